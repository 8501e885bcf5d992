"""The candidates that the paper leaves open: which they are, limits, the arm's own values, and verdicts."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.schema import to_dict
from tfarm.spectrum.gains import PAPER_GAINS
from tfarm.studies.candidates import assumptions, hub_study, section_study

PAPER = tfarm.load("sasaki2012")
STOCKY = tfarm.load("stocky-steel")
LOCKED = replace(PAPER, hub=tfarm.Hub(inertia=math.inf))
PINNED = replace(PAPER, hub=tfarm.Hub(inertia=0.0))


def own_row(study):
    (row,) = (row for row in study.candidates if row.is_own)
    return row


def frequencies(arm, count):
    return tfarm.modes(arm, count).natural_frequency[-count:].tolist()


def test_depths_scale_with_the_area_and_the_arms_own_is_among_them():
    """2 to 60 mm for the paper's area, to two digits; every rectangle has the arm's area."""
    depths = [row.depth for row in section_study(STOCKY, 1).candidates]
    scale = math.sqrt(5e-3 / 6e-4)
    assert [depths[0], depths[-1]] == pytest.approx([0.002 * scale, 0.060 * scale], rel=0.05)
    assert depths[0] == 0.0058
    assert depths == sorted(depths)
    assert sum(math.isclose(row.depth, 0.006) for row in section_study(PAPER, 1).candidates) == 1


@pytest.mark.parametrize("own", [3e-7, 0.0099, 0.03, 0.1, 40.0])
def test_an_inertia_outside_moves_the_candidates_by_decades(own):
    inertias = [row.hub_inertia for row in hub_study(replace(PAPER, hub=tfarm.Hub(inertia=own)), 1).candidates]
    assert own in inertias
    assert inertias[-1] / inertias[0] == pytest.approx(100.0, rel=1e-12)
    assert math.log10(inertias[0]) == pytest.approx(round(math.log10(inertias[0])), abs=1e-9)


@pytest.mark.parametrize("arm", [PAPER, STOCKY, LOCKED, PINNED], ids=["paper", "stocky", "locked", "pinned"])
def test_the_own_section_gives_the_arms_own_table(arm):
    row, section, table = own_row(section_study(arm, 4)), arm.link.section, tfarm.modes(arm, 4)
    assert row.natural_frequency == pytest.approx(frequencies(arm, 4), rel=1e-13)
    assert row.sensitivity == pytest.approx(table.sensitivity["second_moment"][-4:], rel=1e-9)
    assert row.width * row.depth == pytest.approx(section.area, rel=1e-14)
    assert row.second_moment == pytest.approx(section.second_moment, rel=1e-14)


@pytest.mark.parametrize("arm", [PAPER, STOCKY], ids=["paper", "stocky"])
def test_hub_frequencies_fall_and_interlace_with_those_of_pin_and_lock(arm):
    """Rayleigh (1877), one constraint: each frequency lies between its pinned value and the locked one below it."""
    study = hub_study(arm)
    omega = np.array([row.natural_frequency for row in study.candidates])
    assert np.all(np.diff(omega, axis=0) < 0)
    assert np.all((study.locked < omega) & (omega < study.pinned))
    assert own_row(study).natural_frequency == frequencies(arm, 4)
    assert own_row(study).sensitivity == pytest.approx(tfarm.modes(arm, 4).sensitivity["hub_inertia"][-4:], rel=1e-9)
    assert np.all(np.array([row.sensitivity for row in study.candidates]) < 0)


def test_verdicts_are_those_of_the_loop_itself():
    """The arm's own row is that of `margins`, and every row that of its own closed-loop poles.

    A hub without an inertia has no candidates and no loop.
    """
    arm = tfarm.load("sasaki2012-lab")
    for odd in (LOCKED, PINNED):
        found = to_dict(assumptions(odd, 1))
        assert found["hub"] is None
        assert {(row["verdict"], row["K2_below"]) for row in found["section"]["candidates"]} == {("no loop", None)}
    study = hub_study(arm)
    assert own_row(study).K2_below == pytest.approx(tfarm.margins(arm, PAPER_GAINS).windows["K2"].around[1], rel=1e-12)
    for row in study.candidates[1::2]:
        candidate = arm.with_numbers(hub_inertia=row.hub_inertia)
        below, above = (replace(PAPER_GAINS, K2=row.K2_below * factor) for factor in (0.99, 1.01))
        assert row.verdict == "stable"
        assert tfarm.closed_loop_poles(candidate, below, 6).unstable == 0
        assert tfarm.closed_loop_poles(candidate, above, 6).unstable == 2
