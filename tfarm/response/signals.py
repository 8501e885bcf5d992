"""The signals of a controller: named outputs, along the link with their place, as one row of analytic functions.

A transfer function is numerator over drive, both analytic.  The characteristic function of a loop is a sum of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.checks import on_the_arm
from tfarm.arrays import Complex
from tfarm.errors import MISSING, ParameterError
from tfarm.exact.characteristic import LoopParts
from tfarm.exact.outputs import Output
from tfarm.exact.outputs import output as known_output
from tfarm.exact.series import order_at_zero
from tfarm.exact.system import System, system_of
from tfarm.exact.values import free_outputs
from tfarm.records import read_only, record

GRIDS_KEPT = 24  # sets of points whose values are cached


@dataclass(frozen=True)
@record
class Signals:
    """Outputs of an arm by name, those along the link with their place in m: "hub_rate", "strain@0.05".

    Raises ParameterError for an unknown output, and for a place that is missing, superfluous or off the link.
    """

    arm: Arm
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self._placed:
            raise ParameterError(key="signals", value=[], remedy="name at least one output")

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The output of each signal."""
        return tuple(wanted for wanted, _ in self._placed)

    @cached_property
    def places(self) -> tuple[float, ...]:
        """The place of each as a share of the length; 0 for outputs with a fixed place."""
        return tuple(place / self.arm.length for _, place in self._placed)

    @property
    def units(self) -> tuple[str, ...]:
        """The SI unit of each."""
        return tuple(each.unit for each in self.outputs)

    @cached_property
    def system(self) -> System:
        """The exact system of the arm."""
        return system_of(self.arm)

    def kept(self, s: Complex) -> LoopParts:
        """Return `parts`, cached for the last sets of points."""
        key, kept = (s.shape, s.tobytes()), self._kept
        found = kept.pop(key, None) or read_only(self.parts(s))
        kept[key] = found  # the last one is the latest
        if len(kept) > GRIDS_KEPT:
            del kept[next(iter(kept))]
        return found

    @cached_property
    def _kept(self) -> dict[Any, LoopParts]:
        return {}

    def parts(self, s: NDArray[Any]) -> LoopParts:
        """Return drive (n,), numerators (signals, n) in SI per unit of the input, and scale, at s of any shape."""
        k, s = self.system, np.asarray(s, dtype=complex)
        numerators = np.empty((len(self.names), s.size), complex)
        first: LoopParts | None = None
        for share in dict.fromkeys(self.places):
            rows = [n for n, place in enumerate(self.places) if place == share]
            free = free_outputs(k, [self.outputs[n] for n in rows], s.ravel(), share)
            first = first or LoopParts(free.drive, numerators, free.scale)
            numerators[rows] = free.outputs * np.exp(free.scale - first.scale)  # each layout has its own scale
        assert first is not None  # there is at least one signal
        return LoopParts(*(part.reshape(*part.shape[:-1], *s.shape) for part in first))

    def values(self, s: NDArray[Any]) -> Complex:
        """Return the transfer functions (signals, ...) at s; infinite at their poles."""
        drive, numerators, _ = self.parts(s)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(numerators / drive)

    @cached_property
    def orders(self) -> tuple[int, ...]:
        """The order of each numerator's zero at s = 0; that of the drive is `system.at_rest`."""
        return tuple(
            order_at_zero(self.system, wanted, share) for wanted, share in zip(self.outputs, self.places, strict=True)
        )

    @cached_property
    def _placed(self) -> tuple[tuple[Output, float], ...]:
        """The output of each name and its place [m]."""
        return tuple(placed(name, self.arm.length) for name in self.names)


def placed(name: str, length: float) -> tuple[Output, float]:
    """Return the output of a name and its place [m] on an arm of this length.  Raises ParameterError for others."""
    plain, at, text = name.partition("@")
    wanted = known_output(plain)
    if wanted.place != "x":
        if at:
            raise ParameterError(key=name, value=text, remedy=f"{plain} has a fixed place; leave out {at}{text}")
        return wanted, 0.0
    if not at:
        raise ParameterError(
            key=f"{name}.x", value=MISSING, remedy=f"add the place: {plain}@x with x between 0 and {length:g} m"
        )
    try:
        x = float(text)
    except ValueError:
        raise ParameterError(key=name, value=text, remedy=f"a number of metres, 0 to {length:g}") from None
    return wanted, float(on_the_arm(name, x, length))
