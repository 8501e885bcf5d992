"""Designs to requirements against another optimiser:  python -m tests.synthesis.agreement_design SIZE SEED [required]

A random rig (steel to rubber, payload, motor, hub friction), a period of 1 to 20 ms, a delay of 0 to 2 samples and a
structure.  The requirements are the grades *good*, and the least settling time is sought.

The other optimiser has the measures of the models in common with tfarm, neither its search nor its corrections: Sobol's
points, evolution strategies with a full covariance (Hansen, 2016) from many of the best, a simplex on the simulated
slew from several different ends, and one on the exact card where a model has a better law, or tfarm none.  What meets
the requirements is decided by the exact cards of both loops alone.

As the tip of many arms is at rest when the motion ends, the settling time and a twentieth of the dominant time constant
are compared.
"""

import sys
import time
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from tests.plausible.arms import draw, log
from tests.survey import Finding, main, numbered
from tfarm.arm import Motor
from tfarm.arm.chain import Sampling
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.spectrum.gains import rate_unit
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.goals import SHARE_OF_SPEED, check
from tfarm.synthesis.judge import LOST
from tfarm.synthesis.measures import LoopMeasures
from tfarm.synthesis.required import RequirementTask
from tfarm.synthesis.requirements import GOOD
from tfarm.synthesis.search import Worst, sobol
from tfarm.synthesis.slew_measures import SlewMeasures
from tfarm.synthesis.structures import structure_of
from tfarm.synthesis.worst_case import NamedArm

# evaluations of a model: twenty times the 6,000 of a search of two coefficients
POINTS = 2**14
STARTS = 160
CHILDREN = 16
ROUNDS = 40
# of a violation: rounding of a value at its limit
ROUNDING = 1e-12


def some_motor(rng, arm, first):
    """A motor whose back-EMF brakes the arm at 0.01 to 1 times its first frequency."""
    J = arm.total_inertia
    ratio, resistance = log(rng, 1, 100), log(rng, 0.2, 20)
    return Motor(
        resistance=resistance,
        torque_constant=np.sqrt(resistance * J * first * log(rng, 1e-2, 1.0)) / ratio,
        gear_ratio=ratio,
        rotor_inertia=J / ratio**2 * log(rng, 1e-3, 0.3),
        gear_efficiency=float(rng.uniform(0.6, 1.0)),
    )


def some_task(rng):
    """A task whose first mode turns by 0.02 to 2.5 rad a period; one arm of ten has no damping."""
    period = log(rng, 1e-3, 20e-3)
    first = np.inf
    while not 0.02 < first * period < 2.5:
        arm = draw(int(rng.integers(1_000_000)), 0).arm
        first = first_frequency(arm)
    damping = 0.0 if rng.random() < 0.1 else 2 * log(rng, 1e-3, 2e-2) / first
    arm = replace(arm, link=replace(arm.link, damping=damping))
    if damping and rng.random() < 0.3:
        arm = replace(arm, hub=replace(arm.hub, friction=arm.total_inertia * first * log(rng, 1e-3, 0.3)))
    if damping and rng.random() < 0.4:
        drive = str(rng.choice(["motor_voltage", "motor_current"]))
        arm = replace(arm, motor=some_motor(rng, arm, first), input=drive)
    delay = float(rng.choice([0.0, 0.5, 1.0, 2.0, rng.uniform(0, 2)]))
    chain = Chain(sampling=Sampling(period=period, delay_samples=delay))
    structure = str(rng.choice(["K1-K2", "PD", "PID", "PD+notch"], p=(0.5, 0.3, 0.1, 0.1)))
    form = structure_of(structure, arm, Kp=0.0, modes=2, period=period, bounds={}, is_angle_free=True)
    return RequirementTask(arm, GOOD, "settling_time_s", form, 2, chain, lambda text: None)


