"""Sampled verdicts under laws of order 1 to 12, against state transitions at 160 digits:

    python -m tests.loop.law_orders SIZE SEED

Random rigs (`tests.rigs`) and arms (`tests.loop.arms`), periods of 0.1 to 20 ms; clusters of poles near s = 0,
integrators, double integrators and notches on one or two signals, in s under each rule or in z.  The truth is the
state transition of the verdict's modal plant and of the law, from their doubles, in 560 bits (FLINT), closed by hand,
and its eigenvalues: their verdict, the poles at z = 1, and the spectral radius.
"""

import math
from dataclasses import replace

import flint
import numpy as np

from tests import survey
from tests.loop.arms import some_loop
from tests.loop.law_counts import SIGNALS
from tests.rigs import some_rig
from tests.survey import Finding, each_of
from tfarm.arm import Law
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, pulse_transfer
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency

BITS = 560
AT_ONE = 1e-40  # an eigenvalue as near is z = 1: a quadruple one is right to 1e-42, a true one was 8e-23 from it
RADIUS_AGREES, RADIUS_NOISE = 1e-6, 1e-12  # of ln of the spectral radius, and of the model's matrices in doubles
SLOW = 1e-9  # of ln|z|: of a pole next to one at z = 1 rounding leaves no more, 9e-11 was the most of 1,000 laws
MOST_ORDER = 12


def some_case(rng):
    """A rig, a law and a chain; None where the law reads nothing that moves."""
    try:
        arm = some_damped_rig(rng) if rng.random() < 0.5 else some_loop(rng)[0]
        if arm.is_locked:
            return None
        w1 = first_frequency(arm)
    except (ConvergenceError, ParameterError):
        return None
    chain = Chain(
        sampling=Sampling(
            period=float(10 ** rng.uniform(-4, math.log10(0.02))),
            delay_samples=float(rng.choice([0.0, 0.0, 1.0, rng.uniform(0, 2)])),
        )
    )
    law = some_law(rng, arm, chain, w1)
    return None if law is None else Case(arm, law, chain)


def some_damped_rig(rng):
    """A rig whose links have one C or none: modes of others may not be followed, whatever the law."""
    arm = some_rig(rng, damped=False, drive="hub_torque")
    if arm.is_locked or rng.random() < 0.4:
        return arm
    C = float(10 ** rng.uniform(-5, -2)) / first_frequency(arm)
    hub = replace(arm.hub, friction=arm.total_inertia * first_frequency(arm) * float(10 ** rng.uniform(-4, 0)))
    links = [replace(link, damping=C) for link in (arm.link, *arm.outer)]
    return replace(arm, link=links[0], outer=tuple(links[1:]), hub=hub if rng.random() < 0.4 else arm.hub)


def some_law(rng, arm, chain, w1):
    """A law on one or two signals, its loop function about 1 somewhere."""
    T, in_z = chain.sampling.period, rng.random() < 0.25
    rule = str(rng.choice(["tustin", "zoh", "matched"], p=[0.6, 0.2, 0.2]))
    names = [str(each) for each in rng.choice(SIGNALS, size=rng.integers(1, 3), replace=False)]
    entries, left = {}, int(rng.integers(1, MOST_ORDER + 1))
    for n, each in enumerate(names):
        if each == "root_moment" and arm.has_massless_hub:
            continue
        name = f"{each}{round(float(rng.uniform(0.1, 0.9)) * arm.length, 6)}" if each.endswith("@") else each
        order = left if n == len(names) - 1 else int(rng.integers(0, left + 1))
        left -= order
        zeros, poles = some_roots(rng, order, min(w1, 1 / T))
        s = 1j * min(w1 * 10 ** rng.uniform(-1, 1), 2 / T)
        gain = 10 ** rng.uniform(-2.5, 0.3) * rng.choice([-1, 1], p=[0.2, 0.8])
        num, den = np.atleast_1d(np.poly(zeros)).real, np.atleast_1d(np.poly(poles)).real
        if in_z:
            num, den = (np.atleast_1d(np.poly(np.exp(np.array(of) * T))).real for of in (zeros, poles))
        at = np.exp(s * T) if in_z else s
        try:
            size = abs(sampled(arm, name, chain, np.exp(s * T)) * np.polyval(num, at) / np.polyval(den, at))
        except (ConvergenceError, ParameterError):
            continue
        if 1e-250 < size < 1e250:
            scale = 10 ** rng.uniform(-2, 2)  # of both: leading coefficients are seldom 1
            entries[name] = ((num * (gain / size * scale)).tolist(), (den * scale).tolist())
    if not entries:
        return None
    return (
        Law(entries, period=T) if in_z else Law(entries, rule=rule, delay=float(rng.choice([0.0, rng.uniform(0, T)])))
    )


def sampled(arm, name, chain, z):
    """The pulse transfer function to a signal, at one z, from ten modes."""
    plain, _, x = name.partition("@")
    if not x:
        return pulse_transfer(arm, [plain], chain.sampling, count=10)(z)[0]
    s = np.log(z) / chain.sampling.period
    return Signals(arm, (name,)).values(np.array([s]))[0, 0]


