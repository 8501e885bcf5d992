"""The gain tuner on an arm's page: costs against baselines, what it learns, and where it is proven."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import how_many, lined, plain, significant, singly, worded
from tfarm.dsp import Chain, Simulation
from tfarm.dsp.results import ideal_chain
from tfarm.dsp.traces import away, resolved
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots.motion import draw_curves, draw_gain, slew
from tfarm.plots.regions import stable_regions
from tfarm.records import record
from tfarm.report.cases import has_loop, what_holds, why_no_loop
from tfarm.report.motion import clipped_words, resolution_words, responses_table
from tfarm.report.sampled_section import chain_words
from tfarm.report.sections import Fact, PageSection, Picture, typeset
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
QUANTISED_AND_LATE = 3  # row of the comparison, which begins with those of the arm itself
SERVO_SPEED = 1 / 20  # of the first frequency: the servo's angle loop is so slow that it leaves the mode alone
SERVO_TURN = 0.03  # rad a sample, where that is slower
ON_TARGET = 1e-10  # of the tip's travel: no slew ends nearer its target than rounding tells
SAME_COST = 1e-4  # relative difference of two costs below which they are called the same
TUNER_TITLE = "The gain tuner against baselines"
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
DRIFT_WORDS = (
    "The cost does not see the angle at the end. The law regulates the hub rate alone, and the torque of the moment "
    f"feedback adds up to an angle of its integral over {RATE_GAIN}. A tuner for use needs {ANGLE_GAIN} (tfarm tune "
    f"--{ANGLE_GAIN})."
)
SHAPING_WORDS = (
    "Input shaping: the reference shaped, no moment feedback, judged by its own slew. It cannot answer disturbances, "
    "which feedback can."
)
BOUND_WORDS = (
    "Bound: the linear-quadratic optimum that knows the whole state and the slew beforehand. The tuner's gain stays in "
    "{guard}."
)
SERVO_CAPTION = (
    "{gains}. The slew with the tuner: {end}. Guard: "
    f"{MOMENT_GAIN} from {{low}} to {{high}}, {{proven}} for any K(t)."
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


def tuner_in_short(data: TunerNumbers) -> str:
    """The median cost of the tuner over its seeds, against the best constant gain."""
    final, best, median = data.curves.final, data.tuning.best_constant.cost, data.curves.final_quantile(0.5)
    gain, below = 100 * (1 - median / best), int((final < best).sum())
    lead = "Yes" if gain >= 15 else "A little" if gain > 100 * SAME_COST else "No"
    side = (
        "the cost of"
        if abs(gain) <= 100 * SAME_COST
        else f"{significant(abs(gain), 2)} % {'below' if gain > 0 else 'above'}"
    )
    return (
        f"{lead}. The median cost over {final.size} seeds is {significant(median, 3)}, {side} the best constant gain "
        f"({significant(best, 3)}); {below} of {final.size} seeds end below that."
    )


def off_target(data: TunerNumbers, error: float) -> str:
    """How far from its target the tip ends [mm]; 0 where rounding is all there is of it."""
    travel = data.arm.reach * float(abs(data.constant.scenario.hub_angle).max())
    return significant(1e3 * abs(error) * (abs(error) > ON_TARGET * travel), 2)


def servo_table(data: TunerNumbers, held: Tuning) -> Table:
    """The costs of the slew with the angle held too."""
    guard, law, error = held.training.guard, held.plan.servo, tip_errors(held)["tip_error_m"]
    costs = {
        "no moment feedback": held.without.cost,
        "best constant gain": held.best_constant.cost,
        "tuner": held.training.result.cost,
        **held.shaped_costs,
        "bound": held.bound.cost,
    }
    caption = SERVO_CAPTION.format(
        gains=", ".join(law.gain_text(name, lambda x: significant(x, 3), data.arm) for name in (ANGLE_GAIN, RATE_GAIN)),
        end="unstable" if error is None else f"tip {off_target(data, error)} mm off its target at the end",
        low=significant(guard.lo, 3), high=significant(guard.hi, 3),
        proven="proven" if guard.is_proven else "of the first modes alone,",
    )  # fmt: skip
    return Table(
        stem="tune-servo",
        title="Cost of the slew with the angle held",
        caption=caption,
        columns=(
            Column("controller", "controller", of=list(costs)),
            Column("cost", "cost", of=list(costs.values()), digits=singly(significant, 4)),
        ),
    )


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """The costs, from nothing to what is possible."""
    tuning, final, guard = data.tuning, data.curves.final, data.tuning.training.guard
    low, median, high = (data.curves.final_quantile(share) for share in QUARTILES)
    gain = 100 * (1 - median / tuning.best_constant.cost)
    tuned, constant = (
        off_target(data, float(away(data.arm, run)[-1])) for run in (data.slews["with the tuner"], data.constant)
    )
    late = tuning.shaped_delays
    shaped = [f"{kind} {significant(cost, 2)}, {significant(1e3 * late[kind], 3)} ms later"
              for kind, cost in tuning.shaped_costs.items() if late[kind]]  # fmt: skip
    held = "proven stable" if guard.is_proven else f"proven for the first {guard.modes_used} modes"
    return (
        Fact(label="does tuning beat a constant gain?", beside=f"median of {final.size} seeds",
             value=f"by {significant(gain, 2)} %" if gain > 100 * SAME_COST else "no"),
        Fact(label="cost without moment feedback", value=significant(tuning.without.cost, 4)),
        Fact(label="best constant gain", value=significant(tuning.best_constant.cost, 4),
             beside=f"{MOMENT_GAIN} = {significant(tuning.best_constant.gain, 3)}"),
        Fact(label="tuner", value=significant(median, 4),
             beside=f"half between {significant(low, 4)} and {significant(high, 4)}"),
        Fact(label="bound", value=significant(tuning.bound.cost, 4), beside="linear-quadratic optimum"),
        Fact(label="input shaping", value=significant(min(tuning.shaped_costs.values()), 3),
             beside="; ".join(shaped) or "no mode slow enough to shape"),
        Fact(label="tip off its target at the end", value=tuned, unit="mm", beside=f"constant gain: {constant} mm"),
        Fact(label="guard", value=f"{guard.lo:.3f} … {guard.hi:.3f}", beside=f"any K(t) in it: {held}"),
    )  # fmt: skip


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
            DRIFT_WORDS,
            SHAPING_WORDS,
            BOUND_WORDS.format(guard=typeset(data.tuning.training.guard.sentence)),
            *fewer_words(data),
        ),
        blocks=(
            _gain_picture(data),
            _slew_picture(data),
            _coarse_picture(data),
            comparison_table(data),
            residual_table(data),
            *([] if data.servo is None else [servo_table(data, data.servo)]),
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
    rate = tuning.constant.gain_text(RATE_GAIN, plain)
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
            f"Root moment, tip and motor with ideal converters (the paper's Figures 4 and 6). "
            "The dotted line is the end of the slew; dashed, the rigid arm."
            f"{resolution_words(data.slews.values())}"
        ),
        alt="Root moment, tip and motor torque of the slew, without and with the tuner.",
        figure=slew.figure(data.arm, data.slews, "the slew, ideal converters"),
        data=_signals(data.slews, data.arm, "tune-slew-data"),
    )


def _coarse_picture(data: TunerNumbers) -> Picture:
    """The slew, and what stands between the controller and the arm in it."""
    chain = next(iter(data.coarse.values())).chain
    return Picture(
        stem="tune-dsp",
        title="The same with the DSP's effects on",
        caption=(
            f"{chain_words(data.arm, chain)} (The paper's Figures 8 and 9.) Nothing regulates the hub angle (no "
            f"{ANGLE_GAIN}), so what it loses to delay and steps it keeps."
            f"{clipped_words(data.coarse)}{resolution_words(data.coarse.values())}"
        ),
        alt="Root moment, tip and motor torque of the slew with converters and delay, without and with the tuner.",
        figure=slew.figure(data.arm, data.coarse, "the slew, with converters and delay"),
        data=_signals(data.coarse, data.arm, "tune-dsp-data"),
    )


def _signals(runs: Mapping[str, Simulation], arm: Arm, stem: str) -> Table:
    return responses_table(stem, "The slew", arm, dict(zip(("without", "tuner"), runs.values(), strict=True)))


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
        title="Cost of the slew, compared with baselines",
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
