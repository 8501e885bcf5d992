"""The plane of two numbers of a law: how many poles are unstable over a grid, and the exact stability boundary.

D-decomposition (Neimark 1948): D is affine in each number (`windows`).  Its crossings of the imaginary axis are solved
for along the second number, all columns at once, and one count of unstable poles gives all others.  Nothing is
interpolated or missed between grid points.  D is not affine in a delay: that is the number across the columns, each of
which is counted by itself.

In the plane of K1 and K2 each frequency has one point with poles at s = i w: the boundary.  Without damping, where the
gauge reads the hub's moment, it collapses onto two lines.  On one K1 cancels the friction of the hub, on the other K2
cancels the whole moment; between them a theorem decides the stability of every mode (`theorem`).

For pictures: axes, and the boundary in short segments.  The D-decomposition is evaluated inside a long segment; where
the curve leaves the picture, or passes through infinity, it is cut.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cached_property, partial
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, AnyLaw, Arm, HubFeedback, Law
from tfarm.arm.feedback import ON
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.crossing import Crossings, Window, check_ascending, counts_over
from tfarm.crossing.shown import PlaneOfCounts
from tfarm.errors import ConvergenceError, ParameterError, require
from tfarm.loop.continuous import ContinuousLoop, grid
from tfarm.loop.lines import (
    LEADING,
    Along,
    LawTerms,
    cross_axis,
    line_crossings,
    static_edge,
    unstable_below,
    with_numbers,
)
from tfarm.loop.plane_axes import Axis, cell_middles
from tfarm.loop.stability import band_of_family, verdict_on
from tfarm.loop.windows import theorem_edges, theorem_windows
from tfarm.records import frozen
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Quantity
from tfarm.spectrum import modes
from tfarm.spectrum.gains import default_gains
from tfarm.spectrum.table import hub_locked

# count of infinitely many unstable poles
INFINITE = -1


class BoundaryLines(NamedTuple):
    """The exact boundary in a picture of the plane of both gains.

    `points` (n, 3) are both gains and w [rad/s], with rows of nan where it leaves the picture.  A real pole passes
    through 0 at the gains `upright` and `level`, None without one.  At the points `ends` (n, 3) a stability interval
    ends.  Without losses in the links there is instead `resting`, the first frequencies [rad/s] with the hub at rest.
    """

    points: Real
    upright: float | None
    level: float | None
    ends: Real
    resting: Real


@frozen
class Plane(PlaneOfCounts):
    """Unstable poles over a grid of two numbers: `unstable` (len(y), len(x)), -1 where they are infinitely many.

    `vary` names both numbers of `law`, across and up, as `Law.with_number` does.  `boundary` (n, 3) holds both gains
    and w [rad/s] of the D-decomposition curve of K1 and K2; empty without losses and of other numbers.  `band` [rad/s]
    is the frequency range of the crossings, 0 where every mode is known; `crossings` those along y for each x, or none.
    """

    loop: ContinuousLoop
    vary: Annotated[tuple[str, str], Quantity("plane of", help="the two numbers that vary, across and up")]
    x: Annotated[Real, Quantity(curve=True, help="values of the first number")]
    y: Annotated[Real, Quantity(curve=True, help="values of the second number")]
    unstable: NDArray[np.int64]
    boundary: Real
    band: Annotated[
        float, Quantity(key="up_to_rad_s", help="end of the range; 0 where a theorem decides every mode")
    ]
    crossings: list[Crossings]

    @property
    def reach(self) -> Annotated[str, Quantity("frequency range", help="poles in it are counted completely")]:
        """The frequency range in words."""
        if self.band:
            return f"up to {self.band:.6g} rad/s"
        return "every mode, by a theorem"

    @property
    def arm(self) -> Arm:
        """The arm of the loop."""
        return self.loop.arm

    @property
    def law(self) -> Law:
        """The law of the loop, both numbers as they were given."""
        return self.loop.law

    @property
    def controller(self) -> Annotated[ControllerSignals, Quantity(flat=True)]:
        """Names of the arm and the controller."""
        return controller(self.law, self.arm)

    @property
    def counts(
        self,
    ) -> Annotated[
        list[list[int | float]],
        Quantity(
            key="unstable_roots", help="unstable poles at each point, rows upwards; inf where infinitely many"
        ),
    ]:
        """Unstable poles over the grid, rows upwards, infinity where they are infinitely many."""
        return np.where(self.unstable == INFINITE, math.inf, self.unstable.astype(object)).tolist()

    @property
    def boundary_inside(
        self,
    ) -> Annotated[
        list[list[float]],
        Quantity(
            key="boundary", help="both gains and the frequency [rad/s] with poles on the imaginary axis"
        ),
    ]:
        """The points of `boundary` inside the plane."""
        gains = self.boundary[:, :2]
        low = [self.x[0], self.y[0]]
        high = [self.x[-1], self.y[-1]]
        return self.boundary[((gains >= low) & (gains <= high)).all(axis=1)].tolist()

    @property
    def is_of_gains(self) -> bool:
        """Whether it is the plane of K1 and K2."""
        return self.vary == PLANE and self.loop.is_of_gains

    @property
    def is_known(self) -> bool:
        """Whether a theorem decides every mode at each point: no damping in the links, gains at the hub alone."""
        return self.is_of_gains and _is_known_everywhere(self.loop)

    @property
    def Kp(self) -> float:
        """The constant gain on the hub angle."""
        return self.loop.numbers.get(ANGLE_GAIN, 0.0)

    @property
    def upright(self) -> float:
        """The K1 that cancels the friction of the hub."""
        return 0.0 - self.arm.rate_loss

    @cached_property
    def boundary_lines(self) -> BoundaryLines:
        """The boundary in a picture of the plane as it is."""
        return boundary_lines(self, *map(Axis.of, self.axes))

    @property
    def stable_intervals(self) -> list[list[Window]]:
        """For each x the stability intervals of y, cut to the map.

        Where a theorem decides they are the same for every K1 > `upright`, and none for others.
        """
        if not self.is_known:
            return super().stable_intervals
        limits = float(self.y[0]), float(self.y[-1])
        loop = self.loop.with_number(RATE_GAIN, self.upright + default_gains(self.arm).K1)
        stable = theorem_windows(loop, MOMENT_GAIN, limits, theorem_edges(loop, MOMENT_GAIN, limits))
        return [stable if self.upright < K1 else [] for K1 in self.x]

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Points without unstable pole, double pole of the free hub angle at 0 (K1 = Kp = 0), or undamped modes."""
        if not self.is_of_gains:
            return super().stable
        arm = self.arm
        drifts = (self.x == 0) & arm.has_rigid_mode & (self.Kp == 0)
        swings = (self.upright == self.x) & arm.loses_at_hub_alone
        # a pole has passed through infinity
        passed = (self.upright >= self.x) & (not arm.hub_side_inertia)
        no_moment_is_left = np.equal(self.y, arm.input_per_torque) & self.is_known
        return np.asarray((self.unstable == 0) & ~(drifts | swings | passed) & ~no_moment_is_left[:, None])


