"""Margins of a loop function on either curve, from its values on a grid that resolves it.

Phase margins have the sign of python-control: where |L| = 1 the angle from -1 to L, in (-180, 180] deg.  A positive one
is a margin for lag, a negative one for lead; of a stable loop neither sign is an instability.

Disk margin: the largest alpha for which the loop is stable with every factor (2 + alpha d)/(2 - alpha d), |d| < 1
(Seiler, Packard and Gahinet 2020, symmetric disks), which is 2 min |(1 + L)/(1 - L)|.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.crossing import brackets, locate_crossings, zeros_between
from tfarm.loop.loop import Loop
from tfarm.records import frozen
from tfarm.schema import At, Quantity

DELAY_MARGIN = Quantity("delay margin", "s", help="smallest further loop delay that destabilises the loop")
DISK_MARGIN = Quantity("disk margin", help="gain and phase together: factors (2 + d)/(2 - d), |d| < margin")
PEAK_SENSITIVITY = Quantity("peak sensitivity Ms", key="peak_sensitivity", help="largest |1/(1 + L)|")
PEAK_COMPLEMENTARY = Quantity(
    "peak complementary sensitivity Mt", key="peak_complementary_sensitivity", help="largest |L/(1 + L)|"
)


class GainCrossover(NamedTuple):
    """A frequency with |L| = 1."""

    omega: Annotated[float, Quantity("frequency", "rad/s", 7, "gain crossover frequency, |L| = 1")]
    phase_margin: Annotated[
        float, Quantity("phase margin", "deg", help="angle from -1 to L; above 0 for lag")
    ]


class PhaseCrossover(NamedTuple):
    """A frequency with L < 0."""

    omega: Annotated[
        float, Quantity("frequency", "rad/s", 7, "phase crossover frequency, L real and negative")
    ]
    factor: Annotated[
        float, Quantity("gain margin (factor)", help="-1/L: this factor on L puts a pole there")
    ]


@frozen
class LoopMargins:
    """Margins of L(i w) for 0 < w <= `band` [rad/s]; inf where there is no limit.

    `gain` (lowest, highest factor), `phase` [deg] of least size, above 0 for lag and below for lead, `phase_lag` and
    `phase_lead` [deg] the sizes of the least of either, `delay` [s], `disk` [-], `peak_sensitivity` and
    `peak_complementary` [-], of 1/(1 + L) and L/(1 + L); `at` are the frequencies [rad/s] where these occur, or 0.
    `gain_crossovers` are all frequencies with |L| = 1 and the phase margin [deg] at each, `phase_crossovers` all with
    L < 0 and the factor -1/L on it that puts a pole there, both ascending.
    """

    band: Annotated[
        float,
        Quantity(
            "frequency range, up to",
            "rad/s",
            key="up_to_rad_s",
            help="end of the frequency range of these margins",
        ),
    ]
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
        """Return the margin of that name, and its frequency; None where no frequency limits it.

        A passive loop has a disk margin of 2 and a peak sensitivity of 1, to rounding next to a narrow resonance.
        """
        value = float(getattr(self, name))
        unlimited = {"disk": 2.0, "peak_sensitivity": 1.0}.get(name, math.inf)
        is_anywhere = math.isclose(abs(value), unlimited, rel_tol=1e-7)
        return At(value, None if is_anywhere else self.at[name])

    @property
    def phase_margin(
        self,
    ) -> Annotated[
        At,
        Quantity("phase margin", "deg", help="of least size where |L| = 1; above 0 for lag, below for lead"),
    ]:
        """The phase margin of least size."""
        return self.at_frequency("phase")

    @property
    def lag(
        self,
    ) -> Annotated[
        At,
        Quantity(
            "phase margin for lag",
            "deg",
            key="phase_lag_deg",
            help="least phase lag of L that destabilises the loop; inf without a limit",
        ),
    ]:
        """The least phase margin for lag."""
        return self.at_frequency("phase_lag")

    @property
    def lead(
        self,
    ) -> Annotated[
        At,
        Quantity(
            "phase margin for lead",
            "deg",
            key="phase_lead_deg",
            help="least phase lead of L that destabilises the loop; inf without a limit",
        ),
    ]:
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


def margins_along(
    loop: Loop,
    omega: Real,
    band: float,
    gain_limits: Callable[[tuple[PhaseCrossover, ...]], tuple[float, float]],
) -> LoopMargins:
    """Return the margins of a loop function up to a band, on a grid (n,) that resolves it.

    `gain_limits` gives the factors on the law between which the loop is stable, from its phase crossovers.
    """
    crossed = unit_crossings(loop, omega)
    # of size 1: what its angle moves by [rad]
    apart = _spread(lambda w: loop.loop_function(1j * w), crossed)
    minus = -loop.loop_function(1j * crossed)
    # 0 where L = -1
    angle = round_crossovers(np.degrees(np.angle(minus)), np.degrees(apart))
    delay = round_near_poles(np.radians(np.mod(angle, 360)) / crossed, apart / crossed)
    lag = angle > 0
    lead = angle < 0
    least = {
        "phase": _least(angle, crossed),
        "phase_lag": _least(angle[lag], crossed[lag]),
        "phase_lead": _least(-angle[lead], crossed[lead]),
        "delay": _least(delay, crossed),
        "disk": lowest(_distance(loop, 0.5, -0.5), omega),
        "peak_sensitivity": highest(_distance(loop, 1.0, 0.0), omega),
        "peak_complementary": highest(_distance(loop, 0.0, 1.0), omega),
    }
    values = {name: float(f"{value:.9g}") for name, (value, _) in least.items()}
    values["peak_sensitivity"] = max(1.0, values["peak_sensitivity"])
    # next to a dip its depth is flat: its place has fewer digits
    places = {name: float(f"{where:.7g}") for name, (_, where) in least.items()}
    by_phase = phase_crossovers(loop, omega)
    by_gain = tuple(sorted(map(GainCrossover, crossed.tolist(), angle.tolist())))
    gain = gain_limits(by_phase)
    return LoopMargins(band, gain, **values, at=places, gain_crossovers=by_gain, phase_crossovers=by_phase)


def round_crossovers(values: Real, spread: Real) -> Real:
    """Round values (n,) at crossovers: at most to 12 digits, more than any table rounds to."""
    return round_near_poles(values, spread, 12)


def round_near_poles(values: Real, spread: Real, most: int = 9) -> Real:
    """Round values (n,) to the digits that are significant next to poles of L, where L is rounded.

    These are `most` digits, or fewer where a value changes by its `spread` (n,) among the next doubles.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        known = np.log10(abs(values) / spread)
    digits = np.clip(np.ceil(np.nan_to_num(known, nan=0.0)), 1, most).astype(int)
    return np.array([float(f"{value:.{count}g}") for value, count in zip(values, digits, strict=True)])


