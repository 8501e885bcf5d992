"""Slips of units are named; what engineers build is not."""

import math
import re
from dataclasses import replace

import pytest

import tfarm
from tfarm.arm import Attachment, Hub, Motor, Payload, RotarySpring, Section, implausible, load, presets

MATERIALS = {  # E [Pa], density [kg/m^3], Poisson's ratio: handbook values
    "steel": (2.1e11, 7850, 0.3),
    "aluminium": (7.0e10, 2700, 0.33),
    "CFRP": (1.4e11, 1600, 0.3),
    "titanium": (1.14e11, 4430, 0.34),
    "nylon": (2.8e9, 1150, 0.4),
    "rubber": (1.0e7, 1100, 0.49),
    "balsa": (3.0e9, 120, 0.3),
    "tungsten": (4.0e11, 19300, 0.28),
}


def beam(material, length=1.0, slenderness=50.0, damping=0.0):
    E, density, nu = MATERIALS[material]
    section = Section.rectangle(width=length / slenderness, depth=length / slenderness)
    return tfarm.Link.isotropic(
        length=length, density=density, youngs_modulus=E, poissons_ratio=nu, section=section, damping=damping
    )


@pytest.mark.parametrize("material", MATERIALS)
def test_what_is_built_is_plausible(material):
    """Five centimetres to ten metres, L/h 5 to 300, hubs and payloads up to a hundred times the beam, damping 2 %."""
    for length in (0.05, 1.0, 10.0):
        for slenderness in (5.0, 300.0):
            link = beam(material, length, slenderness)
            # w_1 of the cantilever of depth h: 3.516/L^2 sqrt(E h^2 / (12 rho))
            w = 3.516 / length**2 * math.sqrt(link.youngs_modulus / link.density / 12) * length / slenderness
            mass = link.rhoA * length
            arm = tfarm.Arm(
                link=replace(link, damping=2 * 0.02 / w),
                hub=Hub(inertia=100 * mass * length**2 / 3),
                payload=Payload(mass=100 * mass, inertia=mass * length**2),
            )
            assert implausible(arm) == ()


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"youngs_modulus": 210.0, "shear_modulus": 80.0}, "link.youngs_modulus = 210.0"),
        ({"youngs_modulus": 210.0, "shear_modulus": 80.0}, "link.shear_modulus = 80.0"),
        ({"length": 800.0}, "link.length = 800.0"),
        ({"density": 7.85}, "link.density = 7.85"),
        ({"density": 7.85e6}, "link.density = 7850000.0"),
        ({"damping": 0.02}, "link.damping = 0.02"),
        ({"section": Section.rectangle(width=0.06, depth=4.0)}, "link.section.depth is 4 m"),
        ({"section": Section.general(area=1e-3, second_moment=1e-3, shear_factor=0.8)}, "means a depth of 3.464 m"),
    ],
)
def test_a_slip_of_units_is_named(change, key):
    link = replace(beam("steel"), **change)
    texts = implausible(tfarm.Arm(link=link, hub=Hub(inertia=0.1)))
    assert [text for text in texts if key in text]
    assert not any("\n" in text for text in texts)


def test_the_damping_ratio_is_that_of_the_exact_clamped_link():
    """C w/2 by the formula against the exact eigenvalue of the arm with its hub locked."""
    arm = tfarm.Arm(link=beam("steel", slenderness=200.0, damping=0.02), hub=Hub(inertia=math.inf))
    (text,) = implausible(arm)
    named = float(re.search(r"ratio of ([\d.]+)", text)[1])
    exact = tfarm.damped_modes(tfarm.modes(arm, count=1)).damping_ratio[0]
    assert named == pytest.approx(exact, rel=0.05)  # two printed digits; shear and rotary inertia are 1e-4 at L/h = 200


def test_of_the_presets_only_the_misprint_is_named():
    found = {name: implausible(load(name)) for name in presets()}
    assert {name for name, texts in found.items() if texts} == {"sasaki2012-as-printed"}
    assert "density = 2.7667" in found["sasaki2012-as-printed"][0]


SLIPS = {  # of a rig that is plausible without them: a unit mistaken for another
    "hub.inertia = 50000000.0": {"hub": Hub(inertia=5e7)},
    "payload.inertia = 1000.0: a radius of gyration of 70.7 m": {"payload": Payload(mass=0.2, inertia=1e3)},
    "hub.radius = 30.0": {"hub": Hub(inertia=0.1, radius=30.0)},
    "payload.offset = 20.0": {"payload": Payload(mass=0.1, offset=20.0)},
    "clamp.stiffness = 2.0": {"clamp": RotarySpring(stiffness=2.0)},
    "hub.friction = 40000.0": {"hub": Hub(inertia=0.1, friction=4e4)},
    "motor.rotor_inertia = 120.0": {
        "motor": Motor(resistance=1.0, torque_constant=0.1, gear_ratio=100.0, rotor_inertia=120.0)
    },
    "attachment.2.mass = 5000000.0": {"attachments": (Attachment(x=0.1, mass=0.005), Attachment(x=0.2, mass=5e6))},
    "link.2.density = 2.7": {"outer": (replace(beam("aluminium"), density=2.7),)},
}


@pytest.mark.parametrize("key", SLIPS)
def test_a_slip_of_units_in_a_rig_is_named(key):
    change = SLIPS[key]
    plain = tfarm.Arm(link=beam("steel"), hub=Hub(inertia=0.1))
    text = next(text for text in implausible(replace(plain, **change)) if text.startswith(key))
    assert text.isprintable()
    assert implausible(plain) == ()


def test_a_short_segment_is_a_patch_and_no_slip():
    """It is the whole arm that is to be longer than deep, and that swings."""
    patch = replace(beam("steel"), length=0.005)
    assert implausible(tfarm.Arm(link=patch, outer=(beam("steel"),), hub=Hub(inertia=0.1))) == ()
