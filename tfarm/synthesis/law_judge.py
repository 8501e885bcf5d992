"""Laws judged by the sampled loop of few modes, with the slopes of what they are worth by their coefficients.

damping       least damping ratio of the oscillating poles, those of higher modes left out (see `sampled`)
margin        min 2 |1 + L|/|1 - L|
sensitivity   max |S|, S = 1/(1 + L)
delay         the least further delay [s] that turns L to -1 where |L| = 1: (pi + arg L)/q samples, q its angle
residual      root mean square of the arm's own root moment less the rigid arm's, at the samples after the slew
cost          T sum of (a x^2 + b e^2)/2 over a slew, the tuner's: x as the controller reads it, e what is added
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices, Rational
from tfarm.arm.law import Law, Part
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import Chain
from tfarm.dsp.discretise import acting_law, with_estimate
from tfarm.dsp.sampled import Sampled, sampled_loop
from tfarm.dsp.verdict import sampled_verdict
from tfarm.errors import ConvergenceError
from tfarm.loop.stability import stability
from tfarm.records import record
from tfarm.reduced.sensed import sensed_model
from tfarm.synthesis.law_slew import SLEWED, LawSlew
from tfarm.synthesis.law_slopes import Clock, pole_slopes
from tfarm.synthesis.minimax import Pieces
from tfarm.synthesis.pieces import LoopCurve, damping_pieces, directions, growth_pieces
from tfarm.synthesis.sampled import (
    RESERVE,
    SEARCH_RESERVE,
    circle_angles,
    disk_of,
    higher_poles,
    lowest_on_circle,
    of_first_modes,
    simulated_residual,
)
from tfarm.synthesis.structures import Slope

LAW_OBJECTIVES = ("damping", "margin", "sensitivity", "delay", "residual", "cost")
GROWTH_OF_MODEL = 1e-6  # of |s|: an eigenvalue so little right of the axis may be the model's own, of modes left out


@dataclass(frozen=True)
@record
class LawJudge:
    """What laws on the signals of `loop` are worth in the sampled loop of its modes; slews are made for `known`."""

    arm: Arm
    chain: Chain
    loop: Sampled
    objective: str
    modes: int
    known: Arm

    def score(self, law: Law) -> float:
        """What is minimised; `LOST` and more where the loop is not stable, with `RESERVE` too."""
        return self.pieces(law, ()).score

    def pieces(self, law: Law, slopes: Sequence[Slope]) -> Pieces:
        """What the score is the largest of, with its slopes: growth of poles, and the objective's own."""
        acting = self._acting(law)
        A, B, C, D = acting.matrices(self._signals)
        growth = []
        for share in (1.0, 1 / SEARCH_RESERVE, SEARCH_RESERVE):
            z, moves = pole_slopes(self._held, (A, B, share * C, share * D), slopes, share, self._signals, self._clock)
            growth.append(
                growth_pieces(np.log(np.maximum(abs(z), LEAST_SIZE)), (moves / np.where(z == 0, 1.0, z)[:, None]).real)
            )
            if share == 1.0:
                poles, ways = z, moves
        asked = self.loop.law.signals
        real, turn = directions(*pole_slopes(self._continuous, law.matrices(asked), slopes, 1.0, asked, Clock(None)))
        growth.append(growth_pieces(real - GROWTH_OF_MODEL, turn))
        g, dg = (np.concatenate(each) for each in zip(*growth, strict=True))
        if g.max() >= 0.0:
            return Pieces(np.zeros(1), np.zeros((1, dg.shape[1])), g, dg)
        if self.objective == "damping":
            first = of_first_modes(poles[None], self._higher)[0]
            return Pieces(*damping_pieces(poles, ways, first), g, dg)
        if self.objective in SLEWED:
            return Pieces(*self._slew.pieces(self.objective, law, acting, slopes), g, dg)
        return Pieces(*self._curve.pieces(self.objective, acting, slopes), g, dg)

    def value(self, law: Law) -> float:
        """The objective of one law, between the points of the circle too; a residual as `tfarm simulate` finds it."""
        if self.objective == "residual":
            return simulated_residual(self.arm, law, self.chain, self.known)
        if self.objective not in ("margin", "sensitivity"):
            score = self.score(law)
            return score if self.objective == "cost" else -score
        acting = self._acting(law)
        of: Callable[[Complex], Real] = disk_of if self.objective == "margin" else lambda L: np.asarray(abs(1 + L))
        angles = np.asarray(self._curve.places.imag, dtype=float)
        least = lowest_on_circle(lambda q: of(self._loop_function(acting, q)), angles)
        return least if self.objective == "margin" else 1 / least

    def holds(self, law: Law) -> bool:
        """Whether the loop is stable with as many modes as it takes, also with the reserve, and without a clock."""
        try:
            return stability(self.arm, law).is_stable and all(
                sampled_verdict(self.arm, law.times(share), self.chain).is_stable
                for share in (1.0, 1 / RESERVE, RESERVE)
            )
        except ConvergenceError:
            return False

    def _acting(self, law: Law) -> Law:
        """What the computer makes of a law in z, of the signals that it has."""
        return with_estimate(acting_law(self.arm, law, self.chain)[0], self.chain)

    @property
    def _signals(self) -> tuple[str, ...]:
        return self.loop.in_z.signals

    @cached_property
    def _clock(self) -> Clock:
        chain = self.chain
        by_difference = chain.converters.hub_rate == "difference"
        T = chain.sampling.period
        return Clock(T, float(np.exp(-chain.converters.rate_filter * T)) if by_difference else None)

    @cached_property
    def _higher(self) -> list[complex]:
        return higher_poles(self.loop.pulse, self.modes)

    @cached_property
    def _gone(self) -> list[int]:
        """States that are integrals of the input which the plant does not feel: a law holds the angle."""
        first, felt = self.loop.pulse.integrals_at, self.arm.has_rigid_mode
        return [first, *([] if felt else [first + 1])] if self.loop.is_damped or not felt else []

    @cached_property
    def _held(self) -> Matrices:
        """The plant under a hold."""
        A, B, C = self.loop.pulse.matrices()
        A, B, C = (
            np.delete(np.delete(A, self._gone, 0), self._gone, 1),
            np.delete(B, self._gone),
            np.delete(C, self._gone, 1),
        )
        return A, B[:, None], C, np.zeros((len(C), 1))

    @cached_property
    def _continuous(self) -> Matrices:
        """The modal model without a clock."""
        return sensed_model(self.arm, self.loop.law.signals, self.loop.plant.count)

    @cached_property
    def _curve(self) -> LoopCurve:
        """The circle, as i times its angles."""
        q = circle_angles(self.loop.pulse)
        z = np.exp(1j * q)
        return LoopCurve(1j * q, z, self.loop.pulse(z), self._signals, self._clock, self.chain.sampling.period)

    @cached_property
    def _slew(self) -> LawSlew:
        last = self.loop.pulse.integrals_at + 2 - len(self._gone)
        own = np.delete(self.loop.own_moment, self._gone)
        return LawSlew(self.arm, self.known, self.chain, self._held, self._signals, last, own, self._clock)

    def _loop_function(self, acting: Law, q: Real) -> Complex:
        z = np.exp(1j * q)
        return replace(self._curve, places=1j * q, points=z, plant=self.loop.pulse(z)).loop_function(acting)


def law_judge(
    arm: Arm, chain: Chain, law: Law, objective: str, modes: int, count: int, known: Arm | None = None
) -> LawJudge:
    """The judge of laws on the signals of one, with `count` flexible modes; slews are made for `known`, or the arm.

    A law that does not read the root moment reads it with a gain of 0 where that is what counts.
    """
    if objective in SLEWED and "root_moment" not in law.signals:
        law = replace(law, parts=(*law.parts, Part(("root_moment",), Rational((0.0,)))))
    return LawJudge(arm, chain, sampled_loop(arm, law, chain, count=count), objective, modes, known or arm)
