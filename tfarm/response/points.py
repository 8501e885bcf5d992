"""Values of one response at given points, as `tfarm response` has them, and by each method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from tfarm.arrays import Complex
from tfarm.columns import Column, Table
from tfarm.exact.values import MethodRow, Roads
from tfarm.records import record
from tfarm.schema import Quantity, roots_table

from .transfer import TransferFunction

DOUBLE_DIGITS = 15  # more are asked for as texts


@dataclass(frozen=True)
@record
class Points:
    """G(s) of one output at `s`; `value` are pairs of texts where more than 15 digits were asked for."""

    transfer: TransferFunction
    s: Annotated[Complex, Quantity("s", "1/s", curve=True)]
    value: Annotated[Any, Quantity(curve=True)]

    @property
    def arm(self) -> Annotated[str, Quantity("arm")]:
        """The name of the arm."""
        return self.transfer.arm.name

    @property
    def input(self) -> Annotated[str, Quantity("input")]:
        """The input."""
        return self.transfer.input

    @property
    def input_unit(self) -> Annotated[str, Quantity()]:
        """The unit of the input."""
        return self.transfer.input_unit

    @property
    def output(self) -> Annotated[str, Quantity("output")]:
        """The output."""
        return self.transfer.outputs[0]

    @property
    def unit(self) -> Annotated[str, Quantity()]:
        """The unit of the output."""
        return self.transfer.units[0]

    @property
    def gain_unit(self) -> Annotated[str, Quantity("unit")]:
        """The unit of G."""
        return f"{self.unit} / {self.input_unit}"

    @property
    def x(self) -> Annotated[float | None, Quantity(help="place of the output [m]")]:
        """The place of an output along the arm."""
        return self.transfer.x

    @property
    def method(self) -> Annotated[str, Quantity("method")]:
        """The method of the values."""
        return self.transfer.method

    @property
    def largest(self) -> Annotated[float, Quantity("largest magnitude")]:
        """The largest |G| of these points."""
        return float(abs(self._numbers).max())

    @property
    def largest_at(self) -> Annotated[complex, Quantity("at s", "1/s", 10)]:
        """The point of that."""
        return complex(self.s[int(abs(self._numbers).argmax())])

    @property
    def _numbers(self) -> Complex:
        if isinstance(self.value, np.ndarray):
            return self.value
        return np.array([complex(float(re), float(im)) for re, im in self.value])

    @property
    def csv_table(self) -> Table:
        """A row a point."""
        first = roots_table(self.s, Quantity("s", "1 / s", 12)).columns
        pairs = self.value if isinstance(self.value, list) else [(each.real, each.imag) for each in self.value.tolist()]
        parts = zip(("re", "im"), zip(*pairs, strict=True), strict=True)
        values = (
            Column(f"{part}_{self.output}", f"{part} {self.output}", self.gain_unit, of=list(of)) for part, of in parts
        )
        names = (Column(f"{each.key}_s", each.title, "1/s", of=each.of, shown=each.shown) for each in first)
        return Table(columns=(*names, *values))


def points(G: TransferFunction, s: Complex, digits: int | None = None) -> Points:
    """The response at s, with so many right digits where more than 15 are asked for."""
    if digits is not None and digits > DOUBLE_DIGITS:
        return Points(G, s, [list(G.digits(complex(point), digits)) for point in s])
    return Points(G, s, np.asarray(G(s)))


@dataclass(frozen=True)
class ByMethods:
    """The same numbers of an arm by each method, a row a mode or point of `at`."""

    arm: Annotated[str, Quantity("arm")]
    of: Annotated[str, Quantity("quantity", key="output")]
    unit: Annotated[str, Quantity("unit")]
    at: Annotated[Sequence[Any], Quantity()]
    roads: Annotated[Roads, Quantity(flat=True)]

    @property
    def rows(self) -> Annotated[list[MethodRow], Quantity("by method", key="rows")]:
        """A row a mode or point."""
        return self.roads.rows(self.at)
