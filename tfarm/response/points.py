"""Values of one response at points s, those of `tfarm response`, and by each method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from tfarm.arrays import Complex
from tfarm.digits import DOUBLE_DIGITS
from tfarm.exact.values import ByMethod, MethodRow
from tfarm.records import record
from tfarm.schema import Column, Quantity, Table, roots_table

from .transfer import TransferFunction


@dataclass(frozen=True)
@record
class Points:
    """G(s) of one output at `s`; `value` are pairs of texts for more than 15 digits."""

    s: Annotated[Complex, Quantity("s", "1/s", help="Laplace variable", curve=True)]
    value: Annotated[Any, Quantity(help="G(s), output over input", curve=True)]
    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    input: Annotated[str, Quantity("input", help="input of the transfer function")]
    input_unit: Annotated[str, Quantity(help="SI unit of the input")]
    output: Annotated[str, Quantity("output", help="output of the transfer function")]
    unit: Annotated[str, Quantity(help="SI unit of the output")]
    x: Annotated[float | None, Quantity(help="place of the output [m]")]
    method: Annotated[str, Quantity("method", help="closed form, ball arithmetic or the paper's appendix")]

    @property
    def gain_unit(self) -> Annotated[str, Quantity("unit", help="SI unit of G, output over input")]:
        """The unit of G."""
        return f"{self.unit} / {self.input_unit}"

    @property
    def largest(
        self,
    ) -> Annotated[float, Quantity("largest magnitude", help="largest |G| of these points", unit_of="gain_unit")]:
        """The largest |G| at these points."""
        return float(abs(self._numbers).max())

    @property
    def largest_at(self) -> Annotated[complex, Quantity("at s", "1/s", 10, "point of the largest magnitude")]:
        """The point of the largest |G|."""
        return complex(self.s[int(abs(self._numbers).argmax())])

    @property
    def _numbers(self) -> Complex:
        if isinstance(self.value, np.ndarray):
            return self.value
        return np.array([complex(float(re), float(im)) for re, im in self.value])

    @property
    def csv_table(self) -> Table:
        """A row for each point."""
        first = roots_table(self.s, Quantity("s", "1 / s", 12)).columns
        pairs = self.value if isinstance(self.value, list) else [(each.real, each.imag) for each in self.value.tolist()]
        parts = zip(("re", "im"), zip(*pairs, strict=True), strict=True)
        values = (
            Column(f"{part}_{self.output}", f"{part} {self.output}", self.gain_unit, of=list(of)) for part, of in parts
        )
        names = (Column(f"{each.key}_s", each.title, "1/s", of=each.of, shown=each.shown) for each in first)
        return Table(columns=(*names, *values))


def points(G: TransferFunction, s: Complex, digits: int | None = None) -> Points:
    """Return the response at s, with certified digits for more than 15 of them."""
    right = digits or 0
    value = np.asarray(G(s)) if right <= DOUBLE_DIGITS else [list(G.digits(complex(each), right)) for each in s]
    return Points(s, value, G.arm.name, G.input, G.input_unit, G.outputs[0], G.units[0], G.x, G.method)


@dataclass(frozen=True)
class ByMethods:
    """The same numbers of an arm by each method, a row for each mode or point of `at`."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    of: Annotated[str, Quantity("quantity", help="natural frequency, or the output of a response", key="output")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the values")]
    at: Annotated[Sequence[Any], Quantity(help="numbers of the modes, or points s in 1/s")]
    values: Annotated[ByMethod, Quantity(help="values by method", flat=True)]

    @property
    def rows(self) -> Annotated[list[MethodRow], Quantity("by method", help="a row a mode or point", key="rows")]:
        """A row for each mode or point."""
        return self.values.rows(self.at)
