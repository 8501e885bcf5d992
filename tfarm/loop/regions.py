"""The (K1, K2) plane: the exact stability boundary, and how many unstable poles each point of a grid has.

D-decomposition (Neimark 1948): at s = i w the characteristic function is linear in both gains, two real equations, so
each frequency has one point (K1, K2) with poles there: a curve.  Together with K1 = 0, where a real pole passes 0,
these curves bound regions of a constant number of unstable poles.  On a grid this number follows, column by column
(one K1 each), from the crossings along K2 and from one count, so nothing is interpolated or missed between grid points.

At C = 0 the curves collapse onto the lines K1 = 0 and K2 = 1: between them every flexible mode is damped if K1 and
1 - K2 have one sign, and unstable if not.  With both negative the hub acts like one of negative inertia, and some real
pole is unstable.  Where the gauge does not read the hub's moment each mode has such a line of its own (`lossless`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.crossing import Crossings, Window, brackets, counts_over, intervals, solved
from tfarm.errors import ParameterError
from tfarm.exact.characteristic import gains_of, loop_parts, loop_system, torque
from tfarm.exact.system import System
from tfarm.records import record
from tfarm.spectrum.scales import PAPER_GAINS, default_gains

from .frequencies import grid
from .lines import NO_FEEDBACK, ROUNDED, along, ascending, crossing_at_zero, line_crossings, static_crossings
from .lossless import locked_edges, stable_moments
from .plant import HubLoop
from .stability import loop_band, stability
from .windows import holds_undamped

INFINITE = -1  # stands for infinitely many unstable poles
MOST_GRID_GAINS = 2000  # of a map, along one gain
SHOWN_K1, SHOWN_K2 = (-1.0, 3.0), (-2.0, 2.0)  # of a map, unless told: what the paper's arm is stable in, and around it


@dataclass(frozen=True)
@record
class Region:
    """Unstable poles over a grid: `unstable` (len(K2), len(K1)), -1 where they are infinitely many.

    `boundary` (n, 3) holds K1, K2 and w [rad/s] of the D-decomposition curve; empty without losses.  `band` [rad/s] is
    how far up crossings were looked for, 0 where every mode is told; `crossings` those along K2 for each K1, or none.
    """

    arm: Arm
    held: HubFeedback
    K1: Real
    K2: Real
    unstable: NDArray[np.int64]
    boundary: Real
    band: float
    crossings: list[Crossings]

    @property
    def finding(self) -> str:
        """At how many points of the grid the loop is stable, in words."""
        return f"stable at {int(self.stable.sum())} of {self.stable.size} points"

    @property
    def axes(self) -> tuple[Real, Real]:
        """The values of both gains: across the plane, and up it."""
        return self.K1, self.K2

    @property
    def Kp(self) -> float:
        """The gain on the hub angle that it holds."""
        return self.held.Kp

    def on(self, across: Real, up: Real, unstable: NDArray[np.int64]) -> Region:
        """The same plane, with counts on another grid."""
        return replace(self, K1=across, K2=up, unstable=unstable)

    @property
    def freed(self) -> Arm:
        """The arm without what its hub loses, if only that hides a reactive one (`HubLoop.freed`), else itself."""
        return HubLoop(self.arm, self.held).freed.arm

    @property
    def upright(self) -> float:
        """The K1 that takes from a `freed` arm what its hub loses."""
        return 0.0 - self.arm.rate_loss

    @property
    def stable_intervals(self) -> list[list[Window]]:
        """For each K1 the intervals of K2, cut to the map, in which nothing grows: the region with exact edges.

        Of a `freed` arm the same for every K1 > `upright`, by Lyapunov's theorem and the static balance, and none for
        others.
        """
        low, high, arm = float(self.K2[0]), float(self.K2[-1]), self.freed
        if arm.is_reactive:
            law = self.held.at(1.0, 0.0)
            static = [each.t for each in static_crossings(arm, along("K2", law))]
            ends = {low, high, *stable_moments(arm), *static}
            pairs = itertools.pairwise(sorted(end for end in ends if low <= end <= high))
            loop = HubLoop(arm, law)
            held = [pair for pair in pairs if holds_undamped(replace(loop, law=law.having("K2", sum(pair) / 2)))]
            return [held if self.upright < K1 else [] for K1 in self.K1]
        first = self.unstable[0].tolist()
        return [intervals(found, low, high, low, count) for found, count in zip(self.crossings, first, strict=True)]

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Where no pole is unstable, the free hub angle has not two poles at 0 (K1 = Kp = 0), and something damps."""
        drifts = (self.K1 == 0) & self.arm.has_rigid_mode & (self.Kp == 0)
        swings = (self.upright == self.K1) & self.freed.is_reactive
        no_moment_is_left = np.equal(self.K2, self.arm.input_per_torque) & self.freed.is_told_by_lyapunov
        untold = (self.upright >= self.K1) & (not self.arm.hub_side_inertia)  # a pole has passed through infinity
        return np.asarray((self.unstable == 0) & ~(drifts | swings | untold) & ~no_moment_is_left[:, None])