def _spread(f: Callable[[Real], Real | Complex], omega: Real) -> Real:
    """Return the largest change of f at frequencies (n,) among the doubles next to each: its rounding error."""
    if not omega.size:
        return np.empty(0)
    next_doubles = 2.0**-52 * np.arange(-16, 17, 4)
    near = np.multiply.outer(1 + next_doubles, omega)
    return np.asarray(abs(f(near.ravel()).reshape(near.shape) - f(omega)).max(axis=0))


def _distance(loop: Loop, of_1: float, of_L: float) -> Callable[[Real], Real]:
    """Return |1 + L| over |of_1 + of_L L| at i omega: 1/|S|, 1/|T|, or a disk margin at one frequency."""

    def at(omega: Real) -> Real:
        drive, fed_back = loop.parts(1j * omega)
        return np.asarray(abs(drive + fed_back) / np.maximum(abs(of_1 * drive + of_L * fed_back), LEAST_SIZE))

    return at


def phase_crossovers(loop: Loop, omega: Real) -> tuple[PhaseCrossover, ...]:
    """Return the frequencies [rad/s] with L real and below 0, and the factor -1/L; at rest too where L is finite there.

    Where L changes the side of the real axis at a pole or zero of its own, its denominator or numerator turns and not
    L.  Both sides are compared as near as rounding allows: next to a narrow resonance L is so close to the axis that
    the place itself is not known.
    """
    # a factor on L so small belongs to a pole of L on the axis, where L changes its sign through infinity
    at_pole = 1e-9

    def side(w: Real) -> Real:
        drive, fed_back = loop.parts(1j * w)
        return np.asarray((drive * fed_back.conj()).imag)

    factor, place, _ = locate_crossings(omega, lambda w: loop.parts(1j * w))
    # shares of a frequency on either side, until rounding no longer decides the side of the axis that L is on
    farther = 8.0 ** np.arange(-16, -5)
    # (2, shares, n)
    sides = place * (1 + np.multiply.outer([-1.0, 1.0], farther)[..., None])
    own = np.array(loop.parts(1j * sides))
    h = (own[0] * own[1].conj()).imag
    decided = (h.prod(axis=0) < 0) & (abs(h).min(axis=0) > 4.0 * _spread(side, place))
    opposite = ((own[:, 0] * own[:, 1].conj()).real < 0).any(axis=0)
    nearest = decided.argmax(axis=0)[None]
    turns = np.take_along_axis(opposite, nearest, 0)[0] | ~decided.any(axis=0)
    crosses = (factor > at_pole) & (factor < 1 / at_pole) & ~turns
    place = place[crosses]
    factor = factor[crosses]
    factor = round_crossovers(factor, _spread(lambda w: _factor(loop, w), place))
    found = list(map(PhaseCrossover, place.tolist(), factor.tolist()))
    low, lower = _factor(loop, omega[0] * np.array([1.0, 0.5]))
    # at rest -1/L is real, and does not change further down
    if low.real > at_pole and max(abs(low.imag), abs(low - lower)) < 1e-3 * low.real:
        found.append(PhaseCrossover(0.0, float(low.real)))
    return tuple(sorted(found))


