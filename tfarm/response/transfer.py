"""The exact transfer function, with the names of python-control.

Its poles and zeros are complete: by a count for real spectra, else by a winding number.  `TransferPoints` are values of
one response at points s, `ByMethods` those by each method.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tfarm.arm import INPUT_UNITS, Arm, Input, must_be_arm
from tfarm.arm.checks import number, on_the_arm, positive, whole
from tfarm.arrays import Complex, Real
from tfarm.digits import DOUBLE_DIGITS
from tfarm.errors import MISSING, require
from tfarm.exact.balls import nearest_float
from tfarm.exact.characteristic import Analytic, characteristic, deflate, off_rest
from tfarm.exact.loads import is_load, load_of, loaded_value
from tfarm.exact.outputs import Output, output
from tfarm.exact.series import constant_of, expansion_at_zero, order_at_zero
from tfarm.exact.system import System, system_of
from tfarm.exact.values import (
    ByMethod,
    Method,
    MethodRow,
    by_method,
    differentiate_outputs,
    digits_of,
    evaluate_outputs,
    free_outputs,
    free_slopes,
    known_method,
    slow_values,
    why_no_appendix,
)
from tfarm.records import frozen
from tfarm.schema import Column, Quantity, Table, roots_table
from tfarm.spectrum import flexible_frequencies
from tfarm.spectrum.box import REAL_SHARE, TOWARD_SINGULAR, Box, Function, complete_zeros
from tfarm.spectrum.damped import damped_starts


@frozen(slots=True)
class Roots:
    """Poles or zeros `values` [1/s], with multiplicity, ascending in |Im s|: all there are in `box`.

    `box` is (re_min, re_max, im_min, im_max); `proof` of completeness is "count", "winding number" or "constant" (an
    end condition fixes the output, which has none but at 0).
    """

    values: Complex
    box: tuple[float, float, float, float]
    proof: str


def zeros_of(arm: Arm, wanted: Output, up_to: float, x: float) -> Roots:
    """Return the zeros of one output with |Im s| <= up_to; x is a share of the length, for outputs along the arm.

    One that an end condition makes constant has those of its power of s, or none if it is 0 throughout.
    """
    share = wanted.share(x)
    k = system_of(arm)
    constant = constant_of(k, wanted, share)
    if constant is not None:
        at_zero = wanted.power if constant else 0
        return replace(_on_axis(np.empty(0), at_zero, up_to), proof="constant")
    base = replace(wanted.base, gauge=False)
    order = order_at_zero(k, base, x)
    at_zero = max(0, order + wanted.power - k.at_rest)
    neighbours = {("theta", "root"): math.inf, ("M", "root"): 0.0 if arm.is_uniform else None}
    neighbour = neighbours.get((wanted.quantity, wanted.place))
    other = arm if neighbour is None else arm.with_numbers(hub_inertia=neighbour)
    if neighbour is not None and arm.is_undamped:
        return _on_axis(flexible_frequencies(other, up_to), at_zero, up_to)

    def size(s: Complex) -> Real:
        here = free_outputs(k, [base], s, x)
        return np.where(here.lost, np.inf, abs(here.outputs[0] / s**order))

    starts = _starts_by_sampling(size, up_to) if neighbour is None else _near_poles(other, up_to)
    return _in_box(k, _numerator(k, base, order, x), at_zero, up_to, starts)


def _on_axis(frequencies: NDArray[np.float64], at_zero: int, up_to: float) -> Roots:
    values = 1j * np.r_[np.zeros(at_zero), np.outer(frequencies, [1, -1]).ravel()]
    return Roots(values, (-math.inf, math.inf, -up_to, up_to), "count")


def _near_poles(arm: Arm, up_to: float) -> Complex:
    """Return estimates of an arm's poles, and real starts."""
    starts = damped_starts(arm, flexible_frequencies(arm, 1.5 * up_to))
    return np.r_[starts, np.linspace(-up_to, -up_to / 50, 40)]


def _starts_by_sampling(size_at: Callable[[Complex], Real], up_to: float) -> Complex:
    """Return dips of the numerator's size along the imaginary and the real axis."""
    line: Any = np.sort(np.r_[np.geomspace(1e-4 * up_to, up_to, 400), np.linspace(0.01 * up_to, up_to, 1600)])
    starts = []
    for direction in (1j, 1.0, -1.0):
        size = size_at(direction * line)
        inner = size[1:-1]
        is_dip = (inner < size[:-2]) & (inner < size[2:])
        starts.append(direction * line[1:-1][is_dip])
    found = np.concatenate(starts)
    return np.r_[found, found.conj(), -found, -found.conj()]


