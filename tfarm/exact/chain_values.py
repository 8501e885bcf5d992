"""What can be read of a chain: outputs of its free response in float64, with slopes, at s = 0, and in balls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.errors import ParameterError

from .balls import Ball, precision, rational
from .chain import ElementChain, Layout
from .chain_balls import Sweep, summed
from .elements import Place
from .jets import Jet
from .outputs import Output, unit_scale
from .sweep import fill_free

SLOPE_CIRCLE = np.exp(2j * np.pi * np.arange(16) / 16)
SLOPE_RADIUS = 0.3  # of that circle, of |s| over the phase of all waves: the 16th Taylor term is below 1e-17
CLEAR_OF_SINGULAR = 0.1  # of the way to a -1/C: its radius at most
SERIES_BITS = 512  # of the power series at s = 0, whose coefficients are sums of small differences
KNOWN_ZERO = 1e-80  # a coefficient below this share of the first is a zero that balls cannot know
LAYOUTS_KEPT = 256  # of one chain: more places than a page looks at
SERIES_KEPT = 512  # expansions at s = 0 of rigs and outputs: more than a report of six rigs asks for
SLOW_POLE_STEPS = 8  # of Newton's method for a pole next to 0, each doubling its digits
SERIES_ORDER = 8  # of the power series: the drive begins at s^2 at most


class Reading(NamedTuple):
    """What an output weighs: W, Psi, M and Q at a place, theta; its power of s, its gauge's C [s], its SI unit."""

    place: Place | None
    state: tuple[Fraction | int, ...]
    theta: Fraction
    power: int
    gauge: bool
    unit: Fraction
    is_current: bool = False


@dataclass(frozen=True)
class Readings:
    """Several outputs of one chain: where and what, and the table that the compiled sweep takes."""

    layout: Layout
    each: tuple[Reading, ...]

    @property
    def gauges(self) -> list[float]:
        """C [s] of each output's gauge, 0 for what is none."""
        places = self.layout.places
        return [
            self.layout.read[places.index(one.place)].damping if one.gauge and one.place is not None else 0.0
            for one in self.each
        ]

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Rows for `sweep.fill_free`."""
        places = self.layout.places
        return np.array([
            [-1 if one.place is None else places.index(one.place), *one.state, one.theta, one.power, C, one.unit]
            for one, C in zip(self.each, self.gauges, strict=True)
        ], dtype=float).reshape(-1, 9)  # fmt: skip


class ChainFree(NamedTuple):
    """Drive (n,) and outputs (rows, n) of the free response times e^{-scale}, and where digits are lost."""

    drive: Complex
    outputs: Complex
    scale: Complex
    lost: NDArray[np.bool_]


def reading_of(chain: ElementChain, wanted: Output, x: float) -> Reading:
    """An output as weights; x is the share of the length for one along the link."""
    share = Fraction(wanted.share(x))
    weights: dict[str, tuple[Fraction | int, ...]] = {
        **dict.fromkeys(("W", "Y", "centre"), (1, 0, 0, 0)),
        **dict.fromkeys(("Psi", "Phi"), (0, 1, 0, 0)),
        **dict.fromkeys(("M", "strain"), (0, 0, 1, 0)),
    }
    theta = {"Y": -(chain.radius + share), "Phi": Fraction(-1), "theta": Fraction(1)}
    if wanted.quantity == "current":
        if not chain.drive.per_ampere or not chain.drive.turns:
            remedy = "needs a [motor] and another input than hub_angle, which says nothing of the current"
            raise ParameterError(key="output", value="motor_current", remedy=remedy)
        amperes = chain.EI / chain.length / chain.drive.per_ampere / chain.input_unit  # per torque without dimensions
        return Reading(None, (0, 0, 0, 0), Fraction(1), wanted.power, False, amperes, True)
    place = None if wanted.quantity == "theta" else Place(share, wanted.side)
    if wanted.place == "root" and wanted.gauge:
        place = chain.gauge
    if wanted.quantity == "centre":
        place = Place(Fraction(1), "payload")
    state = weights.get(wanted.quantity, (0, 0, 0, 1)) if place else (0, 0, 0, 0)
    unit = unit_scale(wanted, chain)
    if wanted.quantity == "strain" and place:  # at the surface: half the depth over E I/L
        (segment,) = chain.at((place,)).read
        if segment.half_depth is None:
            remedy = 'a "general" section does not say how deep it is: give rectangle, round or tube'
            raise ParameterError(key="link.section.shape", value="general", remedy=remedy)
        unit = Fraction(segment.half_depth) / chain.length / segment.stiffness / chain.input_unit
    return Reading(place, state, theta.get(wanted.quantity, Fraction(0)), wanted.power, wanted.gauge, unit)


def readings(chain: ElementChain, wanted: tuple[Output, ...], x: float) -> Readings:
    """The outputs of a chain, laid out: once for each chain."""
    key = wanted, x
    if key not in chain.kept:
        if len(chain.kept) >= LAYOUTS_KEPT:
            chain.kept.clear()
        chain.kept[key] = laid_out(chain, wanted, [x] * len(wanted))
    return chain.kept[key]


def laid_out(chain: ElementChain, wanted: Sequence[Output], shares: Sequence[float]) -> Readings:
    """Outputs of a chain, each with its own share of the length, laid out anew."""
    each = tuple(reading_of(chain, one, x) for one, x in zip(wanted, shares, strict=True))
    places = tuple(dict.fromkeys(one.place for one in each if one.place is not None))
    return Readings(chain.at(places), each)


def free_outputs(chain: ElementChain, wanted: Sequence[Output], s: Complex, x: float) -> ChainFree:
    """The free response at s (1-D): outputs in SI per unit of the input that the drive is."""
    return _free(readings(chain, tuple(wanted), x), s)


def _free(those: Readings, s: Complex) -> ChainFree:
    found, lost = np.empty((2 + len(those.each), s.size), complex), np.empty(s.size, bool)
    fill_free(np.ascontiguousarray(s, dtype=complex), those.layout.rows, those.layout.ends, those.table, found, lost)
    drive = those.layout.chain.drive
    for row, one in enumerate(those.each):
        if one.is_current:  # the row holds theta: what is left of the input after back-EMF turns the hub
            unit, back = float(one.unit) * s**one.power, float(drive.back_emf) * s
            found[2 + row] = (unit * found[0] - back * found[2 + row]) / (1.0 + float(drive.lag) * s)
    return ChainFree(found[0], found[2:], found[1], lost)


def free_slopes(chain: ElementChain, wanted: Sequence[Output], s: Complex, x: float) -> tuple[ChainFree, ChainFree]:
    """The free response and its derivative at s (1-D), by Cauchy's integral on a circle that is right to rounding."""
    those = readings(chain, tuple(wanted), x)
    here = _free(those, s)
    radius = SLOPE_RADIUS * np.maximum(abs(s), 1e-150) / np.maximum(1.0, abs(here.scale))
    for C in {each.damping for each in chain.segments if each.damping}:
        radius = np.minimum(radius, CLEAR_OF_SINGULAR * abs(s + 1.0 / C))
    around = _free(those, (s[:, None] + radius[:, None] * SLOPE_CIRCLE).ravel())
    factor = np.exp(around.scale.reshape(-1, SLOPE_CIRCLE.size) - here.scale[:, None]) / SLOPE_CIRCLE / radius[:, None]
    drive = (around.drive.reshape(factor.shape) * factor).mean(axis=1)
    outputs = (around.outputs.reshape(-1, *factor.shape) * factor).mean(axis=2)
    return here, ChainFree(drive, outputs, here.scale, here.lost)


