import math
import pickle
from dataclasses import FrozenInstanceError, replace
from fractions import Fraction

import numpy as np
import pytest

import tfarm
from tests.shared import refusal
from tfarm.arm import Arm, Hub, Link, Payload, Section
from tfarm.arm.checks import whole
from tfarm.errors import ParameterError

LINK = Link(
    length=2,
    density=3,
    youngs_modulus=26,
    shear_modulus=10,
    section=Section.general(area=0.5, second_moment=0.25, shear_factor=0.5),
)
ARM = Arm(link=LINK, hub=Hub(inertia=7), payload=Payload(mass=11, inertia=13))
STEEL = {"length": 1.0, "density": 7850.0, "youngs_modulus": 2.1e11, "section": Section.round(diameter=0.02)}


def test_stiffness_and_inertia_per_length():
    assert (LINK.EI, LINK.kGA, LINK.rhoA, LINK.rhoI) == (6.5, 2.5, 1.5, 0.75)
    assert LINK.poissons_ratio == pytest.approx(0.3, rel=1e-15)
    assert LINK.slenderness == pytest.approx(2 * math.sqrt(2), rel=1e-15)


def test_shear_cutoff_is_where_one_wave_number_vanishes():
    """The product of the squared wave numbers, s^2 rhoA/EI (1 + s^2 rhoI/kGA), is zero at s = i w."""
    w = ARM.shear_cutoff
    assert 1 - w**2 * LINK.rhoI / LINK.kGA == pytest.approx(0.0, abs=4e-16)


def test_poissons_ratio_gives_the_shear_modulus():
    link = Link.isotropic(**STEEL, poissons_ratio=0.3)
    assert link.shear_modulus == 2.1e11 / 2.6
    assert link.poissons_ratio == pytest.approx(0.3, abs=4e-16)
    assert Link.isotropic(**STEEL, poissons_ratio=0.5).shear_factor == pytest.approx(0.9, rel=4e-16)


def test_a_material_that_is_not_isotropic_needs_its_shear_factor():
    with pytest.raises(
        ParameterError, match=r"link\.shear_modulus = 5000000000\.0: .* ratio of 20, outside \(-1, 0\.5\]"
    ):
        Link(**STEEL, shear_modulus=5e9)
    with pytest.raises(ParameterError, match=r"link\.shear_modulus = 1e\+25: .* ratio of -1"):
        Link(**STEEL, shear_modulus=1e25)
    given = Section.round(diameter=0.02, shear_factor=0.9)
    assert Link(**{**STEEL, "section": given}, shear_modulus=5e9).shear_factor == 0.9


def test_records_are_frozen_hashable_and_survive_pickling():
    with pytest.raises(FrozenInstanceError):
        LINK.length = 3.0
    assert hash(ARM) == hash(replace(ARM))
    assert pickle.loads(pickle.dumps(ARM)) == ARM
    assert replace(ARM, hub=Hub(inertia=8)) != ARM


@pytest.mark.parametrize("two", [2, np.float64(2), np.float32(2), np.int64(2), Fraction(2)])
def test_every_real_number_becomes_a_float(two):
    link = replace(LINK, length=two)
    assert type(link.length) is float
    assert link == LINK


BAD_NUMBERS = {
    "nan": (math.nan, "nan"),
    "negative": (-1.0, "-1.0"),
    "zero": (0.0, "0.0"),
    "infinite": (math.inf, "inf"),
    "true": (True, "true"),
    "numpy true": (np.True_, "True"),
    "text": ("1.0", "'1.0'"),
    "nothing": (None, "None"),
    "complex": (1 + 0j, "(1+0j)"),
    "huge": (1e300, "1e+300"),
    "tiny": (5e-324, "5e-324"),
    "beyond a float": (10**400, "1000000"),
}


@pytest.mark.parametrize("kind", BAD_NUMBERS)
@pytest.mark.parametrize("name", ["length", "density", "youngs_modulus", "shear_modulus"])
def test_a_link_refuses_what_is_no_positive_number(name, kind):
    value, text = BAD_NUMBERS[kind]
    error = str(refusal(replace, LINK, **{name: value}))
    assert error.startswith(f"link.{name} = ")
    assert text in error


