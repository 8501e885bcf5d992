"""How each parameter moves each natural frequency: d ln w/d ln p, exact, from the energies of the mode.

Rayleigh's quotient w^2 = V/T is stationary at a mode, so of a parameter p that enters the energies

    2 d ln w/d ln p = (dV/d ln p - w^2 dT/d ln p)/V,

with the fields held.  Held as functions of x/l, they leave of a piece's length l  -2 P l/V,  where

    P = M^2/(2 EI) + Q^2/(2 kappa G A) + Q Psi + w^2 (rhoA W^2 + rhoI Psi^2)/2

is the same all along a uniform piece, as its energy-momentum (Eshelby 1951) is; a rigid piece (the hub's radius, the
payload's offset) has P = Q Psi, and an attachment that moves outwards lengthens the piece inside of it.

In these functions energies are shares of the mode's: potential and kinetic ones sum to 1 each.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Iterator
from fractions import Fraction
from itertools import accumulate
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.exact.elements import Place, Segment
from tfarm.exact.layout import Layout

from .shapes import AT_HUB, Shapes

Doubled = dict[str, Real]  # 2 d ln w/d ln p of each mode (modes,)

LINK = ("length", "density", "youngs_modulus", "shear_modulus", "shear_factor", "area", "second_moment")
PARAMETERS = (*LINK, "hub_inertia", "payload_mass", "payload_inertia")  # of every arm; a rig has more


def sensitivities(arm: Arm, shapes: Shapes) -> dict[str, Real]:
    """d ln w/d ln p of the arm's own parameters, by parameter, for each mode of `shapes`.

    All have those of the link, hub and payload (of a rig those of all segments together); "segment_1_length", ... of
    each where there are several; "attachment_1_x", ... and the springs, rotor and offsets that it has.  A length takes
    along what is attached to it.
    """
    parts = [_of_modes(arm, part) for part in shapes.blocks()]
    return {name: np.concatenate([each[name] for each in parts]) / 2 + 0.0 for name in parts[0]}


def _of_modes(arm: Arm, shapes: Shapes) -> Doubled:
    ends = list(accumulate(Fraction(link.length) / shapes.system.length for link in arm.links))  # from the hub outwards
    totals, start = [np.zeros((5, shapes.omega.size)) for _ in arm.links], Fraction(0)
    for piece, weight, fields in shapes.panels():
        terms = _densities(piece, shapes.omega[:, None], *fields)
        totals[bisect(ends, start)] += np.array([term @ weight for term in terms])
        start += piece.length
    segments = [_of_link(*total) for total in totals]
    found = {name: np.sum([each[name] for each in segments], axis=0) for name in LINK}
    found |= _hub(arm, shapes) | _payload(arm, shapes)
    for number, each in enumerate(segments if len(segments) > 1 else (), start=1):
        found |= {f"segment_{number}_{name}": values for name, values in each.items()}
    for number in range(len(arm.attachments)):
        found |= {f"attachment_{number + 1}_{name}": values for name, values in _attachment(arm, shapes, number)}
    return found


def _of_link(bend: Real, shear: Real, slide: Real, move: Real, turn: Real) -> Doubled:
    """A link's parameters by its energies; `slide` is the integral of Q W', twice that of the shear force's work."""
    return {
        "length": -bend + shear - 2 * slide - move - turn,
        "density": -move - turn,
        "youngs_modulus": bend,
        "shear_modulus": shear,
        "shear_factor": shear,
        "area": shear - move,
        "second_moment": bend - turn,
    }


# ------------------------------------------------------------ rigs


def _densities(piece: Segment, omega: Any, W: Any, Psi: Any, M: Any, Q: Any) -> tuple[Any, ...]:
    """Energies of a piece, as in `_of_link`, per length."""
    length, stiffness, square = float(piece.length), float(piece.stiffness), omega**2
    slip = float(piece.sigma) * length**2 / stiffness  # W' = Psi + slip Q
    bend, shear, slide = M**2 / stiffness / square, slip * Q**2 / square, Q * (Psi + slip * Q) / square
    return (
        bend,
        shear,
        slide,
        float(piece.g) * stiffness / length**4 * W**2,
        float(piece.a) * stiffness / length**2 * (Psi**2),
    )


