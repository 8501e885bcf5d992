"""What a law is worth: each objective as the largest of smooth values that is to be small, with their slopes.

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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from tfarm.arm import AnyLaw
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.records import record
from tfarm.synthesis.models import Model, damping_slopes
from tfarm.synthesis.slews import Slews
from tfarm.synthesis.structures import Entry

REAL_ANGLE = 1e-9  # rad, of ln z or s: a pole at a smaller angle is real
AS_NEAR = 4.0  # of the least distance to an open-loop pole: as far off a pole may be its own too
PEAKS_SEEN = 12  # highest places of a curve that count: by hand
LONGEST_MARGIN = 100.0  # samples, or s: the delay margin where |L| is nowhere 1
DIPS_REFINED = 5  # lowest points of the grid that are refined
TIE = 1e-3  # weight of the damping ratio in a disk margin: without sampling rate feedback alone has margin 2


@dataclass(frozen=True)
@record
class Reading:
    """Laws in a model: their `entries`, poles (laws, n), and of one law its poles' slopes and stepped entries."""

    model: Model
    slews: Slews
    entries: Sequence[Entry]
    poles: Complex
    moves: Complex
    stepped: Sequence[Entry]

    @cached_property
    def loop(self) -> Complex:
        """L (laws, m) on the model's grid."""
        return self.model.loop(self.entries)

    def loop_moves(self, at: NDArray[np.int64]) -> Complex:
        """dL/dx (places, coefficients) of one law."""
        return self.model.loop_slopes(self.entries, self.stepped, at)


class Sloped(NamedTuple):
    """Values (laws, m), -inf where there is none, and the slopes (places, coefficients) of those of the first law."""

    values: Real
    slopes: Callable[[NDArray[np.int64]], Real]

    def first(self, most: int) -> tuple[Real, Real]:
        """The highest values of the first law and their slopes."""
        row = self.values[0]
        at = np.argsort(-row, kind="stable")[:most]
        at = at[np.isfinite(row[at])]
        return row[at], self.slopes(at)


@dataclass(frozen=True)
@record
class Objective:
    """`pieces` of a reading, and the `value` of a law by a judge; whether that is the negated score, and of a slew."""

    pieces: Callable[[Reading], Sloped]
    value: Callable[[Any, AnyLaw], float]
    is_negated: bool = False
    of_slew: bool = False

    def worst(self, values: Sequence[float]) -> float:
        """The worst of its values."""
        return min(values) if self.is_negated else max(values)


def damping(now: Reading) -> Sloped:
    """-zeta of the oscillating poles that count; where a law has none, -1."""
    model, s = now.model, now.model.in_s(now.poles)
    values, counted = _damped(model, now.poles)

    def slopes(at: NDArray[np.int64]) -> Real:
        moves = now.moves[at] if model.period is None else now.moves[at] / now.poles[0, at, None]
        return np.where(counted[0, at, None], damping_slopes(s[0, at], moves), 0.0)

    return Sloped(values, slopes)


def _damped(model: Model, poles: Complex) -> tuple[Real, NDArray[np.bool_]]:
    """-zeta (laws, n) of poles, -inf of those that do not count; which of them do."""
    s = model.in_s(poles)
    counted = of_first_modes(poles, model.higher) if model.higher else poles.imag >= 0
    counted &= (np.angle(poles) > REAL_ANGLE) & (poles != 0) & (s.imag < model.band)
    values = np.where(counted, s.real / np.maximum(abs(s), LEAST_SIZE), -np.inf)
    values[~counted.any(axis=1), 0] = -1.0
    return values, counted


def least_damping(model: Model, entries: Sequence[Entry]) -> Real:
    """The least damping ratio (laws,) that counts, of stable laws and others: 1 where no pole oscillates."""
    return -_damped(model, model.poles(entries))[0].max(axis=1)


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


def peaks(now: Reading, values: Real, by_loop: Callable[[NDArray[np.int64]], Complex]) -> Sloped:
    """The local maxima of values (laws, m) along the grid; `by_loop` is df/dL at places of the first law."""
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    high = (values >= padded[:, :-2]) & (values >= padded[:, 2:])

    def slopes(at: NDArray[np.int64]) -> Real:
        return np.asarray((by_loop(at)[:, None] * now.loop_moves(at)).real)

    return Sloped(np.where(high, values, -np.inf), slopes)


