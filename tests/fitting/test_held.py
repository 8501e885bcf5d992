"""The response of samples to an input that is held: against the simulator, and in a fit of a sensor's delay."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

import tfarm
from tests.fitting.test_runs import LOOSE, T, chain_of, simulated, task_of
from tests.shared import refusal
from tests.shell import answer, refused
from tfarm.fitting.fit import fit
from tfarm.fitting.ratio import ratio_of
from tfarm.fitting.recording import read_recording
from tfarm.fitting.spectra import frequency_response

# so that a simulation is periodic after 8 s
DAMPED = replace(tfarm.load("sasaki2012-lab"), name="damped")
DAMPED = replace(DAMPED, link=replace(DAMPED.link, damping=1e-3))
N = 400


@cache
def periods():
    """Torque and root moment of the last of periods of a held input: no window, no leakage."""
    rng = np.random.default_rng(2)
    u = np.tile(rng.choice([-1.0, 1.0], N), 4)
    u -= u.mean()
    sim = simulated(DAMPED, LOOSE, chain_of(0.0), task_of(u, 0 * u), count=20)
    return u[-2 * N :], sim.at_samples.root_moment[-2 * N :]


def measured(**own):
    u, y = (np.fft.rfft(values[-N:])[1 : N // 2] for values in periods())
    omega = 2 * math.pi * np.arange(1, N // 2) / (N * T)
    H = y / u
    return tfarm.Measured(output="root_moment", input="hub_torque", omega=omega, values=H, sigma=1e-3 * abs(H), **own)


def test_a_held_response_is_that_of_the_simulated_samples():
    data = measured(held=T)
    found = ratio_of(DAMPED, data)(1j * data.omega)
    np.testing.assert_allclose(found, data.values, rtol=1e-4, atol=1e-6 * abs(found).max())
    low = data.omega < 20
    late = np.angle(data.values / ratio_of(DAMPED, replace(data, held=None))(1j * data.omega))[low]
    np.testing.assert_allclose(late, -data.omega[low] * T / 2, rtol=0.03)


def test_a_held_input_is_no_delay_of_the_sensor():
    """Half a period of it, where the input is taken for a continuous one; and the arm is not rejected then."""
    before = fit(DAMPED, [measured()], ["delay", "hub.inertia"], profile=False)
    after = fit(DAMPED, [measured(held=T)], ["delay", "hub.inertia"], profile=False)
    (inertia, late), (own, none) = before.parameters, after.parameters
    assert 0.3 < late.value / T < 0.6
    assert abs(none.value) < 1e-3 * T
    assert not before.is_explained
    assert after.is_explained
    assert abs(own.value / DAMPED.hub.inertia - 1) < 1e-3 < abs(inertia.value / DAMPED.hub.inertia - 1)


def test_a_record_says_that_its_input_is_held_and_its_response_keeps_that(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    u, y = periods()
    table = np.c_[T * np.arange(2 * N), u, y]
    np.savetxt("run.csv", table, delimiter=",", header="t,hub_torque,root_moment", comments="")
    how = ("run.csv", "--input", "hub_torque", "--output", "root_moment", "--window", "boxcar", "--segment", "4")
    held = answer(capsys, "frf", *how, "--held", "--save", "held.csv")
    assert held["held_s"] == T
    data = tfarm.read_measured("held.csv", "root_moment", "hub_torque")
    assert data.held == T
    plain = frequency_response(read_recording("run.csv"), "root_moment", "hub_torque", window="boxcar", segment=4.0)
    assert plain.measured.held is None
    np.testing.assert_allclose(data.values, measured().values, rtol=1e-4)
    overlay = tfarm.overlay(DAMPED, data)
    np.testing.assert_allclose(overlay.exact, data.values, rtol=1e-3)
    assert "held" in refused(capsys, "frf", *how, "--held", "--decimate", "2")
    ratio = replace(data, output="tip_acceleration", input="hub_rate")
    assert "of a commanded input" in str(refusal(ratio_of, DAMPED, ratio))
