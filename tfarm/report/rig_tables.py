"""What is given of a rig, part by part, and what follows from it: rows of quantity, symbol, value, unit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm, Link, RotarySpring, unit_of

QuantityRow = tuple[str, str, float, str]


def given_rows(arm: Arm) -> list[QuantityRow]:
    """Every part that the rig has."""
    alone = not arm.outer
    rows = [row for i, link in enumerate(arm.links, 1) for row in _segment(link, "" if alone else f"segment {i}: ")]
    hub = arm.hub
    rows.append(("hub inertia", "I_h", hub.inertia, "kg m^2"))
    others: list[QuantityRow] = [
        ("hub friction", "b", hub.friction, "N m s/rad"),
        ("hub radius, from the axis to the clamp", "r", hub.radius, "m"),
        ("spring from hub to ground", "", hub.stiffness, "N m/rad"),
    ]
    rows += [row for row in others if row[2]]
    rows += [*_spring(arm.clamp, "clamp"), *_spring(arm.joint, "joint at the axis"), *_motor(arm)]
    for i, each in enumerate(arm.attachments, 1):
        parts: list[QuantityRow] = [
            ("place from the clamp", "x", each.x, "m"),
            ("mass", "", each.mass, "kg"),
            ("inertia", "", each.inertia, "kg m^2"),
            ("spring to ground", "", each.stiffness, "N/m"),
            ("rotary spring to ground", "", each.rotational_stiffness, "N m/rad"),
        ]
        rows += [
            (f"attachment {i}: {name}", symbol, value, unit)
            for place, (name, symbol, value, unit) in enumerate(parts)
            if value or not place
        ]
    rows += [("strain gauge: place from the clamp", "x", arm.gauge.x, "m")] * bool(arm.gauge.x)
    payload = arm.payload
    rows += [("payload mass", "m", payload.mass, "kg"), ("payload inertia", "I_c", payload.inertia, "kg m^2")]
    return rows + [("payload's centre beyond the tip", "e", payload.offset, "m")] * bool(payload.offset)


def _segment(link: Link, prefix: str) -> Iterator[QuantityRow]:
    """The numbers of one segment."""
    section = link.section
    kappa = "shear factor, given" if section.shear_factor is not None else "shear factor, Cowper (1966)"
    rows: list[QuantityRow] = [
        ("length", "L", link.length, "m"),
        ("density", "ρ", link.density, "kg/m^3"),
        ("Young's modulus", "E", link.youngs_modulus, "Pa"),
        ("shear modulus", "G", link.shear_modulus, "Pa"),
        ("Kelvin-Voigt damping, on bending", "C", link.damping, "s"),
        *((f"section ({section.shape}): {n.replace('_', ' ')}", "", value, "m") for n, value in section.dimensions),
        ("area of the section", "A", section.area, "m^2"),
        ("second moment of area", "I", section.second_moment, "m^4"),
        (kappa, "κ", link.shear_factor, ""),
    ]
    for name, symbol, value, unit in rows:
        yield f"{prefix}{name}", symbol, value, unit


def _spring(spring: RotarySpring, name: str) -> Iterator[QuantityRow]:
    if not spring.is_rigid:
        yield f"{name}: stiffness", "k", spring.stiffness, "N m/rad"
        yield f"{name}: damping, k (1 + c s)", "c", spring.damping, "s"


def _motor(arm: Arm) -> Iterator[QuantityRow]:
    motor = arm.motor
    if motor is None:
        return
    yield "motor: resistance", "R", motor.resistance, "ohm"
    yield "motor: inductance", "L_a", motor.inductance, "H"
    yield "motor: torque constant", "Kt", motor.torque_constant, "N m/A"
    yield "motor: back-EMF constant", "Ke", motor.back_emf_constant, "V s/rad"
    yield "motor: gear ratio", "N", motor.gear_ratio, ""
    yield "motor: gear efficiency, motor to hub", "η", motor.gear_efficiency, ""
    yield "motor: rotor inertia, before the gear", "J_m", motor.rotor_inertia, "kg m^2"
    yield "motor: rotor friction, before the gear", "b_m", motor.rotor_friction, "N m s/rad"


def derived_rows(arm: Arm) -> list[QuantityRow]:
    """What follows from the parts."""
    alone = not arm.outer
    rows: list[QuantityRow] = []
    for i, link in enumerate(arm.links, 1):
        prefix = "" if alone else f"segment {i}: "
        rows += [
            (f"{prefix}mass", "ρAL", link.rhoA * link.length, "kg"),
            (f"{prefix}bending stiffness", "EI", link.EI, "N m^2"),
            (f"{prefix}shear stiffness", "κGA", link.kGA, "N"),
            (f"{prefix}slenderness", "L/√(I/A)", link.slenderness, ""),
        ]
    rows.append(("total inertia about the axis", "J", arm.total_inertia, "kg m^2"))
    if arm.motor is not None:
        rows.append(("rotor as the hub feels it", "N² J_m", arm.motor.reflected_inertia, "kg m^2"))
    if arm.has_rigid_mode and not arm.is_locked:
        rows.append(("root moment per torque at rest", "", -arm.gauged_inertia / arm.total_inertia, "N m/(N m)"))
    if arm.input_per_torque != 1.0:
        rows.append(("input for a torque of 1 N m", "", arm.input_per_torque, unit_of(MOMENT_GAIN, arm)))
    if arm.rate_loss:
        rows.append((f"what the losses at the hub add to {RATE_GAIN}", "", arm.rate_loss, unit_of(RATE_GAIN, arm)))
    return [*rows, *cutoff_rows(arm)]


def cutoff_rows(arm: Arm) -> list[QuantityRow]:
    """The shear cut-off, of an arm whose theory has one."""
    lowest = ", of several segments the lowest" * bool(arm.outer)
    rows = [
        (f"shear cut-off{lowest}", "√(κGA/ρI)", arm.shear_cutoff, "rad/s"),
        ("shear cut-off", "", arm.shear_cutoff / (2 * math.pi), "Hz"),
    ]
    return rows * arm.has_cutoff
