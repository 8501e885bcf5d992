"""Materials of a link: numbers with sources, isotropy, files that name one or several, and what they refuse."""

import re
import tomllib

import pytest

from tests.shared import refusal
from tfarm.arm import Section, load, to_toml
from tfarm.arm.materials import materials
from tfarm.arm.schema import arm_of_table
from tfarm.errors import ParameterError
from tfarm.fitting.assumptions import is_named

METALS = ("steel", "spring steel", "aluminium 6061", "titanium 6Al-4V", "brass")
LAMINATES = ("CFRP UD 0", "GFRP")
PRINTED = ("PLA", "ABS")
HANDBOOK = {  # kg/m^3, GPa, GPa: least and largest values of E, and G, in handbooks
    "steel": (7850, (200, 215), (77, 83)), "spring steel": (7850, (200, 210), (78, 82)),
    "aluminium 6061": (2700, (68, 70), (25, 26.5)), "titanium 6Al-4V": (4430, (105, 120), (41, 45)),
    "brass": (8440, (97, 115), (37, 42)), "CFRP UD 0": (1600, (120, 182), (4, 7.5)), "GFRP": (1800, (35, 45), (3.5, 5)),
    "PLA": (1240, (2, 4), (0.7, 1.5)), "ABS": (1040, (1.5, 2.9), (0.5, 1.1)),
}  # fmt: skip
ARM = """
name = "m"
[link]
length = 0.5
{}
section = {{ shape = "rectangle", width = 0.03, depth = 0.003 }}
[hub]
inertia = 0.01
"""


def arm_with(*lines, text=ARM):
    return arm_of_table(tomllib.loads(text.format("\n".join(lines))))


def test_the_library_has_the_usual_materials_each_with_a_dated_source_and_a_range():
    assert (*METALS, *LAMINATES, *PRINTED) == tuple(materials())
    for each in materials().values():
        assert re.search(r"\b(19|20)\d\d\b", each.source), each.name
        assert "E " in each.range


@pytest.mark.parametrize("name", HANDBOOK)
def test_numbers_of_a_material_are_within_those_of_handbooks(name):
    """Of an isotropic one E = 2 G (1 + nu), with nu of 0.26 to 0.35 of metals and up to 0.4 of polymers."""
    link, nu = arm_with(f'material = "{name}"').link, materials()[name].poissons_ratio
    density, E, G = HANDBOOK[name]
    assert link.density == pytest.approx(density, rel=0.025)
    assert E[0] <= link.youngs_modulus / 1e9 <= E[1]
    assert G[0] <= link.shear_modulus / 1e9 <= G[1]
    if name not in LAMINATES:
        assert link.youngs_modulus == pytest.approx(2 * link.shear_modulus * (1 + nu), rel=1e-15)
        assert 0.26 <= nu <= (0.35 if name in METALS else 0.4)


@pytest.mark.parametrize("name", LAMINATES)
def test_laminates_have_reissners_shear_factor_unless_one_is_given(name):
    """5/6 of a rectangle; Cowper's is not defined, as E/(2 G) - 1 is far above 0.5."""
    link = arm_with(f'material = "{name}"').link
    assert link.poissons_ratio > 3
    assert link.section.shear_factor == pytest.approx(5 / 6, rel=1e-15)
    own = ARM.replace("0.003 }}", "0.003, shear_factor = 0.7 }}")
    assert arm_with(f'material = "{name}"', text=own).link.section.shear_factor == 0.7
    with pytest.raises(ParameterError, match=r"link\.poissons_ratio = 0\.28: .* not isotropic.* give shear_modulus"):
        arm_with(f'material = "{name}"', "poissons_ratio = 0.28")


def test_each_key_of_the_file_replaces_the_number_of_the_material():
    assert arm_with('material = "steel"', "density = 7900.0").link.density == 7900.0
    softer = arm_with('material = "steel"', "youngs_modulus = 2.0e11").link
    assert (softer.youngs_modulus, softer.density) == (2e11, 7850.0)
    assert softer.shear_modulus == pytest.approx(2e11 / 2.6, rel=1e-15)
    assert arm_with('material = "steel"', "shear_modulus = 8.1e10").link.shear_modulus == 8.1e10
    assert arm_with('material = "steel"', "poissons_ratio = 0.25").link.shear_modulus == 2.1e11 / 2.5
    assert arm_with('material = "CFRP UD 0"', "shear_modulus = 5e9").link.shear_modulus == 5e9


def test_the_assumptions_have_the_numbers_that_were_taken_with_their_source():
    (text,) = arm_with('material = "steel"').assumptions
    assert text.startswith("material steel: ρ = 7850 kg/m^3, E = 210 GPa, ν = 0.3 (EN 1993-1-1:2005")
    (text,) = arm_with('material = "steel"', "youngs_modulus = 2.0e11", "shear_modulus = 8.0e10").assumptions
    assert text.startswith("material steel: ρ = 7850 kg/m^3 (")
    whole = ("density = 1.0e3", "youngs_modulus = 2.0e11", "shear_modulus = 8.0e10")
    assert arm_with('material = "steel"', *whole).assumptions == ()


def test_a_fit_marks_the_numbers_of_a_material_that_it_frees():
    """Its assumptions name a number by the symbol of its label."""
    (text,) = arm_with('material = "steel"').assumptions
    numbers = {"youngs_modulus": 2.1e11, "density": 7850.0, "poissons_ratio": 0.3, "length": 0.5}
    assert [name for name, value in numbers.items() if is_named(f"link.{name}", value, text)] == [*numbers][:3]


def test_segments_of_two_materials_have_a_line_each_and_the_arm_is_written_and_read_back(tmp_path):
    sections = {"GFRP": 'shape = "round", diameter = 0.01',
                "brass": 'shape = "tube", outer_diameter = 0.012, inner_diameter = 0.01'}  # fmt: skip
    text = 'name = "m"\nassumptions = ["mine"]\n'
    for name, section in [*sections.items()] * 2:
        text += f'[[link]]\nlength = 0.2\nmaterial = "{name}"\nsection = {{ {section} }}\n'
    arm = arm_of_table(tomllib.loads(text + "[hub]\ninertia = 0.01\n"))
    assert [each[:14] for each in arm.assumptions] == ["mine", "material GFRP:", "material brass"]
    assert arm.links[0].section.shear_factor == pytest.approx(6 / 7, rel=1e-15)
    assert arm.links[1].section == Section.tube(outer_diameter=0.012, inner_diameter=0.01)
    (tmp_path / "m.toml").write_text(to_toml(arm))
    assert load(tmp_path / "m.toml") == arm


def test_an_unknown_material_is_refused_in_one_line_with_the_known_ones():
    assert str(refusal(arm_with, 'material = "steal"')) == (
        "link.material = 'steal': did you mean \"steel\"? known are: steel, spring steel, aluminium 6061, "
        "titanium 6Al-4V, brass, CFRP UD 0, GFRP, PLA, ABS"
    )
    with pytest.raises(ParameterError, match=r"link\.material = 3: wrong type; "):
        arm_with("material = 3")
    with pytest.raises(ParameterError, match=r"link\.density is missing: give a number without quotes"):
        arm_with("youngs_modulus = 2.0e11", "poissons_ratio = 0.3")
