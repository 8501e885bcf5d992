"""Root loci of the exact rig under any law: at each value the complete set of poles in one box, joined to branches.

Nothing is followed blindly: the winding number says at each value how many poles the box holds, and all are found.
From one value to the next they are assigned to each other; where that is not plain a value between is looked at.  A
branch that leaves the box ends there, one that enters begins, and two that meet on the real axis part there as a pair.
Along a number in which the characteristic function is linear crossings of the imaginary axis are solved for without
branches, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, linear_sum_assignment

from tfarm.arm import Arm, Law
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum.box import Box, newton, zeros_in_box
from tfarm.spectrum.scales import first_frequency

from .crossings import BranchCrossing, crossing_answers, in_words
from .family import line_crossings
from .frequencies import band_of
from .law_answers import signals_answer
from .loop import NEAREST_TO_ORIGIN, Loop
from .poles import box_of, starting_points
from .variation import ARM_PARAMETERS, must_be_way

MOST_LAW_LOCUS_POINTS = 5000  # values: at each all poles of a box are found
MOST_LAW_BRANCHES = 60  # flexible modes below the top of the box
NO_PART = 1e-9  # of a pole's size: a smaller real or imaginary part is rounding, as is a smaller distance of two
NO_PART = 1e-9  # of a pole's size: a smaller real or imaginary part is rounding, as is a smaller distance of two
PLAIN_MOVE = 0.35  # of the distance to the next pole: one that moves by less is itself
AT_EDGE = 0.05  # of the box's height or width: poles so near to its edge come and go
STEP_HALVINGS = 3  # halvings of a step where poles are not plainly told apart; then a branch may end and another begin
HEIGHTS = (1.0, 1.013, 1.031, 1.057, 0.985, 1.09)  # of the box, until no pole is on its edge at the first value
SEEN_CROSSING = 1e-3  # of the range: a crossing of a branch so near to one that was solved for is that one
CROSSING_KNOWN = 1e-13  # of the larger end of a step: the value at which a branch crosses, next to what doubles tell
AT_END = 1e-9  # of the range: a crossing so near to an end is at the end, and not between


@dataclass(frozen=True)
@record
class LawLocus:
    """Poles of a rig under a law as one number varies: `branches` (b, n) [1/s] over `values` (n,), NaN out of `box`.

    `vary` is a number of the law (as `Law.having` names it) or of the arm (payload_mass, payload_inertia, hub_inertia,
    length, damping).  Branches have Im s >= 0; the box holds no other pole at any value.  `crossings` are those of the
    imaginary axis, ascending along the way.
    """

    arm: Arm
    law: Law
    vary: str
    values: Real
    branches: Complex
    box: Box
    crossings: tuple[BranchCrossing, ...]

    @property
    def finding(self) -> str:
        """Where the imaginary axis is crossed, in words."""
        return in_words(self.vary, self.crossings)


def law_locus(arm: Arm, law: Law, vary: str, start: float, stop: float, points: int, branches: int) -> LawLocus:
    """The locus at `points` equally spaced values, in a box as high as the first `branches` flexible modes.

    Raises ParameterError for what is no number of the law or the arm, no loop or no range, ConvergenceError where the
    poles at a value cannot all be found.
    """
    points = whole("points", points, 2, MOST_LAW_LOCUS_POINTS, f"a whole number from 2 to {MOST_LAW_LOCUS_POINTS}")
    branches = whole("branches", branches, 1, MOST_LAW_BRANCHES, f"a whole number from 1 to {MOST_LAW_BRANCHES}")
    must_be_way(start, stop)
    family, values = Family(arm, law, vary, start), np.linspace(start, stop, points)
    box, first = family.started(values, branches)
    rows = [np.r_[each, np.full(points - 1, np.nan)] for each in first[:, None].astype(complex)]
    now = list(range(len(rows)))  # the row of each pole
    here = first
    for n in range(1, points):
        there, now_there = family.joined(float(values[n - 1]), here, float(values[n]), box, STEP_HALVINGS)
        places = []
        for pole, before in zip(there, now_there, strict=True):
            if before is None:
                rows.append(np.full(points, np.nan, complex))
            place = len(rows) - 1 if before is None else now[before]
            rows[place][n] = pole
            places.append(place)
        here, now = there, places
    found = np.array(rows)
    return LawLocus(family.at(start).arm, law, vary, values, found, box, _crossings(family, values, found, box))


@dataclass(frozen=True)
class Family:
    """The loops of an arm and a law, one number of which varies."""

    arm: Arm
    law: Law
    vary: str
    start: float

    @property
    def is_of_arm(self) -> bool:
        """Whether the number is one of the arm."""
        return self.vary in ARM_PARAMETERS

    def at(self, value: float) -> Loop:
        """The loop where the number has that value."""
        if self.is_of_arm:
            return Loop(self.arm.having(**{self.vary: value}), self.law)
        return self._first.under(self.law.having(self.vary, value))

    @property
    def own(self) -> Loop:
        """The loop of the law as it is given: what varies may be a factor on it."""
        return self._first.under(self.law)

    @cached_property
    def _first(self) -> Loop:
        """The loop where the way begins, of whose rig the others are."""
        return Loop(self.arm, self.law.having(self.vary, self.start))

    def started(self, values: Real, branches: int) -> tuple[Box, Complex]:
        """A box for the whole way, and the poles in it at the first value."""
        loops = [self.at(float(value)) for value in (values[0], values[values.size // 2], values[-1])]
        lost: ConvergenceError | None = None
        for factor in HEIGHTS:
            height = factor * max(band_of(loop.arm, branches) for loop in loops)
            boxes = [box_of(loop, height) for loop in loops]
            box = Box(max(each.re_min for each in boxes), max(each.re_max for each in boxes), -height, height)
            try:
                return box, self.poles(float(values[0]), box, np.empty(0, complex))
            except ConvergenceError as error:
                lost = error
        assert lost is not None
        raise lost

    def poles(self, value: float, box: Box, near: Complex) -> Complex:
        """All poles in the box with Im s >= 0 at one value, those at 0 too; `near` are some to begin with."""
        loop = self.at(value)
        known = near[near != 0]
        starts = np.r_[known, known.conj()] if near.size else starting_points(loop, box.im_max)
        found = zeros_in_box(loop.function, box, starts)
        found = np.where(abs(found.imag) < NO_PART * abs(found), found.real, found)
        return np.r_[np.zeros(loop.zeros_at_origin, complex), found[found.imag >= 0]]

    def joined(self, low: float, here: Complex, high: float, box: Box, depth: int) -> tuple[Complex, list[int | None]]:
        """The poles at `high`, and which of those at `low` each continues; None where it is new."""
        there = self.poles(high, box, here)
        pairs, is_plain = assigned(here, there, box)
        if is_plain or not depth:
            return there, [pairs.get(n) for n in range(there.size)]
        middle = (low + high) / 2
        between, first = self.joined(low, here, middle, box, depth - 1)
        there, second = self.joined(middle, between, high, box, depth - 1)
        return there, [None if n is None else first[n] for n in second]

    def between(self, value: float, share: float, rows: Complex) -> Complex | None:
        """The poles at a value that lies a share of the way between two, from those (b, 2) at both.

        None where one is not plainly its own.
        """
        poles = np.full(len(rows), np.nan, complex)
        for n in np.nonzero(np.isfinite(rows).all(axis=1))[0]:
            room, is_real = abs(rows[n, 1] - rows[n, 0]), rows[n].imag == 0
            on_line = rows[n, 0] + share * (rows[n, 1] - rows[n, 0])
            starts = rows[n][np.argsort(is_real)] if is_real.any() != is_real.all() else [on_line]
            found = [self._near(value, complex(start), room) for start in starts] if room else [rows[n, 0]]
            told = [pole for pole in found if pole is not None]
            if not told:
                return None
            poles[n] = told[0]
        return poles

    def _near(self, value: float, start: complex, room: float) -> complex | None:
        """The pole at a value that is near to a start, and real where that is; None where there is none."""
        try:
            pole = self.pole_near(value, start)
        except ConvergenceError:
            return None
        pole = pole.real if abs(pole.imag) <= NO_PART * abs(pole) else pole
        return pole if abs(pole - start) <= room and (pole.imag != 0) == (start.imag != 0) else None

    def at_rest(self, value: float) -> float:
        """D/s^n at s = 0, real, up to a positive factor: a real pole passes through 0 where it changes its sign."""
        beside = NEAREST_TO_ORIGIN * first_frequency(self.at(value).arm) * np.array([1.0, -1.0])
        found = self.at(value).function(beside + 0j)
        return float((found.value * np.exp(1j * found.scale.imag)).real.mean())

    def pole_near(self, value: float, start: complex) -> complex:
        """The pole at a value that Newton's method finds from a start.  Raises ConvergenceError where it finds none."""
        found = newton(self.at(value).function, np.array([start]))
        if not found.size:
            raise ConvergenceError(f"the pole near {start:.6g} is lost at {self.vary} = {value:.6g}", start, value)
        return complex(found[0])


