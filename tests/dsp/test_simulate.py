"""Simulations: energy, poles seen in time, limit cycles, running away."""

import math
from dataclasses import replace
from math import comb

import numpy as np
import pytest
from scipy.signal import lfilter, lsim

import tfarm
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, Sampling, Simulator, scenario
from tfarm.dsp.kernel import estimate
from tfarm.dsp.results import ideal_chain, limit_cycle, simulate_scenario
from tfarm.dsp.simulation import settling_time
from tfarm.errors import ParameterError
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_modes import dominant
from tfarm.reduced import modal_model
from tfarm.schema import to_dict

T = 0.01
GAINS = HubFeedback(K1=0.3, K2=0.3)

ROUNDED = 16 * np.finfo(float).eps  # of the largest moment: 20 modes and 40 are one there, but for sums


def simulator(arm, name="slew", duration=3.0, chain=None, **how):
    case = Case(arm, HubFeedback(), chain)
    return Simulator(case, scenario(name, arm, case.chain, duration), **{"count": 8} | how)


@pytest.mark.parametrize("name", ["slew", "step", "decay", "impulse", "pulse"])
@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.7])
def test_energy_is_the_work_done(lossless, name, delay):
    chain = Chain(sampling=Sampling(delay_samples=delay))
    run = simulator(lossless, name, 1.5, chain, count=20).linear(GAINS)
    assert run.stopped is None
    assert run.energy_error < 2e-14


def test_energy_is_not_known_where_something_takes_it(lab, lossless):
    for arm, chain in ((lab, Chain()), (lossless, Chain(actuator=Actuator(hub_damping=0.1)))):
        assert simulator(arm, "step", 0.1, chain, count=2).linear(GAINS).energy_error is None


def test_free_decay_is_the_damping_of_the_first_mode(lab):
    """Without gains the released mode decays with its own eigenvalue, and starts at the given deflection, at rest."""
    run = simulator(lab, "decay", 2.0).linear(HubFeedback(K1=0, K2=0))
    tip = run.at_samples.tip_displacement
    p = modal_model(lab, "hub_rate", 1).eigenvalues[0, 0]
    expected = 0.01 * np.exp(p.real * run.t) * (np.cos(p.imag * run.t) - p.real / p.imag * np.sin(p.imag * run.t))
    np.testing.assert_allclose(tip, expected, atol=1e-12)


@pytest.mark.parametrize("gains", [HubFeedback(), GAINS])
def test_a_decay_begins_with_filters_at_the_value_that_they_were_held_at(lab, gains):
    """The measured signals are the solution of y_f' = w (y - y_f), y_f(0) = y(0), of the recorded ones."""
    chain, between = Chain(sampling=Sampling(antialias_corner=60.0)), 50
    run = Simulator(Case(lab, gains, chain), scenario("decay", lab, chain, 0.5), count=2, between=between).run()
    t = np.r_[run.at_samples.t, run.between.t]
    order = np.argsort(t, kind="stable")
    for column, name in ((1, "hub_rate"), (2, "root_moment")):
        y = np.r_[run.at_samples.signal(name), run.between.signal(name)][order]
        filtered = lsim((60.0, [1.0, 60.0]), y, t[order], X0=[y[0] / 60.0])[1]
        at = np.searchsorted(t[order], run.at_samples.t)
        np.testing.assert_allclose(run.measured[:, column], filtered[at], atol=2e-3 * abs(y).max())
    assert run.measured[0, 2] == pytest.approx(run.at_samples.root_moment[0], rel=1e-12)


@pytest.mark.parametrize("K2", [0.1, 0.9])
def test_the_decay_in_time_is_the_spectral_radius(lab, K2):
    gains = HubFeedback(K1=0.05, K2=K2)
    loop = sampled_loop(Case(lab, gains), count=8)
    run = simulator(lab, "impulse", 60.0).linear(gains)
    rate = run.at_samples.hub_rate[-200:]
    slope = np.polyfit(np.arange(200), np.log(abs(rate)), 1)[0]
    assert slope == pytest.approx(loop.poles.log_spectral_radius, rel=1e-6)


def test_quantisation_keeps_a_limit_cycle_up(lab):
    """A stable loop whose rate comes in counts a sample: it never quite stops, and finer counts make it smaller."""
    gains = HubFeedback(K1=1.0, K2=0.3)
    counted = Converters(encoder_counts=2000, hub_rate="difference")
    chain = Chain(sampling=Sampling(delay_samples=1.0), converters=counted)
    run = simulator(lab, "impulse", 20.0, chain).linear(gains)
    ideal = simulator(lab, "impulse", 20.0, ideal_chain(chain)).linear(gains)
    assert sampled_loop(Case(lab, gains, chain), count=8).poles.is_stable
    cycle = limit_cycle(run, ideal)
    assert cycle is not None
    assert cycle.torque == pytest.approx(np.ptp(run.torque[-500:]) / 2)
    assert 0 < cycle.frequency < np.pi / T
    assert limit_cycle(ideal, ideal) is None
    coarse = replace(chain, converters=replace(chain.converters, encoder_counts=500))
    larger = limit_cycle(simulator(lab, "impulse", 20.0, coarse).linear(gains), ideal)
    assert larger is not None
    assert larger.root_moment > 2 * cycle.root_moment


