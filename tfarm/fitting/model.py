"""Measured less computed: the residuals of an arm whose numbers are free, over their deviations, with derivatives.

Any number of an arm's TOML file may be free, by its key, with a start, bounds and perhaps a prior.  One that cannot be
negative is searched for by its logarithm, any other by itself over its size; so a step of the search is a share of the
number.

The response of one signal to another is the ratio of two of the arm's transfer functions, so of their numerators, times
a sensor's gain and delay:  H = gain e^{-i w tau} N/D,  with the drive for D where the input is the arm's own.  N and D
have no poles, however sharp a resonance of H is: their derivatives are central differences, right to about 1e-10.
Decays of single modes are eigenvalues of the arm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from tfarm.arm import INPUTS, Arm, Input
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError, did_you_mean, require
from tfarm.exact.characteristic import characteristic
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.system import system_of
from tfarm.fitting.data import NUMBER, Measured, Noise, in_parts
from tfarm.fitting.held import held_parts
from tfarm.fitting.run_model import DRIVE_DELAY, FitRun
from tfarm.records import frozen
from tfarm.response.signals import Signals
from tfarm.spectrum import modes
from tfarm.spectrum.box import newton
from tfarm.spectrum.table import first_frequency


@frozen
class Parameter:
    """A free number: its key, where the search starts, its bounds, all in SI units, and a prior (mean, deviation).

    The search is for (value - start)/size, or where the size is 0 for ln(value/start); of one `is_inverse` for
    (1/value - 1/start)/size.
    """

    key: str
    start: float
    low: float
    high: float
    size: float = 0.0
    prior: tuple[float, float] | None = None
    is_inverse: bool = False
    # times the start, or a part of it: beyond, a search has lost its way, or the data say nothing
    farthest: ClassVar[float] = 1e4

    def value(self, coordinate: float) -> float:
        """Return the number at a coordinate of the search, 0 at the start."""
        if self.is_inverse:
            return 1.0 / (1.0 / self.start + self.size * coordinate)
        if self.size:
            return self.start + self.size * coordinate
        return self.start * math.exp(coordinate)

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a number."""
        if self.is_inverse:
            return (1.0 / value - 1.0 / self.start) / self.size
        if self.size:
            return (value - self.start) / self.size
        return math.log(value / self.start)

    @property
    def bounds(self) -> tuple[float, float]:
        """Of the coordinate."""
        if self.size:
            low, high = sorted((self.coordinate(self.low), self.coordinate(self.high)))
            return low, high
        ends = (self.low / self.start, self.high / self.start)
        shares = np.clip(ends, 1 / self.farthest, self.farthest)
        return math.log(shares.min()), math.log(shares.max())

    def ends(self, coordinates: Sequence[float]) -> list[float | None]:
        """Return the numbers at the ends of an interval, the lower first.

        None where only the reach of the search ended it.
        """
        # a search that comes nearer to its reach has ended there
        farthest = math.inf if self.size else math.log(self.farthest) - 1e-6
        found = [self.value(each) if abs(each) < farthest else None for each in coordinates]
        return found if self.start > 0 or self.size else found[::-1]


