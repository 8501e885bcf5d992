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

SOFTEST = 1e5  # Pa; soft silicone has 3e5
STIFFEST = 2e12  # Pa; diamond has 1.2e12
LIGHTEST = 25.0  # kg/m^3; light foam has 30, and in g/cm^3 everything is below 25
DENSEST = 25_000.0  # kg/m^3; osmium has 22,600
LONGEST_ARM = 100.0  # m; the arm of the space station has 17
MOST_DAMPED = 0.1  # damping ratio of the clamped link; rubber has about 0.05
MODULUS = (SOFTEST, "softer than any rubber; it is taken in Pa, not in GPa",
           STIFFEST, "stiffer than diamond; it is taken in Pa")  # fmt: skip
USUAL = {  # of a segment: between what, and what is said below and above that
    "youngs_modulus": MODULUS,
    "shear_modulus": MODULUS,
    "density": (LIGHTEST, "lighter than foam; it is taken in kg/m^3, not in g/cm^3",
                DENSEST, "denser than osmium; it is taken in kg/m^3"),
    "length": (0.0, "", LONGEST_ARM, "longer than any arm; it is taken in m, not in mm"),
}  # fmt: skip
HEAVIEST = 1e5  # times the link's own mass or inertia
FARTHEST_OFFSET = 10.0  # times the link's length; a hub's radius and a payload's offset are a fraction of it
YIELDING = 10.0  # times the link's own flexibility L/(3 EI); a clamp that is meant to hold has a tenth of it
RUBBING = 50.0  # times 2 sqrt(3 EI/L J), beyond which the link cannot turn the hub; a harmonic drive reaches 1
FIRST_CLAMPED = 1.8751040687119611  # first root of 1 + cos(b) cosh(b) = 0, for the clamped Euler-Bernoulli beam


def implausible(arm: Arm) -> tuple[str, ...]:
    """One text for each value that looks like a slip of units: the key as in the TOML file, the value, and why.

    Empty for a plausible arm.
    """
    keys = [f"link.{i}" for i in range(1, len(arm.links) + 1)] if arm.outer else ["link"]
    segments = [text for key, link in zip(keys, arm.links, strict=True) for text in _segment(key, link, arm.length)]
    return (*segments, *_inertias(arm), *_rig(arm))


def _segment(key: str, link: Link, length: float) -> Iterator[str]:
    """What looks odd in a segment of an arm of that length [m]; its texts begin with its key in the file.

    Material, size, and the damping ratio C w/2 of the clamped arm in its first mode, w = (b/L)^2 sqrt(EI / rhoA).
    """
    for name, (least, below, most, above) in USUAL.items():
        value = getattr(link, name)
        if not least <= value <= most:
            yield f"{key}.{name} = {shown(value)}: {below if value < least else above}"
    sides = link.section.dimensions or (("second_moment", math.sqrt(12) * link.section.radius_of_gyration),)
    for name, side in sides:
        if name != "inner_diameter" and side > length:
            what = "means a depth of" if name == "second_moment" else "is"
            yield f"{key}.section.{name} {what} {side:.4g} m, above the length of {length:.4g} m: no slender link"
    ratio = link.damping * (FIRST_CLAMPED / length) ** 2 * math.sqrt(link.EI / link.rhoA) / 2
    if ratio > MOST_DAMPED:
        yield (
            f"{key}.damping = {shown(link.damping)}: a damping ratio of {ratio:.2g} in the first mode "
            "of the clamped link; it is taken in s (E (1 + C s)), it is no ratio"
        )


def _inertias(arm: Arm) -> Iterator[str]:
    payload, mass, inertia = arm.payload, arm.own_mass, _beam_inertia(arm)
    if HEAVIEST * inertia < arm.hub.inertia < math.inf:
        yield f"hub.inertia = {shown(arm.hub.inertia)}: {arm.hub.inertia / inertia:.1g} times the link's; in kg m^2?"
    if HEAVIEST * mass < payload.mass < math.inf:
        yield f"payload.mass = {shown(payload.mass)}: {payload.mass / mass:.1g} times the link's; in kg?"
    if 0.0 < payload.mass < math.inf and payload.mass * arm.length**2 < payload.inertia < math.inf:
        radius = math.sqrt(payload.inertia / payload.mass)
        yield (
            f"payload.inertia = {shown(payload.inertia)}: a radius of gyration of {radius:.3g} m, "
            "above the link's length; in kg m^2?"
        )


def _beam_inertia(arm: Arm) -> float:
    """Inertia [kg m^2] of the arm's own mass, taken as spread evenly from the axis."""
    return arm.own_mass * arm.length**2 / 3


def _rig(arm: Arm) -> Iterator[str]:
    """The parts that the paper's arm has not: bounds on what a slip of units by 50 or more does to them."""
    hub, bending = arm.hub, 3 * arm.bending_scale
    for key, value in (("hub.radius", hub.radius), ("payload.offset", abs(arm.payload.offset))):
        if value > FARTHEST_OFFSET * arm.length:
            times = value / arm.length
            yield f"{key} = {shown(value)}: {times:.3g} times the link's length; it is taken in m, not in mm"
    if arm.clamp.stiffness < bending / YIELDING:
        yield (
            f"clamp.stiffness = {shown(arm.clamp.stiffness)}: a clamp that yields {bending / arm.clamp.stiffness:.2g} "
            "times as much as its link bends; it is taken in N m/rad"
        )
    critical = 2 * math.sqrt(bending * arm.total_inertia)
    if hub.friction > RUBBING * critical:
        yield (
            f"hub.friction = {shown(hub.friction)}: {hub.friction / critical:.2g} times what keeps the link's first "
            "swing from ringing; it is taken in N m s/rad, at the hub's side of a gear"
        )
    if arm.motor and arm.motor.reflected_inertia > HEAVIEST * _beam_inertia(arm):
        times = arm.motor.reflected_inertia / _beam_inertia(arm)
        yield (
            f"motor.rotor_inertia = {shown(arm.motor.rotor_inertia)}: through the gear {times:.1g} times the link's; "
            "it is taken in kg m^2, before the gear"
        )
    for i, each in enumerate(arm.attachments, 1):
        if each.mass > HEAVIEST * arm.own_mass:
            yield f"attachment.{i}.mass = {shown(each.mass)}: {each.mass / arm.own_mass:.1g} times the link's; in kg?"
