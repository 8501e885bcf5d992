"""The arm or rig as a frozen record in SI units: hub, flexible link of one or more segments, payload, other parts."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from tfarm.arm.checks import (
    INPUT_UNITS,
    INPUTS,
    THEORIES,
    WITH_ROTARY_INERTIA,
    Input,
    Theory,
    plain_name,
    plain_texts,
)
from tfarm.arm.parts import Attachment, Gauge, Hub, Link, Motor, Payload, RotarySpring, brief_repr
from tfarm.errors import ParameterError, must_be_known, require, short_text
from tfarm.moved import FormerName

# segments, and attachments: a check of the chain has 64 equal pieces
MOST_PARTS = 64
# without inertia, friction and gear
IDEAL_MOTOR = Motor(resistance=1.0, torque_constant=1.0, back_emf_constant=0.0)

_PartRecord = TypeVar("_PartRecord")


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """A hub, a flexible link and a payload, with the assumptions that every report repeats.

    `link` is the segment at the hub, the only one of the paper's arm; `outer` are the other segments, outwards.  The
    `clamp` is the spring between hub and link, at `hub.radius` from the axis, the `joint` (gear, shaft) that at the
    axis.  The `gauge` measures the root moment of the law.  `theory` is one of `THEORIES`, `input` one of `INPUTS`.
    Raises ParameterError for an attachment or gauge off the link, a pinned payload on the axis, a motor's input
    without a motor, and a motor on a locked hub.
    """

    link: Link
    hub: Hub
    payload: Payload = field(default_factory=Payload)
    name: str = "arm"
    assumptions: tuple[str, ...] = field(default=(), repr=False)
    outer: tuple[Link, ...] = ()
    clamp: RotarySpring = field(default_factory=RotarySpring)
    joint: RotarySpring = field(default_factory=RotarySpring)
    motor: Motor | None = None
    attachments: tuple[Attachment, ...] = ()
    gauge: Gauge = field(default_factory=Gauge)
    theory: Theory = "timoshenko"
    input: Input = "hub_torque"

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", plain_name(self.name))
        object.__setattr__(self, "assumptions", plain_texts(self.assumptions))
        object.__setattr__(self, "outer", _parts("outer", self.outer, Link, MOST_PARTS - 1))
        attachments = _parts("attachments", self.attachments, Attachment, MOST_PARTS)
        object.__setattr__(self, "attachments", attachments)
        must_be_known("theory", self.theory, THEORIES)
        must_be_known("input", self.input, INPUTS)
        # of the whole length
        slenderness = min(self.length / link.section.radius_of_gyration for link in self.links)
        remedy = f"{slenderness:.3g} times the section's radius of gyration is no beam; check the units"
        require(slenderness >= 1e-3, "length" if self.outer else "link.length", self.length, remedy)
        self._check_places()
        if self.motor is None:
            remedy = "there is no motor; describe it under [motor], or take hub_torque or hub_angle"
            require(self.input in ("hub_torque", "hub_angle"), "input", self.input, remedy)
        else:
            remedy = "locks the hub, so the motor has no effect; leave out the motor, or give the hub's own inertia"
            require(math.isfinite(self.hub.inertia), "hub.inertia", self.hub.inertia, remedy)

    def __repr__(self) -> str:
        return brief_repr(self, always=4)

    def _check_places(self) -> None:
        """Check the places of attachments, gauge and pin; move an attachment that rounding has put beyond the tip."""
        # with the rounding of a sum of up to 64 decimal lengths
        end = self.length * (1 + 1e-12)
        places = [(f"attachment.{i}", each.x, end) for i, each in enumerate(self.attachments, 1)]
        remedy = f"is beyond the tip; x counts from the clamp, up to the link's length of {self.length!r} m"
        for part, x, most in [*places, ("gauge", self.gauge.x, self.length)]:
            require(x <= most, f"{part}.x", x, remedy)
        on_it = tuple(replace(each, x=min(each.x, self.length)) for each in self.attachments)
        object.__setattr__(self, "attachments", on_it)
        is_right = math.isfinite(self.payload.mass) or abs(self.centre_distance) >= 1e-9 * self.reach
        remedy = (
            "puts the pinned centre of mass on the axis, which is fixed anyway; give a finite payload.mass"
        )
        require(is_right, "payload.offset", self.payload.offset, remedy)

    @property
    def links(self) -> tuple[Link, ...]:
        """The segments, from the hub outwards."""
        return (self.link, *self.outer)

    @property
    def length(self) -> float:
        """L [m], from the clamp to the tip."""
        return math.fsum(link.length for link in self.links)

    @property
    def reach(self) -> float:
        """r + L [m], from the axis to the tip."""
        return self.hub.radius + self.length

    @property
    def centre_distance(self) -> float:
        """r + L + e [m], from the axis to the payload's centre of mass."""
        return self.reach + self.payload.offset

    @property
    def own_mass(self) -> float:
        """rho A L [kg], of the link itself, all segments."""
        return math.fsum(link.rhoA * link.length for link in self.links)

    @property
    def payload_mass(self) -> float:
        """m [kg], at the tip; inf where that is pinned."""
        return self.payload.mass

    @property
    def payload_inertia(self) -> float:
        """I_c [kg m^2], about the payload's own centre of mass."""
        return self.payload.inertia

    @property
    def hub_inertia(self) -> float:
        """I_h [kg m^2]."""
        return self.hub.inertia

    @property
    def damping(self) -> float:
        """C [s] of the bending moment E I (1 + C s); of several segments the largest."""
        return max(link.damping for link in self.links)

    @property
    def is_undamped(self) -> bool:
        """Whether nothing dissipates: then every natural frequency is real."""
        return self.loses_at_hub_alone and not self.rate_loss

    @property
    def is_reactive(self) -> bool:
        """Whether nothing dissipates and no input lags: at s = i w all but odd powers of s is real."""
        return self.is_undamped and not self.input_lags

    @property
    def is_uniform(self) -> bool:
        """Whether it is an arm as in the paper: one segment on a hub, a payload centred on the tip, no other part."""
        hub = self.hub
        of_hub = (hub.friction, hub.radius, hub.stiffness)
        others = (self.outer, self.motor, self.attachments, self.payload.offset, self.gauge.x)
        is_rigid = self.clamp.is_rigid and self.joint.is_rigid
        return is_rigid and not any(of_hub + others)

    @property
    def least_damping(self) -> float:
        """The smallest C [s] of the segments."""
        return min(link.damping for link in self.links)

    @property
    def has_elastic_link(self) -> bool:
        """Whether C = 0 in every segment; hub, clamp and joint may dissipate."""
        return self.damping == 0.0

    @property
    def has_massless_hub(self) -> bool:
        """Whether the hub has no inertia, friction or stiffness, and r = 0: then the root moment is -u."""
        # the gauge measures another moment
        places = (self.hub.radius, self.gauge.x)
        return not any((self.hub_side_inertia, self.hub.stiffness, self.rate_loss, *places))

    @property
    def bending_scale(self) -> float:
        """E I/L [N m] of the hub's segment and the whole length."""
        return self.link.EI / self.length

    @property
    def is_locked(self) -> bool:
        """Whether the hub angle is the input instead of a torque: I_h = inf, or by `input`."""
        return math.isinf(self.hub.inertia) or self.input == "hub_angle"

    @property
    def input_unit(self) -> str:
        """The SI unit of the input: "rad" where the hub is locked, else N m, V or A."""
        return INPUT_UNITS["hub_angle" if self.is_locked else self.input]

    @property
    def has_rigid_mode(self) -> bool:
        """Whether the whole rig can turn as a rigid body.

        No inertia is infinite, no spring ties it to the ground, and the hub's angle is not prescribed.
        """
        is_held = self.is_locked or any(value for _, value in self._springs_to_ground())
        is_tip_free = math.isfinite(self.payload.mass) and math.isfinite(self.payload.inertia)
        return is_tip_free and not is_held

    def _springs_to_ground(self) -> Iterator[tuple[str, float]]:
        """Yield the key and the stiffness of each spring to ground."""
        yield "hub.stiffness", self.hub.stiffness
        for i, each in enumerate(self.attachments, 1):
            # where nothing moves
            on_axis = not (each.x or self.hub.radius)
            yield f"attachment.{i}.stiffness", 0.0 if on_axis else each.stiffness
            yield f"attachment.{i}.rotational_stiffness", each.rotational_stiffness

    @property
    def shear_cutoff(self) -> float:
        """sqrt(kGA/rhoI) [rad/s], above which both pairs of waves travel; of several segments the lowest.

        In a theory without shear or rotary inertia only one pair travels at any frequency (`has_cutoff`).
        """
        return min(math.sqrt(link.kGA / link.rhoI) for link in self.links)

    @property
    def has_cutoff(self) -> bool:
        """Whether `shear_cutoff` applies: in Timoshenko's theory alone."""
        return self.theory == "timoshenko"

    # ------------------------------------------------------------ rigid body and motor, at the hub

    @property
    def total_inertia(self) -> float:
        """J = I_h + N^2 J_m + sum of the segments and attachments + m (r + L + e)^2 + I_c [kg m^2], about the axis.

        A segment from a to a + L has rhoA (L^3/3 + a L (a + L)) + rhoI L, without rhoI where the theory has no rotary
        inertia.  inf where that of the hub or the payload is.
        """
        return self._turned_about(-self.hub.radius, self.attachments, self.hub_side_inertia)

    def _turned_about(self, place: float, bodies: Iterable[Attachment], own: float = 0.0) -> float:
        """Return the moment about a place [m] from the clamp of links, bodies and payload beyond it, and its `own`.

        It is that of a rigid rig for an angular acceleration of 1.

        A mass at x has (r + x)(x - place): rhoA (L^3/3 + a L (a + L) + c L (a + L/2)) of a segment from a to a + L
        beyond the place, which is at c from the axis.
        """
        c = self.hub.radius + place
        start = 0.0
        beam = []
        for link in self.links:
            a = max(start, place) - place
            start += link.length
            L = start - place if a == 0 else link.length
            if L > 0:
                rotary = link.rhoI * L if self.theory in WITH_ROTARY_INERTIA else 0.0
                beam += [
                    link.rhoA * L**3 / 3,
                    rotary,
                    link.rhoA * L * a * (a + L),
                    link.rhoA * c * L * (a + L / 2),
                ]
        payload = self.payload.mass * (self.centre_distance * (self.centre_distance - c))
        attached = [
            each.mass * ((self.hub.radius + each.x) * (each.x - place)) + each.inertia for each in bodies
        ]
        return own + math.fsum(beam) + payload + self.payload.inertia + math.fsum(attached)

    @property
    def hub_side_inertia(self) -> float:
        """I_h + N^2 J_m [kg m^2], of hub and rotor."""
        return self.hub.inertia + self._drive.reflected_inertia

    @property
    def carried_inertia(self) -> float:
        """J - I_h - N^2 J_m [kg m^2], of link, payload and attachments."""
        return self.total_inertia - self.hub_side_inertia

    @property
    def reads_hub_moment(self) -> bool:
        """Whether the gauge measures the moment on the hub: it is at the root, r = 0, no inertia at the clamp."""
        at_clamp = any(
            each.x == 0 and (each.inertia or each.rotational_stiffness) for each in self.attachments
        )
        return not (self.hub.radius or self.gauge.x or at_clamp)

    @property
    def input_per_torque(self) -> float:
        """The input for a torque of 1 N m at the hub: 1, or a motor's current [A] or voltage [V]."""
        motor = self._drive
        at_one = {"motor_current": 1.0, "motor_voltage": motor.resistance}.get(self.input)
        if at_one:
            return at_one / (motor.gear_efficiency * motor.gear_ratio * motor.torque_constant)
        return 1.0

    @property
    def input_lags(self) -> bool:
        """Whether the input is the voltage of a motor with an inductance."""
        return self.input == "motor_voltage" and self._drive.inductance > 0

    @property
    def loses_at_hub_alone(self) -> bool:
        """Whether only friction of hub and rotor and the back-EMF dissipate."""
        return not any((self.damping, self.clamp.damping, self.joint.damping))

    @property
    def _turning_friction(self) -> float:
        """b + N^2 b_m [N m s/rad], of hub and rotor at the hub."""
        return self.hub.friction + self._drive.gear_ratio**2 * self._drive.rotor_friction

    @property
    def _back_emf(self) -> float:
        """N Ke [V s/rad] where a voltage is the input, else 0."""
        return self._drive.gear_ratio * self._drive.back_emf_constant * (self.input == "motor_voltage")

    @property
    def _drive(self) -> Motor:
        """The motor; without one an ideal one."""
        return self.motor or IDEAL_MOTOR

    @property
    def rate_loss(self) -> float:
        """The input for a rate of 1 rad/s: that for b + N^2 b_m and, of a voltage, N Ke for the back-EMF."""
        return self.input_per_torque * self._turning_friction + self._back_emf

    @property
    def turned_inertia(self) -> float:
        """J in units of the input [N m s^2, A s^2 or V s^2]; with an inductance plus L_a/R times the friction."""
        motor = self._drive
        lag = motor.inductance / motor.resistance * self._turning_friction if self.input_lags else 0.0
        return self.input_per_torque * (self.total_inertia + lag)

    @property
    def gauged_inertia(self) -> float:
        """-M(0)/theta_tt [kg m^2] of the rigid rig: J without hub and rotor where the clamp is on the axis."""
        if self.reads_hub_moment:
            return self.carried_inertia
        at = self.gauge.x
        return self._turned_about(at, [each for each in self.attachments if each.x > at or each.x == at > 0])

    # ------------------------------------------------------------ other arms

    def with_numbers(self, **numbers: float) -> Arm:
        """Return the arm with other values of numbers in `ADJUSTABLE`, in SI units.

        The damping is that of every segment.  A hub locked by an infinite inertia loses its friction, spring and motor.
        Raises ParameterError for an illegal value, and for a length of several segments.
        """
        arm = self
        for name, value in numbers.items():
            part, number = ADJUSTABLE[name]
            if name == "length":
                remedy = f"ambiguous, as there are {len(arm.links)} segments: change their [[link]] tables"
                require(not arm.outer, name, value, remedy)
            if name == "damping":
                arm = replace(arm, outer=tuple(replace(link, damping=value) for link in arm.outer))
            if name == "hub_inertia" and value == math.inf:
                idle = replace(arm.hub, friction=0.0, stiffness=0.0)
                driven: Input = "hub_angle" if arm.input == "hub_angle" else "hub_torque"
                arm = replace(arm, hub=idle, motor=None, input=driven)
            arm = replace(arm, **{part: replace(getattr(arm, part), **{number: value})})
        return arm

    having = FormerName("with_numbers")

    def under(self, theory: Theory) -> Arm:
        """Return the arm under another of `THEORIES`.  Raises ParameterError for an unknown one."""
        return replace(self, theory=theory)

    @property
    def elastic(self) -> Arm:
        """The arm with C = 0 in every segment."""
        return self if self.has_elastic_link else self.with_numbers(damping=0.0)

    @property
    def lossless(self) -> Arm:
        """The arm without dissipation."""
        clamp = replace(self.clamp, damping=0.0)
        joint = replace(self.joint, damping=0.0)
        return replace(self.elastic.lossless_hub, clamp=clamp, joint=joint)

    @property
    def lossless_hub(self) -> Arm:
        """The arm without friction of hub and rotor and without back-EMF, the parts of `rate_loss`."""
        motor = self.motor and replace(self.motor, rotor_friction=0.0, back_emf_constant=0.0)
        return replace(self, hub=replace(self.hub, friction=0.0), motor=motor)


