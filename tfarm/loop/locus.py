"""Root loci of the exact rig: branches that keep their identity, and where they cross the imaginary axis.

At a few values the winding number counts the poles of a box: there the list is complete.  In between each pole is
followed (`tfarm.spectrum.following`), vectorised over values and poles.  Branches are named after the modes of the rig
without feedback (`tfarm.loop.branches`).

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
from tfarm.loop.branches import ORIGIN, at_origin, follow_poles, origin_name
from tfarm.loop.lines import line_crossings
from tfarm.loop.varied import ARM_PARAMETERS, OF_THE_LAW, Title, Varied
from tfarm.loop.windows import without_losses
from tfarm.records import frozen
from tfarm.response.frequency import AXIS_SHARE
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Quantity
from tfarm.spectrum.box import Box
from tfarm.spectrum.following import interpolate_roots

# values, those between that make it round among them
MOST_LOCUS_POINTS = 100_000


@frozen
class Locus(OfCase):
    """The closed-loop poles of an arm under a law, as one number varies.

    `gain` (n,) are the values of what `vary` names: a number of the law, "all" (a factor on it) or of the arm;
    `branches` (b, n) [1/s] are poles followed: those at s = 0, then in the order of the modes they continue from
    (`origin` (b,): its number, or an `Origin`).  The mirror image of a branch is left out, unless the two meet on the
    real axis and part there: then it is a branch of its own, with Im s < 0 where they are a pair.  A branch is NaN
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
    crossings: Annotated[
        tuple[BranchCrossing, ...],
        Quantity(
            "crossings of the imaginary axis",
            help="solved for, not interpolated; in the order of the range",
        ),
    ]
    followed: Complex = field(repr=False, compare=False)
    listed: Whole = field(repr=False, compare=False)
    in_box: bool = False

    @cached_property
    def smooth(self) -> Locus:
        """The same with the values between that round lines take."""
        return refine_branches(self)

    @property
    def finding(self) -> str:
        """The first three crossings of the imaginary axis."""
        if not self.crossings:
            return "no branch crosses the imaginary axis"
        shown = self.crossings[:3]
        first = ", ".join(f"{each.direction} at {self.vary} = {each.gain:.6g}" for each in shown)
        more = len(self.crossings) - len(shown)
        others = f" and {more} more" if more else ""
        return f"a pole becomes {first}{others}"

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
    most = None if in_box else branches - family.pinned
    listed = np.flatnonzero(is_shown.any(axis=1) & is_upper)[:most]
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
    """Return the branches listed after the poles pinned at 0, NaN outside the box where there is one."""
    found: Complex = np.concatenate([np.zeros((pinned, rows.shape[1]), complex), rows[listed]])
    # no -0
    found += 0.0
    return found if box is None else np.where(box.holds(found), found, np.nan)


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
        own = np.array([*map(frame, branches)])
        common = np.array([frame(branches), view(branches, found.origin)])
        sizes = [np.diff(each)[:, ::2, None] for each in (own, common[:1], common[1:])]
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
    """Return left, right, low and high [1/s] of the picture of all these branches, with the imaginary axis."""
    points = branches[~np.isnan(branches)]
    if not points.size:
        return 0.0, 1.0, 0.0, 1.0
    left = float(points.real.min(initial=0.0))
    right = float(points.real.max(initial=0.0))
    low = float(points.imag.min())
    high = float(points.imag.max())
    # less than 1e-12 of the size of its poles is rounding of a constant pole; 1 where no pole moves from 0
    wide = max(right - left, 1e-12 * float(abs(points).max())) or 1.0
    # where none of them oscillates
    tall = max(high - low, 1e-9 * high) or wide
    return left, left + wide, low, low + tall


def view(branches: Complex, origin: Whole) -> tuple[float, float, float, float]:
    """Return the same of a picture scaled to the modes, Im s >= 0, not to far real poles or those of other origins."""
    of_modes = branches[origin > 0]
    oscillating = of_modes[of_modes.imag > 0]
    if not oscillating.size:
        return frame(branches)
    left, right, _, high = frame(oscillating)
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
    if changes or is_damped:
        # between two values a branch may be higher
        band = max(top, 1.01 * float(np.nanmax(branches.imag, initial=0.0)))
        try:
            known = linear_crossings(family, low, high, band)
        except ConvergenceError:
            # two poles meet at s = 0, and those of modes that rest are on the axis throughout
            if is_damped:
                raise

    def crossing(at: float, omega: float, change: float, branch: int | None = None) -> BranchCrossing:
        name = None if branch is None else origin_name(int(origin[branch]))
        direction = "unstable" if way * change > 0 else "stable"
        return BranchCrossing(at, omega, branch, direction, name, family.title)

    found = []
    for number, *step in changes:
        step.sort(key=lambda n: gain[n])
        points = branches[number, step]
        at, omega = _crossing_between(family, gain[step], points, known, top)
        found.append(crossing(at, omega, points[1].real - points[0].real, number))
    # 1e-9 of the range: a crossing so near to an end is at the end, and not between
    seen = {(own.gain, own.omega) for own in found}
    at_end = 1e-9 * (high - low)
    for each in known if is_damped else ():
        is_between = low + at_end < each.t < high - at_end
        if is_between and not top < each.at < math.inf and (each.t, each.at) not in seen:
            found.append(crossing(*each))
    return tuple(sorted(found, key=lambda own: (way * own.gain, own.omega)))


def linear_crossings(family: Varied, low: float, high: float, band: float) -> list[Crossing]:
    """Return the crossings up to a band [rad/s] along a number in which D is linear; none along another."""
    if family.is_of_arm or family.vary == "delay":
        return []
    loop = family.first.under(family.full)
    name = "gain" if family.vary == "all" else family.vary
    return list(without_losses(loop, name, line_crossings(loop, name, low, high, band)))


def _changes(branches: Complex) -> list[tuple[int, int, int]]:
    """Return each branch that changes sides, with the numbers of its last value before and the first after.

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
        for a, b in sorted(pairs):
            if (poles[[a, b]].imag >= 0).all() and np.isfinite(poles[a:b]).all():
                found.append((number, a, b))
    return found


def _crossing_between(
    family: Varied, ends: Real, points: Complex, known: Sequence[Crossing], top: float
) -> tuple[float, float]:
    """Return the value between two (ascending) at which a branch is on the axis, and the frequency there."""
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
