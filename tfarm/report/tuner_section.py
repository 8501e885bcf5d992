"""Does a self-tuning gain help?  The tuner beside what it has to beat, what it learns, and where it is proven."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import how_many, lined, plain, significant, worded
from tfarm.dsp import Chain
from tfarm.errors import CertificationError
from tfarm.plots.motion import draw_curves, draw_gain, slew
from tfarm.plots.regions import stable_regions
from tfarm.report.loop_laws import has_loop, what_holds, why_no_loop
from tfarm.report.sections import PageSection, Picture
from tfarm.report.time_responses import clipped_words, resolution_words, responses_table
from tfarm.report.tuner_words import (
    AS_TRAINED,
    CURVE_SEEDS,
    LONG_TRIAL,
    LONGEST_TRIAL,
    QUANTISED_AND_LATE,
    TunerNumbers,
    bound_words,
    drift_words,
    servo_words,
    shaping_words,
    trial_samples,
    tuner_facts,
    tuner_in_short,
    tuner_numbers,
)
from tfarm.report.words import residual_words, typeset
from tfarm.tuner.baselines import CONSTANT_GAINS, tried_gains
from tfarm.tuner.training import QUARTILES

TUNER_TITLE = "The gain tuner: does a self-tuning gain help?"
NOT_WITHOUT_DAMPING = (
    "This arm has no damping. When it is sampled its high modes then neither decay by themselves nor are they all "
    "damped by the loop, so no range of moving gains can be proven for all of them, and the tuner is not trained here. "
    "The page of sasaki2012-lab, the same arm as the paper's with a little damping, has the answer."
)

NOT_ON_ELASTIC = (
    "The link of this rig has no damping (C = 0), and what its hub, clamp or joint lose reaches high modes ever less. "
    "When it is sampled no range of moving gains can be proven for all of them, and the tuner is not trained here: "
    "give the link a measured damping, or see what tfarm tune makes of the first modes."
)
RUNS_AWAY = (
    f"No tuner here: at the default {RATE_GAIN} and this period the slew without moment feedback runs away, so that "
    f"there is no cost to compare with. The sampled loop above says which {RATE_GAIN} holds."
)


def tuner_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """The tuner with the paper's figures on a damped arm and its own chain; one sentence for any other."""
    chain = Chain() if chain is None else chain
    reason = why_not(arm) or why_too_long(arm, chain)
    if reason:
        return PageSection(anchor="tune", title=TUNER_TITLE, words=(reason,))
    try:
        data = tuner_numbers(arm, chain)
    except CertificationError as error:
        words = f"No tuner here: no range of gains is proven stable for a gain that moves ({typeset(str(error))})."
        return PageSection(anchor="tune", title=TUNER_TITLE, words=(words,))
    if not math.isfinite(data.tuning.without.cost):
        return PageSection(anchor="tune", title=TUNER_TITLE, words=(RUNS_AWAY,))
    return section_of(data)


def section_of(data: TunerNumbers) -> PageSection:
    """The section on numbers that are there already."""
    return PageSection(
        anchor="tune",
        title=TUNER_TITLE,
        facts=tuner_facts(data),
        words=(
            tuner_in_short(data),
            drift_words(data),
            shaping_words(data),
            bound_words(data),
            *fewer_words(data),
            *([servo_words(data)] if data.servo else []),
        ),
        blocks=(
            _gain_picture(data),
            _slew_picture(data),
            _coarse_picture(data),
            comparison_table(data),
            residual_table(data),
            _curves_picture(data),
        ),
    )


def why_not(arm: Arm) -> str:
    """The sentence for an arm on which no tuner is trained; empty where one is."""
    if not has_loop(arm):
        return why_no_loop(arm)
    if not arm.has_rigid_mode:
        return f"{what_holds(arm)}: it makes no slew, and there is nothing for the tuner to learn from."
    if not arm.has_elastic_link:
        return ""
    return NOT_WITHOUT_DAMPING if arm.is_undamped else NOT_ON_ELASTIC


def why_too_long(arm: Arm, chain: Chain) -> str:
    """The sentence for a slew of more samples than a page's trainings can have; empty for any other."""
    samples = trial_samples(arm, chain)
    if samples <= LONGEST_TRIAL:
        return ""
    return (
        f"No tuner here: a trial of this slew has {samples:,} samples at a period of {plain(chain.sampling.period)} s. "
        "A single tuning: tfarm tune."
    )


