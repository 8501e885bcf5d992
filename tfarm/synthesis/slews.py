"""What a slew leaves behind under laws, and what it costs, in a loop of few modes; many laws at once.

    x_{k+1} = A x_k + G (r_k + D_k ref_k) + E ref_k,   w = (r + D_k (ref - C x) - C_k x_k)/(1 + D_k D)

A that of the closed loop, r the feed-forward, w the input, D_k what a law passes at once.  In continuous time the
reference is a state of its own: its angle, rate and acceleration, constant over each half of the slew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.dsp import Chain, Scenario, scenario
from tfarm.dsp.scenarios import TRIAL_SLEWS, trial_weights
from tfarm.records import record
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.models import Model
from tfarm.synthesis.structures import Entry

SAMPLES_LEFT = 16  # of the record after the slew, where a period of the first mode has fewer
TAYLOR_REACH, TAYLOR_TERMS = 0.25, 10  # size of a matrix, and terms of its series: 0.25^11/11! is 6e-15
PERIOD_POINTS = 64  # of the period after the slew, in continuous time


def slew_and_after(arm: Arm, known: Arm, chain: Chain) -> Scenario:
    """The slew made for the arm `known`, and a period of the first mode of the one that moves."""
    left = max(2 * np.pi / first_frequency(arm), SAMPLES_LEFT * chain.sampling.period)
    return scenario("slew", known, chain, chain.slew.rise_time + left)


def trial_slew(known: Arm, chain: Chain) -> Scenario:
    """The slew of the tuner's trials, made for the arm `known`."""
    return scenario("slew", known, chain, TRIAL_SLEWS * chain.slew.rise_time)


def exponential(matrices: Real) -> Real:
    """e^M of matrices (laws, n, n): a Taylor series of M/2^k, squared k times.

    As SciPy's to some 1e-10, but for all at once.
    """
    size = float(abs(matrices).sum(axis=2).max(initial=0.0))
    halvings = max(0, int(np.ceil(np.log2(max(size, LEAST_SIZE) / TAYLOR_REACH))))
    small, unit = matrices / 2.0**halvings, np.eye(matrices.shape[1])
    found = np.broadcast_to(unit, matrices.shape)
    for n in range(TAYLOR_TERMS, 0, -1):
        found = unit + small @ found / n
    for _ in range(halvings):
        found = found @ found
    return np.asarray(found)


@dataclass(frozen=True)
@record
class Slews:
    """Slews of an arm in a model; they are made for the arm `known`."""

    model: Model
    arm: Arm
    known: Arm
    chain: Chain

    def residual(self, entries: Sequence[Entry]) -> Real:
        """Root mean square [N m] of the arm's own moment less the rigid arm's (laws,)."""
        left = self._left_in_time(entries) if self.model.period is None else self._left_at_samples(entries)
        return np.sqrt((left**2).mean(axis=0))

    def cost(self, entries: Sequence[Entry]) -> Real:
        """T sum of (a x^2 + b e^2)/2 (laws,)."""
        task, (a, b) = self._trial, trial_weights(self.known, self.chain)
        sense = self.model.plant[2][self.model.signals.index("root_moment")]
        moment, u = self._run(task, entries, sense)
        off = moment - task.moment_reference[:, None]
        added = u - (self.chain.slew.reading == "vibration") * task.feedforward[:, None]
        return task.period * (a * off**2 + b * added**2).sum(axis=0) / 2

    @cached_property
    def _slew(self) -> Scenario:
        return slew_and_after(self.arm, self.known, self.chain)

    @cached_property
    def _trial(self) -> Scenario:
        return trial_slew(self.known, self.chain)

    # ------------------------------------------------------------ at samples

    def _left_at_samples(self, entries: Sequence[Entry]) -> Real:
        moment, _ = self._run(self._slew, entries, self.model.own_moment)
        return np.asarray((moment.T - self._slew.rigid_moment).T[self._slew.is_after])

    def _run(self, task: Scenario, entries: Sequence[Entry], sense: Real) -> tuple[Real, Real]:
        """A root moment, as a row `sense` reads it of the states, and the input at the samples, (samples, laws)."""
        model = self.model
        A, (_, Bk, _, Dk) = model.closed(entries), model.states(entries)
        wanted = {name: task.references[name] for name in model.signals if name in task.references}
        references = np.array([wanted.get(name, 0.0 * task.feedforward) for name in model.signals])
        push = task.feedforward + (Dk[:, 0] @ references)  # (laws, samples)
        n = len(model.plant[0])
        forced = np.zeros((len(task.t), *A.shape[:2], 1))
        forced[:, :, :n, 0] = push.T[:, :, None] * model.plant[1][:, 0]
        forced[:, :, n:, 0] = -np.moveaxis(Bk @ references, 2, 0)
        x, moment = np.zeros((*A.shape[:2], 1)), np.zeros((len(task.t), len(A)))
        u = moment.copy()
        for k, force in enumerate(forced):
            moment[k] = x[:, :n, 0] @ sense
            x = A @ x + force
            u[k] = x[:, model.last, 0]
        return moment, u

    # ------------------------------------------------------------ in continuous time

    def _left_in_time(self, entries: Sequence[Entry]) -> Real:
        """The moment at points of the first mode's period after the slew: there the rigid arm's is 0.

        The moment feedback has no reference here: only angle and rate have.
        """
        model, slew = self.model, self.chain.slew
        A, (_, Bk, Ck, Dk) = model.closed(entries), model.states(entries)
        _, B, C, D = model.plant
        number, n = len(A), len(B)
        states = np.zeros((len(model.signals), 3))  # references of angle, rate, acceleration
        for column, name in enumerate(("hub_angle", "hub_rate")):
            if name in model.signals:
                states[model.signals.index(name), column] = 1.0
        through = 1.0 + Dk @ D
        push = (np.array([0.0, self.known.rate_loss, self.known.turned_inertia]) + Dk @ states) / through
        whole = np.zeros((number, A.shape[1] + 3, A.shape[1] + 3))
        size = A.shape[1]
        whole[:, :size, :size] = A
        whole[:, :n, size:], whole[:, n:size, size:] = B @ push, Bk @ (D @ push) - Bk @ states
        whole[:, size, size + 1] = whole[:, size + 1, size + 2] = 1.0
        half = exponential(whole * slew.rise_time / 2)
        x = np.zeros((number, size + 3, 1))
        peak = slew.acceleration(self.known.reach)
        for acceleration in (peak, -peak):
            x[:, -1] = acceleration
            x = half @ x
        x[:, -2:] = 0.0
        step = exponential(whole * (2 * np.pi / first_frequency(self.arm) / PERIOD_POINTS))
        row, at = model.own_moment, model.signals.index("root_moment")
        passed = D[at, 0] * np.concatenate([-(Dk @ C) / through, -Ck / through, push], axis=2)
        sense = passed + np.r_[row, np.zeros(size + 3 - n)]
        left = np.zeros((PERIOD_POINTS, number))
        for k in range(PERIOD_POINTS):
            left[k] = (sense @ x)[:, 0, 0]
            x = step @ x
        return left
