"""Findings of a study: confidence, quantiles, drivers, failures, worst arm, Sobol' indices; its columns."""

import math

import numpy as np
import pytest
from scipy import stats

import tfarm
from tests import survey
from tests.shared import refusal, sized, thinned
from tests.shell import answer
from tests.studies.planted import confidence
from tfarm.arm.chain import load_chain
from tfarm.arm.law_tables import load_law
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.errors import ParameterError
from tfarm.spectrum.gains import default_gains
from tfarm.studies import quantities as room
from tfarm.studies import running
from tfarm.studies.candidates import learning_curves
from tfarm.studies.findings import failures_of, least_share, shares_of, spreads_of
from tfarm.studies.quantities import COLUMNS, column_names, order_of, sources_of, values_of
from tfarm.studies.running import StudyPlan, chunk
from tfarm.studies.space import Subject, Subjects, space_of
from tfarm.studies.worst import badness
from tfarm.tuner import tune
from tfarm.tuner.tuning import usual_plan

GAINS = tfarm.HubFeedback(K1=0.3, K2=0.3)
FIRST, SECOND = (f"modes.natural_frequency_rad_s.{n}" for n in (1, 2))


def run(arm, over=None, ask=("modes",), law=GAINS, **others):
    return tfarm.study(arm, over, ask, law, workers=1, part=others.pop("part", 1000), **others)


# ------------------------------------------------------------ confidence


@pytest.mark.parametrize(("k", "n"), [(1, 1), (1, 2), (7, 9), (58, 60), (1990, 2000), (100_000, 100_000)])
def test_at_the_bound_so_many_stable_arms_have_a_chance_of_5_per_cent(k, n):
    """Of n stable arms it is the closed form 0.05^(1/n), to the rounding of the inverse beta function."""
    p = least_share(k, n)
    terms = [math.comb(n, j) * math.exp(j * math.log(p) + (n - j) * math.log1p(-p)) for j in range(k, n + 1)]
    assert math.fsum(terms) == pytest.approx(0.05, rel=1e-9)  # rounding of powers of some thousand factors
    assert least_share(n, n) == pytest.approx(0.05 ** (1 / n), rel=1e-12)
    assert least_share(0, n) == 0.0


def words(stability, certainty):
    return {"sampled.stability": np.array(stability, object), "sampled.certainty": np.array(certainty, object)}


@pytest.mark.parametrize(
    ("texts", "word"),
    [
        (["certified to 3 rad/s", "certified to 4 rad/s"], "certified"),
        (["certified to 3 rad/s", "converged, first 8 modes"], "converged"),
        (["approximate, first 8 modes", "converged, first 8 modes"], "approximate"),
        (["certified to 3 rad/s", ""], ""),
    ],
)
def test_the_weakest_word_of_certainty_is_printed(texts, word):
    table = words([*["stable"] * 2, "unstable", ""], [*texts, "approximate, first 9 modes", ""])
    (found,) = shares_of(table, tuple(table), is_independent=True)
    assert (found.stable, found.other, found.open, found.certainty) == (2, 1, 1, word)
    assert found.at_least == least_share(2, 4)  # arms without a result count as not stable
    assert f"{word} stable on 2 of 4 arms (1 not stable, 1 not determined)".strip() in found.finding


def test_a_bound_is_rounded_down():
    for count in (*range(1, 200), 2000):
        table = words(["stable"] * count, ["certified to 3 rad/s"] * count)
        (found,) = shares_of(table, tuple(table), is_independent=True)
        assert found.finding.startswith(f"certified stable on {count:,} of {count:,} arms: at least ")
        shown = float(found.finding.split("at least ")[1].split(" %")[0])
        assert 0 <= 0.05 ** (1 / count) - shown / 100 < 1e-4