def evolved(scores_of, starts, box, rounds, rng):
    """Best score and point of an evolution strategy from each of the starts (runs, n), all at once.

    Half of the children, by rank, give the next mean and the rank-mu update of the covariance; the length of the path
    of the means gives the step.
    """
    mean = np.array(starts)
    runs, n = mean.shape
    half = CHILDREN // 2
    w = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    w /= w.sum()
    effective = 1 / (w**2).sum()
    of_path = (effective + 2) / (n + effective + 5)
    of_covariance = min(1.0, effective / n**2) / 2
    size, path, C = np.full(runs, 0.3), np.zeros((runs, n)), np.tile(np.eye(n), (runs, 1, 1))
    rows = np.arange(runs)
    best, scores = mean.copy(), np.full(runs, np.inf)
    for _ in range(rounds):
        root = np.linalg.cholesky(C + 1e-12 * np.trace(C, axis1=1, axis2=2)[:, None, None] * np.eye(n))
        z = rng.standard_normal((runs, CHILDREN, n))
        y = z @ np.swapaxes(root, 1, 2)
        x = np.clip(mean[:, None] + size[:, None, None] * y, *box)
        found = scores_of(x.reshape(-1, n).T).reshape(runs, CHILDREN)
        rank = found.argsort(axis=1)[:, :half]
        is_better = found[rows, rank[:, 0]] < scores
        best[is_better] = x[rows, rank[:, 0]][is_better]
        scores = np.minimum(scores, found[rows, rank[:, 0]])
        chosen, steps = y[rows[:, None], rank], z[rows[:, None], rank]
        mean = np.clip(mean + size[:, None] * (w @ chosen), *box)
        path = (1 - of_path) * path + np.sqrt(of_path * (2 - of_path) * effective) * (w @ steps)
        C = (1 - of_covariance) * C + of_covariance * np.einsum("rki,rkj,k->rij", chosen, chosen, w)
        size = size * np.exp(np.clip(of_path / 2 * ((path**2).sum(axis=1) / n - 1), -1, 1))
    order = scores.argsort()
    return scores[order], best[order]


def apart(points, least, number):
    """The first points (m, n) that differ from those before by more than `least` of a coordinate."""
    chosen = []
    for x in points:
        if len(chosen) < number and all((abs(x - other) > least).any() for other in chosen):
            chosen.append(x)
    return chosen


class Other:
    """The other optimiser of a task, with a share of its evaluations."""

    def __init__(self, task, share):
        self.goal = task.goal
        self.named = NamedArm(task.arm.name, task.arm, {})
        self.judge = task.judge(task.arm, self.goal, 0)
        self.slew = SlewMeasures(self.judge.arm, self.judge.known, self.judge.chain, 8)
        self.task = task
        self.form = task.form.wider(task.form.ends(physical=False), 4.0)
        self.share = share
        # the least value of a law that meets the requirements by the exact card, and its point
        self.value, self.x = np.inf, None

    def value_of(self, law):
        """The settling time and a share of the dominant time constant [s]."""
        judge = self.judge
        entries = judge.entries(law)
        loop = LoopMeasures(judge.model, entries, judge.model.poles(entries), judge.chain.sampling.period)
        speed = float(loop.dominant_time_constant(first_frequency(judge.arm))[0])
        # as of tfarm's score, where the tip of a slow loop does not settle in the longest record
        return min(self.slew.of(law)["settling_time_s"], 100 * speed) + SHARE_OF_SPEED * speed

    def of_model(self, x):
        """Scores (m,) of points (n, m) by the model."""
        return Worst((self.judge,)).scores(self.form, x)

    def simulated(self, x):
        """Score of a point with its slew."""
        return self.goal.simulated_score(self.judge, self.slew, self.form.record_at(x))

    def on_card(self, x):
        """Score of a point by its exact cards; the best that meets the requirements is kept."""
        law = self.form.record_at(x)
        rows, _ = check(self.goal, self.task.arm, self.task.chain, self.named, law)
        violations = np.array([row.violation for row in rows])
        if not np.isfinite(violations).all():
            return LOST
        value = self.value_of(law)
        if violations.max() <= ROUNDING and value < self.value:
            self.value, self.x = value, x
        return float(np.log(value)) + 30 * np.maximum(violations, 0.0).sum()

    def simplex(self, score, x, number, step):
        """Score and point of the end of a simplex."""
        low, high = self.form.box
        edges = np.diag(np.where(x + step > high, -step, step))
        options = {"initial_simplex": [x, *(x + edges)], "maxfev": number, "xatol": 1e-6, "fatol": 1e-6}
        done = minimize(score, x, method="Nelder-Mead", bounds=np.transpose([low, high]), options=options)
        return float(done.fun), done.x

    def run(self, own):
        """Look for a law that meets the requirements with a value below that of tfarm's, `own`."""
        x = sobol(*self.form.box, int(POINTS * self.share), 77)
        x = x[:, self.of_model(x).argsort()].T
        starts = apart(x, 0.2, int(STARTS * self.share))
        scores, x = evolved(self.of_model, starts, self.form.box, ROUNDS, np.random.default_rng(1))
        different = apart(x[scores < LOST], 0.05, 4 + int(12 * self.share))
        ends = [self.simplex(self.simulated, each, 60 * each.size, 0.2) for each in different]
        for score, each in sorted(ends, key=lambda pair: pair[0])[:2]:
            # exact cards take long
            if score < np.log(own) - 3e-3:
                self.simplex(self.on_card, each, 20 * each.size, 0.02)


