"""Slips of units are named; what engineers build is not, and the presets are what their makers print."""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tfarm.arm import Attachment, Hub, Motor, Payload, RotarySpring, Section, implausible, load, presets, to_toml
from tfarm.arm.schema import arm_of_table

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


def test_the_presets_are_those_of_the_documentation():
    rigs, papers = ("quanser-2dsfl", "quanser-flexlink"), ("sasaki2012", "sasaki2012-as-printed", "sasaki2012-lab")
    assert presets() == (*rigs, *papers, "stocky-steel")


@pytest.mark.parametrize("name", ["sasaki2012", "sasaki2012-as-printed", "sasaki2012-lab"])
def test_the_paper_s_arm_has_the_numbers_of_its_table_1(name):
    arm = load(name)
    link, section = arm.link, arm.link.section
    assert (link.length, section.area, link.youngs_modulus, link.shear_modulus) == (1.0, 6e-4, 6.8944e10, 2.6517e10)
    assert link.shear_factor == 5 / 6
    assert (arm.payload.mass, arm.payload.inertia) == (0.0, 0.0)
    assert link.density == (2.7667 if name.endswith("printed") else 2766.7)
    assert link.damping == (1e-4 if name.endswith("lab") else 0.0)


RIGS: dict[str, str | Path] = {path.stem: path for path in sorted((Path(__file__).parents[1] / "rigs").glob("*.toml"))}
RIGS |= {name: name for name in presets() if not load(name).is_uniform}


@pytest.mark.parametrize("name", RIGS | dict.fromkeys(presets()))
def test_an_arm_states_what_is_assumed(name):
    arm = load(RIGS.get(name, name))
    assert arm.name == name
    assert arm.has_rigid_mode
    assert arm_of_table(tomllib.loads(to_toml(arm))) == arm
    wanted = ["kg/m^3", "I_h", "hear factor", "C = ", "our"]
    if name in RIGS:
        assert implausible(arm) == ()
    elif name.startswith("sasaki"):
        wanted += ["1.8e-9 m^4", "0.100 m", "0.006 m", "2.7667", "852780"]
    text = " ".join(arm.assumptions)
    assert [word for word in wanted if word not in text] == []


def test_the_numbers_of_quanser_2dsfl_are_its_maker_s():
    """config_2dslf.m: 0.0635 kg m^2 at the hub, 8.925 N m/A at the joint, 40.0 N m/rad, 2.44 Hz with the hub held."""
    arm = load(RIGS["quanser-2dsfl"])
    assert arm.hub_side_inertia == pytest.approx(0.0635, abs=5e-5)
    motor = arm.motor
    assert motor.gear_efficiency * motor.gear_ratio * motor.torque_constant == pytest.approx(8.925, rel=1e-15)
    assert motor.back_emf_constant == 0.119
    load_inertia = arm.payload.mass * arm.centre_distance**2 + arm.payload.inertia
    assert load_inertia == pytest.approx(0.17043, abs=5e-6)
    lumped = 3 * arm.link.EI / arm.length  # the maker's E w T^3/(4 L)
    assert lumped == pytest.approx(40.0, abs=0.05)
    assert math.sqrt(lumped / load_inertia) / (2 * math.pi) == pytest.approx(2.44, abs=0.005)


def test_quanser_2dsfl_rings_as_it_was_measured_with_its_hub_at_rest():
    """A massless Euler-Bernoulli cantilever with the load as a rigid body off its tip, against 20 runs: 1.79-1.86 Hz.

    Stiffness at the tip for (W, Psi): EI/L^3 (12, -6 L; -6 L, 4 L^2); mass (m, m e; m e, I_c + m e^2).
    """
    arm = load(RIGS["quanser-2dsfl"])
    L, m, e, I_c = arm.length, arm.payload.mass, arm.payload.offset, arm.payload.inertia
    stiffness = arm.link.EI / L**3 * np.array([[12, -6 * L], [-6 * L, 4 * L**2]])
    mass = np.array([[m, m * e], [m * e, I_c + m * e**2]])
    lowest = min(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    assert 1.79 < math.sqrt(lowest) / (2 * math.pi) < 1.86


def test_the_numbers_of_quanser_flexlink_are_its_laboratory_s():
    """AE 4610, table 2: 0.065 kg, I = 9.32e-13 m^4; J_eq = 0.00208 kg m^2 without the module's 2.0e-4."""
    arm = load(RIGS["quanser-flexlink"])
    assert arm.own_mass == pytest.approx(0.065, rel=1e-4)
    assert arm.link.section.second_moment == pytest.approx(9.32e-13, rel=1e-3)
    assert arm.hub_side_inertia - 2.0e-4 == pytest.approx(0.00208, abs=5e-6)
    assert arm.motor.gear_efficiency == pytest.approx(0.9 * 0.69, rel=1e-15)