def test_counts_alone_of_a_grid_a_list_and_a_study_that_is_not_complete(lossless, tmp_path):
    ask = ["continuous.stability"]
    (tmp_path / "list.csv").write_text("law.K1\n0.2\n-0.1\n")
    listed = run(lossless, None, ask, rows=tmp_path / "list.csv", out=tmp_path / "list")
    grid = run(lossless, {"law.K1": {"values": [0.2, -0.1]}}, ask, out=tmp_path / "grid")
    for found in (listed, grid):
        assert found.shares[0].at_least is None
        assert "continuous-time: stable on 1 of 2 arms (1 not stable)" in found.finding
    drawn = {"law.K1": {"uniform": [0.1, 0.2]}}
    started = run(lossless, drawn, ask, draws=4, part=2, stop_after=0.0, out=tmp_path / "started")
    assert (started.is_complete, started.shares[0].at_least) == (False, None)
    whole = run(lossless, drawn, ask, draws=4, part=2, out=tmp_path / "started")
    assert whole.shares[0].at_least == pytest.approx(0.05**0.25, rel=1e-12)


@pytest.mark.parametrize("size", sized(5, 200))
def test_studies_keep_their_confidence(size):
    outcomes, _, wrong = survey.tally(confidence, size, 1)
    assert (outcomes["right"], wrong) == (size, 0)


# ------------------------------------------------------------ spread and drivers


def test_quantiles_are_those_of_the_finite_values():
    table = {FIRST: np.array([*np.arange(101.0), math.nan, math.inf]), "a": np.zeros(103)}
    (found,) = spreads_of(table, [FIRST], ["a"])
    assert (found.arms, found.least, found.low, found.median, found.high, found.largest) == (101, 0, 5, 50, 95, 100)
    assert (found.driver, found.correlation) == (None, None)


def test_the_driver_is_the_number_of_the_largest_rank_correlation():
    rng = np.random.default_rng(3)
    a, b, c = rng.random((3, 400))
    table = {FIRST: np.exp(-5 * a) + 0.2 * b, "a": a, "b": b, "c": c}
    (found,) = spreads_of(table, [FIRST], ["a", "b", "c"])
    ranks = [stats.rankdata(each) for each in (a, table[FIRST])]
    assert found.driver == "a"
    assert found.correlation == pytest.approx(np.corrcoef(*ranks)[0, 1], rel=1e-12)
    assert found.correlation < -0.8
    (chance,) = spreads_of({**table, FIRST: rng.random(400)}, [FIRST], ["a", "b", "c"])
    assert chance.driver is None


def test_arms_that_fail_are_counted_with_reasons(lab, tmp_path, monkeypatch):
    """Without their numbers, which differ from arm to arm."""
    texts = ["", "step: pole 3.5e-2 lost", "step: pole -7 lost", "other"]
    found = failures_of({"row": np.arange(4.0), "failed": np.array(texts, object)})
    assert [(each.reason, each.arms, each.row) for each in found] == [("step: pole N lost", 2, 1), ("other", 1, 3)]
    monkeypatch.setattr(running, "CHECKED", 1)
    (tmp_path / "list.csv").write_text("payload.mass\n0.1\n-1\n0.2\n-2\n")
    found = run(lab, None, rows=tmp_path / "list.csv", out=tmp_path / "s")
    assert [(each.arms, each.row) for each in found.failures] == [(2, 1)]
    assert ["payload.mass" in text for text in found.table()["failed"]] == [False, True, False, True]
    assert np.isnan(found.table()[FIRST]).tolist() == [False, True, False, True]
    monkeypatch.undo()
    with pytest.raises(ParameterError, match="2 of 4 arms are illegal, the first in row 1"):
        run(lab, None, rows=tmp_path / "list.csv", out=tmp_path / "t")
    assert not (tmp_path / "t").exists()


# ------------------------------------------------------------ quantities


@pytest.mark.parametrize(
    ("word", "names"),
    [
        ("sampled.stability", {"sampled.stability"}),
        ("stability", {"continuous.stability", "sampled.stability"}),
        ("delay_margin_periods", {"continuous.delay_margin_periods", "sampled.delay_margin_periods"}),
        ("card", {name for name in COLUMNS if name.startswith(("continuous.", "sampled."))}),
        ("step", {name for name in COLUMNS if name.startswith("step.")}),
        ("step.sampled.tip.settling_time_s", {"step.sampled.tip.settling_time_s"}),
        ("modes", {f"modes.natural_frequency_rad_s.{n}" for n in range(1, 6)}),
    ],
)
def test_a_word_names_the_columns_nearest_to_the_front(word, names):
    assert set(column_names([word])) == names
    for other, near in {"delay_margin": "delay_margin_ms", "damped_mode": "damped_modes", "": "known are"}.items():
        assert near in str(refusal(column_names, [other]))