def test_an_unstable_loop_that_its_motor_limits_rings_for_ever(lab):
    """Everything is linear but the limit: twice the limit and twice the impulse make a cycle twice as large."""
    gains = HubFeedback(K1=0.3, K2=1.18)
    assert not sampled_loop(Case(lab, gains), count=8).poles.is_stable
    cycles = []
    for size in (1.0, 2.0):
        chain = Chain(actuator=Actuator(torque_limit=3.0 * size))
        task = replace(scenario("impulse", lab, chain, 20.0), impulse=0.01 * size)
        case = Case(lab, gains, chain)
        run, ideal = (Simulator(each, task, count=8).run() for each in (case, case.through(ideal_chain(chain))))
        cycles.append(limit_cycle(run, ideal))
        assert run.saturated["torque"] > 100
        assert limit_cycle(ideal, ideal) is None
    one, two = cycles
    moment = run.at_samples.root_moment[-500:]  # whose spectrum has frequencies to 0.2 Hz
    peak = np.argmax(abs(np.fft.rfft((moment - moment.mean()) * np.hanning(500)))) * 2 * np.pi / 5.0
    assert two.frequency == pytest.approx(peak, abs=np.pi / 5.0)
    assert (one.kept_up_by, one.torque) == ("saturation", 3.0)
    assert two.root_moment == pytest.approx(2 * one.root_moment, rel=1e-6)  # what rounding makes of 20 s of ringing
    assert two.frequency == one.frequency
    answer = to_dict(simulate_scenario(Case(lab, gains, chain), "impulse", 20.0, count=8))
    assert answer["limit_cycle"]["kept_up_by"] == "saturation"


def test_a_simulation_uses_enough_modes_or_reports_its_error(lab, lossless):
    """20 modes do after a slew, and with damping after an impulse; without it 40 do not, and the error is right."""
    for task, duration in (("slew", 1.5), ("impulse", 0.5)):
        enough = to_dict(simulate_scenario(Case(lab, GAINS, Chain()), task, duration))
        assert (enough["modes_used"], enough["modes_change"] < 1e-4) == (20, True)
        fine = simulator(lab, task, duration, count=30).linear(GAINS).at_samples
        off = abs(enough["root_moment"] - fine.root_moment).max() / abs(fine.root_moment).max()
        assert 0 < off < max(enough["modes_change"], ROUNDED)
    sudden = to_dict(simulate_scenario(Case(lossless, GAINS, Chain()), "impulse", 0.5))
    assert (sudden["modes_used"], sudden["modes_change"] > 1e-4) == (40, True)
    more = simulator(lossless, "impulse", 0.5, count=160).linear(GAINS).at_samples
    off = abs(sudden["root_moment"] - more.root_moment).max() / abs(more.root_moment).max()
    assert 1e-4 < off < 2 * sudden["modes_change"]
    limited = to_dict(simulate_scenario(Case(lab, GAINS, Chain()), "slew", 0.1, count=3))
    assert (limited["modes_used"], limited["modes_change"]) == (3, None)


def time_function(G, t, terms=400):
    """The inverse Laplace transform of G at t > 0: Fourier series with Euler summation (Abate and Whitt, 1995)."""
    A, m = 25.0, 12  # errors of e^-A, and of the last terms' 12th differences
    values = G((A + 2j * np.pi * np.arange(terms + m + 1)) / (2 * t)).real * (-1.0) ** np.arange(terms + m + 1)
    values[..., 0] /= 2
    sums = np.cumsum(values, axis=-1)[..., terms:] @ [comb(m, k) / 2**m for k in range(m + 1)]
    return np.exp(A / 2) / t * sums


def test_an_impulse_is_first_seen_a_sample_later_and_20_modes_have_it(lab):
    """Struck just before a sample, a damped arm's moment there would grow as t^-1/2, and no modes would do."""
    chain = Chain(sampling=Sampling(period=0.004))
    run = simulator(lab, "impulse", 0.04, chain, count=20).linear(HubFeedback(K1=0.0, K2=0.0))
    G, seen = tfarm.transfer(lab, ["hub_rate", "root_moment"]), run.at_samples
    assert [seen.hub_angle[0], seen.hub_rate[0], seen.root_moment[0], run.torque[0]] == [0.0] * 4
    exact = run.scenario.impulse * np.array([time_function(G, t) for t in run.t[1:]])
    for own, signal in zip(exact.T, (seen.hub_rate, seen.root_moment), strict=True):
        np.testing.assert_allclose(signal[1:], own, atol=1e-6 * abs(own).max())


