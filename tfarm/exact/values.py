"""Outputs at any s: the compiled sweeps where they have all digits, ball arithmetic at the few other points.

There are three methods for one number:

closed-form   the formulas in float64, with ball arithmetic where they lose digits (the default)
balls         ball arithmetic alone (python-flint): a certified enclosure, and the float64 nearest to it
appendix      the paper's 4x4 determinant and Cramer's rule with mpmath, at a precision that is doubled until two
              results agree, without a formula of the other two
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from itertools import count, takewhile
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, cast, get_args

import flint
import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Theory
from tfarm.arrays import Complex, Real
from tfarm.errors import CertificationError, ParameterError, must_be_known, require
from tfarm.exact.balls import Ball, Sweep, first_success, nearest_float, point, rational
from tfarm.exact.layout import Field, Layout, OutputFormula, readings
from tfarm.exact.outputs import Output
from tfarm.exact.series import constant_of, expansion_at_zero
from tfarm.exact.sweep import AXIS, fill_free
from tfarm.exact.system import ONE, ZERO, Place, System
from tfarm.records import frozen, read_only
from tfarm.schema import Quantity

_Value = TypeVar("_Value")

# more than a float64 has
PROVEN_BITS = 60


# ------------------------------------------------------------ the free response


class Free(NamedTuple):
    """Drive (n,) and outputs (rows, n) of the free response times e^{-scale}, and where digits are lost."""

    drive: Complex
    outputs: Complex
    scale: Complex
    lost: NDArray[np.bool_]


def free_outputs(chain: System, wanted: Sequence[Output], s: Complex, x: float) -> Free:
    """Return the free response at s (1-D), with outputs in SI for one unit of the drive."""
    return free_of(readings(chain, wanted, x), s)


def free_of(layout: Layout, s: Complex) -> Free:
    """Return the free response of a layout."""
    found, lost = _sweep_layout(layout, s)
    return Free(found[0], found[2:], found[1], lost)


def _sweep_layout(
    layout: Layout, s: Complex, axis: Real = AXIS, *, per_input: bool = False
) -> tuple[Complex, NDArray[np.bool_]]:
    """Return drive, scale and outputs (rows), for a unit input if `per_input`, and where digits are lost."""
    found = np.empty((2 + len(layout.each), s.size), complex)
    lost = np.empty(s.size, bool)
    s = np.ascontiguousarray(s, dtype=complex)
    fill_free(s, layout.rows, layout.ends, axis, layout.table, found, lost, per_input)
    return found, lost


@cache
def unit_circle() -> Complex:
    """Return 16 points of the unit circle (16,), from 1 on and in conjugate pairs."""
    upper = np.exp(1j * np.pi * np.arange(1, 8) / 8)
    return np.asarray(read_only(np.r_[1.0, upper, -1.0, upper[::-1].conj()]))


def free_slopes(chain: System, wanted: Sequence[Output], s: Complex, x: float) -> tuple[Free, Free]:
    """Return the free response and its derivative at s (1-D), by Cauchy's integral on a circle, to rounding."""
    # of that circle, of |s| over the phase of all waves: the 16th Taylor term is below 1e-17
    slope_radius = 0.3
    # of the way to a -1/C: its radius at most
    clear_of_singular = 0.1
    circle = unit_circle()
    layout = readings(chain, wanted, x)
    here = free_of(layout, s)
    radius = slope_radius * np.maximum(abs(s), 1e-150) / np.maximum(1.0, abs(here.scale))
    for each in chain.singular:
        radius = np.minimum(radius, clear_of_singular * abs(s - each))
    around = free_of(layout, (s[:, None] + radius[:, None] * circle).ravel())
    scales = around.scale.reshape(-1, circle.size)
    here = here._replace(scale=np.where(np.isfinite(here.scale), here.scale, scales[:, 0]))
    values = np.exp(scales - here.scale[:, None])
    slope = 1.0 / circle / radius[:, None]
    drive = around.drive.reshape(scales.shape) * values
    outputs = around.outputs.reshape(-1, *scales.shape) * values
    # there the values are means over the circle, as where two waves are one
    if here.lost.any():
        here = here._replace(
            drive=np.where(here.lost, _mean(drive), here.drive),
            outputs=np.where(here.lost, _mean(outputs), here.outputs),
        )
    return here, Free(_mean(drive * slope), _mean(outputs * slope), here.scale, here.lost)


