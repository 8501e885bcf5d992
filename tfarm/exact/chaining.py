"""From an arm to its chain: every part a rig has becomes an element, in exact fractions of its float64 numbers."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache

from tfarm.arm import Arm, Attachment, Link, RotarySpring, Theory

from .chain import ElementChain
from .coefficients import SYSTEMS_KEPT, scaled_inertia, stiffness_of, uniform
from .elements import Body, Drive, Element, Offset, Place, Segment, Spring


@lru_cache(maxsize=SYSTEMS_KEPT)
def chain_of(arm: Arm, theory: Theory | None = None) -> ElementChain:
    """The chain of an arm under its own theory, or another."""
    theory = theory or arm.theory
    unit_length, EI = sum((Fraction(link.length) for link in arm.links), Fraction(0)), stiffness_of(arm.link)
    translation, rotation = unit_length**3 / EI, unit_length / EI

    def segment(link: Link) -> Segment:
        numbers = uniform(link, theory)
        length, stiffness = Fraction(link.length) / unit_length, stiffness_of(link) / EI
        return Segment(*numbers, link.damping, length, stiffness, link.section.half_depth)

    pieces: list[Element] = [Offset(Fraction(arm.payload.offset) / unit_length)] if arm.payload.offset else []
    waiting = sorted(arm.attachments, key=lambda each: each.x)
    position = unit_length
    for link in reversed(arm.links):
        start, own = position - Fraction(link.length), segment(link)
        while waiting and Fraction(waiting[-1].x) > start:
            each = waiting.pop()
            if gap := position - min(Fraction(each.x), position):
                pieces.append(own.piece(gap / Fraction(link.length)))
                position -= gap
            pieces.append(_body(each, translation, rotation))
        pieces.append(own.piece((position - start) / Fraction(link.length)))
        position = start
    at_clamp = [_body(each, translation, rotation) for each in reversed(waiting)]
    if not arm.hub.radius:  # on the axis nothing moves: a spring there holds nothing
        at_clamp = [each._replace(stiffness=Fraction(0)) for each in at_clamp]
    pieces += at_clamp
    pieces += _springs(arm.clamp, rotation)
    pieces += [Offset(Fraction(arm.hub.radius) / unit_length)] if arm.hub.radius else []
    pieces += _springs(arm.joint, rotation)
    return ElementChain(
        elements=tuple(pieces),
        tip_mass=scaled_inertia(arm.payload.mass, translation),
        tip_inertia=scaled_inertia(arm.payload.inertia, rotation),
        drive=hub_drive(arm, rotation),
        radius=Fraction(arm.hub.radius) / unit_length,
        offset=Fraction(arm.payload.offset) / unit_length,
        gauge=Place(min(Fraction(arm.gauge.x) / unit_length, Fraction(1)), arm.gauge.side),
        length=unit_length,
        EI=EI,
    )


def hub_drive(arm: Arm, rotation: Fraction) -> Drive:
    """The drive of an arm's input; `rotation` is L/EI."""
    hub, motor, none = arm.hub, arm.motor, Fraction(0)
    if arm.is_locked:
        return Drive(False, none, none, none, none, none, Fraction(1))
    inertia, friction, per_ampere, lag, back_emf = (
        Fraction(hub.inertia),
        Fraction(hub.friction),
        Fraction(1),
        none,
        none,
    )
    if motor is not None:
        N = Fraction(motor.gear_ratio)
        inertia += N**2 * Fraction(motor.rotor_inertia)
        friction += N**2 * Fraction(motor.rotor_friction)
        per_ampere = Fraction(motor.gear_efficiency) * N * Fraction(motor.torque_constant)
        back_emf = per_ampere * N * Fraction(motor.back_emf_constant) / Fraction(motor.resistance) * rotation
        lag = Fraction(motor.inductance) / Fraction(motor.resistance)
    per_torque = {"motor_current": 1 / per_ampere}.get(arm.input, Fraction(1))
    if motor is not None and arm.input == "motor_voltage":
        per_torque = Fraction(motor.resistance) / per_ampere
    else:
        lag = back_emf = none
    own = inertia * rotation, friction * rotation, Fraction(hub.stiffness) * rotation
    return Drive(True, *own, back_emf, lag, per_torque / rotation, per_ampere if motor is not None else none)


def _body(each: Attachment, translation: Fraction, rotation: Fraction) -> Body:
    return Body(
        mass=Fraction(each.mass) * translation,
        inertia=Fraction(each.inertia) * rotation,
        stiffness=Fraction(each.stiffness) * translation,
        rotational_stiffness=Fraction(each.rotational_stiffness) * rotation,
    )


def _springs(spring: RotarySpring, rotation: Fraction) -> list[Element]:
    """The spring as an element, or nothing where it is rigid."""
    if math.isinf(spring.stiffness):
        return []
    k = Fraction(spring.stiffness) * rotation
    return [Spring(k / (1 + k), 1 / (1 + k), spring.damping)]