def region(arm: Arm, K1: Real, K2: Real, held: HubFeedback = NO_FEEDBACK) -> Region:
    """The map over the grid of K1 and K2 (1-D, ascending), the other gains as in `held`, all on the hub's own outputs.

    What a hub loses beside an arm without losses is added to K1, for which the theorems of such an arm then hold.  A
    grid line exactly on K1 = 0 or K2 = 1 at C = 0 is not stable, though no pole need be right of the axis there, nor
    is K1 = 0 where the hub angle is free.  Raises ParameterError where there is no loop or the grid is empty.
    """
    K1, K2 = ascending("K1", K1, MOST_GRID_GAINS), ascending("K2", K2, MOST_GRID_GAINS)
    held = held.at(0.0, 0.0)
    for gain in held.elsewhere:
        remedy = (
            "0: the plane of two gains is that of what is at the hub; of other laws ask for their own numbers, vary="
        )
        raise ParameterError(key=gain.name, value=held[gain.name], remedy=remedy)
    free = HubLoop(arm, held.at(float(K1[-1]), float(K2[-1]))).freed.arm
    if free.is_told_by_lyapunov:
        counts = _undamped_counts(free, K1 + arm.rate_loss, K2, held)
        return Region(arm, held, K1, K2, counts, np.empty((0, 3)), 0.0, [])
    if free.is_reactive:
        counts, band = _lossless_counts(free, K1 + arm.rate_loss, K2, held), float(locked_edges(free).at.max())
        return Region(arm, held, K1, K2, counts, np.empty((0, 3)), band, [])
    corners = [held.at(float(a), float(b)) for a in (K1[0], K1[-1]) for b in (K2[0], K2[-1])]
    band = max(loop_band(HubLoop(arm, law))[0] for law in corners)
    omega = np.asarray(grid(arm, band))
    without = held.at(float(K1[-1]), 0.0)
    last = np.array([stability(arm, without).unstable_roots])
    (without_K2,) = counts_over(K1, [line_crossings(arm, along("K1", without), band)], float(K1[-1]), last)
    found = _crossings_along_K2(arm, K1, held, omega)
    unstable = counts_over(K2, found, 0.0, without_K2).T
    if arm.loses_at_hub_alone and arm.reads_hub_moment and not arm.input_lags:
        # a hub without inertia behind a spring, which is not `freed`: of elastic links every mode is driven
        taken = np.sign(1.0 - K2[:, None] / arm.input_per_torque) * np.sign(K1 + arm.rate_loss)
        unstable = np.where(taken < 0, INFINITE, unstable)  # as `HubLoop.takes_energy` says
    return Region(arm, held, K1, K2, unstable, boundary(arm, omega, held), band, found)


def ranges_of(arm: Arm) -> tuple[tuple[float, float], tuple[float, float]]:
    """The ranges of K1 and K2 that a map has unless others are asked for: of a rig, in its own units."""
    K1 = 1.0 if arm.is_uniform else default_gains(arm).K1 / PAPER_GAINS.K1
    K2 = arm.input_per_torque
    (low, high), (lower, upper) = SHOWN_K1, SHOWN_K2
    return (low * K1, high * K1), (lower * K2, upper * K2)


def between(low: float, high: float, number: int) -> Real:
    """So many gains from low to high, the middles of equal parts: none of them on a line K1 = 0 unless by chance."""
    values = low + (high - low) * (np.arange(number) + 0.5) / number
    return np.where(abs(values) <= ROUNDED * (high - low), 0.0, values)