def _mean(values: Complex) -> Complex:
    """Return the mean over the circle (last axis), with exactly conjugate means at conjugate points."""
    count = values.shape[-1]
    half = count // 2
    pairs = values[..., 1:half] + values[..., :half:-1]
    return np.asarray((values[..., 0] + values[..., half] + pairs.sum(axis=-1)) / count)


def free_fields(
    chain: System, s: Complex, places: Sequence[Place], axis: Real = AXIS
) -> tuple[NDArray[Any], NDArray[Any], Complex]:
    """Return W, Psi, M, Q (4, s, places) and hub angle (s,) times e^{-scale}, and scale: dimensionless.

    The states satisfy axis . (W, Psi, M, Q) = 0 on the hub's axis, by default W = 0.
    """

    def make_layout() -> Layout:
        each: list[OutputFormula] = []
        for place in places:
            each += [OutputFormula(place, field, ZERO, 0, ONE) for field in Field]
        each.append(OutputFormula(None, -1, ONE, 0, ONE))
        return Layout(chain, tuple(dict.fromkeys(places)), tuple(each))

    layout = chain.keep(tuple(places), make_layout)
    found, _ = _sweep_layout(layout, s, np.asarray(read_only(np.ascontiguousarray(axis))))
    return found[2:-1].reshape(len(places), 4, s.size).transpose(1, 2, 0), found[-1], found[1]


# ------------------------------------------------------------ outputs for a unit input


def evaluate_outputs(k: System, wanted: Sequence[Output], s: Complex, x: float = 0.0) -> Complex:
    """Return outputs (rows) for a unit input at s (1-D), SI; x is a share of the length, for outputs along the arm.

    Raises ParameterError at a pole, naming it.
    """
    with np.errstate(all="ignore"):
        # of a chain by NumPy's division, which leaves no imaginary part where there is none but for rounding
        is_link = len(k.elements) == 1
        found, lost = _sweep_layout(readings(k, wanted, x), s, per_input=is_link)
        values = found[2:]
        if not is_link:
            values = values / found[0]
    return _with_care(k, wanted, s, x, values, lost)


def differentiate_outputs(k: System, wanted: Sequence[Output], s: Complex, x: float = 0.0) -> Complex:
    """Return the derivatives N'/D - N D'/D^2 of the outputs (rows) in s, by balls where digits are lost."""
    with np.errstate(all="ignore"):
        free, slopes = free_slopes(k, wanted, s, x)
        values: Complex = (slopes.outputs - free.outputs * slopes.drive / free.drive) / free.drive
    return _with_care(k, wanted, s, x, values, free.lost | (s == 0), of_slope=True)


def _with_care(
    k: System,
    wanted: Sequence[Output],
    s: Complex,
    x: float,
    values: Complex,
    lost: NDArray[np.bool_],
    of_slope: bool = False,
) -> Complex:
    """Return values, those with lost digits by `value_with_care`."""
    for i in np.flatnonzero(lost | ~np.isfinite(values).all(axis=0)):
        values[:, i] = [value_with_care(k, each, complex(s[i]), x, of_slope=of_slope) for each in wanted]
    return values


def value_with_care(
    k: System, wanted: Output, s: complex, x: float = 0.0, *, of_slope: bool = False
) -> complex:
    """Return one output, or its slope, at one s from a certified enclosure, or from the expansion at s = 0.

    Raises ParameterError at a pole, and for a value larger than any float64.
    """
    _refuse_pole(k, wanted, s, x)
    if s == 0:
        return complex(expansion_at_zero(k, wanted, x)[2 + of_slope])
    if of_slope:
        ball = slope(k, wanted, s, x)
    else:
        ball = enclose(k, wanted, s, bits=PROVEN_BITS, x=x)
    value = nearest_float(ball)
    require(np.isfinite(value), "s", s, f"{wanted.name} is larger than any float64 there; choose another s")
    return value


def _refuse_pole(k: System, wanted: Output, s: complex, x: float) -> None:
    """Raise ParameterError if s is a pole to the last digit of a float64."""
    # of |s|: the distance of a pole within which no digit is right
    at_a_pole = 4 * float(np.finfo(float).eps)
    if constant_of(k, wanted, x) is not None:
        return
    if s == 0:
        is_finite = not any(expansion_at_zero(k, wanted, x)[:2])
        require(is_finite, "s", 0, "a pole: the arm turns as a rigid body there; choose s != 0")
        return
    with np.errstate(all="ignore"):
        here, slopes = free_slopes(k, (), np.array([s]), 0.0)
    # both 0 where s^2 underflows: no pole there
    if abs(here.drive[0]) < at_a_pole * abs(s) * abs(slopes.drive[0]):
        name = f"an eigenvalue, {s:.10g} 1/s"
        if s.real == 0:
            name = f"a natural frequency, {abs(s):.10g} rad/s"
        remedy = f"a pole: {name}; the response is infinite there, move s"
        raise ParameterError(key="s", value=s, remedy=remedy)