def some_roots(rng, order, w1):
    """Zeros and poles [1/s]: a cluster, integrators, notches and single ones, no more zeros than poles."""
    poles, zeros = [], []
    if rng.random() < 0.3:
        poles += [0.0] * min(order, int(rng.integers(1, 3)))
    if order - len(poles) > 2 and rng.random() < 0.6:
        middle, spread = w1 * 10 ** rng.uniform(-3, 0.3), 10 ** rng.uniform(-3, -0.3)
        size = int(rng.integers(2, order - len(poles) + 1))
        poles += (-middle * (1 + spread * rng.uniform(-1, 1, size))).tolist()
    while len(poles) < order:
        w, damping = w1 * 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-2, -0.1)
        if order - len(poles) > 1 and rng.random() < 0.5:
            pair = w * complex(-damping, math.sqrt(1 - damping**2))
            poles += [pair, pair.conjugate()]
            if rng.random() < 0.7:  # a notch
                zero = w * complex(-damping * rng.uniform(0, 0.5), math.sqrt(1 - damping**2))
                zeros += [zero, zero.conjugate()]
        else:
            poles.append(float(-w * rng.choice([1, -1], p=[0.97, 0.03])))
    while len(zeros) < len(poles) and rng.random() < 0.6:
        zeros.append(
            0.0 if rng.random() < 0.15 else float(-w1 * 10 ** rng.uniform(-2, 1) * rng.choice([1, -1], p=[0.9, 0.1]))
        )
    return zeros, poles


def balls(values, kind=flint.arb):
    """An array of doubles as balls of FLINT, exactly."""
    return np.vectorize(kind, otypes=[object])(np.asarray(values))


def by_flint(function, M):
    """A function of a matrix in balls."""
    return np.array(function(flint.arb_mat(M.tolist())).tolist(), object)


def held(A, B, duration):
    """e^{A t} and its integral times B, for a time in balls."""
    n, m = B.shape
    both = by_flint(flint.arb_mat.exp, np.block([[A, B], [balls(np.zeros((m, n + m)))]]) * duration)
    return both[:n, :n], both[:n, n:]


def states_of(num, den):
    """A, B, C, D of num/den, polynomials in descending powers, exactly: first row of A, D apart."""
    num, den = (np.array([flint.arb(each) for each in of], object) / flint.arb(den[0]) for of in (num, den))
    n = den.size - 1
    num = np.r_[balls(np.zeros(n + 1 - num.size)), num] if num.size <= n else num
    A = balls(np.eye(n, k=-1))
    A[0] = -den[1:]
    return A, balls(np.eye(n, 1)), (num[1:] - num[0] * den[1:])[None], num[0]


def matched(num, den, T):
    """The coefficients in z whose roots are e^{rT}, with the same lowest terms at rest."""
    factors = []
    for of in (num, den):
        s = flint.fmpq_poly([flint.fmpq(*each.as_integer_ratio()) for each in reversed(of)])
        roots = [root for root, times in s.complex_roots() for _ in range(times)] if s.degree() else []
        whole = flint.acb_poly.from_roots([(flint.acb(root) * T).exp() for root in roots])
        lowest, below = next(flint.arb(each) for each in reversed(of) if each), flint.acb(1)
        for root in roots:
            below *= T if root == 0 else 1 - (flint.acb(root) * T).exp()  # (z - 1)/T replaces s
        factors.append([whole[k].real * (lowest / below).real for k in range(whole.degree() + 1)][::-1])
    return factors


def law_in_balls(case):
    """Of each part of the law its signal and A, B, C (None without states) and D in z."""
    T = flint.arb(case.chain.sampling.period)
    for part in case.law.parts:
        num, den = list(part.block.num), list(part.block.den)
        rule = "none" if case.law.is_discrete else case.law.rule
        if len(den) == 1:
            yield part.signals[0], None, flint.arb(num[0]) / den[0]
            continue
        A, B, C, D = states_of(*(matched(num, den, T) if rule == "matched" else (num, den)))
        if rule == "zoh":
            A, B = held(A, B, T)
        elif rule == "tustin":
            one, half = balls(np.eye(len(A))), A * (T / 2)
            within = by_flint(flint.arb_mat.inv, one - half)
            A, B, C, D = within @ (one + half), within @ B * T, C @ within, D + (C @ within @ B)[0, 0] * (T / 2)
        yield part.signals[0], (A, B, C), D


def stepped(poles, duration):
    """Over a time: the diagonal of the transition of a' = p a + u, and what a held u adds."""
    step = np.array([(p * duration).exp() for p in poles], object)
    return step, (step - 1) / poles


