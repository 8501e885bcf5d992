"""The candidates that the paper leaves open: limits, scaling laws, finite differences, and the arm's own values."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tfarm.audit.assumptions import (
    assumptions,
    has_hub_inertia,
    hub_study,
    own_depth,
    section_study,
)
from tfarm.schema import to_dict, to_json
from tfarm.spectrum.table import PAPER_GAINS

PAPER = tfarm.load("sasaki2012")
STOCKY = tfarm.load("stocky-steel")
LOCKED = replace(PAPER, hub=tfarm.Hub(inertia=math.inf))
PINNED = replace(PAPER, hub=tfarm.Hub(inertia=0.0))
ARMS = [PAPER, STOCKY, LOCKED, PINNED]
NAMES = ["paper", "stocky", "locked", "pinned"]


def own_frequencies(arm, count=4):
    return tfarm.modes(arm, count).natural_frequency[-count:]


# ------------------------------------------------------------ which candidates


def test_the_candidates_of_the_paper():
    depths, inertias = section_study(PAPER, count=1).values, hub_study(PAPER, count=1).values
    assert (depths[0], depths[-1]) == (0.002, 0.060)
    assert sum(math.isclose(depth, 0.006) for depth in depths) == 1
    assert inertias.tolist() == [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0]


def test_another_area_scales_the_depths_and_the_arm_is_among_them():
    depths = section_study(STOCKY, count=1).values
    scale = math.sqrt(5e-3 / 6e-4)
    assert [depths[0], depths[-1]] == pytest.approx([0.002 * scale, 0.060 * scale], rel=0.05)  # two digits
    assert depths[0] == 0.0058
    assert own_depth(STOCKY) == pytest.approx(0.10, rel=1e-14)
    assert own_depth(STOCKY) in depths
    assert np.all(np.diff(depths) > 0)


@pytest.mark.parametrize("own", [3e-7, 0.0099, 0.03, 40.0])
def test_an_inertia_outside_moves_the_candidates_by_decades(own):
    inertias = hub_study(replace(PAPER, hub=tfarm.Hub(inertia=own)), count=1).values
    assert own in inertias
    assert inertias[-1] / inertias[0] == pytest.approx(100.0, rel=1e-12)
    assert math.log10(inertias[0]) == pytest.approx(round(math.log10(inertias[0])), abs=1e-9)


def test_a_hub_without_an_inertia_has_no_candidates():
    assert [has_hub_inertia(arm) for arm in ARMS] == [True, True, False, False]
    assert [to_dict(assumptions(arm, 1))["hub"] for arm in (LOCKED, PINNED)] == [None, None]
    assert hub_study(LOCKED, [0.1]).natural_frequency[0] == pytest.approx(own_frequencies(PAPER), rel=1e-14)


# ------------------------------------------------------------ the arm's own values


@pytest.mark.parametrize("arm", thinned(ARMS, 2), ids=NAMES)
def test_the_own_section_gives_the_arms_own_table(arm):
    study = section_study(arm, count=6)
    assert study.is_own.sum() == 1
    assert study.natural_frequency[study.is_own][0] == pytest.approx(own_frequencies(arm, 6), rel=1e-13)
    (row,) = (row for row in study.candidates if row.is_own)
    assert row.width * row.depth == pytest.approx(arm.link.section.area, rel=1e-14)
    assert row.second_moment == pytest.approx(arm.link.section.second_moment, rel=1e-14)


@pytest.mark.parametrize("arm", [PAPER, STOCKY], ids=NAMES[:2])
def test_the_own_hub_gives_the_arms_own_table(arm):
    study = hub_study(arm)
    assert study.natural_frequency[study.is_own].tolist() == [own_frequencies(arm).tolist()]


# ------------------------------------------------------------ sensitivities


def slopes(values, frequency):
    """d ln w / d ln value, by central differences of order four over five neighbours."""
    step = math.log(values[1] / values[0])
    log = np.log(frequency)
    return (log[0] - 8 * log[1] + 8 * log[3] - log[4]) / (12 * step)


NEIGHBOURS = np.geomspace(0.998, 1.002, 5)


@pytest.mark.parametrize("arm", thinned(ARMS, 3), ids=NAMES)
@pytest.mark.parametrize("share", [0.3, 1.0, 4.0])
def test_the_sensitivity_to_the_section_is_the_slope_between_neighbours(arm, share):
    study = section_study(arm, own_depth(arm) * share * NEIGHBOURS)
    slope = slopes(study.values**2, study.natural_frequency)  # I = A depth^2/12
    assert study.sensitivity[2] == pytest.approx(
        slope, abs=1e-9
    )  # order four: 0.001^4 x its factor (a veering pair: 600)


@pytest.mark.parametrize("arm", thinned([PAPER, STOCKY], 2), ids=NAMES[:2])
@pytest.mark.parametrize("share", [0.1, 1.0, 10.0])
def test_the_sensitivity_to_the_hub_is_the_slope_between_neighbours(arm, share):
    study = hub_study(arm, arm.hub.inertia * share * NEIGHBOURS)
    slope = slopes(study.values, study.natural_frequency)
    assert study.sensitivity[2] == pytest.approx(slope, abs=1e-9)
    assert np.all(study.sensitivity < 0)


# ------------------------------------------------------------ limits


def test_a_slender_arm_rings_in_proportion_to_its_depth():
    study = section_study(PAPER, [5e-5, 1e-4, 2e-4])
    ratio = study.natural_frequency[1:] / study.natural_frequency[:-1]
    shear = (1e-4 * np.arange(1, 5)) ** 2 * 1e3  # Timoshenko's correction, of order (mode x depth/length)^2
    assert abs(ratio - 2).max() < shear.max()
    assert abs(study.sensitivity - 0.5).max() < shear.max()


@pytest.mark.parametrize("arm", [PAPER, STOCKY], ids=NAMES[:2])
def test_a_heavy_hub_is_a_locked_one_and_a_light_hub_a_pin(arm):
    study = hub_study(arm, [1e-9, 1e9])
    assert study.natural_frequency[0] == pytest.approx(study.pinned, rel=1e-6)
    assert study.natural_frequency[1] == pytest.approx(study.locked, rel=1e-8)
    assert study.locked == pytest.approx(own_frequencies(replace(arm, hub=tfarm.Hub(inertia=math.inf))), rel=1e-15)


@pytest.mark.parametrize("arm", [PAPER, STOCKY], ids=NAMES[:2])
def test_hub_frequencies_fall_and_interlace_with_those_of_pin_and_lock(arm):
    """Rayleigh (1877), one constraint: each frequency lies between its pinned value and the locked one below it."""
    study = hub_study(arm)
    assert np.all(np.diff(study.natural_frequency, axis=0) < 0)
    assert np.all(study.natural_frequency < study.pinned)
    assert np.all(study.natural_frequency > study.locked)


# ------------------------------------------------------------ the answer


def test_the_answer_is_plain_json_with_the_numbers_of_the_studies():
    answer = json.loads(to_json(to_dict(assumptions(PAPER, 2))))
    assert (answer["arm"], answer["count"]) == ("sasaki2012", 2)
    study, rows = section_study(PAPER, count=2), answer["section"]["candidates"]
    assert [row["natural_frequency_rad_s"] for row in rows] == study.natural_frequency.tolist()
    assert [row["sensitivity"] for row in rows] == study.sensitivity.tolist()
    assert [row["depth_m"] for row in rows if row["is_own"]] == study.values[study.is_own].tolist()
    assert "area" in answer["section"]["held"]
    assert answer["hub"]["locked_rad_s"] == hub_study(PAPER, count=2).locked.tolist()
    (own,) = (row for row in answer["hub"]["candidates"] if row["is_own"])
    assert own["natural_frequency_rad_s"][0] == pytest.approx(71.505682466890, rel=1e-13)


def test_verdicts_are_those_of_the_loop_itself():
    """The arm's own row is that of `margins`, and every row that of its own closed-loop poles."""
    arm = tfarm.load("sasaki2012-lab")
    study = hub_study(arm, (0.05, 0.1, 0.5))
    verdicts = study.candidates
    assert verdicts[1].K2_below == pytest.approx(tfarm.margins(arm, PAPER_GAINS).windows["K2"].around[1], rel=1e-12)
    for each, found in zip(study.arms, verdicts, strict=True):
        below, above = (replace(PAPER_GAINS, K2=found.K2_below * factor) for factor in (0.99, 1.01))
        assert found.verdict == "stable"
        assert tfarm.closed_loop_poles(each, below, 6).unstable == 0
        assert tfarm.closed_loop_poles(each, above, 6).unstable == 2


def test_a_locked_hub_has_no_loop():
    arm = replace(tfarm.load("sasaki2012-lab"), hub=tfarm.Hub(inertia=math.inf))
    assert {(row.verdict, row.K2_below) for row in section_study(arm, count=1).candidates} == {("no loop", None)}
