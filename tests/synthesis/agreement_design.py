"""Designs to requirements against another optimiser:  python -m tests.synthesis.agreement_design SIZE SEED [required]

A random rig (steel to rubber, payload, motor, hub friction), a period of 1 to 20 ms, a delay of 0 to 2 samples and a
structure.  The requirements are the grades *good*, and the least settling time is sought.

The other optimiser has the measures of the models in common with tfarm, neither its search nor its corrections: Sobol's
points, of which the peak of S on a coarse grid discards most, evolution strategies with a full covariance (Hansen,
2016) from many of the best, and a simplex on the simulated slew from several different ends.  Where a model has a
better law, or tfarm none, it is corrected by the exact card.  What meets the requirements is decided by the exact cards
of both loops alone; `tfarm.sampled` has tfarm's law stable
with gains up to 6 dB larger and smaller, and with a further delay of a period.

Its evaluations of laws are `share` times those that design counts, and a figure of the survey.

As the tip of many arms is at rest when the motion ends, the settling time and a twentieth of the dominant time constant
are compared, and as laws below the floor of speed pay for it in what is minimised, times what they pay.

    python -m tests.synthesis.agreement_design FIRST LAST SEED FILE     # appends a line of JSON a rig
    python -m tests.synthesis.agreement_design summary FILE
"""

import json
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import tfarm
from tests.plausible.arms import draw, log
from tests.survey import Finding, main, numbered
from tfarm.arm import Motor
from tfarm.arm.chain import Sampling
from tfarm.assessment.card import graded_arm
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.spectrum.gains import rate_unit
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.goals import SHARE_OF_SPEED, WEIGHT, Goal, check, measures_of, slowness
from tfarm.synthesis.judge import LOST, of_laws
from tfarm.synthesis.models import values_of
from tfarm.synthesis.near_map import find_near_map
from tfarm.synthesis.required import RequirementTask
from tfarm.synthesis.requirements import GOOD
from tfarm.synthesis.search import Worst, sobol
from tfarm.synthesis.slew_measures import SlewMeasures
from tfarm.synthesis.structures import structure_of
from tfarm.synthesis.worst_case import NamedArm