def free_fields(chain: ElementChain, s: Complex, places: Sequence[Place]) -> tuple[NDArray[Any], NDArray[Any], Complex]:
    """W, Psi, M, Q (4, s, places) and hub angle (s,) times e^{-scale}, and scale: dimensionless."""
    layout = chain.at(tuple(dict.fromkeys(places)))
    order = [layout.places.index(place) for place in places]
    table = np.zeros((4 * len(layout.places) + 1, 9))
    table[:, 8], table[-1, 0], table[-1, 5] = 1.0, -1.0, 1.0
    for number in range(len(layout.places)):
        rows = slice(4 * number, 4 * (number + 1))
        table[rows, 0], table[rows, 1:5] = number, np.eye(4)
    found, lost = np.empty((2 + len(table), s.size), complex), np.empty(s.size, bool)
    fill_free(np.ascontiguousarray(s, dtype=complex), layout.rows, layout.ends, table, found, lost)
    fields = found[2:-1].reshape(len(layout.places), 4, s.size).transpose(1, 2, 0)[:, :, order]
    return fields, found[-1], found[1]


class ChainState:
    """The free response of a chain at one s in balls, as `balls.State` is of an arm."""

    def __init__(self, chain: ElementChain, s: Any, *, slow: bool = False) -> None:
        self.chain, self.s, self._sweep = chain, s, SlowSweep if slow else Sweep
        self.input = self._sweep(chain.at(), s).input

    def numerator(self, output: Output, x: float = 0.0) -> Any:
        """The output of the free response, in SI units."""
        those = readings(self.chain, (output,), x)
        return self._sweep(those.layout, self.s).output(those.each[0])

    def value(self, output: Output, x: float = 0.0) -> Ball:
        """The output for a unit input, in SI units; x is a share of the length."""
        constant, drive = output.constant(self.chain, x), self.chain.drive
        if output.quantity == "current" and not (drive.back_emf or drive.lag):  # the input itself, but for its unit
            return self.s**output.power * rational(readings(self.chain, (output,), x).each[0].unit)
        if constant is None:
            return self.numerator(output, x) / self.input
        return self.s**output.power * constant * rational(unit_scale(output, self.chain))

    def determines(self, output: Output, x: float) -> bool:
        """Whether the output has a value here: everywhere but where the input may be zero, at a pole."""
        return output.constant(self.chain, x) is not None or not self.input.contains(0)


