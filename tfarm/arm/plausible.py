"""Values that are legal and yet look like a slip of units: texts for a warning, never an error.

Each bound lies outside what any material or mechanism has by a margin; a unit mistaken for another (GPa for Pa,
mm for m, g/cm^3 for kg/m^3, a damping ratio for seconds) moves a value by a factor of 50 or more, well past it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from tfarm.arm.link import Link
from tfarm.arm.records import Arm
from tfarm.errors import shown

SOFTEST, STIFFEST = 1e5, 2e12  # Pa; soft silicone has 3e5, diamond 1.2e12
LIGHTEST, DENSEST = 25.0, 25_000.0  # kg/m^3; light foam has 30, osmium 22,600: in g/cm^3 everything is below 25
LONGEST = 100.0  # m; the arm of the space station has 17
DAMPED = 0.1  # damping ratio of the clamped link; rubber has about 0.05
HEAVIEST = 1e5  # times the link's own mass or inertia
FIRST_CLAMPED = 1.8751040687119611  # first root of 1 + cos(b) cosh(b) = 0, for the clamped Euler-Bernoulli beam


def implausible(arm: Arm) -> tuple[str, ...]:
    """One text for each value that looks like a slip of units: the key as in the TOML file, the value, and why.

    Empty for a plausible arm.
    """
    return tuple(_material(arm.link)) + tuple(_size(arm.link)) + tuple(_damping(arm.link)) + tuple(_inertias(arm))


def _material(link: Link) -> Iterator[str]:
    for name in ("youngs_modulus", "shear_modulus"):
        value = getattr(link, name)
        if value < SOFTEST:
            yield f"link.{name} = {shown(value)}: softer than any rubber; it is taken in Pa, not in GPa"
        elif value > STIFFEST:
            yield f"link.{name} = {shown(value)}: stiffer than diamond; it is taken in Pa"
    if link.density < LIGHTEST:
        yield f"link.density = {shown(link.density)}: lighter than foam; it is taken in kg/m^3, not in g/cm^3"
    elif link.density > DENSEST:
        yield f"link.density = {shown(link.density)}: denser than osmium; it is taken in kg/m^3"


def _size(link: Link) -> Iterator[str]:
    if link.length > LONGEST:
        yield f"link.length = {shown(link.length)}: longer than any arm; it is taken in m, not in mm"
    sides = link.section.dimensions or (("second_moment", math.sqrt(12) * link.section.radius_of_gyration),)
    for name, side in sides:
        if name != "inner_diameter" and side > link.length:
            what = "means a depth of" if name == "second_moment" else "is"
            yield f"link.section.{name} {what} {side:.4g} m, above the length of {link.length:.4g} m: no slender link"


def _damping(link: Link) -> Iterator[str]:
    """The damping ratio C w/2 of the clamped link in its first mode, w = (b/L)^2 sqrt(EI / rhoA)."""
    w = (FIRST_CLAMPED / link.length) ** 2 * math.sqrt(link.EI / link.rhoA)
    ratio = link.damping * w / 2
    if ratio > DAMPED:
        yield (
            f"link.damping = {shown(link.damping)}: a damping ratio of {ratio:.2g} in the first mode "
            "of the clamped link; it is taken in s (E (1 + C s)), it is no ratio"
        )


def _inertias(arm: Arm) -> Iterator[str]:
    link, payload = arm.link, arm.payload
    mass, inertia = link.rhoA * link.length, link.rhoA * link.length**3 / 3
    if HEAVIEST * inertia < arm.hub.inertia < math.inf:
        yield f"hub.inertia = {shown(arm.hub.inertia)}: {arm.hub.inertia / inertia:.1g} times the link's; in kg m^2?"
    if HEAVIEST * mass < payload.mass < math.inf:
        yield f"payload.mass = {shown(payload.mass)}: {payload.mass / mass:.1g} times the link's; in kg?"
    if 0.0 < payload.mass < math.inf and payload.mass * link.length**2 < payload.inertia < math.inf:
        radius = math.sqrt(payload.inertia / payload.mass)
        yield (
            f"payload.inertia = {shown(payload.inertia)}: a radius of gyration of {radius:.3g} m, "
            "above the link's length; in kg m^2?"
        )
