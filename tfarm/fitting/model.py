"""What of an arm may be free: any number of its TOML file, by its key, with a start, bounds and perhaps a prior.

A number that cannot be negative is searched for by its logarithm, any other by itself over its size; so a step of the
search is a share of the number.

An arm and its neighbours, a step away along each number that is free: for derivatives of whatever is read of it.

Frequencies and damping ratios of decays beside measured responses: eigenvalues of the arm, with derivatives.

Measured less computed: the residuals of an arm whose numbers run, over their deviations, with exact derivatives.

The response of one signal to another is the ratio of two of the arm's transfer functions, so of their numerators, times
a sensor's gain and delay:  H = gain e^{-i w tau} N_out/N_in,  with the drive for N_in where the input is the arm's own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import INPUTS, Arm, Input
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError, did_you_mean
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.series import Direction, Jet, response_gradients
from tfarm.exact.system import System, system_of
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum import modes
from tfarm.spectrum.table import first_frequency

from .data import Measured, Noise, check_signal, in_parts

SIGNED = ("offset",)  # numbers of an arm that may be negative
UPPER_ENDS = {"gear_efficiency": 1.0, "poissons_ratio": 0.5}  # and those that end somewhere
FARTHEST_FROM_START = 1e4  # times or a part of it: beyond, a search has lost its way, or the data say nothing
AT_REACH = 1e-6  # of ln p: a search that comes so near to that has ended there
COORDINATE_STEP = 2.0**-20  # of a derivative by differences: the rounding of a float over it is 1e-10, its square below
NUDGE = 1e-6  # of s: for a slope along it by a difference, which is right to about as much


@dataclass(frozen=True, kw_only=True)
@record
class Parameter:
    """A free number: its key, where the search starts, its bounds, all in SI units, and a prior (mean, deviation).

    `by_logarithm` says that the search is for ln(value/start), otherwise for (value - start)/size.
    """

    key: str
    start: float
    low: float
    high: float
    by_logarithm: bool
    size: float
    prior: tuple[float, float] | None = None

    def value(self, coordinate: float) -> float:
        """The number at a coordinate of the search, 0 at the start."""
        if self.by_logarithm:
            return self.start * math.exp(coordinate)
        return self.start + self.size * coordinate

    def coordinate(self, value: float) -> float:
        """The coordinate of a number."""
        if self.by_logarithm:
            return math.log(value / self.start)
        return (value - self.start) / self.size

    @property
    def bounds(self) -> tuple[float, float]:
        """Of the coordinate."""
        if not self.by_logarithm:
            return self.coordinate(self.low), self.coordinate(self.high)
        low = self.coordinate(self.low) if self.low > 0 else -math.inf
        high = self.coordinate(self.high) if self.high < math.inf else math.inf
        return max(low, -math.log(FARTHEST_FROM_START)), min(high, math.log(FARTHEST_FROM_START))

    def known_ends(
        self, coordinates: Sequence[float], values: tuple[float, float]
    ) -> tuple[float | None, float | None]:
        """Ends of an interval, None where only the reach of the search ended it and no bound of the number."""
        reach, (first, last) = math.log(FARTHEST_FROM_START), coordinates
        if not self.by_logarithm or self.start < 0:
            return values
        is_low = first > -reach + AT_REACH or self.low > 0
        is_high = last < reach - AT_REACH or self.high < math.inf
        return values[0] if is_low else None, values[1] if is_high else None

    def slope(self, coordinate: float) -> float:
        """d value/d coordinate."""
        return self.value(coordinate) if self.by_logarithm else self.size


def parameters(
    arm: Arm,
    keys: Sequence[str],
    *,
    start: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    priors: Mapping[str, tuple[float, float]],
) -> tuple[KeyedArms, tuple[Parameter, ...]]:
    """The family of an arm whose numbers under `keys` are free, and these numbers.

    Each starts where `start` says, else at the arm's own value, or where that is 0 at a hundredth of what would matter.
    Raises ParameterError for a key that is none or is not free, and for bounds or a start that leave no room.
    """
    for said, what in ((start, "start"), (bounds, "bounds"), (priors, "prior")):
        for key in said:
            if key not in keys:
                raise ParameterError(key=what, value=key, remedy=f"is not free; {did_you_mean(key, keys)}")
    family = KeyedArms(arm, keys)
    return family, tuple(
        _parameter(family, key, start.get(key), bounds.get(key), priors.get(key)) for key in family.keys
    )


def _parameter(
    family: KeyedArms,
    key: str,
    start: float | None,
    bounds: tuple[float, float] | None,
    prior: tuple[float, float] | None,
) -> Parameter:
    name = key.split(".")[-1]
    own = family.value(key)
    if start is None:
        start = own if own and math.isfinite(own) else _typical(family.arm, key, own)
    is_signed = name in SIGNED
    most = family.arm.length if name == "x" else UPPER_ENDS.get(name, math.inf)
    low, high = bounds or (-math.inf if is_signed else 0.0, most)
    if not low <= start <= high or not low < high:
        remedy = f"starts at {start:g}; give bounds low,high around it, or another start"
        raise ParameterError(key=f"bounds of {key}", value=(low, high), remedy=remedy)
    if not is_signed and start <= 0:
        raise ParameterError(key=f"start of {key}", value=start, remedy="a positive number in SI units")
    if prior is not None and not (math.isfinite(prior[0]) and prior[1] > 0):
        raise ParameterError(key=f"prior of {key}", value=prior, remedy="mean,deviation with a deviation above 0")
    size = max(abs(start), 0.1 * family.arm.length) if is_signed else abs(start)
    return Parameter(key=key, start=start, low=low, high=high, by_logarithm=not is_signed, size=size, prior=prior)


def _typical(arm: Arm, key: str, own: float) -> float:
    """A hundredth of what would matter, for a number that is 0, or a hundred times that of one that is infinite."""
    w1, inertia = first_frequency(arm), arm.turned_inertia if math.isfinite(arm.turned_inertia) else arm.carried_inertia
    EI, length = arm.link.EI, arm.length
    of_the_arm = {
        "mass": arm.own_mass,
        "inertia": inertia,
        "rotor_inertia": inertia,
        "rotor_friction": inertia * w1,
        "friction": inertia * w1,
        "damping": 1.0 / w1,
        "radius": length,
        "offset": length,
        "x": length,
        "rotational_stiffness": EI / length,
        "stiffness": EI / length**3 if key.startswith("attachment") else EI / length,
    }
    name = key.split(".")[-1]
    if name not in of_the_arm:
        raise ParameterError(key=f"start of {key}", value=own, remedy="say where to start the search")
    return 0.01 * of_the_arm[name] if own == 0 else 100 * of_the_arm[name]


class Around:
    """An arm and its neighbours a step below and above along each free number, as chains, made once for each drive.

    Where there is no arm on one side, at the tip for what is attached, the arm itself stands in its place.
    """

    def __init__(self, arm: Arm, pairs: Sequence[tuple[Arm, ...]]) -> None:
        self.arm, self._pairs = arm, pairs
        self._chains: dict[str, tuple[System, list[tuple[System, System]]]] = {}

    def gradients(self, driven: str, names: tuple[str, ...], s: Complex) -> tuple[Jet, list[Jet]]:
        """Drive and signals at s, up to one factor, with their derivatives along the free numbers."""
        if driven not in self._chains:
            pairs = [(system_of(under_drive(a, driven)), system_of(under_drive(b, driven))) for a, b in self._pairs]
            self._chains[driven] = system_of(under_drive(self.arm, driven)), pairs
        chain, pairs = self._chains[driven]
        signals, own = Signals(self.arm, names), self.arm
        along = [
            Direction(
                below,
                above,
                Signals(a, names).places,
                Signals(b, names).places,
                COORDINATE_STEP * ((a != own) + (b != own)),
            )
            for (below, above), (a, b) in zip(pairs, self._pairs, strict=True)
        ]
        return response_gradients(chain, signals.outputs, signals.places, along, s)


def drive_behind(arm: Arm, name: str) -> str:
    """What drives an arm where that is the input of a response: the arm's own drive, where it is over a signal."""
    return name if name in INPUTS and name not in OUTPUTS else arm.input


