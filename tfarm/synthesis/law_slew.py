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
from tfarm.arm.blocks import Matrices, Rational
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.dsp import Chain, Scenario
from tfarm.dsp.discretise import acting_law, substituted
from tfarm.dsp.scenarios import trial_weights
from tfarm.dsp.simulate import references_of
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

    `last` is the state that keeps the input of the sample before; `own_moment` reads the arm's own root moment of the
    states, ahead of the anti-alias filter.
    """

    arm: Arm
    known: Arm
    chain: Chain
    held: Matrices
    signals: tuple[str, ...]
    last: int
    own_moment: Real
    clock: Clock

    def pieces(self, objective: str, law: Law, acting: Law, slopes: Sequence[Slope]) -> tuple[Real, Real]:
        """Residual [N m] or cost of a law, (1,), and its slopes (1, n)."""
        from scipy.signal import dlsim  # here, because it takes half a second to load

        task = self._tasks[SLEWED.index(objective)]
        plain = acting_law(self.arm, law, self.chain)[0]
        references = references_of(plain, task)
        A = closed(self.held, acting.matrices(self.signals))
        _, driven, *_ = dlsim((*plain.matrices(), 1.0), references)  # 1: counted in samples
        sense = self.own_moment if objective == "residual" else self.held[2][self.signals.index("root_moment")]
        x, moment, u = self._run(A, task.feedforward[:, None] + driven, sense)
        change = self._change(x[..., 0], dict(zip(plain.signals, references.T, strict=True)), slopes)
        _, d_moment, d_u = self._run(A, change, sense)
        if objective == "residual":
            left = task.residual(moment)
            value = np.sqrt((left**2).mean(axis=0))
            return value, (left * d_moment[task.is_after]).mean(axis=0)[None] / np.maximum(value, LEAST_SIZE)
        (a, b), (off, added) = self._weights, slew_errors(task, self.chain, moment, u)
        value = slew_cost(task, self.chain, (a, b), moment, u)
        return value, task.period * (a * off * d_moment + b * added * d_u).sum(axis=0)[None]

    @cached_property
    def _tasks(self) -> tuple[Scenario, Scenario]:
        """The slew with what follows it, and that of the tuner's trials."""
        return slew_and_after(self.arm, self.known, self.chain), trial_slew(self.known, self.chain)

    @cached_property
    def _weights(self) -> tuple[float, float]:
        return trial_weights(self.known, self.chain)

    def _run(self, A: Real, inputs: Real, sense: Real) -> tuple[Real, Real, Real]:
        """States (samples, states, n), a root moment and input (samples, n), for inputs (samples, n) from rest."""
        B = self.held[1]
        x = np.zeros((len(inputs) + 1, len(A), inputs.shape[1]))
        push = np.r_[B[:, 0], np.zeros(len(A) - len(B))][:, None]
        for k, row in enumerate(inputs):
            x[k + 1] = A @ x[k] + push * row
        moment = np.tensordot(x[:-1, : len(B)], sense, (1, 0))
        return x, moment, x[1:, self.last]

    def _change(self, x: Real, references: dict[str, Real], slopes: Sequence[Slope]) -> Real:
        """-sum over entries of dC_i/dx_j (signal - reference): (samples, coefficients)."""
        from scipy.signal import lfilter

        _, B, C, _ = self.held
        seen = dict(zip(self.signals, (x[:-1, : len(B)] @ C.T).T, strict=True))
        T, total = self.chain.sampling.period, np.zeros((len(x) - 1, len(slopes[0].num) if slopes else 0))
        for entry, num, den in slopes:
            signal = seen[entry.signal] if entry.signal in seen else self._rate(seen["hub_angle"])
            off = signal - references[entry.signal]
            for j, (a, b) in enumerate(zip(num, den, strict=True)):
                top = np.polysub(np.polymul(a, entry.den), np.polymul(entry.num, b))
                if top.any():
                    change = substituted(Rational(tuple(top), tuple(np.polymul(entry.den, entry.den))), 2 / T)
                    late = len(change.den) - len(change.num)  # zeros in front are samples of delay
                    total[:, j] -= lfilter([*[0.0] * late, *change.num], change.den, off)
        return total

    def _rate(self, angle: Real) -> Real:
        """The rate as the difference of the angle, filtered."""
        from scipy.signal import lfilter

        a, T = self.clock.estimate or 0.0, self.chain.sampling.period
        return np.asarray(lfilter([(1 - a) / T, -(1 - a) / T], [1.0, -a], angle))