def assigned(here: Complex, there: Complex, box: Box) -> tuple[dict[int, int], bool]:
    """Which pole of `here` each of `there` continues, and whether that is plain."""
    if not here.size or not there.size:
        return {}, not inside(np.r_[here, there], box).any()
    away = abs(here[:, None] - there)
    rows, columns = linear_sum_assignment(away)
    moved = away[rows, columns]
    room = np.minimum(_room(here)[rows], _room(there)[columns])
    near = moved <= PLAIN_MOVE * room
    pairs = {int(j): int(i) for i, j, kept in zip(rows, columns, near | (moved <= room), strict=True) if kept}
    alone = np.r_[np.delete(here, rows[near]), np.delete(there, columns[near])]
    return pairs, not inside(alone, box).any()


def _room(poles: Complex) -> Real:
    """How far each is from the next, its own mirror image among them; those at 0 count as one."""
    everyone = np.r_[poles, poles.conj()]
    away = abs(poles[:, None] - everyone)
    away[away <= NO_PART * abs(poles)[:, None]] = math.inf
    return np.asarray(away.min(axis=1, initial=math.inf))


def inside(poles: Complex, box: Box) -> NDArray[np.bool_]:
    """Which are well inside the box."""
    width, height = AT_EDGE * (box.re_max - box.re_min), AT_EDGE * box.im_max
    across = (poles.real > box.re_min + min(width, height)) & (poles.real < box.re_max - min(width, height))
    return np.asarray(across & (poles.imag < box.im_max - height))


