"""The arm's numbers without dimensions, once, for every way of evaluating the exact solution.

Lengths in L, moments in EI/L, forces in EI/L^2, time in seconds.  The four beam theories are four choices of
two numbers: rotary inertia a (0 without it) and shear flexibility b, sigma (0 without it).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR, Arm, Link, Theory
from tfarm.errors import ParameterError
from tfarm.records import record

Inertia = Fraction | float  # a fraction, or math.inf
SYSTEMS_KEPT = 64  # arms whose exact numbers are kept: one page asks for those of one arm some thousand times


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


@dataclass(frozen=True, kw_only=True)
@record
class Coefficients:
    """Dimensionless coefficients of an arm, exact as fractions of its float64 parameters.

    a = rho L^2/E, b = rho L^2/(kappa G) and g = rho A L^4/(E I) in s^2, sigma = EI/(kappa G A L^2),
    damping C in s; mass m L^3/EI, tip and hub inertia I L/EI in s^2 (inf where the arm says so).
    """

    a: Fraction
    b: Fraction
    g: Fraction
    sigma: Fraction
    damping: float
    tip_mass: Inertia
    tip_inertia: Inertia
    hub_inertia: Inertia
    length: Fraction
    EI: Fraction

    @property
    def is_locked(self) -> bool:
        """Whether the hub cannot turn, so that its angle is the input."""
        return not isinstance(self.hub_inertia, Fraction)

    @property
    def has_rigid_mode(self) -> bool:
        """Whether the arm can turn as a rigid body: every inertia is finite."""
        return all(isinstance(end, Fraction) for end in (self.tip_mass, self.tip_inertia, self.hub_inertia))

    @property
    def transit(self) -> float:
        """(rho A L^4/(E I))^(1/4) [s^(1/2)]: times the root of w, the phase of a slow bending wave along the arm."""
        return float(self.g) ** 0.25

    @property
    def at_rest(self) -> int:
        """How often the drive vanishes at s = 0: twice where the arm turns freely."""
        return 2 * self.has_rigid_mode

    @property
    def singular(self) -> tuple[float, ...]:
        """-1/C [1/s], where eigenvalues accumulate; empty without damping."""
        return (-1.0 / self.damping,) if self.damping else ()

    @property
    def is_undamped(self) -> bool:
        """Whether nothing dissipates."""
        return self.damping == 0

    @property
    def is_real_on_axis(self) -> bool:
        """Whether drive and outputs are real at s = i w, but for odd powers of s."""
        return self.is_undamped

    @property
    def input_unit(self) -> Fraction:
        """The SI value of one unit of the input: E I/L of torque, 1 rad of the angle of a locked hub."""
        return Fraction(1) if self.is_locked else self.EI / self.length

    def with_damping(self, share: float) -> Coefficients:
        """The same with so much of its C."""
        return replace(self, damping=self.damping * share)

    @cached_property
    def kept(self) -> dict[Any, Any]:
        """What is worked out of it once (`characteristic.unit_gains`), with it and gone with it."""
        return {}

    @cached_property
    def kernel(self) -> NDArray[np.float64]:
        """The vector that the compiled functions of `waves` read (see `vector`)."""
        split = [part for value in (self.a, self.b, self.g) for part in double_double(value)]
        ends = [EndCondition.of(inertia) for inertia in (self.tip_mass, self.tip_inertia, self.hub_inertia)]
        numbers = [float(number) for end in ends for number in (end.rest, end.inertia, end.force)]
        gain = 1.0 if self.is_locked else float(ends[2].force)
        return np.array([*split, float(self.sigma), self.damping, *numbers, gain])


def double_double(value: Fraction) -> tuple[float, float]:
    """The two floats whose sum is nearest to the fraction."""
    high = float(value)
    return high, float(value - Fraction(high))


@lru_cache(maxsize=SYSTEMS_KEPT)
def coefficients(arm: Arm, theory: Theory = "timoshenko") -> Coefficients:
    """The coefficients of the arm under one of `THEORIES`.

    "shear" leaves out rotary inertia, "rayleigh" shear flexibility, "euler-bernoulli" both (Han, Benaroya
    and Wei 1999).  Raises ParameterError for another name.
    """
    link = arm.link
    length, EI = Fraction(link.length), stiffness_of(link)
    a, b, g, sigma = uniform(link, theory)
    return Coefficients(
        a=a,
        b=b,
        g=g,
        sigma=sigma,
        damping=link.damping,
        tip_mass=scaled_inertia(arm.payload.mass, length**3 / EI),
        tip_inertia=scaled_inertia(arm.payload.inertia, length / EI),
        hub_inertia=scaled_inertia(math.inf if arm.is_locked else arm.hub.inertia, length / EI),
        length=length,
        EI=EI,
    )


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
