"""Rigs and Laplace variables drawn at random by a NumPy generator: whatever a rig can have, alone and together."""

import math
from dataclasses import replace

import numpy as np

import tfarm
from tests.chain_elements import reached
from tfarm import Arm, Hub, Link, Payload, Section
from tfarm.arm import Attachment, Motor, RotarySpring

MOST_SEGMENTS = 6
CONTRAST = 1e4  # of EI and of rhoA between neighbours, at most
SLENDERNESS = (5, 500)  # length over depth of each segment, as of a rectangle


def some_rig(rng, *, damped=None, segments=None, theory="timoshenko", drive=None):
    """A rig of 1 to 6 segments with any of hub radius, springs, friction, motor, attachments and offset payload.

    `damped` False leaves out everything that dissipates, None draws it; `segments` and `drive` (the input) are drawn
    unless given.
    """
    links = _links(rng, segments or int(rng.integers(1, MOST_SEGMENTS + 1)))
    damped = bool(rng.random() < 0.6) if damped is None else damped
    scale = _Scale(links)
    if damped and rng.random() < 0.8:
        C = [_maybe(rng, 0.7, _log(rng, 1e-5, 0.1)) / scale.rate for _ in links]
        links = [replace(link, damping=each) for link, each in zip(links, C, strict=True)]
    locked = bool(rng.random() < 0.1)
    motor = None if locked else _motor(rng, scale, damped)
    return Arm(
        link=links[0],
        outer=tuple(links[1:]),
        hub=_hub(rng, scale, locked, damped),
        payload=_payload(rng, scale),
        clamp=_spring(rng, scale.EI[0] / links[0].length, scale, damped),
        joint=_spring(rng, scale.EI[0] / links[0].length, scale, damped),
        motor=motor,
        attachments=tuple(_attachment(rng, scale) for _ in range(rng.integers(0, 4))),
        theory=theory,
        input=drive or _input(rng, motor, damped),
        name="some rig",
    )


def some_point(rng, arm):
    """i w, or s off the axis in either half plane, from a hundredth of the first frequency to some twentieth."""
    size = reached(arm, 10 ** rng.uniform(-1, math.log10(20)))
    if rng.random() < 0.6:
        return complex(0.0, size)
    return complex(size * np.exp(1j * rng.uniform(0, math.pi)))


class _Scale:
    """What the parts of a rig are measured in: its length, its mass, stiffness and a first frequency."""

    def __init__(self, links):
        self.joints = np.cumsum([0.0, *(link.length for link in links)])
        self.length = math.fsum(link.length for link in links)
        self.mass = sum(link.rhoA * link.length for link in links)
        self.EI = [link.EI for link in links]
        softest = sum(link.length**3 / link.EI for link in links)  # a flexibility, of the order of the arm's
        self.rate = 1 / math.sqrt(self.mass * softest)
        self.inertia = self.mass * self.length**2


def _links(rng, count):
    """Segments whose EI and rhoA lie within the root of `CONTRAST` of a middle one's, lengths within a factor of 5."""
    EI, rhoA, length = _log(rng, 1e-1, 1e3), _log(rng, 1e-2, 1e1), _log(rng, 0.05, 2)
    root = math.sqrt(CONTRAST)
    links = []
    for _ in range(count):
        own = length * _log(rng, 0.2, 5)
        gyration = own / _log(rng, *SLENDERNESS) / math.sqrt(12)
        area = 1e-4  # m^2; which one does not matter
        links.append(
            Link.isotropic(
                length=own,
                density=rhoA * _log(rng, 1 / root, root) / area,
                youngs_modulus=EI * _log(rng, 1 / root, root) / (area * gyration**2),
                poissons_ratio=float(rng.uniform(0, 0.49)),
                section=Section.general(area=area, second_moment=area * gyration**2, shear_factor=5 / 6),
            )
        )
    return links


def _hub(rng, scale, locked, damped):
    radius = _maybe(rng, 0.6, scale.length * _log(rng, 1e-3, 2))
    if locked:
        return Hub(inertia=math.inf, radius=radius)
    return Hub(
        inertia=_maybe(rng, 0.9, scale.inertia * _log(rng, 1e-4, 1e3)),
        radius=radius,
        friction=_maybe(rng, 0.5 * damped, scale.inertia * scale.rate * _log(rng, 1e-4, 1e2)),
        stiffness=_maybe(rng, 0.2, scale.inertia * scale.rate**2 * _log(rng, 1e-3, 1e3)),
    )


def _payload(rng, scale):
    mass = _maybe(rng, 0.6, scale.mass * _log(rng, 1e-2, 1e2))
    inertia = _maybe(rng, 0.5, scale.inertia * _log(rng, 1e-5, 1))
    offset = scale.length * _log(rng, 1e-3, 0.5) * float(rng.choice([-1, 1]))
    if rng.random() < 0.1:
        mass = math.inf
    return Payload(
        mass=mass,
        inertia=math.inf if rng.random() < 0.1 else inertia,
        offset=_maybe(rng, 0.6, offset) if mass > 0 else 0.0,
    )