def free_parameters(
    arm: Arm,
    keys: Sequence[str],
    *,
    start: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    priors: Mapping[str, tuple[float, float]],
) -> tuple[KeyedArms, tuple[Parameter, ...]]:
    """Return the family of an arm whose numbers under `keys` are free, and these numbers.

    Each starts where `start` has it, else at the arm's own value, or where that is 0 at a hundredth of a typical one.
    Raises ParameterError for a key that is none or is not free, and for bounds or a start that leave no room.
    """
    for known, what in ((start, "start"), (bounds, "bounds"), (priors, "prior")):
        for key in known:
            require(key in keys, what, key, f"is not free; {did_you_mean(key, keys)}")
    family = KeyedArms(arm, keys)
    found = []
    for key in family.keys:
        name = key.split(".")[-1]
        is_signed = name == "offset"
        at = start.get(key, family.value(key))
        if key not in start and (at == 0 or not math.isfinite(at)):
            at = _typical(arm, key, at)
        most = {"x": arm.length, "gear_efficiency": 1.0, "poissons_ratio": 0.5}.get(name, math.inf)
        low, high = bounds.get(key, (-math.inf if is_signed else 0.0, most))
        remedy = f"starts at {at:g}; give bounds low,high around it, or another start"
        require(low <= at <= high and low < high, f"bounds of {key}", (low, high), remedy)
        require(is_signed or at > 0, f"start of {key}", at, "a positive number in SI units")
        prior = priors.get(key)
        if prior is not None:
            is_legal = math.isfinite(prior[0]) and prior[1] > 0
            require(is_legal, f"prior of {key}", prior, "mean,deviation with a deviation above 0")
        size = max(abs(at), 0.1 * arm.length) if is_signed else 0.0
        found.append(Parameter(key, at, low, high, size, prior))
    return family, tuple(found)


def _typical(arm: Arm, key: str, own: float) -> float:
    """Return a hundredth of a typical value, for a number that is 0, or a hundred times it for one that is infinite."""
    w1 = first_frequency(arm)
    inertia = arm.turned_inertia if math.isfinite(arm.turned_inertia) else arm.carried_inertia
    EI = arm.link.EI
    length = arm.length
    name = key.split(".")[-1]
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
    require(name in of_the_arm, f"start of {key}", own, "give the value where the search starts")
    return (0.01 if own == 0 else 100) * of_the_arm[name]


class RingMode(NamedTuple):
    """A decay in one mode: its `number` among the flexible ones, and `frequency` w = Im s [rad/s], `ratio` -Re s/|s|.

    Each with its standard deviation; a ratio that is None was not measured.
    """

    number: int
    frequency: float
    frequency_deviation: float
    ratio: float | None = None
    ratio_deviation: float = math.inf


def mode_of(text: str) -> RingMode:
    """Return the decay that the command line means by "1=2.52hz,0.006".  Raises ParameterError for another form.

    The deviation is by default 0.2 % of a frequency, and 10 % of a ratio.
    """
    some = rf"({NUMBER})\s*"
    spread = rf"(?:~\s*{some})?"
    form = rf"\s*(\d{{1,3}})\s*=\s*{some}(?:hz|rad_s)\s*{spread}(?:,\s*{some}{spread})?"
    found = re.fullmatch(form, text, re.IGNORECASE | re.ASCII)
    remedy = "write N=FREQUENCY,RATIO such as 1=2.52hz,0.006 (hz or rad_s; a deviation after ~: 2.52hz~0.01)"
    number, *given = found.groups() if found else ("0",) * 5
    w, dw, ratio, of_ratio = (float(each) if each else None for each in given)
    unit = 2 * math.pi if "hz" in text.lower() else 1.0
    frequency = (w or 0.0) * unit
    deviation = 2e-3 * frequency if dw is None else dw * unit
    of_ratio = 0.1 * (math.inf if ratio is None else ratio) if of_ratio is None else of_ratio
    is_ratio = ratio is None or 0 < ratio < 1
    is_positive = min(frequency, deviation, of_ratio) > 0 and frequency * deviation < math.inf
    require(1 <= int(number) <= 100 and is_positive and is_ratio, "--mode", text, remedy)
    return RingMode(int(number), frequency, deviation, ratio, of_ratio)


def eigenvalue(arm: Arm, number: int) -> complex:
    """Return the eigenvalue s [1/s] of a flexible mode, by Newton's method.

    It starts from the undamped natural frequency; ConvergenceError where a damped mode does not ring near that.
    """
    system = system_of(arm)
    start = 1j * modes(arm, number).natural_frequency[-1:]
    found = newton(lambda s: characteristic(system, s), start)
    if not (found.imag > 0).any():
        raise ConvergenceError(
            f"mode {number} of {arm.name} does not ring near its undamped frequency", found, None
        )
    return complex(found[0])


