"""Frequency responses of records, against SciPy, a known filter, the scatter of Bendat and Piersol; the commands."""

import re

import numpy as np
import pytest
from scipy import signal

from tests.shared import refusal
from tests.shell import answer, refused, run
from tfarm.fitting.data import data_of
from tfarm.fitting.recording import Recording
from tfarm.fitting.spectra import frequency_response, independent_averages

T = 0.01
B, A = [0.0, 0.5, 0.2], [1.0, -0.8, 0.4]  # rings for some ten samples: segments of a hundred leave little of it out


def recorded(x, y, period=T):
    signals = {"hub_torque": np.asarray(x, float), "tip_acceleration": np.asarray(y, float)}
    return Recording(signals=signals, start=0.0, period=period, jitter=0.0, source="made", digest="")


def estimate(x, y, output="tip_acceleration", **options):
    return frequency_response(recorded(x, y), output, "hub_torque", **options)


def truth(omega):
    return signal.freqz(B, A, worN=omega * T)[1]


def noisy(rng, n, on_output=0.0, on_input=0.0):
    """White excitation, the filter's answer, and white noise of these deviations on both as they are measured."""
    x = rng.standard_normal(n)
    y = signal.lfilter(B, A, x)
    return x + on_input * rng.standard_normal(n), y + on_output * rng.standard_normal(n)


def test_a_sine_swept_again_and_again_is_answered_exactly_by_segments_of_a_sweep():
    """Nothing leaks from a period: the response of the filter, to rounding over the smallest line's power."""
    n = 512
    sweep = signal.chirp(np.arange(n) * T, 0.2, n * T, 45.0)
    x = np.tile(sweep, 12)
    y = signal.lfilter(B, A, x)
    found = estimate(x[4 * n :], y[4 * n :], window="boxcar", segment=n * T)  # once the filter has settled: 0.63^2048
    assert (found.segments, found.resolution) == (8, pytest.approx(1 / (n * T)))
    assert found.measured.omega[:2] == pytest.approx(2 * np.pi * found.resolution * np.array([1, 2]), rel=1e-14)
    assert found.independent == pytest.approx(8, rel=1e-15)
    assert found.measured.values == pytest.approx(truth(found.measured.omega), rel=1e-9)


@pytest.mark.parametrize(("window", "overlap"), [("hann", 0.5), ("hann", 0.75), ("boxcar", 0.0)])
def test_bias_and_scatter_are_those_of_the_formula(window, overlap):
    """150 records, 33 lines, as much noise as excitation: H/H0 - 1 scatters in each part by sqrt((1 - g^2)/(2 N g^2)).

    And by N/(N - 1) more in its square, as S_xx is an average of N too.  The pooled deviation is known to 1.4 % (some
    2500 numbers, as neighbouring lines share noise), the mean of a line to 1/sqrt(150); 4.5 of that for the worst.
    """
    rng, n, size = np.random.default_rng(2), 2048, 128
    away = []
    for _ in range(150):
        found = estimate(*noisy(rng, n, 1.0), window=window, segment=size * T, overlap=overlap)
        lines = slice(2, 35)
        H0 = truth(found.measured.omega)[lines]
        g = abs(H0) ** 2 / (abs(H0) ** 2 + 1.0)  # true coherence: excitation and noise are white, of power 1
        away.append((found.measured.values[lines] / H0 - 1) / np.sqrt((1 - g) / (2 * found.independent * g)))
    away = np.array(away)
    pooled, N = np.sqrt((abs(away) ** 2).mean() / 2), found.independent
    assert pooled == pytest.approx(np.sqrt(N / (N - 1)), abs=0.03)
    means = away.mean(axis=0)
    assert abs(np.r_[means.real, means.imag]).max() < 4.5 / np.sqrt(150)
    assert found.measured.averages == int(found.independent)


