"""Gain, phase, delay and disk margin of the exact loop function L(i w), and never without the verdict.

Margins of an unstable loop have no meaning.  At C = 0 the loop function has poles on the axis at ever higher frequency,
so that any delay, however short, destabilises some mode: the exact delay margin is 0.  With K2 != 0 the exact disk
margin is 0 too and the peak sensitivity infinite; with K2 = 0 the hub is passive, and both are finite.  The margins up
to a band are listed in addition, with the band.

Phase margins have the sign of python-control: where |L| = 1 the angle from -1 to L, in (-180, 180] deg.  A positive one
is a margin for lag, a negative one for lead; of a stable loop neither sign is an instability.

Disk margin: the largest alpha for which the loop is stable with every factor (2 + alpha d)/(2 - alpha d), |d| < 1
(Seiler, Packard and Gahinet 2020, symmetric disks), which is 2 min |(1 + L)/(1 - L)|.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Annotated, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.crossing import brackets, crossed, zeros_between
from tfarm.records import record
from tfarm.schema import At, Quantity

from .continuous import ContinuousLoop, grid
from .stability import BAND, Stability, is_quiet, stability
from .theorem import Lyapunov, Signs, lyapunov, signs_of_loop, theorem_of
from .windows import Windows, reach_words, windows_of

MARGIN_DIGITS, PLACE_DIGITS = 9, 7  # of a margin, at most, and of the frequency of a dip, where its depth is flat
CROSSOVER_DIGITS = 12  # of the value at each crossover, at most: more than any table rounds to
NEXT_DOUBLES = 2.0**-52 * np.arange(-16, 17, 4)  # on either side of a frequency, in shares of it: as L is rounded
FARTHER = 8.0 ** np.arange(-16, -5)  # the same, until rounding no longer decides the side of the axis that L is on
BELOW_SLOWEST = 20.0  # of the lowest frequency of interest: where the curve of L begins
ABOVE_NOISE = 4.0  # times what neighbours differ by
ROUND_POINTS, ROUNDS = 17, 7  # of ever narrower grids around a dip, an eighth each time: 1e-6 of the first is left
LOWEST = 6  # local minima on the grid that are refined
AT_POLE = 1e-9  # a factor on L so small belongs to a pole of L on the axis, where L changes its sign through infinity
REST = 1e-3  # of the size of -1/L: largest imaginary part, and change from half the lowest frequency on, at rest
BELOW_SLOWEST_POLE = 0.05  # of its size: so far down |L| may cross 1
SLOW_POINTS = 400  # from there to the grid of the arm
NEAR_POLES = np.geomspace(0.05, 20.0, 12)  # points about a pole, in its distances from the axis
NEAR_POLES = np.r_[-NEAR_POLES, 0.0, NEAR_POLES]  # on both sides
UNLIMITED = {"disk": 2.0, "peak_sensitivity": 1.0}  # sizes of a passive loop, at no frequency of its own; else inf
SAME_SIZE = 1e-7  # of such a size: so much rounding leaves next to a narrow resonance
NO_WINDOWS = "no stability intervals: with an undamped link all modes meet on the axis"

GAIN_MARGIN = Quantity("gain margin, factors down and up", help="factors on L between which the loop stays stable")
PHASE_MARGIN = Quantity("phase margin", "deg", help="of least size where |L| = 1; above 0 for lag, below for lead")
LAG = "least phase lag of L that destabilises the loop; inf without a limit"
PHASE_LAG = Quantity("phase margin for lag", "deg", key="phase_lag_deg", help=LAG)
PHASE_LEAD = Quantity("phase margin for lead", "deg", key="phase_lead_deg", help=LAG.replace("lag", "lead"))
DELAY_MARGIN = Quantity("delay margin", "s", help="smallest further loop delay that destabilises the loop")
DISK_MARGIN = Quantity("disk margin", help="gain and phase together: factors (2 + d)/(2 - d), |d| < margin")
PEAK_SENSITIVITY = Quantity("peak sensitivity Ms", key="peak_sensitivity", help="largest |1/(1 + L)|")
IN_RANGE = Quantity(
    "margins in the frequency range", key="in_range", help="of L(iw) up to the end of the verdict's frequency range"
)
LYAPUNOV = Quantity("Lyapunov function of the paper", help="energy argument for constant gains at the hub")
PASSIVITY = Quantity("passivity of the controller", help="sign of the controller from hub angle or rate to torque")
INTERVALS = Quantity("stability intervals", first=True, help="of each gain or coefficient alone, the others constant")
INTERVALS_NOTE = Quantity("limits of the intervals", help="frequency range in which the intervals are known")
GAIN_CROSSOVERS = Quantity("gain crossovers, abs(L) = 1", help="all in the frequency range, ascending")
PHASE_CROSSOVERS = replace(GAIN_CROSSOVERS, label="phase crossovers, L < 0")
COMPLEMENTARY = "peak_complementary_sensitivity"
PEAK_COMPLEMENTARY = Quantity("peak complementary sensitivity Mt", key=COMPLEMENTARY, help="largest |L/(1 + L)|")
EXACT_DELAY, EXACT_DISK, EXACT_PEAK, EXACT_COMPLEMENTARY = (  # of the infinite-dimensional loop
    replace(each, label=f"{each.label}, exact") for each in (
        replace(DELAY_MARGIN, key="delay_margin_s"), replace(DISK_MARGIN, key="disk_margin"), PEAK_SENSITIVITY,
        PEAK_COMPLEMENTARY,
    )
)  # fmt: skip


class GainCrossover(NamedTuple):
    """A frequency with |L| = 1."""

    omega: Annotated[float, Quantity("frequency", "rad/s", 7, "gain crossover frequency, |L| = 1")]
    phase_margin: Annotated[float, Quantity("phase margin", "deg", help="angle from -1 to L; above 0 for lag")]


class PhaseCrossover(NamedTuple):
    """A frequency with L < 0."""

    omega: Annotated[float, Quantity("frequency", "rad/s", 7, "phase crossover frequency, L real and negative")]
    factor: Annotated[float, Quantity("gain margin (factor)", help="-1/L: this factor on L puts a pole there")]


@dataclass(frozen=True)
@record
class LoopMargins:
    """Margins of L(i w) for 0 < w <= `band` [rad/s]; inf where there is no limit.

    `gain` (lowest, highest factor), `phase` [deg] of least size, above 0 for lag and below for lead, `phase_lag` and
    `phase_lead` [deg] the sizes of the least of either, `delay` [s], `disk` [-], `peak_sensitivity` and
    `peak_complementary` [-], of 1/(1 + L) and L/(1 + L); `at` are the frequencies [rad/s] where these occur, or 0.
    `gain_crossovers` are all frequencies with |L| = 1 and the phase margin [deg] at each, `phase_crossovers` all with
    L < 0 and the factor -1/L on it that puts a pole there, both ascending.
    """

    band: Annotated[float, replace(BAND, help="end of the frequency range of these margins")]
    gain: tuple[float, float]
    phase: float
    phase_lag: float
    phase_lead: float
    delay: float
    disk: float
    peak_sensitivity: float
    at: dict[str, float]
    peak_complementary: float
    gain_crossovers: tuple[GainCrossover, ...]
    phase_crossovers: tuple[PhaseCrossover, ...]

    def at_frequency(self, name: str) -> At:
        """The margin of that name, and its frequency; None where no frequency limits it."""
        value = float(getattr(self, name))
        is_anywhere = math.isclose(abs(value), UNLIMITED.get(name, math.inf), rel_tol=SAME_SIZE)
        return At(value, None if is_anywhere else self.at[name])

    @property
    def phase_margin(self) -> Annotated[At, PHASE_MARGIN]:
        """The phase margin of least size."""
        return self.at_frequency("phase")

    @property
    def lag(self) -> Annotated[At, PHASE_LAG]:
        """The least phase margin for lag."""
        return self.at_frequency("phase_lag")

    @property
    def lead(self) -> Annotated[At, PHASE_LEAD]:
        """The least phase margin for lead."""
        return self.at_frequency("phase_lead")

    @property
    def delay_margin(self) -> Annotated[At, DELAY_MARGIN]:
        """The smallest destabilising delay."""
        return self.at_frequency("delay")

    @property
    def disk_margin(self) -> Annotated[At, DISK_MARGIN]:
        """The margin for gain and phase together."""
        return self.at_frequency("disk")

    @property
    def sensitivity_peak(self) -> Annotated[At, PEAK_SENSITIVITY]:
        """The peak of 1/(1 + L)."""
        return self.at_frequency("peak_sensitivity")

    @property
    def complementary_peak(self) -> Annotated[At, PEAK_COMPLEMENTARY]:
        """The peak of L/(1 + L)."""
        return self.at_frequency("peak_complementary")


@dataclass(frozen=True)
@record
class Margins:
    """Verdict and margins of a loop; `windows` are the stability intervals of each number of the law, by its name.

    `in_band` are the margins up to the verdict's band; `exact_delay`, `exact_disk` and `exact_peak` those of the whole
    infinite-dimensional loop.  All four are None unless the loop is stable.  The exact ones are None, not determined,
    where at C > 0 nothing bounds |L| beyond the band (the hub's inertia does, where there is some).
    """

    stability: Annotated[Stability, Quantity(flat=True)]
    in_band: Annotated[LoopMargins | None, IN_RANGE]
    exact_delay: Annotated[float | None, EXACT_DELAY]
    exact_disk: Annotated[float | None, EXACT_DISK]
    exact_peak: Annotated[float | None, EXACT_PEAK]

    @cached_property
    def windows(self) -> dict[str, Windows]:
        """Stability intervals of each number of the law, found when they are read: a result card has no use for them.

        Raises ConvergenceError where poles cannot be counted along one.
        """
        return windows_of(self.stability)

    @property
    def exact_complementary(self) -> Annotated[float | None, EXACT_COMPLEMENTARY]:
        """Peak of T = 1 - S of the whole infinite-dimensional loop: not determined, or infinite, where that of S is."""
        is_open = self.exact_peak is None or math.isinf(self.exact_peak)
        return self.exact_peak if is_open or self.in_band is None else self.in_band.peak_complementary

    @property
    def gain_margin(self) -> Annotated[tuple[float, float] | None, GAIN_MARGIN]:
        """Factors on the whole law between which the loop is stable."""
        return None if self.in_band is None else self.in_band.gain

    @property
    def lyapunov(self) -> Annotated[Lyapunov | None, LYAPUNOV]:
        """The proof by energy, for gains at the hub."""
        loop = self.stability.loop
        return None if loop.gains is None else lyapunov(loop.arm, loop.gains)

    @property
    def passivity(self) -> Annotated[Signs | None, PASSIVITY]:
        """The sign of a law that is more than gains at the hub."""
        loop = self.stability.loop
        return signs_of_loop(loop) if loop.gains is None else None

    @property
    def stability_intervals(self) -> Annotated[list[Windows], INTERVALS]:
        """One row for each number of the law, the others constant; without K2 on a free pin, where it has no loop."""
        return list(self.windows.values())

    @property
    def intervals_note(self) -> Annotated[str | None, INTERVALS_NOTE]:
        """Frequency range of the intervals where nothing is known beyond it.

        A theorem on the sign of a law, and small gain, hold for that law, not for one with another number.
        """
        loop, words = self.stability.loop, reach_words(self.windows.values())
        if loop.gains is not None:
            return None if self.stability.is_known_beyond else words or None
        if not self.windows and loop.arm.has_elastic_link:
            return NO_WINDOWS
        uncounted = [name for name in loop.law.numbers if self.windows and name not in self.windows]
        return words + (f"; poles not counted along {', '.join(uncounted)}" if uncounted else "") or None

    @property
    def gain_crossovers(self) -> Annotated[tuple[GainCrossover, ...], GAIN_CROSSOVERS]:
        """All in the frequency range, ascending; empty unless the loop is stable."""
        return () if self.in_band is None else self.in_band.gain_crossovers

    @property
    def phase_crossovers(self) -> Annotated[tuple[PhaseCrossover, ...], PHASE_CROSSOVERS]:
        """All in the frequency range, ascending; empty unless the loop is stable."""
        return () if self.in_band is None else self.in_band.phase_crossovers


def margins(arm: Arm, law: AnyLaw, band: float | None = None) -> Margins:
    """Return the verdict, the stability intervals of each number of the law, and the margins of the loop.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, or where with damping
    one is on the axis to working precision.
    """
    verdict = stability(arm, law, band)
    if not verdict.is_stable:
        return Margins(verdict, None, None, None, None)
    found = loop_margins(verdict)
    return Margins(verdict, found, *_exact(verdict, found))


def _exact(verdict: Stability, found: LoopMargins) -> tuple[float | None, float | None, float | None]:
    """Delay margin, disk margin and peak sensitivity of the whole infinite-dimensional loop; None: not determined."""
    loop = verdict.loop
    arm, gains, of_disk = loop.arm, loop.gains, (found.disk, found.peak_sensitivity)
    if not arm.is_undamped and is_quiet(loop, verdict.band):
        return found.delay, *of_disk
    if gains is not None and arm.is_undamped and theorem_of(loop).energy is not None:
        if gains.K2:
            return 0.0, 0.0, math.inf
        # 1 + L = 1 + (Kp + i K1 w) theta, theta real: no dip deepens with w
        return 0.0 if loop.feeds_back else found.delay, *of_disk
    if gains is not None and not arm.is_undamped and gains.K2 == gains.Kp == 0 and not arm.input_lags:
        return None, *of_disk  # L is in the right half-plane
    return None, None, None


class LoopFunction(Protocol):
    """A loop function L(i w), that of samples L(e^{i w T}) among them."""

    @property
    def feeds_back(self) -> bool:
        """Whether L is other than 0."""

    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Denominator and numerator of L at s = i w [1/s]."""

    def loop_function(self, s: NDArray[Any]) -> Complex:
        """L at s = i w [1/s]."""


def loop_margins(verdict: Stability) -> LoopMargins:
    """The margins of a stable loop up to the verdict's band."""
    return margins_of_curve(verdict.loop, dense(verdict), verdict.band, partial(gain_edges, verdict.loop))


def margins_of_curve(
    loop: LoopFunction, omega: Real, band: float,
    edges: Callable[[tuple[PhaseCrossover, ...]], list[float]] | None = None,
) -> LoopMargins:  # fmt: skip
    """The margins of a loop function on a grid (n,) that resolves it.

    `edges` are the factors that end stability, by default all -1/L at a phase crossover.
    """
    crossed = unit_crossings(loop, omega)
    apart = _spread(lambda w: loop.loop_function(1j * w), crossed)  # of size 1: what its angle moves by [rad]
    minus = -loop.loop_function(1j * crossed)
    angle = held(np.degrees(np.angle(minus)), np.degrees(apart), CROSSOVER_DIGITS)  # 0 where L = -1
    delay = held(np.radians(np.mod(angle, 360)) / crossed, apart / crossed)
    lag, lead = angle > 0, angle < 0
    least = {
        "phase": _least(angle, crossed),
        "phase_lag": _least(angle[lag], crossed[lag]),
        "phase_lead": _least(-angle[lead], crossed[lead]),
        "delay": _least(delay, crossed),
        "disk": lowest(_distance(loop, 0.5, -0.5), omega),
        "peak_sensitivity": highest(_distance(loop, 1.0, 0.0), omega),
        "peak_complementary": highest(_distance(loop, 0.0, 1.0), omega),
    }
    values = {name: float(f"{value:.{MARGIN_DIGITS}g}") for name, (value, _) in least.items()}
    values["peak_sensitivity"] = max(1.0, values["peak_sensitivity"])
    places = {name: float(f"{where:.{PLACE_DIGITS}g}") for name, (_, where) in least.items()}
    by_phase = phase_crossovers(loop, omega)
    factors = [factor for _, factor in by_phase] if edges is None else edges(by_phase)
    gain = max((t for t in factors if 0 <= t < 1), default=0.0), min((t for t in factors if t > 1), default=math.inf)
    by_gain = tuple(sorted(map(GainCrossover, crossed.tolist(), angle.tolist())))
    return LoopMargins(band, gain, **values, at=places, gain_crossovers=by_gain, phase_crossovers=by_phase)


def held(values: Real, spread: Real, most: int = MARGIN_DIGITS) -> Real:
    """Round values (n,) to the digits that are significant next to poles of L, where L is rounded.

    These are `most` digits, or fewer where a value changes by its `spread` (n,) among the next doubles.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        known = np.log10(abs(values) / spread)
    digits = np.clip(np.ceil(np.nan_to_num(known, nan=0.0)), 1, most).astype(int)
    return np.array([float(f"{value:.{count}g}") for value, count in zip(values, digits, strict=True)])


def _spread(f: Callable[[Real], Real | Complex], omega: Real) -> Real:
    """Largest change of f at frequencies (n,) among the doubles next to each: its rounding error."""
    if not omega.size:
        return np.empty(0)
    near = np.multiply.outer(1 + NEXT_DOUBLES, omega)
    return np.asarray(abs(f(near.ravel()).reshape(near.shape) - f(omega)).max(axis=0))


def _distance(loop: LoopFunction, of_1: float, of_L: float) -> Callable[[Real], Real]:
    """|1 + L| over |of_1 + of_L L| at i omega: 1/|S|, 1/|T|, or a disk margin at one frequency."""

    def at(omega: Real) -> Real:
        drive, fed_back = loop.parts(1j * omega)
        return np.asarray(abs(drive + fed_back) / np.maximum(abs(of_1 * drive + of_L * fed_back), LEAST_SIZE))

    return at


def phase_crossovers(loop: LoopFunction, omega: Real) -> tuple[PhaseCrossover, ...]:
    """Frequencies [rad/s] with L real and below 0, and the factor -1/L; at rest too where L is finite there.

    Where L changes the side of the real axis at a pole or zero of its own, its denominator or numerator turns and not
    L.  Both sides are compared as near as rounding allows: next to a narrow resonance L is so close to the axis that
    the place itself is not known.
    """

    def turned(w: Real) -> Real:
        drive, fed_back = loop.parts(1j * w)
        return np.asarray((drive * fed_back.conj()).imag)

    factor, place, _ = crossed(omega, lambda w: loop.parts(1j * w))
    sides = place * (1 + np.multiply.outer([-1.0, 1.0], FARTHER)[..., None])  # (2, shares, n)
    own = np.array(loop.parts(1j * sides))
    h = (own[0] * own[1].conj()).imag
    decided = (h.prod(axis=0) < 0) & (abs(h).min(axis=0) > ABOVE_NOISE * _spread(turned, place))
    opposite = ((own[:, 0] * own[:, 1].conj()).real < 0).any(axis=0)
    nearest = decided.argmax(axis=0)[None]
    turns = np.take_along_axis(opposite, nearest, 0)[0] | ~decided.any(axis=0)
    crosses = (factor > AT_POLE) & (factor < 1 / AT_POLE) & ~turns
    place, factor = place[crosses], factor[crosses]
    factor = held(factor, _spread(lambda w: _factor(loop, w), place), CROSSOVER_DIGITS)
    found = list(map(PhaseCrossover, place.tolist(), factor.tolist()))
    low, lower = _factor(loop, omega[0] * np.array([1.0, 0.5]))
    if low.real > AT_POLE and max(abs(low.imag), abs(low - lower)) < REST * low.real:
        found.append(PhaseCrossover(0.0, float(low.real)))
    return tuple(sorted(found))


def _factor(loop: LoopFunction, omega: Real) -> Complex:
    """-1/L at i omega; 0 where L is infinite or vanishes."""
    drive, fed_back = loop.parts(1j * omega)
    return np.asarray(-drive / np.where(fed_back == 0, np.inf, fed_back))


def dense(verdict: Stability) -> Real:
    """The grid of the arm, and points about every pole of the loop and of its law at its distance from the axis.

    |1 + L| dips there, and not where the arm's own functions are steep; the less damping, the narrower the dip.
    """
    omega, poles = np.asarray(grid(verdict.loop.arm, verdict.band)), np.r_[verdict.poles.values, verdict.loop.law.poles]
    close = poles.imag[:, None] + abs(poles.real[:, None]) * NEAR_POLES
    slowest = abs(verdict.poles.moving).min(initial=omega[0])
    slow = np.geomspace(BELOW_SLOWEST_POLE * slowest, omega[0], SLOW_POINTS) if slowest < omega[0] else omega[:0]
    return np.unique(np.r_[omega, close[(close > 0) & (close < omega[-1])], slow])


def gain_edges(loop: ContinuousLoop, by_phase: tuple[PhaseCrossover, ...]) -> list[float]:
    """Factors on all of a law at which a pole reaches the axis, from where L < 0.

    Without damping all modes may reach it at one factor, where rounding alone decides whether L < 0.  There the factor
    follows from a theorem.
    """
    gains, arm = loop.gains, loop.arm
    if gains is None or not arm.loses_at_hub_alone or theorem_of(loop).energy is None:
        return [t for _, t in by_phase]
    found = [t for w, t in by_phase if w == 0]
    found += [arm.input_per_torque / gains.K2] if gains.K2 else []
    return found + ([-arm.rate_loss / gains.K1] if gains.K1 and arm.rate_loss else [])


def unit_crossings(loop: LoopFunction, omega: Real) -> Real:
    """Frequencies [rad/s] where |L(i w)| = 1."""
    if not loop.feeds_back:
        return np.empty(0)

    def size(w: Real) -> Real:
        with np.errstate(divide="ignore"):  # where the hub stays at rest L is 0
            return np.asarray(np.log(abs(loop.loop_function(1j * w))))

    (before,), _ = brackets(size(omega))
    return zeros_between(size, omega[before], omega[before + 1])


def lowest(f: Callable[[Real], Real], omega: Real) -> tuple[float, float]:
    """The least value of f over the range of the grid, and its place; the lowest dips are refined."""
    values = f(omega)
    best = int(np.argmin(values))
    dips = np.nonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]))[0] + 1
    dips = np.r_[best, dips[np.argsort(values[dips])][:LOWEST]]
    low, high = omega[np.maximum(dips - 1, 0)], omega[np.minimum(dips + 1, omega.size - 1)]
    for _ in range(ROUNDS):
        inside = np.linspace(low, high, ROUND_POINTS)
        depth = f(inside.ravel()).reshape(inside.shape)
        lowest_one = depth.argmin(axis=0)[None]
        low, high = (
            np.take_along_axis(inside, np.clip(lowest_one + way, 0, ROUND_POINTS - 1), 0)[0] for way in (-1, 1)
        )
    least, at = min(zip(depth.ravel().tolist(), inside.ravel().tolist(), strict=True))
    (least,) = held(np.array([least]), _spread(f, np.array([at])))
    return float(least), at


def highest(inverse: Callable[[Real], Real], omega: Real) -> tuple[float, float]:
    """The highest value of a function given by its inverse, and its place; infinity where the inverse vanishes."""
    dip, at = lowest(inverse, omega)
    if not dip:
        return math.inf, at
    (peak,) = held(np.array([1.0 / dip]), _spread(lambda w: 1.0 / inverse(w), np.array([at])))
    return float(peak), at


def _least(values: Real, where: Real) -> tuple[float, float]:
    """The value of least size and its place; infinity and 0 where there is none."""
    if not values.size:
        return math.inf, 0.0
    i = int(np.argmin(abs(values)))
    return float(values[i]), float(where[i])
