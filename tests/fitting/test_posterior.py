"""The posterior of a fit: covariance, draws, also given ranged numbers, coverage, its file, and arms that it allows.

Several records of one response: their scatter is the noise's where nothing else differs, and more where it does.
"""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.stats import chi2

import tfarm
from tests.fitting.planted import chi_squared_at
from tests.fitting.test_fit import LAB, PAIRS, measured
from tests.shared import refusal, sized, thinned
from tests.shell import refused, run
from tfarm.dsp import Chain
from tfarm.ensemble.declaration import load_study
from tfarm.errors import ParameterError
from tfarm.fitting.fit import arms_drawn, fit, response_band, save_fit, stable_share
from tfarm.fitting.posterior import Posterior, PosteriorNumber, load_posterior, repeats
from tfarm.plots.frequency import draw_band, draw_share
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import fit_section
from tfarm.spectrum.gains import default_gains

MASS, OFFSET, E, I = "payload.mass", "payload.offset", "link.youngs_modulus", "link.section.second_moment"
COVARIANCE = [[0.04, -0.018], [-0.018, 0.01]]  # of ln mass, and of offset/0.05: correlation -0.9
ROWS = 40_000
TIP = Path("tests/data/sweep/tip.csv").resolve()


def normal_posterior(covariance=COVARIANCE, keys=(MASS, OFFSET)):
    """Two numbers: one by its logarithm, about 0.2, and one by its size of 0.05, about -0.01."""
    numbers = [PosteriorNumber(key=key, value=value, low=None, high=None, size=size)
               for key, value, size in zip(keys, (0.2, -0.01), (0.0, 0.05), strict=True)]  # fmt: skip
    return Posterior(format="tfarm posterior 1", arm="lab", numbers=numbers, covariance=covariance, not_determined=[])


def joint(posterior, seed=0):
    """Coordinates of draws of both numbers (rows, 2)."""
    p = posterior.draws({}, np.random.default_rng(seed).standard_normal((ROWS, 2)))
    return np.c_[np.log(p[:, 0] / 0.2), (p[:, 1] + 0.01) / 0.05]


def test_moments_of_draws_are_the_best_values_and_the_covariance():
    x = joint(normal_posterior())
    deviation = np.sqrt(np.diag(COVARIANCE))
    assert abs(x.mean(axis=0)).max() < 5 * deviation.max() / math.sqrt(ROWS)
    assert np.cov(x.T) == pytest.approx(np.array(COVARIANCE), rel=5 * math.sqrt(2 / ROWS))


@pytest.mark.parametrize(("ranged", "other", "at"), [(0, 1, 0.25), (1, 0, -0.12)])
def test_draws_given_one_number_are_those_kept_of_the_joint_ones(ranged, other, at):
    """Rejection: of joint draws only those within 5 % of a deviation of the given coordinate."""
    x = joint(normal_posterior(), seed=1)
    width = 0.05 * math.sqrt(COVARIANCE[ranged][ranged])
    kept = x[abs(x[:, ranged] - at) < width, other]
    key, value = ((MASS, 0.2 * math.exp(at)), (OFFSET, -0.01 + 0.05 * at))[ranged]
    normal = np.random.default_rng(2).standard_normal((ROWS, 1))
    p = normal_posterior().draws({key: np.full(ROWS, value)}, normal)[:, 0]
    drawn = (p + 0.01) / 0.05 if other else np.log(p / 0.2)
    assert len(kept) > 300
    assert drawn.mean() == pytest.approx(kept.mean(), abs=5 * kept.std() / math.sqrt(len(kept)))
    assert drawn.std() == pytest.approx(kept.std(), rel=5 / math.sqrt(2 * len(kept)))
    assert stats.ks_2samp(drawn, kept).pvalue > 1e-4


def test_with_every_number_ranged_nothing_is_drawn():
    ranged = {MASS: np.full(3, 0.1), OFFSET: np.zeros(3)}
    assert normal_posterior().draws(ranged, np.empty((3, 0))).shape == (3, 0)


# ------------------------------------------------------------ of a fit


def test_sensors_are_marginalised():
    """The Schur complement of the information is the block of the whole inverse."""
    free = [E, "link.damping", "gain", "delay"]
    found = fit(LAB, measured(pairs=PAIRS[:1]), free=free, profile=False)
    whole = np.linalg.inv(found.jacobian.T @ found.jacobian)
    assert found.posterior.keys == (E, "link.damping")
    assert found.posterior.matrix == pytest.approx(whole[:2, :2], rel=1e-6)
    alone = np.linalg.inv(found.jacobian[:, :2].T @ found.jacobian[:, :2])
    assert (np.diag(found.posterior.matrix) > 1.01 * np.diag(alone)).any()