def _numerator(k: System, base: Output, order: int, x: float) -> Function:
    """Return an output over its power of s without its zeros at s = 0, as many as its order."""

    def function(s: Complex) -> Analytic:
        s = off_rest(s)
        here, slopes = free_slopes(k, [base], s, x)
        return deflate(here.outputs[0], slopes.outputs[0], here.scale, s, order)

    return function


def _in_box(k: System, function: Function, at_zero: int, up_to: float, starts: Complex) -> Roots:
    """Return the zeros of a function in a box of that height; the box grows where a zero lies on its edge."""

    def box_of(height: float) -> Box:
        reach = min(TOWARD_SINGULAR / k.damping, height) if k.damping else height
        return Box(-reach, height, -height, height)

    found, box = complete_zeros(function, box_of, up_to, starts)
    # zeros come in +- pairs too
    if k.is_undamped:
        found = np.where(abs(found.real) < REAL_SHARE * abs(found), 1j * found.imag, found)
    order = np.lexsort((-found.imag, found.real.round(9), abs(found.imag).round(9)))
    found = found[order]
    return Roots(np.r_[np.zeros(at_zero, complex), found], (*box,), "winding number")


if TYPE_CHECKING:
    import control


# one output or several
Wanted = str | Output | Sequence[str | Output]


def transfer(
    arm: Arm,
    outputs: Wanted,
    *,
    x: float | None = None,
    method: Method = "closed-form",
    input: str | None = None,
) -> TransferFunction:
    """Return the exact transfer function from the arm's input to one output or several.

    `outputs` are names of `tfarm.exact.outputs.OUTPUTS`, or `Output` records; `x` [m] is the place of those along the
    arm.  `input` replaces that of the arm: one of `tfarm.arm.INPUTS`, or a load on the link with the hub's input at
    zero.  Loads are force@X [N], positive with the displacement, and moment_pair@X1,X2 [N m], that of a piezo patch,
    with X in m from the clamp.  Their values are enclosures in balls, about a millisecond each.
    `method` is that of the values: the closed form in float64, "balls" for ball arithmetic alone, or "appendix" for the
    paper's determinant with mpmath, some milliseconds a point (`tfarm.exact.values`).
    Raises ParameterError for an unknown output or method, and a place that is missing or off the arm.
    """
    return TransferFunction(arm, outputs, x=x, method=method, input=input)