# ------------------------------------------------------------ enclosures, at a growing precision


def output_ball(k: System, wanted: Output, s: Ball, x: float) -> Ball | None:
    """Return an output for a unit input at s, in SI units; None where the input of the free response may be zero."""
    layout = readings(k, (wanted,), x)
    constant = constant_of(k, wanted, x)
    (one,) = layout.each
    if constant is not None:
        return s**one.power * constant * rational(one.unit) / (1 + rational(one.C) * s)
    sweep = Sweep(layout, s)
    if sweep.input.contains(0):
        return None
    return sweep.output(one) / sweep.input


def accurate_ball(value: Ball | None, bits: int) -> Ball | None:
    """Return a ball with that many right bits, or of 0 alone; None for any other."""
    if value is not None and (value.rel_accuracy_bits() >= bits or value.is_zero()):
        return value
    return None


def enclose(k: System, wanted: Output, s: complex, *, bits: int, x: float = 0.0) -> Ball:
    """Return a ball around the output at s with a relative radius below 2^-bits.

    Raises CertificationError where that needs more than 2^18 bits: at a pole or an exact zero.
    """
    return certify_by_precision(
        bits, lambda: accurate_ball(output_ball(k, wanted, point(s), x), bits), f"{bits} bits", s
    )


def slope(k: System, wanted: Output, s: complex, x: float = 0.0) -> Ball:
    """Return dG/ds at s, by a difference with `PROVEN_BITS` of the larger of G/s and dG/ds."""
    step = rational(Fraction(1, 1 << (2 * PROVEN_BITS)))

    def attempt() -> Ball | None:
        here = point(s)
        value = output_ball(k, wanted, here, x)
        beyond = output_ball(k, wanted, here * (1 + step), x)
        if value is None or beyond is None:
            return None
        difference = (beyond - value) / (step * here)
        larger = difference + value / here
        if larger.rel_accuracy_bits() >= PROVEN_BITS or value.is_zero():
            return difference
        return None

    return certify_by_precision(4 * PROVEN_BITS, attempt, "derivative", s)


def digits_of(k: System, wanted: Output, s: complex, digits: int, x: float = 0.0) -> tuple[str, str]:
    """Return real and imaginary part to `digits` significant right digits each, "0.0" where it is identically zero.

    By symmetry G is real for real s, and without dissipation a function of s^2: then one part is exactly zero.
    Raises ParameterError at a pole, CertificationError next to one and at an exact zero.
    """
    _refuse_pole(k, wanted, s, x)
    is_imaginary = False
    is_real = s.imag == 0
    if s.real == 0 != s.imag and k.is_real_on_axis:
        is_imaginary = wanted.power % 2 == 1
        is_real = not is_imaginary
    bits = math.ceil(3.33 * digits) + 8
    zero = flint.arb(0)

    def attempt() -> tuple[str, str] | None:
        value = output_ball(k, wanted, point(s), x)
        if value is None:
            return None
        re = zero if is_imaginary else value.real
        im = zero if is_real else value.imag
        if accurate_ball(re, bits) is None or accurate_ball(im, bits) is None:
            return None
        return text_of(re), text_of(im)

    def text_of(part: Ball) -> str:
        if part.is_zero():
            return "0.0"
        return str(part.mid().str(digits, radius=False))

    return certify_by_precision(4 * digits, attempt, f"{digits} digits", s)


def certify_by_precision(bits: int, attempt: Callable[[], _Value | None], number: str, s: complex) -> _Value:
    """Return the first result other than None at working precisions for that many right bits, each twice the last.

    Raises CertificationError, naming the number and s, where none has one.
    """
    # at a pole no number of them is enough
    most_bits = 1 << 18
    precisions = takewhile(lambda working: working < most_bits, ((2 * bits + 64) << n for n in count()))
    failure = CertificationError(f"no {number} at s = {s:g} 1/s: it is a pole or a zero, or too close to one")
    return first_success(precisions, attempt, failure)


Method = Literal["closed-form", "balls", "appendix"]
METHODS: tuple[Method, ...] = get_args(Method)

# of the appendix: more than a float64 holds
APPENDIX_DIGITS = 17


