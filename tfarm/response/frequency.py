"""The data of a Bode plot: a grid that misses no peak, exact values, exact phase.

The grid.  Around every pole and zero s = -sigma + i w the response changes on the scale sigma.  So each has points of
its own, w and w +- sigma t with t in geometric steps up to the spacing of the even grid.  On the axis (sigma = 0) the
nearest point is at a millionth of w.

The phase.  At C = 0 the response is real, and its phase is counted: 180 degrees down at every pole on the axis and up
at every zero on it, the limit of vanishing damping.  Elsewhere the phase of the refined grid changes by far less than
180 degrees between two points, and is unwrapped.
"""

import math
from contextlib import suppress
from dataclasses import field
from fractions import Fraction
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.errors import CertificationError, ConvergenceError, require
from tfarm.exact.outputs import Output, unit_over
from tfarm.exact.rigid import rigid_response
from tfarm.records import frozen
from tfarm.response.extrema import Extremum, extrema
from tfarm.response.transfer import TransferFunction, transfer
from tfarm.schema import Quantity
from tfarm.spectrum import modes

# of the largest error, even in ln w
BAND_POINTS = 100


def worst_error(arm: Arm, output: str, band: tuple[float, float]) -> float | None:
    """Return the largest error along the imaginary axis over a range [rad/s]; None where G is zero throughout.

    Relative to the condition number with respect to s: |G_64/G - 1| / (1 + |s G'/G|).
    """
    G = transfer(arm, output)
    s = 1j * np.geomspace(*band, BAND_POINTS)
    values = G(s)
    if not values.any():
        return None
    errors = []
    for point, value, slope in zip(*map(np.ndarray.tolist, (s, values, G.derivative(s))), strict=True):
        # a zero of G has no relative error
        with suppress(CertificationError, ConvergenceError):
            # 30 digits of the reference value: twice those of float64
            re, im = map(Fraction, G.digits(point, 30))
            off = complex(re - Fraction(value.real), im - Fraction(value.imag))
            errors.append(abs(off) / (abs(value) + abs(point * slope)))
    return max(errors, default=None)


# rad/s
HERTZ = 2 * math.pi
# |Re s|/|s| below which a root is on the imaginary axis
AXIS_SHARE = 1e-12


class Root(NamedTuple):
    """A pole or zero of a Bode plot, and |G| at i Im s, of a real one at i |s|."""

    kind: Annotated[str, Quantity("kind", help="pole or zero")]
    s: Annotated[complex, Quantity("s", "1/s", 10, "of two conjugates that with Im s > 0", key="s")]
    frequency: Annotated[float, Quantity("frequency", "Hz", 8, "Im s over 2 pi; 0 if real")]
    damping: Annotated[float | None, Quantity("damping ratio", help="-Re s/|s|", key="damping_ratio")]
    magnitude: Annotated[
        float, Quantity("magnitude", help="|G| at i Im s, or i |s| if real", unit_of="gain_unit")
    ]


