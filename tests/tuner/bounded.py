"""Guarded runs of random seeds and arms stay in the guard and bounded; so do adversarial sequences inside a sector.

`python -m tests.tuner.bounded SIZE SEED` for SIZE runs and a fifth as many sequences.
"""

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from tests import survey
from tests.survey import Finding
from tfarm import Arm, Hub, Link, Payload, Section
from tfarm.dsp import Chain, Sampling, Slew
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.tuner import Learning, best_constant, find_guard, initial_network, slew_trial, train
from tfarm.tuner.guard import MovingGain

SEEDS_AN_ARM = 4
STEPS = 3000


def some_trial(rng):
    """A light or stocky arm with a hub and perhaps a payload, at a period and with a delay that need not suit it."""
    section = Section.rectangle(width=float(rng.uniform(0.02, 0.15)), depth=float(rng.uniform(0.003, 0.015)))
    link = Link.isotropic(
        length=float(rng.uniform(0.5, 1.5)), density=float(rng.uniform(1500, 8000)),
        youngs_modulus=float(10 ** rng.uniform(10, 11.3)), poissons_ratio=0.3, section=section,
        damping=float(10 ** rng.uniform(-6, -3)),
    )  # fmt: skip
    payload = Payload(mass=float(rng.choice([0.0, rng.uniform(0, 0.5)])))
    arm = Arm(link=link, hub=Hub(inertia=float(10 ** rng.uniform(-1.5, 0.5))), payload=payload)
    sampling = Sampling(
        period=float(rng.choice([0.002, 0.005, 0.01])), delay_samples=float(rng.choice([0, 0, rng.uniform(0, 1)]))
    )
    chain = Chain(sampling=sampling, slew=Slew(travel=0.5, rise_time=1.0))
    return slew_trial(arm, chain, K1=arm.total_inertia * float(rng.uniform(0.1, 1.5)), duration=2.0)


def moment_bound(trial, guard):
    """What the moment may reach at each sample: the norm of P shrinks by itself, the references add to it."""
    proof, loop = guard.proofs[0], MovingGain(trial.loop)
    root = np.linalg.cholesky(proof.P)
    push, reading = np.linalg.norm(root.T @ loop.drive), np.linalg.norm(np.linalg.solve(root, loop.sense))
    servo, counted, rest, rigid = trial.reference
    steady = counted + rest + servo
    torque = np.maximum(abs(steady + guard.lo * rigid), abs(steady + guard.hi * rigid))
    bound, size = [0.0], 0.0
    for each in torque[:-1]:
        size = proof.contraction * size + push * each
        bound.append(reading * size)
    return np.array(bound)


def run(trial, guard, rng):
    """One training with random settings; what is wrong with it, or None."""
    learning = Learning(
        mode=str(rng.choice(["trial", "online"])), rule=str(rng.choice(["plain", "clipped", "dynamic"])),
        sensitivity=str(rng.choice(["one-step", "whole"])), eta=float(10 ** rng.uniform(-1, 2)),
        alpha=float(rng.uniform(0, 0.95)),
    )  # fmt: skip
    network = initial_network(int(rng.integers(2**31)), scales=np.ones(int(rng.choice([6, 7]))))
    training = train(trial, network, guard, learning, 4)
    K, x = training.result.K, training.result.x
    if training.stopped is not None or training.result.stopped is not None:
        return f"not bounded: {training.stopped}"
    if not (guard.lo <= K.min() and K.max() <= guard.hi):
        return f"left the guard: {K.min()}, {K.max()}"
    excess = (abs(x + trial.task.moment_reference) - moment_bound(trial, guard) * (1 + 1e-9) - 1e-9).max()
    return None if excess <= 0 else f"passed its bound by {excess}"


def adversary(loop, lo, hi, rng, patience, root=None):
    """ln of the growth of a state in STEPS samples, each gain an end of the sector, the worse for a random energy.

    The energy is a Lyapunov function of one frozen gain between them, as the adversary does not know the common one.
    A choice is kept for `patience` samples.  The size of a state s is |root^T s|, or |s|.
    """
    low, high = loop.at(lo), loop.at(hi)
    weights = np.exp(rng.normal(size=loop.drive.size)) * (rng.random(loop.drive.size) < 0.5)
    frozen = loop.at(float(rng.uniform(lo, hi)))
    energy = solve_discrete_lyapunov(frozen.T, np.diag(weights) + np.outer(loop.sense, loop.sense))
    ahead = [np.linalg.matrix_power(A, patience) for A in (low, high)]
    forms = [A.T @ energy @ A for A in ahead]
    root = np.eye(loop.drive.size) if root is None else root
    state, log_size = rng.normal(size=loop.drive.size), 0.0
    start = np.linalg.norm(root.T @ state)
    for _ in range(STEPS // patience):
        state = ahead[int(state @ forms[1] @ state > state @ forms[0] @ state)] @ state
        size = np.linalg.norm(root.T @ state)
        log_size += np.log(size)
        state = state / size
    return log_size - np.log(start)


def runs(size, seed):
    """`size` guarded runs, several an arm, and a fifth as many sequences, one an arm."""
    rng, made, sequences = np.random.default_rng(seed), 0, 0
    while made < size:
        trial = some_trial(rng)
        try:
            guard = find_guard(trial.loop, "time-varying", best_constant(trial).gain)
        except (CertificationError, ConvergenceError):
            yield Finding("without a sector")
            continue
        for _ in range(min(SEEDS_AN_ARM, size - made)):
            made += 1
            wrong = run(trial, guard, rng) or ""
            yield Finding("run", f"{wrong} {guard.sentence} {trial.arm}" if wrong else "", bool(wrong))
        if sequences < size // 5:
            sequences += 1
            loop, patience = MovingGain(trial.loop), int(rng.integers(1, 6))
            grows = bool(adversary(loop, guard.lo, guard.hi, rng, patience, np.linalg.cholesky(guard.proofs[0].P)) >= 0)
            yield Finding("sequence", f"grows {guard.sentence} {trial.arm}" if grows else "", grows)


if __name__ == "__main__":
    survey.main(runs, size=40, seed=0)