def test_values_are_those_of_the_card(lab):
    """Whole, and of the stability and its certainty alone, which need no margins."""
    case = Subject(Case(lab, GAINS), {})
    card = tfarm.result_card(lab, GAINS)
    whole = values_of(case, sources_of(column_names(["card"])))
    for loop in ("continuous", "sampled"):
        own = getattr(card, loop)
        assert whole[f"{loop}.delay_margin_ms"] == own.delay_margin.value
        assert whole[f"{loop}.least_damping.mode"] == own.least_damping.mode
        names = [f"{loop}.stability", f"{loop}.certainty"]
        assert values_of(case, sources_of(names)) == {name: whole[name] for name in names} | {"failed": None}


def test_a_row_without_a_result_keeps_its_error_in_the_table_and_in_its_file(lab, tmp_path):
    """At that gain a pole is on the axis to working precision: the loop is not determined, and the sampled one is."""
    over = {"law.K2": {"values": [0.3, 1.0305375542174282]}}
    ask = ["continuous.stability", "sampled.stability"]
    found = run(lab, over, ask, out=tmp_path)
    assert [found.table()[name].tolist() for name in ask] == [["stable", ""], ["stable", "stable"]]
    _, text = found.table()["failed"].tolist()
    assert text.startswith("continuous: ")
    assert "on the imaginary axis to working precision" in text
    assert [(each.arms, each.row) for each in found.failures] == [(1, 1)]
    (file,) = tmp_path.glob("part-*.parquet")
    kept = pytest.importorskip("pyarrow.parquet").read_table(file).to_pydict()
    assert (kept["failed"], kept[ask[0]]) == ([None, text], ["stable", None])
    assert run(lab, over, ask, out=tmp_path).table()["failed"].tolist() == ["", text]


def test_a_law_in_z_has_a_sampled_loop_alone(lab):
    law = tfarm.Law({"hub_rate": 0.3}, period=0.01, references=("hub_rate",))
    names = ["continuous.stability", "sampled.stability"]
    found = values_of(Subject(Case(lab, law), {}), sources_of(names))
    assert found == {"continuous.stability": None, "sampled.stability": "stable", "failed": None}


ASKED = ["step.sampled.tip.settling_time_s", "step.continuous.tip.settling_time_s", "damped_modes"]


@pytest.mark.parametrize("name", thinned(sorted(tfarm.presets(), key=lambda name: name != "sasaki2012-lab"), 6))
def test_time_response_and_damping_ratios_of_every_preset(name):
    case = Case(tfarm.load(name), default_gains(tfarm.load(name)), load_chain(name))
    found = values_of(Subject(case, {}), sources_of(column_names(ASKED)))
    assert found["failed"] is None
    response = tfarm.step(case.arm, case.law, case.chain, "slew")
    for loop in ("sampled", "continuous"):
        own = getattr(response, loop)
        assert found[f"step.{loop}.tip.settling_time_s"] == (own and own.tip and own.tip.settling_time)
    table = tfarm.modes(case.arm, 5)
    s = tfarm.damped_modes(table).eigenvalues[table.index > 0, 0]
    assert [found[f"damped_modes.damping_ratio.{n}"] for n in range(1, 6)] == (-s.real / abs(s)).tolist()


# ------------------------------------------------------------ worst arm


@pytest.mark.parametrize(
    ("word", "stability", "values", "worst"),
    [
        ("sampled.delay_margin_ms", "sampled.stability", [3.0, 1.0, 2.0, math.nan], 1),
        ("sampled.peak_sensitivity", "sampled.stability", [3.0, 1.0, math.inf, math.nan], 2),
        ("step.sampled.tip.settling_time_s", "step.sampled.stability", [3.0, 1.0, 2.0, math.nan], 0),
        ("step.sampled.tip.steady_state_error", "step.sampled.stability", [-3.0, 1.0, 2.0, math.nan], 0),
        (FIRST, "", [3.0, 1.0, 2.0, math.nan], 1),
        ("poles.re_1_s.1", "", [-3.0, -1.0, -2.0, math.nan], 1),
    ],
)
def test_the_order_of_worse_arms(word, stability, values, worst):
    order = order_of(word)
    assert order[1:] == ((stability,) if stability else ())
    rows = [{word: value, stability: "stable"} if stability else {word: value} for value in values]
    assert int(np.argmax([badness(order, row) for row in rows])) == worst
    if stability:
        unstable = {word: math.nan, stability: "unstable"}
        assert int(np.argmax([badness(order, row) for row in [*rows, unstable]])) == 4
    assert order_of("damping_ratio.2") == ("damped_modes.damping_ratio.2",)
    assert "2 quantities of numbers, not one" in str(refusal(order_of, "delay_margin_ms"))