def gain_map(
    arm: Arm,
    K1: Real,
    K2: Real,
    Kp: float = 0.0,
    *,
    law: AnyLaw | None = None,
    vary: tuple[str, str] | None = None,
) -> Plane:
    """Return the number of unstable poles over the plane of K1 and K2 (1-D, ascending), and its exact boundary.

    Of a `law` `vary` names two of its numbers ("gain", "delay", a signal, "SIGNAL.num.N", "SIGNAL.den.N", "K1"), whose
    values are then given, first across and then up.  A grid line exactly on K1 = 0 or K2 = 1 at C = 0 is not stable,
    though no pole need be right of the axis there, nor is K1 = 0 where the hub angle is free.
    Raises ParameterError for an invalid law, loop or range, ConvergenceError where poles cannot be counted.
    """
    if law is None:
        require(vary is None, "law", None, "give the HubFeedback or Law whose numbers vary names")
        return plane(ContinuousLoop(Case(arm, HubFeedback(Kp=Kp))), PLANE, K1, K2)
    loop = ContinuousLoop(Case(arm, law))
    require(not Kp, ANGLE_GAIN, Kp, "give Kp in the law, or no law")
    if vary is None and loop.is_of_gains:
        vary = PLANE
    match vary:
        case (str() as across, str() as up):
            return plane(loop, (across, up), K1, K2)
    raise ParameterError(key="vary", value=vary, remedy='two numbers of the law, such as ("gain", "delay")')


