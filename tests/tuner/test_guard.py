"""The guard: sectors against the circle criterion by transfer functions, switching, exact proofs, empty guards.

A small sample of `python -m tests.tuner.bounded 1000`, and that its adversary has teeth.
"""

import re
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import flint
import numpy as np
import pytest
from scipy.linalg import eigh, solve_discrete_lyapunov

import tfarm
from tests.shared import thinned
from tests.survey import tally
from tests.tuner import bounded
from tests.tuner.bounded import adversary
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.errors import CertificationError
from tfarm.exact.rationals import is_positive_definite
from tfarm.loop.sampled import sampled_loop
from tfarm.tuner import find_guard, guard, slew_trial
from tfarm.tuner.guard import RADIUS_SHARE, MovingGain, _peak, common_lyapunov, upper_modes_are_quiet

FINE = np.r_[np.geomspace(1e-6, 1e-2, 500), np.linspace(1e-2, np.pi, 100_001)]


def moving(arm, count=6, delay=0.0, **servo):
    chain = Chain(sampling=Sampling(delay_samples=delay))
    return MovingGain(sampled_loop(Case(arm, HubFeedback(**{"K1": 0.3, "K2": 1.0} | servo), chain), count=count))


@pytest.fixture(scope="module")
def loop(lab):
    return moving(lab)


def test_gains_of_a_tuner_are_those_that_hold_from_0_to_10(monkeypatch, lab):
    monkeypatch.setattr(guard, "stable_windows", lambda loop, vary: [(-3.0, -1.0), (-0.5, 0.4), (0.6, 12.0)])
    assert guard.constant_windows(sampled_loop(Case(lab, HubFeedback(K1=0.3)), count=2)) == [(0.0, 0.4), (0.6, 10.0)]


def criterion(loop, lo, hi):
    """1 + (lo + hi) Re H + lo hi |H|^2 at z = e^{i theta}, by transfer functions."""
    z, sampled = np.exp(1j * FINE), loop.loop
    H = sampled.rig.terms(z, None, np.ones(z.size))[1 + sampled.part("K2")] / sampled.with_number("K2", 0.0)(z)
    return 1 + (lo + hi) * H.real + lo * hi * abs(H) ** 2


@pytest.mark.parametrize(("m", "delay"), thinned(product([0.05, 0.2, 0.47, 0.9], [0.0, 0.6]), 3))
def test_the_radius_is_where_the_criterion_first_fails(lab, m, delay):
    """The state-space peak against 1 + (lo + hi) Re H + lo hi |H|^2 by pulse transfer functions."""
    loop = moving(lab, delay=delay)
    radius = loop.radius(m)
    assert criterion(loop, m - 0.998 * radius, m + 0.998 * radius).min() > 0
    assert criterion(loop, m - 1.002 * radius, m + 1.002 * radius).min() < 0


@pytest.mark.parametrize("angle", [0.0, 1e-3, 0.7, np.pi])
def test_the_peak_of_one_pole_is_at_its_own_angle(angle):
    """|r/(z - p)| is largest, |r|/(1 - |p|), where z has the angle of p: at both ends of the half circle too."""
    for size in (0.5, 0.9, 1 - 1e-6):
        peak = _peak(np.array([0.3 - 0.4j]), np.array([size * np.exp(1j * angle)]))
        assert peak == pytest.approx(0.5 / (1 - size), rel=1e-9)


@pytest.mark.parametrize(("m", "servo"), [(0.2, {}), (0.47, {}), (0.3, {"K1": 3.6, "Kp": 10.0})])
def test_what_the_criterion_allows_is_proven_and_nothing_beyond(lab, m, servo):
    """Any sequence of its gains contracts by that factor, the held angle among the states."""
    loop = moving(lab, **servo)
    assert (len(loop.open) == len(loop.loop.matrix())) == bool(servo)
    ends = [m + share * loop.radius(m) for share in (-RADIUS_SHARE, RADIUS_SHARE)]
    proof, state = loop.proof(*ends), np.random.default_rng(2).normal(size=loop.drive.size)
    root = np.linalg.cholesky(proof.P)
    size = [np.linalg.norm(root.T @ state)]
    for K in np.random.default_rng(1).choice([*ends, m], size=400):
        state = loop.at(K) @ state
        size.append(np.linalg.norm(root.T @ state))
    assert np.all(np.diff(np.log(size)) <= np.log(proof.contraction) + 1e-12)
    assert proof.contraction < 1
    assert loop.proof(m - 1.01 * loop.radius(m), m + 1.01 * loop.radius(m)) is None