def fewer_words(data: TunerNumbers) -> list[str]:
    """The extent of learning curves and comparison that long trials limit, none where nothing does."""
    n, seeds, gains = data.tuning.trial.n, data.curves.final.size, tried_gains(data.tuning.trial.n)
    limits = [
        f"Learning curves: {seeds} seeds instead of {CURVE_SEEDS}" * (seeds < CURVE_SEEDS),
        f"Comparison: {len(data.rows)} conditions, all on this arm" * (n > LONG_TRIAL),
        f"Constant gains: {gains} instead of {CONSTANT_GAINS}" * (gains < CONSTANT_GAINS),
    ]
    if not any(limits):
        return []
    return [f"A trial has {n:,} samples. {'. '.join(limit for limit in limits if limit)}."]


# ------------------------------------------------------------ pictures


def _gain_picture(data: TunerNumbers) -> Picture:
    tuning = data.tuning
    plane = stable_regions(data.arm, tuning.constant, tuning.trial.loop.chain)
    guard, K = tuning.training.guard, tuning.training.result.K
    rate = tuning.constant.told(RATE_GAIN, plain)
    return Picture(
        stem="tune-gain",
        title="The tuner's path and its guard on the map",
        caption=(
            "Left: the map of both gains, sand where the continuous loop is stable, blue where the sampled one is, for "
            "constant gains. A gain that moves needs its own proof, and gets it only in the green bar: "
            f"{typeset(guard.sentence)}. Black: the gains that the tuner takes, {significant(float(K.min()), 3)} to "
            f"{significant(float(K.max()), 3)}, at {rate}. Right: the same over time (the "
            f"paper's Figure 3), seed {tuning.plan.seed}; without the tuner {MOMENT_GAIN} = 0."
        ),
        alt=f"Map of {' and '.join(PLANE)} with the tuner's guard from {guard.lo:.3f} to {guard.hi:.3f}, and its gain "
        "over time.",
        figure=draw_gain(tuning, *plane),
        data=Table(
            stem="tune-gain-data",
            title="The tuner's gain",
            columns=(
                Column("t_s", "time", "s", of=tuning.training.result.t),
                Column("K", "gain", of=K),
                Column("x_N_m", "x, as the controller reads it", "N m", of=tuning.training.result.x),
            ),
        ),
    )


def _slew_picture(data: TunerNumbers) -> Picture:
    return Picture(
        stem="tune-slew",
        title="The slew without and with the tuner",
        caption=(
            f"Root moment, tip and motor with ideal converters (the paper's Figures 4 and 6). {_residuals(data, 0)} "
            "The dotted line is the end of the slew; dashed, the rigid arm."
            f"{resolution_words(data.slews.values())}"
        ),
        alt=f"Root moment, tip and motor torque of the slew. {_residuals(data, 0)}",
        figure=slew.figure(data.arm, data.slews, "the slew, ideal converters"),
        data=_signals(data, 0, "tune-slew-data"),
    )


def _coarse_picture(data: TunerNumbers) -> Picture:
    """The slew, and what stands between the controller and the arm in it."""
    chain = next(iter(data.coarse.values())).chain
    c, delay = chain.converters, chain.sampling.delay_samples
    ranges = [
        f"{bits}-bit {name} over ±{plain(span, 3)} N m"
        for name, bits, span in (("ADC", c.moment_bits, c.moment_range), ("DAC", c.torque_bits, c.torque_range))
        if bits is not None and span is not None
    ]
    if c.hub_rate == "difference":
        ranges.append(f"a hub rate differenced from an encoder of {c.encoder_counts} counts")
    ranges.append(f"{how_many(delay, 'sample')} of delay")
    return Picture(
        stem="tune-dsp",
        title="The same with the DSP's effects on",
        caption=(
            f"With {', '.join(ranges)} (the paper's Figures 8 and 9). {_residuals(data, 1)} Nothing regulates the hub "
            f"angle (no {ANGLE_GAIN}), so what it loses to delay and steps it keeps."
            f"{clipped_words(data.coarse)}{resolution_words(data.coarse.values())}"
        ),
        alt=f"The slew with converters and delay. {_residuals(data, 1)}",
        figure=slew.figure(data.arm, data.coarse, f"the slew, converters and {how_many(delay, 'sample')} of delay"),
        data=_signals(data, 1, "tune-dsp-data"),
    )