def _crossings(family: Family, values: Real, branches: Complex, box: Box) -> tuple[BranchCrossing, ...]:
    """Where branches change sides, solved for; along a linear number also those that no branch was seen to make.

    The latter by D-decomposition, between the ends of the range.
    """
    found, sign = [], float(np.sign(values[-1] - values[0]))
    for number, row in enumerate(branches):
        side = np.where(abs(row.real) <= NO_PART * abs(row), 0, np.sign(row.real))  # NaN where it is in no box
        for low, high in pairwise(np.flatnonzero(side != 0)):
            if not side[low] * side[high] < 0 or np.isnan(row[low : high + 1]).any():
                continue
            on_it = values[low + 1], abs(row[low + 1].imag)  # where a value between them is the crossing
            at, omega = on_it if high > low + 1 else _crossed(family, values[low : high + 1], row[low : high + 1])
            way = "unstable" if side[high] > 0 else "stable"
            found.append(BranchCrossing(gain=float(at), omega=float(omega), branch=number, direction=way))
    if not family.is_of_arm and family.vary != "delay":
        loop, ascending, band, seen = family.own, np.sort(values), box.im_max, tuple(found)
        span = float(ascending[-1] - ascending[0])
        for t, w, change in line_crossings(loop, family.vary, float(ascending[0]), float(ascending[-1]), band):
            near = [each for each in seen if abs(each.gain - t) <= SEEN_CROSSING * span]
            is_seen = any(abs(each.omega - w) <= SEEN_CROSSING * band for each in near)
            if AT_END * span < t - ascending[0] < (1 - AT_END) * span and not is_seen:
                direction = "unstable" if sign * change > 0 else "stable"
                found.append(BranchCrossing(gain=t, omega=w, branch=None, direction=direction))
    return tuple(sorted(found, key=lambda each: (sign * each.gain, each.omega)))


def _crossed(family: Family, values: Real, poles: Complex) -> tuple[float, float]:
    """The value between two at which a branch is on the axis, and the frequency there.

    A pole next to 0 has no digits, and two that meet beside it no way: there it is the value at which s = 0 is one.
    """
    low, high = (float(value) for value in values)
    known = CROSSING_KNOWN * max(abs(low), abs(high))
    if not poles.imag.all() and family.at_rest(low) * family.at_rest(high) < 0:
        return float(brentq(family.at_rest, low, high, xtol=known)), 0.0

    def pole(value: float) -> complex:
        share = (value - low) / (high - low)
        return family.pole_near(value, complex(poles[0] + share * (poles[1] - poles[0])))

    at = float(brentq(lambda value: pole(value).real, low, high, xtol=known))
    return at, abs(pole(at).imag)


def law_locus_answer(found: LawLocus) -> dict[str, Any]:
    """The branches at each value, null where they are not in the box, and where they cross the imaginary axis."""
    return {
        "arm": found.arm.name,
        **signals_answer(found.law, found.arm),
        "vary": found.vary,
        "unit": ARM_PARAMETERS.get(found.vary, "s" if found.vary == "delay" else "1"),
        "gain": found.values.tolist(),
        "branches": [[None if np.isnan(s) else [s.real, s.imag] for s in row] for row in found.branches.tolist()],
        "box": list(found.box),
        "crossings": crossing_answers(found.crossings),
    }
