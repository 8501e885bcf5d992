"""The gain tuner on an arm's page: costs against baselines, what it learns, and where it is proven."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import how_many, lined, plain, significant, worded
from tfarm.dsp import Chain, Simulation
from tfarm.dsp.results import ideal_chain
from tfarm.dsp.traces import away, resolved
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots.motion import draw_curves, draw_gain, slew
from tfarm.plots.regions import stable_regions
from tfarm.records import record
from tfarm.report.cases import has_loop, what_holds, why_no_loop
from tfarm.report.motion import clipped_words, resolution_words, responses_table
from tfarm.report.sections import Fact, PageSection, Picture, residual_words, typeset
from tfarm.spectrum.table import first_frequency
from tfarm.tuner import LearningCurves, Plan, Tuning, compare_controllers, learning_curves, tried_loops, tune
from tfarm.tuner.baselines import CONSTANT_GAINS, Outcomes, quantised_chain, tried_gains
from tfarm.tuner.training import QUARTILES
from tfarm.tuner.tuning import tip_errors, usual_plan

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
CURVE_SEEDS = 20  # of the learning curves
CURVE_SAMPLES = 80_000_000  # that their trials may have together, some 35 s of one core
LONG_TRIAL = 16_000  # samples: the comparison of a longer one is of the arm itself alone
LONGEST_TRIAL = 70_000  # samples: a page has no longer one
AS_TRAINED, QUANTISED_AND_LATE = 0, 3  # rows of the comparison, which begins with those of the arm itself
SERVO_SPEED = 1 / 20  # of the first frequency: the servo's angle loop is so slow that it leaves the mode alone
SERVO_TURN = 0.03  # rad a sample, where that is slower
SERVO_GAINS = (ANGLE_GAIN, RATE_GAIN)
ON_TARGET = 1e-10  # of the tip's travel: no slew ends nearer its target than rounding tells
MUCH_MORE = 3.0  # times as far off its target is more, and no coincidence
SAME_COST = 1e-4  # relative difference of two costs below which they are called the same
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


@dataclass(frozen=True)
@record
class TunerNumbers:
    """One tuning and what is compared with it.

    `slews` and `coarse` hold two simulations each, without and with the tuner; `constant` is the slew with the best
    constant gain; `servo` the tuning with the angle held, None where no range of gains is proven there.
    """

    arm: Arm
    tuning: Tuning
    slews: Mapping[str, Simulation]
    constant: Simulation
    coarse: Mapping[str, Simulation]
    curves: LearningCurves
    rows: tuple[Outcomes, ...]
    servo: Tuning | None


def tuner_numbers(arm: Arm, chain: Chain) -> TunerNumbers:
    """Train with the paper's figures, through the arm's own chain with its converters ideal, and measure.

    Raises ParameterError for an arm without a loop or a slew, CertificationError where no range of gains is proven.
    """
    plan = usual_plan(arm, chain)
    tuning = tune(arm, plan, ideal_chain(chain))
    ideal = tuning.trial.loop.chain
    conditions = QUANTISED_AND_LATE + 1 if tuning.trial.n > LONG_TRIAL else None
    listed = tried_loops(arm, ideal, quantised_chain(arm, chain))[:conditions]
    rows = compare_controllers(tuning.trial, tuning.gain(), tuning.training.guard, listed, tuning.best_constant.gain)
    return TunerNumbers(
        arm=arm,
        tuning=tuning,
        slews=_simulated(tuning, ideal),
        constant=tuning.trial.simulator(chain=ideal).linear(tuning.constant),
        coarse=_simulated(tuning, listed[QUANTISED_AND_LATE].chain),
        curves=learning_curves(tuning, curve_seeds(plan.trials * tuning.trial.n)),
        rows=tuple(rows),
        servo=_servo_tuning(arm, plan, ideal),
    )


def curve_seeds(samples: int) -> int:
    """Number of seeds of the learning curves, for trainings of so many samples."""
    return min(CURVE_SEEDS, max(1, CURVE_SAMPLES // samples))


def trial_samples(arm: Arm, chain: Chain) -> int:
    """Number of samples of each trial."""
    return 1 + round(usual_plan(arm, chain).duration / chain.sampling.period)


def _servo_tuning(arm: Arm, plan: Plan, chain: Chain) -> Tuning | None:
    """The same tuning with an angle loop a twentieth as fast as the first mode, or slower at a long period."""
    speed = min(SERVO_SPEED * first_frequency(arm), SERVO_TURN / chain.sampling.period)
    on_angle = float(f"{arm.turned_inertia * speed**2:.2g}")
    try:
        return tune(arm, plan.holding(arm, on_angle), chain)
    except (CertificationError, ConvergenceError):
        return None


def _simulated(tuning: Tuning, chain: Chain) -> dict[str, Simulation]:
    without, tuned = resolved(
        tuning.trial.simulator(chain=chain),
        tuning.trial.arm,
        lambda each: each.linear(tuning.gain().servo),
        lambda each: tuning.gain().run(each),
    )
    return {WITHOUT: without, "with the tuner": tuned}


# ------------------------------------------------------------ in words


def tuner_in_short(data: TunerNumbers) -> str:
    """How much the tuner gains over the best constant gain, and what that does by itself."""
    tuning, final, median = data.tuning, data.curves.final, data.curves.final_quantile(0.5)
    constant, best, without = tuning.best_constant.gain, tuning.best_constant.cost, tuning.without.cost
    below = int((final < best).sum())
    gain = 100 * (1 - median / best)
    lead = "A little" if 100 * SAME_COST < gain < 15 else "Yes" if gain >= 15 else "No"
    by_itself, again = f"No constant {MOMENT_GAIN} takes anything off the cost of a slew", ""
    costs = f"{significant(without, 3)} without it"
    if best < (1 - SAME_COST) * without:
        off, again = significant(100 * (1 - best / without), 2), "another "
        by_itself = (
            f"A constant {MOMENT_GAIN} of {significant(constant, 3)} already takes {off} % off the cost of a slew"
        )
        costs = f"{significant(without, 3)} without moment feedback, {significant(best, 3)} with it"
    verb = {"below": f"lowers it by {again}", "above": "raises it by "}.get(_side(median, best), "")
    moves = f"{verb}{significant(abs(gain), 2)} %, to" if verb else "leaves it as it is, at"
    return (
        f"{lead}. {by_itself} ({costs}); a gain that tunes itself {moves} "
        f"{significant(median, 3)} in the median of {final.size} seeds. {below} of {final.size} seeds end below the "
        "best constant gain."
    )


def _side(cost: float, yardstick: float) -> str:
    """Whether a cost is below or above another one, or the same."""
    if abs(cost - yardstick) <= SAME_COST * yardstick:
        return "the same"
    return "below" if cost < yardstick else "above"


def drift_words(data: TunerNumbers) -> str:
    """What the cost does not see: the angle that a moving gain leaves, as nothing regulates it."""
    tuned, constant = off_target(data)
    more = "a gain that moves leaves more of it than a constant one" if tuned > MUCH_MORE * constant else ""
    less = "here a gain that moves leaves no more of it than a constant one" if tuned <= constant else ""
    what = more or less or "here a gain that moves leaves about as much of it as a constant one"
    return (
        f"What the cost does not see: the arm ends off its target, the tip {significant(1e3 * tuned, 2)} mm with the "
        f"tuner and {significant(1e3 * constant, 2)} mm with the best constant gain. The law regulates the hub rate "
        f"alone, and the moment feedback's torque adds up to an angle of its integral over {RATE_GAIN}: {what}. A "
        f"tuner for use needs {ANGLE_GAIN} (tfarm tune --{ANGLE_GAIN})."
    )


def servo_words(data: TunerNumbers) -> str:
    """The same with the angle held: where the slew ends then, and what the tuner is worth beside its yardsticks."""
    if data.servo is None:
        return ""
    tuning, guard = data.servo, data.servo.training.guard
    law = tuning.plan.servo
    gains = " and ".join(law.told(name, lambda gain: significant(gain, 3), data.arm) for name in SERVO_GAINS)
    off = tip_errors(tuning)["tip_error_m"]
    end = "runs away" if off is None else f"ends {significant(1e3 * abs(off), 2)} mm off its target"
    if off is not None and abs(off) < ON_TARGET * data.arm.reach * float(abs(tuning.trial.task.hub_angle).max()):
        end = "ends on its target"
    proven = "proven" if guard.is_proven else "of the first modes alone"
    costs = {
        "no moment feedback": tuning.without.cost,
        "the best constant gain": tuning.best_constant.cost,
        "the tuner": tuning.training.result.cost,
        **{f"the shaper {kind}": cost for kind, cost in tuning.shaped_costs.items()},
        "the bound": tuning.bound.cost,
    }
    told = ", ".join(f"{name} {significant(cost, 3)}" for name, cost in costs.items())
    return (
        f"With the angle held, {gains}, the tuned slew {end}. The guard there is {MOMENT_GAIN} from "
        f"{significant(guard.lo, 3)} to {significant(guard.hi, 3)}, {proven} for any K(t). Costs of that slew: {told}."
    )


def off_target(data: TunerNumbers) -> tuple[float, float]:
    """How far off the tip ends [m], with the tuner and with the best constant gain."""
    runs = data.slews["with the tuner"], data.constant
    travel = data.arm.reach * float(abs(data.constant.scenario.hub_angle).max())
    tuned, constant = (abs(float(away(data.arm, each)[-1])) for each in runs)
    return tuned * (tuned > ON_TARGET * travel), constant * (constant > ON_TARGET * travel)


def shaping_words(data: TunerNumbers) -> str:
    """What input shaping does instead."""
    tuning, median = data.tuning, data.curves.final_quantile(0.5)
    costs, late = tuning.shaped_costs, tuning.shaped_delays
    if not any(late.values()):
        return (
            "Input shaping, which one would try first, has nothing to do here: no mode of the loop lies below half the "
            "sample rate, and a shaper would be shorter than a sample."
        )
    told = " and ".join(
        f"{kind} has {significant(costs[kind], 2)}, arriving {significant(1e3 * late[kind], 3)} ms later"
        for kind in costs
    )
    rival = min(median, tuning.best_constant.cost)
    verdicts = {"below": "is cheaper", "above": "is dearer here", "the same": "costs the same"}
    verdict = verdicts[_side(min(costs.values()), rival)]
    return (
        f"What one would try first {verdict}: shaping the reference, with no moment feedback at all, {told} (each "
        "judged by its own slew). Shaping cannot answer disturbances, which feedback can."
    )


def bound_words(data: TunerNumbers) -> str:
    """How far everything is from what is possible, and what is proven."""
    bound, guard = data.tuning.bound.cost, data.tuning.training.guard
    return (
        f"No controller of this slew gets below {significant(bound, 3)}, the linear-quadratic optimum that knows the "
        f"whole state and the slew beforehand. The tuner's gain stays in {typeset(guard.sentence)}."
    )


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """The costs, from nothing to what is possible."""
    tuning, final = data.tuning, data.curves.final
    low, median, high = (data.curves.final_quantile(share) for share in QUARTILES)
    gain = 100 * (1 - median / tuning.best_constant.cost)
    guard = tuning.training.guard
    off, off_constant = (significant(1e3 * x, 2) for x in off_target(data))
    helps = f"by {significant(gain, 2)} %" if gain > 100 * SAME_COST else "no"
    held = "proven stable" if guard.is_proven else f"proven for the first {guard.modes_used} modes"
    half = f"half between {significant(low, 4)} and {significant(high, 4)}"
    shaped = min((cost, kind) for kind, cost in tuning.shaped_costs.items())
    how = f"{shaped[1]}, a later slew" if any(tuning.shaped_delays.values()) else "no mode slow enough to shape"
    K = f"{MOMENT_GAIN} = {significant(tuning.best_constant.gain, 3)}"
    return (
        Fact(label="does tuning beat a constant gain?", value=helps, beside=f"median of {final.size} seeds"),
        Fact(label="cost without moment feedback", value=significant(tuning.without.cost, 4)),
        Fact(label="best constant gain", value=significant(tuning.best_constant.cost, 4), beside=K),
        Fact(label="tuner", value=significant(median, 4), beside=half),
        Fact(label="nothing is below", value=significant(tuning.bound.cost, 4), beside="linear-quadratic optimum"),
        Fact(label="input shaping instead", value=significant(shaped[0], 3), beside=how),
        Fact(label="tip off its target at the end", value=off, unit="mm", beside=f"constant gain: {off_constant} mm"),
        Fact(label="guard", value=f"{guard.lo:.3f} … {guard.hi:.3f}", beside=f"any K(t) in it: {held}"),
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