@pytest.fixture(scope="module")
def pair():
    """A fit of which these data determine the product E I alone."""
    return fit(LAB, measured(pairs=PAIRS[:1]), free=[E, I], profile=False)


def test_an_open_direction_needs_a_range(pair):
    assert np.linalg.matrix_rank(pair.posterior.matrix, tol=1e-9) == 1
    with pytest.raises(ParameterError, match=r"^posterior = '(link\.\S+)': .*--over \1=uniform:LOW,HIGH$"):
        pair.posterior.must_be_determined(("payload.mass",))
    for key in (E, I):
        pair.posterior.must_be_determined((key,))
    ranged = pair.arm.link.youngs_modulus * np.linspace(0.5, 2.0, 9)
    drawn = pair.posterior.draws({E: ranged}, np.zeros((9, 1)))[:, 0]
    assert ranged * drawn == pytest.approx(np.full(9, pair.arm.link.EI), rel=1e-3)  # rotary inertia
    sizes = np.linalg.eigvalsh(pair.posterior.with_all_determined.matrix)
    assert sizes == pytest.approx([np.trace(pair.posterior.matrix), 1.0], rel=1e-6)


@pytest.mark.parametrize("fits", sized(16, 100))
def test_the_posterior_covers_the_truth_at_its_rate(fits):
    """Squared distances of the truth, over the covariance, are those of chi squared: their sum, and 80 % of them."""
    squares = []
    for seed in range(fits):
        found = fit(LAB, measured(pairs=PAIRS[:1], share=0.1, seed=seed), free=[E, "link.damping"], profile=False)
        x = np.log([LAB.link.youngs_modulus / found.arm.link.youngs_modulus, LAB.damping / found.arm.damping])
        squares.append(x @ found.posterior.information @ x)
    inside = sum(each < stats.chi2.ppf(0.8, df=2) for each in squares)
    assert stats.binomtest(inside, fits, 0.8).pvalue > 1e-3
    assert 1e-3 < stats.chi2.cdf(sum(squares), df=2 * fits) < 1 - 1e-3


# ------------------------------------------------------------ its file


@pytest.fixture(scope="module")
def saved(pair, tmp_path_factory):
    """The folder of that fit's files."""
    folder = tmp_path_factory.mktemp("saved")
    save_fit(pair, folder / "fitted.toml")
    return folder


def test_the_file_is_the_posterior(pair, saved):
    assert load_posterior(saved / "fitted.posterior.json") == pair.posterior
    assert tfarm.load(saved / "fitted.toml") == pair.arm
    content = json.loads((saved / "fitted.posterior.json").read_text())
    assert [each["value"] for each in content["numbers"]] == [each.value for each in pair.parameters]
    assert content["not_determined"] == list(pair.not_determined)