def plane(loop: ContinuousLoop, vary: tuple[str, str], x: Real, y: Real) -> Plane:
    """Return the map over two numbers of the law of a loop, x and y (1-D, ascending), the others constant.

    Raises ParameterError for an unknown number, an invalid loop or range; ConvergenceError where poles cannot be
    counted.
    """
    # in the name of a number in which L is not affine: its size is not largest at corners
    not_affine = ("delay", ".den.")
    require(vary[0] != vary[1], "vary", list(vary), "two different numbers of the law")
    is_of_gains = vary == PLANE and loop.is_of_gains
    if is_of_gains:
        loop = loop_at(loop, PLANE, (0.0, 0.0))
    # most values of a map, along one number of a law, and along one gain
    most = 2000 if loop.is_of_gains else 400
    x = check_ascending(vary[0], x, 2, most)
    y = check_ascending(vary[1], y, 2, most)
    across = (float(x[0]), float(x[-1]))
    up = (float(y[0]), float(y[-1]))
    remedy = (
        "a leading coefficient keeps its sign in a map, as without it the order is another: a range without 0"
    )
    for name, (low, high) in zip(vary, (across, up), strict=True):
        require(not name.endswith(LEADING) or low * high > 0, name, [low, high], remedy)
    corners = [loop_at(loop, vary, each) for each in itertools.product(across, up)]
    if _is_known_everywhere(loop) and tuple(ON.get(n, n) for n in vary) == PLANE:
        counts = _known_counts(loop, x, y)
        return Plane(loop, vary, x, y, counts, np.empty((0, 3)), 0.0, [])
    if vary[1] == "delay":
        turned = plane(loop, (vary[1], vary[0]), y, x)
        return replace(turned, vary=vary, x=x, y=y, unstable=turned.unstable.T.copy(), crossings=[])
    band, is_quiet = band_of_family(corners)
    # from K2 = 0, where the hub is passive, a count is carried to the range: real poles between pass through 0 too
    searched = (min(up[0], 0.0), max(up[1], 0.0)) if vary == PLANE else up
    found = _columns(loop, vary, x, searched, band)
    crossing = np.concatenate([y[:0], *(each.gain for each in found)])
    at = 0.0 if vary == PLANE else float(y[_farthest(y, crossing)])
    there = _counts_across(loop.with_number(vary[1], at), vary[0], x, band)
    unstable = counts_over(y, found, at, there).T.copy()
    edge = boundary(loop, np.asarray(grid(loop.arm, band))) if is_of_gains else np.empty((0, 3))
    done = Plane(loop, vary, x, y, unstable, edge, band, found)

    def count_at(*point: float) -> int | None:
        try:
            return unstable_below(loop_at(loop, vary, point), band)
        except ConvergenceError:
            # a pole on the axis to working precision, which is on either side
            return None

    # poles may enter or leave the band through its top, between the corners
    is_affine = not any(part in name for part, name in itertools.product(not_affine, vary))
    if not (is_quiet and is_affine):
        reach = f"{band:.4g} rad/s"
        remedy = f"some cross the end of the frequency range, {reach}; ask for a smaller range of values"
        done.must_agree(count_at, remedy)
    return done


