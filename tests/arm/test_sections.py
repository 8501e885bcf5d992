import math
from dataclasses import replace

import pytest
from scipy.integrate import quad

from tfarm.arm import Link, Section
from tfarm.errors import ParameterError

EPS = 2.0**-52


def chord(diameter, y):
    """The width [m] of a disc at height y [m]."""
    return 2 * math.sqrt(max((diameter / 2) ** 2 - y**2, 0.0))


SECTIONS = {
    "rectangle": (Section.rectangle(width=0.03, depth=0.08), 0.08, lambda y: 0.03),
    "round": (Section.round(diameter=0.05), 0.05, lambda y: chord(0.05, y)),
    "tube": (
        Section.tube(outer_diameter=0.06, inner_diameter=0.05),
        0.06,
        lambda y: chord(0.06, y) - chord(0.05, y),
    ),
}


@pytest.mark.parametrize("shape", SECTIONS)
def test_area_and_second_moment_are_integrals_over_the_section(shape):
    section, depth, width = SECTIONS[shape]

    def integral(power):
        # y = (depth/2) sin t takes the square roots out; the tube's inner radius is a breakpoint
        corner = math.asin(0.05 / 0.06)
        total, _ = quad(
            lambda t: (depth / 2 * math.sin(t)) ** power * width(depth / 2 * math.sin(t)) * depth / 2 * math.cos(t),
            -math.pi / 2,
            math.pi / 2,
            points=[-corner, corner],
            epsabs=0,
            epsrel=1e-12,
            limit=200,
        )
        return total

    assert section.area == pytest.approx(integral(0), rel=1e-11)
    assert section.second_moment == pytest.approx(integral(2), rel=1e-11)


def test_a_thin_tube_keeps_its_digits():
    """Wall t: A -> pi D t, I -> pi D^3 t/8, with relative corrections t/D and 3 t/D; no cancellation."""
    D, t = 1.0, 2.0**-30
    tube = Section.tube(outer_diameter=D, inner_diameter=D - 2 * t)
    assert tube.area == pytest.approx(math.pi * (D - t) * t, rel=4 * EPS)
    assert tube.second_moment == pytest.approx(math.pi * D**3 * t / 8 * (1 - 3 * t / D), rel=1e-15)


def kappa(section, nu):
    return section.cowper_factor(nu)


def test_cowper_s_factor_of_common_sections():
    """Fractions: 5/6, 6/7 and 9/10 are the textbook values of the rectangle and the round bar."""
    rectangle, disc = Section.rectangle(width=1, depth=2), Section.round(diameter=1)
    assert kappa(rectangle, 0.0) == pytest.approx(5 / 6, rel=EPS)
    assert kappa(disc, 0.0) == pytest.approx(6 / 7, rel=EPS)
    assert kappa(disc, 0.5) == pytest.approx(9 / 10, rel=EPS)


@pytest.mark.parametrize("nu", [-0.9, 0.0, 0.25, 0.5])
def test_a_tube_lies_between_the_solid_bar_and_the_thin_wall(nu):
    solid = kappa(Section.round(diameter=1), nu)
    assert kappa(Section.tube(outer_diameter=1, inner_diameter=1e-9), nu) == pytest.approx(solid, rel=4 * EPS)
    thin = kappa(Section.tube(outer_diameter=1, inner_diameter=1 - 1e-9), nu)
    assert thin == pytest.approx(2 * (1 + nu) / (4 + 3 * nu), rel=1e-15)
    assert thin < kappa(Section.tube(outer_diameter=1, inner_diameter=0.5), nu) < solid


def test_a_given_shear_factor_wins_over_cowper():
    section = Section.rectangle(width=0.1, depth=0.2, shear_factor=5 / 6)
    link = Link(length=2, density=7800, youngs_modulus=2.1e11, shear_modulus=8e10, section=section)
    assert link.shear_factor == 5 / 6
    assert replace(link, section=Section.rectangle(width=0.1, depth=0.2)).shear_factor == kappa(section, 0.3125)


BAD = {
    "zero width": (lambda: Section.rectangle(width=0, depth=1), "link.section.width = 0", "positive, finite"),
    "negative depth": (lambda: Section.rectangle(width=1, depth=-2.0), "link.section.depth = -2.0", "metres"),
    "nan diameter": (lambda: Section.round(diameter=math.nan), "link.section.diameter = nan", "nan is none"),
    "infinite diameter": (lambda: Section.round(diameter=math.inf), "diameter = inf", "finite"),
    "bool": (lambda: Section.round(diameter=True), "link.section.diameter = true", "plain number"),
    "text": (lambda: Section.round(diameter="0.1"), "link.section.diameter = '0.1'", "plain number"),
    "solid tube": (
        lambda: Section.tube(outer_diameter=0.1, inner_diameter=0.1),
        "link.section.inner_diameter = 0.1",
        "less than its outer diameter, 0.1 m",
    ),
    "no area": (
        lambda: Section.general(area=0, second_moment=1e-9, shear_factor=0.8),
        "link.section.area = 0",
        "positive, finite area in m^2",
    ),
    "no second moment": (
        lambda: Section.general(area=1e-4, second_moment=-1e-9, shear_factor=0.8),
        "link.section.second_moment = -1e-09",
        "second moment in m^4",
    ),
    "no shear factor": (
        lambda: Section(shape="general", area=1e-4, second_moment=1e-9),
        "link.section.shear_factor is missing",
        "0.8333",
    ),
    "form factor": (
        lambda: Section.rectangle(width=1, depth=1, shear_factor=1.2),
        "link.section.shear_factor = 1.2",
        "6/5 is entered as 5/6",
    ),
    "zero shear factor": (
        lambda: Section.rectangle(width=1, depth=1, shear_factor=0.0),
        "link.section.shear_factor = 0.0",
        "above 0, up to 1",
    ),
    "unknown shape": (
        lambda: Section(shape="rond", area=1, second_moment=1),
        "link.section.shape = 'rond'",
        'did you mean "round"?',
    ),
    "no dimensions": (
        lambda: Section(shape="tube", area=1, second_moment=1),
        "link.section.dimensions = ()",
        "outer_diameter and inner_diameter",
    ),
    "an area of another section": (
        lambda: replace(Section.round(diameter=0.1), area=1.0),
        "link.section.area = 1.0",
        "Section.general()",
    ),
    "an atom": (lambda: Section.round(diameter=1e-12), "second_moment", "check the unit"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_section_is_refused_in_words_of_physics(case):
    build, what, remedy = BAD[case]
    with pytest.raises(ParameterError) as caught:
        build()
    assert what in str(caught.value)
    assert remedy in str(caught.value)