def _factor(loop: Loop, omega: Real) -> Complex:
    """Return -1/L at i omega; 0 where L is infinite or vanishes."""
    drive, fed_back = loop.parts(1j * omega)
    return np.asarray(-drive / np.where(fed_back == 0, np.inf, fed_back))


def unit_crossings(loop: Loop, omega: Real) -> Real:
    """Return the frequencies [rad/s] where |L(i w)| = 1."""
    if not loop.feeds_back:
        return np.empty(0)

    def size(w: Real) -> Real:
        # where the hub stays at rest L is 0
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(abs(loop.loop_function(1j * w))))

    (before,), _ = brackets(size(omega))
    return zeros_between(lambda w, _: size(w), omega[before], omega[before + 1])


def bandwidth(loop: Loop, omega: Real) -> float:
    """Return the lowest frequency [rad/s] from which |T| = |L/(1 + L)| is below 1/sqrt(2), -3 dB.

    The first of the grid where |T| begins below, the last one where it stays above.
    """
    inverse = _distance(loop, 0.0, 1.0)

    def size(w: Real) -> Real:
        return np.asarray(np.log(np.sqrt(0.5) * inverse(w)))

    values = size(omega)
    if values[0] > 0:
        return float(omega[0])
    (before,), _ = brackets(values)
    found = zeros_between(lambda w, _: size(w), omega[before[:1]], omega[before[:1] + 1])
    return float(found[0]) if found.size else float(omega[-1])


def lowest(
    f: Callable[[Real], Real], omega: Real, most: int = 6, rounds: int = 7, points: int = 17
) -> tuple[float, float]:
    """Return the least value of f over the range of the grid, and its place.

    The lowest dips, 6 at most, are refined by ever narrower grids, an eighth each time: 1e-6 of the first is left.
    """
    values = f(omega)
    best = int(np.argmin(values))
    dips = np.nonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]))[0] + 1
    dips = np.r_[best, dips[np.argsort(values[dips])][:most]]
    low = omega[np.maximum(dips - 1, 0)]
    high = omega[np.minimum(dips + 1, omega.size - 1)]
    for _ in range(rounds):
        inside = np.linspace(low, high, points)
        depth = f(inside.ravel()).reshape(inside.shape)
        lowest_one = depth.argmin(axis=0)[None]
        low, high = (
            np.take_along_axis(inside, np.clip(lowest_one + way, 0, points - 1), 0)[0] for way in (-1, 1)
        )
    least, at = min(zip(depth.ravel().tolist(), inside.ravel().tolist(), strict=True))
    (least,) = round_near_poles(np.array([least]), _spread(f, np.array([at])))
    return float(least), at


def highest(inverse: Callable[[Real], Real], omega: Real) -> tuple[float, float]:
    """Return the highest value of a function and its place, from its inverse; infinity where that vanishes."""
    dip, at = lowest(inverse, omega)
    if not dip:
        return math.inf, at
    (peak,) = round_near_poles(np.array([1.0 / dip]), _spread(lambda w: 1.0 / inverse(w), np.array([at])))
    return float(peak), at


def _least(values: Real, where: Real) -> tuple[float, float]:
    """Return the value of least size and its place; infinity and 0 where there is none."""
    if not values.size:
        return math.inf, 0.0
    i = int(np.argmin(abs(values)))
    return float(values[i]), float(where[i])