def _columns(
    loop: ContinuousLoop, vary: tuple[str, str], x: Real, up: Window, band: float
) -> list[Crossings]:
    """Return the crossings along the second number at each value of the first; of gains of parts all at once."""
    terms = LawTerms(loop.signals, loop.law, [])
    if None in map(terms.part, vary):
        return [line_crossings(loop.with_number(vary[0], value), vary[1], *up, band) for value in x.tolist()]
    lines = [terms.with_number(vary[0], value).line(vary[1], *up) for value in x.tolist()]
    members = (partial(loop.with_number, vary[0], value) for value in x.tolist())
    loops = [Along(member, vary[1], line) for member, line in zip(members, lines, strict=True)]
    return [column() for column in cross_axis(loop.arm, terms, band, loops)]


def loop_at(loop: ContinuousLoop, vary: tuple[str, str], point: tuple[float, ...]) -> ContinuousLoop:
    """Return the loop at a point of the plane of two numbers of its law."""
    return loop.under(with_numbers(loop.law, dict(zip(vary, point, strict=True))))


def _is_known_everywhere(loop: ContinuousLoop) -> bool:
    """Return whether a theorem decides every mode for any K1 and K2."""
    return loop.is_moved_at_hub_alone and loop.arm.reads_hub_moment and not loop.arm.input_lags


def _known_counts(loop: ContinuousLoop, K1: Real, K2: Real) -> NDArray[np.int64]:
    """Return unstable poles without damping: one count for each side of each line on which modes meet the axis."""
    limits = float(K2[0]), float(K2[-1])
    static = static_edge(loop.with_number(RATE_GAIN, default_gains(loop.arm).K1), MOMENT_GAIN, limits)
    unstable = np.zeros((K2.size, K1.size), dtype=np.int64)
    side = np.sign(K1 + loop.arm.rate_loss) + 3 * np.sign(K2 - loop.arm.input_per_torque)[:, None]
    if static is not None:
        side += 9.0 * (static.t < K2)[:, None]
    for each in np.unique(side):
        is_there = side == each
        row, column = np.median(np.nonzero(is_there), axis=1).astype(int)
        found = verdict_on(loop_at(loop, PLANE, (float(K1[column]), float(K2[row]))))
        unstable[is_there] = INFINITE if found.unstable_roots_infinite else found.unstable_roots
    return unstable


def _counts_across(row: ContinuousLoop, name: str, x: Real, band: float) -> NDArray[np.int64]:
    """Return unstable poles at each x along a row, from one count far from its crossings; of a delay one at each."""
    if name == "delay":
        return np.array([unstable_below(row.with_number(name, value), band) for value in x.tolist()])
    across = line_crossings(row, name, float(x[0]), float(x[-1]), band)
    start = float(x[_farthest(x, across.gain)])
    return unstable_below(row.with_number(name, start), band) + across.passed(x) - across.passed(start)


def _farthest(values: Real, at: Real) -> int:
    """Return the index of the value that is farthest from all crossings; of the middle one where there are none."""
    if at.size:
        return int(np.argmax(abs(values[:, None] - at).min(axis=1)))
    return values.size // 2


def boundary(loop: ContinuousLoop, omega: Real) -> Real:
    """Return K1 and K2 with poles at +-i w, the other gains those of the loop, and w: (n, 3), in the order of omega."""
    if loop.arm.loses_at_hub_alone:
        # both equations are one
        return np.empty((0, 3))
    apart = loop_at(loop, PLANE, (0.0, 0.0))
    terms = LawTerms(apart.signals, apart.law, [])
    rows = terms.at(1j * omega)
    N = terms.weights @ rows
    a, b = (terms.line(name).alone @ rows for name in PLANE)
    determinant = (a * b.conj()).imag
    # where both equations are one, the point is far away
    with np.errstate(all="ignore"):
        K1 = -(N * b.conj()).imag / determinant
        K2 = (N * a.conj()).imag / determinant
    points = np.stack([K1, K2, omega], axis=1)
    return points[np.isfinite(points).all(1)]


def deepest_moment_gain(arm: Arm) -> float:
    """Return the lowest moment gain at which unstable gains are searched."""
    return -50.0 * arm.input_per_torque


