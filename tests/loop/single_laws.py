"""Laws in float32: the certified poles are those of the numbers that run, and the simulation grows or decays by them.

    python -m tests.loop.single_laws SIZE SEED

Random laws of order 3 to 6 with poles next to z = 1 at 1 ms, in z or by Tustin's rule.  The truth is the rounded state
space by hand (controllable form, every number to float32), closed around the sampled plant, its eigenvalues in 200 bits
(FLINT); and the growth of the root moment over long simulations from an impulse so small that nothing ends them early.
These are in float64 with the rounded numbers by hand, and in float32, where signals are rounded too: next to a cluster
of poles that changes the rate, and the sign of it is what has to agree.
"""

from dataclasses import replace

import flint
import numpy as np
from scipy.signal import cont2discrete

import tfarm
from tests import survey
from tests.loop.law_orders import balls
from tests.survey import Finding, each_of
from tfarm import Law
from tfarm.arm.blocks import Rational, StateSpace
from tfarm.arm.law import Part
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Sampling, Simulator, pulse_transfer, scenario
from tfarm.loop.sampled import sampled_loop

ARM, T, MODES, BITS, DURATION = tfarm.load("sasaki2012-lab"), 0.001, 3, 200, 60.0
SINGLE = Chain(sampling=Sampling(period=T), converters=Converters(arithmetic="float32"))
DOUBLE = Chain(sampling=Sampling(period=T))
RADIUS_AGREES, GROWTH_AGREES = 1e-7, 0.03  # relative; next to a cluster the plant's doubles change 1e-9 too
AT_ONE = 1e-9  # of the plant's doubles
CLEAR = 35.0  # growth or decay over the record, as ln: less is not measured
FAINT, FAINTEST = 1e-18, 1e-150  # N m s: in float32 and in float64; decay and growth stay within their numbers


def some_law(rng):
    """A lag of order 3 to 6 on the hub angle, K1 and a law without it stable."""
    order, poles = int(rng.integers(3, 7)), []
    while len(poles) < order:
        w, damping = 10 ** rng.uniform(0.3, 1.5), rng.uniform(0.3, 1.0)
        pair = w * np.exp(1j * (np.pi - np.arccos(damping)))
        poles += [pair, pair.conjugate()] if order - len(poles) > 1 and rng.random() < 0.5 else [-w]
    zeros = -(10 ** rng.uniform(0.3, 1.5, order - 1))
    num, den = np.poly(zeros), np.poly(poles).real
    num *= 10 ** rng.uniform(-2, 0) * den[-1] / num[-1]
    if rng.random() < 0.3:
        return {"hub_angle": (num, den)}, None
    num, den = np.poly(np.exp(zeros * T)) * num[0] * T, np.poly(np.exp(np.array(poles) * T)).real
    return {"hub_angle": (num, den)}, T


def by_hand(num, den, period):
    """A, B, C, D of num/den as they run: controllable form, and Tustin's rule for one in s."""
    num, den = np.r_[np.zeros(len(den) - len(num)), num] / den[0], np.asarray(den) / den[0]
    A, B, C = np.eye(len(den) - 1, k=-1), np.eye(len(den) - 1, 1), (num[1:] - num[0] * den[1:])[None]
    A[0], D = -den[1:], np.array([[num[0]]])
    return (A, B, C, D) if period else cont2discrete((*balanced(A, B, C), D), T, "bilinear")[:4]


def balanced(A, B, C):
    """The states of a law in s in units of powers of two in which rows and columns are alike."""
    from scipy.linalg import matrix_balance

    A, (scale, _) = matrix_balance(A, permute=False, separate=True)
    return A, B / scale[:, None], C * scale


def true_log_radius(blocks, K1):
    """The largest ln|z| of the loop of a rounded lag and rate gain; and whether it has z = 1, which is left out.

    That is the hub angle where the lag is rounded to 0 at rest.
    """
    A, B, C = pulse_transfer(ARM, ["hub_angle", "hub_rate"], Sampling(period=T), count=MODES).matrices()
    a, b, c, d = blocks
    M = np.block([[A, np.zeros((len(A), len(a)))], [b @ C[:1], a]]).astype(object)
    M[: len(A)] = balls(M[: len(A)]) - np.outer(balls(B), np.r_[d[0, 0] * balls(C[0]) + K1 * balls(C[1]), balls(c[0])])
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        values = flint.acb_mat([[flint.acb(x) for x in row] for row in M.tolist()]).eig(algorithm="approx")
        moving = [float(abs(z).log().mid()) for z in values if abs(z - 1).mid() > AT_ONE]
        return max(moving), len(moving) < len(values)
    finally:
        flint.ctx.prec = before


def growth(law, chain, impulse):
    """ln of the growth a sample of the root moment between two quarters of a simulation; and the samples of it."""
    task = replace(scenario("impulse", ARM, chain, DURATION), impulse=impulse)
    moment = abs(Simulator(Case(ARM, law, chain), task, count=MODES).run().at_samples.root_moment)
    n = moment.size // 8
    first, last = moment[4 * n : 6 * n].max(), moment[6 * n : 8 * n].max()
    return np.log(last / first) / (2 * n), moment.size


def judge(rng):
    """One law: its certified radius in float32 and what it is, and the growth of its simulation."""
    entries, period = some_law(rng)
    K1, law = float(np.float32(0.3)), Law({**entries, "hub_rate": 0.3}, period=period)
    blocks = [each.astype(np.float32).astype(float) for each in by_hand(*entries["hub_angle"], period)]
    truth, is_free = true_log_radius(blocks, K1)
    found = sampled_loop(Case(ARM, law, SINGLE), count=MODES).poles.log_spectral_radius
    exact = sampled_loop(Case(ARM, law, DOUBLE), count=MODES).poles.log_spectral_radius
    hand = Law({}, parts=(Part(("hub_angle",), StateSpace(*blocks)), Part(("hub_rate",), Rational((K1,)))), period=T)
    (slope, samples), (single, _) = growth(hand, DOUBLE, FAINTEST), growth(law, SINGLE, FAINT)
    words = f"{law.order}, {'z' if period else 's'}: {found:.6e}, true {truth:.6e}, simulated {slope:.6e}, {single:.6e}"
    if not np.isclose(found, truth, rtol=RADIUS_AGREES, atol=1e-9):
        return Finding("another loop", words, is_wrong=True)
    if abs(truth) * samples < CLEAR or is_free:
        return Finding(f"slowly {'growing' if truth > 0 else 'decaying'}")
    if not np.isclose(slope, truth, rtol=GROWTH_AGREES, atol=4 / samples) or single * truth < 0:
        return Finding("another growth", words, is_wrong=True)
    figures = {"ln|z| moved by rounding": abs(truth - exact), "rate by rounding of signals": abs(single / truth - 1)}
    is_lost = exact < 0 < truth
    return Finding("unstable by rounding" if is_lost else "unstable" if truth > 0 else "stable", figures=figures)


if __name__ == "__main__":
    survey.main(each_of(judge), size=100)
