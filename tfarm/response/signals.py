"""The signals of a controller: named outputs, along the link with their place, as one row of analytic functions.

A transfer function is numerator over drive, both analytic.  The characteristic function of a loop is a sum of both.
The results of loops describe their controller by its gains or transfer functions, signals, units, sign convention.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import LISTED, SPELT_OUT, Arm, Law, input_words, unit_of
from tfarm.arm.checks import on_the_arm
from tfarm.arrays import Complex
from tfarm.errors import MISSING, ParameterError, require
from tfarm.exact.characteristic import LoopParts
from tfarm.exact.outputs import Output
from tfarm.exact.outputs import output as known_output
from tfarm.exact.series import order_at_zero
from tfarm.exact.system import System, system_of
from tfarm.exact.values import free_outputs
from tfarm.records import frozen, read_only
from tfarm.schema import Quantity


@frozen
class Signals:
    """Outputs of an arm by name, those along the link with their place in m: "hub_rate", "strain@0.05".

    Raises ParameterError for an unknown output, and for a place that is missing, superfluous or off the link.
    """

    arm: Arm
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        require(self._places_by_output, "signals", [], "name at least one output")

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The output of each signal."""
        return tuple(wanted for wanted, _ in self._places_by_output)

    @cached_property
    def places(self) -> tuple[float, ...]:
        """The place of each as a share of the length; 0 for outputs with a fixed place."""
        return tuple(place / self.arm.length for _, place in self._places_by_output)

    @property
    def units(self) -> tuple[str, ...]:
        """The SI unit of each."""
        return tuple(each.unit for each in self.outputs)

    @cached_property
    def system(self) -> System:
        """The exact system of the arm."""
        return system_of(self.arm)

    def recall_parts(self, s: Complex) -> LoopParts:
        """Return `parts`, cached for the last 24 sets of points."""
        key = (s.shape, s.tobytes())
        cache = self._cache
        found = cache.pop(key, None) or read_only(self.parts(s))
        # the last one is the latest
        cache[key] = found
        if len(cache) > 24:
            del cache[next(iter(cache))]
        return found

    @cached_property
    def _cache(self) -> dict[Any, LoopParts]:
        return {}

    def parts(self, s: NDArray[Any]) -> LoopParts:
        """Return drive (n,), numerators (signals, n) in SI per unit of the input, and scale, at s of any shape."""
        k = self.system
        s = np.asarray(s, dtype=complex)
        numerators = np.empty((len(self.names), s.size), complex)
        first: LoopParts | None = None
        for share in dict.fromkeys(self.places):
            rows = [n for n, place in enumerate(self.places) if place == share]
            free = free_outputs(k, [self.outputs[n] for n in rows], s.ravel(), share)
            first = first or LoopParts(free.drive, numerators, free.scale)
            # each layout has its own scale
            numerators[rows] = free.outputs * np.exp(free.scale - first.scale)
        # there is at least one signal
        assert first is not None
        return LoopParts(*(part.reshape(*part.shape[:-1], *s.shape) for part in first))

    def values(self, s: NDArray[Any]) -> Complex:
        """Return the transfer functions (signals, ...) at s; infinite at their poles."""
        drive, numerators, _ = self.parts(s)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(numerators / drive)

    @cached_property
    def orders(self) -> tuple[int, ...]:
        """The order of each numerator's zero at s = 0; that of the drive is `system.at_rest`."""
        pairs = zip(self.outputs, self.places, strict=True)
        return tuple(order_at_zero(self.system, wanted, share) for wanted, share in pairs)

    @cached_property
    def _places_by_output(self) -> tuple[tuple[Output, float], ...]:
        """The output of each name and its place [m]."""
        return tuple(locate_output(name, self.arm.length) for name in self.names)


def locate_output(name: str, length: float) -> tuple[Output, float]:
    """Return the output of a name and its place [m] on an arm of this length.  Raises ParameterError for others."""
    plain, at, text = name.partition("@")
    wanted = known_output(plain)
    if wanted.place != "x":
        require(not at, name, text, f"{plain} has a fixed place; leave out {at}{text}")
        return wanted, 0.0
    require(at, f"{name}.x", MISSING, f"add the place: {plain}@x with x between 0 and {length:g} m")
    try:
        x = float(text)
    except ValueError:
        raise ParameterError(key=name, value=text, remedy=f"a number of metres, 0 to {length:g}") from None
    return wanted, float(on_the_arm(name, x, length))


@dataclass(frozen=True)
class ControllerSignals:
    """A law on an arm.  `gains` are those at the hub, empty of another law; `signals` have their SI units."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    law: Annotated[str, Quantity("controller", help="its gains at the hub, or its name")]
    gains: Annotated[dict[str, float], Quantity(help="gain at the hub", flat=True)]
    gain_units: Annotated[dict[str, str], Quantity(help="SI unit of each gain")]
    signals: Annotated[
        dict[str, str], Quantity("signals", help="outputs that are fed back, with their SI units")
    ]
    law_order: Annotated[
        int, Quantity("order of the controller", help="number of its states, without delays")
    ]
    delay: Annotated[float, Quantity(unit="s", help="delay of the controller")]
    sign_convention: Annotated[
        str, Quantity("sign convention", help="control law from the signals to the input")
    ]
    input: Annotated[str, Quantity("input", help="actuating signal")]


def controller(law: Law, arm: Arm) -> ControllerSignals:
    """Return the description of a law on an arm."""
    gains = {} if law.gains is None else law.gains.by_name
    units = {gain.name: unit_of(gain.name, arm) for gain in LISTED} if gains else {}
    return ControllerSignals(
        arm=arm.name,
        law=", ".join(f"{name} = {value:g}" for name, value in gains.items()) or law.name,
        gains=gains,
        gain_units=units,
        signals=dict(zip(law.signals, Signals(arm, law.signals).units, strict=True)),
        law_order=law.order,
        delay=law.delay,
        sign_convention=sign_convention(law, arm),
        input=arm.input,
    )


def sign_convention(law: Law, arm: Arm) -> str:
    """Return the control law in words; for gains at the hub with the moment of a static torque."""
    if law.gains is not None:
        return sign_of(arm)
    sign = "-" if law.sign < 0 else "+"
    variable = "z" if law.is_discrete else "s"
    late = f", delay {law.delay:g} s" if law.delay else ""
    return (
        f"v = {sign}sum of C_i({variable}) y_i{late}; v is {input_words(arm)}, y = ({', '.join(law.signals)})"
    )


def sign_of(arm: Arm) -> str:
    """Return the law of gains at the hub in words, and the moment of a static torque, which fixes the sign of K2."""
    words = f"u = -{SPELT_OUT} + r"
    if arm.is_uniform and arm.has_rigid_mode:
        return f"{words}; a static torque u gives the moment -(J - I_h)/J u"
    if not arm.has_rigid_mode:
        return f"{words}; u is {input_words(arm)}"
    share = -arm.gauged_inertia / arm.total_inertia
    at_rest = f"a static torque at the hub gives the moment {share:.6g} times as much"
    return f"{words}; u is {input_words(arm)}, and {at_rest}"