class TransferFunction:
    """G(s), exact, for one output or a list of them (see `transfer`).

    A call with a complex scalar or array of s [1/s] returns values of that shape, with a leading axis for a list of
    outputs.  They have full float64 accuracy.  Raises ParameterError, naming the pole, at a pole.
    """

    def __init__(
        self,
        arm: Arm,
        outputs: Wanted,
        *,
        x: float | None = None,
        method: Method = "closed-form",
        input: str | None = None,
    ) -> None:
        must_be_arm(arm)
        self.load = load_of(input, arm.length) if input is not None and is_load(input) else None
        self._input = input
        if input is not None and self.load is None:
            # checked by the record
            arm = replace(arm, input=cast("Input", input))
        self.method = known_method(method)
        self.arm = arm
        self.is_single = isinstance(outputs, str | Output)
        if isinstance(outputs, Iterable) and not isinstance(outputs, str):
            each = tuple(outputs)
        else:
            each = (outputs,)
        require(each, "outputs", outputs, "name at least one output")
        self.rows: tuple[Output, ...] = tuple(map(output, each))
        self.system: System = system_of(arm)
        along = [each.name for each in self.rows if each.place == "x"]
        remedy = f"give the place of {', '.join(along)}, 0 to {arm.length:g} m"
        require(not along or x is not None, "x", MISSING, remedy)
        require(along or x is None, "x", x, f"{self.outputs[0]} has a fixed place; leave x out")
        meaning = f"a point between 0 and {arm.length:g} m"
        self.x = None if x is None else float(on_the_arm("x", number("x", x, meaning), arm.length))

    @property
    def outputs(self) -> tuple[str, ...]:
        """The name of each output."""
        return tuple(wanted.name for wanted in self.rows)

    @property
    def units(self) -> tuple[str, ...]:
        """The SI unit of each output."""
        return tuple(wanted.unit for wanted in self.rows)

    @property
    def input(self) -> str:
        """The input of the arm, "hub_angle" [rad] where the hub is locked, or the load."""
        own = "hub_angle" if self.arm.is_locked else self.arm.input
        return own if self.load is None else str(self._input)

    @property
    def input_unit(self) -> str:
        """The SI unit of the input."""
        return INPUT_UNITS[self.input] if self.load is None else self.load.unit

    def __repr__(self) -> str:
        place = "" if self.x is None else f" at x = {self.x:g} m"
        return f"<TransferFunction of {self.arm.name}: {self.input} -> {', '.join(self.outputs)}{place}>"

    # ------------------------------------------------------------ values

    def __call__(self, s: ArrayLike) -> Any:
        """Return G(s) at a complex scalar or array."""
        points = _finite(s)
        return self._as_single(self._values(points.ravel()).reshape(len(self.outputs), *points.shape))

    def by_methods(self, s: ArrayLike) -> ByMethod:
        """Return G(s) at an array of s by every method that has it (`tfarm.exact.values`), with their differences."""
        self.must_be_of_the_hub("a comparison of methods")
        wanted = self.rows[0] if self.is_single else self.rows
        points = np.atleast_1d(np.asarray(s))

        return by_method(
            lambda method: np.asarray(transfer(self.arm, wanted, x=self.x, method=method)(points)),
            why_no_appendix(self.arm, self.arm.theory, self.rows),
        )

    def derivative(self, s: ArrayLike) -> Any:
        """Return dG/ds at a complex scalar or array."""
        self.must_be_of_the_hub("a derivative")
        points = _finite(s)
        flat = differentiate_outputs(self.system, self.rows, points.ravel(), self.share)
        return self._as_single(flat.reshape(len(self.outputs), *points.shape))

    def digits(self, s: complex, digits: int) -> Any:
        """Return G(s) as pairs of decimal strings (re, im), each with that many digits certified in ball arithmetic.

        s and the arm's parameters are exact float64 numbers.  Raises CertificationError at a pole.
        """
        digits = whole("digits", digits, 1, 1000, "a whole number of digits from 1 to 1000")
        self.must_be_of_the_hub("digits")
        point = complex(_finite(s))
        pairs = [digits_of(self.system, wanted, point, digits, self.share) for wanted in self.rows]
        return pairs[0] if self.is_single else pairs

    def frequency_response(self, omega: ArrayLike) -> control.FrequencyResponseData:
        """Return G(i omega) as python-control data with named signals; omega in rad/s (1-D, increasing)."""
        import control

        grid = np.atleast_1d(np.asarray(omega, dtype=float))
        data = self._values(1j * grid)[:, None, :]
        return control.FrequencyResponseData(
            data, grid, inputs=[self.input], outputs=list(self.outputs), name=self.arm.name
        )

    def _values(self, s: Complex) -> Complex:
        if self.load is not None:
            balls = (
                loaded_value(self.system, self.load, each, at, self.share)
                for each in self.rows
                for at in s.tolist()
            )
            return np.array(list(map(nearest_float, balls)), complex).reshape(len(self.rows), s.size)
        if self.method != "closed-form":
            return slow_values(self.method, self.arm, self.system, self.rows, s, self.share)
        # 2^13 points s at once: the memory that each output needs stays in the cache
        blocks = np.array_split(s, 1 + (s.size >> 13))
        return np.hstack([evaluate_outputs(self.system, self.rows, each, self.share) for each in blocks])

    def _as_single(self, values: NDArray[Any]) -> Any:
        """Return values (outputs, ...) without the first axis for a single output, a scalar as a Python number."""
        if self.is_single:
            values = values[0]
        return values if np.ndim(values) else values.item()

    # ------------------------------------------------------------ s = 0, poles and zeros

    @cached_property
    def expansion(self) -> NDArray[np.float64]:
        """Coefficients (outputs, 4) of s^-2, s^-1, 1 and s at s = 0."""
        self.must_be_of_the_hub("an expansion at s = 0")
        return np.array([expansion_at_zero(self.system, row, self.share) for row in self.rows])

    @property
    def rigid_body(self) -> Any:
        """The coefficient of 1/s^2 at s = 0, of the rigid body."""
        return self._as_single(self.expansion[:, 0])

    @property
    def static(self) -> Any:
        """The constant term of the expansion at s = 0: the static gain where the output is finite there."""
        return self._as_single(self.expansion[:, 2])

    def poles(self, *, up_to: float) -> Roots:
        """Return the poles with |Im s| <= up_to [rad/s], complete in the box of the record (see `Roots`).

        At C = 0 they are +-i times the natural frequencies, complete by their count, and 0 twice for the rigid-body
        mode.  At C > 0 they are complete by the winding number of the characteristic function.
        """
        k = self.system
        up_to = _known_height(up_to)
        if self.arm.is_undamped:
            return _on_axis(flexible_frequencies(self.arm, up_to), k.at_rest, up_to)
        starts = _near_poles(self.arm, up_to)
        return _in_box(k, lambda s: characteristic(k, s, at_zero=k.at_rest), k.at_rest, up_to, starts)

    def zeros(self, *, up_to: float) -> Roots:
        """Return the zeros of a single output with |Im s| <= up_to [rad/s], complete in the box of the record.

        By a count for hub angle, hub rate and root moment at C = 0, else by the winding number.
        """
        self.must_be_of_the_hub("zeros")
        require(self.is_single, "outputs", self.outputs, "zeros are those of one output; give one")
        return zeros_of(self.arm, self.rows[0], _known_height(up_to), self.share)

    # ------------------------------------------------------------ inside

    def must_be_of_the_hub(self, what: str) -> None:
        """Raise ParameterError where the input is a load on the link."""
        remedy = f"{what} needs an input at the hub; a load has values G(s) only"
        require(self.load is None, "input", self._input, remedy)

    @property
    def share(self) -> float:
        """The place `x` as a share of the length; 0 for outputs with a fixed place."""
        return 0.0 if self.x is None else self.x / self.arm.length


