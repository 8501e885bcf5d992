"""Norms of weighted S, K S and T of random stable loops, against dense evaluations of the same functions.

    python -m tests.loop.norms SIZE SEED

Slender damped arms under laws of gains, lead, PI and notch, with weights in s or z, some with integrators.  The dense
values are those of the pulse transfer function of the arm and of the law as ratios of polynomials, on a grid with 400
points about each closed-loop pole.  A bound below one of them, or more than 1e-3 above the largest, is wrong.
"""

from dataclasses import replace

import numpy as np

import tfarm
from tests import survey
from tests.loop.settled import beam_of
from tests.plausible.arms import log
from tests.strategies import arm_of
from tests.survey import Finding, numbered
from tfarm import HubFeedback, Law
from tfarm.arm import as_law
from tfarm.arm.weights import Weights, weights_of
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, pulse_transfer
from tfarm.dsp.discretise import discretise_law
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.spectrum.table import first_frequency

ROUNDING = 1e-9  # of a dense value: its law is a ratio of polynomials


def some_loop(rng):
    """A damped arm under a law that seldom is unstable, and its chain."""
    draw, beam = beam_of(rng, 2.0, 30)
    arm = arm_of(**draw, damping=log(rng, 3e-5, 3e-4), hub=beam * log(rng, 0.2, 5))
    w, J = first_frequency(arm), arm.total_inertia
    delay = float(rng.choice([0.0, 1.0, rng.uniform(0, 1)]))
    chain = Chain(sampling=Sampling(period=min(log(rng, 1e-3, 2e-2), 0.5 / w), delay_samples=delay))
    K1, K2 = J * w * log(rng, 3e-3, 0.3), float(rng.uniform(0, 0.4))
    Kp = K1 * w * log(rng, 0.01, 0.2)
    lead = ([K1 + Kp / (10 * w), Kp], [1 / (10 * w), 1.0])
    laws = (
        HubFeedback(K1=K1, K2=K2),
        HubFeedback(K1=K1, K2=K2, Kp=Kp),
        Law({"hub_angle": lead, "root_moment": K2}),
        Law({"hub_angle": lead}, delay=0.3 * chain.sampling.period),
        Law({"hub_rate": K1, "hub_angle": ([Kp, Kp * K1 / J * 0.1], [1.0, 0.0])}),
        Law({"hub_rate": ([K1, 0.1 * w * K1, w * w * K1], [1.0, w, w * w]), "hub_angle": Kp}),
    )
    return Case(arm, laws[rng.integers(len(laws))], chain)


def some_weights(rng, case):
    """Weights on some of S, K S and T, in s or z; an integrator on S where the loop is 0 at rest."""
    w, T = first_frequency(case.arm), case.chain.sampling.period
    corner, low = w * log(rng, 0.1, 1), w * log(rng, 1e-4, 1e-2)
    if rng.random() < 0.3:
        a, b = float(rng.uniform(-0.9, 0.9)), float(rng.uniform(-0.9, 0.99))
        return weights_of({"S": ([1.0, -a], [1.0, -b]), "KS": 1e-2, "T": ([1.0, -b], [1.0, 0.2])}, T)
    entries = {
        "S": ([0.5, corner], [1.0, float(rng.choice([0.0, low]))]),
        "KS": ([log(rng, 1e-2, 1), 0.0], [1.0, corner]),
        "T": ([1 / w, float(rng.uniform(0.1, 1))], [1.0]),
    }
    kept = rng.random(3) < 0.7
    kept[rng.integers(3)] = True
    return Weights(weights_of(dict(np.array([*entries.items()], object)[kept])).blocks)


def values_at(q, case, weights, count):
    """Each weighted function, and the column of all, at angles of the circle."""
    T, law = case.chain.sampling.period, discretise_law(as_law(case.law), case.chain.sampling.period)
    z, s = np.exp(1j * q), 1j * q / T
    late = replace(case.chain.sampling, delay_samples=case.chain.sampling.delay_samples + law.delay / T)
    K = law.values(z)
    S = 1 / (1 + (K * pulse_transfer(case.arm, law.signals, late, count=count)(z)).sum(axis=0))
    own = {"S": abs(S), "KS": np.linalg.norm(K, axis=0) * abs(S), "T": abs(1 - S)}
    found = []
    for name, block in weights.blocks.items():
        at = s if weights.period is None else z
        found.append(own[name] * abs(np.polyval(block.num, at) / np.polyval(block.den, at)))
    return np.array([*found, np.linalg.norm(found, axis=0)])


def dense_peaks(case, weights, full):
    """The largest value of each on a dense grid, with 401 points about each pole, and 401 more about each maximum."""
    poles = full.poles
    around = np.maximum(abs(poles.log_radius), 1e-12)[:, None] * np.linspace(-5, 5, 401)
    near = (abs(np.angle(poles.z))[:, None] + around).ravel()
    q = np.unique(np.r_[np.geomspace(1e-8, np.pi, 4000), np.linspace(1e-3, np.pi, 3000), near])
    q = q[(q > 1e-9) & (q <= np.pi)]
    first = values_at(q, case, weights, full.plant.count)
    best = first.argmax(axis=1)
    low, high = q[np.maximum(best - 1, 0)], q[np.minimum(best + 1, q.size - 1)]
    finer = np.linspace(low, high, 401).ravel()
    return np.maximum(first.max(axis=1), values_at(finer, case, weights, full.plant.count).max(axis=1))


def bounded(rng):
    """The finding on one loop."""
    case = some_loop(rng)
    verdict = sampled_verdict(case)
    if not (verdict.is_stable and verdict.is_settled):
        return Finding("not stable" if verdict.is_settled else "not certified")
    weights = some_weights(rng, case)
    found = tfarm.norm(case.arm, case.law, case.chain, weights=weights)
    if not found.is_certified:
        return Finding("approximate", f"{case} {weights}", True)
    most = dense_peaks(case, weights, verdict.full)
    upper, value = (np.array([getattr(row, name) for row in found.bounds]) for name in ("upper", "value"))
    figures = {"above the dense values": max(upper / most - 1), "arcs": found.arcs, "values": max(value / most - 1)}
    is_wrong = (
        (upper < most * (1 - ROUNDING)).any() or (upper / most > 1 + 1e-3 + ROUNDING).any() or (value > upper).any()
    )
    return Finding("bounded", f"{upper / most} {case} {weights}" if is_wrong else "", bool(is_wrong), figures)


norms = numbered(bounded)
norms.__name__ = "norms"

if __name__ == "__main__":
    survey.main(norms, size=200, seed=1)
