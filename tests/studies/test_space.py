"""Rows of a study: distributions, grids, lists; independent of chunks, workers and order."""

import csv
import dataclasses
import math
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import tfarm
from tests.rigs import some_rig
from tests.shared import refusal
from tfarm.arm import to_toml
from tfarm.arm.schema import arm_of_table
from tfarm.arm.writing import numbers_of
from tfarm.case import Case
from tfarm.errors import ParameterError
from tfarm.fitting.posterior import Posterior, PosteriorNumber
from tfarm.studies.declaration import files_of
from tfarm.studies.space import ENDS, Listing, Subjects, lines_of, listing_of, space_of

CHANCE = 1e-3  # of a right distribution to be called wrong
TRUE = {  # by kind: its numbers, and the distribution by another formula than the code's
    "uniform": ([2.0, 5.0], lambda x: (x - 2) / 3),
    "loguniform": ([0.1, 10.0], lambda x: np.log(x / 0.1) / np.log(100)),
    "normal": ([1.0, 0.2], lambda x: stats.norm.cdf((x - 1) / 0.2)),
    "lognormal": ([3.0, 0.5], lambda x: stats.norm.cdf(np.log(x / 3) / 0.5)),
}
GAINS = tfarm.HubFeedback(K1=0.3, K2=0.3)


def made(over=None, *, draws=100, seed=1, listing=None, posterior=None):
    return space_of(over or {}, draws=draws, seed=seed, posterior=posterior, listing=listing)


def test_draws_have_their_distributions_and_are_independent():
    found = made({f"key {kind}": {kind: numbers} for kind, (numbers, _) in TRUE.items()}, draws=3000)
    columns = found.rows(0, 3000, None).T
    for column, (kind, (_, cdf)) in zip(columns, TRUE.items(), strict=True):
        assert stats.kstest(column, cdf).pvalue > CHANCE, kind
    pairs = [stats.spearmanr(columns[n], columns[k]).pvalue for n in range(4) for k in range(n)]
    assert min(pairs) > CHANCE / len(pairs)
    after = [stats.spearmanr(column[1:], column[:-1]).pvalue for column in columns]  # rows one after another
    assert min(after) > CHANCE / len(after)


def test_a_row_depends_on_seed_and_number_alone():
    over = {"a": {"uniform": [0, 1]}, "b": {"normal": [0, 1]}, "c": {"grid": [0, 1, 3]}, "d": {"values": [5, 7]}}
    found = made(over, draws=50)
    whole = found.rows(0, found.count, None)
    for size in (1, 7, 64):
        ends = [(first, min(first + size, found.count)) for first in range(0, found.count, size)]
        parts = {first: found.rows(first, last, None) for first, last in reversed(ends)}
        assert np.array_equal(np.vstack([parts[first] for first, _ in ends]), whole)
    assert np.array_equal(made(over, draws=7).rows(0, 42, None), whole[:42])
    assert not np.any(made(over, draws=50, seed=2).rows(0, 300, None)[:, 0] == whole[:, 0])


def test_each_draw_has_every_point_of_the_grid():
    found = made({"c": {"grid": [0, 1, 3]}, "a": {"uniform": [0, 1]}, "d": {"values": [5, 7]}}, draws=4)
    assert (found.keys, found.count, found.is_independent) == (("a", "c", "d"), 24, False)
    rows = found.rows(0, 24, None)
    for n in range(4):
        own = rows[6 * n : 6 * n + 6]
        assert np.ptp(own[:, 0]) == 0
        assert own[:, 1:].tolist() == [[c, d] for c in (0.0, 0.5, 1.0) for d in (5.0, 7.0)]
    alone = made({"c": {"grid": [0, 1, 3]}}, draws=1000)
    assert (alone.count, alone.is_independent) == (3, False)


def test_inverses_are_finite_at_both_ends_of_the_uniform_numbers(monkeypatch):
    for kind, (numbers, _) in TRUE.items():
        values = made({"a": {kind: numbers}}).values(np.array([ENDS]).T)
        assert np.isfinite(values).all()
        assert values[0] < values[1]
    monkeypatch.setattr(np.random, "Generator", lambda _: SimpleNamespace(random=np.zeros))
    assert made({"a": {"normal": [0, 1]}}).uniform(3).tolist() == [ENDS[0]]


