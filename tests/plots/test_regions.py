"""Where gains keep a loop stable, drawn: which columns of the picture there are, against eigenvalues."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.exported.live_loop import live_data
from tfarm.loop.plane import moment_axis
from tfarm.loop.plane_axes import rate_axis, rate_columns
from tfarm.loop.stability import stability
from tfarm.report.blocks import prose
from tfarm.synthesis.stability_map import sampled_region

LAB = tfarm.load("sasaki2012-lab")
FRICTION = 0.02
LOSSY = replace(LAB, name="lossy", hub=replace(LAB.hub, friction=FRICTION))  # its least rate gain is in the picture
K2S = (-1.0, 0.0, 0.3, 0.9, 1.1)


def region_of(arm):
    x = rate_axis(arm)
    return sampled_region(arm, x, moment_axis(arm, x), Chain())


@pytest.mark.parametrize("arm", [tfarm.load("quanser-flexlink"), LOSSY], ids=lambda arm: arm.name)
def test_a_hub_that_loses_something_is_stable_below_no_rate_gain_too(arm):
    """Back-EMF or friction, and a gain that takes less than they: drawn, as by the eigenvalues of the loop."""
    plane = region_of(arm)
    below = np.flatnonzero((plane.K1 < 0) & (plane.K1 / arm.rate_loss > -0.99))  # not at the edge: rounding
    assert below.size
    for n in below[:: max(1, below.size // 3)]:
        windows = plane.stable_intervals[n]
        for K2 in np.array(K2S) * arm.input_per_torque:
            inside = any(low < K2 < high for low, high in windows)
            loop = plane.loop.with_number("K1", float(plane.K1[n])).with_number("K2", float(K2))
            assert inside == bool(abs(loop.eigenvalues).max() < 1)


def test_its_least_rate_gain_is_an_upright_edge_of_the_picture():
    plane = region_of(LOSSY)
    stable = np.array([bool(each) for each in plane.stable_intervals])
    assert plane.K1[stable].min() == pytest.approx(-FRICTION, rel=1e-8)
    assert not stable[plane.K1 < -FRICTION].any()
    areas = live_data(Case(LOSSY, tfarm.default_gains(LOSSY)))["continuous"]
    assert min(row["K1"] for row in areas) >= -FRICTION


def test_only_a_held_tip_has_columns_below_0_on_a_lossless_hub():
    x = rate_axis(LAB)
    assert rate_columns(LAB, x, 40).min() > 0
    held = replace(LAB, payload=replace(LAB.payload, mass=np.inf))
    assert rate_columns(held, rate_axis(held), 40).min() < 0


@pytest.mark.parametrize("friction", [0.0, FRICTION])
def test_nothing_is_stable_below_the_rate_gain_that_the_words_name(friction):
    """Just below it and far below, at every K2: poles of the exact loop, and eigenvalues of the sampled one."""
    arm = replace(LAB, hub=replace(LAB.hub, friction=friction))
    assert prose("beyond_left", arm=arm).split("< ")[1].startswith("−0.02," if friction else "0")
    loop = region_of(arm).loop
    for K1 in (-friction - 1e-5, -friction - 0.3, -friction - 20.0):
        for K2 in K2S:
            assert not stability(Case(arm, HubFeedback(K1=K1, K2=K2))).is_stable
            assert abs(loop.with_number("K1", K1).with_number("K2", K2).eigenvalues).max() > 1