class MethodRow(NamedTuple):
    """One number by several methods."""

    at: Annotated[Any, Quantity("mode or s", digits=10, help="number of the mode, or the point s in 1/s")]
    value: Annotated[Any, Quantity("closed form", digits=15, help="value of the float64 solution")]
    balls: Annotated[
        float | None,
        Quantity("difference of balls", digits=2, help="relative, of ball arithmetic from the closed form"),
    ]
    appendix: Annotated[
        float | None,
        Quantity(
            "difference of the appendix", digits=2, help="relative, of the paper's determinant in mpmath"
        ),
    ]


@frozen
class ByMethod:
    """The same numbers by each method that has them (`values`), and the reason for a missing one (`left_out`)."""

    values: Annotated[dict[Method, NDArray[Any]], Quantity(key="methods", help="values of each method")]
    left_out: Annotated[dict[Method, str], Quantity("left out", help="methods that do not apply, and why")]

    @property
    def differences(
        self,
    ) -> Annotated[
        dict[Method, Real], Quantity(help="relative difference of each method from the closed form")
    ]:
        """The relative difference of each from the closed form; the absolute one where that is 0."""
        fast = self.values["closed-form"]
        size = np.where(fast == 0, 1.0, abs(fast))
        return {
            name: np.asarray(abs(each - fast) / size)
            for name, each in self.values.items()
            if each is not fast
        }

    @property
    def largest_difference(
        self,
    ) -> Annotated[float, Quantity("maximum relative difference", digits=2, help="largest of all methods")]:
        """The largest of the differences."""
        return max(float(each.max(initial=0.0)) for each in self.differences.values())

    @property
    def finding(
        self,
    ) -> Annotated[
        str, Quantity("methods", help="methods compared, and whether they differ by rounding alone")
    ]:
        """The agreement of the methods in words."""
        # relative: some tens of roundings of a float64
        methods_agree = 1e-14
        if self.largest_difference <= methods_agree:
            word = "agree to rounding"
        else:
            word = "differ by more than rounding"
        return f"{', '.join(self.values)}: {word}"

    def rows(self, at: Sequence[Any]) -> list[MethodRow]:
        """Return a row for each place: the value of the closed form, and the differences of the others."""
        values = self.values["closed-form"].tolist()
        apart = {k: v.tolist() for k, v in self.differences.items()}
        none = [None] * len(values)
        return list(map(MethodRow, at, values, apart.get("balls", none), apart.get("appendix", none)))


def by_method(value: Callable[[Method], NDArray[Any]], no_appendix: str) -> ByMethod:
    """Return the values of each method, without the appendix where `no_appendix` is a reason."""
    left_out: dict[Method, str] = {}
    if no_appendix:
        left_out["appendix"] = no_appendix
    values = {method: np.asarray(value(method)) for method in METHODS if method not in left_out}
    return ByMethod(values, left_out)


def known_method(method: str) -> Method:
    """Return the method of that name.  Raises ParameterError for any other."""
    must_be_known("method", method, METHODS)
    return cast("Method", method)


def why_no_appendix(arm: Arm, theory: Theory, wanted: Sequence[Output] = ()) -> str:
    """Return the reason why the paper's appendix has no value of these outputs, or no frequencies, or ""."""
    if theory != "timoshenko" or not arm.is_uniform:
        return "the paper's appendix is of one Timoshenko beam on a hub"
    others = [each.name for each in wanted if not each.is_in_appendix]
    if others:
        return f"the paper's appendix has no {others[0]}, an output of rigs"
    return ""


def must_be_of_appendix(arm: Arm, theory: Theory, wanted: Sequence[Output] = ()) -> None:
    """Raise ParameterError where the appendix has no value."""
    words = why_no_appendix(arm, theory, wanted)
    require(not words, "method", "appendix", words)


def slow_values(
    method: Method, arm: Arm, k: System, wanted: Sequence[Output], s: Complex, x: float
) -> Complex:
    """Return outputs (rows) at s (1-D) one by one, by the balls or by the appendix; x is a share of the length.

    Raises ParameterError at a pole to the last digit of float64, ConvergenceError where the appendix has no limit.
    """
    points = s.tolist()
    if method == "balls":
        return np.array([[value_with_care(k, each, at, each.share(x)) for at in points] for each in wanted])
    # here: mpmath takes a while to load
    from tfarm.exact.appendix import output_value

    must_be_of_appendix(arm, arm.theory, wanted)
    place = x * arm.link.length

    def values_of(each: Output) -> list[complex]:
        return [complex(output_value(arm, each, at, APPENDIX_DIGITS, place)) for at in points]

    return np.array([values_of(each) for each in wanted])