COVARIANCE = np.array([[0.04, 0.06, 0.0], [0.06, 0.25, 0.1], [0.0, 0.1, 0.09]])
POSTERIOR = Posterior(
    format="tfarm posterior 1", arm="arm", covariance=COVARIANCE.tolist(), not_determined=[],
    numbers=[PosteriorNumber(key=key, value=value, size=size, low=None, high=None)
             for key, value, size in (("a", 2.0, 0.0), ("b", 5.0, 2.0), ("c", 7.0, 1.0))],  # a by its logarithm
)  # fmt: skip


def test_draws_of_a_posterior_have_its_covariance():
    """A number with a range of its own is not drawn again; how it conditions is in `tests.fitting.test_posterior`."""
    found = made(posterior=POSTERIOR, draws=4000)
    a, b, c = found.rows(0, 4000, None).T
    coordinates = np.array([np.log(a / 2), (b - 5) / 2, c - 7])
    deviation = np.sqrt(np.diag(COVARIANCE))
    for own, size in zip(coordinates, deviation, strict=True):
        assert stats.kstest(own / size, "norm").pvalue > CHANCE
    gap = (np.cov(coordinates) - COVARIANCE) / np.outer(deviation, deviation)
    assert abs(gap).max() < 4 * math.sqrt(2 / 4000)  # four deviations of a sample variance
    assert found.is_independent
    assert np.array_equal(found.rows(17, 19, None), found.rows(0, 4000, None)[17:19])
    ranged = made({"a": {"loguniform": [1.0, 4.0]}}, posterior=POSTERIOR, draws=4000)
    assert ranged.keys == ("a", "b", "c")
    a, b, _ = ranged.rows(0, 4000, None).T
    assert stats.kstest(np.log2(a) / 2, "uniform").pvalue > CHANCE
    slope = COVARIANCE[1, 0] / COVARIANCE[0, 0]
    assert np.polyfit(np.log(a / 2), (b - 5) / 2, 1)[0] == pytest.approx(slope, abs=0.1)


BAD_RANGES = {  # by remedy
    "LOW, HIGH": [{"uniform": [1.0, 1.0]}, {"uniform": [1.0]}],
    "MEAN, DEVIATION": [{"normal": numbers} for numbers in ([1.0], [], [1.0, 0.0], [1.0, 0.1, 2.0])],
    "above 0": [{"loguniform": [0.0, 1.0]}, {"loguniform": [1.0, 2.0, 3.0]}],
    "MEDIAN": [{"lognormal": [-1.0, 1.0]}, {"lognormal": [1.0, 1000.0]}],
    "finite": [{"uniform": numbers} for numbers in (
        [0.0, math.inf], [-1e308, 1e308], [0.0, math.nan], [True, 2], "01", 0.5)],
    "COUNT": [{"grid": [0.0, 1.0, count]} for count in (2.5, 0, 1e12)],
    "at least one number": [{"values": []}],
    'did you mean "uniform"': [{"unifrom": [0.0, 1.0]}],
    "give one of uniform": [{}, 0.5],
}  # fmt: skip


@pytest.mark.parametrize(("remedy", "range"), [(remedy, each) for remedy, of in BAD_RANGES.items() for each in of])
def test_a_bad_range_is_refused_in_one_line(remedy, range):
    error = refusal(made, {"a": range})
    assert (error.key, remedy in error.remedy) == ("over.a", True)


def test_a_space_of_nothing_or_of_too_much_is_refused():
    assert "nothing is varied" in str(refusal(made, {}))
    many = refusal(made, {"a": {"grid": [0, 1, 5000]}, "b": {"grid": [0, 1, 5000]}})
    assert (many.key, "10,000,000" in many.remedy) == ("rows", True)
    numbers = made({"a": {"uniform": np.array([0.0, 1.0])}, "b": {"values": (np.float64(1), np.int64(2))}})
    assert numbers.grids == {"b": (1.0, 2.0)}  # those of NumPy are numbers


def test_a_key_has_one_place(lab):
    listing = Listing("list.csv", ("a",), 3)
    assert "varied twice" in str(refusal(made, {"a": {"uniform": [0, 1]}}, listing=listing))
    assert "no grid with it" in str(refusal(made, {"b": {"grid": [0, 1, 3]}}, listing=listing))
    case = Case(lab, tfarm.Law({"hub_rate": 0.3, "root_moment": 0.3}))
    for pair in (("law.K1", "law.hub_rate"), ("law.hub_rate", "law.hub_rate.gain")):
        assert "two keys are one number" in str(refusal(Subjects, case, pair))


UNKNOWN_KEYS = [
    ("payload.mas", "over", 'did you mean "payload.mass"'),
    ("sampling.perod", "over", 'did you mean "sampling.period"'),
    ("converters.arithmetic", "over", "converters.rate_filter"),
    ("law.K9", "law", "known are"),
    ("law.foo", "law", "known are"),
    ("tuner.sed", "tuner", 'did you mean "seed"'),
    ("", "over", "known are"),
]