def _undamped_counts(arm: Arm, K1: Real, K2: Real, held: HubFeedback) -> NDArray[np.int64]:
    """Unstable poles at C = 0: one count for each side of the static limit where they are finitely many."""
    static = crossing_at_zero(arm, along("K2", held.at(1.0, 0.0)))
    side = np.zeros(K2.size, bool) if static is None else static.t < K2
    unstable = np.zeros((K2.size, K1.size), dtype=np.int64)
    of_K1, of_K2 = np.sign(K1), np.sign(K2 - arm.input_per_torque)  # at 1 N m a N m nothing of the moment is left
    for of_column, of_row, each in itertools.product((-1, 0, 1), (-1, 0, 1), (True, False)):
        (columns,), (rows,) = np.nonzero(of_K1 == of_column), np.nonzero((of_K2 == of_row) & (side == each))
        if rows.size and columns.size:
            law = held.at(float(K1[columns[columns.size // 2]]), float(K2[rows[rows.size // 2]]))
            unstable[np.ix_(rows, columns)] = _counted(arm, law)
    return unstable


def _counted(arm: Arm, law: HubFeedback) -> int:
    """The unstable poles of one loop, or INFINITE."""
    found = stability(arm, law)
    return INFINITE if found.unstable_roots_infinite else found.unstable_roots


def _lossless_counts(arm: Arm, K1: Real, K2: Real, held: HubFeedback) -> NDArray[np.int64]:
    """The same where the gauge does not read the hub's moment: for K1 > 0 of the modes of `locked_edges`.

    K1 < 0 mirrors the poles, so that infinitely many are unstable; at K1 = 0 each loop is counted by itself.
    """
    unstable = np.full((K2.size, K1.size), INFINITE, dtype=np.int64)
    law = held.at(default_gains(arm).K1, 0.0)
    found = Crossings.of([*locked_edges(arm), *static_crossings(arm, along("K2", law))])
    (counts,) = counts_over(K2, [found], 0.0, np.array([stability(arm, law).unstable_roots]))
    unstable[:, K1 > 0] = counts[:, None]
    if (K1 == 0).any():
        unstable[:, K1 == 0] = [[_counted(arm, held.at(0.0, float(each)))] for each in K2]
    return unstable


def _crossings_along_K2(arm: Arm, K1: Real, held: HubFeedback, omega: Real) -> list[Crossings]:
    """The crossings along K2 for each K1, all columns solved at once."""
    k = loop_system(arm)
    laws = [held.at(float(each), 0.0) for each in K1]
    rows = np.array([[float(gain) for gain in gains_of(k, law)] for law in laws]).T
    along_K2 = [float(gain) for gain in gains_of(k, HubFeedback(K2=1.0))]
    fixed, by_K1 = _h(k, omega, held), _h(k, omega, held.at(1.0, 0.0))
    (column, before), change = brackets(fixed + K1[:, None] * (by_K1 - fixed))

    def parts(w: Real) -> tuple[Complex, Complex]:
        drive, numerators, _ = loop_parts(k, 1j * w)
        return drive + torque(rows[:, column], numerators), torque(along_K2, numerators)

    at, t = solved(parts, omega[before], omega[before + 1])
    found = []
    for n, law in enumerate(laws):
        here = column == n
        solved_here = zip(t[here], at[here], change[here], strict=True)
        found.append(Crossings.of([*solved_here, *static_crossings(arm, along("K2", law))]))
    return found


def _h(k: System, omega: Real, law: HubFeedback) -> Real:
    """Im(N P*) along K2 from a law on (see `lines`), in units of the sizes of its parts."""
    drive, numerators, _ = loop_parts(k, 1j * omega)
    along_K2 = torque(map(float, gains_of(k, HubFeedback(K2=1.0))), numerators)
    N = drive + torque(map(float, gains_of(k, law)), numerators)
    return np.asarray((N * along_K2.conj()).imag / (abs(along_K2) * (abs(drive) + abs(numerators[0])) + LEAST_SIZE))


def boundary(arm: Arm, omega: Real, held: HubFeedback) -> Real:
    """K1 and K2 with poles at +-i w, and w: (n, 3), in the order of omega."""
    k = loop_system(arm)
    drive, numerators, _ = loop_parts(k, 1j * omega)
    laws = (held, HubFeedback(K1=1.0), HubFeedback(K2=1.0))
    N, a, b = (torque(map(float, gains_of(k, law)), numerators) for law in laws)
    N, determinant = drive + N, (a * b.conj()).imag
    with np.errstate(all="ignore"):  # where both equations are one, the point is far away
        K1 = -(N * b.conj()).imag / determinant
        K2 = (N * a.conj()).imag / determinant
    points = np.stack([K1, K2, omega], axis=1)
    return points[np.isfinite(points).all(1)]
