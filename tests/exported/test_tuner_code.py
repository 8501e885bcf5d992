"""A trained tuner in C: against Python bit for bit, its exponential against mpmath, its network against NumPy's."""

import math
from dataclasses import replace
from fractions import Fraction
from itertools import product

import mpmath
import numpy as np
import pytest

import tfarm
from tests.exported import tuners
from tests.exported.compilers import COMPILERS, KINDS, STRICT, build, needed, run
from tests.exported.tuners import DIFFERENCE, LEVELS, PRECISIONS, SECTOR, exported, is_equal
from tests.hostile import C_TEXTS, NAME
from tests.shared import sized, thinned
from tests.shell import answer, refused
from tests.survey import tally
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.errors import ParameterError
from tfarm.exported import tuner_code as functions
from tfarm.exported.tuner_code import ExportedTuner
from tfarm.loop.sampled import sampled_loop
from tfarm.tuner import find_guard, slew_trial
from tfarm.tuner.guard import sector_guard
from tfarm.tuner.trial import to_text

SOURCES = ("tuner.c", "self_test.c")
LAB = "sasaki2012-lab"
GUARDED = {"guard": SECTOR, "guard_kind": "time-varying"}  # certified on the laboratory arm
EXCEEDED = {  # 0.16 + (0.43 - 0.16) is above 0.43 in either precision, and the sum of the network in most samples
    "guard": (0.16, 0.43), "guard_kind": "frozen", "W1": [[0.1] * 6] * 2, "w2": [200.0] * 2, "scales": [1.0] * 6,
}  # fmt: skip
FROZEN = {"guard": SECTOR, "guard_kind": "frozen"}
REALS = [KINDS[each] for each in PRECISIONS]


def rng_of(seed):
    return np.random.default_rng(seed)


def tuner_of(seed, **changed):
    """A tuner that is certified on the laboratory arm."""
    return tuners.some_tuner(rng_of(seed), **GUARDED | {"Kp": 0.0, "signals": "vibration"} | changed)


def numbers_of(real):
    """Constants of exp and log in a precision."""
    return functions.constants_of_tuner(tuner_of(0), real)


# ------------------------------------------------------------ exp


def ulps(found, exact, real):
    """Error of a number in units in the last place of the exact one."""
    return abs(mpmath.mpf(float(found)) - exact) / mpmath.mpf(float(np.spacing(real(float(exact)))))


@pytest.mark.parametrize("size", sized(2000, 100_000))
@pytest.mark.parametrize("real", REALS)
def test_errors_of_exp(real, size):
    """Within the stated units in the last place of mpmath, next to both ends, changes of k, and tiny ones."""
    of, rng = numbers_of(real), rng_of(0)
    ends = np.array([0.5, 1.5, 2.5]) * math.log(2.0)
    x = -np.r_[rng.uniform(0, -float(of.lowest), size), 10 ** rng.uniform(-30, 0, size), rng.uniform(0, 2, size)]
    x = np.r_[x, -ends, -ends * (1 + 2.0**-20), np.nextafter(of.lowest, real(0))].astype(real)
    with mpmath.workprec(150):
        exp = max(ulps(functions.exponential(each, of), mpmath.exp(mpmath.mpf(float(each))), real) for each in x)
    assert 0.5 < exp <= 1.5


@pytest.mark.parametrize(("real", "digits"), [(np.float64, 53), (np.float32, 24)])
def test_constants_and_ends_of_exp(real, digits):
    """ln 2 = h + l, k h exact; the terms that the series leaves out are below a tenth of half a unit."""
    of = numbers_of(real)
    with mpmath.workprec(200):
        left = abs(mpmath.log(2) - mpmath.mpf(float(of.high)) - mpmath.mpf(float(of.low)))
        assert left < mpmath.mpf(2) ** (-digits) * abs(mpmath.mpf(float(of.low)))
    largest = math.ceil(-float(of.lowest) / math.log(2.0))
    for k in (1, 3, largest - 1, largest):
        assert Fraction(float(real(k) * of.high)) == k * Fraction(float(of.high))
    assert float(of.shift) == 1.5 * 2 ** (digits - 1)
    r = math.log(2) / 2
    assert r**of.taylor.size / math.factorial(of.taylor.size) / math.exp(-r) < 0.1 * 2.0**-digits
    np.testing.assert_array_equal(of.taylor, [real(1 / math.factorial(n)) for n in range(of.taylor.size)])
    assert [functions.exponential(real(x), of) for x in (0, of.lowest, -math.inf)] == [1, 0, 0]
    assert [functions.sigmoid(real(x), of) for x in (-math.inf, 0, math.inf)] == [0, 0.5, 1]


