"""The locus of a law as it is drawn: round, and without a gap where two of its poles meet on the real axis.

The roots of a pair may be told apart on either side of the value at which they meet, but not at it: there they go with
the square root of the distance.  Half their sum and the square of half their difference are analytic through it.  Both
are integrals of s f'/f and s^2 f'/f around a circle with the two and no other zero of f; where that is 0 they meet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tfarm.arrays import Complex, Real
from tfarm.crossing.turning import loose
from tfarm.errors import ConvergenceError
from tfarm.spectrum.box import Box

from .law_locus import Family, LawLocus, assigned, inside
from .locus import frame

LAW_HALVING_ROUNDS = 18  # of halving at most where a branch bends, or two meet
MEETING_HALVINGS = 7  # halvings of a step until two poles that meet in it are apart from the others
CLEAR_RADIUS = 1.5  # times as far as the two from the middle of a circle around them is any other pole
CIRCLE_POINTS = 128  # of it: integrals err by CLEAR_RADIUS^(-CIRCLE_POINTS/2) at most by the trapezoidal rule, 1e-11
MEETING_KNOWN = 1e-13  # of a value: so closely it is known where two meet
WORTH_HALVING = 1.5  # shortest steps: a wider one is halved; between one and two, as steps are powers of two of them
WHOLE_COUNT = 0.01  # how far an integral that counts zeros may be from their number: far more than it errs by
ABSENT, ON_REAL_AXIS, IN_PAIR = 0, 1, 2  # what a branch is at a value


def rounded_law_locus(found: LawLocus) -> LawLocus:
    """The same locus with values between, until no branch turns by more than 5 degrees as it is drawn.

    Poles between are Newton's, from half way, or where two meet from either side.  A value at which one of them is not
    plainly that of its branch is left out.  Where two meet on the real axis their branches reach that point, and it is
    one of the values; a pole that is on a branch at neither neighbour has one of its own.
    """
    family = Family(found.arm, found.law, found.vary, float(found.values[0]))
    values, rows = _closed(family, found)
    left_out: set[float] = set()
    left, right, low, high = frame(rows)
    for _ in range(LAW_HALVING_ROUNDS):
        bent = np.nonzero(loose(rows, right - left, high - low))[0]
        halves = {n: float(values[n] + values[n + 1]) / 2 for n in bent.tolist()}
        added = {
            n: family.between(middle, 0.5, rows[:, n : n + 2]) for n, middle in halves.items() if middle not in left_out
        }
        left_out |= {halves[n] for n, poles in added.items() if poles is None}
        told = [(n, poles) for n, poles in added.items() if poles is not None]
        if not told:
            break
        places = [n + 1 for n, _ in told]
        values = np.insert(values, places, [halves[n] for n, _ in told])
        rows = np.insert(rows, places, np.array([poles for _, poles in told]).T, axis=1)
    return replace(found, values=values, branches=rows)


def _closed(family: Family, found: LawLocus) -> tuple[Real, Complex]:
    """Values and branches with every meeting on the real axis among them that could be told apart."""
    values, rows = found.values, found.branches.copy()  # a record cannot be written
    n, shortest = 0, abs(np.diff(values)).min() * 2.0**-MEETING_HALVINGS
    while n < values.size - 1:
        gap = _Gap(family, found.box, values[n : n + 2], rows[:, n : n + 2])
        met = gap.met() if gap.is_open else None
        if met is not None and met[0] in values:
            rows[:, n if met[0] == values[n] else n + 1] = met[1]
            n += 1
        elif met is not None:
            values, rows = np.insert(values, n + 1, met[0]), np.insert(rows, n + 1, met[1], axis=1)
            n += 2
        elif gap.is_open and gap.width > WORTH_HALVING * shortest and (half := gap.halved()) is not None:
            values, rows = np.insert(values, n + 1, half[0]), _with(rows, n + 1, *half[1:])
        else:
            n += 1
    return values, rows


def _with(rows: Complex, at: int, before: Complex, after: Complex, new: Complex) -> Complex:
    """The branches with poles between: those that continue each from `before`, those that it continues to `after`.

    A branch of which these are not the same pole was none: it is cut there.  Each of `new` is a branch of its own.
    """
    cut = np.isfinite(rows[:, at - 1 : at + 1]).all(axis=1) & (before != after)
    rows = np.insert(rows, at, np.where(np.isnan(before), after, before), axis=1)
    rest = np.full((cut.sum() + new.size, rows.shape[1]), np.nan, complex)
    rest[: cut.sum(), at + 1 :] = rows[cut, at + 1 :]
    rest[:, at] = np.r_[after[cut], new]
    rows[cut, at + 1 :] = np.nan
    rows[cut, at] = before[cut]
    return np.vstack([rows, rest])


@dataclass(frozen=True)
class _Gap:
    """The branches (b, 2) at two neighbouring `values`, between which some may meet."""

    family: Family
    box: Box
    values: Real
    rows: Complex

    @property
    def width(self) -> float:
        """How far apart the two values are."""
        return float(abs(self.values[1] - self.values[0]))

    @property
    def kinds(self) -> NDArray[np.int64]:
        """What each branch is at both values: ABSENT, ON_REAL_AXIS or IN_PAIR."""
        return np.where(np.isnan(self.rows), ABSENT, np.where(self.rows.imag == 0, ON_REAL_AXIS, IN_PAIR))

    @property
    def is_open(self) -> bool:
        """Whether at both values there is a pole well inside the box that is no longer, or not yet, what it was."""
        sides = self.rows[self.kinds[:, 0] != self.kinds[:, 1]].T
        return all(inside(side[np.isfinite(side)], self.box).any() for side in sides)

    def met(self) -> tuple[float, Complex] | None:
        """The value at which two branches meet, and all branches there; None where it is not one meeting, and plain."""
        ways = [(side, *self._changing(side)) for side in (0, 1)]
        met = [(side, axis, pair) for side, axis, pair in ways if axis.size and pair.size]
        if len(met) != 1 or (met[0][1].size, met[0][2].size) != (2, 1):
            return None
        side, axis, pair = met[0]
        two, complex_one = self.rows[axis, side].real, self.rows[pair, 1 - side][0]
        if two[0] == two[1]:  # they part at the value itself
            column = self.rows[:, side].copy()
            column[pair] = two[0]
            return float(self.values[side]), column
        try:
            value, point = self._meeting(side, axis, pair, two, complex_one)
        except ConvergenceError:
            return None
        rest = self.rows.copy()
        rest[np.r_[axis, pair]] = np.nan
        share = (value - self.values[0]) / (self.values[1] - self.values[0])
        found = self.family.between(value, share, rest)
        if found is not None:
            found[np.r_[axis, pair]] = point
        return None if found is None else (value, found)

    def _changing(self, side: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which are on the axis at a side alone, and which are in a pair at the other side alone."""
        here, there = self.kinds[:, side], self.kinds[:, 1 - side]
        return (
            np.flatnonzero((here == ON_REAL_AXIS) & (there != ON_REAL_AXIS)),
            np.flatnonzero((there == IN_PAIR) & (here != IN_PAIR)),
        )

    def _meeting(
        self, side: int, axis: NDArray[np.int64], pair: NDArray[np.int64], two: Real, complex_one: complex
    ) -> tuple[float, float]:
        """The value, and where on the axis, at which two real poles of a side are the pair of the other."""
        middle = float(np.mean([*two, complex_one.real, complex_one.real]))
        others = np.r_[np.delete(self.rows[:, side], axis), np.delete(self.rows[:, 1 - side], pair)]
        others = np.r_[others[np.isfinite(others)], self.family.at(float(self.values.mean())).k.singular]
        reach = float(max(abs(two - middle).max(), abs(complex_one - middle)))
        clear = float(abs(others - middle).min(initial=np.inf))
        if clear < CLEAR_RADIUS**2 * reach:
            raise ConvergenceError("other poles lie too near to two that meet", middle, clear)
        circle = CLEAR_RADIUS * reach * np.exp(2j * np.pi * (np.arange(CIRCLE_POINTS) + 0.5) / CIRCLE_POINTS)

        def squared(value: float) -> float:
            if value == self.values[side]:
                return float((two[1] - two[0]) ** 2 / 4)
            if value == self.values[1 - side]:
                return float(-(complex_one.imag**2))
            return _pair_in(self.family, value, middle, circle)[1]

        low, high = sorted(self.values.tolist())
        value = float(brentq(squared, low, high, xtol=MEETING_KNOWN * max(abs(low), abs(high))))
        return value, _pair_in(self.family, value, middle, circle)[0]

    def halved(self) -> tuple[float, Complex, Complex, Complex] | None:
        """Half way, and the poles of the box there: that which continues each branch, that which each continues, and
        the others.  None where they cannot all be found."""
        value = float(self.values.mean())
        alive = [np.flatnonzero(np.isfinite(row)) for row in self.rows.T]
        here, there = (self.rows[which, side] for side, which in enumerate(alive))
        try:
            poles = self.family.poles(value, self.box, np.unique(np.r_[here, there]))
        except ConvergenceError:
            return None
        sides = np.full((2, len(self.rows)), np.nan, complex)
        told = [(0, int(alive[0][i]), j) for j, i in assigned(here, poles, self.box)[0].items()]
        told += [(1, int(alive[1][j]), i) for j, i in assigned(poles, there, self.box)[0].items()]
        # both on the axis, or neither: of two that meet each begins a branch at the meeting
        told = [(side, row, n) for side, row, n in told if (self.rows[row, side].imag == 0) == (poles[n].imag == 0)]
        for side, row, pole in told:
            sides[side, row] = poles[pole]
        return value, *sides, np.delete(poles, [pole for _, _, pole in told])


def _pair_in(family: Family, value: float, middle: float, circle: Complex) -> tuple[float, float]:
    """Half the sum of the two zeros in a circle around a middle, and the square of half their difference.

    Raises ConvergenceError where there are not two.
    """
    at = family.at(value).function(middle + circle)
    weights = at.slope / at.value * circle / circle.size
    count, first, second = (float((weights * circle**power).sum().real) for power in (0, 1, 2))
    if abs(count - 2) > WHOLE_COUNT:
        raise ConvergenceError(f"there are {count:.3g} poles near {middle:.6g}, not two", middle, count)
    return middle + first / 2, second / 2 - (first / 2) ** 2