def _spring(rng, stiffness, scale, damped):
    if rng.random() < 0.5:
        return RotarySpring()
    damping = _maybe(rng, 0.5 * damped, _log(rng, 1e-5, 0.1) / scale.rate)
    return RotarySpring(stiffness=stiffness * _log(rng, 1e-2, 1e4), damping=damping)


def _motor(rng, scale, damped):
    """A motor whose back-EMF damps the hub within some powers of ten of what the arm's inertia calls for."""
    if rng.random() < 0.5:
        return None
    N, R = _log(rng, 1, 200), _log(rng, 0.1, 20)
    friction = scale.inertia * scale.rate / N**2
    constant = math.sqrt(R * friction * _log(rng, 1e-3, 1e2))
    return Motor(
        resistance=R,
        torque_constant=constant,
        back_emf_constant=constant * _log(rng, 0.5, 2) if rng.random() < 0.3 else None,
        inductance=_maybe(rng, 0.5, R / scale.rate * _log(rng, 1e-4, 1e1)),
        gear_ratio=N,
        rotor_inertia=_maybe(rng, 0.8, scale.inertia / N**2 * _log(rng, 1e-4, 1e1)),
        rotor_friction=_maybe(rng, 0.5 * damped, friction * _log(rng, 1e-4, 1e1)),
        gear_efficiency=float(rng.choice([1.0, rng.uniform(0.3, 1.0)])),
    )


def _attachment(rng, scale):
    """Anywhere on the link, at the joint of two segments, at the clamp or at the tip."""
    x = float(rng.choice([rng.uniform(0, scale.length), rng.choice(scale.joints)], p=(0.7, 0.3)))
    mass = scale.mass * _log(rng, 1e-4, 10)
    return Attachment(
        x=min(x, scale.length),
        mass=mass,
        inertia=_maybe(rng, 0.5, mass * scale.length**2 * _log(rng, 1e-6, 1e-1)),
        stiffness=_maybe(rng, 0.2, scale.mass * scale.rate**2 * _log(rng, 1e-3, 1e4)),
        rotational_stiffness=_maybe(rng, 0.2, scale.inertia * scale.rate**2 * _log(rng, 1e-3, 1e2)),
    )


def _input(rng, motor, damped):
    """An undamped rig is not driven by a voltage, whose back-EMF would damp it."""
    inputs = ["hub_torque", "hub_torque", "hub_angle"]
    if motor is not None:
        inputs += ["motor_current"] + ["motor_voltage"] * 2 * damped
    return str(rng.choice(inputs))


def _maybe(rng, chance, value):
    return value if rng.random() < chance else 0.0


def _log(rng, low, high):
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def _link(length, depth, damping=0.0, E=7e10):
    section = Section.rectangle(width=0.04, depth=depth)
    return Link.isotropic(
        length=length, density=2700.0, youngs_modulus=E, poissons_ratio=0.33, section=section, damping=damping
    )


def rig(**changes):
    """Three segments with everything that a rig can have, lengths and places of few bits."""
    arm = tfarm.load("sasaki2012")
    rig = replace(
        arm,
        link=_link(0.25, 0.005, 1e-4),
        outer=(_link(0.5, 0.003, 2e-4), _link(0.25, 0.02)),
        hub=replace(arm.hub, radius=0.0625, friction=0.1, stiffness=0.5),
        payload=replace(arm.payload, mass=0.2, inertia=1e-3, offset=0.03125),
        clamp=RotarySpring(stiffness=300.0, damping=1e-3),
        joint=RotarySpring(stiffness=200.0, damping=2e-3),
        motor=Motor(
            resistance=2.0,
            torque_constant=0.05,
            back_emf_constant=0.06,
            inductance=0.01,
            gear_ratio=14.0,
            rotor_inertia=1e-5,
            rotor_friction=1e-6,
            gear_efficiency=0.9,
        ),
        attachments=(
            Attachment(x=0.125, mass=0.03, inertia=1e-5),
            Attachment(x=0.25, mass=0.1, inertia=1e-4, stiffness=100.0, rotational_stiffness=2.0),
        ),
    )
    return replace(rig, **changes)


def lossless(arm):
    """The rig with nothing that dissipates."""
    motor = None if arm.motor is None else replace(arm.motor, rotor_friction=0.0)
    springs = {name: RotarySpring(stiffness=getattr(arm, name).stiffness) for name in ("clamp", "joint")}
    links = [replace(link, damping=0.0) for link in arm.links]
    drive = "hub_angle" if arm.input == "hub_angle" else "hub_torque"
    hub = replace(arm.hub, friction=0.0)
    return replace(arm, link=links[0], outer=tuple(links[1:]), hub=hub, motor=motor, input=drive, **springs)