@frozen(slots=True, kw_only=True)
class Bode:
    """A frequency response with its poles and zeros.  omega in rad/s, `value` in SI units, `phase` in degrees.

    `poles` and `zeros` are those of the output with Im s >= 0 after cancellation, without s = 0.  They are complete up
    to `band`[1] in the ranges `pole_width` and `zero_width` of Re s [1/s]; the grid has none of those on the axis.
    `rigid` is the response of the same rig with rigid links (`rigid_response`).  `row` is the output, `x` [m] its
    place, None where that is fixed.
    """

    arm: Arm
    row: Output = field(repr=False)
    x: Annotated[float | None, Quantity(help="place of the output [m]")] = None
    omega: Annotated[
        Real, Quantity("angular frequency", "rad/s", help="grid refined at poles and zeros", curve=True)
    ]
    value: Annotated[Complex, Quantity("value", help="G(i omega), output over input", curve=True)]
    phase: Annotated[
        Real, Quantity("phase", "deg", help="continuous; -180 deg at a pole on the axis", curve=True)
    ]
    poles: Complex
    zeros: Complex
    rigid: Complex
    # |G| at the frequency of each pole; inf on the axis
    at_poles: Real
    # and of each zero; 0 on the axis
    at_zeros: Real
    # ascending
    peaks: Annotated[tuple[Extremum, ...], Quantity("peaks", help="local maxima of the magnitude")]
    dips: Annotated[tuple[Extremum, ...], Quantity("dips", help="local minima of the magnitude")]
    pole_width: Annotated[
        tuple[float, float],
        Quantity(
            "poles complete in Re s",
            "1/s",
            help="all with Im s up to the last frequency",
            key="poles_between_re_1_s",
        ),
    ]
    zero_width: Annotated[
        tuple[float, float],
        Quantity(
            "zeros complete in Re s",
            "1/s",
            help="all with Im s up to the last frequency",
            key="zeros_between_re_1_s",
        ),
    ]

    @property
    def arm_name(self) -> Annotated[str, Quantity("arm", help="name of the arm", key="arm")]:
        """The name of the arm."""
        return self.arm.name

    @property
    def output(self) -> Annotated[str, Quantity("output", help="output of the transfer function")]:
        """The name of the output."""
        return self.row.name

    @property
    def input(self) -> Annotated[str, Quantity("input", help="input of the transfer function")]:
        """The input."""
        return "hub_angle" if self.arm.is_locked else self.arm.input

    @property
    def magnitude(self) -> Annotated[Real, Quantity("magnitude", help="|G(i omega)|", curve=True)]:
        """|G|."""
        return np.abs(self.value)

    @property
    def pole_list(
        self,
    ) -> Annotated[list[Root], Quantity("poles", help="not cancelled, without 0", key="poles")]:
        """The poles of the upper half-plane."""
        return _listed_roots("pole", self.poles, self.at_poles)

    @property
    def zero_list(
        self,
    ) -> Annotated[list[Root], Quantity("zeros", help="not cancelled, without 0", key="zeros")]:
        """The zeros of the upper half-plane, without rounding of Re s on the axis."""
        zeros = self.zeros
        if self.arm.has_elastic_link:
            # 1e-13 of |s|: rounding of Re s of a zero on the axis, for an elastic link
            zeros = np.where(abs(zeros.real) < 1e-13 * abs(zeros), 1j * zeros.imag, zeros)
        return _listed_roots("zero", zeros, self.at_zeros)

    @property
    def finding(
        self,
    ) -> Annotated[str, Quantity("poles and zeros", help="with Im s >= 0, after cancellation")]:
        """The numbers of poles and zeros in words."""
        return f"{self.poles.size} poles and {self.zeros.size} zeros up to {self.band[1]:.6g} rad/s"

    @property
    def band(
        self,
    ) -> Annotated[
        tuple[float, float],
        Quantity("frequency range", "rad/s", help="first and last frequency", key="range_rad_s"),
    ]:
        """First and last frequency [rad/s]."""
        return float(self.omega[0]), float(self.omega[-1])

    @property
    def infinite(self) -> Real:
        """Frequencies [rad/s] where the response is infinite."""
        return _on_axis(self.poles)

    @property
    def vanishing(self) -> Real:
        """Frequencies [rad/s] where the response is zero."""
        return _on_axis(self.zeros)

    @property
    def resonances(self) -> Complex:
        """The poles that oscillate, ascending."""
        return self.poles[self.poles.imag > 0]

    @property
    def is_zero(self) -> bool:
        """Whether the output is zero throughout, as that of a pinned tip."""
        return not self.value.any()

    @property
    def label(self) -> str:
        """The output in words."""
        if self.x is None:
            return self.row.label
        return self.row.label.replace("at x", f"at x = {self.x:g} m")

    @property
    def gain_unit(
        self,
    ) -> Annotated[str, Quantity("unit", help="SI unit of G, output over input", key="unit")]:
        """SI unit of the response, e.g. N m/(N m)."""
        return unit_over(self.row.unit, self.arm.input_unit)

    @property
    def input_label(self) -> str:
        """The input in words."""
        if self.input == "hub_torque":
            return "torque"
        return self.input.replace("_", " ")


