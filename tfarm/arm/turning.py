"""The parts of a rig, and what they are that turn as a rigid body, seen from the hub: inertias, input, friction."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, get_args

from tfarm.arm.link import Link
from tfarm.arm.rig import Attachment, Gauge, Hub, Motor, Payload, RotarySpring

Input = Literal["hub_torque", "motor_voltage", "motor_current", "hub_angle"]
INPUTS: tuple[Input, ...] = get_args(Input)
INPUT_UNITS = {"hub_torque": "N m", "motor_voltage": "V", "motor_current": "A", "hub_angle": "rad"}
Theory = Literal["timoshenko", "shear", "rayleigh", "euler-bernoulli"]  # of the beam
THEORIES: tuple[Theory, ...] = get_args(Theory)
WITH_ROTARY_INERTIA: tuple[Theory, ...] = ("timoshenko", "rayleigh")
WITH_SHEAR: tuple[Theory, ...] = ("timoshenko", "shear")


@dataclass(frozen=True, slots=True, kw_only=True)
class Turning:
    """The parts of an `Arm`, and its properties that are those of a rigid body on a motor."""

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
        """r + L [m], from the axis to the tip: a rigid arm turned by theta has moved its tip by (r + L) theta."""
        return self.hub.radius + self.length

    @property
    def centre_distance(self) -> float:
        """r + L + e [m], from the axis to the payload's centre of mass."""
        return self.reach + self.payload.offset

    @property
    def total_inertia(self) -> float:
        """J = I_h + N^2 J_m + sum of the segments and attachments + m (r + L + e)^2 + I_c [kg m^2], about the axis.

        A segment from a to a + L has rhoA (L^3/3 + a L (a + L)) + rhoI L, without rhoI where the theory has no rotary
        inertia.  inf where the hub or the payload says so.
        """
        beam = math.fsum(self._segment_inertias())
        payload = self.payload.mass * self.centre_distance**2
        attached = math.fsum(each.mass * (self.hub.radius + each.x) ** 2 + each.inertia for each in self.attachments)
        return self.hub_side_inertia + beam + payload + self.payload.inertia + attached

    def _segment_inertias(self) -> Iterator[float]:
        a = self.hub.radius
        for link in self.links:
            L = link.length
            rotary = link.rhoI * L if self.theory in WITH_ROTARY_INERTIA else 0.0
            yield link.rhoA * L**3 / 3 + rotary + link.rhoA * L * a * (a + L)
            a += L

    @property
    def hub_inertia(self) -> float:
        """I_h [kg m^2]."""
        return self.hub.inertia

    @property
    def hub_side_inertia(self) -> float:
        """I_h + N^2 J_m [kg m^2], of hub and rotor."""
        return self.hub.inertia + (self.motor.reflected_inertia if self.motor else 0.0)

    @property
    def carried_inertia(self) -> float:
        """J - I_h - N^2 J_m [kg m^2], of what the hub carries."""
        return self.total_inertia - self.hub_side_inertia

    @property
    def reads_hub_moment(self) -> bool:
        """Whether the gauge reads the moment that turns the hub: it is at the root, r = 0, no inertia at the clamp."""
        at_clamp = any(each.x == 0 and (each.inertia or each.rotational_stiffness) for each in self.attachments)
        return self.hub.radius == 0 and self.gauge.x == 0 and not at_clamp

    @property
    def input_per_torque(self) -> float:
        """What one N m of torque at the hub takes of the input: 1, or of a motor's current [A] or voltage [V]."""
        if self.motor is None or self.input not in ("motor_current", "motor_voltage"):
            return 1.0
        per_ampere = self.motor.gear_efficiency * self.motor.gear_ratio * self.motor.torque_constant
        return (self.motor.resistance if self.input == "motor_voltage" else 1.0) / per_ampere

    @property
    def input_lags(self) -> bool:
        """Whether the input is a voltage behind an inductance, whose torque comes late."""
        return self.input == "motor_voltage" and self.motor is not None and self.motor.inductance > 0

    @property
    def loses_at_hub_alone(self) -> bool:
        """Whether nothing but the hub's own friction, the rotor's and back-EMF dissipates."""
        return not any((*(link.damping for link in self.links), self.clamp.damping, self.joint.damping))

    @property
    def _turning_friction(self) -> float:
        """b + N^2 b_m [N m s/rad], of hub and rotor as the hub feels it."""
        return self.hub.friction + (self.motor.gear_ratio**2 * self.motor.rotor_friction if self.motor else 0.0)

    @property
    def rate_loss(self) -> float:
        """What the input must give for 1 rad/s: of N m for b + N^2 b_m, and of a voltage N Ke for the back-EMF too."""
        if self.motor is None:
            return self.hub.friction
        back_emf = self.motor.gear_ratio * self.motor.back_emf_constant if self.input == "motor_voltage" else 0.0
        return self.input_per_torque * self._turning_friction + back_emf

    @property
    def turned_inertia(self) -> float:
        """J in units of the input [N m s^2, A s^2 or V s^2]; with an inductance what friction adds through L_a/R."""
        lag = 0.0
        if self.motor is not None and self.input == "motor_voltage":
            lag = self.motor.inductance / self.motor.resistance * self._turning_friction
        return self.input_per_torque * (self.total_inertia + lag)

    @property
    def gauged_inertia(self) -> float:
        """-M(0)/theta_tt [kg m^2] of the slowly turning rig: J without hub and rotor where the clamp is on the axis."""
        if self.reads_hub_moment:
            return self.carried_inertia
        r, at = self.hub.radius, self.gauge.x
        total = self.payload.inertia + self.payload.mass * self.centre_distance * (self.centre_distance - r - at)
        beyond = [each for each in self.attachments if each.x > at or each.x == at > 0]
        total += math.fsum(each.mass * (r + each.x) * (each.x - at) + each.inertia for each in beyond)
        start = 0.0
        for link in self.links:
            a, b = max(start, at) - at, start + link.length - at  # from the gauge on
            start += link.length
            if b > a:
                rotary = link.rhoI * (b - a) if self.theory in WITH_ROTARY_INERTIA else 0.0
                total += link.rhoA * ((b**3 - a**3) / 3 + (r + at) * (b**2 - a**2) / 2) + rotary
        return total