def under_drive(arm: Arm, driven: str) -> Arm:
    return arm if arm.input == driven else replace(arm, input=cast("Input", driven))


FREQUENCY_KNOWN = 2e-3  # of itself: what a decay says of it, where its deviation is not said
RATIO_KNOWN = 0.1  # of itself, likewise
EIGENVALUE_STEPS = 30  # of Newton's method, at most: from an undamped frequency on a few do
EIGENVALUE_FIRM = 1e-12  # of an eigenvalue: a step that is less ends it
MOST_NUMBER = 100  # number of a mode
MODE_FORM = "N=FREQUENCY,RATIO such as 1=2.52hz,0.006 (hz or rad_s; a deviation after ~: 2.52hz~0.01)"
MODE_PATTERN = re.compile(
    r"\s*(\d+)\s*=\s*([\d.eE+-]+)\s*(hz|rad_s)\s*(?:~\s*([\d.eE+-]+))?\s*(?:,(.*))?", re.IGNORECASE
)


@dataclass(frozen=True, kw_only=True)
@record
class RingMode:
    """A decay in one mode: its `number` among the flexible ones, and `frequency` w = Im s [rad/s], `ratio` -Re s/|s|.

    Each with its standard deviation; a ratio that is None was not measured.
    """

    number: int
    frequency: float
    frequency_deviation: float
    ratio: float | None = None
    ratio_deviation: float = math.inf