def test_the_worst_arm_is_the_worst_of_a_fine_grid(lab, tmp_path):
    """A mass along the link lowers the second frequency most at a place within the range."""
    arm = tfarm.Arm(link=lab.link, hub=lab.hub, attachments=(tfarm.Attachment(x=0.5, mass=0.2),), name="mass")
    over = {"attachment.1.x": {"uniform": [0.1, 0.75]}}
    found = run(arm, over, draws=5, worst=SECOND, out=tmp_path / "s")
    grid = run(arm, {"attachment.1.x": {"grid": [0.1, 0.75, 400]}}, out=tmp_path / "g").table()
    least = int(np.argmin(grid[SECOND]))
    assert 0 < least < 399
    assert found.worst.drawn == found.table()[SECOND].min() > found.worst.found
    assert found.worst.found <= grid[SECOND][least]
    assert found.worst.numbers["attachment.1.x"] == pytest.approx(grid["attachment.1.x"][least], abs=0.65 / 399)
    again = tfarm.load(found.worst.file)
    assert tfarm.modes(again, 5).natural_frequency[-4] == found.worst.found
    assert load_law(found.worst.file).gains == GAINS
    end = run(arm, {"payload.mass": {"uniform": [0.0, 0.5]}}, draws=5, worst=FIRST, out=tmp_path / "e").worst
    assert end.numbers["payload.mass"] == pytest.approx(0.5, abs=1e-4)  # tolerance of the simplex
    assert end.found <= end.drawn
    of_grid = run(lab, {"payload.mass": {"grid": [0.0, 0.5, 4]}}, worst=FIRST, out=tmp_path / "h").worst
    assert (of_grid.row, of_grid.evaluations, of_grid.drawn) == (3, 0, of_grid.found)


# ------------------------------------------------------------ Sobol' indices


def moments(name, numbers, power):
    """Mean and variance of x^power, by closed forms."""

    def mean(p):
        if name == "lognormal":
            return numbers[0] ** p * math.exp((p * numbers[1]) ** 2 / 2)
        low, high = numbers
        return (high**p - low**p) / (p * math.log(high / low))

    return mean(power), mean(2 * power) - mean(power) ** 2


def test_indices_of_a_product_are_the_closed_form(lab, tmp_path):
    """With a locked hub and no payload a frequency is sqrt(E/rho) times a constant; E and rho are independent."""
    arm = tfarm.Arm(link=lab.link, hub=lab.hub, input="hub_angle", name="clamped")
    E, rho = lab.link.youngs_modulus, lab.link.density
    over = {"link.youngs_modulus": ("lognormal", [E, 0.5]), "link.density": ("loguniform", [rho, 3 * rho])}
    seen = []
    found = run(
        arm, {key: {kind: numbers} for key, (kind, numbers) in over.items()}, [FIRST], draws=20, sobol=256,
        out=tmp_path / "s", progress=lambda *each: seen.append(each),
    )  # fmt: skip
    (m1, v1), (m2, v2) = moments(*over["link.youngs_modulus"], 0.5), moments(*over["link.density"], -0.5)
    whole = v1 * m2**2 + v2 * m1**2 + v1 * v2
    first = {"link.youngs_modulus": v1 * m2**2 / whole, "link.density": v2 * m1**2 / whole}
    total = {"link.youngs_modulus": 1 - first["link.density"], "link.density": 1 - first["link.youngs_modulus"]}
    assert [each.key for each in found.sobol] == list(over)
    for each in found.sobol:
        assert each.first == pytest.approx(first[each.key], abs=0.05)  # of a sample of 256, by its own intervals
        assert each.total == pytest.approx(total[each.key], abs=0.05)
        assert each.first_interval[0] <= each.first <= each.first_interval[1]
    assert found.done == 20  # rows of the sample are no rows of the study
    (cost, *_) = [each for each in seen if "Sobol'" in each[2]]
    assert cost[:2] == (0, 0)
    assert cost[2].startswith("Sobol' indices of 1,024 further arms, about ")


