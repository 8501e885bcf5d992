"""Evolution strategies on functions whose least is known, and the scores of laws by other roads."""

import numpy as np
import pytest

import tfarm
from tests.synthesis.judged import judge_of
from tests.synthesis.test_sampled_design import slewed
from tfarm import Law
from tfarm.dsp import Chain
from tfarm.dsp.chain import Converters
from tfarm.synthesis.evolution import evolved
from tfarm.synthesis.judge import LOST, entries_of
from tfarm.synthesis.structures import structure_of
from tfarm.tuner.trial import slew_trial

LAB = tfarm.load("sasaki2012-lab")


def three_circles(x):
    """The largest of (x - a)^2 + (y - b)^2: least, 1, at the centre of the circle through (1, 0), (-1, 0), (0, 1)."""
    return max((x[0] - a) ** 2 + (x[1] - b) ** 2 for a, b in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0)))


def curved_edge(x):
    """8 |x^2 - y| + (1 - x)^2, of Lewis and Overton: least, 0, at (1, 1) in a curved edge; wanted: x + y > 0.5."""
    value = 8 * abs(x[0] ** 2 - x[1]) + (1 - x[0]) ** 2
    return value if x.sum() > 0.5 else LOST + 0.5 - x.sum()


@pytest.mark.parametrize(
    ("function", "top", "least", "at"),
    [
        (three_circles, 9.0, 1.0, [0.0, 0.0]),
        (curved_edge, 9.0, 0.0, [1.0, 1.0]),
        (curved_edge, [0.5, 9.0], 0.25, [0.5, 0.25]),  # with a limit on x
    ],
)
def test_the_least_of_a_function_with_edges_is_found(function, top, least, at):
    """From starts of which one is lost: the lowest score comes first, and points are in the box."""
    starts, box = np.array([[-0.5, 0.3, -3.0], [0.0, -2.0, 4.0]]), (np.full(2, -9.0), np.broadcast_to(top, 2))
    rounds = []
    x, scores = evolved(
        lambda points: np.array([function(each) for each in points.T]), starts, box, lambda *each: rounds.append(each)
    )
    assert scores[0] == pytest.approx(least, abs=1e-3)
    assert x[:, 0] == pytest.approx(at, abs=0.02)
    assert (x.shape, list(scores)) == ((2, 3), sorted(scores))
    assert (box[0] <= x.T).all()
    assert (box[1] >= x.T).all()
    assert [best for _, best in rounds] == sorted((best for _, best in rounds), reverse=True)


def test_coordinates_that_hang_together_are_learnt():
    """An ellipsoid whose axes are 1 : 100 and turned: strategies of one step for all coordinates do not get there."""
    turn, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((5, 5)))
    sizes = 10 ** np.linspace(0, 4, 5)
    box = np.full(5, -5.0), np.full(5, 5.0)
    x, scores = evolved(
        lambda points: sizes @ (turn @ (points - 0.7)) ** 2, np.array([[-2.0, 3.0, 1.0, 0.0, 4.0]]).T, box, lambda *_: 0
    )
    assert x[:, 0] == pytest.approx(0.7, abs=1e-3)
    assert scores[0] < 1e-5


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
    form = structure_of("PPF", LAB, Kp=4.0, modes=2, period=0.01, bounds={})
    law = form.record_at(form.origin + 0.1)
    score = judge_of(LAB, law, "residual", count=20).score(law)
    assert score == pytest.approx(slewed(LAB, law, Chain()), rel=1e-9)
