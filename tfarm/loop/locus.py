"""Root loci of the exact rig: branches that keep their identity, and where they cross the imaginary axis.

At a few values the winding number says how many poles a box holds: there the list is complete.  In between each pole
is followed (`tfarm.crossing.following`), vectorised over values and poles.  Branches are named after the modes of the
rig without feedback: the whole law grows from 0 to what it is at the first value, and each pole is followed there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from tfarm.arm import AnyLaw, Arm, HubFeedback
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real, Whole
from tfarm.crossing.following import assigned, between, follow
from tfarm.crossing.turning import loose
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum import damped_modes, modes
from tfarm.spectrum.box import Box
from tfarm.spectrum.damped import single_zeros

from .crossings import BranchCrossing, branch_crossings, in_words
from .varied import Varied

MOST_LOCUS_POINTS = 100_000  # values, those between that make it round among them
MOST_BRANCHES = 200  # and flexible modes below the top of the box
COMPANY = 2  # flexible modes followed beyond the box, whose poles may come into it
NODES = 3  # values after the first at which the poles of the box are counted
SAME_POLE = 1e-6  # of its size: a pole found by two searches
HALVING_ROUNDS = 24  # of halving at most: where two branches meet their distance goes with the root of that of the gain
LEAST_WIDTH, LEAST_HEIGHT = 1e-12, 1e-9  # of a picture, of the size of its poles: less is rounding of one that stands


@dataclass(frozen=True)
@record
class Locus:
    """The closed-loop poles of an arm under a law, as one number varies.

    `gain` (n,) are the values of what `vary` names: a number of the law, "all" (a factor on it) or of the arm;
    `branches` (b, n) [1/s] are poles followed: those at s = 0, then in the order of the modes they continue from
    (`mode` (b,), 0 for the rigid body, a motor's circuit, a filter, a delay).  The mirror image of a branch is left
    out, unless the two meet on the real axis and part there: then it is a branch of its own, with Im s < 0 where they
    are a pair.  A branch is NaN where it is not followed (`ends`).  `box` holds no other pole at its nodes.
    `followed` are all poles but those at 0 all the way, mirror images too, `listed` the numbers of those in
    `branches`, which with `in_box` are NaN outside the box.
    `crossings` are those of the imaginary axis, ascending along the way.
    """

    arm: Arm
    law: AnyLaw
    vary: str
    gain: Real
    branches: Complex
    mode: Whole
    box: Box
    crossings: tuple[BranchCrossing, ...]
    followed: Complex = field(repr=False, compare=False)
    listed: Whole = field(repr=False, compare=False)
    in_box: bool = False

    @property
    def finding(self) -> str:
        """Where the imaginary axis is crossed, in words."""
        return in_words(self.vary, self.crossings)

    @property
    def varied(self) -> Varied:
        """The family of loops."""
        return Varied(self.arm, self.law, self.vary, float(self.gain[0]), float(self.gain[-1]), self.box)

    @property
    def gains(self) -> HubFeedback:
        """The gains at the hub, of a locus of these."""
        return cast("HubFeedback", self.law)

    @property
    def spectral_abscissa(self) -> Real:
        """The largest real part [1/s] of these branches at each gain, apart from poles at s = 0."""
        moving = np.where(self.branches == 0, -math.inf, self.branches.real)
        return np.asarray(np.fmax.reduce(moving, axis=0))

    @property
    def ends(self) -> tuple[tuple[int, float], ...]:
        """The number of each branch that ends on the way, and the last of the values at which it lives."""
        lives = ~np.isnan(self.branches)
        rows = np.nonzero(~lives[:, -1])[0]
        return tuple((int(row), float(self.gain[np.nonzero(lives[row])[0][-1]])) for row in rows if lives[row].any())


def locus(
    arm: Arm, law: AnyLaw, vary: str, start: float, stop: float, points: int, branches: int, in_box: bool = False
) -> Locus:
    """Return the exact locus at `points` equally spaced values from `start` to `stop`.

    It has the first `branches` branches; with `in_box` those in a box as high as so many flexible modes.  Raises
    ParameterError for what is no loop or no range, ConvergenceError where branches cannot be told apart.
    """
    points = whole("points", points, 2, MOST_LOCUS_POINTS, f"a whole number from 2 to {MOST_LOCUS_POINTS}")
    branches = whole("branches", branches, 1, MOST_BRANCHES, f"a whole number from 1 to {MOST_BRANCHES}")
    number = branches if in_box else max(1, branches - 2 * arm.has_rigid_mode)
    family = Varied(arm, law, vary, start, stop).boxed(number)
    gain = np.linspace(start, stop, points)
    rows, mode = followed(family, gain, number)
    is_mirrored = ~(rows.imag == 0).any(axis=1) & ~(rows.imag > 0).any(axis=1)
    listed = np.flatnonzero(~np.isnan(rows).all(axis=1) & ~is_mirrored)
    shown = np.where(family.box.holds(rows), rows, np.nan) if in_box else rows
    listed = listed[~np.isnan(shown[listed]).all(axis=1)][: len(rows) if in_box else branches - family.pinned]
    pinned = min(family.pinned, branches)
    found = np.concatenate([np.zeros((pinned, points), complex), shown[listed]])
    found += 0.0  # no -0
    if len(found) < branches and not in_box:
        raise ConvergenceError(f"only {len(found)} branches could be followed: ask for fewer", found, branches)
    mode = np.r_[np.zeros(pinned, np.int64), mode[listed]]
    top = family.box.im_max if in_box else float(np.fmax.reduce(found.imag).min()) or family.frequency
    crossings = branch_crossings(family, gain, found, top)
    return Locus(family.first.arm, law, vary, gain, found, mode, family.box, crossings, rows, listed, in_box)


def followed(family: Varied, gain: Real, modes: int) -> tuple[Complex, Whole]:
    """All poles (b, n) but those at 0 all the way, mirror images among them, and the mode of each."""
    row, mode = named(family, modes + COMPANY)
    row = np.r_[row, missing(family, family.start, row)]
    rows, low = row[:, None], 0
    nodes = np.unique(np.linspace(0, gain.size - 1, NODES + 1).round().astype(int)).tolist()[1:]
    while nodes:
        high = nodes[0]
        try:
            part = follow(family, gain[low : high + 1], rows[:, -1])
        except ConvergenceError:  # of a pole that came into the box, and is next to one of these
            if high - low == 1:
                raise
            nodes.insert(0, (low + high) // 2)
            continue
        new = missing(family, float(gain[high]), part[-1])
        if new.size:
            back = follow(family, gain[low : high + 1][::-1], np.r_[part[-1], new])
            part = np.hstack([part, back[::-1, part.shape[1] :]])
            rows = np.vstack([rows, np.full((new.size, rows.shape[1]), np.nan)])
        rows, low = np.hstack([rows, part[1:].T]), nodes.pop(0)
    return rows, np.r_[mode, np.zeros(len(rows) - mode.size, np.int64)]


def missing(family: Varied, value: float, row: Complex) -> Complex:
    """The poles of the box at a value that are none of these (b,): none where their number is that of the box."""
    inside = row[family.box.holds(row) & (row != 0)]
    try:
        count = family.count(value)
    except ConvergenceError:  # a pole on the edge of the box: there it comes or goes
        return row[:0]
    if count < inside.size:
        raise ConvergenceError(f"branches cannot be told apart at {family.vary} = {value:.10g}", value, inside.size)
    if count == inside.size:
        return row[:0]
    every = family.complete(value, row)
    away = abs(every[:, None] - row[~np.isnan(row)]).min(axis=1, initial=math.inf)
    return every[away > SAME_POLE * abs(every)]


def named(family: Varied, number: int) -> tuple[Complex, Whole]:
    """The poles but those at 0 all the way at the first value (b,) that continue from the open rig's, and their modes.

    In the order of the modes, of which there are so many flexible ones; those of a law come last.
    """
    loop = family.first
    law = family.law_at(family.start)
    grown = Varied(loop.arm, law, "gain", 0.0, 1.0, family.box)
    row, mode = open_poles(loop.arm, number)
    rests = grown.at(0.0).zeros_at_origin - grown.pinned
    row, mode = np.r_[np.zeros(rests, complex), row, law.poles[law.poles != 0]], np.r_[np.zeros(rests, np.int64), mode]
    mode = np.r_[mode, np.zeros(row.size - mode.size, np.int64)]
    if loop.feeds_back:
        try:
            row = follow(grown, np.array([0.0, 1.0]), row)[1]
        except ConvergenceError:  # of poles that come in from afar, as under a delay
            row = assigned(grown, 1.0, row)
    more = max(0, grown.pinned - family.pinned)  # at 0 at the first value alone
    row, mode = np.r_[np.zeros(more, complex), row], np.r_[np.zeros(more, np.int64), mode]
    return row[~np.isnan(row)], mode[~np.isnan(row)]


def open_poles(arm: Arm, number: int) -> tuple[Complex, Whole]:
    """The poles of the rig without feedback, both of each pair, and their modes: of so many flexible ones at least."""
    table = modes(arm, number)
    if arm.is_undamped:
        omega = table.natural_frequency[table.index > 0]
        pairs, index, singles = (
            np.stack([1j * omega, -1j * omega], axis=1),
            table.index[table.index > 0],
            single_zeros(table),
        )
    else:
        found = damped_modes(table)
        rigid = found.eigenvalues[found.index == 0].ravel()
        singles = [*rigid, *found.others, *found.unassigned_pairs.ravel()]
        pairs, index = found.eigenvalues[found.index > 0], found.index[found.index > 0]
    row = np.r_[np.array(singles, complex), pairs.ravel()]
    mode = np.r_[np.zeros(len(singles), np.int64), np.repeat(index, 2)]
    alive = np.isfinite(row) & (row != 0)
    return row[alive], mode[alive]


def rounded(found: Locus) -> Locus:
    """Return the same locus with more values, until no branch turns by more than 5 degrees as it is drawn.

    Each is seen in a picture of its own and in one of all, down to pieces of a pixel.
    """
    family, gain, rows, shown = found.varied, found.gain, found.followed, found.branches
    way, pinned = int(np.sign(gain[-1] - gain[0])), len(shown) - found.listed.size
    for _ in range(HALVING_ROUNDS):
        more = _bent(gain, shown)
        if not more.size or more.size + gain.size > MOST_LOCUS_POINTS:
            break
        order = np.argsort(way * np.r_[gain, more], kind="stable")
        added = between(family, gain[::way], rows[:, ::way].T, more).T
        gain, rows = np.r_[gain, more][order], np.hstack([rows, added])[:, order]
        shown = np.concatenate([np.zeros((pinned, gain.size)), rows[found.listed]])
        shown = np.where(family.box.holds(shown), shown, np.nan) if found.in_box else shown
    return replace(found, gain=gain, branches=shown, followed=rows)


def _bent(gain: Real, rows: Complex) -> Real:
    """Half way between values where a branch is to be known more closely, in a frame of its own or of all."""
    frames = np.array([[*map(frame, rows)], [frame(rows)] * len(rows)])  # (2, b, 4)
    width, height = frames[..., 1] - frames[..., 0], frames[..., 3] - frames[..., 2]
    own, every = (loose(rows, width[n, :, None], height[n, :, None]) for n in (0, 1))
    return np.asarray((gain[:-1] + gain[1:])[own | every] / 2)


def frame(branches: Complex) -> tuple[float, float, float, float]:
    """Left, right, low and high of the picture of these branches [1/s]: all of them, with the imaginary axis."""
    points = branches[~np.isnan(branches)]
    if not points.size:
        return 0.0, 1.0, 0.0, 1.0
    left, right = min(float(points.real.min()), 0.0), max(float(points.real.max()), 0.0)
    low, high = float(points.imag.min()), float(points.imag.max())
    wide = max(right - left, LEAST_WIDTH * float(abs(points).max())) or 1.0  # where no pole moves from 0
    tall = max(high - low, LEAST_HEIGHT * high) or wide  # where none of them swings
    return left, left + wide, low, low + tall
