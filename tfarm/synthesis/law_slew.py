"""What a slew leaves behind under a law, and what it costs, in the sampled loop of few modes; with their slopes.

    x_{k+1} = A x_k + b (r_k + C(z) references)      A that of the closed loop, r the feed-forward

A change dC of the law adds -dC(z) (signals - references) to the input: what the closed loop makes of that is the change
of the moment and of the input.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tfarm.arm import Arm, Law
from tfarm.arm.blocks import Matrices
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.dsp import Chain, Scenario
from tfarm.dsp.chain import TIME_ROUNDING
from tfarm.dsp.law_loop import acting_law
from tfarm.dsp.law_simulate import references_of
from tfarm.dsp.scenarios import TRIAL_COST
from tfarm.records import record
from tfarm.reduced.sensed import closed
from tfarm.synthesis.law_slopes import Clock
from tfarm.synthesis.sampled import slew_and_after, slew_cost, slew_errors, trial_slew
from tfarm.synthesis.structures import Slope

SLEWED = ("residual", "cost")  # the objectives of a slew


@dataclass(frozen=True)
@record
class LawSlew:
    """The slew of an arm under laws that read `signals` of a `held` plant; it is made for the arm `known`.

    `last` is the state that keeps the input of the sample before.
    """

    arm: Arm
    known: Arm
    chain: Chain
    held: Matrices
    signals: tuple[str, ...]
    last: int
    clock: Clock

    def pieces(self, objective: str, law: Law, acting: Law, slopes: Sequence[Slope]) -> tuple[Real, Real]:
        """Residual [N m] or cost of a law, (1,), and its slopes (1, n)."""
        from scipy.signal import dlsim  # here, because it takes half a second to load

        task = self._tasks[SLEWED.index(objective)]
        plain = acting_law(self.arm, law, self.chain)[0]
        references = references_of(plain, task)
        A = closed(self.held, acting.matrices(self.signals))
        _, driven, *_ = dlsim((*plain.matrices(), 1.0), references)  # 1: counted in samples
        x, moment, u = self._run(A, task.feedforward[:, None] + driven)
        change = self._change(x[..., 0], dict(zip(plain.signals, references.T, strict=True)), slopes)
        _, d_moment, d_u = self._run(A, change)
        if objective == "residual":
            after = task.t >= task.busy_until * (1 - TIME_ROUNDING)
            value = np.sqrt((moment[after] ** 2).mean(axis=0))
            return value, (moment[after] * d_moment[after]).mean(axis=0)[None] / np.maximum(value, LEAST_SIZE)
        (a, b), (off, added) = (weight * task.period for weight in TRIAL_COST), slew_errors(task, self.chain, moment, u)
        value = slew_cost(task, self.chain, moment, u)
        return value, (a * off * d_moment + b * added * d_u).sum(axis=0)[None]

    @cached_property
    def _tasks(self) -> tuple[Scenario, Scenario]:
        """The slew with what follows it, and that of the tuner's trials."""
        return slew_and_after(self.arm, self.known, self.chain), trial_slew(self.known, self.chain)

    def _run(self, A: Real, inputs: Real) -> tuple[Real, Real, Real]:
        """States (samples, states, n), root moment and input (samples, n), for inputs (samples, n) from rest."""
        _, B, C, _ = self.held
        x = np.zeros((len(inputs) + 1, len(A), inputs.shape[1]))
        push = np.r_[B[:, 0], np.zeros(len(A) - len(B))][:, None]
        for k, row in enumerate(inputs):
            x[k + 1] = A @ x[k] + push * row
        moment = np.tensordot(x[:-1, : len(B)], C[self.signals.index("root_moment")], (1, 0))
        return x, moment, x[1:, self.last]

    def _change(self, x: Real, references: dict[str, Real], slopes: Sequence[Slope]) -> Real:
        """-sum over entries of dC_i/dx_j (signal - reference): (samples, coefficients)."""
        from scipy.signal import bilinear, lfilter

        _, B, C, _ = self.held
        seen = dict(zip(self.signals, (x[:-1, : len(B)] @ C.T).T, strict=True))
        T, total = self.chain.sampling.period, np.zeros((len(x) - 1, len(slopes[0].num) if slopes else 0))
        for entry, num, den in slopes:
            signal = seen[entry.signal] if entry.signal in seen else self._rate(seen["hub_angle"])
            off = signal - references[entry.signal]
            for j, (a, b) in enumerate(zip(num, den, strict=True)):
                top = np.polysub(np.polymul(a, entry.den), np.polymul(entry.num, b))
                if top.any():
                    total[:, j] -= lfilter(*bilinear(top, np.polymul(entry.den, entry.den), 1 / T), off)
        return total

    def _rate(self, angle: Real) -> Real:
        """The rate as the difference of the angle, filtered."""
        from scipy.signal import lfilter

        a, T = self.clock.estimate or 0.0, self.chain.sampling.period
        return np.asarray(lfilter([(1 - a) / T, -(1 - a) / T], [1.0, -a], angle))
