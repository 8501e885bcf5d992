"""The elements of a rig without dimensions, as exact fractions: what stands in a chain from the payload inwards.

Lengths are in L (clamp to tip), moments in EI/L, forces in EI/L^2 of the segment at the hub, time in seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Literal, NamedTuple

from tfarm.arm import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR, Link, Theory
from tfarm.errors import ParameterError

from .outputs import Side

Inertia = Fraction | float  # a fraction, or math.inf


class Segment(NamedTuple):
    """A uniform piece: a, b, g [s^2], sigma, C [s] (see `waves`), length/L, EI/EI of the first, depth/2 [m]."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class EndCondition:
    """An end condition  (rest + inertia s^2) motion + force_weight force = 0, scaled to stay near one.

    A finite dimensionless inertia n gives (0, n, 1)/(1 + n), an infinite one (1, 0, 0): motion = 0.
    """

    rest: Fraction
    inertia: Fraction
    force: Fraction

    @classmethod
    @lru_cache(maxsize=64)  # a proof asks for the same three at every step of its contour
    def of(cls, inertia: Inertia) -> EndCondition:
        """The condition of a body of that dimensionless inertia (0..inf)."""
        if not isinstance(inertia, Fraction):
            return cls(rest=Fraction(1), inertia=Fraction(0), force=Fraction(0))
        return cls(rest=Fraction(0), inertia=inertia / (1 + inertia), force=1 / (1 + inertia))


def double_double(value: Fraction) -> tuple[float, float]:
    """The two floats whose sum is nearest to the fraction."""
    high = float(value)
    return high, float(value - Fraction(high))


def uniform(link: Link, theory: Theory) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """a, b, g [s^2] and sigma of a link under one of `THEORIES`.  Raises ParameterError for another name."""
    if theory not in THEORIES:
        raise ParameterError(key="theory", value=theory, remedy=f"use one of {', '.join(THEORIES)}")
    length, density, E = Fraction(link.length), Fraction(link.density), Fraction(link.youngs_modulus)
    kG = Fraction(link.shear_factor) * Fraction(link.shear_modulus)
    area, EI = Fraction(link.section.area), stiffness_of(link)
    rotary = theory in WITH_ROTARY_INERTIA
    flexible = theory in WITH_SHEAR
    a, b = density * length**2 / E * rotary, density * length**2 / kG * flexible
    return a, b, density * area * length**4 / EI, EI / (kG * area * length**2) * flexible


def stiffness_of(link: Link) -> Fraction:
    """E I [N m^2] of a link, exact."""
    return Fraction(link.youngs_modulus) * Fraction(link.section.second_moment)


def scaled_inertia(value: float, unit: Fraction) -> Inertia:
    """A mass or inertia in that unit; inf stays."""
    return math.inf if math.isinf(value) else Fraction(value) * unit
