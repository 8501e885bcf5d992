"""The same rig in other units of mass, length and time: dimensional analysis is a second method for every answer.

Units that are powers of two change no digit, so that whatever compares a quantity with a plain number shows.
"""

from dataclasses import dataclass, fields, replace

from tfarm import Arm, HubFeedback, Law, Section
from tfarm.arm import Attachment, Hub, Link, Motor, Payload, RotarySpring

INERTIA, TORQUE, RATE, FORCE = (1, 2, 0), (1, 2, -2), (1, 2, -1), (1, 1, -2)
MASS, LENGTH, TIME, NONE = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)
POWER, FREQUENCY = (1, 2, -3), (0, 0, -1)
DIMENSIONS = {  # exponents of mass, length and time; currents keep their unit, so a voltage is a power
    Link: {"length": LENGTH, "density": (1, -3, 0), "youngs_modulus": (1, -1, -2), "shear_modulus": (1, -1, -2),
           "damping": TIME},
    Hub: {"inertia": INERTIA, "friction": RATE, "radius": LENGTH, "stiffness": TORQUE},
    RotarySpring: {"stiffness": TORQUE, "damping": TIME},
    Motor: {"resistance": POWER, "torque_constant": TORQUE, "back_emf_constant": TORQUE, "inductance": TORQUE,
            "gear_ratio": NONE, "rotor_inertia": INERTIA, "rotor_friction": RATE, "gear_efficiency": NONE},
    Attachment: {"x": LENGTH, "mass": MASS, "inertia": INERTIA, "stiffness": (1, 0, -2),
                 "rotational_stiffness": TORQUE},
    Payload: {"mass": MASS, "inertia": INERTIA, "offset": LENGTH},
}  # fmt: skip
INPUTS = {"hub_torque": TORQUE, "motor_current": NONE, "motor_voltage": POWER, "hub_angle": NONE}
OUTPUTS = {"hub_angle": NONE, "hub_rate": FREQUENCY, "root_moment": TORQUE, "tip_displacement": LENGTH}


@dataclass(frozen=True)
class Units:
    """What a quantity is multiplied by, in units that make numbers of mass, length and time these times as large."""

    mass: float
    length: float
    time: float

    def of(self, dimension):
        M, L, T = dimension
        return self.mass**M * self.length**L * self.time**T

    def arm(self, arm: Arm) -> Arm:
        """The arm in these units."""
        return replace(
            arm,
            link=self._link(arm.link),
            outer=tuple(self._link(each) for each in arm.outer),
            attachments=tuple(self._part(each) for each in arm.attachments),
            gauge=replace(arm.gauge, x=arm.gauge.x * self.length),
            motor=arm.motor and self._part(arm.motor),
            **{name: self._part(getattr(arm, name)) for name in ("hub", "payload", "clamp", "joint")},
        )

    def law(self, arm: Arm, law):
        """Gains at the hub, or a law in s made of pairs (num, den) by its signals, in these units."""
        drive = self.of(INPUTS[arm.input])
        if isinstance(law, HubFeedback):
            return HubFeedback(K1=law.K1 * drive * self.time, K2=law.K2 * drive / self.of(TORQUE), Kp=law.Kp * drive)
        return Law({name: self._entry(*pair, drive / self.of(OUTPUTS[name])) for name, pair in law.items()})

    def _entry(self, num, den, gain):
        return self._polynomial(num, gain), self._polynomial(den, 1.0)

    def _polynomial(self, coefficients, size):
        """Coefficients in s, the highest first."""
        degree = len(coefficients) - 1
        return [each * size * self.time ** (degree - n) for n, each in enumerate(coefficients)]

    def _part(self, part):
        own = DIMENSIONS[type(part)]
        assert {each.name for each in fields(part)} - {"section", "stated_ratio"} == set(own)
        return replace(part, **{name: getattr(part, name) * self.of(dimension) for name, dimension in own.items()})

    def _link(self, link):
        old = link.section
        area, second_moment = old.area * self.length**2, old.second_moment * self.length**4
        section = Section.general(area=area, second_moment=second_moment, shear_factor=link.shear_factor)
        return replace(self._part(link), section=section)


SLOW, FAST = Units(2.0**7, 2.0**-4, 2.0**12), Units(2.0**-5, 2.0**3, 2.0**-10)
EITHER = {"slow": SLOW, "fast": FAST}
