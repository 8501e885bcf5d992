"""Verdicts called settled, on loops drawn to hurt and on ordinary ones, against a hold model.

    python -m tests.loop.settled 2000 [SEED]

To hurt: hubs of 1e-4 to 1e-1 of the beam's inertia or none, first modes with 1e-6 to 1e-3 of critical damping, periods
that put one of the modes 10 to 60 where sampled rate feedback destabilises it, delays.  Two sizes of the hold model
must agree, or one of 240 polynomials decides; a growth below 1e-7 a sample is not decided.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from tests import survey
from tests.dsp.independent import held
from tests.models import Ritz
from tests.plausible.arms import log
from tests.strategies import arm_of
from tests.survey import Finding, each_of
from tfarm.arm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.errors import ConvergenceError
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.spectrum import modes

FAINT = 1e-7
PERIOD = 0.01  # s, of the ordinary ones


def beam_of(rng, longest, stockiest):
    """What a slender beam without hub and damping is drawn from, and its inertia about the hub [kg m^2]."""
    draw = {
        "length": log(rng, 0.3, longest),
        "slenderness": log(rng, stockiest, 300),
        "width": log(rng, 1, 20),
        "density": log(rng, 1500, 8000),
        "E": log(rng, 1e10, 2e11),
        "nu": float(rng.uniform(0.1, 0.4)),
        "mass": float(rng.choice([0.0, log(rng, 0.01, 1)])),
        "inertia": 0.0,
    }
    return draw, arm_of(**draw, damping=0.0, hub=1.0).total_inertia - 1.0


def ordinary_case(rng):
    """A slender arm with a hub of its size, damped, and gains on both sides of the edges."""
    draw, beam = beam_of(rng, 2.0, 30)
    arm = arm_of(**draw, damping=log(rng, 3e-6, 3e-4), hub=beam * log(rng, 0.05, 5))
    gains = HubFeedback(K1=arm.total_inertia / PERIOD * log(rng, 1e-3, 3), K2=float(rng.uniform(-0.6, 1.8)))
    delay = float(rng.choice([0.0, 1.0, 2.0, rng.uniform(0, 2)]))
    return Case(arm, gains, Chain(sampling=Sampling(period=PERIOD, delay_samples=delay)))


def hurting_case(rng):
    """A light hub, little damping, and a period short enough for the modes 10 to 60 to matter."""
    draw, beam = beam_of(rng, 3.0, 20)
    share = float(rng.choice([0.0, *(log(rng, 1e-4, 1e-1) for _ in range(3))]))
    arm = arm_of(**draw, damping=0.0, hub=beam * share)
    w = modes(arm, 60).natural_frequency
    arm = replace(arm, link=replace(arm.link, damping=2 * log(rng, 1e-6, 1e-3) / float(w[1])))
    period = float(rng.uniform(1.0, 2.0) * np.pi / w[rng.integers(10, 61)])
    delay = float(rng.choice([0.0, 0.5, 1.0, rng.uniform(0, 2)]))
    felt = float(rng.choice([arm.total_inertia, max(arm.hub.inertia, 1e-4 * beam)]))
    gains = HubFeedback(K1=felt / period * log(rng, 1e-3, 1), K2=float(rng.uniform(-0.4, 1.4)) if share else 0.0)
    return Case(arm, gains, Chain(sampling=Sampling(period=period, delay_samples=delay)))


def oracle(case):
    """Whether a loop is stable; None where it is not determined."""
    found = [HoldModel(case.arm, terms).log_radius(case.gains, case.chain) for terms in (80, 140)]
    if min(found) <= 0 <= max(found):
        found = [HoldModel(case.arm, 240).log_radius(case.gains, case.chain)]
    return None if min(abs(np.array(found))) < FAINT else found[-1] < 0


def settled(case):
    """The finding on one loop; what the oracle does not decide is "unclear"."""
    try:
        verdict = sampled_verdict(case)
    except ConvergenceError as error:
        return Finding("refused", f"{error} {case}")
    stable = oracle(case)
    if stable is None:
        return Finding("unclear")
    if not verdict.is_settled:
        return Finding("not settled")
    if stable == verdict.is_stable:
        return Finding("settled stable" if stable else "settled unstable")
    return Finding("false", f"{verdict.sentence} {case}", is_wrong=True)


def hurting(rng):
    return settled(hurting_case(rng))


def ordinary(rng):
    return settled(ordinary_case(rng))


class HoldModel:
    """A damped arm, by no code of tfarm: the lowest quarter of the modes that `terms` polynomials a strain give.

    `terms`/2 modes, that is: those are right to 1e-13, the last of them to 1e-9; higher ones are the polynomials' own.

    States: w q and q_t of each mode, the angle and rate of the rigid arm, and the gauge's moment g, from the hub's
    balance  g + C g_t = I_h theta_tt - u,  which includes the static share of the modes left out.
    """

    def __init__(self, arm, terms=80):
        ritz, C = Ritz(arm, terms), arm.link.damping
        flexibility, shapes = (part[..., : terms // 2] for part in ritz.flexibilities())
        shapes = shapes / np.sqrt(flexibility)
        w, b = 1 / np.sqrt(flexibility), ritz.hub_psi @ shapes
        damping = C * (shapes.T * ritz.bending) @ shapes
        rigid = 1 / np.sqrt(arm.total_inertia)
        n, inertia, W = w.size, arm.hub.inertia, np.diag(w)
        A = block_diag(np.block([[np.zeros((n, n)), W], [-W, -damping]]), [[0.0, 1.0], [0.0, 0.0]], [[-1 / C]])
        B = np.r_[np.zeros(n), b, 0.0, rigid, 0.0]
        self.angle, self.rate = np.r_[b / w, np.zeros(n), rigid, 0.0, 0.0], np.r_[np.zeros(n), b, 0.0, rigid, 0.0]
        A[-1] += inertia / C * (self.rate @ A)
        B[-1] = (inertia * (b @ b + rigid**2) - 1) / C
        self.A, self.B = A, B

    def log_radius(self, gains, chain):
        """The largest ln|z|, the hub angle's own pole at z = 1 apart (Kp = 0)."""
        T, delay = chain.sampling.period, chain.sampling.delay_samples
        d, n = int(np.floor(delay)), self.B.size
        (before, late), (after, early) = (held(self.A, self.B, f * T) for f in (delay - d, 1 - delay + d))
        step, newest = np.zeros((n + d + 1, n + d + 1)), np.zeros(n + d + 1)  # then u_{k-1} ... u_{k-d-1}
        step[:n, :n], step[:n, -1] = after @ before, after @ late
        if d:
            step[:n, -2], newest[n] = early, 1.0
            step[np.arange(n + 1, n + d + 1), np.arange(n, n + d)] = 1.0
        else:
            newest[:n], newest[n] = early, 1.0
        step[:, :n] -= np.outer(newest, gains.K1 * self.rate + gains.K2 * np.eye(n)[-1])
        z = np.linalg.eigvals(step)
        return float(np.log(abs(np.delete(z, abs(z - 1).argmin())).max()))


if __name__ == "__main__":
    survey.main(each_of(hurting), each_of(ordinary))