# ------------------------------------------------------------ the step


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("signals", ["vibration", "total"])
def test_a_sample_that_is_not_finite_is_refused(precision, signals):
    """An error status, the torque before, the state kept: what follows is as without that sample."""
    tuner, rng = ExportedTuner(tuner_of(1, signals=signals), precision), rng_of(0)
    rows = rng.normal(size=(40, len(tuner.inputs)))
    expected, _ = tuner.run(rows)
    for place in range(rows.shape[1]):
        for value in (math.nan, math.inf, -math.inf, 1.1 * float(tuner.numbers.largest)):
            odd = np.insert(rows, 20, rows[20], axis=0)
            odd[20, place] = value
            tuner.reset()
            torque, status = tuner.run(odd)
            assert status.nonzero()[0].tolist() == [20]
            assert status[20] == 1
            assert torque[20] == torque[19]
            np.testing.assert_array_equal(np.delete(torque, 20), expected)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_no_kept_state_refuses_a_later_sample(precision):
    """The largest inputs, weights and the smallest scales: a refused result is one of that sample alone."""
    for seed in range(20):
        rng = rng_of(seed)
        saved = tuners.some_tuner(rng)
        tuner = ExportedTuner(saved.model_copy(update={"W1": (1e6 * np.array(saved.W1)).tolist()}), precision)
        largest = float(tuner.numbers.largest)
        rows = rng.choice([-1.0, -1e-3, 1.0, 1e-3], (200, len(tuner.inputs))) * largest
        rows[1::2] = rng.normal(size=(100, len(tuner.inputs)))
        torque, status = tuner.run(rows)
        assert np.isfinite(torque).all()
        assert not status[1::2].any()
        assert set(status[::2].tolist()) <= {0, 2}


@pytest.mark.parametrize("precision", PRECISIONS)
def test_ends_of_the_network_and_of_the_guard(precision):
    """u(t) and u(t-1) of the largest size with opposite weights: their sum is 0, not inf - inf.

    No gain is above the guard where the sum of its lower end and its width is, by rounding.  A finite input times a
    gain of ten is refused.
    """
    opposite = {"W1": [[1e6, -1e6, 0.0, 0.0, 0.0, 0.0]], "w2": [1.0], "scales": [1.0] * 6}
    tuner, exceeded, large = (
        ExportedTuner(tuner_of(0, **each), precision) for each in (opposite, EXCEEDED, {"guard": (5.0, 10.0)})
    )
    row = np.zeros(7)
    row[[1, 4]] = np.array([-1.0, 1.0]) * float(tuner.numbers.largest)
    assert not tuner.run(np.array([row, row]))[1].any()
    assert tuner.state[3] == pytest.approx(SECTOR[0] + (SECTOR[1] - SECTOR[0]) / (1 + math.exp(-0.5)), rel=1e-6)
    of = exceeded.numbers
    exceeded.run(np.zeros((1, 7)))
    assert of.lo + (of.hi - of.lo) > of.hi == exceeded.state[3]
    torque, status = large.run(0.9 * float(large.numbers.largest) * np.eye(7)[2:3])
    assert (status[0], torque[0], large.state.tolist()) == (2, 0.0, [0.0] * 6)


@pytest.mark.parametrize(("changed", "key"), [({"K1": 1e39}, "K1"), ({"scales": [1e-50] * 6}, "scales")])
def test_numbers_beyond_float_are_refused_by_name(changed, key):
    W1 = {"W1": np.ones((2, 6)).tolist(), "w2": [1.0, 1.0], "scales": [1.0] * 6}
    saved = tuner_of(0, **W1 | changed)
    ExportedTuner(saved)
    with pytest.raises(ParameterError, match="export it in double") as caught:
        ExportedTuner(saved, "float")
    assert caught.value.key == key