def _listed_roots(kind: str, roots: Complex, magnitudes: Real) -> list[Root]:
    """Return the poles or zeros of a Bode plot with |G| at each."""
    found = []
    for s, magnitude in zip(roots.tolist(), magnitudes.tolist(), strict=True):
        # -0.0 becomes 0.0
        damping = -s.real / abs(s) + 0.0 if s else None
        found.append(Root(kind, s, s.imag / HERTZ, damping, magnitude))
    return found


def resonant_band(arm: Arm, resonances: int = 10) -> tuple[float, float]:
    """Return the range [rad/s] from far below the first flexible mode to midway from the last to the next."""
    omega = modes(arm, resonances + 1).flexible.tolist()
    low = omega[0] / 20
    decade = 10.0 ** math.floor(math.log10(low))
    start = max(step * decade for step in (1, 2, 5) if step * decade <= low * (1 + 1e-12))
    return start, math.sqrt(omega[-2] * omega[-1])


def bode(
    arm: Arm,
    output: str | Output,
    band: tuple[float, float] | None = None,
    *,
    x: float | None = None,
    input: str | None = None,
) -> Bode:
    """Return the exact frequency response of one output over a range `band` [rad/s], refined at every pole and zero.

    `x` [m] is the place of an output along the arm, `input` another input at the hub (see `tfarm.transfer`).  By
    default the range has the first ten flexible modes (`resonant_band`).
    Raises ParameterError for an unknown output, a wrong place, a load on the link, and an illegal range.
    """
    G = transfer(arm, output, x=x, input=input)
    arm = G.arm
    (row,) = G.rows
    band = resonant_band(arm) if band is None else known_band(band, 1e30)
    G.must_be_of_the_hub("a Bode plot, with its zeros,")
    if not np.any(G(1j * np.geomspace(*band, 3))):
        return _no_motion(arm, row, G.x, band)
    # roots just above the range shape its edge
    beyond = 1.3 * band[1]
    all_poles = G.poles(up_to=beyond)
    all_zeros = G.zeros(up_to=beyond)
    poles, zeros = without_cancelled(_upper(all_poles.values), _upper(all_zeros.values))
    # by an end condition: it has no pole of the arm
    if all_zeros.proof == "constant":
        poles = poles[:0]
    omega = refined_grid(band, np.r_[poles, zeros])
    value = G(1j * omega)
    inside_poles = poles[poles.imag < band[1]]
    inside_zeros = zeros[zeros.imag < band[1]]
    infinite, vanishing = map(_on_axis, (inside_poles, inside_zeros))
    roots = np.r_[poles, zeros]
    peaks, dips = extrema(
        G, omega, value, roots, infinite[infinite > band[0]], vanishing[vanishing > band[0]]
    )
    return Bode(
        arm=arm,
        row=row,
        x=G.x,
        omega=omega,
        value=value,
        phase=phase_of(omega, value, inside_poles, inside_zeros, is_real=arm.is_reactive),
        poles=inside_poles,
        zeros=inside_zeros,
        rigid=rigid_response(arm, row, 1j * omega, G.share),
        at_poles=_magnitude_at(G, inside_poles, on_axis=math.inf),
        at_zeros=_magnitude_at(G, inside_zeros, on_axis=0.0),
        peaks=peaks,
        dips=dips,
        pole_width=all_poles.box[:2],
        zero_width=all_zeros.box[:2],
    )


def _upper(roots: Complex) -> Complex:
    """Return the roots with Im s >= 0, without s = 0."""
    return roots[(roots.imag >= 0) & (roots != 0)]


def known_band(band: tuple[float, float], widest: float) -> tuple[float, float]:
    """Return the two ends of a range, with a ratio of at most `widest`.  Raises ParameterError for another value."""
    try:
        low, high = map(float, band)
    except (TypeError, ValueError):
        low = high = math.nan
    decades = f"at most {math.log10(widest):g} decades apart"
    remedy = f"two frequencies in rad/s, the lower first, {decades}: (1.0, 1000.0)"
    require(0 < low < high < math.inf and high / low <= widest, "band", band, remedy)
    return low, high


def _no_motion(arm: Arm, row: Output, x: float | None, band: tuple[float, float]) -> Bode:
    zero = np.zeros(2, complex)
    none = zero[:0]
    everywhere = (-math.inf, math.inf)
    return Bode(
        arm=arm,
        row=row,
        x=x,
        omega=np.array(band),
        value=zero,
        phase=zero.real,
        poles=none,
        zeros=none,
        rigid=zero,
        at_poles=none.real,
        at_zeros=none.real,
        peaks=(),
        dips=(),
        pole_width=everywhere,
        zero_width=everywhere,
    )


