"""Verdicts on random laws in z, by two other roads:  python -m tests.dsp.law_verdicts SIZE SEED

Random arms (as in `tests.loop.arms`), periods of 0.02 to 1.5 over the first frequency, delays of up to three samples,
some with an anti-alias filter and some with a hub that the actuator damps; one to three signals with ratios of
polynomials in z, of order 8 in all at most, some of their poles outside the circle or at z = 1.  The verdict is held
against the eigenvalues of a modal model of 40 modes, discretised with matrix exponentials and closed by hand, where its
largest |ln z| is beyond 1e-9; and against a simulation of 20,000 samples after an impulse where that is beyond 1e-3.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from tests import survey
from tests.loop.arms import some_loop
from tests.loop.law_counts import SIGNALS
from tests.survey import Finding, each_of
from tfarm.arm import Law
from tfarm.dsp import Actuator, Chain, Sampling, Simulator, pulse_transfer, scenario
from tfarm.dsp.plant import is_analog
from tfarm.dsp.verdict import sampled_verdict
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.reduced.conversions import sensed_model
from tfarm.response.signals import Signals
from tfarm.spectrum.table import first_frequency

MODES = 40
CLOSE, SLOW = 1e-9, 1e-3  # ln of the radius from which on models, and simulations, decide
SAMPLES, PART = 20_000, 2_000
AT_ONE = 1e-4  # as near to 1 is an eigenvalue that is there three times


def some_case(rng):
    """An arm, a law in z and a chain; None where a signal is never moved."""
    arm = some_loop(rng)[0]
    period = float(10 ** rng.uniform(-1.7, 0.2)) / first_frequency(arm)
    delay = float(rng.choice([0.0, 0.0, 1.0, rng.uniform(0, 3)]))
    chain = Chain(sampling=Sampling(period=period, delay_samples=delay))
    law, w1, analog = some_law(rng, arm, chain), first_frequency(arm), np.random.default_rng(rng.integers(2**32))
    if analog.random() < 0.3:
        corner = float(10 ** analog.uniform(-0.5, 1.5)) * w1
        chain = replace(chain, sampling=replace(chain.sampling, antialias_corner=corner))
    if analog.random() < 0.3 and arm.has_rigid_mode and not arm.has_massless_hub:
        damping = float(10 ** analog.uniform(-3, 0)) * arm.total_inertia * w1
        chain = replace(chain, actuator=Actuator(hub_damping=damping))
    return None if law is None else (arm, law, chain)


def some_law(rng, arm, chain):
    """One to three random entries, scaled so that the loop function is about 1 somewhere on the circle."""
    names = [str(each) for each in rng.choice(SIGNALS, size=rng.integers(1, 4), replace=False)]
    if arm.has_massless_hub:
        names = [each for each in names if each != "root_moment"]
    entries, left = {}, 8
    for each in names:
        name = f"{each}{round(float(rng.uniform(0.1, 0.9)) * arm.length, 6)}" if each.endswith("@") else each
        order = int(rng.integers(0, min(left, 5) + 1))
        left -= order
        poles, zeros = roots(rng, order), roots(rng, int(rng.integers(0, order + 1)))
        z = np.exp(1j * np.pi * rng.uniform(0.01, 0.99))
        size = abs(sampled(arm, name, chain, z))
        if not 1e-290 < size < np.inf:
            continue
        shape = abs(np.prod(z - np.array(zeros)) / np.prod(z - np.array(poles)))
        gain = 10.0 ** rng.uniform(-2.5, 0.3) / (size * shape)
        entries[name] = {"zeros": zeros, "poles": poles, "gain": float(gain * rng.choice([-1, 1]))}
    return Law(entries, period=chain.sampling.period) if entries else None


def sampled(arm, name, chain, z):
    """The pulse transfer function to a signal, at one z, from ten modes."""
    plain, _, x = name.partition("@")
    if not x:
        return pulse_transfer(arm, [plain], chain.sampling, count=10)(z)[0]
    s = np.log(z) / chain.sampling.period
    return Signals(arm, (name,)).values(np.array([s]))[0, 0]


def roots(rng, count):
    """Roots in conjugate pairs or alone: most inside the circle, some outside, some at 1."""
    found = []
    while len(found) < count:
        size = rng.uniform(1.0, 1.4) if rng.random() < 0.05 else 1 - 10 ** rng.uniform(-3, 0)
        if count - len(found) > 1 and rng.random() < 0.5:
            root = complex(size * np.exp(1j * rng.uniform(0.02, 3.1)))
            found += [root, root.conjugate()]
        else:
            found.append(1.0 if rng.random() < 0.1 else float(size * rng.choice([1, -1], p=[0.8, 0.2])))
    return found


def read_analog(arm, law, chain, count):
    """A, B, C, D to what is sampled: the actuator's damping as friction of the hub, the anti-alias filter as states."""
    damping, corner = chain.actuator.hub_damping, chain.sampling.antialias_corner
    if damping:
        arm = replace(arm, hub=replace(arm.hub, friction=arm.hub.friction + damping))
    A, B, C, D = sensed_model(arm, law.signals, count)
    rows = [n for n, each in enumerate(Signals(arm, law.signals).outputs) if is_analog(each, chain)]
    if np.isinf(corner) or not rows:
        return A, B, C, D
    n, m = len(A), len(rows)
    whole = np.block([[A, np.zeros((n, m))], [corner * C[rows], -corner * np.eye(m)]])
    seen, through = np.hstack([C, np.zeros((len(C), m))]), D.copy()
    seen[rows], through[rows] = np.eye(n + m)[n:], 0.0
    return whole, np.vstack([B, corner * D[rows]]), seen, through


