"""Exact sensitivities of natural frequencies to the parameters of an arm, from the energies of the mode shapes.

Rayleigh's quotient w^2 = V/T is stationary at a mode, so for a parameter p of the energies

    2 d ln w/d ln p = (dV/d ln p - w^2 dT/d ln p)/V

with constant fields.  With constant functions of x/l, the term of a piece's length l is  -2 P l/V,  where

    P = M^2/(2 EI) + Q^2/(2 kappa G A) + Q Psi + w^2 (rhoA W^2 + rhoI Psi^2)/2

is constant along a uniform piece, its energy-momentum (Eshelby 1951).  A rigid piece (the hub's radius, the payload's
offset) has P = Q Psi.  An attachment that moves outwards lengthens the piece inside of it.

In these functions energies are shares of those of the mode: potential and kinetic ones sum to 1 each.
"""

import math
from bisect import bisect
from collections.abc import Iterator
from fractions import Fraction
from itertools import accumulate
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.exact.layout import segment_at
from tfarm.exact.system import Place, Segment
from tfarm.spectrum.shapes import Shapes

# 2 d ln w/d ln p of each mode (modes,)
Doubled = dict[str, Real]

# of every arm; a rig has more
PARAMETERS = (
    "length",
    "density",
    "youngs_modulus",
    "shear_modulus",
    "shear_factor",
    "area",
    "second_moment",
    "hub_inertia",
    "payload_mass",
    "payload_inertia",
)


def sensitivities(arm: Arm, shapes: Shapes) -> dict[str, Real]:
    """Return d ln w/d ln p of the arm's parameters, by parameter, for each mode of `shapes`.

    All arms have those of link (all segments together), hub and payload; others "segment_1_length", ... of each
    segment, "attachment_1_x", ... and those of springs, rotor and offsets.  Attachments move with a length.
    """
    parts = [_of_modes(arm, part) for part in shapes.blocks()]
    found = {}
    for name in parts[0]:
        doubled = np.concatenate([each[name] for each in parts])
        # -0.0 becomes 0.0
        found[name] = doubled / 2 + 0.0
    return found


def _of_modes(arm: Arm, shapes: Shapes) -> Doubled:
    """Return those of all parameters for the modes of one block."""
    # from the hub outwards
    ends = list(accumulate(Fraction(link.length) / shapes.system.length for link in arm.links))
    totals = [np.zeros((5, shapes.omega.size)) for _ in arm.links]
    start = Fraction(0)
    for piece, weight, fields in shapes.panels():
        terms = _densities(piece, shapes.omega[:, None], *fields)
        totals[bisect(ends, start)] += np.array([term @ weight for term in terms])
        start += piece.length
    segments = [_of_link(*total) for total in totals]
    found = {}
    for name in segments[0]:
        found[name] = np.sum([each[name] for each in segments], axis=0)
    found |= _hub(arm, shapes) | _payload(arm, shapes)
    if arm.outer:
        for number, each in enumerate(segments, start=1):
            found |= {f"segment_{number}_{name}": values for name, values in each.items()}
    for number in range(len(arm.attachments)):
        place = f"attachment_{number + 1}"
        found |= {f"{place}_{name}": values for name, values in _attachment(arm, shapes, number)}
    return found


def _of_link(bend: Real, shear: Real, slide: Real, move: Real, turn: Real) -> Doubled:
    """Return those of a link from its energies; `slide` is the integral of Q W', twice the work of the shear force."""
    return {
        "length": -bend + shear - 2 * slide - move - turn,
        "density": -move - turn,
        "youngs_modulus": bend,
        "shear_modulus": shear,
        "shear_factor": shear,
        "area": shear - move,
        "second_moment": bend - turn,
    }