def without_cancelled(poles: Complex, zeros: Complex) -> tuple[Complex, Complex]:
    """Return poles and zeros without the pairs that cancel."""
    kept_poles = list(poles)
    kept_zeros = list(zeros)
    for pole in poles:
        # 1e-9: relative distance below which a pole and a zero cancel
        near = [zero for zero in kept_zeros if abs(zero - pole) <= 1e-9 * abs(pole)]
        if near:
            kept_poles.remove(pole)
            kept_zeros.remove(near[0])
    return np.array(kept_poles, complex), np.array(kept_zeros, complex)


def refined_grid(band: tuple[float, float], roots: Complex) -> Real:
    """Return frequencies [rad/s], ascending, even on a log scale and geometric around every root off the real axis."""
    even_per_decade = 120
    # relative distance of the nearest point to a root on the axis
    least_gap = 1e-6
    low, high = band
    even = np.geomspace(low, high, 1 + math.ceil(even_per_decade * math.log10(high / low)))
    near = (_root_grid(root, least_gap, even_per_decade) for root in roots.tolist() if root.imag > 0)
    grid = np.unique(np.r_[even, *near])
    on_axis = _on_axis(roots)
    # none so near to a root that the value is rounding
    if on_axis.size:
        gap = abs(grid[:, None] / on_axis - 1).min(axis=1)
        grid = grid[gap >= 0.5 * least_gap]
    return grid[(grid >= low) & (grid <= high)]


def _root_grid(root: complex, least_gap: float, even_per_decade: int) -> Real:
    """Return w and w +- sigma t of a root, up to two steps of the even grid; on the axis t begins at `least_gap` w."""
    centre = root.imag
    reach = 2 * centre * math.log(10) / even_per_decade
    on_axis = abs(root.real) <= AXIS_SHARE * abs(root)
    nearest = least_gap * centre if on_axis else abs(root.real) / 20
    if nearest >= reach:
        return np.array([centre])
    # 12 points for each decade of distance, on each side of a pole or zero
    count = 2 + math.ceil(12 * math.log10(reach / nearest))
    steps = np.geomspace(nearest, reach, count)
    sides = np.r_[centre - steps, centre + steps]
    return sides if on_axis else np.r_[sides, centre]


def phase_of(omega: Real, value: Complex, poles: Complex, zeros: Complex, *, is_real: bool) -> Real:
    """Return the phase [degrees], continuous where the response is, from near 0 or -180, or 90 or -90 of a rate.

    `is_real`: without losses or lag a response is real, or imaginary for a rate.
    """
    first = value[0]
    start = 0.0 if first.real > 0 else -180.0
    if not is_real:
        phase = np.degrees(np.unwrap(np.angle(value)))
        return phase - 360.0 * np.round((phase[0] - start) / 360.0)
    zeros_below, poles_below = (np.searchsorted(np.sort(_on_axis(roots)), omega) for roots in (zeros, poles))
    if abs(first.imag) > abs(first.real):
        start = 90.0 if first.imag > 0 else -90.0
    return start + 180.0 * np.subtract(zeros_below, poles_below)


def _is_on_axis(roots: Complex) -> NDArray[np.bool_]:
    """Return which roots are on the positive imaginary axis."""
    return (abs(roots.real) <= AXIS_SHARE * abs(roots)) & (roots.imag > 0)


def _on_axis(roots: Complex) -> Real:
    """Return the frequencies [rad/s] of the roots on the positive imaginary axis."""
    return np.asarray(roots.imag[_is_on_axis(roots)], float)


def _magnitude_at(G: TransferFunction, roots: Complex, *, on_axis: float) -> Real:
    """Return |G(i Im s)| at each root, `on_axis` for those on the axis."""
    result = np.full(roots.size, on_axis)
    off = ~_is_on_axis(roots)
    at = np.where(roots.imag > 0, roots.imag, abs(roots))
    result[off] = abs(G(1j * at[off]))
    return result