def _residuals(data: TunerNumbers, which: int) -> str:
    """What is left after the slew, from the table's rows: as trained, or with converters and delay."""
    row = data.rows[(AS_TRAINED, QUANTISED_AND_LATE)[which]]
    return (
        f"Left after the slew: {residual_words(row.without.residual)} without moment feedback, "
        f"{residual_words(row.tuner.residual)} with the tuner, {residual_words(row.best_constant.residual)} "
        "with the best constant gain."
    )


def _signals(data: TunerNumbers, which: int, stem: str) -> Table:
    without, tuned = (data.slews, data.coarse)[which].values()
    return responses_table(stem, "The slew", data.arm, {"without": without, "tuner": tuned})


def _curves_picture(data: TunerNumbers) -> Picture:
    curves = data.curves
    seeds, trials = curves.costs.shape
    first = Column("trial", "trial", of=np.arange(1, trials + 1))
    quantiles = (
        Column(name, name, of=curves.quantile(share))
        for name, share in zip(("lower_quartile", "median", "upper_quartile"), QUARTILES, strict=True)
    )
    own = (Column(f"seed_{seed}", f"seed {seed}", of=costs) for seed, costs in enumerate(curves.costs))
    return Picture(
        stem="tune-curves",
        title="Learning",
        caption=(
            f"Cost of each trial over {how_many(seeds, 'seed')} (the paper's Figure 5): grey each seed, blue the "
            f"median and the middle half; {curves.diverged} diverged, {curves.died} died at {MOMENT_GAIN} = 0. The "
            "gradient is cut to norm 0.5, and a step that raises the cost is taken back and halved."
        ),
        alt=f"Learning curves of {how_many(seeds, 'seed')}, the best constant gain and the bound.",
        figure=draw_curves(curves, data.tuning),
        data=Table(stem="tune-curves-data", title="Learning curves", columns=(first, *quantiles, *own)),
    )


CONTROLLERS = {
    "without": "none",
    "best_constant": "constant",
    "own_constant": "own constant",
    "tuner": "tuner",
    "bound": "bound",
    "ZV": "ZV",
    "EI": "EI",
}


def comparison_table(data: TunerNumbers) -> Table:
    """Cost of a slew, a row a condition, a column a controller, and whether the guard is proven there too."""
    unit, best = data.tuning.plan.scale, significant(data.tuning.best_constant.gain, 3)
    units = f" Costs count moments and torques in units of {plain(unit)} N m, as suits this arm." * (unit != 1.0)
    away_from_it = "; ∞ where the loop ran away" if any(math.isinf(row.tuner.cost) for row in data.rows) else ""
    return Table(
        stem="tune-comparison",
        title="Cost of the slew, beside what it has to beat",
        caption=(
            "Every controller knows the arm by its name plate only: what was trained or chosen as trained is used on "
            f"all others. None: no moment feedback. Constant: the best constant gain as trained, {MOMENT_GAIN} = "
            f"{best}; own constant: the best one for that row, of those that leave its loop stable, steps apart. "
            f"Tuner: that of seed {data.tuning.plan.seed}. Bound: the linear-quadratic optimum. ZV and EI: "
            "input shaping with no moment feedback, judged by their own, later slew, so that the bound is not theirs. "
            "Guard proven: "
            f"whether the same range of gains is proven for that arm and chain too, with the trial's "
            f"{data.tuning.trial.loop.plant.count} modes{away_from_it}.{units}"
        ),
        record=data.rows,
        columns=(
            *_of_each("cost", 4),
            Column("guard_proven", "guard proven", of=lambda row: "yes" if row.proven else "no"),
        ),
    )


def residual_table(data: TunerNumbers) -> Table:
    """What is left of the moment after the slew."""
    return Table(
        stem="tune-residual",
        title="Root moment left after the slew",
        caption=(
            "Root mean square of the arm's own root moment less the rigid arm's, from the end of the slew on, in N m"
            f"{'; – where the loop ran away' if any(row.tuner.residual is None for row in data.rows) else ''}."
        ),
        record=data.rows,
        columns=_of_each("residual", 3),
    )


def _of_each(name: str, digits: int) -> tuple[Column, ...]:
    """The condition, then one number of every controller."""

    def cells(values: Sequence[float | None]) -> list[str]:
        shown = iter(lined(digits, 2)([value for value in values if value is not None]))
        return ["–" if value is None else next(shown) for value in values]

    return (
        Column("condition", "condition", digits=worded(typeset)),
        *(Column(f"{key}_{name}", title, of=f"{key}.{name}", digits=cells) for key, title in CONTROLLERS.items()),
    )
