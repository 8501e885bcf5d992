"""Curves in time: a line that resolves what rings, or a band around it; the file has what is drawn."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import tfarm
from tests.odd_arms import odd_arms
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, Simulator, Slew, scenario
from tfarm.dsp.results import simulate_for_picture
from tfarm.dsp.traces import (
    MOST_LINE,
    POINTS_A_PERIOD,
    TimeCurve,
    curve,
    curve_of,
    points_a_period,
    reference_angle,
)
from tfarm.report.sampled_section import response_columns
from tfarm.spectrum.gains import default_gains

STEEL = tfarm.load("stocky-steel")


def test_a_fast_ringing_is_drawn_as_a_band_that_holds_the_curve():
    """The band of a known oscillation is its amplitude: no piece of it is shorter than a period."""
    t = np.linspace(0.0, 3.0, 30_001)
    f = 10_000 / POINTS_A_PERIOD  # Hz, twenty points a period
    found = curve(t, 2.0 + np.cos(2 * np.pi * f * t))
    assert found.is_band
    assert found.low[:-1] == pytest.approx(1.0, abs=0.05)  # the cosine's lowest of twenty points, at most 9 degrees off
    assert found.high[:-1] == pytest.approx(3.0, abs=0.05)
    assert np.diff(found.t).min() * f >= 2 * (1 - 1e-9)
    line = curve(t[:MOST_LINE], t[:MOST_LINE])
    assert not line.is_band
    assert np.array_equal(line.low, line.high)


def test_the_slew_of_a_stiff_arm_is_not_aliased_and_its_file_has_the_curve():
    run = simulate_for_picture(Case(STEEL, default_gains(STEEL).with_number("K2", 0.0), Chain()), "slew", 3.0)
    records = run.between.t.size / run.t.size
    first = tfarm.modes(STEEL, 1).natural_frequency[-1] / (2 * np.pi)
    assert (records + 1) * 100 >= POINTS_A_PERIOD * first > 400  # 400 a second is what three records gave
    curve, table = curve_of(run, "root_moment"), response_columns(STEEL, {"without": run})
    columns = {column.key: np.array(column.values) for column in table}
    assert curve.is_band
    rounded = 0.5e-6 * abs(curve.high).max()  # seven digits are in the file
    assert columns["root_moment_without_N_m_low"] == pytest.approx(curve.low, abs=rounded)
    assert columns["root_moment_without_N_m_high"] == pytest.approx(curve.high, abs=rounded)
    assert (columns["root_moment_without_N_m_low"] <= columns["root_moment_without_N_m_high"]).all()


def test_a_slew_under_any_law_is_resolved_too():
    """On the page of a law: 20 records in each period of the first mode, which rings at 368 Hz, or a band around it."""
    law = tfarm.Law({"hub_rate": ([40.0, 0.0], [1.0, 300.0]), "hub_angle": 100.0})
    run = simulate_for_picture(Case(STEEL, law, Chain()), "impulse", 0.1)
    first = tfarm.modes(STEEL, 1).natural_frequency[-1] / (2 * np.pi)
    assert (run.between.t.size / run.t.size + 1) * 100 >= POINTS_A_PERIOD * first
    found, needed = points_a_period(STEEL, run)
    assert found >= POINTS_A_PERIOD
    coarse = tfarm.simulate(STEEL, law, scenario_name="impulse", duration=0.1, count=20)
    assert points_a_period(STEEL, coarse)[0] == pytest.approx(POINTS_A_PERIOD / (needed + 1), rel=0.1)
    assert "points a period" in tfarm.plots.slew(STEEL, coarse, ax=Figure().subplots(3))[0].get_title("right")
    assert tfarm.plots.slew(STEEL, run, ax=Figure().subplots(3))[0].get_title("right") == ""


def test_a_slow_arm_is_a_line_of_the_simulators_own_records():
    lab = tfarm.load("sasaki2012-lab")
    run = simulate_for_picture(Case(lab, default_gains(lab), Chain()), "slew", 3.0)
    curve = curve_of(run, "root_moment")
    assert not curve.is_band
    assert curve.t.size == run.t.size + run.between.t.size >= 4 * 301


def test_the_reference_between_the_samples_is_that_of_the_slew():
    """theta = a t^2/2 up to the middle of the slew, and its mirror image after it."""
    arm = odd_arms()["boom"]
    task = scenario("slew", arm, Chain(slew=Slew(rise_time=1.0)), 1.5)
    t = np.linspace(0.0, 1.4, 777)
    a = 4 * 1.15  # rad/s^2: 1.15 rad in 1 s
    exact = np.where(t < 0.5, a * t**2 / 2, 1.15 - a * np.clip(1 - t, 0, None) ** 2 / 2)
    assert reference_angle(task, t) == pytest.approx(exact, abs=1e-12)


def test_at_other_times_a_curve_holds_what_it_last_was():
    own = TimeCurve(np.array([0.5, 1.0, 2.0]), np.array([5.0, 6.0, 7.0]), np.array([5.5, 6.5, 7.5]), True)
    found = own.at(np.array([0.0, 0.5, 0.9, 1.0, 1.9, 9.0]))
    np.testing.assert_array_equal(found.low, [5.0, 5.0, 5.0, 6.0, 6.0, 7.0])
    np.testing.assert_array_equal(found.high, found.low + 0.5)
    assert found.is_band
    assert own.at(np.array([3.0, 4.0, 5.0])) is own  # as many are its own


@pytest.mark.parametrize(("name", "delay"), [("step", 0.0), ("step", 0.3), ("step", 1.6), ("slew", 0.0), ("slew", 1.0)])
def test_torques_applied_again_let_a_mode_ring_as_far_as_in_the_simulation(name, delay):
    """Without feedback or damping, by the range of the moment within the sample where it is largest."""
    arm = replace(STEEL, link=replace(STEEL.link, damping=0.0))
    chain = Chain(sampling=Sampling(delay_samples=delay))
    task = scenario(name, arm, chain, 0.3 if name == "step" else 1.5)
    run = Simulator(Case(arm, HubFeedback(), chain), task, count=1, between=400).run()
    moment = run.between.root_moment.reshape(-1, 400)[math.ceil(delay) :]  # 96 records a period, four periods a sample
    frequency, size = run.rings
    assert frequency == pytest.approx(tfarm.modes(arm, 1).natural_frequency[-1:])
    assert size[2, 0] == pytest.approx(np.ptp(moment, axis=1).max() / 2, rel=2e-3)
