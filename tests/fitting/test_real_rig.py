"""A real rig that rings, and the exact arm of its maker's numbers: tests/data/quanser-2dsfl (B. Basta, MIT licence).

Nothing is tuned.  The inertia of the load about the hub's axis and the place of its centre of mass are as the preset
assumes them; how the inertia splits is not published, and the whole range of what it leaves possible is looked at.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

import tfarm
from tests.shell import answer, run
from tfarm.fitting.model import mode_of
from tfarm.fitting.recording import read_recording

DATA = Path(__file__).parent.parent / "data" / "quanser-2dsfl"
RUNS = ("ring-20deg.csv", "ring-neg-10deg.csv")
ABOUT_AXIS = 0.17043  # kg m^2, of the load as its maker states it
RIG = tfarm.load("quanser-2dsfl")


def held(offset):
    """The rig with its hub held and the load's centre of mass so far [m] beyond the tip."""
    mass, length = RIG.payload.mass, RIG.length
    own = ABOUT_AXIS - mass * (length + offset) ** 2
    load = replace(RIG.payload, offset=offset, inertia=own)
    return replace(RIG, payload=load).having(hub_inertia=math.inf)


def first(offset):
    return float(tfarm.modes(held(offset), count=1).natural_frequency_hz[-1])


@pytest.mark.parametrize("name", RUNS)
def test_the_inner_stage_rings_between_1_79_and_1_86_hz(name, capsys):
    """The hub moves by less than a quarter of what the tip does; what is left is no noise, and that is noted."""
    found = answer(capsys, "ring", str(DATA / name), "--signal", "tip_angle_against_hub", "--from", "2")
    (mode,) = found["modes"]
    assert 1.79 < mode["frequency_hz"] < 1.86
    assert mode["frequency_low_hz"] < mode["frequency_hz"] < mode["frequency_high_hz"]
    assert 0.003 < mode["damping_ratio"] < 0.04
    assert found["residuals_white"] is False
    option = mode_of(f"1={mode['mode_option']}")
    assert option.frequency == pytest.approx(2 * math.pi * mode["frequency_hz"], rel=1e-6)
    assert option.ratio_deviation == pytest.approx(mode["damping_ratio_std"], rel=1e-2)
    record = read_recording(DATA / name)
    late = record.times >= 2
    hub, tip = (record.signals[each][late] for each in ("hub_angle", "tip_angle_against_hub"))
    assert hub.std() < 0.25 * tip.std()


def test_the_held_arm_of_the_published_numbers_is_in_that_range_and_so_are_others():
    """1.83 Hz where the preset puts the centre of mass; 1.65 to 1.96 Hz for all places that the inertia leaves."""
    farthest = math.sqrt(ABOUT_AXIS / RIG.payload.mass) - RIG.length  # then all of it is a point
    assert RIG.payload.offset == 0.079
    assert RIG.payload.inertia == pytest.approx(held(0.079).payload.inertia, rel=1e-4)
    assert first(0.079) == pytest.approx(1.83, abs=0.005)
    ends = first(0.0), first(farthest * (1 - 1e-9))
    assert ends == pytest.approx((1.65, 1.96), abs=0.005)


def test_the_text_of_a_ring_has_the_limits_of_its_interval(capsys):
    code, out, err = run(capsys, "ring", str(DATA / RUNS[0]), "--signal", "tip_angle_against_hub", "--from", "2")
    assert (code, err) == (0, "")
    assert "the residuals are correlated" in out
    assert re.search(r"^from +2 s\nto +3.99 s\nsamples +200$", out, re.MULTILINE)