def test_divergence_is_reported_with_its_time_and_mode(lab):
    run = simulator(lab, duration=5.0).linear(HubFeedback(K1=0.3, K2=1.5))
    assert run.stopped is not None
    assert run.stopped.time == pytest.approx(run.t.size * T)
    assert f"mode {run.stopped.mode}" == dominant(sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=1.5)), count=8))
    for signal in (run.torque, run.at_samples.root_moment, run.at_samples.tip_displacement):
        assert np.isfinite(signal).all()
    answer = to_dict(simulate_scenario(Case(lab, HubFeedback(K1=0.3, K2=1.5), Chain()), "slew", 5.0, count=8))
    assert answer["settling_time_s"] is None
    assert answer["stopped_at_s"] == run.stopped.time


def test_settling_and_residual_by_hand(lab):
    run = simulator(lab).linear(GAINS)
    moment, vibration = abs(run.at_samples.root_moment), run.at_samples.root_moment - run.scenario.rigid_moment
    assert run.residual_moment == pytest.approx(np.sqrt(np.mean(vibration[100:] ** 2)), rel=1e-12)
    assert run.residual_raw == pytest.approx(np.sqrt(np.mean(moment[100:] ** 2)), rel=1e-12)
    k = 100 + round(run.settling_time / T)  # after the end of the slew
    signed, last = run.at_samples.root_moment, math.ceil(0.9 * (moment.size - 1))
    away = abs(signed - signed[last:].mean())
    assert away[k:].max() <= 0.02 * away.max() < away[k - 1]


@pytest.mark.parametrize("more", [0, 1])
def test_a_settling_time_has_a_tenth_of_the_record_after_it(more):
    """A record that ends a sample before nine tenths are over at the settling time, and right there."""
    for k in (9, 90, 333):
        n = math.ceil(k / 0.9) - 1 + more  # samples after the first
        settled = settling_time(np.arange(n + 1) * T, np.where(np.arange(n + 1) < k, 1.0, 0.01))
        assert settled == (pytest.approx(k * T, rel=1e-12) if more else None)


PINNED = {"payload_mass": np.inf}


@pytest.mark.parametrize(
    ("run", "words"),
    [
        (lambda lab: simulator(lab.with_numbers(**PINNED)), r"payload\.mass = inf: .*no slew"),
        (lambda lab: simulator(lab.with_numbers(payload_inertia=np.inf)), r"payload\.inertia = inf: .*no slew"),
        (lambda lab: simulator(lab.with_numbers(**PINNED), "decay", 1.0, count=3).linear(GAINS), "no free decay"),
        (lambda lab: simulator(lab, "slow"), 'did you mean "slew"'),
        (lambda lab: simulator(lab, "step", 1e9), "at most 4000000 samples"),
        (lambda lab: simulator(lab, "step", -1.0), "duration"),
        (lambda lab: simulator(lab, between=-1), "0 to 1000"),
        (lambda lab: simulator(lab).controller(lambda m: np.nan), "not finite"),
    ],
)
def test_what_cannot_be_simulated_is_refused(lab, run, words):
    with pytest.raises(ParameterError, match=words):
        run(lab)


def test_what_an_ideal_chain_leaves_decides_while_signals_are_clipped(lab):
    """A steady ringing that is clipped: kept up where the ideal loop grows, if not beyond bounds, and not where it has
    died down to no less than half of it; an ideal loop that has died down further decides either way."""
    chain = Chain(actuator=Actuator(torque_limit=3.0))
    run = simulator(lab, "impulse", 4.0, chain).linear(GAINS)

    def ringing(size, growth, clipped=False):
        signals = replace(run.at_samples, root_moment=size * np.exp(growth * run.t) * np.sin(30 * run.t))
        return replace(run, at_samples=signals, saturated_at=np.full_like(run.saturated_at, clipped))

    steady = ringing(1.0, 0.0, clipped=True)
    assert limit_cycle(steady, ringing(1.0, 0.5)).kept_up_by == "saturation"
    assert limit_cycle(steady, ringing(1.0, -0.1)) is None
    assert limit_cycle(steady, ringing(1.0, -1.0)) is not None
    assert limit_cycle(steady, ringing(1.0, 0.0)) is None


def test_a_filtered_difference_is_the_documented_filter_from_an_angle_at_rest():
    """(1 - a)/T (1 - 1/z)/(1 - a/z), by SciPy's filter: of a random walk, wherever it begins."""
    a = math.exp(-120.0 * T)
    angle = 0.7 + np.cumsum(np.random.default_rng(2).normal(size=50))
    memory = np.zeros(3)
    found = [estimate(each, np.nan, memory, True, a, T) for each in angle]
    through = (1 - a) / T
    np.testing.assert_allclose(found, lfilter([through, -through], [1, -a], angle - angle[0]), rtol=1e-9, atol=1e-11)
    assert found[0] == 0.0