@pytest.mark.parametrize("guard", [(0.31, 0.63), (0.1, 0.3), (0.35, 0.55)])
def test_the_guard_is_rounded_inwards(guard):
    for seed in range(10):
        W1, w2 = rng_of(seed).normal(size=(6, 6)).tolist(), [1e3] * 6
        tuner = ExportedTuner(tuner_of(seed, guard=guard, W1=W1, w2=w2, scales=[1.0] * 6), "float")
        tuner.run(rng_of(seed).normal(0, 10, (50, 7)))
        assert guard[0] <= float(tuner.numbers.lo) < float(tuner.numbers.hi) <= guard[1]
        assert guard[0] <= float(tuner.state[3]) <= guard[1]
    with pytest.raises(ParameterError, match="guard"):
        ExportedTuner(tuner_of(0, guard=(0.3, math.nextafter(0.3, 1))), "float")


# ------------------------------------------------------------ the simulated slew


@pytest.mark.parametrize("signals", ["vibration", "total"])
@pytest.mark.parametrize("Kp", [0.0, 2.0])
def test_a_slew_is_that_of_the_tuner(lab, signals, Kp):
    """The difference from tfarm's own simulation is within the stated bound.

    And within what roundings of every signal do to tfarm's own: as much as planted relative errors, to scale.
    """
    saved = tuner_of(5, signals=signals, Kp=Kp)
    trial = slew_trial(lab, K1=saved.K1, Kp=Kp, signals=signals)
    found = tuners.differences(trial, saved)
    planted, rng, gain = 1e-6, rng_of(0), saved.gain()
    own = gain.run(trial.simulator())

    def shaken(value):
        return float(value * (1 + planted * rng.uniform(-1, 1)))

    def controller(m):
        m = m._replace(**{name: shaken(getattr(m, name)) for name, _, _ in ExportedTuner(saved).inputs.values()})
        m = m._replace(vibration=shaken(m.root_moment - m.rigid_moment))
        return shaken(m.feedforward + m.servo(gain.servo) - shaken(gain(m)) * m.vibration)

    size = abs(trial.simulator().controller(controller).torque - own.torque).max() / abs(own.torque).max()
    for precision, digits in (("double", 53), ("float", 24)):
        assert found[precision] <= DIFFERENCE[precision]
        assert found[precision] <= 10 * size / planted * 2.0**-digits
    assert found["float"] > 1e-9  # the arithmetic is that of float


