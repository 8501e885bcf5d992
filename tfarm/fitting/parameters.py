"""What of an arm may be free: any number of its TOML file, by its key, with a start, bounds and perhaps a prior.

A number that cannot be negative is searched for by its logarithm, any other by itself over its size; so a step of the
search is a share of the number.

An arm and its neighbours, a step away along each number that is free: for derivatives of whatever is read of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

from tfarm.arm import INPUTS, Arm, Input
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Complex
from tfarm.errors import ParameterError, did_you_mean
from tfarm.exact.gradients import Direction, response_gradients
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.series import Jet
from tfarm.exact.system import System, system_of
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum.scales import first_frequency

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
