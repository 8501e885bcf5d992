"""What a law is worth: each objective as a score that is to be small.

damping       least damping ratio of the oscillating poles of the first modes
margin        disk margin min 2 |1 + L|/|1 - L|; of nearly equal ones that with more damping
sensitivity   max |S|, S = 1/(1 + L)
delay         least further delay [s] that turns L to -1 where |L| = 1: (pi + arg L)/w
residual      root mean square of the arm's own root moment less the rigid arm's, over a period of the first mode after
              the slew
cost          T sum of (a x^2 + b e^2)/2 over a slew, the tuner's: x as the controller reads it, e what is added

Where two poles are about as near to that of a higher mode, the one that has decayed more is taken for it, so that no
damping is claimed that is not there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from tfarm.arm import AnyLaw
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.records import record
from tfarm.synthesis.models import Model
from tfarm.synthesis.slews import Slews
from tfarm.synthesis.structures import Entry

REAL_ANGLE = 1e-9  # rad, of ln z or s: a pole at a smaller angle is real
AS_NEAR = 4.0  # of the least distance to an open-loop pole: as far off a pole may be its own too
LONGEST_MARGIN = 100.0  # samples, or s: the delay margin where |L| is nowhere 1
DIPS_REFINED = 5  # lowest points of the grid that are refined
TIE = 1e-3  # weight of the damping ratio in a disk margin: without sampling rate feedback alone has margin 2


@dataclass(frozen=True)
@record
class Reading:
    """Laws in a model: their `entries` and closed-loop poles (laws, n)."""

    model: Model
    slews: Slews
    entries: Sequence[Entry]
    poles: Complex

    @cached_property
    def loop(self) -> Complex:
        """L (laws, m) on the model's grid."""
        return self.model.loop(self.entries)


@dataclass(frozen=True)
@record
class Objective:
    """Its `scores` (laws,), small where laws are good, and the `value` of one law by a judge.

    `is_negated`: whether the value is the negated score; `of_slew`: whether it is of a slew.
    """

    scores: Callable[[Reading], Real]
    value: Callable[[Any, AnyLaw], float]
    is_negated: bool = False
    of_slew: bool = False

    def worst(self, values: Sequence[float]) -> float:
        """The worst of its values."""
        return min(values) if self.is_negated else max(values)


def damping_of(model: Model, poles: Complex) -> Real:
    """The least damping ratio (laws,) of the oscillating poles (laws, n) that count; 1 where a law has none."""
    s = model.in_s(poles)
    counted = of_first_modes(poles, model.higher) if model.higher else poles.imag >= 0
    counted &= (np.angle(poles) > REAL_ANGLE) & (poles != 0) & (s.imag < model.band)
    return np.where(counted, -s.real / np.maximum(abs(s), LEAST_SIZE), 1.0).min(axis=1, initial=1.0)


def least_damping(model: Model, entries: Sequence[Entry]) -> Real:
    """The least damping ratio (laws,) that counts, of stable laws and others: 1 where no pole oscillates."""
    return damping_of(model, model.poles(entries))


def of_first_modes(z: Complex, higher: Sequence[complex]) -> NDArray[np.bool_]:
    """Which poles (laws, n) are none of a higher mode: one of each pair, those about the `higher` ones left out."""
    left, rows = z.imag >= 0, np.arange(len(z))
    for own in higher:
        gap = np.where(left, abs(z - own), np.inf)
        near = left & (gap <= AS_NEAR * gap.min(axis=1, keepdims=True))
        left[rows, np.where(near, abs(z), np.inf).argmin(axis=1)] = False
    return np.asarray(left)


def disk_of(L: Complex) -> Real:
    """2 |1 + L|/|1 - L|."""
    return np.asarray(2 * abs(1 + L) / np.maximum(abs(1 - L), LEAST_SIZE))


def sensitivity(now: Reading) -> Real:
    """The largest |S|; in continuous time at least 1, as L -> 0 beyond the grid."""
    least = 0.0 if now.model.period is not None else 1.0
    return np.maximum(1 / np.maximum(abs(1 + now.loop).min(axis=1), LEAST_SIZE), least)


def delay(now: Reading) -> Real:
    """-delay [s] where |L| passes 1, between two points along straight lines."""
    q, L, unit = now.model.angles, now.loop, now.model.period or 1.0
    size, turn = np.log(np.maximum(abs(L), LEAST_SIZE)), np.mod(np.pi + np.unwrap(np.angle(L)), 2 * np.pi)
    passes = (size[:, 1:] * size[:, :-1] <= 0) & (size[:, 1:] != size[:, :-1])
    share = size[:, :-1] / np.where(passes, size[:, :-1] - size[:, 1:], 1.0)
    step = np.mod(turn[:, 1:] - turn[:, :-1] + np.pi, 2 * np.pi) - np.pi
    late = np.mod(turn[:, :-1] + share * step, 2 * np.pi) / (q[:-1] + share * np.diff(q))
    return -unit * np.where(passes, late, LONGEST_MARGIN).min(axis=1, initial=LONGEST_MARGIN)


# ------------------------------------------------------------ values of one law


def lowest(model: Model, law: Sequence[Entry], of: Callable[[Complex], Real]) -> float:
    """The least of a function of L on the grid, its lowest dips refined between the points."""
    q, found = model.angles, of(model.loop(law)[0])
    best = [float(found.min())]
    for i in np.argsort(found)[:DIPS_REFINED]:
        ends = (q[max(i - 1, 0)], q[min(i + 1, q.size - 1)])
        done = minimize_scalar(
            lambda at: float(of(model.loop(law, np.array([at]))[0])[0]),
            bounds=ends, method="bounded", options={"xatol": 1e-9 * (ends[1] - ends[0])},
        )  # fmt: skip
        best.append(float(done.fun))
    return min(best)


OBJECTIVES = {
    "damping": Objective(
        lambda now: -damping_of(now.model, now.poles), lambda judge, law: judge.exact_damping(law), is_negated=True
    ),
    "margin": Objective(
        lambda now: -(disk_of(now.loop).min(axis=1) + TIE * damping_of(now.model, now.poles)),
        lambda judge, law: judge.lowest(law, disk_of),
        is_negated=True,
    ),
    "sensitivity": Objective(sensitivity, lambda judge, law: judge.peak(law)),
    "delay": Objective(delay, lambda judge, law: -judge.score(law), is_negated=True),
    "residual": Objective(
        lambda now: now.slews.residual(now.entries), lambda judge, law: judge.simulated_residual(law), of_slew=True
    ),
    "cost": Objective(lambda now: now.slews.cost(now.entries), lambda judge, law: judge.score(law), of_slew=True),
}