@pytest.mark.parametrize(("key", "named", "remedy"), UNKNOWN_KEYS)
def test_an_unknown_key_is_refused_before_any_arm(lab, key, named, remedy):
    for law in (GAINS, tfarm.Law({"hub_rate": 0.3})):
        error = refusal(Subjects, Case(lab, law), (key,))
        assert (error.key, remedy in error.remedy) == (named, True)


def test_values_reach_arm_chain_controller_and_tuner(lab):
    keys = ("payload.mass", "link.youngs_modulus", "sampling.period", "sampling.delay_samples", "law.K2", "tuner.seed",
            "actuator.hub_damping")  # fmt: skip
    one = Subjects(Case(lab, GAINS), keys).at((0.1, 7e10, 0.005, 1.5, 0.25, 3.0, 0.01))
    arm, chain = one.case.arm, one.case.chain
    assert (arm.payload.mass, arm.link.youngs_modulus) == (0.1, 7e10)
    assert arm.link.shear_modulus == lab.link.shear_modulus
    assert (chain.sampling.period, chain.sampling.delay_samples, chain.actuator.hub_damping) == (0.005, 1.5, 0.01)
    assert (one.case.gains, one.tuner) == (tfarm.HubFeedback(K1=0.3, K2=0.25), {"seed": 3.0})
    by_block = Subjects(Case(lab, tfarm.Law({"hub_rate": ([1.0], [0.1, 1.0])})), ("law.hub_rate.den.0",)).at((0.2,))
    assert by_block.case.law == tfarm.Law({"hub_rate": ([1.0], [0.2, 1.0])})


RIG_KEYS = ("link.2.length", "link.1.density", "attachment.1.mass", "hub.inertia", "payload.mass")


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_with_other_numbers_is_that_of_the_edited_file(seed):
    """Whose parts are all read and checked, and refused with the same words."""
    arm = some_rig(np.random.default_rng([23, seed]), segments=2)
    table = tomllib.loads(to_toml(arm))
    keys = [key for key in RIG_KEYS if key in numbers_of(arm)]
    values = {key: 1.1 * numbers_of(arm)[key] for key in keys}
    subjects = Subjects(Case(arm, GAINS), keys)
    for key, value in [*values.items(), (keys[-1], -1.0), (keys[-1], 1e-60)]:
        place, *rest = key.split(".")
        *numbers, name = rest
        here = table.setdefault(place, {})
        (here[int(numbers[0]) - 1] if numbers else here)[name] = value
        values[key] = value
        if key == keys[-1]:
            assert _built(lambda: subjects.at([*values.values()]).case.arm) == _built(lambda: arm_of_table(table))


def _built(make):
    """The arm, or the words of its refusal."""
    try:
        return make()
    except ParameterError as error:
        return str(error)


def test_a_stated_shear_modulus_stays_and_one_by_poissons_ratio_follows(lab):
    """In a study of the arm as it was loaded, and of its own file; the numbers of a fit are changed as the fit did."""
    E = "link.youngs_modulus"
    steel = tfarm.load("stocky-steel")
    for arm in (steel, arm_of_table(tomllib.loads(to_toml(steel)))):
        for modulus in (1.9e11, 2.2e11):
            one = Subjects(Case(arm, GAINS), (E,)).at((modulus,)).case.arm
            assert one.link.shear_modulus == modulus / 2.6  # the file: Poisson's ratio 0.3
        assert Subjects(Case(arm, GAINS), (E,)).notes == [f"{E}: G changes with it, at a constant Poisson's ratio"]
    both = Subjects(Case(steel, GAINS), (E, "link.shear_modulus"))
    assert both.at((1.9e11, 7e10)).case.arm.link.shear_modulus == 7e10
    stated = Subjects(Case(lab, GAINS), (E,))
    assert stated.notes == both.notes == [f"{E}: G as it is stated or varied itself"]
    assert stated.at((8e10,)).case.arm.link.shear_modulus == lab.link.shear_modulus
    fitted = Subjects(Case(lab, GAINS), (E,), fitted=(E,)).at((8e10,)).case.arm.link
    assert fitted.poissons_ratio == pytest.approx(lab.link.poissons_ratio, rel=1e-14)
    changed = dataclasses.replace(steel.link, youngs_modulus=1.9e11)  # which states its shear modulus
    assert (changed.stated_ratio, changed.shear_modulus) == (None, steel.link.shear_modulus)


