import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tfarm.arm import implausible, load, presets, to_toml
from tfarm.arm.schema import arm_of_table


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
