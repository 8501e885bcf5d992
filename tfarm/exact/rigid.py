"""The response of a rig with rigid links and its own hub, joint, clamp, motor, payload and attachments.

It is the limit of stiff links.  A rigid segment of length l is half of its offset, a body of mass rho A l and
inertia rho A l^3/12 + rho I l, and the other half of the offset.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex

from .balls import Sweep
from .layout import Layout, Numbers, Reading, readings
from .outputs import Output
from .system import Body, Offset, Place, Segment, Spring, system_of
from .waves import Plane, Row

ROUNDING = 64 * float(np.finfo(float).eps)  # share of the hub's motion: rounding of that of a fixed link


def rigid_response(arm: Arm, wanted: Output, s: Complex, x: float = 0.0) -> Complex:
    """Return one output in SI units for unit input at s [1/s] (1-D), with rigid links; x is a share of the length.

    It is zero for a strain, and where the constraints of rigid parts are contradictory or redundant: a payload of
    infinite mass and inertia, or either of them with the hub angle as the input.
    """
    if wanted.quantity == "strain":
        return np.zeros(s.size, complex)
    chain = system_of(arm)
    those = readings(chain, (wanted,), x)
    one = those.each[0]
    with np.errstate(all="ignore"):
        sweep = RigidSweep(those.layout, s)
        value = np.broadcast_to(sweep.output(one) / sweep.input, s.shape)
        if one.place is not None and not (one.theta or one.state[2] or one.state[3]):  # W or Psi
            reach = one._replace(place=None, theta=1 + chain.radius + abs(chain.offset))
            value = np.where(abs(value) <= ROUNDING * abs(sweep.output(reach) / sweep.input), 0.0, value)
    return np.where(np.isfinite(value), value, 0.0)


class RigidSweep(Sweep):
    """The sweep over rigid segments at an array of s, in float64.

    W and Psi at a mark are those minus the motion without springs, (r + x) theta and theta, as a deflection at low
    frequency is a small difference of both.
    """

    def output(self, one: Reading) -> Any:
        """Return an output of this response, in SI units."""
        if one.place is not None:  # W = (r + x) theta + its mark's, Psi = theta + its mark's
            reach = self.layout.chain.radius + self._from_clamp(one.place)
            one = one._replace(theta=one.theta + one.state[0] * reach + one.state[1])
        return super().output(one)

    @cached_property
    def states(self) -> dict[int, Row]:
        """W - (r + x) theta, Psi - theta, M and Q at each mark."""
        lift, turn = self._yielded
        places = [float(self._from_clamp(place)) for place in self.layout.places]
        return {n: (lift + places[n] * turn, turn, *state[2:]) for n, state in super().states.items()}

    @cached_property
    def _yielded(self) -> tuple[Any, Any]:
        """W and Psi at the clamp from the deformation of joint and clamp."""
        lift, turn, M = 0.0 * self.s, 0.0 * self.s, self.M
        for each in reversed(self.numbers.elements):
            if isinstance(each, Segment | Body):
                break
            if isinstance(each, Spring):
                stiffness, compliance = self._spring(each)
                turn = turn + compliance / stiffness * M
            elif isinstance(each, Offset):
                lift, M = lift + each.length * turn, M - each.length * self.Q
        return lift, turn

    def _from_clamp(self, place: Place) -> Fraction:
        """Return the distance of a place from the clamp, a share of the length."""
        return place.share + (self.layout.chain.offset if place.side == "payload" else 0)

    def exact(self, number: Any) -> Any:
        """Return the nearest float64."""
        return float(number)

    def numbers_of(self, layout: Layout) -> Numbers:
        """Return the layout's numbers as float64."""
        return layout.numbers("float64", float)

    def _inside(self, element: Any, p: Plane) -> Plane:
        for each in _rigid(element):
            p = super()._inside(each, p)
        return p

    def _beyond(self, element: Any, f: Row) -> Row:
        for each in _rigid(element):
            f = super()._beyond(each, f)
        return f


def _rigid(element: Any) -> tuple[Any, ...]:
    """Return a segment as a rigid body between two halves of its length; any other element itself."""
    if not isinstance(element, Segment):
        return (element,)
    l, EI = element.length, element.stiffness
    none: Any = 0.0
    half = Offset(l / 2)
    return half, Body(EI * element.g / l**3, EI / l * (element.g / 12 + element.a), none, none), half