def mode_of(text: str) -> RingMode:
    """The decay that the command line means by "1=2.52hz,0.006".  Raises ParameterError for another form."""
    found = MODE_PATTERN.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        number, unit = int(found[1]), 2 * math.pi if found[3].lower() == "hz" else 1.0
        frequency = float(found[2]) * unit
        deviation = float(found[4]) * unit if found[4] else FREQUENCY_KNOWN * frequency
        ratio, spread = None, math.inf
        if found[5] is not None:
            value, _, said = found[5].partition("~")
            ratio = float(value)
            spread = float(said) if said else RATIO_KNOWN * ratio
            if not (0 < ratio < 1 and spread > 0):
                raise ValueError
        sizes_fit = frequency > 0 and deviation > 0 and math.isfinite(frequency * deviation)
        if not (1 <= number <= MOST_NUMBER and sizes_fit):
            raise ValueError
    except ValueError:
        raise ParameterError(key="--mode", value=text, remedy=f"write {MODE_FORM}") from None
    return RingMode(
        number=number, frequency=frequency, frequency_deviation=deviation, ratio=ratio, ratio_deviation=spread
    )


def ring_residuals(here: Around, rings: tuple[RingMode, ...], size: int) -> tuple[Real, Real]:
    """Computed less measured over its deviation (n,), of logarithms of frequencies and of ratios; slopes (n, size)."""
    rows: list[float] = []
    slopes: list[Any] = []
    for each in rings:
        s, ds = eigenvalue(here, each.number)
        pad = np.zeros(size - ds.size)
        share = each.frequency_deviation / each.frequency
        rows.append(math.log(s.imag / each.frequency) / share)
        slopes.append(np.r_[ds.imag / s.imag / share, pad])
        if each.ratio is not None:
            size_of, d_size = abs(s), (s.conjugate() * ds).real / abs(s)
            rows.append((-s.real / size_of - each.ratio) / each.ratio_deviation)
            d_ratio = -ds.real / size_of + s.real * d_size / size_of**2
            slopes.append(np.r_[d_ratio / each.ratio_deviation, pad])
    return np.array(rows), np.array(slopes).reshape(-1, size)


def eigenvalue(here: Around, number: int) -> tuple[complex, NDArray[Any]]:
    """The eigenvalue s [1/s] of a flexible mode and its derivatives (numbers of the arm,), by Newton's method.

    It starts from the undamped natural frequency; ConvergenceError where a damped mode does not ring near that.
    """
    arm = here.arm
    s = 1j * float(modes(arm, number).natural_frequency[-1])
    for _ in range(EIGENVALUE_STEPS):
        drive, _ = here.gradients(arm.input, ("hub_angle",), np.array([s, s * (1 + NUDGE)]))
        f, by_s = drive.c[0][0], (drive.c[0][1] - drive.c[0][0]) / (s * NUDGE)
        step = complex(f / by_s)
        s -= step
        if abs(step) < EIGENVALUE_FIRM * abs(s) or not abs(step) < abs(s):
            break
    if not (abs(step) < 1e-8 * abs(s) and s.imag > 0):
        raise ConvergenceError(f"mode {number} of {arm.name} does not ring near its undamped frequency", s, abs(step))
    return s, np.asarray(-drive.c[1][:, 0] / by_s)


WALL = 10.0  # times the largest residual of the first point: so high that no search goes on there
INSIDE_BOUNDS = 1e-9  # of a coordinate: so far inside its bounds a search begins


@dataclass(frozen=True)
class Response:
    """One measured response as the arm has it: its data, noise, and which numbers are its own gain and delay."""

    data: Measured
    noise: Noise
    gain: int | None = None  # place in the vector of what is searched for
    delay: int | None = None

    @property
    def size(self) -> int:
        """How many real residuals it has: two a frequency at which something was measured."""
        return 2 * int(np.isfinite(self.noise.sigma).sum())


