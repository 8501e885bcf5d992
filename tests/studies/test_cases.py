"""Columns of studies that cases of it need: modes of any number, sensitivities, intervals of gains, the tuner."""

import math

import numpy as np
import pytest

import tfarm
from tests.shell import answer
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.studies import quantities as room
from tfarm.studies.cases import learning_curves
from tfarm.studies.quantities import column_names, sources_of, values_of
from tfarm.studies.running import Plan, chunk
from tfarm.studies.space import Subjects, space_of
from tfarm.tuner import tune
from tfarm.tuner import tuning as tuning_room
from tfarm.tuner.tuning import usual_plan

LAB = tfarm.load("sasaki2012-lab")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)


def values(words, arm=LAB, law=LAW, **numbers):
    """Values of the columns of some words for one arm, with other numbers by key."""
    subject = Subjects(Case(arm, law), tuple(numbers)).at(tuple(numbers.values()))
    return values_of(subject, sources_of(column_names(words)))


def grid(key, points, names):
    """The plan of a study over the values of one key."""
    return Plan(Case(LAB, LAW), space_of({key: {"values": points}}, draws=1, seed=0), tuple(names))


def test_a_mode_of_any_number_has_a_column():
    omega = tfarm.modes(LAB, 9).natural_frequency[-9:]
    name = "modes.natural_frequency_rad_s.9"
    assert values([name]) == {"failed": None, name: pytest.approx(omega[8], rel=1e-12)}
    assert list(values(["modes"]).values())[:5] == pytest.approx(omega[:5], rel=1e-12)
    assert room.quantity_of(name).label == "natural frequency, mode 9"
    assert room.quantity_of(name).unit == "rad/s"
    for word in ("modes.natural_frequency_rad_s.0", "poles.unstable.2", "modes.colour.1"):
        with pytest.raises(ParameterError, match=r"^ask = "):
            column_names([word])


def test_sensitivities_are_the_quotients_of_differences():
    names = [f"sensitivity.{parameter}.{n}" for parameter in ("hub_inertia", "length") for n in (1, 3)]
    found, step = values(names), 1e-4
    for key, parameter in (("hub.inertia", "hub_inertia"), ("link.length", "length")):
        own = {"hub.inertia": LAB.hub.inertia, "link.length": LAB.length}[key]
        sides = [values(["modes"], **{key: own * factor}) for factor in (1 - step, 1 + step)]
        low, high = (np.array([side[f"{room.FREQUENCY}.{n}"] for n in (1, 2, 3)]) for side in sides)
        slopes = np.log(high / low) / math.log((1 + step) / (1 - step))
        for n in (1, 3):  # the error is of second order in the step
            assert found[f"sensitivity.{parameter}.{n}"] == pytest.approx(slopes[n - 1], rel=1e-5)


def test_intervals_of_gains_are_those_of_the_margins_and_end_at_the_axis():
    found, intervals = values(["interval"]), tfarm.margins(LAB, LAW).windows
    assert found["interval.verdict"] == "stable"
    for gain in ("K1", "K2"):
        ends = [found[f"interval.{gain}.{name}"] for name in ("low", "high", "low_is", "high_is")]
        assert ends == list(intervals[gain].interval)
    for factor, unstable in ((0.999, 0), (1.001, 2)):
        law = tfarm.HubFeedback(K1=0.3, K2=found["interval.K2.high"] * factor)
        assert tfarm.closed_loop_poles(LAB, law, 6).unstable == unstable
    beyond = values(["interval"], law=tfarm.HubFeedback(K1=0.3, K2=2.0))
    assert beyond["interval.verdict"] == "unstable"
    assert beyond["interval.K2.high"] is None


def test_a_count_of_poles_without_an_end_is_undecided(monkeypatch):
    def none(*_):
        raise ConvergenceError("no end", None, None)

    monkeypatch.setattr(room, "windows_of", none)
    assert values(["interval"])["interval.verdict"] == "undecided"


# ------------------------------------------------------------ the tuner


def test_the_tuner_of_a_row_is_that_of_the_command(capsys):
    """Seed, trials and cost; the same again, and another for another seed."""
    names = ("tuner.cost", "tuner.cost_best_constant", "tuner.trials", "tuner.is_zero", "tuner.trial_cost.4")
    table = chunk(grid("tuner.seed", (3, 4, 3), names), 0, 3)
    one = answer(capsys, "tune", "sasaki2012-lab", "--seed", "3")
    assert [table[name][0] for name in names] == [one["cost_tuned"], one["cost_best_constant"], 100, 0, one["cost"][3]]
    assert [table[name][2] for name in names] == [table[name][0] for name in names]
    assert table["tuner.cost"][1] != table["tuner.cost"][0]


def test_learning_curves_have_guard_and_baselines_computed_once(monkeypatch):
    calls, find, seen = [], tuning_room.find_guard, []
    monkeypatch.setattr(tuning_room, "find_guard", lambda *args: calls.append(1) or find(*args))
    tuning_room._baselines.cache_clear()
    plan, chain = usual_plan(LAB), Chain()
    tuning = tune(LAB, plan, chain)
    curves = learning_curves(LAB, plan, chain, 3, lambda *done: seen.append(done))
    assert len(calls) == 1
    assert seen == [(n, 3, "learning curves") for n in (1, 2, 3)]
    assert curves.costs[0].tolist() == tuning.training.costs.tolist()
    assert curves.final[0] == tuning.training.result.cost
