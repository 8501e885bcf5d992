"""Laws judged by the sampled loop of few modes: the poles of its matrix, or its loop function on the unit circle.

damping       least damping ratio of the oscillating poles, those of higher modes left out (see `sampled`)
margin        min 2 |1 + L|/|1 - L|
sensitivity   max |S|, S = 1/(1 + L)
delay         the least further delay [s] that turns L to -1 where |L| = 1: (pi + arg L)/q samples, q its angle
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.law import Law
from tfarm.dsp import Chain
from tfarm.dsp.law_loop import SampledLaw, acting_law, sampled_law, with_estimate
from tfarm.dsp.law_verdict import law_verdict
from tfarm.errors import ConvergenceError
from tfarm.loop.law_stability import law_stability
from tfarm.records import record
from tfarm.reduced.partial_fractions import Matrices
from tfarm.reduced.sensed import closed, sensed_model
from tfarm.synthesis.sampled import RESERVE, SEARCHED, circle_angles, disk_of, first_damping, higher_poles, lowest

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

LAW_OBJECTIVES = ("damping", "margin", "sensitivity", "delay")
LOST = 1e3  # score of a loop that is not stable, and more the further its poles are outside
ON_AXIS = 1e-6  # of |s|: an eigenvalue so little right of the axis may be the model's own, of modes left out
LONGEST = 100.0  # samples: the delay margin where |L| is nowhere 1


@dataclass(frozen=True)
@record
class LawJudge:
    """What laws on the signals of `loop` are worth in the sampled loop of its modes."""

    arm: Arm
    chain: Chain
    loop: SampledLaw
    objective: str
    modes: int

    def loop_of(self, law: Law) -> SampledLaw:
        """The loop of a law on these signals."""
        acting, late = acting_law(self.arm, law, self.chain)
        return SampledLaw(self.loop.sensed, late, with_estimate(acting, late), law)

    def score(self, law: Law) -> float:
        """What is minimised; `LOST` and more where the loop is not stable, with `RESERVE` too."""
        acting = with_estimate(acting_law(self.arm, law, self.chain)[0], self.chain)
        A, B, C, D = acting.matrices()
        shares = (1.0, 1 / SEARCHED, SEARCHED)
        poles = [np.linalg.eigvals(closed(self._held, (A, B, share * C, share * D))) for share in shares]
        outside = max(float(abs(z).max()) for z in poles) - 1.0
        if outside >= 0.0:
            return LOST * (1.0 + min(outside, 1e6))
        s = np.linalg.eigvals(closed(self._continuous, law.matrices()))
        if (grows := float((s.real / np.maximum(abs(s), 1e-300)).max())) > ON_AXIS:  # without a clock it does not hold
            return LOST * (1.0 + grows)
        if self.objective == "damping":
            return -float(first_damping(poles[0][None].astype(complex), self._higher)[0])
        value = self._on_circle(acting)
        return value if self.objective == "sensitivity" else -value

    def value(self, law: Law) -> float:
        """The objective of one law, between the points of the circle too."""
        loop = self.loop_of(law)
        if self.objective == "damping":
            return float(first_damping(loop.eigenvalues[None], self._higher)[0])
        if self.objective == "delay":
            return self._on_circle(loop.law)
        of = disk_of if self.objective == "margin" else _distance
        least = lowest(lambda q: of(_loop_function(loop.law, q, loop.pulse(np.exp(1j * q)))), self._angles)
        return least if self.objective == "margin" else 1 / least

    def holds(self, law: Law) -> bool:
        """Whether the loop is stable with as many modes as it takes, also with the reserve, and without a clock."""
        try:
            return law_stability(self.arm, law).is_stable and all(
                law_verdict(self.arm, law.times(share), self.chain).is_stable for share in (1.0, 1 / RESERVE, RESERVE)
            )
        except ConvergenceError:
            return False

    @cached_property
    def _higher(self) -> list[complex]:
        return higher_poles(self.loop.pulse, self.modes)

    @cached_property
    def _held(self) -> tuple[Real, Real, Real, Real]:
        """The plant under a hold, without integrals of the input that it does not feel; a law holds the angle."""
        A, B, C = self.loop.pulse.matrices()
        first = 2 * self.loop.pulse.kept()[0].size + self.loop.pulse.kept()[1].size
        felt = self.arm.has_rigid_mode
        gone = [first, *([] if felt else [first + 1])] if self.loop.is_damped or not felt else []
        A, B, C = np.delete(np.delete(A, gone, 0), gone, 1), np.delete(B, gone), np.delete(C, gone, 1)
        return A, B[:, None], C, np.zeros((len(C), 1))

    @cached_property
    def _continuous(self) -> Matrices:
        """The modal model without a clock."""
        return sensed_model(self.arm, self.loop.asked.signals, self.loop.plant.count)

    @cached_property
    def _angles(self) -> Real:
        return circle_angles(self.loop.pulse)

    @cached_property
    def _plant(self) -> Complex:
        return self.loop.pulse(np.exp(1j * self._angles))

    def _on_circle(self, law: Law) -> float:
        """Disk margin, largest |S| or delay margin [s] of a law in z, by the points of a grid."""
        L = _loop_function(law, self._angles, self._plant)
        if self.objective == "margin":
            return float(disk_of(L).min())
        if self.objective == "sensitivity":
            return float(1 / _distance(L).min())
        return self.chain.sampling.period * _delay(self._angles, L)


def _loop_function(law: Law, q: Real, plant: Complex) -> Complex:
    """L at e^{iq} (n,), of the plant (signals, n) there."""
    return np.asarray((law.values(np.exp(1j * q)) * plant).sum(axis=0))


def _distance(L: Complex) -> Real:
    """|1 + L| = 1/|S|."""
    return np.asarray(abs(1 + L))


def _delay(q: Real, L: Complex) -> float:
    """The least delay in samples at the points where |L| passes 1, between two points along straight lines."""
    size, turn = np.log(np.maximum(abs(L), 1e-300)), np.mod(np.pi + np.unwrap(np.angle(L)), 2 * np.pi)
    (at,) = np.nonzero(size[1:] * size[:-1] <= 0)
    if not at.size:
        return LONGEST
    share = size[at] / np.where(size[at] == size[at + 1], 1.0, size[at] - size[at + 1])
    step = np.mod(turn[at + 1] - turn[at] + np.pi, 2 * np.pi) - np.pi
    angle, left = q[at] + share * (q[at + 1] - q[at]), np.mod(turn[at] + share * step, 2 * np.pi)
    return min(LONGEST, float((left / angle).min()))


def law_judge(arm: Arm, chain: Chain, law: Law, objective: str, modes: int, count: int) -> LawJudge:
    """The judge of laws on the signals of one, with `count` flexible modes."""
    return LawJudge(arm, chain, sampled_law(arm, law, chain, count=count), objective, modes)