def test_laws_that_differ_in_the_last_bit_are_other_studies(lab):
    declared = {"over": {"payload.mass": {"uniform": [0.0, 1.0]}}, "ask": ["modes"], "rows": None, "posterior": None}
    laws = [tfarm.HubFeedback(K1=K1, K2=0.3) for K1 in (0.3, math.nextafter(0.3, 1))]
    laws += [
        tfarm.Law.of_matrices(np.array([[-1.0]]), [[gain]], [[1.0]], [[0.0]], ["hub_rate"])
        for gain in (1.0, math.nextafter(1, 2))
    ]
    files = [files_of(Case(lab, law), declared) for law in laws]
    assert len({(each["arm.toml"], each.get("law.mat")) for each in files}) == 4


# ------------------------------------------------------------ lists


def listed(folder, text, name="list.csv"):
    (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder / name


def test_a_list_is_read_row_by_row(tmp_path):
    path = listed(tmp_path, "\ufeffpayload.mass, law.K2\n0.1,0.2\n 3e-1 ,4\n-5,+6.5\n".replace(", ", ","))
    found = listing_of(path)
    assert (found.columns, found.size) == (("payload.mass", "law.K2"), 3)
    assert [block.tolist() for block in found.blocks([(0, 1), (2, 3)])] == [[[0.1, 0.2]], [[-5.0, 6.5]]]
    own = made(listing=found)
    assert (own.count, own.is_independent) == (3, False)
    (rows,) = found.blocks([(1, 3)])
    assert own.rows(1, 3, rows).tolist() == [[0.3, 4.0], [-5.0, 6.5]]


BAD_LISTS = {  # by what is named
    "row 1, column b": ["a,b\n1,2\n3,\n", "a,b\n1,2\n3,null\n"],
    "row 0, column a": ["a,b\nnan,2\n"],
    "row 0, column b": [f"a,b\n1,{cell}\n" for cell in ("inf", "1e999", '"[1, 2]"', "one", "1_0", "True")],
    "row 0": ["a,b\n1\n", "a,b\n1,2,3\n"],
    "row 1": ["a,b\n1,2\n\n3,4\n"],
    "column": ["a,a\n1,2\n", "a,\n1,2\n"],
    "list": ["a,b\n", "", 'a\n"1\n', b"a\n\xff\xfe\n"],
}


@pytest.mark.parametrize(("key", "text"), [(key, text) for key, texts in BAD_LISTS.items() for text in texts])
def test_a_bad_list_is_refused_with_row_and_column(tmp_path, key, text):
    error = refusal(listing_of, listed(tmp_path, text))
    assert (error.key, "list.csv" in str(error)) == (key, True)
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(ParameterError, match=r"cannot be read|is a folder"):
            listing_of(path)


PARQUET_CELLS = [
    ([1.0, None], None), ([1.0, math.nan], None), ([[1.0], [2.0]], None), ([True, False], None), (["1", "x"], None),
    ([1, 2], [1.0, 2.0]), (["1", "2"], [1.0, 2.0]),
]  # fmt: skip


@pytest.mark.parametrize(("cells", "values"), PARQUET_CELLS)
def test_a_list_in_parquet_has_the_same_rules(tmp_path, cells, values):
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "list.parquet"
    parquet.write_table(arrow.table([arrow.array([0.5, 1.5]), arrow.array(cells)], ["a", "b"]), path)
    if values is None:
        with pytest.raises(ParameterError, match=r"list\.parquet: row [01], column b"):
            listing_of(path)
    else:
        assert list(lines_of(path)) == [("a", "b"), [0.5, values[0]], [1.5, values[1]]]
    parquet.write_table(arrow.table([arrow.array([1.0])] * 2, ["a", "a"]), path)
    assert "each column has a key of its own" in str(refusal(listing_of, path))
    assert "cannot be read" in str(refusal(listing_of, listed(tmp_path, b"PAR1 no table PAR1", "other.parquet")))


@pytest.mark.survey
def test_a_long_list_takes_no_memory(tmp_path):
    import tracemalloc

    peaks = []
    for count in (10_000, 300_000):
        with (tmp_path / "list.csv").open("w", newline="") as file:
            csv.writer(file).writerows([("a", "b"), *((n, 0.5) for n in range(count))])
        tracemalloc.start()
        found = listing_of(tmp_path / "list.csv")
        assert found.size == count
        for block in found.blocks([(n, n + 1000) for n in range(0, count, 1000)]):
            assert len(block) == 1000
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 1e5  # bytes
