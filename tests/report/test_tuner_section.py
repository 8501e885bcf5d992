"""The tuner on the page: costs are those of the tuner's room, the guard is on the map, other arms get one sentence."""

import math
import pickle
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tests.report.written import blocks_of, report_with, values_of
from tests.shared import once
from tests.shell import answer
from tfarm.dsp import Chain, Sampling
from tfarm.dsp.traces import away
from tfarm.errors import CertificationError
from tfarm.report.blocks import prose
from tfarm.report.page import ArmReport
from tfarm.report.sampled_section import tuner_in_short, tuner_section
from tfarm.schema.html import with_symbols
from tfarm.studies import candidates as tuned
from tfarm.tuner import Learning, LearningCurves, Plan, initial_network, train

LAB = tfarm.load("sasaki2012-lab")
SEEDS = 3


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The section and its numbers with few seeds and the first four conditions."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuned, "LONG_TRIAL", 300)
        patch.setattr(tuned, "CURVE_SAMPLES", SEEDS * Plan().trials * 301)
        data = pickle.loads(once(tmp_path_factory, "tuner", save_study).read_bytes())
    return data, tuner_section(report_with(LAB, tuner=data))


def save_study(file):
    file.write_bytes(pickle.dumps(tuned.tuner_numbers(LAB, Chain())))


def test_what_is_drawn_is_the_tuning(small):
    blocks, guard = blocks_of(small[1]), small[0].tuning.training.guard
    assert f"[{guard.lo:.4g}, {guard.hi:.4g}]" in blocks["tune-gain"].caption
    bars = [line for line in blocks["tune-gain"].figure.axes[0].lines if line.get_linewidth() == 9]
    assert [tuple(bar.get_ydata()) for bar in bars] == [(guard.lo, guard.hi)]
    assert [tuple(bar.get_xdata()) for bar in bars] == [(0.3, 0.3)]


def test_curves_are_trainings_of_their_seeds(small):
    data = small[0]
    tuning = data.tuning
    drawn = values_of(blocks_of(small[1])["tune-curves"].data)
    seed = 2
    trained = train(tuning.trial, initial_network(seed), tuning.training.guard, Learning(), Plan().trials)
    assert drawn[f"seed_{seed}"] == trained.costs.tolist()
    rows = np.sort([drawn[f"seed_{i}"] for i in range(SEEDS)], axis=0)
    assert drawn["median"] == rows[1].tolist()
    assert len(drawn["trial"]) == Plan().trials


def test_the_words_begin_with_the_answer_and_the_facts_carry_the_numbers(small):
    data, section = small
    below = int((data.curves.final < data.tuning.best_constant.cost).sum())
    assert section.answer.startswith(f"The median cost with the tuner over {SEEDS} seeds is ")
    assert f"; {below} of {SEEDS} seeds end below that." in section.answer
    facts = {fact.label: fact.value for fact in section.facts}
    assert facts["cost without moment feedback"] == "2.692"
    assert facts["best constant gain"] == "0.9531"
    assert facts["bound"].startswith("0.256")
    assert all(block.alt for block in section.blocks if hasattr(block, "alt"))
    table = values_of(blocks_of(section)["tune-comparison"])
    costs = [table[key][0]["cost"] for key in ("bound", "tuner", "best_constant", "without")]
    assert costs == sorted(costs)


@pytest.mark.parametrize(
    ("tuner", "words"),
    [(0.9, "10 % below"), (1.15, "15 % above"), (0.8, "20 % below"), (1.0, "1.00, the cost of the best constant gain")],
)
def test_the_answer_compares_the_costs(tuner, words):
    curves = LearningCurves(np.full((5, 1), tuner), np.full(5, tuner), 0, 0)
    tuning = SimpleNamespace(best_constant=SimpleNamespace(cost=1.0))
    text = tuner_in_short(SimpleNamespace(curves=curves, tuning=tuning))
    assert words in text
    assert text.endswith(f"{5 * (tuner < 1)} of 5 seeds end below that.")


def test_the_angle_that_a_moving_gain_leaves_is_named(small):
    data = small[0]
    drift = away(LAB, data.slews["with the tuner"])[-1]
    (fact,) = (fact for fact in small[1].facts if fact.unit == "mm")
    assert float(fact.value) == pytest.approx(1e3 * abs(drift), rel=0.05)


@pytest.mark.parametrize(
    ("arm", "word"),
    [
        (replace(LAB, hub=tfarm.Hub(inertia=math.inf)), "locked"),
        (replace(LAB, hub=tfarm.Hub(inertia=0.0)), "no inertia"),
        (replace(LAB, payload=tfarm.Payload(mass=math.inf)), "held"),
        (tfarm.load("sasaki2012"), "no damping"),
    ],
)
def test_other_arms_have_the_reason_why_there_is_no_tuner(arm, word):
    section = tuner_section(ArmReport(arm, Chain()))
    assert not section.words
    assert word in section.answer
    assert not section.blocks


def test_a_slew_that_runs_away_and_a_guard_that_fails_are_a_sentence():
    """Random arms met both: a traceback out of matplotlib, and 3.21e+06 in the middle of a sentence."""
    answer = tuner_section(ArmReport(LAB.with_numbers(damping=1e-14), Chain())).answer
    assert answer.startswith("No tuner here: no range of gains is proven stable")
    assert not re.search(r"\de-?\d", with_symbols(answer))
    words = prose("tuner_unproven", error=CertificationError("no sector at K1 = 3.21e+06, C = 6.94e-05 s"))
    assert "K1 = 3.21 × 10⁶, C = 6.94 × 10⁻⁵ s" in with_symbols(words)
    runs_away = SimpleNamespace(tuning=SimpleNamespace(without=SimpleNamespace(cost=math.inf)))
    assert "is unstable" in tuner_section(report_with(LAB, tuner=runs_away)).answer


@pytest.mark.parametrize(("samples", "seeds"), [(301, 20), (40_000, 20), (60_000, 13), (1_000_000, 1)])
def test_long_trials_have_fewer_seeds(samples, seeds):
    """At most 80 million samples in all of trainings of 100 trials, but one training always."""
    assert tuned.curve_seeds(100 * samples) == seeds


def test_a_slew_of_too_many_samples_has_no_study_but_its_number():
    """600,001 samples of a slew of 3 s at 5 us."""
    chain = Chain(sampling=Sampling(period=5e-6))
    words = tuner_section(ArmReport(LAB, chain)).answer
    assert "600,001 samples" in words
    assert "tfarm tune" in words


def test_the_rows_of_the_table_are_the_costs_of_the_command(small, capsys):
    own, drawn = answer(capsys, "tune", LAB.name), values_of(blocks_of(small[1])["tune-comparison"])
    names = {"tuner": "tuned", "without": "without", "best_constant": "best_constant", "bound": "lq_bound"}
    for key, name in names.items():
        assert drawn[key][0]["cost"] == pytest.approx(own[f"cost_{name}"], rel=1e-9)
    assert drawn["EI"][0]["cost"] == pytest.approx(own["shaped"]["EI"]["cost"], rel=1e-9)