@dataclass(frozen=True)
class Problem:
    """What is searched for: `parameters` of the arm first, then those of the sensors, and what they have to explain."""

    family: KeyedArms
    parameters: tuple[Parameter, ...]
    responses: tuple[Response, ...]
    rings: tuple[RingMode, ...] = ()

    @cached_property
    def _grids(self) -> dict[tuple[bytes, str], list[int]]:
        """Responses that are computed together, by their frequencies and by what drives the arm."""
        found: dict[tuple[bytes, str], list[int]] = {}
        for number, each in enumerate(self.responses):
            driven = drive_behind(self.family.arm, each.data.input)
            found.setdefault((each.data.omega.tobytes(), driven), []).append(number)
        return found

    @cached_property
    def of_the_arm(self) -> tuple[Parameter, ...]:
        """The parameters that are the arm's."""
        return self.parameters[: len(self.family.keys)]

    @cached_property
    def bounds(self) -> tuple[Real, Real]:
        """Lowest and highest coordinates."""
        low, high = zip(*(each.bounds for each in self.parameters), strict=True)
        return np.array(low), np.array(high)

    def inside(self, point: Real) -> Real:
        """The point, or the nearest one by `INSIDE_BOUNDS` inside the bounds."""
        low, high = self.bounds
        return np.clip(point, low + INSIDE_BOUNDS, high - INSIDE_BOUNDS)

    @property
    def size(self) -> int:
        """How many real residuals there are: two a frequency, one or two a decay, one a prior."""
        priors = sum(each.prior is not None for each in self.parameters)
        rings = sum(1 + (each.ratio is not None) for each in self.rings)
        return sum(each.size for each in self.responses) + rings + priors

    def numbers(self, point: Real) -> dict[str, float]:
        """The arm's numbers at a point of the search, by key."""
        return {each.key: each.value(float(x)) for each, x in zip(self.of_the_arm, point, strict=False)}

    def arm(self, point: Real) -> Arm:
        """The arm at a point."""
        return self.family.at(self.numbers(point))

    # ------------------------------------------------------------ responses

    def computed(self, point: Real) -> list[Complex]:
        """Each response at its own frequencies."""
        return [np.asarray(over / under) for over, under, _ in self.fractions(point)]

    def fractions(self, point: Real, share: float = 0.0) -> list[tuple[Complex, Complex, Real]]:
        """Numerator, denominator, and ln of the factor that both lack, of each response at s = (i + share) w."""
        arm = self.arm(point)
        found: list[Any] = [None] * len(self.responses)
        for (_, driven), numbers in self._grids.items():
            names = self._signals(numbers, driven)
            s = (1j + share) * self.responses[numbers[0]].data.omega
            parts = Signals(under_drive(arm, driven), names).parts(s)
            for n in numbers:
                over, under = self._over_and_under(n, names, parts.drive, parts.numerators)
                found[n] = over * self._sensor(n, point), under, parts.scale.real
        return found

    def slopes(self, point: Real, here: Around | None = None) -> list[tuple[Complex, Complex]]:
        """Each response, and its derivative (parameters, n) along each coordinate."""
        here, found = here or self.around(point), list[Any]([None] * len(self.responses))
        for (_, driven), numbers in self._grids.items():
            names, s = self._signals(numbers, driven), 1j * self.responses[numbers[0]].data.omega
            drive, outputs = here.gradients(driven, names, s)
            for n in numbers:
                over, under = self._over_and_under(n, names, drive, outputs)
                found[n] = self._with_slopes(n, over, under, point, s)
        return found

    def around(self, point: Real) -> Around:
        """The arm at a point, and those a step away along each of its own numbers."""
        base, pairs = self.numbers(point), []
        own = self.family.at(base)
        for each, x in zip(self.of_the_arm, point, strict=False):
            sides = []
            for step in (-COORDINATE_STEP, COORDINATE_STEP):
                try:
                    sides.append(self.family.at(base | {each.key: each.value(float(x) + step)}))
                except ParameterError:
                    sides.append(own)
            pairs.append(tuple(sides))
        return Around(own, tuple(pairs))

    def _with_slopes(self, n: int, over: Jet, under: Jet, point: Real, s: Complex) -> tuple[Complex, Complex]:
        one = self.responses[n]
        H = over.c[0] / under.c[0] * self._sensor(n, point)
        slopes = np.zeros((len(self.parameters), s.size), complex)
        slopes[: len(self.of_the_arm)] = H * (over.c[1] / over.c[0] - under.c[1] / under.c[0])
        if one.gain is not None:
            slopes[one.gain] = H  # by its logarithm
        if one.delay is not None:
            slopes[one.delay] = -s * H * self.parameters[one.delay].size
        return H, slopes

    def _signals(self, numbers: Sequence[int], driven: str) -> tuple[str, ...]:
        """What is read of the arm for those responses."""
        pairs = [(self.responses[n].data.output, self.responses[n].data.input) for n in numbers]
        return tuple(dict.fromkeys(name for output, input in pairs for name in (output, input) if name != driven))

    def _over_and_under(self, n: int, names: tuple[str, ...], drive: Any, numerators: Any) -> tuple[Any, Any]:
        """Numerator and denominator of a response: jets or arrays."""
        one = self.responses[n].data
        if one.output == drive_behind(self.family.arm, one.input):  # the input over a signal
            return drive, numerators[names.index(one.input)]
        return numerators[names.index(one.output)], numerators[names.index(one.input)] if one.input in names else drive

    def _sensor(self, n: int, point: Real) -> Any:
        one, factor = self.responses[n], 1.0
        if one.gain is not None:
            factor = self.parameters[one.gain].value(float(point[one.gain]))
        if one.delay is not None:
            delay = self.parameters[one.delay].value(float(point[one.delay]))
            return factor * np.exp(-1j * one.data.omega * delay)
        return factor

    def at(self, number: int, omega: Real) -> Problem:
        """The problem of one of its responses alone, at other frequencies: for curves."""
        one = self.responses[number]
        data = replace(one.data, omega=omega, values=np.ones(omega.size, complex), sigma=None, coherence=None)
        return replace(self, responses=(replace(one, data=data),), rings=())

    # ------------------------------------------------------------ residuals

    def residuals(self, point: Real) -> Real:
        """(size,): real and imaginary parts of computed less measured over their deviations, then the priors."""
        pairs = zip(self.computed(point), self.responses, strict=True)
        away = [_parts((H - one.data.values) / one.noise.sigma, one) for H, one in pairs]
        rings = ring_residuals(Around(self.arm(point), ()), self.rings, point.size)[0] if self.rings else np.empty(0)
        coordinates = zip(self.parameters, point.tolist(), strict=True)
        priors = [(each.value(x) - each.prior[0]) / each.prior[1] for each, x in coordinates if each.prior is not None]
        return np.concatenate([*away, rings, priors])

    def jacobian(self, point: Real) -> Real:
        """(size, parameters): the derivatives of the residuals."""
        here = self.around(point)
        pairs = zip(self.slopes(point, here), self.responses, strict=True)
        rows = [_parts(dH / one.noise.sigma, one) for (_, dH), one in pairs]
        rings = ring_residuals(here, self.rings, point.size)[1]
        priors = [
            row * each.slope(x) / each.prior[1]
            for row, each, x in zip(np.eye(point.size), self.parameters, point.tolist(), strict=True)
            if each.prior is not None
        ]
        return np.concatenate([*(row.T for row in rows), rings, np.reshape(priors, (-1, point.size))])


def walled(residuals: Callable[[Real], Real]) -> Callable[[Real], Real]:
    """The residuals, and a wall where there is no arm (a mass beyond the tip): `WALL` times the first one's largest."""
    walls: list[Real] = []

    def found(x: Real) -> Real:
        try:
            values = residuals(x)
        except ParameterError:
            if not walls:
                raise
            return walls[0]
        if not walls:
            walls.append(np.full(values.size, WALL * max(float(abs(values).max(initial=0.0)), 1.0)))
        return values

    return found


def _parts(values: Complex, one: Response) -> Real:
    """Real and imaginary parts, one behind the other, of what was measured."""
    return in_parts(values[..., np.isfinite(one.noise.sigma)])


def check_signals(arm: Arm, data: Sequence[Measured]) -> None:
    """Raise ParameterError where a response names what is no signal of the arm."""
    for each in data:
        for name, role in ((each.output, "output"), (each.input, "input")):
            check_signal(name, f"{role} of {each.name}")
            if name in INPUTS and name not in OUTPUTS:
                under_drive(arm, name)  # which needs a motor, or refuses
            else:
                Signals(arm, (name,))
        if each.output == each.input:
            raise ParameterError(key=each.name, value="1", remedy="a signal over itself says nothing of the arm")