def moment_axis(arm: Arm, x: Axis) -> Axis:
    """Return the axis of the moment gain, -4 to 2 times `input_per_torque`, or down to the lowest unstable gain."""
    low = -4.0 * arm.input_per_torque
    high = 2.0 * arm.input_per_torque
    deepest = deepest_moment_gain(arm)
    if arm.is_undamped:
        return Axis(low, high)
    # 32 columns of the picture in which unstable gains are searched
    across = x.grid(32)
    # 400 values between, at which they are searched
    deep = gain_map(arm, across[across > 0], cell_middles(deepest, low, 400))
    rows = np.nonzero(~deep.stable.all(axis=1))[0]
    if not rows.size:
        return Axis(low, high)
    # the picture is deeper than all of them, so that the region ends in it
    return Axis(max(deepest, 1.4 * float(deep.axes[1][rows[0]])), high, high)


def edge(found: Plane, x: Axis, y: Axis) -> Real:
    """Return the boundary in the picture, refined where it is coarse, with a row of nan after each of its parts."""
    # of the picture: longer pieces of the boundary do not look straight, and are cut
    short = 0.008
    # of the picture: a piece longer than that after all cuts is a jump through infinity, and not drawn
    long = 0.03
    points = found.boundary
    # rounds of cutting at most: 2^-30 of a step between frequencies is less than a pixel
    for _ in range(30):
        length, is_seen = _segments(points, x, y)
        low = points[:-1, 2]
        high = points[1:, 2]
        middle = np.sqrt(low * high)
        is_coarse = (length > short) & is_seen & (low < middle) & (middle < high)
        if not is_coarse.any():
            break
        points = np.concatenate([points, boundary(found.loop, middle[is_coarse])])
        points = points[np.argsort(points[:, 2])]
    length, is_seen = _segments(points, x, y)
    parts = np.split(points, np.flatnonzero(~is_seen | (length >= long)) + 1)
    gap = np.full((1, 3), np.nan)
    drawn = [gap[:0]]
    for part in parts:
        if len(part) > 1:
            drawn += [part, gap]
    return np.concatenate(drawn)


def _segments(points: Real, x: Axis, y: Axis) -> tuple[Real, NDArray[np.bool_]]:
    """Return the drawn length of each segment, and whether it may pass through the picture."""
    places = np.array([x.place(points[:, 0]), y.place(points[:, 1])])
    low = np.minimum(places[:, :-1], places[:, 1:])
    high = np.maximum(places[:, :-1], places[:, 1:])
    is_seen = ((high >= 0) & (low <= 1)).all(axis=0)
    return np.hypot(*np.diff(places)), np.asarray(is_seen)


def stable_edge(found: Plane) -> Real:
    """Return K1 > 0, K2 and frequency [rad/s] (n, 3) where pairs of poles cross at an end of a stability interval."""
    ends = []
    for K1, column, stable in zip(found.x.tolist(), found.crossings, found.stable_intervals, strict=True):
        edges = np.ravel(stable)
        ends += [(K1, each.t, each.at) for each in column if each.t in edges]
    points = np.reshape(ends, (-1, 3))
    return points[(points[:, 0] > 0) & (points[:, 2] > 0) & np.isfinite(points[:, 2])]


def boundary_lines(found: Plane, x: Axis, y: Axis) -> BoundaryLines:
    """Return the boundary in a picture with these axes."""
    if found.arm.loses_at_hub_alone:
        none = np.empty((0, 3))
        return BoundaryLines(none, None, None, none, hub_locked(modes(found.arm, 3)).natural_frequency)
    return BoundaryLines(edge(found, x, y), *static_edges(found), stable_edge(found), np.empty(0))


def static_edges(found: Plane) -> tuple[float | None, float | None]:
    """Return the gains at which a real pole passes through 0: an upright line of the boundary, and a level one."""
    upright = found.upright if found.arm.has_rigid_mode and found.Kp == 0 else None
    loop = found.loop
    up = float(abs(found.y).max())
    level = static_edge(loop.with_number(RATE_GAIN, 1.0), MOMENT_GAIN, (-up, up))
    return upright, None if level is None else level.t