@pytest.mark.parametrize("nu", [0.7, 0.5000001, -1.0, -3, math.nan, math.inf, "0.3", True])
def test_poissons_ratio_lies_above_minus_one_up_to_a_half(nu):
    with pytest.raises(ParameterError, match=r"link\.poissons_ratio = .*above -1, up to 0\.5"):
        Link.isotropic(**STEEL, poissons_ratio=nu)


LIMITED = {  # of a number that may be 0: how a record has it, and what the refusal says
    r"link\.damping = ": lambda value: replace(LINK, damping=value),
    r"hub\.inertia = .*(locked|check the unit)": lambda value: Hub(inertia=value),
    r"payload\.mass = .*(tip pinned|check the unit)": lambda value: Payload(mass=value),
    r"payload\.inertia = .*(cannot rotate|check the unit)": lambda value: Payload(inertia=value),
}


@pytest.mark.parametrize("message", LIMITED)
@pytest.mark.parametrize("value", [-1e-4, math.nan, -math.inf, False, "0", 1e-300, 1e300])
def test_dampings_and_inertias_are_zero_or_positive(value, message):
    with pytest.raises(ParameterError, match=f"^{message}"):
        LIMITED[message](value)
    assert math.copysign(1.0, replace(LINK, damping=-0.0).damping) == 1.0
    with pytest.raises(ParameterError, match=r"^link\.damping = inf"):
        replace(LINK, damping=math.inf)


def test_nothing_that_is_accepted_overflows():
    for big in (1e-40, 1e40):
        section = Section.general(area=big, second_moment=big, shear_factor=1.0)
        link = Link(length=1.0, density=big, youngs_modulus=big, shear_modulus=big, section=section)
        arm = Arm(link=link, hub=Hub(inertia=big), payload=Payload(mass=big, inertia=big))
        for x in (link.EI, link.kGA, link.rhoA, link.rhoI, arm.total_inertia, arm.shear_cutoff):
            assert 0.0 < x < math.inf


@pytest.mark.parametrize("length", [1e-9, 1e20])
def test_a_plate_or_an_endless_thread_is_no_beam(length):
    with pytest.raises(ParameterError, match=r"^link\.length = .*radius of gyration is no beam"):
        replace(ARM, link=replace(LINK, length=length))


BAD_NAMES = ["", "../up", "a/b", "a\\b", ".hidden", "end.", "two\nlines", "\x1b[1m", "x" * 81, 3, "a:b"]


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_name_has_the_letters_of_a_folder_on_any_machine(name):
    with pytest.raises(ParameterError, match=r"^name = .*begins with a letter or digit"):
        replace(ARM, name=name)
    assert replace(ARM, name="Arm nº 2 (β)").name == "Arm nº 2 (β)"
    with pytest.raises(ParameterError, match=r"320 bytes; at most 200"):
        replace(ARM, name="\U0001d538" * 80)


@pytest.mark.parametrize("assumptions", ["one text", [3], ["\x1b[31m"], None])
def test_assumptions_are_plain_texts(assumptions):
    with pytest.raises(ParameterError, match=r"^assumptions = .*list of plain texts"):
        replace(ARM, assumptions=assumptions)


@pytest.mark.parametrize(("name", "value"), [("damping", 1e-4), ("length", 2.0), ("hub_inertia", 0.3)])
def test_an_arm_with_another_number_is_the_same_but_for_it(name: str, value: float) -> None:
    arm = tfarm.load("sasaki2012-lab")
    other = arm.with_numbers(**{name: value})
    assert getattr(other, name) == value
    assert other.with_numbers(**{name: getattr(arm, name)}) == arm
    assert arm.with_numbers(hub_inertia=0.3).hub == tfarm.Hub(inertia=0.3)
    assert arm.with_numbers(payload_mass=1.0, payload_inertia=0.2).payload == tfarm.Payload(mass=1.0, inertia=0.2)
    with pytest.raises(tfarm.ParameterError, match="length"):
        arm.with_numbers(length=-1.0)


@pytest.mark.parametrize("value", [True, 1.0, "2", None, 0, 8])
def test_a_number_that_is_not_whole_or_out_of_range_is_refused(value: object) -> None:
    with pytest.raises(ParameterError, match="from 1 to 7"):
        whole("n", value, 1, 7, "a whole number from 1 to 7")