class SlowSweep(Sweep):
    """The sweep with power series (`Jet`) in s at 0, whose coefficients are balls."""

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """F0..F3 by their series in z1 + z2 and z1 z2, which begin with s^2 both."""
        return tuple(summed(z_sum, z_product, 2 * len(self.s.c)))


def expansions(chain: ElementChain, wanted: Sequence[Output], x: float) -> list[tuple[float, float, float, float]]:
    """Coefficients of s^-2, s^-1, 1 and s in each output's expansion at s = 0."""
    return [(each[0], each[1], each[2], each[3]) for each in series_at_zero(chain, wanted, x)]


def series_at_zero(
    chain: ElementChain, wanted: Sequence[Output], x: float, terms: int = SERIES_ORDER
) -> list[list[float]]:
    """Coefficients from s^-2 on in each output's expansion at s = 0, `terms` less two of them at least."""
    return [list(_series_at_zero(chain, each, x, terms)) for each in wanted]


@lru_cache(SERIES_KEPT)  # loops, models and pages ask for the same few of a rig again and again
def _series_at_zero(chain: ElementChain, output: Output, x: float, terms: int) -> tuple[float, ...]:
    """The same of one output."""
    coefficients = _quotient_at_zero(chain, output, x, terms).c
    order = _leading(_slow(chain, terms)[1])
    return (*[0.0] * (2 - order), *(float(c.mid()) if hasattr(c, "mid") else float(c) for c in coefficients))


def _quotient_at_zero(chain: ElementChain, output: Output, x: float, terms: int) -> Jet:
    """The output's expansion from s^-n on, n the order of the drive's zero, in balls."""
    state, drive = _slow(chain, terms)
    order = _leading(drive)
    with precision(SERIES_BITS):
        return Jet(_cleared(state.numerator(output, x)).c[: terms - order]) / drive.shifted(order)


def beside_slow_pole(chain: ElementChain, wanted: Sequence[Output], x: float) -> list[tuple[float, float]]:
    """Coefficients of 1 and s in each output's expansion at s = 0, without those of a single pole p next to 0.

    Of r/(s - p) they are c_k = -r/p^(k+1), beside which those of all other poles vanish from some n on: so what is left
    is c_k - p^(n-k) c_n, right to (p/w)^(n-k), w the next pole.  In float64 -r/p alone would drown it.
    """
    _, drive = _slow(chain, SERIES_ORDER)
    first = _leading(drive)
    with precision(SERIES_BITS):
        of_drive = drive.shifted(first)
        p = rational(0)
        for _ in range(SLOW_POLE_STEPS):  # Newton's method on a power series that is nearly a line there
            p = p - sum(c * p**k for k, c in enumerate(of_drive.c)) / sum(
                k * c * p ** (k - 1) for k, c in enumerate(of_drive.c) if k
            )
        found = []
        for each in wanted:
            constant, slope, *others, last = _quotient_at_zero(chain, each, x, SERIES_ORDER).c[first:]
            power = p ** (len(others) + 1)
            found.append((float((constant - last * power * p).mid()), float((slope - last * power).mid())))
    return found


def order_at_zero(chain: ElementChain, wanted: Output | None, x: float = 0.0) -> int:
    """How often an output of the free response vanishes at s = 0; the drive itself for None."""
    state, drive = _slow(chain, SERIES_ORDER)
    if wanted is None:
        return _leading(drive)
    with precision(SERIES_BITS):
        return _leading(_cleared(state.numerator(wanted, x)))


@lru_cache(SERIES_KEPT)
def _slow(chain: ElementChain, terms: int) -> tuple[ChainState, Jet]:
    """The free response as power series in s at 0, and the drive's, exact zeros told from rounding."""
    with precision(SERIES_BITS):
        s = Jet([rational(0), rational(1), *[rational(0)] * (terms - 2)])
        state = ChainState(chain, s, slow=True)
        return state, _cleared(state.input)


def _leading(series: Jet) -> int:
    """The number of the first coefficient that is not 0."""
    return next(n for n, coefficient in enumerate(series.c) if coefficient != 0)


def _cleared(jet: Jet) -> Jet:
    """The jet with exact zeros where only rounding is left."""
    sizes = [abs(rational(0) + c) for c in jet.c]
    largest = max(float(size.mid()) for size in sizes)
    return Jet(
        [rational(0) if float(size.mid()) < KNOWN_ZERO * largest else c for size, c in zip(sizes, jet.c, strict=True)]
    )