def _hub(arm: Arm, shapes: Shapes) -> Doubled:
    """Of hub, rotor, clamp and joint: behind the clamp the link turns by Psi - M/k, W = r times that, theta at last."""
    chain, hub, square = shapes.system, arm.hub, shapes.omega**2
    per_rotation, theta = float(chain.length / chain.EI), shapes.theta()
    _, Psi, M, Q = shapes.states((AT_HUB,))[0][..., 0]
    found = {"hub_inertia": -hub.inertia * per_rotation * theta**2 if not arm.is_locked else np.zeros_like(theta)}
    if not arm.clamp.is_rigid:
        found["clamp_stiffness"] = M**2 / (arm.clamp.stiffness * per_rotation) / square
        Psi = Psi - M / (arm.clamp.stiffness * per_rotation)
    if hub.radius:
        found["hub_radius"] = -2 * float(chain.radius) * Q * Psi / square
        M = M + float(chain.radius) * Q
    if not arm.joint.is_rigid:
        found["joint_stiffness"] = M**2 / (arm.joint.stiffness * per_rotation) / square
    if hub.stiffness:
        found["hub_stiffness"] = hub.stiffness * per_rotation * theta**2 / square
    if arm.motor is not None and arm.motor.rotor_inertia:
        rotor = -arm.motor.reflected_inertia * per_rotation * theta**2 * (not arm.is_locked)
        found |= {"rotor_inertia": rotor, "gear_ratio": 2 * rotor}
    return found


def _payload(arm: Arm, shapes: Shapes) -> Doubled:
    """Of the payload: it moves by W + e Psi."""
    chain, square = shapes.system, shapes.omega**2
    W, Psi, _, Q = shapes.tip()
    motions = (("mass", chain.tip_mass, W + float(chain.offset) * Psi), ("inertia", chain.tip_inertia, Psi))
    found = {
        f"payload_{name}": -float(held) * motion**2 if math.isfinite(held) else np.zeros_like(motion)
        for name, held, motion in motions
    }
    if arm.payload.offset:
        found["payload_offset"] = -2 * float(chain.offset) * Q * Psi / square
    return found


def _attachment(arm: Arm, shapes: Shapes, number: int) -> Iterator[tuple[str, Real]]:
    """Of an attachment what it has; its place too, where the link is uniform around it and nothing else is there."""
    each, chain, square = arm.attachments[number], shapes.system, shapes.omega**2
    share = min(Fraction(each.x) / chain.length, Fraction(1))
    sides = Place(share, "inner"), Place(share, "outer")
    inner, outer = shapes.states(sides)[0].transpose(2, 0, 1)
    per_motion, per_rotation = float(chain.length**3 / chain.EI), float(chain.length / chain.EI)
    joints = list(accumulate((Fraction(link.length) for link in arm.links), initial=Fraction(0)))
    if Fraction(each.x) not in joints and sum(other.x == each.x for other in arm.attachments) == 1:
        pieces = Layout(chain, sides).read
        beyond, within = (
            _of_link(*_densities(piece, shapes.omega, *state))["length"]
            for piece, state in zip(pieces[::-1], (outer, inner), strict=True)
        )
        yield "x", (within - beyond) * float(share)
    W, Psi = outer[:2]
    if each.mass:
        yield "mass", -each.mass * per_motion * W**2
    if each.inertia:
        yield "inertia", -each.inertia * per_rotation * Psi**2
    if each.stiffness:
        yield "stiffness", each.stiffness * per_motion * W**2 / square
    if each.rotational_stiffness:
        yield "rotational_stiffness", each.rotational_stiffness * per_rotation * Psi**2 / square