def _densities(piece: Segment, omega: Any, W: Any, Psi: Any, M: Any, Q: Any) -> tuple[Any, ...]:
    """Return energies of a piece, as in `_of_link`, per length."""
    length = float(piece.length)
    stiffness = float(piece.stiffness)
    square = omega**2
    # W' = Psi + slip Q
    slip = float(piece.sigma) * length**2 / stiffness
    bend = M**2 / stiffness / square
    shear = slip * Q**2 / square
    slide = Q * (Psi + slip * Q) / square
    move = float(piece.g) * stiffness / length**4 * W**2
    turn = float(piece.a) * stiffness / length**2 * (Psi**2)
    return bend, shear, slide, move, turn


def _hub(arm: Arm, shapes: Shapes) -> Doubled:
    """Return those of hub, rotor, clamp and joint; behind the clamp the rotation is Psi - M/k, at the joint theta."""
    chain = shapes.system
    hub = arm.hub
    square = shapes.omega**2
    per_rotation = float(chain.length / chain.EI)
    turning = per_rotation * shapes.theta() ** 2
    _, Psi, M, Q = shapes.root()
    inertia = 0.0 if arm.is_locked else hub.inertia
    found = {"hub_inertia": -inertia * turning}
    if not arm.clamp.is_rigid:
        bent = M / (arm.clamp.stiffness * per_rotation)
        found["clamp_stiffness"] = M * bent / square
        Psi = Psi - bent
    if hub.radius:
        radius = float(chain.radius)
        found["hub_radius"] = -2 * radius * Q * Psi / square
        M = M + radius * Q
    if not arm.joint.is_rigid:
        found["joint_stiffness"] = M**2 / (arm.joint.stiffness * per_rotation) / square
    if hub.stiffness:
        found["hub_stiffness"] = hub.stiffness * turning / square
    if arm.motor is not None and arm.motor.rotor_inertia:
        rotor = -arm.motor.reflected_inertia * turning
        found |= {"rotor_inertia": rotor, "gear_ratio": 2 * rotor}
    return found


def _payload(arm: Arm, shapes: Shapes) -> Doubled:
    """Return those of the payload, with the displacement W + e Psi."""
    chain = shapes.system
    square = shapes.omega**2
    W, Psi, _, Q = shapes.tip()
    offset = float(chain.offset)
    motions = (("mass", chain.tip_mass, W + offset * Psi), ("inertia", chain.tip_inertia, Psi))
    found = {}
    for name, size, motion in motions:
        # an infinite one rests
        moved = float(size) if math.isfinite(size) else 0.0
        found[f"payload_{name}"] = -moved * motion**2
    if offset:
        found["payload_offset"] = -2 * offset * Q * Psi / square
    return found


def _attachment(arm: Arm, shapes: Shapes, number: int) -> Iterator[tuple[str, Real]]:
    """Yield those of an attachment; also of its place, where the link is uniform around it and has no other there."""
    each = arm.attachments[number]
    chain = shapes.system
    square = shapes.omega**2
    share = min(Fraction(each.x) / chain.length, Fraction(1))
    sides = Place(share, "inner"), Place(share, "outer")
    states = shapes.states(sides)[0].transpose(2, 0, 1)
    outer = states[1]
    per_motion = float(chain.length**3 / chain.EI)
    per_rotation = float(chain.length / chain.EI)
    joints = list(accumulate((Fraction(link.length) for link in arm.links), initial=Fraction(0)))
    if Fraction(each.x) not in joints and sum(other.x == each.x for other in arm.attachments) == 1:
        within, beyond = (
            _of_link(*_densities(segment_at(chain, side), shapes.omega, *state))["length"]
            for side, state in zip(sides, states, strict=True)
        )
        yield "x", (within - beyond) * float(share)
    translation = per_motion * outer[0] ** 2
    rotation = per_rotation * outer[1] ** 2
    # kinetic ones negative
    energies = {
        "mass": -translation,
        "inertia": -rotation,
        "stiffness": translation / square,
        "rotational_stiffness": rotation / square,
    }
    for name, energy in energies.items():
        value = getattr(each, name)
        if value:
            yield name, value * energy