# of a sensor, as `FitResponse` has them: free like the arm's numbers
SENSOR_GAIN = "gain"
SENSOR_DELAY = "delay"


def is_of_chain(key: str) -> bool:
    """Return whether a free number is a sensor's or of the drive's dead time, and none of the arm's."""
    starts = (f"{SENSOR_GAIN}:", f"{DRIVE_DELAY}:")
    return key in (SENSOR_GAIN, SENSOR_DELAY, DRIVE_DELAY) or key.startswith(starts)


@dataclass(frozen=True)
class FitResponse:
    """One measured response as the arm has it: its data, noise, and which numbers are its own gain and delay."""

    data: Measured
    noise: Noise
    # place in the vector of what is searched for
    gain: int | None = None
    delay: int | None = None

    @property
    def size(self) -> int:
        """How many real residuals it has: two a frequency at which something was measured."""
        return 2 * self.noise.is_finite.sum()

    @property
    def has_known_noise(self) -> bool:
        """Whether the size of its noise was not taken from the residuals."""
        return self.noise.is_known

    @property
    def log_deviation(self) -> float:
        """The sum of ln sigma over all residuals."""
        return 2 * float(np.log(self.noise.sigma[self.noise.is_finite]).sum())

    def rescaled(self, residuals: Real, share: float) -> FitResponse:
        """Return it with a deviation known up to a factor as its own residuals say, times the root of a share."""
        if self.noise.is_known:
            return self
        factor = math.sqrt((residuals @ residuals) / residuals.size * share)
        # of a deviation: a change that moves no number
        if abs(factor - 1) < 1e-6:
            return self
        return replace(self, noise=replace(self.noise, sigma=self.noise.sigma * max(factor, 1e-12)))

    def over_deviation(self, values: Complex) -> Real:
        """Return values at its frequencies over their deviations, in parts, of what was measured."""
        kept = self.noise.is_finite
        return in_parts(values[kept] / self.noise.sigma[kept])

    def at(self, omega: Real, values: Complex, sigma: Real) -> FitResponse:
        """Return the response at other frequencies."""
        data = replace(self.data, omega=omega, values=values, sigma=None, coherence=None)
        return replace(self, data=data, noise=replace(self.noise, sigma=sigma))


class Fraction(NamedTuple):
    """A response N/D at its frequencies (n,), and `scale`, ln of a factor that both lack."""

    N: Complex
    D: Complex
    scale: Real