def test_positive_definite_in_whole_numbers():
    """Also where float64 eigenvalues cannot distinguish a singular matrix from a definite one."""
    rng = np.random.default_rng(0)
    singular = np.array([[1, 1, 2], [1, 2, 3], [2, 3, 5]]) * 10**12
    grams = [M @ M.T + np.eye(len(M), dtype=int) for M in (rng.integers(-9, 10, (n, n)) for n in range(1, 9))]
    for S in (singular + np.diag([0, 0, 1]), *grams):
        assert is_positive_definite(flint.fmpz_mat(S.tolist()))
        S[len(S) // 2, len(S) // 2] = -1
        assert not is_positive_definite(flint.fmpz_mat(S.tolist()))
    assert not is_positive_definite(flint.fmpz_mat(singular.tolist()))
    assert not is_positive_definite(flint.fmpz_mat([[0, 1], [1, 0]]))


def test_a_planted_unstable_end_is_not_proven(loop):
    """P of one stable matrix does not prove an unstable one."""
    proof = loop.proof(0.31, 0.63)
    assert not replace(proof, high=loop.at(1.3)).is_proven()
    alone = solve_discrete_lyapunov(loop.at(0.31).T, np.eye(loop.drive.size))
    assert replace(proof, high=loop.at(0.31), P=alone).is_proven()
    assert not replace(proof, high=loop.at(0.31), P=-alone).is_proven()


@pytest.mark.parametrize("fastest", [1.0, 1.2])
def test_an_unstable_middle_has_no_lyapunov_function_and_no_warning(fastest):
    """No overflow on the way: warnings are errors here."""
    A, b = np.diag([fastest, 0.3]), np.ones(2)
    assert common_lyapunov(A, b, b, A, A) is None


@pytest.mark.parametrize("unit", [2.0**-40, 1e-9, 1e9])
def test_a_proof_does_not_depend_on_the_units_of_the_states(loop, unit):
    """The same loop with lengths, rates and torques in other units, as a micro-arm or a boom has them.

    Its function is found and proven alike.
    """
    proof = loop.proof(0.31, 0.63)
    units = unit ** np.linspace(-1.0, 1.0, loop.drive.size)
    low, high = (A * units / units[:, None] for A in (proof.low, proof.high))
    other = replace(proof, low=low, high=high, P=proof.P * units * units[:, None])
    assert other.is_proven()
    assert not replace(other, high=loop.at(1.3) * units / units[:, None]).is_proven()
    middle, half = loop.at(0.47) * units / units[:, None], np.sqrt(0.16)
    again = common_lyapunov(middle, half * loop.drive / units, half * loop.sense * units, low, high)
    assert again is not None
    assert again.contraction == pytest.approx(proof.contraction, rel=1e-6)


def test_the_default_sector(lab):
    guard = find_guard(slew_trial(lab).loop, "time-varying", 0.336)
    assert guard.is_proven
    assert guard.is_settled
    assert guard.modes_used == 24
    assert (guard.lo, guard.hi) == (pytest.approx(0.3034, abs=1e-3), pytest.approx(0.6427, abs=1e-3))
    margin = 0.336 - guard.lo
    assert 0.08 < margin / (guard.hi - guard.lo) < 0.12
    for proof in guard.proofs:
        assert proof.is_proven()
    ends = [(A.T @ proof.P @ A, proof.P) for proof in guard.proofs for A in (proof.low, proof.high)]
    slowest = np.sqrt(max(eigh(*each, eigvals_only=True)[-1] for each in ends))
    ((sector, shrinks),) = re.findall(r"^(.*): certified for any K\(t\), contraction by (.*) a sample", guard.sentence)
    assert sector == f"[{guard.lo:.4g}, {guard.hi:.4g}]"
    assert float(shrinks) == pytest.approx(1 - slowest, rel=0.05)  # two digits


def test_a_best_gain_of_nothing_gets_a_sector_from_zero(lab):
    guard = find_guard(slew_trial(lab).loop, "time-varying", 0.0)
    assert guard.lo == 0.0
    assert 0.05 < guard.hi < 0.2


def test_modes_are_quiet_where_they_lose_more_than_the_feedback_could_give(lab):
    """Two modes by hand, T = 1: the push is 2 (|K1| 0.01 + K 0.02) on a mode that loses 0.05 a sample."""
    plant = SimpleNamespace(
        residues=np.array([[0.0, 0.0], [9.0, 0.01], [9.0, 0.02]], complex),
        poles=np.array([-1e-3 + 1e-6j, -0.05 + 1e-6j]), mode=np.array([1, 2]), count=2,
    )  # fmt: skip
    loop = sampled_loop(Case(lab, HubFeedback(K1=-0.5), Chain(sampling=Sampling(period=1.0))), count=1)
    loop = replace(loop, rig=replace(loop.rig, sensed=SimpleNamespace(together=plant)))
    hold = (1 - np.exp(-0.05)) / 0.05
    edge = (0.05 / hold / 2 - 0.5 * 0.01) / 0.02
    assert upper_modes_are_quiet(loop, 0.999 * edge)
    assert not upper_modes_are_quiet(loop, 1.001 * edge)


@pytest.mark.parametrize("before", [(0.1, 0.6 - 6e-4), (0.1, 0.6 + 6e-4), (0.1 - 6e-4, 0.6), (0.1 + 6e-4, 0.6)])
def test_a_guard_that_more_modes_change_by_a_thousandth_of_its_width_is_not_settled(lab, before):
    loops = [sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=1.0)), count=count) for count in (2, 24)]
    assert not guard._is_settled(loops, [before, (0.1, 0.6)])
    nearer = tuple(end + 0.5 * (was - end) for was, end in zip(before, (0.1, 0.6), strict=True))
    assert guard._is_settled(loops, [nearer, (0.1, 0.6)])


