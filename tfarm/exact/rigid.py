"""The response of a rig with rigid links and its own hub, joint, clamp, motor, payload and attachments.

It is the limit of stiff links.  A rigid segment of length l is half of its offset, a body of mass rho A l and
inertia rho A l^3/12 + rho I l, and the other half of the offset.  So it is a ratio of polynomials in s, which are
computed exactly: a deflection at low frequency is a small difference of motions.
"""

from fractions import Fraction
from typing import Any

import flint
import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex
from tfarm.exact.balls import Sweep, fraction
from tfarm.exact.layout import Layout, readings
from tfarm.exact.outputs import Output
from tfarm.exact.system import Body, Offset, Segment, system_of
from tfarm.exact.waves import SolutionPlane, SolutionRow


def rigid_response(arm: Arm, wanted: Output, s: Complex, x: float = 0.0) -> Complex:
    """Return one output in SI units for unit input at s [1/s] (1-D), with rigid links; x is a share of the length.

    It is zero for a strain, and where the constraints of rigid parts are contradictory or redundant: a payload of
    infinite mass and inertia, or either of them with the hub angle as the input.
    """
    if wanted.quantity == "strain":
        return np.zeros(s.size, complex)
    layout = readings(system_of(arm), (wanted,), x)
    sweep = RigidSweep(layout)
    one = layout.each[0]
    # polynomials also where they are constant
    none = 0 * sweep.s
    above = sweep.numerator(one) + none
    below = sweep.input + none
    if not below:
        return np.zeros(s.size, complex)
    with np.errstate(all="ignore"):
        value = _at(above, s) / _at(below, s) / (1.0 + float(one.C) * s)
    return np.where(np.isfinite(value), value, 0.0)


def _at(polynomial: Any, s: Complex) -> Complex:
    """Return a polynomial over the rationals at s."""
    coefficients = [float(Fraction(int(each.p), int(each.q))) for each in reversed(polynomial.coeffs())]
    return np.asarray(np.polyval(coefficients, s))


class RigidSweep(Sweep):
    """The sweep over rigid segments, in polynomials in s over the rationals."""

    def __init__(self, layout: Layout) -> None:
        super().__init__(layout, flint.fmpq_poly([0, 1]))

    exact = staticmethod(fraction)

    def _plane_inside(self, element: Any, p: SolutionPlane) -> SolutionPlane:
        for each in _rigid_parts(element):
            p = super()._plane_inside(each, p)
        return p

    def _row_beyond(self, element: Any, f: SolutionRow) -> SolutionRow:
        for each in _rigid_parts(element):
            f = super()._row_beyond(each, f)
        return f


def _rigid_parts(element: Any) -> tuple[Any, ...]:
    """Return a segment as a rigid body between two halves of its length; any other element itself."""
    if not isinstance(element, Segment):
        return (element,)
    l = element.length
    (a, _, g, _) = element.of_chain
    half = Offset(l / 2)
    none = 0 * l
    return half, Body(g * l, (g * l * l / 12 + a) * l, none, none), half