def is_null(task, found):
    """Whether all gains of a law are below 1e-3 of their units."""
    rate = rate_unit(task.arm)
    units = {"K1": rate, "Kd": rate, "Kp": rate * first_frequency(task.arm), "K2": task.arm.input_per_torque}
    form = found.search.form
    gains = form.by_name(form.coefficients(found.x).tolist())
    return all(abs(gain) < 1e-3 * units[name] for name, gain in gains.items() if name in units)


def compare(rng, share):
    """Compare one design with that of the other optimiser."""
    task = some_task(rng)
    begun = time.process_time()
    try:
        found = task.find([NamedArm(task.arm.name, task.arm, {})], None, "whole")
    except ConvergenceError:
        found = None
    figures = {"CPU [s]": time.process_time() - begun}
    sampling = task.chain.sampling
    name = f"{task.arm.name}, {task.form.name}, {task.arm.input}, {sampling.period:.4g} s, {sampling.delay_samples:.2g}"
    if found is not None and is_null(task, found):
        return Finding("null", name, True, figures)
    other = Other(task, share)
    own = np.inf if found is None or found.violation > ROUNDING else other.value_of(found.law)
    other.run(own)
    if np.isinf(own) and np.isinf(other.value):
        return Finding("neither meets the requirements", "", False, figures)
    if np.isinf(own):
        law = other.form.record_at(other.x)
        return Finding("the other alone meets the requirements", f"{name}: {law}", True, figures)
    gain = max(own / other.value - 1, 0.0)
    figures["beaten by"] = gain
    if gain <= 0.005:
        return Finding("not beaten", "", False, figures)
    words = f"{name}: {own:.5g} of {found.law} by {other.value:.5g} of {other.form.record_at(other.x)}"
    return Finding(f"beaten by more than {'2' if gain > 0.02 else '0.5'} %", words, True, figures)


@numbered
def required(rng):
    """Against twenty times the evaluations of a structure of two coefficients, twice those of more."""
    return compare(rng, 1.0)


@numbered
def brief(rng):
    """Against one and a half times the evaluations."""
    return compare(rng, 1 / 16)


if __name__ == "__main__":
    # twenty times the evaluations take a minute and a half of CPU a rig: only where it is named
    main(*((brief, required) if sys.argv[3:] else (brief,)), size=300)