# numbers of an arm by name: the part and the field that hold them
ADJUSTABLE = {
    "payload_mass": ("payload", "mass"),
    "payload_inertia": ("payload", "inertia"),
    "hub_inertia": ("hub", "inertia"),
    "length": ("link", "length"),
    "damping": ("link", "damping"),
}


def must_be_arm(arm: object) -> None:
    """Raise ParameterError for anything but an Arm."""
    if not isinstance(arm, Arm):
        name = str(arm) if isinstance(arm, str | os.PathLike) else "sasaki2012"
        raise ParameterError(key="arm", value=arm, remedy=f"is no Arm; give tfarm.load({short_text(name)})")


def must_have_free_hub(arm: Arm) -> None:
    """Raise ParameterError where the hub angle is the input, so that nothing can be fed back to the hub."""
    remedy = "a locked hub (inertia = inf) has no loop: give the hub a finite inertia"
    require(not math.isinf(arm.hub.inertia), "hub.inertia", arm.hub.inertia, remedy)
    remedy = "a hub whose angle is the input has no loop: take the torque of the hub, or a motor's input"
    require(not arm.is_locked, "input", arm.input, remedy)


def must_turn(arm: Arm) -> None:
    """Raise ParameterError, naming the infinite part or the spring, for an arm that cannot slew."""
    payload = arm.payload
    parts = (
        ("hub.inertia", arm.hub.inertia),
        ("payload.mass", payload.mass),
        ("payload.inertia", payload.inertia),
    )
    remedy = "an arm that cannot turn has no slew; give finite inertias"
    for key, value in parts:
        require(not math.isinf(value), key, value, remedy)
    remedy = "an arm with a spring to ground has no slew; leave the spring out"
    for key, value in arm._springs_to_ground():
        require(value <= 0.0, key, value, remedy)


def _parts(key: str, parts: Any, kind: type[_PartRecord], most: int) -> tuple[_PartRecord, ...]:
    """Return a tuple of at most `most` records of one kind.  Raises ParameterError for anything else."""
    is_list = isinstance(parts, list | tuple) and all(isinstance(part, kind) for part in parts)
    require(is_list, key, parts, f"give a tuple of {kind.__name__} records")
    require(len(parts) <= most, key, len(parts), f"at most {most}")
    return tuple(parts)
