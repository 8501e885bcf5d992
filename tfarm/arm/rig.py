"""The parts of a rig other than its link, as frozen records in SI units: hub, springs, motor, attachments, payload.

Letters: I_h, b, r of the hub; k, c of a rotary spring; R, L_a, Kt, Ke, N, J_m, b_m, eta of the motor; m, I_c, e of the
payload.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, cast

from tfarm.arm.checks import check_fields, extended, not_negative, positive, signed
from tfarm.errors import require


def differing(record: Any, always: int) -> dict[str, Any]:
    """Return the first `always` fields of a record's repr, and those of the others that differ from their defaults."""
    found = {}
    for i, each in enumerate(known for known in fields(record) if known.repr):
        value = getattr(record, each.name)
        default = each.default if each.default_factory is MISSING else each.default_factory()
        if i < always or value != default:
            found[each.name] = value
    return found


def brief_repr(record: Any, always: int) -> str:
    """Return the repr of a record with the fields of `differing` alone."""
    shown = ", ".join(f"{name}={value!r}" for name, value in differing(record, always).items())
    return f"{type(record).__name__}({shown})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """The hub: `inertia` I_h [kg m^2] (inf: locked, 0: free pin), viscous `friction` b [N m s/rad].

    `radius` r [m] is the distance from the axis to the clamp; `stiffness` [N m/rad] is a spring to ground.
    """

    inertia: float
    friction: float = 0.0
    radius: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            "hub",
            extended,
            inertia="a hub inertia is zero (free pin), positive in kg m^2, or inf (locked)",
        )
        check_fields(
            self,
            "hub",
            not_negative,
            friction="a hub friction is zero or a positive, finite number in N m s/rad",
            radius="a hub radius, from the axis to the clamp, is zero or a positive, finite number of metres",
            stiffness="a spring from hub to ground is zero or positive, finite, in N m/rad (inertia = inf locks)",
        )
        for name in ("friction", "stiffness"):
            require(
                math.isfinite(self.inertia) or not getattr(self, name),
                f"hub.{name}",
                getattr(self, name),
                f"no effect, as inertia = inf locks the hub; leave out the {name}, or give a finite inertia",
            )

    def __repr__(self) -> str:
        return brief_repr(self, always=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RotarySpring:
    """A rotary spring and dashpot in parallel: `stiffness` k [N m/rad] (inf: rigid), `damping` c [s], k (1 + c s)."""

    stiffness: float = math.inf
    damping: float = 0.0

    def __post_init__(self) -> None:
        meaning = "the stiffness of a clamp or joint is positive in N m/rad, or inf (rigid)"
        check_fields(self, "spring", extended, stiffness=meaning)
        require(self.stiffness != 0.0, "spring.stiffness", self.stiffness, meaning)
        check_fields(
            self,
            "spring",
            not_negative,
            damping="damping c is zero or a positive time in seconds, as in k (1 + c s)",
        )
        require(
            not (self.damping and self.is_rigid),
            "spring.damping",
            self.damping,
            "a rigid spring has no damping: give a finite stiffness in N m/rad, or leave the damping out",
        )

    @property
    def is_rigid(self) -> bool:
        """Whether k = inf."""
        return math.isinf(self.stiffness)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor:
    """A geared DC motor: `resistance` R [ohm], `inductance` L_a [H], `torque_constant` Kt [N m/A].

    `back_emf_constant` Ke [V s/rad] is Kt by default; `gear_ratio` N is motor turns per hub turn.  On the motor's
    side of the gear: `rotor_inertia` J_m [kg m^2] and `rotor_friction` b_m [N m s/rad].  `gear_efficiency` eta [-]
    is that from motor to hub: u = eta N Kt i.
    """

    resistance: float
    torque_constant: float
    back_emf_constant: float = cast("float", None)  # Kt then
    inductance: float = 0.0
    gear_ratio: float = 1.0
    rotor_inertia: float = 0.0
    rotor_friction: float = 0.0
    gear_efficiency: float = 1.0

    def __post_init__(self) -> None:
        meanings = {
            "resistance": "a motor's resistance is a positive, finite number of ohms",
            "torque_constant": "a torque constant is a positive, finite number in N m/A",
            "gear_ratio": "a gear ratio, motor turns per hub turn, is a positive, finite number",
            "gear_efficiency": "an efficiency is above 0, up to 1 (75 % is entered as 0.75)",
        }
        check_fields(self, "motor", positive, **meanings)
        require(self.gear_efficiency <= 1.0, "motor.gear_efficiency", self.gear_efficiency, meanings["gear_efficiency"])
        if cast("float | None", self.back_emf_constant) is None:
            object.__setattr__(self, "back_emf_constant", self.torque_constant)
        check_fields(
            self,
            "motor",
            not_negative,
            back_emf_constant="a back-EMF constant is zero or a positive, finite number in V s/rad",
            inductance="an inductance is zero or a positive, finite number of henries",
            rotor_inertia="a rotor inertia is zero or a positive, finite number in kg m^2, before the gear",
            rotor_friction="a rotor friction is zero or a positive, finite number in N m s/rad, before the gear",
        )

    @property
    def reflected_inertia(self) -> float:
        """N^2 J_m [kg m^2], the rotor's inertia at the hub."""
        return self.gear_ratio**2 * self.rotor_inertia


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A body on the link at `x` [m] from the clamp: `mass` [kg], `inertia` [kg m^2], springs to ground.

    `stiffness` [N/m] is that of its displacement, `rotational_stiffness` [N m/rad] that of its rotation.
    """

    x: float
    mass: float = 0.0
    inertia: float = 0.0
    stiffness: float = 0.0
    rotational_stiffness: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            "attachment",
            not_negative,
            x="an attachment's place is zero or a positive number of metres from the clamp, up to the tip",
            mass="an attached mass is zero or a positive, finite number in kg",
            inertia="an attached inertia is zero or a positive, finite number in kg m^2",
            stiffness="an attached spring to ground is zero or positive, finite, in N/m",
            rotational_stiffness="an attached rotary spring to ground is zero or positive, finite, in N m/rad",
        )
        require(
            self.mass or self.inertia or self.is_held,
            "attachment.x",
            self.x,
            "an empty attachment: give a mass, an inertia, a stiffness or a rotational_stiffness",
        )

    @property
    def is_held(self) -> bool:
        """Whether it has a spring to ground."""
        return self.stiffness > 0.0 or self.rotational_stiffness > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gauge:
    """The strain gauge whose moment is fed back, at `x` [m] from the clamp: 0, the root, in the paper.

    At a joint of two segments, or at an attachment, it is on the outer side unless `side` is "inner".
    """

    x: float = 0.0
    side: Literal["outer", "inner"] = "outer"

    def __post_init__(self) -> None:
        check_fields(
            self,
            "gauge",
            not_negative,
            x="a gauge's place is zero or a positive number of metres from the clamp",
        )
        require(self.side in ("outer", "inner"), "gauge.side", self.side, '"outer" or "inner"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """The payload: `mass` m [kg] (inf pins its centre), `inertia` I_c [kg m^2] about its own centre of mass.

    An infinite inertia locks the tip's rotation; `offset` e [m], of any sign, is that of the centre beyond the tip.
    """

    mass: float = 0.0
    inertia: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            "payload",
            extended,
            mass="a payload mass is zero, positive in kg, or inf (tip pinned)",
            inertia="a payload inertia is zero, positive in kg m^2, or inf (tip cannot rotate)",
        )
        check_fields(
            self,
            "payload",
            signed,
            offset="a payload's offset is a finite number of metres beyond the tip, negative before it",
        )

    def __repr__(self) -> str:
        return brief_repr(self, always=2)
