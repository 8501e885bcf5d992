"""The modal table: rows and columns, the same numbers by other methods, and its notes."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tests.spectrum.independent import pinned, sine_waves
from tfarm.arm import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR
from tfarm.errors import ParameterError
from tfarm.schema import table
from tfarm.spectrum.listing import beyond_the_box, listed_modes
from tfarm.spectrum.table import hub_locked, modes_below

EPS = 2.0**-52
LAB, STEEL = tfarm.load("sasaki2012-lab"), tfarm.load("stocky-steel")
RUBBED = replace(LAB, name="rubbed", hub=replace(LAB.hub, friction=0.4))
PINNED = replace(STEEL, hub=tfarm.Hub(inertia=0.0), payload=tfarm.Payload(mass=math.inf))


@pytest.mark.parametrize("arm", [LAB, STEEL, PINNED, LAB.with_numbers(hub_inertia=math.inf)])
def test_every_row_is_of_its_mode(arm):
    """The column of the locked hub too: of a rigid body there is none, of flexible mode n it is number n."""
    found = tfarm.modes(arm, 3)
    listed = listed_modes(found)
    still = hub_locked(found).natural_frequency[-3:].tolist()
    assert [row.hub_locked for row in listed.modes] == [None] * arm.has_rigid_mode + still
    np.testing.assert_array_equal([row.natural_frequency_hz for row in listed.modes], found.natural_frequency_hz)
    np.testing.assert_allclose(2 * math.pi * found.natural_frequency_hz, found.natural_frequency, rtol=4 * EPS)
    assert listed.count == 3
    ends = found.natural_frequency[[-3, -1]]
    assert found.finding == "3 flexible, {:.6g} to {:.6g} rad/s".format(*ends)
    keys = [column.key for column in table(listed.modes).columns]
    assert ("eigenvalue" in keys) == (not arm.is_undamped)
    assert "hub_locked_rad_s" in keys


@pytest.mark.parametrize("digits", [14, 15, 16, 30])
def test_digits_beyond_a_double_are_strings_of_them(digits):
    """Of both columns, the hub's free and locked, and each within a last unit of the float64."""
    table = tfarm.modes(STEEL, 3)
    answer = listed_modes(table, digits, certify=True)
    assert answer.digits == digits
    for key, values in (
        ("natural_frequency", table.natural_frequency),
        ("hub_locked", hub_locked(table).natural_frequency),
    ):
        own = [getattr(row, key) for row in answer.modes][-3:]
        assert all(isinstance(each, str) == (digits > 15) for each in own)
        np.testing.assert_allclose([float(each) for each in own], values[-3:], rtol=4 * EPS)
        assert digits <= 15 or all(len(each.replace(".", "")) == digits for each in own)
    for row, omega in zip(answer.modes, table.natural_frequency, strict=True):
        low, high = row.lower, row.upper
        assert low is None if omega == 0 else float(low) * (1 - 2 * EPS) <= omega <= float(high) * (1 + 2 * EPS)
    assert answer.proof.count == len(table)


def test_every_method_has_the_same_frequencies():
    """Balls and the appendix; the table of all methods has their differences."""
    table = tfarm.modes(STEEL, 4)
    for method in ("closed-form", "balls", "appendix"):
        found = table.frequencies(method)
        assert found[0] == 0
        np.testing.assert_allclose(found, table.natural_frequency, rtol=4 * EPS)
    texts = table.digits(20)
    assert texts[0] == "0.0"
    np.testing.assert_allclose([float(text) for text in texts], table.frequencies("balls"), rtol=EPS)
    assert all(len(text.replace(".", "")) == 20 for text in texts[1:])
    assert list(table.by_methods().values) == ["closed-form", "balls", "appendix"]