# ------------------------------------------------------------ C


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Files of a tuner of every kind in each precision, its twin in Python, and inputs with refused ones among them."""
    found = {precision: [] for precision in PRECISIONS}
    for precision, kinds in found.items():
        for n, changed in enumerate((FROZEN | {"signals": "total"}, EXCEEDED, GUARDED | {"signals": "vibration"})):
            folder = tmp_path_factory.mktemp("tuner")
            tuner = exported(folder, tuners.some_tuner(rng_of(n), **changed), precision, anyway=True)
            rows = tuners.some_inputs(rng_of(10 + n), 5000, tuner)
            assert {0, 1, 2} == set(tuner.run(rows)[1].tolist())
            kinds.append((folder, tuner, rows))
    return found


@pytest.mark.parametrize(("precision", "compiler", "level"), thinned([*product(PRECISIONS, COMPILERS, LEVELS)], 3))
def test_c_is_python_to_the_last_bit(folders, compiler, level, precision):
    """15,000 samples in all."""
    needed(compiler)
    for folder, tuner, rows in folders[precision]:
        assert is_equal(folder, tuner, rows, compiler, level), folder


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_self_test_runs(tmp_path, compiler, precision):
    """And fails where the sign of the output neuron is the other one."""
    needed(compiler)
    exported(tmp_path, tuner_of(3), precision)
    assert run(build(tmp_path, compiler, sources=SOURCES)) == b"0 of 1000 samples differ\n"
    source = (tmp_path / "tuner.c").read_text()
    (tmp_path / "tuner.c").write_text(source.replace("z += w2[j]", "z -= w2[j]"))
    with pytest.raises(AssertionError, match="of 1000 samples differ"):
        run(build(tmp_path, compiler, sources=SOURCES))


def test_no_library_is_called_and_checks_of_c_find_nothing(tmp_path):
    """Neither libm nor malloc: the object file at -O0 has no undefined symbol but copies of memory."""
    for precision in PRECISIONS:
        tuner = exported(tmp_path, tuner_of(6, **FROZEN), precision, anyway=True)
        rows = tuners.some_inputs(rng_of(0), 2000, tuner)
        assert is_equal(tmp_path, tuner, rows, "gcc", "-fsanitize=undefined,address", "-fno-sanitize-recover=all")
    run(needed("gcc"), *STRICT, "-O0", "-c", tmp_path / "tuner.c", "-o", tmp_path / "tuner.o")
    found = run(needed("nm"), "-u", tmp_path / "tuner.o").decode().splitlines()
    assert {line.split()[-1] for line in found} <= {"memcpy", "memset"}
    checks = ("--std=c99", "--enable=warning,performance,portability", "--error-exitcode=1", "--quiet")
    assert run(needed("cppcheck"), *checks, tmp_path / "tuner.c", tmp_path / "self_test.c") == b""


# ------------------------------------------------------------ the certificate, texts and refusals


def test_the_guard_is_certified_anew(lab, tmp_path):
    """A sector of the default rule again; beyond its radius there is none; at C = 0 it is not settled."""
    loop = sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=1.0)), count=6)
    guard = find_guard(loop, "time-varying", 0.336)
    again = sector_guard(loop, guard.lo, guard.hi)
    assert (again.is_proven, again.sentence) == (guard.is_proven, guard.sentence) == (True, again.sentence)
    assert sector_guard(loop, guard.lo, 1.2 * guard.hi) is None
    lossless = sampled_loop(Case(lab.with_numbers(damping=0.0), HubFeedback(K1=0.3, K2=1.0)), count=6)
    assert sector_guard(lossless, *SECTOR) is None


@pytest.mark.parametrize(("changed", "arm"), [({"guard": (0.0, 1.1)}, LAB), ({}, "sasaki2012")])
def test_a_gain_without_a_certificate_needs_anyway(tmp_path, changed, arm):
    saved = tuner_of(0, **changed)
    with pytest.raises(ParameterError, match="--anyway exports it"):
        exported(tmp_path, saved, arm=arm)
    assert not (tmp_path / "tuner.c").exists()
    exported(tmp_path, saved, arm=arm, anyway=True)
    assert "NOT CERTIFIED STABLE; exported by --anyway" in (tmp_path / "tuner.h").read_text()


def test_what_is_refused(tmp_path, lab):
    (tmp_path / "tuned.json").write_text(to_text(tuner_of(0)))
    (tmp_path / "free.json").write_text(to_text(tuner_of(0, guard=None, guard_kind="none")))
    how = {"what": "tuner", "form": "c", "folder": tmp_path / "out"}
    file = tmp_path / "tuned.json"
    for changed, key in (
        ({}, "tuned"),
        ({"tuned": file, "chain": Chain(sampling=Sampling(period=0.005))}, "sampling.period"),
        ({"tuned": file, "precision": "q31"}, "precision"),
        ({"tuned": tmp_path / "none.json"}, "tuned"),
        ({"tuned": tmp_path / "free.json", "anyway": True}, "guard_kind"),
    ):
        with pytest.raises(ParameterError) as caught:
            tfarm.export(lab, **how | changed)
        assert caught.value.key == key
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", thinned([each[:80] for each in C_TEXTS], 3))
def test_hostile_names(tmp_path, lab, words):
    """Of the arm, of the arm of the training, and of the identifiers."""
    saved = tuner_of(0, arm=words, **FROZEN)
    exported(tmp_path, saved, arm=replace(lab, name=NAME), name=words, anyway=True)
    files = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(files) == {"tuner.h", "tuner.c", "self_test.c", "tuned.json"}
    for name in ("tuner.h", "tuner.c"):
        assert files[name].isascii()
        assert files[name].count(b"/*") == files[name].count(b"*/")
    assert run(build(tmp_path, "gcc", "-trigraphs", sources=SOURCES)) == b"0 of 1000 samples differ\n"


def test_the_command(tmp_path, capsys):
    file, out = tmp_path / "tuned.json", tmp_path / "out"
    file.write_text(to_text(tuner_of(0)))
    arguments = ("export", LAB, "--what", "tuner", "--as", "c", "--tuned", str(file), "--out", str(out))
    found = answer(capsys, *arguments, "--name", "gain")
    assert found["files"] == ["tuner.h", "tuner.c", "self_test.c"]
    assert "certified for any K(t)" in found["verdict"]
    assert "int gain_step(" in (out / "tuner.h").read_text()
    line = refused(capsys, *arguments, "--period", "0.02")
    assert "sampling.period = 0.02: the tuner was trained every 0.01 s" in line


def test_a_small_survey():
    outcomes, _, wrong = tally(tuners.slews, 5, 3)
    assert (wrong, sum(outcomes.values())) == (0, 1)
