import math

import pytest

from tfarm.arm import load, presets


def test_the_presets_are_those_of_the_documentation():
    rigs, papers = ("quanser-2dsfl", "quanser-flexlink"), ("sasaki2012", "sasaki2012-as-printed", "sasaki2012-lab")
    assert presets() == (*rigs, *papers, "stocky-steel")
    assert [load(name).name for name in presets()] == list(presets())


@pytest.mark.parametrize("name", ["sasaki2012", "sasaki2012-as-printed", "sasaki2012-lab"])
def test_the_paper_s_arm_has_the_numbers_of_its_table_1(name):
    arm = load(name)
    link, section = arm.link, arm.link.section
    assert (link.length, section.area, link.youngs_modulus, link.shear_modulus) == (
        1.0,
        6e-4,
        6.8944e10,
        2.6517e10,
    )
    assert link.shear_factor == 5 / 6
    assert (arm.payload.mass, arm.payload.inertia) == (0.0, 0.0)
    assert link.density == (2.7667 if name.endswith("printed") else 2766.7)
    assert link.damping == (1e-4 if name.endswith("lab") else 0.0)


def test_what_the_paper_leaves_out_is_a_rectangle_of_its_area_and_a_stated_hub():
    arm = load("sasaki2012")
    assert arm.link.section.second_moment == pytest.approx(0.1 * 0.006**3 / 12, rel=1e-15)
    assert arm.link.section.area == pytest.approx(0.1 * 0.006, rel=1e-15)
    assert arm.hub.inertia == 0.1


def test_the_lab_arm_has_0_36_percent_of_critical_damping_in_its_first_mode():
    """zeta = C w / 2 at the first natural frequency, 71.505682466890 rad/s."""
    assert 100 * load("sasaki2012-lab").link.damping * 71.505682466890 / 2 == pytest.approx(0.36, abs=0.005)


def test_the_stocky_arm_is_a_fifth_as_deep_as_long_and_carries_a_steel_cube():
    arm = load("stocky-steel")
    dimensions = dict(arm.link.section.dimensions)
    assert dimensions["depth"] / arm.link.length == pytest.approx(0.2, rel=1e-15)
    assert arm.link.poissons_ratio == pytest.approx(0.3, rel=1e-14)
    assert arm.payload.mass == pytest.approx(7850 * 0.1**3, rel=1e-14)
    assert arm.payload.inertia == pytest.approx(arm.payload.mass * 0.1**2 / 6, rel=5e-3)


@pytest.mark.parametrize("name", presets())
def test_every_preset_states_what_is_assumed(name):
    text = " ".join(load(name).assumptions)
    for word in ("kg/m^3", "I_h", "hear factor", "C = ", "our"):
        assert word in text
    if name.startswith("sasaki"):
        for word in ("1.8e-9 m^4", "0.100 m", "0.006 m", "2.7667", "852780"):
            assert word in text


@pytest.mark.parametrize("name", presets())
def test_every_preset_can_turn(name):
    arm = load(name)
    assert arm.has_rigid_mode
    assert math.isfinite(arm.shear_cutoff)
