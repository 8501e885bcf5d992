"""What is said about the tuner: the answer first, then what it leaves out."""

from __future__ import annotations

import numpy as np

from tfarm.report.digits import significant
from tfarm.report.sampled_words import typeset
from tfarm.report.sections import Fact
from tfarm.report.time_responses import away
from tfarm.report.tuner_study import Curves, TunerStudy


def short_answer(data: TunerStudy) -> str:
    """How much the tuner gains over the best constant gain."""
    tuning, final = data.tuning, data.curves[0].final
    best, without = tuning.best_constant.cost, tuning.without.cost
    median = float(np.quantile(final, 0.5, method="nearest"))
    free = float(np.quantile(data.curves[1].final, 0.5, method="nearest"))
    below = int((final < best).sum())
    taken = 100 * (1 - best / without)
    gain = 100 * (1 - median / best)
    lead = "A little" if 0 < gain < 15 else "Yes" if gain >= 15 else "No"
    more = "lowers it by" if gain > 0 else "raises it by"
    return (
        f"{lead}. A constant K2 of {significant(tuning.best_constant.gain, 3)} already takes {significant(taken, 2)} % "
        f"off the cost of a slew ({significant(without, 3)} without moment feedback, {significant(best, 3)} with it); "
        f"a gain that tunes itself {more} another {significant(abs(gain), 2)} %, to {significant(median, 3)} in the "
        f"median of {final.size} seeds. {below} of {final.size} seeds end below the best constant gain. Without the "
        f"guard, and so without a proof, it would be {significant(100 * (1 - free / best), 2)} %."
    )


def drift_words(data: TunerStudy) -> str:
    """What the cost does not see: the angle that a moving gain leaves, as nothing regulates it."""
    tuned, constant = _off_target(data)
    return (
        f"What the cost does not see: the arm ends off its target, the tip {tuned} mm with the tuner and {constant} mm "
        "with the best constant gain. The law regulates the hub rate alone; the moment feedback's torque adds up to an "
        "angle of its integral over K1, which for a constant gain is nearly nothing and for a moving one is not. A "
        "tuner for use needs Kp."
    )


def _off_target(data: TunerStudy) -> tuple[str, str]:
    """How far off the tip ends [mm], with the tuner and with the best constant gain."""
    ends = (float(away(data.arm, each)[-1]) for each in (data.slews["with the tuner"], data.constant))
    tuned, constant = (significant(1e3 * abs(x), 2) for x in ends)
    return tuned, constant


def shaping_words(data: TunerStudy) -> str:
    """What input shaping does instead."""
    costs = {kind: record.cost for kind, (_, record) in data.tuning.shaped.items()}
    late = {
        kind: trial.task.busy_until - data.tuning.trial.task.busy_until
        for kind, (trial, _) in data.tuning.shaped.items()
    }
    told = " and ".join(
        f"{kind} has {significant(costs[kind], 2)}, arriving {significant(1e3 * late[kind], 3)} ms later"
        for kind in costs
    )
    return (
        f"What one would try first is cheaper: shaping the reference, with no moment feedback at all, {told} (each "
        "judged by its own slew). Shaping cannot answer disturbances, which feedback can."
    )


def bound_words(data: TunerStudy) -> str:
    """How far everything is from what is possible, and what is proven."""
    bound, guard = data.tuning.bound.cost, data.tuning.training.guard
    return (
        f"No controller of this slew gets below {significant(bound, 3)}, the linear-quadratic optimum that knows the "
        f"whole state and the slew beforehand. The tuner's gain stays in {typeset(guard.sentence)}."
    )


def learning_words(data: TunerStudy) -> str:
    """What each rule does, and whether the paper's pair is the best."""
    best = data.tuning.best_constant.cost
    told = [
        f"{curves.title[0].upper()}{curves.title[1:]}: {int((curves.final < best).sum())} of {curves.final.size} below "
        f"the best constant gain, {_ends(curves)}"
        for curves in data.curves
    ]
    found = data.cost_map
    answer = "Yes" if found.is_papers_best else "No"
    return (
        f"Seed by seed. {'. '.join(told)}. The guard costs part of the gain, "
        "and buys the proof. Is (0.6, 0.8) the best pair of momentum and learning rate? "
        f"{answer}: {found.verdict.partition(': ')[2]}."
    )


def _ends(curves: Curves) -> str:
    finite = curves.final[np.isfinite(curves.final)]
    low, middle, high = (
        significant(float(x), 3) for x in (finite.min(), np.quantile(curves.final, 0.5, method="nearest"), finite.max())
    )
    gone = [
        f"{count} {what}" for count, what in ((curves.diverged, "diverged"), (curves.died, "died at K = 0")) if count
    ]
    spread = f"median {middle}, from {low} to {high}"
    return ", ".join([*gone, spread])


def headline_facts(data: TunerStudy) -> tuple[Fact, ...]:
    """The costs, from nothing to what is possible."""
    tuning, final = data.tuning, data.curves[0].final
    median = float(np.quantile(final, 0.5, method="nearest"))
    low, high = (float(np.quantile(final, q, method="nearest")) for q in (0.25, 0.75))
    gain = 100 * (1 - median / tuning.best_constant.cost)
    guard = tuning.training.guard
    off, off_constant = _off_target(data)
    helps = f"by {significant(gain, 2)} %" if gain > 0 else "no"
    K = significant(tuning.best_constant.gain, 3)
    shaped = min((record.cost, kind) for kind, (_, record) in tuning.shaped.items())
    return (
        Fact(label="does tuning beat a constant gain?", value=helps, beside=f"median of {final.size} seeds"),
        Fact(label="cost without moment feedback", value=significant(tuning.without.cost, 4)),
        Fact(label="best constant gain", value=significant(tuning.best_constant.cost, 4), beside=f"K2 = {K}"),
        Fact(label="tuner", value=significant(median, 4), beside=f"half between {low:.3f} and {high:.3f}"),
        Fact(label="nothing is below", value=significant(tuning.bound.cost, 4), beside="linear-quadratic optimum"),
        Fact(label="input shaping instead", value=significant(shaped[0], 3), beside=f"{shaped[1]}, a later slew"),
        Fact(label="tip off its target at the end", value=off, unit="mm", beside=f"constant gain: {off_constant} mm"),
        Fact(label="guard", value=f"{guard.lo:.3f} … {guard.hi:.3f}", beside="any K(t) in it: proven stable"),
    )
