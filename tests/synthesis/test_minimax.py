"""The minimax search on functions whose least is known, and the slopes of laws beside central differences."""

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tests.synthesis.judged import judge_of
from tests.synthesis.test_sampled_design import slewed
from tfarm import Law
from tfarm.dsp import Chain
from tfarm.dsp.chain import Converters
from tfarm.synthesis.judge import entries_of
from tfarm.synthesis.minimax import LOST, Pieces, along_tangents, descended, minimax
from tfarm.synthesis.objectives import OBJECTIVES
from tfarm.synthesis.structures import STRUCTURES, structure_of
from tfarm.tuner.trial import slew_trial

LAB = tfarm.load("sasaki2012-lab")


def three_circles(x):
    """max of (x - a)^2 + (y - b)^2: least, 1, at the centre of the circle through (1, 0), (-1, 0) and (0, 1)."""
    off = x - np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]])
    return Pieces((off**2).sum(axis=1), 2 * off, np.array([-1.0]), np.zeros((1, 2)))


def rosenbrock_edge(x):
    """8 |x^2 - y| + (1 - x)^2, of Lewis and Overton: least, 0, at (1, 1) in a curved edge; wanted: x + y > 0.5."""
    edge, slope = x[0] ** 2 - x[1], np.array([2 * x[0], -1.0])
    rest, push = (1 - x[0]) ** 2, np.array([2 * x[0] - 2, 0.0])
    growth = np.array([0.5 - x.sum()])
    return Pieces(
        np.array([8 * edge + rest, -8 * edge + rest]), np.array([8 * slope + push, push - 8 * slope]),
        growth, -np.ones((1, 2)),
    )  # fmt: skip


@pytest.mark.parametrize("start", [[3.0, -2.0], [-0.5, 0.4]])
def test_the_least_of_a_largest_is_found_on_its_edges(start):
    start, free = np.array(start), (np.full(2, -9.0), np.full(2, 9.0))
    score, x = along_tangents(three_circles, start, free)
    assert score == pytest.approx(1.0, abs=1e-6)
    assert x == pytest.approx([0.0, 0.0], abs=1e-3)
    assert rosenbrock_edge(descended(rosenbrock_edge, start, free)).score < 1e-3
    score, x = minimax(rosenbrock_edge, [start], free, lambda n, best: None)[0]
    assert x == pytest.approx([1.0, 1.0], abs=0.05)
    assert score < 1e-3


def test_what_may_not_be_passed_is_not():
    """From a start that is lost, and with a limit on x: the least is at x = 0.5."""
    first = rosenbrock_edge(np.array([-0.5, 0.0]))
    assert first.score >= LOST
    score, x = minimax(
        rosenbrock_edge, [np.array([-0.5, 0.0])], (np.full(2, -9.0), np.array([0.5, 9.0])), lambda n, best: None
    )[0]
    assert score == pytest.approx(0.25, abs=1e-3)
    assert x == pytest.approx([0.5, 0.25], abs=1e-2)


def differences(judge, form, x, step=1e-5):
    """Central differences of the largest objective and of the largest growth, by every coordinate."""
    ends = [[judge.pieces(form, x + way * each) for way in (step, -step)] for each in np.eye(x.size)]
    return tuple(
        np.array([(getattr(a, name).max() - getattr(b, name).max()) / (2 * step) for a, b in ends])
        for name in ("values", "growth")
    )


def form_of(name, Kp=5.0):
    return structure_of(name, LAB, Kp=0.0 if name == "K1-K2" else Kp, modes=2, period=0.01, bounds={})


def slopes_agree(judge, form, x):
    """The slopes of the largest value and of the largest growth are those of central differences."""
    found = judge.pieces(form, x)
    values, growth = differences(judge, form, x)
    # a second-order difference of 1e-5, and rounding of 1e-16/1e-5 of poles that are right to 1e-13
    for ours, theirs in (
        (found.slopes[found.values.argmax()], values),
        (found.growth_slopes[found.growth.argmax()], growth),
    ):
        assert ours == pytest.approx(theirs, rel=1e-5, abs=1e-6 * abs(theirs).max() + 1e-8)


@pytest.mark.parametrize("name", thinned(STRUCTURES, 2))
@pytest.mark.parametrize("continuous", [False, True])
def test_slopes_are_those_of_central_differences(name, continuous):
    form = form_of(name)
    x = form.origin + 0.1 * np.random.default_rng(0).standard_normal(form.size) - 0.2
    for objective in OBJECTIVES:
        if not (objective == "cost" and continuous):
            judge = judge_of(LAB, form.record_at(x), objective, continuous=continuous)
            slopes_agree(judge, form, x)
            assert judge.scores(form, x[:, None])[0] == pytest.approx(judge.pieces(form, x).score, rel=1e-9)


@pytest.mark.parametrize("name", ["strain-rate", "K1-K2"])
def test_slopes_of_a_rate_that_is_a_difference(name):
    """Of a free angle, too, which the difference does not see."""
    chain = Chain(converters=Converters(hub_rate="difference"))
    form = form_of(name)
    x = form.origin + np.array([-0.4, 0.1, -0.2][: form.size])
    for objective in ("damping", "margin", "cost"):
        slopes_agree(judge_of(LAB, form.record_at(x), objective, chain), form, x)


def test_poles_of_a_rate_that_is_a_difference_are_those_of_the_sampled_loop():
    chain = Chain(converters=Converters(hub_rate="difference", rate_filter=80.0))
    for law in (tfarm.HubFeedback(K1=2.0, K2=0.2), tfarm.HubFeedback(K1=2.0, K2=0.2, Kp=4.0)):
        judge = judge_of(LAB, law, "damping", chain)
        z = abs(judge.model.poles(entries_of(law))).max()
        assert np.log(z) == pytest.approx(tfarm.sampled(LAB, law, chain).verdict.log_radius, rel=1e-6)


@pytest.mark.parametrize("gain", [0.0, 0.2])
def test_the_cost_is_that_of_the_tuners_trial_with_a_constant_gain(gain):
    """Its trial has six modes and ideal converters, as the judge here."""
    law = Law(
        {"hub_angle": 4.0, "hub_rate": 2.0, "root_moment": gain}, references=("hub_angle", "hub_rate", "root_moment")
    )
    trial = slew_trial(LAB, K1=2.0, Kp=4.0)
    score = judge_of(LAB, law, "cost", count=6).score(law)
    assert score == pytest.approx(trial.with_constant(gain).cost, rel=1e-9)


def test_the_residual_is_that_of_the_simulated_slew():
    form = form_of("PPF", 4.0)
    law = form.record_at(form.origin + 0.1)
    score = judge_of(LAB, law, "residual", count=20).score(law)
    assert score == pytest.approx(slewed(LAB, law, Chain()), rel=1e-9)
