"""The minimax search on functions whose least is known, and the slopes of laws beside central differences."""

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tests.synthesis.test_sampled_design import slewed
from tfarm import Law
from tfarm.dsp import Chain
from tfarm.dsp.chain import Converters
from tfarm.synthesis.law_judge import LAW_OBJECTIVES, law_judge
from tfarm.synthesis.minimax import LOST, Pieces, along_tangents, descended, minimax
from tfarm.synthesis.structures import STRUCTURES
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
    start, free = np.array(start), np.full(2, 9.0)
    score, x = along_tangents(three_circles, start, free)
    assert score == pytest.approx(1.0, abs=1e-6)
    assert x == pytest.approx([0.0, 0.0], abs=1e-3)
    assert rosenbrock_edge(descended(rosenbrock_edge, start, free)).score < 1e-3
    score, x = minimax(rosenbrock_edge, [start], free, lambda n, best: None)[0]
    assert x == pytest.approx([1.0, 1.0], abs=0.05)
    assert score < 1e-3


def test_what_may_not_be_passed_is_not():
    """From a start that is lost, and with a limit on x: the least is at x = 0.5."""
    first = rosenbrock_edge(np.array([-3.0, 0.0]))
    assert first.score >= LOST
    score, x = minimax(rosenbrock_edge, [np.array([-3.0, 0.0])], np.array([0.5, 9.0]), lambda n, best: None)[0]
    assert score == pytest.approx(0.25, abs=1e-3)
    assert x == pytest.approx([0.5, 0.25], abs=1e-2)


def differences(judge, form, x, step=1e-5):
    """Central differences of the largest objective and of the largest growth, by every coordinate."""
    ends = [[judge.pieces(form.law(x + way * each), ()) for way in (step, -step)] for each in np.eye(x.size)]
    return tuple(
        np.array([(getattr(a, name).max() - getattr(b, name).max()) / (2 * step) for a, b in ends])
        for name in ("values", "growth")
    )


@pytest.mark.parametrize("name", thinned(STRUCTURES, 2))
def test_slopes_are_those_of_central_differences(name):
    form = STRUCTURES[name](LAB, 5.0, 2, 0.01)
    x = form.origin + 0.1 * np.random.default_rng(0).standard_normal(form.origin.size) - 0.2
    for objective in LAW_OBJECTIVES:
        judge = law_judge(LAB, Chain(), form.law(x), objective, 2, 8)
        found = judge.pieces(form.law(x), form.slopes(x))
        values, growth = differences(judge, form, x)
        # a second-order difference of 1e-5, and rounding of 1e-16/1e-5 of poles that are right to 1e-13
        for ours, theirs in (
            (found.slopes[found.values.argmax()], values),
            (found.growth_slopes[found.growth.argmax()], growth),
        ):
            assert ours == pytest.approx(theirs, rel=1e-5, abs=2e-7 * abs(theirs).max() + 1e-9)


def test_slopes_of_a_rate_that_is_a_difference():
    chain = Chain(converters=Converters(hub_rate="difference"))
    form = STRUCTURES["strain-rate"](LAB, 5.0, 2, 0.01)
    x = np.array([-0.4, 0.3, -0.2])
    for objective in ("damping", "margin", "cost"):
        judge = law_judge(LAB, chain, form.law(x), objective, 2, 8)
        found = judge.pieces(form.law(x), form.slopes(x))
        assert found.slopes[found.values.argmax()] == pytest.approx(differences(judge, form, x)[0], rel=1e-5, abs=1e-8)


@pytest.mark.parametrize("gain", [0.0, 0.2])
def test_the_cost_is_that_of_the_tuners_trial_with_a_constant_gain(gain):
    """Its trial has six modes and ideal converters, as the judge here."""
    law = Law(
        {"hub_angle": 4.0, "hub_rate": 2.0, "root_moment": gain}, references=("hub_angle", "hub_rate", "root_moment")
    )
    judge = law_judge(LAB, Chain(), law, "cost", 2, 6)
    trial = slew_trial(LAB, K1=2.0, Kp=4.0)
    assert judge.score(law) == pytest.approx(trial.with_constant(gain).cost, rel=1e-9)


def test_the_residual_is_that_of_the_simulated_slew():
    form = STRUCTURES["PPF"](LAB, 4.0, 2, 0.01)
    law = form.law(form.origin + 0.1)
    judge = law_judge(LAB, Chain(), law, "residual", 2, 20)
    assert judge.score(law) == pytest.approx(slewed(LAB, law, Chain()), rel=1e-9)