def sensitivity(now: Reading) -> Sloped:
    """|S| at its peaks; in continuous time at least 1, as L -> 0 beyond the grid."""
    apart = 1.0 + now.loop
    least = 0.0 if now.model.period is not None else 1.0
    f = np.maximum(1 / np.maximum(abs(apart), LEAST_SIZE), least)
    by_loop = np.where(f[0] > least, -(f[0] ** 2) * apart[0].conj() / np.maximum(abs(apart[0]), LEAST_SIZE), 0.0)
    return peaks(now, f, lambda at: by_loop[at])


def margin(now: Reading) -> Sloped:
    """-(disk margin + TIE zeta): of each dip of the disk and each pole, so that the largest is of both the least."""
    L, tied = now.loop, damping(now)
    f = -disk_of(L)
    dips = peaks(now, f, lambda at: f[0, at] * (1 / (1.0 + L[0, at]) + 1 / (1.0 - L[0, at])))
    if not now.stepped:
        return Sloped((f.max(axis=1) + TIE * tied.values.max(axis=1))[:, None], dips.slopes)
    (own, d_own), (more, d_more) = dips.first(PEAKS_SEEN), tied.first(PEAKS_SEEN)
    values = own[:, None] + TIE * more
    slopes = (d_own[:, None] + TIE * d_more).reshape(values.size, -1)
    return Sloped(values.reshape(1, -1), lambda at: slopes[at])


def delay(now: Reading) -> Sloped:
    """-delay [s] where |L| passes 1, between two points along straight lines."""
    q, L, unit = now.model.angles, now.loop, now.model.period or 1.0
    size, turn = np.log(np.maximum(abs(L), LEAST_SIZE)), np.mod(np.pi + np.unwrap(np.angle(L)), 2 * np.pi)
    passes = (size[:, 1:] * size[:, :-1] <= 0) & (size[:, 1:] != size[:, :-1])
    gap = np.where(passes, size[:, :-1] - size[:, 1:], 1.0)
    share = size[:, :-1] / gap
    step = np.mod(turn[:, 1:] - turn[:, :-1] + np.pi, 2 * np.pi) - np.pi
    angle, left = q[:-1] + share * np.diff(q), np.mod(turn[:, :-1] + share * step, 2 * np.pi)
    late = np.where(passes, left, LONGEST_MARGIN) / np.where(passes, angle, 1.0)
    values = np.where(passes, -unit * np.minimum(late, LONGEST_MARGIN), -np.inf)
    values[~passes.any(axis=1), 0] = -LONGEST_MARGIN * unit

    def slopes(at: NDArray[np.int64]) -> Real:
        ends = [now.loop_moves(at + k) / L[0, at + k, None] for k in (0, 1)]  # d ln L
        d_share = (ends[0].real - share[0, at, None] * (ends[0] - ends[1]).real) / gap[0, at, None]
        d_angle = d_share * (q[at + 1] - q[at])[:, None]
        own = share[0, at, None]
        d_left = ends[0].imag + d_share * step[0, at, None] + own * (ends[1] - ends[0]).imag
        d_late = (d_left - late[0, at, None] * d_angle) / angle[0, at, None]
        return -unit * np.where((values[0, at] > -LONGEST_MARGIN * unit)[:, None], d_late, 0.0)

    return Sloped(values, slopes)


def residual(now: Reading) -> Sloped:
    """What a slew leaves [N m]."""
    return _slewed(now, now.slews.residual)


def cost(now: Reading) -> Sloped:
    """What a slew costs."""
    return _slewed(now, now.slews.cost)


def _slewed(now: Reading, of: Callable[[Sequence[Entry]], tuple[Real, Real]]) -> Sloped:
    """A value (laws, 1) of a simulated slew; its slope is that of the same run with stepped coefficients."""
    value, _ = of(now.entries)
    return Sloped(value[:, None], lambda at: of(now.stepped)[1][None][0 * at])


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
    "damping": Objective(damping, lambda judge, law: judge.exact_damping(law), is_negated=True),
    "margin": Objective(margin, lambda judge, law: judge.lowest(law, disk_of), is_negated=True),
    "sensitivity": Objective(sensitivity, lambda judge, law: judge.peak(law)),
    "delay": Objective(delay, lambda judge, law: -judge.score(law), is_negated=True),
    "residual": Objective(residual, lambda judge, law: judge.simulated_residual(law), of_slew=True),
    "cost": Objective(cost, lambda judge, law: judge.score(law), of_slew=True),
}
