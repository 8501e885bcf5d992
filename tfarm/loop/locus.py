"""Root loci of the exact rig: branches that keep their identity, and where they cross the imaginary axis.

At a few values the winding number counts the poles of a box: there the list is complete.  In between each pole is
followed (`tfarm.spectrum.following`), vectorised over values and poles.  Branches are named after the modes of the rig
without feedback: a factor on the law grows from 0 to 1 at the first value, and each pole is followed on that way.

Crossings are solved for gain and frequency together, not interpolated.  Along a number of the law in which D is linear
D-decomposition has every one (`tfarm.crossing`).  Each belongs to the branch that changes sides there, or to a pole on
no branch.  Along another number the branch is followed to its crossing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, cast

import numpy as np
from scipy.optimize import brentq

from tfarm.arm import FED_BACK, NAMES, PLANE, AnyLaw, Arm, HubFeedback
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real, Whole
from tfarm.case import Case, OfCase
from tfarm.crossing import Crossing
from tfarm.crossing.turning import loose
from tfarm.errors import ConvergenceError, must_be_known, require
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.lines import line_crossings
from tfarm.loop.varied import ARM_PARAMETERS, OF_THE_LAW, Title, Varied
from tfarm.loop.windows import without_losses
from tfarm.records import frozen
from tfarm.response.frequency import AXIS_SHARE
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Quantity
from tfarm.spectrum import damped_modes, modes
from tfarm.spectrum.box import Box
from tfarm.spectrum.following import assign_roots, follow, interpolate_roots

# values, those between that make it round among them
MOST_LOCUS_POINTS = 100_000
# of a locus, in its finding
CROSSINGS_SHOWN = 3
# origin of a branch of no flexible mode
RIGID = 0
CONTROLLER = -1
OTHER = -2
ORIGINS = {RIGID: "rigid body", CONTROLLER: "controller", OTHER: "other"}

CROSSINGS = Quantity(
    "crossings of the imaginary axis", help="solved for, not interpolated; in the order of the range"
)
ORIGIN = Quantity(
    "origin",
    help="open-loop pole that the branch continues from; other: the motor's circuit, a delay, a fast real pole",
)


def origin_name(origin: int) -> str:
    """The flexible mode of that number, or another origin of a branch."""
    return ORIGINS.get(origin, f"mode {origin}")


@frozen
class Locus(OfCase):
    """The closed-loop poles of an arm under a law, as one number varies.

    `gain` (n,) are the values of what `vary` names: a number of the law, "all" (a factor on it) or of the arm;
    `branches` (b, n) [1/s] are poles followed: those at s = 0, then in the order of the modes they continue from
    (`origin` (b,): its number, or one of `ORIGINS`).  The mirror image of a branch is left out, unless the two meet on
    the real axis and part there: then it is a branch of its own, with Im s < 0 where they are a pair.  A branch is NaN
    where it is not followed (`ends`).  `box` holds no other pole at its nodes.
    `arm` is that at the first value where a number of it varies.
    `followed` are all poles but those at 0 all the way, mirror images too, `listed` the numbers of those in
    `branches`, which with `in_box` are NaN outside the box.
    `crossings` are those of the imaginary axis, ascending along the way.
    """

    case: Case
    vary: Annotated[
        str, Quantity("varied", help="number of the controller or the arm along which poles are followed")
    ]
    gain: Annotated[Real, Quantity("value", curve=True, help="values of the number that varies")]
    branches: Annotated[
        Complex, Quantity("branch", "1/s", curve=True, help="closed-loop poles, a branch each")
    ]
    origin: Whole
    box: Annotated[
        Box, Quantity("box: Re s from, to, Im s from, to", help="poles are complete in it at a few values")
    ]
    crossings: Annotated[tuple[BranchCrossing, ...], CROSSINGS]
    followed: Complex = field(repr=False, compare=False)
    listed: Whole = field(repr=False, compare=False)
    in_box: bool = False

    @cached_property
    def smooth(self) -> Locus:
        """The same with the values between that round lines take."""
        return refine_branches(self)

    @property
    def finding(self) -> str:
        """The first `CROSSINGS_SHOWN` crossings of the imaginary axis."""
        if not self.crossings:
            return "no branch crosses the imaginary axis"
        shown = self.crossings[:CROSSINGS_SHOWN]
        more = len(self.crossings) - CROSSINGS_SHOWN
        first = ", ".join(f"{each.direction} at {self.vary} = {each.gain:.6g}" for each in shown)
        return f"a pole becomes {first}{f' and {more} more' if more > 0 else ''}"

    @property
    def controller(self) -> Annotated[ControllerSignals, Quantity(flat=True)]:
        """Names of the arm and the controller."""
        return controller(self.law, self.arm)

    @property
    def mode(self) -> Whole:
        """Flexible mode of each branch (b,), 0 of those that continue from none."""
        return np.maximum(self.origin, 0)

    @property
    def unit(self) -> Annotated[str, Quantity(help="SI unit of the number that varies; 1 of a pure one")]:
        """The SI unit of the varied number, "1" of a pure one."""
        return self.varied.unit

    @property
    def titles(self) -> dict[str, Title]:
        """The title of the curve of its values."""
        return {"gain": self.varied.title}

    @cached_property
    def varied(self) -> Varied:
        """The family of loops."""
        return Varied(self.case, self.vary, float(self.gain[0]), float(self.gain[-1]), self.box)

    @property
    def gains(self) -> HubFeedback:
        """The gains at the hub, of a locus of these."""
        return cast("HubFeedback", self.case.gains)

    @property
    def spectral_abscissa(self) -> Real:
        """The largest real part [1/s] of these branches at each gain, apart from poles at s = 0."""
        moving = np.where(self.branches == 0, -math.inf, self.branches.real)
        return np.asarray(np.fmax.reduce(moving, axis=0))

    @property
    def ends(self) -> tuple[tuple[int, float], ...]:
        """The number of each branch that ends within the range, and the last value at which it is followed."""
        lives = ~np.isnan(self.branches)
        rows = np.nonzero(~lives[:, -1])[0]
        return tuple(
            (int(row), float(self.gain[np.nonzero(lives[row])[0][-1]])) for row in rows if lives[row].any()
        )


def locus(
    arm: Arm, law: AnyLaw, vary: str, start: float, stop: float, points: int | None = None, branches: int = 10
) -> Locus:
    """Return the closed-loop poles of the exact arm at equally spaced values of one number, `start` to `stop`.

    `vary` is a gain, "all" (a scale on the gains), payload_mass, payload_inertia, hub_inertia, length or damping; of a
    law of signals also "gain" (a factor on it), "delay", a signal, "SIGNAL.num.N" or "SIGNAL.den.N".  Along the latter,
    and of any `Law` but gains at the hub, the record has all poles of a box as high as the first `branches` flexible
    modes, by default at 100 values.  Else it has that many branches, by default at 500 values.
    Raises ParameterError for an invalid law, loop or range, ConvergenceError where branches cannot be distinguished.
    """
    # and flexible modes below the top of the box
    most_branches = 200
    case = Case(arm, law)
    gains = case.gains
    require(isinstance(vary, str), "vary", vary, f"the name of what varies, such as {PLANE[1]} or length")
    known = (*OF_THE_LAW, *ARM_PARAMETERS)
    in_box = gains is None or vary not in known
    if gains is not None:
        must_be_known("vary", vary.partition(".")[0], (*known, "gain", "delay", *FED_BACK))
        remedy = f"every gain is 0: give {' or '.join(NAMES)} to be scaled"
        require(vary != "all" or gains != HubFeedback(), "vary", "all", remedy)
    # by default 500 values of gains, 100 of any other law
    points = (100 if in_box else 500) if points is None else points
    points = whole("points", points, 2, MOST_LOCUS_POINTS, f"a whole number from 2 to {MOST_LOCUS_POINTS}")
    branches = whole("branches", branches, 1, most_branches, f"a whole number from 1 to {most_branches}")
    number = branches if in_box else max(1, branches - 2 * case.arm.has_rigid_mode)
    family = Varied(case, vary, start, stop).with_box(number)
    gain = np.linspace(start, stop, points)
    rows, origin = follow_poles(family, gain, number)
    is_shown = family.box.holds(rows) if in_box else ~np.isnan(rows)
    # others are mirror images throughout
    is_upper = (rows.imag >= 0).any(axis=1)
    listed = np.flatnonzero(is_shown.any(axis=1) & is_upper)[: None if in_box else branches - family.pinned]
    pinned = min(family.pinned, branches)
    found = branches_in_box(rows, listed, pinned, family.box if in_box else None)
    if len(found) < branches and not in_box:
        raise ConvergenceError(
            f"only {len(found)} branches could be followed: ask for fewer", found, branches
        )
    origin = np.r_[at_origin(family.first)[:pinned], origin[listed]]
    top = family.box.im_max if in_box else float(np.fmax.reduce(found.imag).min()) or family.frequency
    crossings = branch_crossings(family, gain, found, origin, top)
    return Locus(
        case.on(family.first.arm), vary, gain, found, origin, family.box, crossings, rows, listed, in_box
    )


def branches_in_box(rows: Complex, listed: Whole, pinned: int, box: Box | None) -> Complex:
    """The branches listed after the poles pinned at 0, NaN outside the box where there is one."""
    found: Complex = np.concatenate([np.zeros((pinned, rows.shape[1]), complex), rows[listed]])
    # no -0
    found += 0.0
    return found if box is None else np.where(box.holds(found), found, np.nan)


def follow_poles(family: Varied, gain: Real, modes: int) -> tuple[Complex, Whole]:
    """All poles (b, n) but those at 0 at every value, mirror images included, and the origin of each."""
    # 2 flexible modes are followed beyond the box, whose poles may come into it
    row, origin = continue_from_rig(family, modes + 2)
    row = np.r_[row, missing_poles(family, family.start, row)]
    rows = row[:, None]
    low = 0
    # 3 values after the first at which the poles of the box are counted
    nodes = np.unique(np.linspace(0, gain.size - 1, 3 + 1).round().astype(int)).tolist()[1:]
    while nodes:
        high = nodes[0]
        try:
            part = follow(family, gain[low : high + 1], rows[:, -1])
        except ConvergenceError:
            # of a pole that came into the box, and is next to one of these
            if high - low == 1:
                raise
            nodes.insert(0, (low + high) // 2)
            continue
        new = missing_poles(family, float(gain[high]), part[-1])
        if new.size:
            back = follow(family, gain[low : high + 1][::-1], np.r_[part[-1], new])
            part = np.hstack([part, back[::-1, part.shape[1] :]])
            rows = np.vstack([rows, np.full((new.size, rows.shape[1]), np.nan)])
        rows = np.hstack([rows, part[1:].T])
        low = nodes.pop(0)
    return rows, np.r_[origin, np.full(len(rows) - origin.size, OTHER)]


def missing_poles(family: Varied, value: float, row: Complex) -> Complex:
    """The poles of the box at a value that are not among these (b,): none where their number is that of the box."""
    inside = row[family.box.holds(row) & (row != 0)]
    try:
        count = family.count(value)
    except ConvergenceError:
        # a pole on the edge of the box: there it comes or goes
        return row[:0]
    if count < inside.size:
        text = f"two branches cannot be distinguished at {family.vary} = {value:.10g}"
        raise ConvergenceError(text, value, inside.size)
    if count == inside.size:
        return row[:0]
    every = family.complete(value, row)
    away = abs(every[:, None] - row[~np.isnan(row)]).min(axis=1, initial=math.inf)
    # within 1e-6 of its size a pole of two searches is one
    return every[away > 1e-6 * abs(every)]


def continue_from_rig(family: Varied, number: int) -> tuple[Complex, Whole]:
    """Poles at the first value (b,) that continue from the open rig's, and their origins; without those pinned at 0.

    In the order of the modes, `number` flexible ones; poles of a law come last.
    """
    loop = family.first
    grown = Varied(loop.case, "gain", 0.0, 1.0, family.box)
    row, origin = open_poles(loop.arm, number)
    own = loop.law.poles[loop.law.poles != 0]
    resting = at_origin(grown.at(0.0))
    row = np.r_[np.zeros(resting.size - grown.pinned, complex), row, own]
    origin = np.r_[resting[grown.pinned :], origin, np.full(own.size, CONTROLLER)]
    if loop.feeds_back:
        try:
            row = follow(grown, np.array([0.0, 1.0]), row)[1]
        except ConvergenceError:
            # of poles that come in from afar, as under a delay
            row = assign_roots(grown, 1.0, row)
    # at 0 at the first value alone
    of_first = resting[family.pinned : grown.pinned]
    row = np.r_[np.zeros(of_first.size, complex), row]
    origin = np.r_[of_first, origin]
    return row[~np.isnan(row)], origin[~np.isnan(row)]


def at_origin(loop: ContinuousLoop) -> Whole:
    """Origins of the poles at s = 0 of a loop: those of the rig first."""
    return np.where(np.arange(loop.zeros_at_origin) < loop.k.at_rest, RIGID, CONTROLLER)


def open_poles(arm: Arm, number: int) -> tuple[Complex, Whole]:
    """Poles of the rig without feedback, both of each pair, and their origins: of at least `number` flexible modes."""
    found = damped_modes(modes(arm, number))
    rigid = found.eigenvalues[found.index == 0].ravel()
    pairs = found.eigenvalues[found.index > 0].ravel()
    others = [*found.others, *found.unassigned_pairs.ravel()]
    row = np.array([*rigid, *others, *pairs], complex)
    origin = np.repeat([RIGID, OTHER], [len(rigid), len(others)])
    origin = np.r_[origin, np.repeat(found.index[found.index > 0], 2)]
    alive = np.isfinite(row) & (row != 0)
    return row[alive], origin[alive]


def refine_branches(found: Locus) -> Locus:
    """Return the same locus with more values, until no branch turns by more than 5 degrees as it is drawn.

    Each is drawn in a picture of its own and in one of all, down to pieces of a pixel.
    """
    family = found.varied
    gain = found.gain
    rows = found.followed
    branches = found.branches
    way = int(np.sign(gain[-1] - gain[0]))
    pinned = len(branches) - found.listed.size
    box = found.box
    # rounds of halving at most: where two branches meet their distance goes with the root of that of the gain
    for _ in range(24):
        pictures = np.array([*map(frame, branches)]), frame(branches), view(branches, found.origin)
        sizes = [np.diff(np.atleast_2d(each))[:, ::2, None] for each in pictures]
        is_loose = np.any([loose(branches, *each.swapaxes(0, 1)) for each in sizes], axis=0)
        more = (gain[:-1] + gain[1:])[is_loose] / 2
        if not more.size or more.size + gain.size > MOST_LOCUS_POINTS:
            break
        order = np.argsort(way * np.r_[gain, more], kind="stable")
        added = interpolate_roots(family, gain[::way], rows[:, ::way].T, more).T
        gain = np.r_[gain, more][order]
        rows = np.hstack([rows, added])[:, order]
        branches = branches_in_box(rows, found.listed, pinned, box if found.in_box else None)
    return replace(found, gain=gain, branches=branches, followed=rows)


def frame(branches: Complex) -> tuple[float, float, float, float]:
    """Left, right, low and high [1/s] of the picture of all these branches, with the imaginary axis."""
    points = branches[~np.isnan(branches)]
    if not points.size:
        return 0.0, 1.0, 0.0, 1.0
    left = float(points.real.min(initial=0.0))
    right = float(points.real.max(initial=0.0))
    low = float(points.imag.min())
    high = float(points.imag.max())
    # less than 1e-12 of the size of its poles is rounding of a constant pole
    # where no pole moves from 0
    wide = max(right - left, 1e-12 * float(abs(points).max())) or 1.0
    # where none of them oscillates
    tall = max(high - low, 1e-9 * high) or wide
    return left, left + wide, low, low + tall


def view(branches: Complex, origin: Whole) -> tuple[float, float, float, float]:
    """The same of a picture scaled to the modes, Im s >= 0: not to far real poles, nor to poles of other origins."""
    swinging = branches[origin > 0]
    swinging = swinging[swinging.imag > 0]
    if not swinging.size:
        return frame(branches)
    left, right, _, high = frame(swinging)
    return max(left, -high), min(right, high), 0.0, high


@dataclass(frozen=True, slots=True)
class BranchCrossing:
    """Crossing of the imaginary axis by a branch of a locus, at s = i `omega` [rad/s] and the value `gain`.

    `omega` is 0 or infinite where a real pole goes through the origin or through infinity.  `branch` is its number in
    the locus, None for a pole on none of them, or between two points; `direction` is "unstable" where the real part
    becomes positive as the locus runs, and "stable" where it becomes negative.  `title` is that of the varied number.
    """

    gain: Annotated[
        float, Quantity("value", digits=10, help="value of the number that varies, at the crossing")
    ]
    omega: Annotated[
        float, Quantity("frequency", "rad/s", 10, "imaginary part there; 0 or infinite of a real pole")
    ]
    branch: Annotated[int | None, Quantity("branch", help="- : a pole on no branch")]
    direction: Annotated[
        str, Quantity("becomes", help="side of the axis to which the pole goes as the locus runs")
    ]
    origin: Annotated[str | None, ORIGIN] = None
    title: Title = ("value", "")

    @property
    def titles(self) -> dict[str, Title]:
        """That of the number that varies."""
        return {"gain": self.title}

    @property
    def frequency(self) -> Annotated[float, Quantity("frequency", "Hz", help="the same over 2 pi")]:
        """omega in Hz."""
        return self.omega / (2 * math.pi)


def branch_crossings(
    family: Varied, gain: Real, branches: Complex, origin: Whole, top: float
) -> tuple[BranchCrossing, ...]:
    """Return the crossings of the imaginary axis in the order of the way.

    Of a damped rig along a number of its law those of poles on no branch too, up to `top` [rad/s].  Where D is linear
    in the number they are those of D-decomposition.
    """
    way = float(np.sign(gain[-1] - gain[0]))
    (low, high) = sorted(gain[[0, -1]].tolist())
    changes = _changes(branches)
    is_damped = not family.is_reactive
    known: list[Crossing] = []
    if (changes or is_damped) and not (family.is_of_arm or family.vary == "delay"):
        loop = family.first.under(family.full)
        name = "gain" if family.vary == "all" else family.vary
        # between two values a branch may be higher
        band = max(top, 1.01 * float(np.nanmax(branches.imag, initial=0.0)))
        try:
            known = list(without_losses(loop, name, line_crossings(loop, name, low, high, band)))
        except ConvergenceError:
            # two poles meet at s = 0, and those of modes that rest are on the axis throughout
            if is_damped:
                raise

    def crossing(at: float, omega: float, change: float, branch: int | None = None) -> BranchCrossing:
        of = None if branch is None else origin_name(int(origin[branch]))
        return BranchCrossing(
            at, omega, branch, "unstable" if way * change > 0 else "stable", of, family.title
        )

    found = []
    for number, *step in changes:
        step.sort(key=lambda n: gain[n])
        points = branches[number, step]
        at, omega = _crossed(family, gain[step], points, known, top)
        found.append(crossing(at, omega, points[1].real - points[0].real, number))
    # 1e-9 of the range: a crossing so near to an end is at the end, and not between
    seen = {(own.gain, own.omega) for own in found}
    at_end = 1e-9 * (high - low)
    for each in known if is_damped else ():
        is_between = low + at_end < each.t < high - at_end
        if is_between and not top < each.at < math.inf and (each.t, each.at) not in seen:
            found.append(crossing(*each))
    return tuple(sorted(found, key=lambda own: (way * own.gain, own.omega)))


def _changes(branches: Complex) -> list[tuple[int, int, int]]:
    """Each branch that changes sides, with the numbers of its last value before and the first after.

    Points on the axis are left out.  A change too is where a point at i w becomes a real one off the axis.  Mirror
    images are not listed.
    """
    size = abs(branches)
    largest = np.fmax.reduce(size, axis=1, initial=0.0)[:, None]
    # 1e-9 of the largest of its branch: a pole so near to 0 is there but for the last step of its correction
    on_axis = (abs(branches.real) <= AXIS_SHARE * size) | (size <= 1e-9 * largest)
    side = np.where(on_axis | np.isnan(branches), 0, np.sign(branches.real)).astype(int)
    becomes_real = (branches[:, :-1].imag > 0) & (branches[:, 1:].imag == 0)
    leaves = becomes_real & (side[:, :-1] == 0) & (side[:, 1:] != 0)
    found = []
    for number, (sides, poles) in enumerate(zip(side, branches, strict=True)):
        pairs = {(a, b) for a, b in pairwise(np.flatnonzero(sides).tolist()) if sides[a] != sides[b]}
        pairs |= {(n, n + 1) for n in np.flatnonzero(leaves[number]).tolist()}
        is_upper = poles.imag >= 0
        found += [
            (number, a, b)
            for a, b in sorted(pairs)
            if is_upper[[a, b]].all() and np.isfinite(poles[a:b]).all()
        ]
    return found


def _crossed(
    family: Varied, ends: Real, points: Complex, known: Sequence[Crossing], top: float
) -> tuple[float, float]:
    """The value between two (ascending) at which a branch is on the axis, and the frequency there."""
    (low, high) = ends.tolist()
    (slow, fast) = sorted(abs(points.imag).tolist())
    # 1e-3 of the highest frequency: largest distance of a crossing from where the points of its branch are
    wide = 1e-3 * top + fast - slow
    near = [each for each in known if low <= each.t <= high and slow - wide <= each.at <= fast + wide]
    if near:
        order = np.argsort(points.real)
        there = np.interp(0.0, points.real[order], abs(points.imag[order]))
        best = min(near, key=lambda each: abs(each.at - there))
        return best.t, best.at
    tolerance = 1e-15 * max(abs(low), abs(high))
    if not points.imag.all() and family.at_rest(low) * family.at_rest(high) <= 0:
        return float(brentq(family.at_rest, low, high, xtol=tolerance)), 0.0

    def pole(value: float) -> complex:
        found = family.near(np.array([value]), np.array([[np.interp(value, ends, points)]]))[0, 0]
        if np.isnan(found):
            text = f"a crossing of the imaginary axis near {family.vary} = {value:.6g} was not found"
            raise ConvergenceError(text, value, found)
        return complex(found)

    at = float(brentq(lambda value: pole(value).real, low, high, xtol=tolerance))
    return at, abs(pole(at).imag)
