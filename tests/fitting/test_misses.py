"""A fit whose curve misses the data says so, with its factor, its range and the remedy; no good fit is called one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.fitting.planted import judged_miss
from tests.fitting.test_fit import LAB, OMEGA, PAIRS, measured
from tests.shared import refusal, thinned
from tests.shell import refused, run
from tfarm.arm.writing import to_toml
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.fitting.data import Measured, noise_of
from tfarm.fitting.fit import arms_drawn, fit
from tfarm.fitting.misses import misses_of
from tfarm.fitting.model import FitResponse, Problem
from tfarm.fitting.solve import Solution
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import fit_section

E, INERTIA = "link.youngs_modulus", "hub.inertia"
LINES = np.linspace(10.0, 400.0, 196)


class Given(Problem):
    """A problem whose computed responses are given."""

    def compute(self, point):
        return [point]


def missed(ratio):
    """The misses of a curve with these ratios computed/measured at `LINES`, of a response with unknown noise."""
    data = Measured(output="hub_rate", input="hub_torque", omega=LINES, values=1.0 / (1 + 1j * LINES / 50))
    problem = Given(None, (), (FitResponse(data, noise_of(data)),))
    nothing = np.zeros(0)
    return misses_of(Solution(problem, data.values * ratio, nothing, nothing, True, 1))


@pytest.mark.parametrize("ratio", [7.0, 1 / 7, -1.0, 2.0 * np.exp(0.8j)])
def test_factor_angle_and_range_are_those_of_the_ratio(ratio):
    is_off = (LINES > 100) & (LINES < 300)
    (found,) = missed(np.where(is_off, ratio, 1.0 + 0.0j))
    assert found.factor == pytest.approx(math.exp(abs(math.log(abs(ratio)))), rel=1e-12)
    assert found.degrees == pytest.approx(abs(math.degrees(np.angle(ratio))), abs=1e-9)
    assert (found.low, found.high) == pytest.approx((102 / 2 / math.pi, 298 / 2 / math.pi), rel=1e-12)


def test_a_delay_misses_from_where_its_phase_does():
    """The phase w tau is above ln 1.2 from w = 36 rad/s on; at 2 rad/s a line its steps are 0.01."""
    (found,) = missed(np.exp(-5e-3j * LINES))
    assert found.factor == pytest.approx(1.0)
    assert found.low == pytest.approx(math.log(1.2) / 5e-3 / 2 / math.pi, abs=2 / 2 / math.pi)
    assert found.high == pytest.approx(400 / 2 / math.pi)


def test_a_factor_of_less_than_a_fifth_is_no_miss():
    assert missed(np.full(LINES.size, 1.19)) == ()
    assert len(missed(np.full(LINES.size, 1.21))) == 1


@pytest.mark.parametrize("share", [0.1, 0.5, 3.0])
@pytest.mark.parametrize(("low", "high"), [(0, 400), (100, 130), (300, 400)])  # all lines, an antiresonance, the end
def test_noise_is_no_miss(share, low, high):
    """Of 200 sweeps none, however large the noise and wherever it is; computed over measured, and the other way."""
    rng, is_noisy = np.random.default_rng(int(10 * share) + high), (low < LINES) & (high > LINES)
    for _ in range(100):
        noise = rng.standard_normal(LINES.size) + 1j * rng.standard_normal(LINES.size)
        ratio = 1.0 + np.where(is_noisy, share, 0.01) * noise
        assert missed(ratio) == missed(1 / ratio) == ()


SEVENFOLD = replace(measured(pairs=PAIRS[1:], omega=OMEGA[::4])[0], sigma=None)
SEVENFOLD = replace(SEVENFOLD, values=7.0 * SEVENFOLD.values)


@pytest.fixture(scope="module")
def without_gain():
    """A fit of E and the hub's inertia to a root moment that is seven times too large, its noise unknown."""
    return fit(LAB, [SEVENFOLD], free=[E, INERTIA], profile=False)


def test_an_unknown_gain_is_a_miss_and_is_its_own_remedy(without_gain):
    assert without_gain.converged
    assert without_gain.is_explained is None
    assert without_gain.verdict == "misses the data"
    (miss,) = without_gain.misses
    assert miss.response in without_gain.in_words
    gain = float(without_gain.advice.removeprefix("a free gain (--free gain): "))
    assert gain == pytest.approx(7.0, rel=0.02)
    assert without_gain.remedies[0].is_enough
    assert not without_gain.remedies[1].is_enough


def test_the_remedy_is_right(without_gain):
    """With the gain free the same data have the arm that they were computed of, and no miss."""
    found = fit(LAB, [SEVENFOLD], free=[E, INERTIA, "gain"], profile=False)
    assert (found.verdict, found.misses, found.remedies, found.advice) == ("fitted", (), (), None)
    assert found.arm.link.youngs_modulus == pytest.approx(LAB.link.youngs_modulus, rel=0.01)


def test_arms_are_not_drawn_about_a_curve_that_misses(without_gain):
    assert "misses the data" in str(refusal(arms_drawn, without_gain, 3, kind=ConvergenceError))
    section = fit_section(ArmReport(without_gain.arm, Chain(), (), without_gain), count=3)
    assert f"Remedy: {without_gain.advice}." in section.words
    assert [block.title for block in section.blocks] == ["Measured over fitted", "Fitted numbers", "Resonances"]


def test_a_bound_that_leaves_the_truth_out_is_named():
    (data,) = measured(pairs=PAIRS[:1], omega=OMEGA[::2])
    found = fit(LAB, [data], free=[E], start={E: 2e11}, bounds={E: (1.5e11, 3e11)}, profile=False)
    assert found.verdict == "misses the data"
    words, _, value = found.advice.rpartition(" ")
    assert words == f"no bound of {E} ="
    assert float(value) == pytest.approx(LAB.link.youngs_modulus, rel=0.01)


@pytest.mark.parametrize("seed", thinned([0, 5, 10, 15, 3, 9], 3))  # each kind, with noise of a known size and not
def test_planted_misses_are_called_so_with_their_remedy(seed):
    assert judged_miss(seed)[0] == "right"


def test_the_command_ends_with_3_and_names_the_remedy(tmp_path, capsys):
    path = tmp_path / "sweep.csv"
    table = np.c_[SEVENFOLD.omega / 2 / math.pi, SEVENFOLD.values.real, SEVENFOLD.values.imag]
    np.savetxt(path, table, delimiter=",", header="hz,re,im", comments="")
    given = ("fit", "sasaki2012-lab", "--data", f"root_moment/hub_torque={path}", "--free", E, "--covariance")
    code, out, err = run(capsys, *given)
    assert (code, err) == (3, "")
    assert "misses the data" in out
    assert "a free gain (--free gain): " in out
    locked = tmp_path / "locked.toml"
    locked.write_text(to_toml(LAB.with_numbers(hub_inertia=math.inf)))
    assert "drives no locked hub" in refused(capsys, given[0], str(locked), *given[2:])