def test_the_frozen_guard_is_stable_inside_and_not_beyond(lab):
    loop = slew_trial(lab).loop
    guard = find_guard(loop, "frozen", 0.336)
    assert not guard.is_proven
    assert "not certified for one that varies" in guard.sentence
    for K in np.linspace(guard.lo, guard.hi, 25):
        assert loop.with_number("K1", 0.3).with_number("K2", float(K)).poles.is_stable
    assert not loop.with_number("K1", 0.3).with_number("K2", guard.hi * 1.02).poles.is_stable


def test_without_damping_a_proof_is_of_the_first_modes_and_no_proof_of_the_loop():
    """Every finite model has one, but at C = 0 modes without end neither decay nor are looked at."""
    chain = Chain(sampling=Sampling(period=0.005))
    guard = find_guard(slew_trial(tfarm.load("sasaki2012"), chain).loop, "time-varying", 0.3)
    assert all(proof.is_proven() for proof in guard.proofs)
    assert not guard.is_settled
    assert not guard.is_proven
    assert "certified for the first 20 modes" in guard.sentence


@pytest.mark.parametrize("kind", ["frozen", "time-varying"])
def test_a_loop_that_no_damping_saves(lab, kind):
    with pytest.raises(CertificationError, match="nor with any damping"):
        find_guard(slew_trial(lab, K1=500.0).loop, kind, 0.3)


def test_a_frozen_guard_is_the_window_nearest_to_a_best_gain_that_lies_in_none(lab, monkeypatch):
    """By their middles: 0.5 is nearer to 2 than 5 is, and farther from 3.5."""
    monkeypatch.setattr(guard, "constant_windows", lambda loop: [(0.0, 1.0), (4.0, 6.0)])
    loops = [sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=1.0)), count=2)]
    assert guard._find_interval(loops, 2.0).hi == pytest.approx(RADIUS_SHARE)
    assert guard._find_interval(loops, 3.5).lo == pytest.approx(4.0 + 2 * (1 - RADIUS_SHARE))


@pytest.mark.parametrize("best", [0.1, 0.336, 1.1])
def test_the_default_sector_is_the_widest_with_the_best_gain_a_tenth_inside(loop, best):
    """Of all middles in the stability interval; beyond it the sector is the last one."""
    found = find_guard(loop.loop, "time-varying", best)
    ((low, high),) = guard.constant_windows(loop.loop)
    radii = {m: loop.radius(m) for m in np.linspace(low, high, 302)[1:-1].tolist()}
    widest = max(radius for m, radius in radii.items() if abs(best - m) <= 0.8 * radius)
    half = (found.hi - found.lo) / 2 / RADIUS_SHARE
    assert half == pytest.approx(widest, rel=0.04)
    assert abs(best - (found.hi + found.lo) / 2) <= 0.8 * half * (1 + 1e-3)
    assert find_guard(loop.loop, "time-varying", 3 * high).lo > 0.95 * high


def test_guarded_runs_stay_bounded_and_in_the_guard():
    outcomes, _, wrong = tally(bounded.runs, 2, 1)  # whose first arm has a sector, found soon
    assert (outcomes["run"], wrong) == (2, 0)


def test_the_adversary_has_teeth():
    """HubFeedback that are stable one by one: beyond a sector it drives the loop unstable, inside one it cannot."""
    loop = MovingGain(sampled_loop(Case(tfarm.load("sasaki2012-lab"), HubFeedback(K1=0.3, K2=1.0)), count=6))
    grown = {ends: adversary(loop, *ends, np.random.default_rng(0), 1) for ends in ((0, 1.1), (0.1, 0.6), (0.31, 0.63))}
    assert grown[0, 1.1] > 50
    assert grown[0.1, 0.6] > 5
    assert grown[0.31, 0.63] < 0