def transition(loop, case):
    """The closed loop's matrix in balls: amplitudes of the plant's poles, its two integrals, inputs before, the law."""
    plant, sampling, read = loop.plant, case.chain.sampling, loop.rig.sensed.read
    samples = sampling.delay_samples + case.law.delay / sampling.period
    T, whole = flint.arb(sampling.period), math.floor(samples)
    late = (flint.arb(samples) - whole) * T
    poles, blocks = balls(plant.poles, flint.acb), list(law_in_balls(case))
    n, start = poles.size + 2, poles.size + whole + 3  # of the inputs before; the last of these acts
    last, size = start - 1, start + sum(len(block[0]) for _, block, _ in blocks if block)
    M, modes = balls(np.zeros((size, size)), flint.acb), np.arange(n - 2)
    rests = [order > read.system.at_rest for order in read.orders]  # which signals are 0 under a constant input
    (one, first), (two, second) = stepped(poles, late), stepped(poles, T - late)
    M[modes, modes], M[modes, last] = one * two, two * first
    M[n - 2, n - 2] = M[n - 1, n - 1] = flint.acb(1)
    M[n - 2, n - 1], M[n - 2, last], M[n - 1, last] = T, late * (T - late) + late**2 / 2, late
    for name, block, through in blocks:
        row = plant.outputs.index(name)
        residues, at_once = balls(plant.residues[row], flint.acb), flint.acb(float(plant.static[row]))
        if rests[row]:  # in all digits, as static and residues have it in theirs
            at_once = sum(residues / poles, flint.acb(0))
        signal = np.r_[residues, balls(np.r_[plant.rigid[row], np.zeros(whole)], flint.acb), at_once]
        M[n, : last + 1] += case.law.sign * through * signal
        if block:
            A, B, C = block
            own = slice(start, start + len(A))
            M[n, own] += case.law.sign * C[0]
            M[own, own] = A
            M[own, : last + 1] += np.outer(B[:, 0], signal)
            start += len(A)
    newest = M[n] if whole == 0 else balls(np.arange(size) == last - 1, lambda each: flint.acb(int(each)))
    M[:n] += np.outer(np.r_[second, (T - late) ** 2 / 2, T - late], newest)
    M[np.arange(n + 1, last + 1), np.arange(n, last)] = flint.acb(1)
    return flint.acb_mat(M.tolist())


def truth(loop, case):
    """How many poles are at z = 1, and ln|z| of the others, descending."""
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        z = transition(loop, case).mid().eig(algorithm="approx")
        at_one = [abs(each - 1).mid() < AT_ONE for each in z]
        logs = [
            float(abs(each).log().mid()) for each, is_one in zip(z, at_one, strict=True) if not is_one and each != 0
        ]
        return sum(at_one), sorted(logs, reverse=True)
    finally:
        flint.ctx.prec = before


def integrals_apart(loop):
    """How many of the two integrals of the input the rig does not have: a spring holds its hub, or friction does."""
    return int(loop.rig.is_damped) if loop.plant.arm.has_rigid_mode else 2


def judge(case):
    """ "right", "refused: ...", "wrong: ..." , whether it is proven, or that it need not be."""
    try:
        verdict = sampled_verdict(case)
        mine, word = verdict.log_radius, verdict.word
        loop = verdict.loop
    except (ConvergenceError, ParameterError) as error:
        return f"refused: {str(error).splitlines()[0]}"
    at_one, logs = truth(loop, case)
    marginal = at_one - loop.has_free_angle - integrals_apart(loop)
    largest = max([*logs, *([0.0] if marginal else [])])
    real = "marginal" if largest == 0 else "unstable" if largest > 0 else "stable"
    small = f"true ln radius {largest:.4e}, {marginal} at z = 1; found {mine:.4e}, {loop.poles_at_one}"
    own, rounding = loop.poles.log_spectral_radius, loop.poles.error[loop.poles.log_radius == 0]
    if word == "marginal" and real != word and abs(largest) <= rounding.max():
        return "right"  # nothing of that growth is left of rounding
    if word != real:
        return f"wrong: {word} for {real}: {small}"
    if marginal != loop.poles_at_one or abs(own - largest) > RADIUS_AGREES * abs(largest) + RADIUS_NOISE:
        return f"inexact: {small}, {own:.6e} of {largest:.6e}"
    clear = [sum(each > SLOW for each in of) for of in (loop.poles.log_radius, logs)]
    if clear[0] != clear[1]:
        return f"miscounted: {clear[0]} for {clear[1]}"
    return "right" if verdict.is_settled or not case.arm.damping else "not proven"


def laws(rng):
    """The finding on one case; None where there is none."""
    case = some_case(rng)
    if case is None:
        return None
    word = judge(case)
    outcome, _, words = word.partition(":")
    law, kind = case.law, "in z" if case.law.is_discrete else case.law.rule
    known = f"order {law.order} {kind}, T {case.chain.sampling.period:.3g}, C {case.arm.damping:.3g} {law.signals}"
    is_wrong = outcome in ("wrong", "inexact", "miscounted")
    return Finding(outcome, "" if word == "right" else f"{words} {known}", is_wrong)


if __name__ == "__main__":
    survey.main(each_of(laws))