def _known_height(up_to: float) -> float:
    """Return the height of a box.  Raises ParameterError for another value."""
    return positive("up_to", up_to, "a positive, finite frequency in rad/s")


def _finite(s: ArrayLike) -> Complex:
    """Return the points s [1/s] as an array.  Raises ParameterError for NaN and beyond 1e20."""
    points = np.asarray(s, dtype=complex)
    # without an array of a million sizes
    ends = [end(part, initial=0.0) for part in (points.real, points.imag) for end in (np.min, np.max)]
    # far above any arm, and powers of s do not overflow
    largest = 1e20
    # False of NaN too
    if not all(abs(each) <= largest for each in ends):
        # of NaN its first
        worst = complex(points.ravel()[abs(points.ravel()).argmax()])
        require(np.isfinite(worst), "s", worst, "a transfer function needs finite s in 1/s")
        require(False, "s", worst, f"at most {largest:g} 1/s")
    return points


@frozen
class TransferPoints:
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
    ) -> Annotated[
        float, Quantity("largest magnitude", help="largest |G| of these points", unit_of="gain_unit")
    ]:
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
        return np.array(self.value, dtype=float) @ [1, 1j]

    @property
    def csv_table(self) -> Table:
        """A row for each point."""
        first = roots_table(self.s, Quantity("s", "1 / s", 12)).columns
        value = self.value
        parts: Iterable[Any]
        if isinstance(value, list):
            parts = zip(*value, strict=True)
        else:
            parts = value.real, value.imag
        values = (
            Column(f"{part}_{self.output}", f"{part} {self.output}", self.gain_unit, of=of)
            for part, of in zip(("re", "im"), parts, strict=True)
        )
        names = (Column(f"{each.key}_s", each.title, "1/s", of=each.of, shown=each.shown) for each in first)
        return Table(columns=(*names, *values))


def values_at(G: TransferFunction, s: Complex, digits: int | None = None) -> TransferPoints:
    """Return the response at s, with certified digits for more than 15 of them."""
    right = digits or 0
    value: Any
    if right <= DOUBLE_DIGITS:
        value = np.asarray(G(s))
    else:
        value = [list(G.digits(each, right)) for each in s.tolist()]
    return TransferPoints(
        s, value, G.arm.name, G.input, G.input_unit, G.outputs[0], G.units[0], G.x, G.method
    )


@dataclass(frozen=True)
class ByMethods:
    """The same numbers of an arm by each method, a row for each mode or point of `at`."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    of: Annotated[
        str, Quantity("quantity", help="natural frequency, or the output of a response", key="output")
    ]
    unit: Annotated[str, Quantity("unit", help="SI unit of the values")]
    at: Annotated[Sequence[Any], Quantity(help="numbers of the modes, or points s in 1/s")]
    values: Annotated[ByMethod, Quantity(help="values by method", flat=True)]

    @property
    def rows(
        self,
    ) -> Annotated[list[MethodRow], Quantity("by method", help="a row a mode or point", key="rows")]:
        """A row for each mode or point."""
        return self.values.rows(self.at)
