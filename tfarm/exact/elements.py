"""The elements of a rig without dimensions, as exact fractions: what stands in a chain from the payload inwards.

Lengths are in L (clamp to tip), moments in EI/L, forces in EI/L^2 of the segment at the hub, time in seconds.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Literal, NamedTuple

from .outputs import Side


class Segment(NamedTuple):
    """A uniform piece: a, b, g [s^2], sigma, C [s] as in `Coefficients`, length/L, EI/EI of the first, depth/2 [m]."""

    a: Fraction
    b: Fraction
    g: Fraction
    sigma: Fraction
    damping: float
    length: Fraction
    stiffness: Fraction
    half_depth: float | None = None

    def piece(self, share: Fraction) -> Segment:
        """That share of it."""
        return self._replace(
            a=self.a * share**2,
            b=self.b * share**2,
            g=self.g * share**4,
            sigma=self.sigma / share**2,
            length=self.length * share,
        )

    @property
    def units(self) -> tuple[Fraction, Fraction, Fraction]:
        """What W, M and Q in the chain's units are multiplied by to be in the segment's own."""
        return 1 / self.length, self.length / self.stiffness, self.length * self.length / self.stiffness


class Offset(NamedTuple):
    """A rigid massless piece of that length, of L; of either sign."""

    length: Fraction


class Spring(NamedTuple):
    """A rotational spring with a dashpot, k (1 + c s): stiffness = k/(1 + k), compliance = 1/(1 + k), c [s]."""

    stiffness: Fraction
    compliance: Fraction
    damping: float


class Body(NamedTuple):
    """Mass and inertia [s^2], springs to ground in both motions."""

    mass: Fraction
    inertia: Fraction
    stiffness: Fraction
    rotational_stiffness: Fraction


class Mark(NamedTuple):
    """A place that something is read at: its number in the list of places."""

    number: int


class Place(NamedTuple):
    """A point of the link, as a share of its length (0..1), and a side where a body or a joint is at it.

    "payload" is the payload's centre of mass, beyond the tip.
    """

    share: Fraction
    side: Side | Literal["payload"] = "outer"


Element = Segment | Offset | Spring | Body | Mark


class Drive(NamedTuple):
    """What the hub asks of its input: inertia [s^2], friction [s], stiffness, back-EMF [s] and the lag L_a/R [s].

    The input turns the hub against  Z_h = inertia s^2 + friction s + stiffness,  or is its angle (`turns` false).  A
    voltage has back-EMF and lag too:  (1 + lag s)(Z_h theta - M_axis) + back_emf s theta.  `unit` is the SI value of
    one unit of the input, `per_ampere` the torque at the hub of 1 A [N m/A], 0 without a motor.
    """

    turns: bool
    inertia: Fraction
    friction: Fraction
    stiffness: Fraction
    back_emf: Fraction
    lag: Fraction
    unit: Fraction
    per_ampere: Fraction = Fraction(0)

    @property
    def of_angle(self) -> tuple[Fraction, ...]:
        """A_0..A_3."""
        if not self.turns:
            return Fraction(1), Fraction(0), Fraction(0), Fraction(0)
        Z = self.stiffness, self.friction, self.inertia
        return Z[0], Z[1] + self.lag * Z[0] + self.back_emf, Z[2] + self.lag * Z[1], self.lag * Z[2]

    @property
    def of_moment(self) -> tuple[Fraction, Fraction]:
        """B_0 and B_1."""
        return Fraction(self.turns), self.lag * self.turns