def test_as_many_modes_as_lie_below():
    """Of a rigid body nothing is counted; exactly at a frequency it is not below."""
    for arm in (STEEL, PINNED, LAB):
        omega = tfarm.modes(arm, 4).natural_frequency[-4:]
        for number, point in enumerate(np.sqrt(omega[1:] * omega[:-1]), start=1):
            assert modes_below(arm, float(point)) == number
            np.testing.assert_array_equal(
                tfarm.modes(arm, up_to=float(point)).natural_frequency[-number:], omega[:number]
            )
    with pytest.raises(ParameterError, match="no flexible mode lies below it"):
        tfarm.modes(LAB, up_to=0.5 * float(tfarm.modes(LAB, 1).natural_frequency[-1]))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "either a count of modes or a frequency"), ({"count": 2, "up_to": 3.0}, "either a count of modes or a"),
        ({"count": 0}, "from 1 to 10000"), ({"count": 10_001}, "at most 10000"), ({"up_to": 0.0}, "positive, finite"),
        ({"up_to": math.inf}, "positive, finite"),
    ],
)  # fmt: skip
def test_a_count_or_frequency_out_of_range_is_refused(given, words):
    with pytest.raises(ParameterError, match=words):
        tfarm.modes(LAB, **given)


@pytest.mark.parametrize(("arm", "count"), thinned([(LAB.with_numbers(damping=1e-3), 8), (LAB, 4), (RUBBED, 3)], 2))
def test_each_disc_is_in_the_row_of_its_eigenvalue(arm, count):
    rows = listed_modes(tfarm.modes(arm, count), 15, certify=True).modes
    assert [row.index for row in rows] == list(range(count + 1))
    compared = 0
    for row in rows:
        if row.discs is None:
            assert row.eigenvalue in (None, 0) or row.second_eigenvalue is not None
            continue
        values = [each for each in (row.eigenvalue, row.second_eigenvalue) if each]
        assert len(values) == len(row.discs)
        for disc in row.discs:
            middle = complex(float(disc.re), float(disc.im))
            assert min(abs(middle - each) for each in values) <= 1e-9 * abs(middle)
            compared += 1
    assert compared >= count - 3


@pytest.mark.parametrize("theory", THEORIES)
def test_short_waves_are_overdamped_without_shear_and_hardly_damped_with_it(theory):
    """Of the 400 first waves between two pins the last, whose k^2 EI C is far above the inertia."""
    arm = pinned(replace(LAB.link, damping=1e-2))
    last = sine_waves(arm, 400, theory)[0][-1]
    note = beyond_the_box(LAB.under(theory))
    rings = (-last.real / abs(last)).min() < 0.1
    assert rings == (theory in WITH_SHEAR) == ("lightly damped modes exist at ever higher frequency" in note)
    assert rings != ("all of them are overdamped" in note)
    assert "-1/C, -10000 1/s" in note


def test_segments_of_different_damping_are_distinguished():
    damped, stiff = (replace(LAB.link, damping=C) for C in (3e-4, 0.0))
    assert "-1/C of the most damped segment, -3333.33 1/s" in beyond_the_box(replace(LAB, outer=(damped,)))
    partly = replace(LAB, outer=(stiff,), theory="rayleigh")
    assert "segments without damping have lightly damped modes" in beyond_the_box(partly)
    assert beyond_the_box(LAB.elastic) == "their damping decreases with frequency, as no segment has damping (C = 0)"


def test_waves_change_at_a_cut_off_in_timoshenkos_theory_alone():
    """Beyond it both l^2 of the dispersion relation are negative: shear and rotary inertia together turn the sign."""
    for theory in THEORIES:
        arm, link = LAB.under(theory), LAB.link
        w = 1.1 * arm.shear_cutoff
        shear = link.rhoA / link.kGA * (theory in WITH_SHEAR)
        turning = link.rhoI / link.EI * (theory in WITH_ROTARY_INERTIA)
        both = shear * turning * w**4 - link.rhoA / link.EI * w**2
        squares = np.roots([1.0, w**2 * (shear + turning), both])
        assert arm.has_cutoff == (squares.real < 0).all()
