"""The exact transfer function, with the vocabulary of python-control and none of its approximations.

Its poles and zeros are complete: by a count where the spectrum is real, by a winding number where it is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tfarm.arm import INPUT_UNITS, Arm, Input, must_be_arm
from tfarm.arm.checks import number, on_the_arm, positive, whole
from tfarm.arrays import Complex
from tfarm.errors import MISSING, ParameterError
from tfarm.exact.balls import nearest_float
from tfarm.exact.characteristic import Analytic, characteristic, deflated, off_rest
from tfarm.exact.layout import constant_of
from tfarm.exact.loads import is_load, load_of, loaded_value
from tfarm.exact.outputs import Output, output
from tfarm.exact.series import expansions_at_zero, order_at_zero
from tfarm.exact.system import System, system_of
from tfarm.exact.values import (
    Method,
    Roads,
    by_roads,
    differentiate_outputs,
    digits_of,
    evaluate_outputs,
    free_slopes,
    known_method,
    slow_values,
    why_no_appendix,
)
from tfarm.records import record
from tfarm.spectrum import flexible_frequencies
from tfarm.spectrum.box import REAL_SHARE, TOWARD_SINGULAR, Box, Function, complete


@dataclass(frozen=True, slots=True)
@record
class Roots:
    """Poles or zeros `values` [1/s], with multiplicity, ascending in |Im s|: all there are in `box`.

    `box` is (re_min, re_max, im_min, im_max); `proof` says how completeness is known: "count", "winding number" or
    "constant" (an end condition holds the output: none but at 0).
    """

    values: Complex
    box: tuple[float, float, float, float]
    proof: str


def poles_of(arm: Arm, up_to: float) -> Roots:
    """The poles of every transfer function of the arm with |Im s| <= up_to."""
    k = system_of(arm)
    if arm.is_undamped:
        return _on_axis(flexible_frequencies(arm, up_to), k.at_rest, up_to)
    return _in_box(k, lambda s: characteristic(k, s, at_zero=k.at_rest), k.at_rest, up_to, _damped_starts(arm, up_to))


def zeros_of(arm: Arm, wanted: Output, up_to: float, x: float) -> Roots:
    """The zeros of one output with |Im s| <= up_to; x is a share of the length, for outputs along the arm.

    One that its end condition holds constant has none but those of its power of s (at the tip: 0 throughout has none).
    """
    share = wanted.share(x)
    k = system_of(arm)
    constant = constant_of(k, wanted, share)
    if constant is not None:
        at_zero = wanted.power if constant else 0
        return Roots(np.zeros(at_zero, complex), (-math.inf, math.inf, -up_to, up_to), "constant")
    order, numerator = _numerator(k, wanted, x)
    at_zero = max(0, order + wanted.power - k.at_rest)
    neighbours = {("theta", "root"): math.inf, ("M", "root"): 0.0 if arm.is_uniform else None}
    neighbour = neighbours.get((wanted.quantity, wanted.place))
    other = arm if neighbour is None else arm.having(hub_inertia=neighbour)
    if neighbour is not None and arm.is_undamped:
        return _on_axis(flexible_frequencies(other, up_to), at_zero, up_to)
    starts = _starts_by_sampling(numerator, up_to) if neighbour is None else _damped_starts(other, up_to)
    return _in_box(k, numerator, at_zero, up_to, starts)


def _on_axis(frequencies: NDArray[np.float64], at_zero: int, up_to: float) -> Roots:
    pairs = np.repeat(1j * frequencies, 2)
    pairs[1::2] *= -1
    return Roots(np.r_[np.zeros(at_zero, complex), pairs], (-math.inf, math.inf, -up_to, up_to), "count")


def _damped_starts(arm: Arm, up_to: float) -> Complex:
    """First-order estimates s = -C w^2/2 +- i w sqrt(1 - (C w/2)^2) from the undamped frequencies."""
    omega, C = flexible_frequencies(arm, 1.5 * up_to), arm.damping
    root = np.sqrt((1 - (C * omega / 2) ** 2).astype(complex))
    starts = np.r_[omega * (-C * omega / 2 + 1j * root), omega * (-C * omega / 2 - 1j * root)]
    return np.r_[starts, np.linspace(-up_to, -up_to / 50, 40)]


def _starts_by_sampling(numerator: Function, up_to: float) -> Complex:
    """Dips of the numerator along the imaginary and the real axis."""
    line = np.r_[np.geomspace(1e-4 * up_to, up_to, 400), np.linspace(0.01 * up_to, up_to, 1600)]
    line.sort()
    starts = []
    for direction in (1j, 1.0, -1.0):
        at = numerator(direction * line)
        size = abs(at.value)
        dips = np.nonzero((size[1:-1] < size[:-2]) & (size[1:-1] < size[2:]))[0] + 1
        starts.append(direction * line[dips])
    found = np.concatenate(starts)
    return np.r_[found, found.conj(), -found, -found.conj()]


def _numerator(k: System, wanted: Output, x: float) -> tuple[int, Function]:
    """How often an output over its power of s vanishes at s = 0, and the function without these zeros."""
    base = replace(wanted.base, gauge=False)
    order = order_at_zero(k, base, x)

    def function(s: Complex) -> Analytic:
        s = off_rest(s)
        here, slopes = free_slopes(k, [base], s, x)
        return deflated(here.outputs[0], slopes.outputs[0], here.scale, s, order)

    return order, function


def _in_box(k: System, function: Function, at_zero: int, up_to: float, starts: Complex) -> Roots:
    """Zeros of the quantity in a box of that height; the box grows a little where a zero lies on its edge."""

    def box_of(height: float) -> Box:
        return Box(-min(TOWARD_SINGULAR / k.damping, height) if k.damping else -height, height, -height, height)

    found, box = complete(function, box_of, up_to, starts)
    if k.is_undamped:  # zeros come in +- pairs too
        found = np.where(abs(found.real) < REAL_SHARE * abs(found), 1j * found.imag, found)
    found = found[np.lexsort((-found.imag, found.real.round(9), abs(found.imag).round(9)))]
    return Roots(np.r_[np.zeros(at_zero, complex), found], (*box,), "winding number")


if TYPE_CHECKING:
    import control

POINTS_AT_ONCE = 1 << 16  # points s at once: their values fill a megabyte an output, and few loops are begun
LARGEST_S = 1e20  # 1/s: far beyond any arm, and the powers of s that are taken do not overflow
MOST_ASKED_DIGITS = 1000  # of a value
A_FREQUENCY = "a positive, finite frequency in rad/s"


Wanted = str | Output | Sequence[str | Output]  # one output or several


def transfer(
    arm: Arm, outputs: Wanted, *, x: float | None = None, method: Method = "closed-form", input: str | None = None
) -> TransferFunction:
    """The exact transfer function from the arm's input (hub torque, unless it has another) to one output or several.

    `input` takes the place of the arm's own: one of `tfarm.arm.INPUTS`, or a load on the link while the hub's input is
    held at zero, force@X [N] (positive with the displacement) or moment_pair@X1,X2 [N m] (as a piezo patch between them
    gives), with X in m from the clamp; then every value is an enclosure in balls, about a millisecond each.

    `outputs` are names of `tfarm.exact.outputs.OUTPUTS`, or an `Output` of your own; `x` [m] is the place of those
    along the arm.  `method` is the road to its values: the closed form in float64, "balls" for ball arithmetic alone,
    or "appendix" for the paper's own determinant with mpmath, some milliseconds a point (`tfarm.exact.values`).
    Raises ParameterError for an unknown output or method, or for a place missing or outside the arm.
    """
    return TransferFunction(arm, outputs, x=x, method=method, input=input)


class TransferFunction:
    """G(s), exact, for one output or a list of them (see `transfer`).

    Calling it at a complex scalar or array of s [1/s] gives values of that shape; a list of outputs adds a leading
    axis.  At a pole it raises ParameterError naming the pole; everywhere else it has full float64 accuracy.
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
            arm = replace(arm, input=cast("Input", input))  # the record refuses what is none
        self.method = known_method(method)
        self.arm = arm
        self.is_single = isinstance(outputs, str | Output)
        asked = tuple(outputs) if isinstance(outputs, Iterable) and not isinstance(outputs, str) else (outputs,)
        if not asked:
            raise ParameterError(key="outputs", value=outputs, remedy="name at least one output")
        self.rows: tuple[Output, ...] = tuple(output(each) for each in asked)
        self.system: System = system_of(arm)  # the exact system that it is read from
        self.x = self._place(x)

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
        """The input: the arm's own, "hub_torque" [N m] of the paper's; "hub_angle" [rad] where the hub is locked."""
        if self.load is not None:
            return str(self._input)
        return "hub_angle" if self.arm.is_locked else self.arm.input

    @property
    def input_unit(self) -> str:
        """The SI unit of the input."""
        return INPUT_UNITS[self.input] if self.load is None else self.load.unit

    def __repr__(self) -> str:
        place = "" if self.x is None else f" at x = {self.x:g} m"
        return f"<TransferFunction of {self.arm.name}: {self.input} -> {', '.join(self.outputs)}{place}>"

    # ------------------------------------------------------------ values

    def __call__(self, s: ArrayLike) -> Any:
        """G(s) at a complex scalar or array."""
        points = _finite(s)
        return self._shaped(self._values(points.ravel()).reshape(len(self.outputs), *points.shape))

    def by_methods(self, s: ArrayLike) -> Roads:
        """G(s) at an array of s by every method that has it (`tfarm.exact.values`), and how far these part."""
        self.must_be_of_the_hub("a comparison of methods")
        wanted = self.rows[0] if self.is_single else self.rows
        points = np.atleast_1d(np.asarray(s))

        def value(method: Method) -> Complex:
            return np.asarray(transfer(self.arm, wanted, x=self.x, method=method)(points))

        return by_roads(value, why_no_appendix(self.arm, self.arm.theory, self.rows))

    def derivative(self, s: ArrayLike) -> Any:
        """dG/ds at a complex scalar or array, by the same formulas carried as power series."""
        self.must_be_of_the_hub("a derivative")
        points = _finite(s)
        flat = differentiate_outputs(self.system, self.rows, points.ravel(), self.share)
        return self._shaped(flat.reshape(len(self.outputs), *points.shape))

    def digits(self, s: complex, digits: int) -> Any:
        """G(s) as pairs of decimal strings (re, im), each with that many right digits, proven in ball arithmetic.

        s and the arm's parameters are taken as the float64 numbers they are.  Raises CertificationError at a pole.
        """
        most = MOST_ASKED_DIGITS
        digits = whole("digits", digits, 1, most, f"a whole number of digits from 1 to {most}")
        self.must_be_of_the_hub("digits")
        point = complex(_finite(s))
        pairs = [digits_of(self.system, wanted, point, digits, self.share) for wanted in self.rows]
        return pairs[0] if self.is_single else pairs

    def frequency_response(self, omega: ArrayLike) -> control.FrequencyResponseData:
        """G(i omega) as python-control data with named signals; omega in rad/s (1-D, increasing)."""
        import control

        grid = np.atleast_1d(np.asarray(omega, dtype=float))
        data = self._values(1j * grid)[:, None, :]
        return control.FrequencyResponseData(
            data, grid, inputs=[self.input], outputs=list(self.outputs), name=self.arm.name
        )

    def _values(self, s: Complex) -> Complex:
        if self.load is not None:
            of_load = np.empty((len(self.rows), s.size), complex)
            for row, each in enumerate(self.rows):
                balls = (loaded_value(self.system, self.load, each, complex(at), self.share) for at in s)
                of_load[row] = [nearest_float(ball) for ball in balls]
            return of_load
        if self.method != "closed-form":
            return slow_values(self.method, self.arm, self.system, self.rows, s, self.share)
        if s.size <= POINTS_AT_ONCE:
            return evaluate_outputs(self.system, self.rows, s, self.share)
        values = np.empty((len(self.outputs), s.size), complex)
        for start in range(0, s.size, POINTS_AT_ONCE):
            part = slice(start, start + POINTS_AT_ONCE)
            values[:, part] = evaluate_outputs(self.system, self.rows, s[part], self.share)
        return values

    def _shaped(self, values: Complex) -> Any:
        values = values[0] if self.is_single else values
        return complex(values) if values.ndim == 0 else values

    # ------------------------------------------------------------ s = 0, poles and zeros

    @cached_property
    def expansion(self) -> NDArray[np.float64]:
        """Coefficients (outputs, 4) of s^-2, s^-1, 1 and s at s = 0."""
        self.must_be_of_the_hub("an expansion at s = 0")
        return np.array(expansions_at_zero(self.system, self.rows, self.share))

    @property
    def rigid_body(self) -> Any:
        """The coefficient of 1/s^2 at s = 0: the arm turning as a rigid body."""
        return self._shaped_real(self.expansion[:, 0])

    @property
    def static(self) -> Any:
        """The constant term of the expansion at s = 0: the static gain where the output is finite there."""
        return self._shaped_real(self.expansion[:, 2])

    def _shaped_real(self, values: NDArray[np.float64]) -> Any:
        return float(values[0]) if self.is_single else values

    def poles(self, *, up_to: float) -> Roots:
        """The poles with |Im s| <= up_to [rad/s], complete in the box of the record (see `Roots`).

        At C = 0 they are +-i times the natural frequencies, complete by their count, and 0 twice for the
        rigid-body mode; at C > 0 complete by the winding number of the characteristic function around the box.
        """
        return poles_of(self.arm, positive("up_to", up_to, A_FREQUENCY))

    def zeros(self, *, up_to: float) -> Roots:
        """The zeros of a single output with |Im s| <= up_to [rad/s], complete in the box of the record.

        By a count for hub angle, hub rate and root moment at C = 0, else by the winding number around the box.
        """
        self.must_be_of_the_hub("zeros")
        if not self.is_single:
            raise ParameterError(key="outputs", value=self.outputs, remedy="ask for the zeros of one output at a time")
        return zeros_of(self.arm, self.rows[0], positive("up_to", up_to, A_FREQUENCY), self.share)

    # ------------------------------------------------------------ inside

    def must_be_of_the_hub(self, what: str) -> None:
        """Raise ParameterError where the input is a load on the link."""
        if self.load is not None:
            remedy = f"{what} is known for an input at the hub; ask for values G(s)"
            raise ParameterError(key="input", value=self._input, remedy=remedy)

    @property
    def share(self) -> float:
        """The place `x` as a share of the length; 0 of outputs that have their own."""
        return 0.0 if self.x is None else self.x / self.arm.length

    def _place(self, x: float | None) -> float | None:
        along = [name for name, wanted in zip(self.outputs, self.rows, strict=True) if wanted.place == "x"]
        length = self.arm.length
        if not along:
            if x is not None:
                raise ParameterError(key="x", value=x, remedy=f"{self.outputs[0]} has its own place; leave x out")
            return None
        if x is None:
            raise ParameterError(key="x", value=MISSING, remedy=f"say where {along[0]} is meant, 0 to {length:g} m")
        return float(on_the_arm("x", number("x", x, f"a point between 0 and {length:g} m"), length))


def _finite(s: ArrayLike) -> Complex:
    points = np.asarray(s, dtype=complex)
    if not np.isfinite(points.sum()) and not np.isfinite(points).all():  # the sum needs no array of its own
        bad = points[~np.isfinite(points)].ravel()[0]
        raise ParameterError(key="s", value=complex(bad), remedy="a transfer function wants finite s in 1/s")
    parts = (points.real, points.imag) if points.size else ()
    if any(part.max() > LARGEST_S or part.min() < -LARGEST_S for part in parts):
        bad = points.ravel()[abs(points.ravel()).argmax()]
        raise ParameterError(key="s", value=complex(bad), remedy=f"beyond any arm; at most {LARGEST_S:g} 1/s")
    return points