def test_intervals_of_the_file_are_the_profiles(capfd, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    data = f"tip_acceleration/hub_torque={TIP}"
    options = ("fit", "sasaki2012-lab", "--data", data, "--free", E)
    code, out, _ = run(capfd, *options, "--save", "fitted.toml", "--json")
    assert code == 3  # E alone misses these data: its files are written all the same
    found = json.loads(out)
    (number,) = load_posterior("fitted.posterior.json").numbers
    assert [number.low, number.high] == [found["parameters"][0][key] for key in ("low", "high")]
    code, out, _ = run(capfd, *options, "--covariance", "--save", "-")
    assert code == 3
    assert out.startswith('name = "sasaki2012-lab-fitted"')
    assert sorted(each.name for each in tmp_path.iterdir()) == ["fitted.posterior.json", "fitted.toml"]


def test_a_study_reads_the_posterior_next_to_its_file_and_names_the_number_without_a_range(capsys, saved, tmp_path):
    (saved / "study.toml").write_text('arm = "fitted.toml"\nposterior = "fitted.posterior.json"\n')
    assert load_posterior(load_study(str(saved / "study.toml"))["posterior"]).arm == "sasaki2012-lab-fitted"
    options = ("study", str(saved / "fitted.toml"), "--posterior", str(saved / "fitted.posterior.json"), "--draws", "3",
               "--ask", "modes", "--out", str(tmp_path / "out"))  # fmt: skip
    assert "--over link." in refused(capsys, *options)
    code, _, _ = run(capsys, *options, "--over", f"{E}=uniform:6e10,8e10", "--workers", "1")
    assert code == 0


BAD = {
    "not JSON": (lambda one: "{", "Invalid JSON"),
    "another format": (lambda one: one | {"format": "tfarm posterior 2"}, "format = 'tfarm posterior 2'"),
    "no covariance": (lambda one: {key: one[key] for key in one if key != "covariance"}, "covariance"),
    "an unknown key": (lambda one: one | {"mean": 0.0}, "mean = 0.0"),
    "a text for a number": (lambda one: one | {"covariance": [["1", 0.0], [0.0, 1.0]]}, "covariance.0.0 = '1'"),
    "NaN": (lambda one: one | {"covariance": [[math.nan, 0.0], [0.0, 1.0]]}, "covariance.0.0 = nan"),
    "asymmetric": (lambda one: one | {"covariance": [[1.0, 0.5], [0.4, 1.0]]}, "symmetric"),
    "negative": (lambda one: one | {"covariance": [[1.0, 2.0], [2.0, 1.0]]}, "non-negative matrix of 2"),
    "of another size": (lambda one: one | {"covariance": [[1.0]]}, "2 rows and columns"),
    "ragged": (lambda one: one | {"covariance": [[1.0, 0.0], [1.0]]}, "2 rows and columns"),
    "no numbers": (lambda one: one | {"numbers": [], "covariance": []}, "covariance = []"),
    "a negative size": (lambda one: one | {"numbers": [n | {"size": -1.0} for n in one["numbers"]]}, "numbers.0.size"),
    "a mass of 0": (lambda one: one | {"numbers": [n | {"value": 0.0} for n in one["numbers"]]}, "payload.mass = 0.0"),
}


@pytest.mark.parametrize("case", BAD)
def test_another_file_is_refused_in_one_line(tmp_path, case):
    change, words = BAD[case]
    changed = change(normal_posterior().model_dump())
    file = tmp_path / "bad.posterior.json"
    file.write_text(changed if isinstance(changed, str) else json.dumps(changed))
    text = str(refusal(load_posterior, file))
    assert str(file) in text
    assert words in text
    assert len(text) < 400


def test_a_posterior_of_other_numbers_is_refused(capsys, tmp_path):
    file = tmp_path / "other.posterior.json"
    file.write_text(normal_posterior(keys=(MASS, "payload.colour")).model_dump_json())
    options = ("study", "sasaki2012-lab", "--posterior", str(file), "--out", str(tmp_path / "out"))
    assert "payload.colour" in refused(capsys, *options)


def test_a_deviation_below_a_millionth_is_written_as_such(pair):
    firm = replace(pair, jacobian=pair.jacobian * 1e6)
    assert np.linalg.eigvalsh(firm.posterior.matrix)[0] == pytest.approx(1e-12, rel=1e-3, abs=0.0)


@pytest.fixture(scope="module")
def known():
    return fit(LAB, measured(share=0.1), free=[E, "link.damping"], profile=False)


def test_intervals_by_the_covariance_reach_its_quantile_to_both_sides(known):
    for each in known.parameters:
        reach = np.exp(1.959964 * each.deviation / each.value)  # of a logarithm
        assert (each.low, each.high) == pytest.approx((each.value / reach, each.value * reach), rel=1e-6)
    assert sum(each.chi_squared for each in known.response_list) == pytest.approx(known.chi_squared, rel=1e-12)


def test_drawn_arms_are_spread_by_the_covariance(known):
    arms = arms_drawn(known, count=400)
    points = np.log([[arm.link.youngs_modulus / known.arm.link.youngs_modulus, arm.damping / known.arm.damping]
                     for arm in arms])  # fmt: skip
    covariance, spread = np.linalg.inv(known.jacobian.T @ known.jacobian), np.cov(points.T)
    deviation = np.sqrt(np.diag(covariance))
    assert np.sqrt(np.diag(spread)) == pytest.approx(deviation, rel=5 / np.sqrt(2 * 400))
    correlation = covariance[0, 1] / deviation.prod()
    assert spread[0, 1] / np.sqrt(spread[0, 0] * spread[1, 1]) == pytest.approx(correlation, abs=5 / np.sqrt(400))


def test_drawn_arms_agree_with_the_data():
    """Their own sum of squares, numbers of the sensor at their best, is within the quantile of chi squared: 99.9 %."""
    found = fit(LAB, measured(pairs=PAIRS[:1], share=0.1), free=[E, "link.damping", "gain"], profile=False)
    limit = found.chi_squared + chi2.ppf(0.999, df=2)
    for arm in arms_drawn(found, count=10):
        numbers = {E: arm.link.youngs_modulus, "link.damping": arm.damping}
        sums = [chi_squared_at(found, numbers | {"gain": gain}) for gain in np.linspace(0.8, 1.2, 201)]
        assert min(sums) < limit


def test_of_an_unknown_pair_the_product_hardly_varies(pair):
    arms = arms_drawn(pair, count=30)
    E, EI = (np.log([getattr(arm.link, name) for arm in arms]) for name in ("youngs_modulus", "EI"))
    assert np.std(E) > 0.3
    assert np.std(EI) < 1e-3


def test_gains_and_responses_on_all_of_them(known):
    """The band is that of the drawn arms' own responses, the map the share of those that are stable."""
    arms = arms_drawn(known, count=5)
    found = response_band(known, arms, "root_moment")
    band, best = draw_band.figure(known, found, "root_moment", 5).axes[0].get_children()[:2]
    vertices = band.get_paths()[0].vertices
    omega = 2 * np.pi * best.get_xdata()[400]
    sizes = [abs(tfarm.transfer(arm, "root_moment")(1j * omega)) for arm in (known.arm, *arms)]
    at = vertices[np.isclose(vertices[:, 0], best.get_xdata()[400], rtol=1e-12), 1]
    assert (at.min(), at.max(), best.get_ydata()[400]) == pytest.approx((min(sizes[1:]), max(sizes[1:]), sizes[0]))
    found = stable_share(arms[:2], [(0.3, 0.5), (0.3, 3.0)])
    share = draw_share.figure(known, found).axes[0].collections[0].get_array()
    stable = [tfarm.closed_loop_poles(arm, tfarm.HubFeedback(K1=0.3, K2=0.3), 6).unstable == 0 for arm in arms[:2]]
    assert share[0, 0] == np.mean(stable)
    assert share[-1].tolist() == [0.0] * 60


def test_the_section_of_a_page(known):
    section = fit_section(ArmReport(known.arm, Chain(), (), known), count=3)
    titles = [block.title for block in section.blocks]
    assert titles == [
        "Measured over fitted", "Fitted numbers", "Resonances", "The arms that the data leave possible",
        "Gains on all of these arms", "Margins over these arms",
    ]  # fmt: skip
    assert "the loop is stable on 3 of 3 of these arms" in " ".join(section.words)
    assert "[N m s/rad]" in section.blocks[4].figure.axes[0].get_xlabel()
    table = section.blocks[1]
    assert [row["value"] for row in table] == [each.value for each in known.parameters]
    each = [tfarm.margins(arm, default_gains(known.arm)).in_band.disk for arm in arms_drawn(known, count=3)]
    assert [row["disk_margin"][0] for row in section.blocks[-1]] == each


OMEGA = np.geomspace(8.0, 600.0, 60)


def records(moduli):
    """A record of each of these arms."""
    arms = [replace(LAB, link=replace(LAB.link, youngs_modulus=each)) for each in moduli]
    return [measured(arm, PAIRS[:1], seed=n, omega=OMEGA)[0] for n, arm in enumerate(arms)]


@pytest.mark.parametrize("scatter", thinned([0.01, 0.0], 2))
def test_the_scatter_between_records(scatter):
    """E that differs by 1 % from sweep to sweep: of its mean over eight records that leaves 1 %/sqrt(8)."""
    shares = np.array([-1.2, 0.7, 0.1, 1.4, -0.6, -1.1, 0.9, -0.2])
    moduli = LAB.link.youngs_modulus * (1 + scatter * shares)
    found = fit(LAB, records(moduli), free=[E], profile=False)
    several = repeats(found, found.parameters, draws=12)
    assert [row[E] for row in several.each] == pytest.approx(moduli, rel=5e-3 if scatter else 2e-3)
    times = several.times_wider[E]
    if not scatter:
        assert 0.4 < times < 1.8  # of eight records: a deviation is known to 1/sqrt(14)
        return
    spread = times * found.parameters[0].deviation / LAB.link.youngs_modulus
    assert spread == pytest.approx(scatter * shares.std(ddof=0) / np.sqrt(8), rel=0.5)
    assert times > 5
    low, high = several.intervals[E]
    assert low < LAB.link.youngs_modulus < high
    assert fit(LAB, records(moduli[:2]), free=[E], profile=False).records is None


def test_draws_of_a_posterior_with_variances_far_apart():
    """A number that is not determined next to one known to 6 digits: each is drawn with its own deviation."""
    covariance = np.diag([1e-12, 0.0, 0.2])
    numbers = [{"key": key, "value": 2.0, "low": None, "high": None, "size": 0.0} for key in "abc"]
    own = {"format": "tfarm posterior 1", "arm": "x", "numbers": numbers, "not_determined": ["b"]}
    # turned a little, so that the axes are none of the coordinates
    turn = np.linalg.qr(np.eye(3) + 1e-4 * np.random.default_rng(1).standard_normal((3, 3)))[0]
    covariance = turn @ covariance @ turn.T
    posterior = Posterior(**own, covariance=((covariance + covariance.T) / 2).tolist())
    drawn = np.log(posterior.with_all_determined.draws({}, np.random.default_rng(2).standard_normal((4000, 3))) / 2.0)
    along = np.std(drawn @ turn, axis=0)
    np.testing.assert_allclose(along, [1e-6, 1.0, np.sqrt(0.2)], rtol=0.1)