# of the evaluations of the other optimiser: those of Sobol's points
SCREENED = 0.75
CHILDREN = 16
ROUNDS = 40
# points of the coarse grid
COARSE = 100
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

    `scores_of` points and limits may have any value above these: a child half a unit worse than the last parents.

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
    limits = np.full(runs, np.inf)
    for _ in range(rounds):
        root = np.linalg.cholesky(C + 1e-12 * np.trace(C, axis1=1, axis2=2)[:, None, None] * np.eye(n))
        z = rng.standard_normal((runs, CHILDREN, n))
        y = z @ np.swapaxes(root, 1, 2)
        x = np.clip(mean[:, None] + size[:, None, None] * y, *box)
        found = scores_of(x.reshape(-1, n).T, np.repeat(limits, CHILDREN)).reshape(runs, CHILDREN)
        rank = found.argsort(axis=1)[:, :half]
        limits = found[rows, rank[:, -1]] + 0.5
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
    """The other optimiser of a task, with a number of evaluations of laws."""

    def __init__(self, task, evaluations):
        self.goal = task.goal
        self.named = NamedArm(task.arm.name, task.arm, {})
        self.judge = task.judge(task.arm, self.goal, 0)
        # poles with the delays required, and gains a quarter larger, only where the slew is simulated
        self.few = replace(self.judge, delayed=())
        angles = self.judge.model.angles
        self.coarse = self.judge.model.responses_at(angles[np.linspace(0, angles.size - 1, COARSE).astype(int)])
        self.slew = SlewMeasures(self.judge.arm, self.judge.known, self.judge.chain, 8)
        self.task = task
        self.form = task.form.wider(task.form.ends(physical=False), 4.0)
        self.evaluations = evaluations
        self.counted = 0
        # the least value of a law that meets the requirements by the exact card, and its point
        self.value, self.x, self.law = np.inf, None, None
        # the least score of a model with its slew
        self.score = np.inf

    def value_of(self, law):
        """The settling time and a share of the dominant time constant [s], times what a slow law pays."""
        judge = self.judge
        entries = judge.entries(law)
        loop = measures_of(judge, entries)
        speed = float(loop.dominant_time_constant(first_frequency(judge.arm))[0])
        # as of tfarm's score, where the tip of a slow loop does not settle in the longest record
        value = min(self.slew.of(law)["settling_time_s"], 100 * speed) + SHARE_OF_SPEED * speed
        return value * float(np.exp(slowness(judge, entries)[0]))

    def of_model(self, x, limits):
        """Scores (m,) of points (n, m) by the model, any value above their limits."""
        self.counted += x.shape[1]
        entries = self.form.entries(self.form.coefficients(x))
        # no dominant time constant is shorter
        least = np.log(0.25 / first_frequency(self.judge.arm))
        peak = 1 / abs(1 + self.coarse_loop(entries)).min(axis=1)
        scores = slowness(self.judge, entries) + least + WEIGHT * np.maximum(peak / 2 - 1, 0.0)
        left = np.flatnonzero(scores <= limits)
        if left.size:
            scores[left] = self.goal.aims(self.few, of_laws(entries, left), limits[left])
        return scores

    def coarse_loop(self, entries):
        """The loop function (laws, points) on the coarse grid."""
        s, response = self.coarse
        signals = self.judge.model.signals
        return sum(
            values_of(num, s) / values_of(den, s) * response[signals.index(signal)] for signal, num, den in entries
        )

    def screened(self, number, kept):
        """The best of Sobol's points (kept, n), those below a limit that falls."""
        best, scores = np.zeros((0, self.form.size)), np.zeros(0)
        x = sobol(*self.form.box, 1 << (number - 1).bit_length(), 77)[:, :number]
        for part in np.array_split(x, number // 512 + 1, axis=1):
            limit = scores[kept] if scores.size > kept else np.inf
            found = self.of_model(part, np.full(part.shape[1], limit))
            scores, best = np.r_[scores, found], np.r_[best, part.T]
            order = scores.argsort()[: 4 * kept]
            scores, best = scores[order], best[order]
        return best[scores < LOST]

    def simulated(self, goal):
        """Function from a point to its score with its slew by a goal."""
        judge = self.task.judge(self.task.arm, goal, 0)

        def score(x):
            self.counted += 1
            return goal.simulated_score(judge, self.slew, self.form.record_at(x))[0]

        return score

    def is_met(self, law):
        """Whether the exact cards of a law meet all requirements."""
        _, violations = check(self.goal, self.task.arm, self.task.chain, self.named, law)
        return violations.max() <= ROUNDING

    def on_card(self, x):
        """Violations (2, requirements) of a point by its exact cards; the best that meets them all is kept."""
        law = self.form.record_at(x)
        _, violations = check(self.goal, self.task.arm, self.task.chain, self.named, law)
        if violations.max() <= ROUNDING and self.value_of(law) < self.value:
            self.value, self.x, self.law = self.value_of(law), x, law
        return violations

    def simplex(self, score, x, number, step):
        """Score and point of the end of a simplex."""
        low, high = self.form.box
        edges = np.diag(np.where(x + step > high, -step, step))
        options = {"initial_simplex": [x, *(x + edges)], "maxfev": number, "xatol": 1e-6, "fatol": 1e-6}
        done = minimize(score, x, method="Nelder-Mead", bounds=np.transpose([low, high]), options=options)
        return float(done.fun), done.x

    def run(self, own):
        """Look for a law that meets the requirements with a value below that of tfarm's, `own`."""
        runs = max(int((1 - SCREENED) * self.evaluations / (CHILDREN * ROUNDS)), 2)
        starts = apart(self.screened(int(SCREENED * self.evaluations), 4 * runs), 0.2, runs)
        if not starts:
            return
        scores, x = evolved(self.of_model, starts, self.form.box, ROUNDS, np.random.default_rng(1))
        different = apart(x[scores < LOST], 0.1, 3)
        simulated = self.simulated(self.goal)
        ends = [self.simplex(simulated, each, 50 * each.size, 0.1) for each in different]
        self.score = min(score for score, _ in ends) if ends else np.inf
        for score, each in sorted(ends, key=lambda pair: pair[0])[:2]:
            goal = self.goal
            # exact cards take long: corrected by half more than is missing, as long as it would be better
            for _ in range(4):
                if not score < np.log(own) - 3e-3:
                    break
                violations = self.on_card(each)
                if violations.max() <= ROUNDING or not np.isfinite(violations).all():
                    break
                goal = goal.tighter(1.2 * np.maximum(violations, 0.0) + 1e-6 * (violations > 0))
                score, each = self.simplex(self.simulated(goal), each, 25 * each.size, 0.02)


def is_null(task, found):
    """Whether all gains of a law are below 1e-3 of their units, and its loop stable with ten times as much.

    The hub of an arm under a heavy payload may allow no more: its own inertia is far below that of the whole arm.
    """
    rate = rate_unit(task.arm)
    units = {"K1": rate, "Kd": rate, "Kp": rate * first_frequency(task.arm), "K2": task.arm.input_per_torque}
    form = found.search.form
    gains = form.by_name(form.coefficients(found.x).tolist())
    is_small = all(abs(gain) < 1e-3 * units[name] for name, gain in gains.items() if name in units)
    arm, _ = graded_arm(task.arm)
    return is_small and tfarm.sampled(arm, found.law.times(10.0), task.chain).verdict.is_stable


@contextmanager
def laws_counted():
    """A list with the number of laws that searches of tfarm have scored, and of slews."""
    counted = [0]
    of_models, of_slews = Worst.scores, Goal.simulated_score

    def scores(self, form, x, limits=None):
        counted[0] += x.shape[1]
        return of_models(self, form, x, limits)

    def simulated_score(self, *rest):
        counted[0] += 1
        return of_slews(self, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Worst, "scores", scores)
        patch.setattr(Goal, "simulated_score", simulated_score)
        yield counted


def is_good_when_sampled(task, law):
    """Whether `tfarm.sampled` has a law stable up to the limits of gain margin and delay margin."""
    arm, _ = graded_arm(task.arm)
    sampling = task.chain.sampling
    late = replace(task.chain, sampling=replace(sampling, delay_samples=sampling.delay_samples + 1 - 1e-6))
    cases = [(1 / 1.995, task.chain), (1.0, task.chain), (1.995, task.chain), (1.0, late)]
    return all(tfarm.sampled(arm, law.times(share), chain).verdict.is_stable for share, chain in cases)


def outcome_of(task, share):
    """What came of one rig: names and figures of both laws."""
    begun = time.process_time()
    with laws_counted() as counted:
        try:
            found = find_near_map(task, [NamedArm(task.arm.name, task.arm, {})], None, "whole")
        except ConvergenceError:
            found = None
    cpu = time.process_time() - begun
    other = Other(task, int(share * counted[0]))
    is_met = found is not None and found.violation <= ROUNDING
    own = other.value_of(found.law) if is_met else np.inf
    begun = time.process_time()
    if other.evaluations:
        other.run(own)
    sampling = task.chain.sampling
    return {
        "structure": task.form.name,
        "name": f"{task.arm.name}, {task.arm.input}, {sampling.period:.4g} s, {sampling.delay_samples:.2g}",
        "undamped": task.arm.has_elastic_link,
        "met": is_met,
        "checked": not is_met or is_good_when_sampled(task, found.law),
        "other_met": np.isfinite(other.value) or is_met,
        "null": found is not None and is_null(task, found),
        "own": own,
        "other": other.value,
        "of_model": float(np.exp(other.score)),
        "beaten": max(own / other.value - 1, 0.0) if np.isfinite(own) else 0.0,
        "law": str(None if found is None else found.law),
        "better": str(other.law),
        "cpu": cpu,
        "other_cpu": time.process_time() - begun,
        "laws": counted[0],
        "ratio": other.counted / max(counted[0], 1),
    }


def compare(rng, share):
    """Compare one design with that of the other optimiser."""
    found = outcome_of(some_task(rng), share)
    figures = {"CPU [s]": found["cpu"], "ratio of evaluations": found["ratio"], "beaten by": found["beaten"]}
    name = f"{found['structure']}, {found['name']}"
    if not found["checked"]:
        return Finding("not stable when sampled", name, True, figures)
    if found["null"]:
        return Finding("null", name, True, figures)
    if not found["met"] and np.isinf(found["other"]):
        return Finding("neither meets the requirements", "", False, figures)
    if not found["met"]:
        return Finding("the other alone meets the requirements", f"{name}: {found['better']}", True, figures)
    if found["beaten"] <= 0.005:
        return Finding("not beaten", "", False, figures)
    words = f"{name}: {found['own']:.5g} of {found['law']} by {found['other']:.5g} of {found['better']}"
    return Finding(f"beaten by more than {'2' if found['beaten'] > 0.02 else '0.5'} %", words, True, figures)


@numbered
def required(rng):
    """Against twenty times the evaluations."""
    return compare(rng, 20.0)


@numbered
def brief(rng):
    """Against as many evaluations."""
    return compare(rng, 1.0)


def record(first, last, seed, path):
    """Append a line of JSON for each of these rigs that the file has not, against twenty times the evaluations."""
    known = [(row["seed"], row["rig"]) for row in rows_of(path)]
    for number in range(first, last):
        if (seed, number) in known:
            continue
        found = {"rig": number, "seed": seed} | outcome_of(some_task(np.random.default_rng([seed, number])), 20.0)
        with Path(path).open("a") as file:
            file.write(json.dumps(found, default=float) + "\n")


def rows_of(path):
    """The records of a file, the last of each rig."""
    lines = Path(path).read_text().splitlines() if Path(path).exists() else []
    rows = [json.loads(line) for line in lines]
    return list({(row["seed"], row["rig"]): row for row in rows}.values())


def summary(path):
    """Print the shares of all rigs of a file."""
    rows = rows_of(path)
    both = [row for row in rows if row["met"] and row["other_met"]]
    alone = [row["rig"] for row in rows if row["met"] and np.isinf(row["other"])]
    lost = [row["rig"] for row in rows if not row["met"] and np.isfinite(row["other"])]
    print(f"{len(rows)} rigs: {sum(row['met'] for row in rows)} met by tfarm, the other alone {lost}")
    print(f"no better law by the other: {len(alone)}; null results: {sum(row['null'] for row in rows)}")
    print(f"not confirmed by sampled: {[row['rig'] for row in rows if not row['checked']]}")
    for limit in (0.005, 0.02):
        beaten = [row["rig"] for row in both if row["beaten"] > limit]
        print(f"beaten by more than {limit:.1%}: {len(beaten)} of {len(both)}, {beaten}")
    print(f"evaluations of the other: median {np.median([row['ratio'] for row in rows]):.3g} times those of tfarm")
    for name in sorted({row["structure"] for row in rows}):
        cpu = [row["cpu"] for row in rows if row["structure"] == name]
        other = [row["other_cpu"] for row in rows if row["structure"] == name]
        words = f"CPU median {np.median(cpu):.3g} s, worst {max(cpu):.3g} s, the other {np.median(other):.3g} s"
        print(f"{name}: {len(cpu)} rigs, {words}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["summary"]:
        summary(sys.argv[2])
    elif len(sys.argv) == 5:
        record(*map(int, sys.argv[1:4]), sys.argv[4])
    else:
        # twenty times the evaluations take half a minute of CPU a rig: only where it is named
        main(*((brief, required) if sys.argv[3:] else (brief,)), size=300)