def stepped(arm, law, chain, count=MODES):
    """The closed loop's matrix of a modal model: matrix exponentials, held inputs and the law's states."""
    A, B, C, D = read_analog(arm, law, chain, count)
    T, d = chain.sampling.period, chain.sampling.whole_delay
    f = chain.sampling.fraction
    n = len(A)

    def held(duration):
        both = expm(duration * np.block([[A, B], [np.zeros((1, n + 1))]]))
        return both[:n, :n], both[:n, n]

    (first, late), (second, early) = held(f * T), held((1 - f) * T)
    Ak, Bk, Ck, Dk = law.matrices()
    m = len(Ak)
    size = n + d + 1 + m  # the arm, u_{k-1} .. u_{k-d-1}, the law
    states, inputs, own = np.arange(n), n + np.arange(d + 1), n + d + 1 + np.arange(m)
    read = np.zeros((len(C), size))
    read[:, states], read[:, inputs[-1]] = C, D[:, 0]
    u = -Dk @ read
    u[:, own] -= Ck
    M = np.zeros((size, size))
    M[np.ix_(states, states)] = second @ first
    M[states, inputs[-1]] += second @ late
    M[states] += np.outer(early, u[0]) if d == 0 else 0.0
    if d:
        M[states, inputs[-2]] += early
        M[inputs[1:], inputs[:-1]] = 1.0
    M[inputs[0]] = u[0]
    M[own] = Bk @ read
    M[np.ix_(own, own)] += Ak
    return M


def radius_of(M, at_one=0):
    """ln of the spectral radius, but for so many poles at z = 1, that of a free hub angle among them."""
    z = np.linalg.eigvals(M)
    near = np.argsort(abs(z - 1), kind="stable")[:at_one]
    assert (abs(z[near] - 1) < AT_ONE).all()
    return float(np.log(abs(np.delete(z, near)).max()))


def grows(arm, law, chain, count):
    """Whether the input of the simulated loop is larger at the end of 20,000 samples after an impulse than early on."""
    task = replace(scenario("impulse", arm, chain, SAMPLES * chain.sampling.period), impulse=1e-12)
    run = Simulator(arm, chain, task, law, count=count).run()
    if run.stopped is not None:
        return True
    size = abs(run.torque)
    return size[-PART:].max() > size[1:PART].max()


def judge(arm, law, chain):
    """ "right", "refused: ...", "wrong: ..." or "too near", and whether a simulation was asked too."""
    try:
        count = None if arm.least_damping else MODES
        verdict = sampled_verdict(arm, law, chain, count=count)
    except (ConvergenceError, ParameterError) as error:
        return f"refused: {str(error).splitlines()[0]}", False
    try:
        M = stepped(arm, law, chain)
    except ConvergenceError:
        return "no second road", False
    other = radius_of(M, verdict.loop.has_free_angle + verdict.loop.poles_at_one)
    if abs(other) < CLOSE:
        return "too near", False
    mine = verdict.log_radius
    if (mine > 0) != (other > 0):
        return f"wrong: ln radius {mine:.3e}, of a model {other:.3e}", False
    if abs(other) > SLOW and not verdict.loop.poles_at_one:
        if grows(arm, law, chain, verdict.modes_used) != (mine > 0):
            return f"wrong: ln radius {mine:.3e}, but a simulation says otherwise", True
        return "right", True
    return "right", False


def laws(rng):
    """The finding on one case; None where there is none."""
    case = some_case(rng)
    if case is None:
        return None
    (word, simulated), (arm, law, chain) = judge(*case), case
    outcome, _, words = word.partition(":")
    if outcome in ("wrong", "refused"):
        words += f" {arm.damping} {law.signals} {chain.sampling} {chain.actuator.hub_damping}"
    return Finding(outcome, words, outcome == "wrong", {"simulated": float(simulated)})


if __name__ == "__main__":
    survey.main(each_of(laws))