def test_overlapped_segments_are_worth_fewer_averages():
    """Hann at one half: rho(1) = 1/36 (the integral of sin^2 cos^2 over that of sin^4, squared: (1/6)^2)."""
    w = np.hanning(1025)[:-1]
    K = 50
    assert independent_averages(w, 512, K) == pytest.approx(K / (1 + 2 * (1 - 1 / K) / 36), rel=1e-9)
    assert independent_averages(np.ones(64), 64, 7) == 7


def test_noise_on_the_input_lowers_h1_and_not_h2():
    """H1 by 1/(1 + N/S), here 1/1.25; H2 by nothing, and Hv by the root of that."""
    x, y = noisy(np.random.default_rng(3), 400_000, 0.0, 0.5)
    for kind, expected in (("H1", 0.8), ("H2", 1.0), ("Hv", np.sqrt(0.8))):
        found = estimate(x, y, estimator=kind, segment=128 * T).measured
        assert (found.values / truth(found.omega))[2:30].mean() == pytest.approx(expected, abs=0.006)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"segment": 50.0}, "--segment = 50.0: seconds between 0.08 and 5"),
        ({"segment": 0.01}, "--segment = 0.01"),
        ({"overlap": 1.0}, "--overlap = 1.0"),
        ({"estimator": "H3"}, "--estimator = 'H3'"),
        ({"window": "han"}, 'did you mean "hann"'),
        ({"output": "root_moment"}, "--output = 'root_moment': known are: hub_torque, tip_acceleration"),
        ({"x": np.zeros(1000)}, "'hub_torque': does not move"),
        ({"y": np.zeros(1000)}, "'tip_acc"),
    ],
)
def test_an_impossible_estimate_is_refused(options, message):
    given = dict(zip("xy", noisy(np.random.default_rng(4), 1000), strict=True)) | options
    assert message in str(refusal(estimate, **given))


@pytest.fixture
def record(tmp_path):
    x = np.random.default_rng(1).standard_normal(1600)
    y = signal.lfilter(B, A, x)
    path = tmp_path / "run.csv"
    rows = (f"{T * n:.2f},{u:.9g},{v:.9g}" for n, (u, v) in enumerate(zip(x, y, strict=True)))
    path.write_text("\n".join(["t,hub_torque,acc1", *rows]))
    return path


NAMED = ("--input", "hub_torque", "--output", "tip_acceleration=acc1")


def test_a_record_becomes_a_file_that_the_other_commands_read(record, tmp_path, capsys):
    save = tmp_path / "sweep.csv"
    code, out, err = run(capsys, "frf", str(record), *NAMED, "--save", str(save))
    assert (code, err) == (0, f"written: {save}\n")
    assert re.search(r"^independent averages +14.2", out, re.MULTILINE)
    data = data_of(f"tip_acceleration/hub_torque={save}")
    found = answer(capsys, "frf", str(record), *NAMED)
    assert [row["hz"] for row in found["response"]] == pytest.approx(list(data.omega / 2 / np.pi), rel=1e-15)
    assert [row["re"] for row in found["response"]] == data.values.real.tolist()
    assert data.coherence.tolist() == [row["coherence"] for row in found["response"]]
    assert data.averages == int(found["independent_averages"])
    # what hann segments of 200 samples leave of a ring of ten
    assert abs(data.values / truth(data.omega) - 1)[1:90].max() < 0.05


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("frf", "RUN", "--input", "hub_torque", "--output", "tip_acceleration"), "--output = 'tip_acceleration'"),
        (("frf", "RUN", "--input", "torque=hub_torque", "--output", "tip_acceleration=acc1"), "--input = 'torque'"),
        (("frf", "RUN", "--input", "hub_torque", "--output", "tip_acceleration="), "write NAME=COLUMN"),
        (("frf", "/nowhere.csv", *NAMED), "does not exist"),
        (("ring", "RUN", "--signal", "acc2"), 'did you mean "acc1"'),
        (("ring", "RUN", "--signal", "acc1", "--modes", "0"), "--modes = '0'"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, message, record, capsys):
    assert message in refused(capsys, *(str(record) if each == "RUN" else each for each in arguments))