@dataclass(frozen=True)
class Problem:
    """What is searched for: `parameters` of the arm first, then those of the sensors, and what they have to explain.

    Runs may be of several arms, the family's own and `others`, the rest is of the first.  A number that not all of them
    share has the arm's name in its key: "link.length:ruler".
    """

    family: KeyedArms
    parameters: tuple[Parameter, ...]
    responses: tuple[FitResponse, ...]
    rings: tuple[RingMode, ...] = ()
    runs: tuple[FitRun, ...] = ()
    others: tuple[KeyedArms, ...] = ()

    @property
    def records(self) -> tuple[FitResponse | FitRun, ...]:
        """What was measured, in the order of the residuals."""
        return *self.responses, *self.runs

    @cached_property
    def of_the_arm(self) -> tuple[Parameter, ...]:
        """The parameters that are the arm's, or one of the arms'."""
        return tuple(each for each in self.parameters if each.key.partition(":")[0] in self.family.keys)

    @cached_property
    def bounds(self) -> tuple[Real, Real]:
        """Lowest and highest coordinates."""
        low, high = np.transpose([each.bounds for each in self.parameters])
        return low, high

    @property
    def start(self) -> Real:
        """Where the search starts."""
        return self.inside(np.zeros(len(self.parameters)))

    def inside(self, point: Real, by: float = 1e-9) -> Real:
        """Return the point, or the nearest one by that inside the bounds."""
        low, high = self.bounds
        return np.clip(point, low + by, high - by)

    def arm(self, point: Real, number: int = 0) -> Arm:
        """Return the arm at a point, by its number where there are several."""
        family = (self.family, *self.others)[number]
        values = {}
        for each, x in zip(self.of_the_arm, point.tolist(), strict=False):
            key, _, name = each.key.partition(":")
            if name in ("", family.arm.name):
                values[key] = each.value(x)
        return family.at(values)

    def arms(self, point: Real) -> list[Arm]:
        """Return all arms at a point."""
        return [self.arm(point, number) for number in range(1 + len(self.others))]

    def value(self, point: Real, place: int) -> float:
        """Return the number of that place in the vector at a point."""
        return self.parameters[place].value(float(point[place]))

    # ------------------------------------------------------------ responses

    def compute(self, point: Real) -> list[Complex]:
        """Return each response at its own frequencies."""
        return [(each.N / each.D) for each in self.fractions(point)]

    def fractions(self, point: Real, share: float = 0.0) -> list[Fraction]:
        """Return each response at s = (i + share) w.

        Those of one grid of frequencies and one drive are computed together.
        """
        arm = self.arm(point)
        grids: dict[tuple[bytes, str], set[str]] = {}
        keys = []
        for each in self.responses:
            of = each.data
            # the input of the response, or where that is a signal the arm's own
            driven = of.input if of.input in INPUTS and of.input not in OUTPUTS else arm.input
            keys.append((of.omega.tobytes(), driven))
            grids.setdefault(keys[-1], set()).update({of.output, of.input} - {driven})
        known: dict[tuple[bytes, str], tuple[dict[str, Complex], Real]] = {}
        for (grid, drives), signals in grids.items():
            names = tuple(sorted(signals))
            under_drive = arm if arm.input == drives else replace(arm, input=cast("Input", drives))
            drive, numerators, scale = Signals(under_drive, names).parts((1j + share) * np.frombuffer(grid))
            known[grid, drives] = (
                {drives: drive} | dict(zip(names, numerators, strict=True)),
                np.asarray(scale.real),
            )
        found = []
        for each, key in zip(self.responses, keys, strict=True):
            gain = 1.0 if each.gain is None else self.value(point, each.gain)
            delay = 0.0 if each.delay is None else self.value(point, each.delay)
            sensor = gain * np.exp(-1j * delay * each.data.omega)
            values, lacking = known[key]
            N = values[each.data.output]
            D = values[each.data.input]
            if each.data.held is not None:
                s = (1j + share) * each.data.omega
                under_drive = replace(arm, input=key[1])
                hold, images = held_parts(under_drive, each.data.output, each.data.held, s)
                N = N * hold + D * images
            found.append(Fraction(N * sensor, D, lacking))
        return found

    def with_sensors(self, free: Sequence[str]) -> Problem:
        """Return the problem with "gain" or "delay" of each sensor free, too."""
        own = [*self.parameters]
        responses = []
        for n, each in enumerate(self.responses, start=1):
            places: dict[str, Any] = {}
            which = "" if len(self.responses) == 1 else f":{n}"
            for key, start, size in ((SENSOR_GAIN, 1.0, 0.0), (SENSOR_DELAY, 0.0, 1.0 / each.data.band[1])):
                if key in free and getattr(each, key) is None:
                    places[key] = len(own)
                    own.append(Parameter(key + which, start, -np.inf, np.inf, size))
            responses.append(replace(each, **places))
        return replace(self, parameters=tuple(own), responses=tuple(responses))

    def at(self, number: int, omega: Real) -> Problem:
        """Return the problem of one of its responses alone, at other frequencies: for curves."""
        one = self.responses[number].at(omega, np.ones(omega.size, complex), np.ones(omega.size))
        return replace(self, responses=(one,), rings=(), runs=())

    # ------------------------------------------------------------ residuals

    def residuals(self, point: Real) -> Real:
        """Return computed less measured over their deviations (size,), of decays and priors last."""
        fractions, others = self._terms(point)
        pairs = zip(fractions, self.responses, strict=True)
        return np.concatenate(
            [*(one.over_deviation(N / D - one.data.values) for (N, D, _), one in pairs), others]
        )

    def jacobian(self, point: Real) -> Real:
        """Return the derivatives of the residuals (size, parameters).

        Those of a run are at constant own numbers, with what these can add projected out (Kaufman 1975).
        """
        arms = self.arms(point)
        projections = [
            each.projection(arms[each.arm], lambda place: self.value(point, place)) for each in self.runs
        ]
        own = [each.own for each in projections]
        here = self._terms(point, own)
        # the rounding of a float over it is 1e-10, its square below
        size = 2.0**-20
        steps = size * np.eye(point.size)
        found = np.stack([self._slope(here, point, step, own) for step in steps], axis=1)
        row = sum(each.size for each in self.responses)
        for each in projections:
            rows = found[row : row + each.residuals.size]
            rows -= each.basis @ (each.basis.T @ rows)
            row += each.residuals.size
        return found

    def _slope(self, here: tuple[list[Fraction], Real], point: Real, step: Real, own: Sequence[Real]) -> Real:
        """Return the derivatives along one coordinate; from the arm itself where there is none on one side."""
        sides = [here, here]
        size = float(step.max())
        width = 0.0
        for side, to in enumerate((point - step, point + step)):
            with suppress(ParameterError):
                sides[side] = self._terms(to, own)
                width += size
        (below, low), (above, high) = sides
        slopes = []
        for (N, D, scale), down, up, one in zip(here[0], below, above, self.responses, strict=True):
            lower = np.exp(down.scale - scale)
            upper = np.exp(up.scale - scale)
            dN = up.N * upper - down.N * lower
            dD = up.D * upper - down.D * lower
            slopes.append(one.over_deviation((dN - N / D * dD) / D))
        return np.concatenate([*slopes, high - low]) / max(width, size)

    def _terms(self, point: Real, own: Sequence[Real] = ()) -> tuple[list[Fraction], Real]:
        """Return the responses, and what runs, decays and priors leave; `own` are the runs' numbers, if given."""
        coordinates = zip(self.parameters, point.tolist(), strict=True)
        priors = [
            (each.value(x) - each.prior[0]) / each.prior[1]
            for each, x in coordinates
            if each.prior is not None
        ]
        arms = self.arms(point)

        def value(place: int) -> float:
            return self.value(point, place)

        if own:
            pairs = zip(self.runs, own, strict=True)
            runs = [each.residuals_with(arms[each.arm], value, numbers) for each, numbers in pairs]
        else:
            runs = [each.residuals(arms[each.arm], value) for each in self.runs]
        return self.fractions(point), np.concatenate([*runs, self.decays(point, self.rings), priors])

    def decays(self, point: Real, rings: Sequence[RingMode]) -> Real:
        """Return the residuals of decays, over their deviations (n,), of logarithms of frequencies and of ratios."""
        rows: list[float] = []
        for each in rings:
            s = eigenvalue(self.arm(point), each.number)
            rows.append(math.log(s.imag / each.frequency) * each.frequency / each.frequency_deviation)
            if each.ratio is not None:
                rows.append((-s.real / abs(s) - each.ratio) / each.ratio_deviation)
        return np.array(rows)


def penalize(residuals: Callable[[Real], Real], first: Real) -> Callable[[Real], Real]:
    """Return the residuals with a wall where there is no arm (a mass beyond the tip), too high for a search."""
    near = residuals(first)
    wall = np.full(near.size, 10.0 * max(abs(near).max(initial=0.0), 1.0))

    def found(x: Real) -> Real:
        try:
            return residuals(x)
        except (ParameterError, ConvergenceError):
            return wall

    return found
