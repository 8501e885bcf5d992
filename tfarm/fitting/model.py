"""Measured less computed: the residuals of an arm whose numbers run, over their deviations, with exact derivatives.

The response of one signal to another is the ratio of two of the arm's transfer functions, so of their numerators, times
a sensor's gain and delay:  H = gain e^{-i w tau} N_out/N_in,  with the drive for N_in where the input is the arm's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import INPUTS, Arm
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.series import Jet
from tfarm.response.signals import Signals

from .data import Measured, Noise, in_parts
from .parameters import COORDINATE_STEP, Around, Parameter, drive_behind, under_drive
from .reading import check_signal
from .ringing import RingMode, ring_residuals

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
