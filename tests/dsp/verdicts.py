"""Random arms, gains and delays: the verdict against a simulation and against encirclements of the aliasing sum.

    python -m tests.dsp.verdicts 1000

Cases nearer than 1e-3 to an edge (in K1 or K2), or with |ln radius| below 1e-5, are drawn again.
"""

from dataclasses import dataclass, replace

import numpy as np

import tfarm
from tests import survey
from tests.dsp.roads import aliased_loop
from tests.strategies import arm_of
from tests.survey import Finding, each_of
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, Sampling, Simulator, sampled_verdict, scenario
from tfarm.dsp.crossings import circle_grid, number_crossings
from tfarm.errors import ConvergenceError

PERIOD = 0.01
CLOSE, SLOW = 1e-3, 1e-5
TURN = 0.5  # rad of phase between two points of a contour


@dataclass(frozen=True)
class Case:
    arm: object
    gains: HubFeedback
    chain: Chain


def some_case(rng):
    """A slender arm with a hub of its size, damped, and gains on both sides of the edges."""

    def log(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    draw = {
        "length": log(0.3, 2.0),
        "slenderness": log(30, 300),
        "width": log(1, 20),
        "density": log(1500, 8000),
        "E": log(1e10, 2e11),
        "nu": float(rng.uniform(0.1, 0.4)),
        "mass": float(rng.choice([0.0, log(0.01, 1)])),
        "inertia": 0.0,
    }
    probe = arm_of(**draw, damping=0.0, hub=1.0)
    beam = probe.total_inertia - 1.0
    arm = arm_of(**draw, damping=log(3e-6, 3e-4), hub=beam * log(0.05, 5))
    gains = HubFeedback(K1=arm.total_inertia / PERIOD * log(1e-3, 3), K2=float(rng.uniform(-0.6, 1.8)))
    delay = float(rng.choice([0.0, 1.0, 2.0, rng.uniform(0, 2)]))
    return Case(arm, gains, Chain(sampling=Sampling(period=PERIOD, delay_samples=delay)))


def is_clear(verdict):
    """Whether the gains are far enough from every edge."""
    loop, gains = verdict.loop, verdict.loop.gains
    if abs(loop.poles.log_spectral_radius) < SLOW:
        return False
    grid = circle_grid(loop)
    near_K1 = abs(number_crossings(grid, "K1", loop.row[None])[0].gain - gains.K1) < CLOSE * max(1, abs(gains.K1))
    near_K2 = abs(number_crossings(grid, "K2", loop.row[None])[0].gain - gains.K2) < CLOSE
    return not (near_K1.any() or near_K2.any())


def simulated_growth(case, log_radius, count):
    """How much larger the loop is at the end of 20/|ln radius| samples than at the start; inf where it ran away."""
    n = max(60, int(np.ceil(20 / abs(log_radius))))
    task = replace(scenario("impulse", case.arm, case.chain, n * PERIOD), impulse=1e-9)
    run = Simulator(case.arm, case.chain, task, count=count).linear(case.gains)
    if run.stopped:
        return np.inf
    signal = abs(run.at_samples.hub_rate) * case.arm.hub.inertia + abs(run.at_samples.root_moment) * PERIOD
    edge = 10
    return signal[-edge:].max() / signal[1 : 1 + edge].max()


def encirclements(case, terms=300):
    """Roots of (1 - 1/z) F(z) outside the unit circle, F by the aliasing sum over the exact arm."""
    delay, gains = case.chain.sampling.delay_samples, case.gains

    def F(q):
        z = np.exp(1j * q)
        R, M = aliased_loop(case.arm, z, PERIOD, delay, terms)
        return (1 - 1 / z) * (1 + gains.K1 * R + gains.K2 * M)

    q = contour(case.arm)
    values = [F(each) for each in q]
    i, turned = 0, 0.0
    while i < len(q) - 1:
        step = np.angle(values[i + 1] / values[i])
        if abs(step) > TURN and q[i + 1] - q[i] > 1e-9:
            middle = (q[i] + q[i + 1]) / 2
            q.insert(i + 1, middle)
            values.insert(i + 1, F(middle))
            continue
        turned += step
        i += 1
    start = np.angle(values[0])  # to z = 1, where the function is K1 T/J > 0
    return -round((turned + start) / np.pi)


def contour(arm):
    """Angles from 0 to pi, dense where the samples see a natural frequency: a resonance is not to be stepped over."""
    C, q = arm.link.damping, [np.linspace(1e-4, np.pi, 60)]
    table = tfarm.modes(arm, 40)
    for w in table.natural_frequency[table.index > 0]:
        width = C * w**2 / 2 * PERIOD
        if width < 2:
            seen = abs(np.angle(np.exp(1j * w * np.sqrt(max(0.0, 1 - (C * w / 2) ** 2)) * PERIOD)))
            q.append(seen + width * np.array([-4, -2, -1, -0.5, 0, 0.5, 1, 2, 4]))
    inside = np.unique(np.concatenate(q))
    return list(inside[(inside >= 1e-4) & (inside <= np.pi)])


def judge(case):
    """The verdict's count of growing poles, the simulation's growth and the encirclements; None if unclear."""
    verdict = sampled_verdict(case.arm, case.gains, case.chain)
    if not is_clear(verdict):
        return None
    growing = int((verdict.loop.poles.log_radius > 0).sum())
    growth = simulated_growth(case, verdict.loop.poles.log_spectral_radius, verdict.modes_used)
    return growing, growth, encirclements(case)


def loops(rng):
    """The finding on one loop; None where the verdict is too near to an edge."""
    case = some_case(rng)
    try:
        judged = judge(case)
    except ConvergenceError as error:
        return Finding("refused", f"{error} {case}")
    if judged is None:
        return None
    growing, growth, outside = judged
    is_wrong = (growing > 0) != (growth > 1) or growing != outside
    outcome = "wrong" if is_wrong else "unstable" if growing else "stable"
    return Finding(outcome, f"{judged} {case}" if is_wrong else "", is_wrong)


if __name__ == "__main__":
    survey.main(each_of(loops))