def test_a_quantity_without_a_value_on_each_arm_has_no_indices(lab, tmp_path):
    over = {"law.K1": {"uniform": [-0.3, 0.3]}, "payload.mass": {"uniform": [0.0, 0.1]}}
    words = ["continuous.time_constant_s", FIRST]
    found = run(lab, over, words, tfarm.HubFeedback(K1=0.3), draws=1, sobol=2, out=tmp_path / "s").sobol
    by_name = {each.quantity: each for each in found}
    assert by_name["continuous.time_constant_s"].note.startswith("no finite value on ")
    assert by_name["continuous.time_constant_s"].first is None
    assert [each.first for each in found if each.quantity == FIRST and each.key == "law.K1"] == [0.0]


@pytest.mark.parametrize(
    ("over", "size", "remedy"),
    [
        *(({"uniform": [0, 1]}, size, "a power of 2") for size in (-1, 3, 100)),
        ({"uniform": [0, 1]}, 4, "two or more independent distributions"),
        ({"grid": [0, 1, 3]}, 4, "two or more independent distributions"),
    ],
)
def test_indices_need_a_power_of_2_and_two_independent_distributions(lab, tmp_path, over, size, remedy):
    assert remedy in str(refusal(run, lab, {"payload.mass": over}, sobol=size, out=tmp_path / "s"))
    assert not (tmp_path / "s").exists()


LAB = tfarm.load("sasaki2012-lab")


def values(words, law=GAINS, **numbers):
    """Values of the columns of some words for one arm, with other numbers by key."""
    subject = Subjects(Case(LAB, law), tuple(numbers)).at(tuple(numbers.values()))
    return values_of(subject, sources_of(column_names(words)))


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
    found, intervals = values(["interval"]), tfarm.margins(LAB, GAINS).windows
    assert found["interval.verdict"] == "stable"
    for gain in ("K1", "K2"):
        ends = [found[f"interval.{gain}.{name}"] for name in ("low", "high", "low_is", "high_is")]
        assert ends == list(intervals[gain].interval)
    for factor, unstable in ((0.999, 0), (1.001, 2)):
        law = tfarm.HubFeedback(K1=0.3, K2=found["interval.K2.high"] * factor)
        assert tfarm.closed_loop_poles(LAB, law, 6).unstable == unstable
    beyond = values(["interval"], law=tfarm.HubFeedback(K1=0.3, K2=2.0))
    on_the_axis = values(["interval"], law=tfarm.HubFeedback(K1=0.3, K2=1.0305375542174282))
    assert [each["interval.verdict"] for each in (beyond, on_the_axis)] == ["unstable", "undecided"]
    assert beyond["interval.K2.high"] is on_the_axis["interval.K2.high"] is None


# ------------------------------------------------------------ the tuner


def test_the_tuner_of_a_row_is_that_of_the_command(capsys):
    """Seed, trials and cost; the same again, and another for another seed."""
    names = ("tuner.cost", "tuner.cost_best_constant", "tuner.trials", "tuner.is_zero", "tuner.trial_cost.4")
    space = space_of({"tuner.seed": {"values": (3, 4, 3)}}, draws=1, seed=0)
    table = chunk(StudyPlan(Case(LAB, GAINS), space, names), 0, 3)
    one = answer(capsys, "tune", "sasaki2012-lab", "--seed", "3")
    assert [table[name][0] for name in names] == [one["cost_tuned"], one["cost_best_constant"], 100, 0, one["cost"][3]]
    assert [table[name][2] for name in names] == [table[name][0] for name in names]
    assert table["tuner.cost"][1] != table["tuner.cost"][0]


def test_learning_curves_begin_with_the_training_of_the_plan():
    seen = []
    plan, chain = usual_plan(LAB), Chain()
    tuning = tune(LAB, plan, chain)
    curves = learning_curves(LAB, plan, chain, 3, lambda *done: seen.append(done))
    assert seen == [(n, 3, "learning curves") for n in (1, 2, 3)]
    assert curves.costs[0].tolist() == tuning.training.costs.tolist()
    assert curves.final[0] == tuning.training.result.cost
