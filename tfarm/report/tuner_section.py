"""The gain tuner on an arm's page: costs against baselines, what it learns, and where it is proven."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, Arm
from tfarm.columns import Column, Table
from tfarm.digits import how_many, lined, plain, significant
from tfarm.dsp import Chain, Simulation
from tfarm.dsp.results import ideal_chain
from tfarm.dsp.traces import away, resolved
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots.motion import draw_curves, draw_gain, slew
from tfarm.plots.regions import stable_regions
from tfarm.records import record
from tfarm.report.cases import Case, has_loop, what_holds, why_no_loop
from tfarm.report.sampled_section import chain_words, piece_of_bands, responses_table
from tfarm.report.sections import Fact, PageSection, Picture, prose
from tfarm.schema import Quantity, table
from tfarm.spectrum.table import first_frequency
from tfarm.tuner import LearningCurves, Plan, Tuning, compare_controllers, learning_curves, tried_loops, tune
from tfarm.tuner.baselines import CONSTANT_GAINS, Outcomes, quantised_chain, tried_gains
from tfarm.tuner.training import QUARTILES
from tfarm.tuner.tuning import SlewEnd, usual_plan

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
CURVE_SEEDS = 20  # of the learning curves
CURVE_SAMPLES = 80_000_000  # that their trials may have together, some 35 s of one core
LONG_TRIAL = 16_000  # samples: the comparison of a longer one is of the arm itself alone
LONGEST_TRIAL = 70_000  # samples: a page has no longer one
QUANTISED_AND_LATE = 3  # row of the comparison, which begins with those of the arm itself
SERVO_SPEED = 1 / 20  # of the first frequency: the servo's angle loop is so slow that it leaves the mode alone
SERVO_TURN = 0.03  # rad a sample, where that is slower
ON_TARGET = 1e-10  # of the tip's travel: no slew ends nearer its target than rounding
SAME_COST = 1e-4  # relative difference of two costs below which they are called the same
TUNER_TITLE = "The gain tuner against baselines"
CONTROLLERS = {
    "without": "none", "best_constant": "constant", "own_constant": "own constant", "tuner": "tuner", "bound": "bound",
    "ZV": "ZV", "EI": "EI",
}  # fmt: skip


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
    """Number of seeds of the learning curves, for trainings of that length."""
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
    """The median cost of the tuner over its seeds, compared with the best constant gain."""
    final, best, median = data.curves.final, data.tuning.best_constant.cost, data.curves.final_quantile(0.5)
    gain = 100 * (1 - median / best)
    return prose("tuner_in_short", gain=gain, same=100 * SAME_COST, median=median, best=best, seeds=final.size,
                 below=int((final < best).sum()))  # fmt: skip


def off_target(data: TunerNumbers, error: float) -> str:
    """How far from its target the tip ends [mm]; 0 where rounding is all there is of it."""
    travel = data.arm.reach * float(abs(data.constant.scenario.hub_angle).max())
    return significant(1e3 * abs(error) * (abs(error) > ON_TARGET * travel), 2)


class Cost(NamedTuple):
    """The cost of the slew under one controller."""

    controller: Annotated[str, Quantity("controller")]
    cost: Annotated[float, Quantity("cost", digits=4)]


def servo_table(data: TunerNumbers, servo: Tuning) -> Table:
    """The costs of the slew with the angle regulated too."""
    law, error = servo.plan.servo, SlewEnd.of(servo).tip_error
    rows = [
        Cost("no moment feedback", servo.without.cost),
        Cost("best constant gain", servo.best_constant.cost),
        Cost("tuner", servo.training.result.cost),
        *itertools.starmap(Cost, servo.shaped_costs.items()),
        Cost("bound", servo.bound.cost),
    ]
    gains = ", ".join(law.gain_text(name, partial(significant, digits=3), data.arm) for name in (ANGLE_GAIN, RATE_GAIN))
    caption = prose("tuner_servo", gains=gains, guard=servo.training.guard, moment=MOMENT_GAIN,
                    error=None if error is None else off_target(data, error))  # fmt: skip
    return table(rows, stem="tune-servo", title="Cost of the slew with the angle regulated", caption=caption)


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """The costs, from no moment feedback to the bound."""
    tuning, final, guard = data.tuning, data.curves.final, data.tuning.training.guard
    low, median, high = (data.curves.final_quantile(share) for share in QUARTILES)
    gain = 100 * (1 - median / tuning.best_constant.cost)
    tuned, constant = (
        off_target(data, float(away(data.arm, run)[-1])) for run in (data.slews["with the tuner"], data.constant)
    )
    late = tuning.shaped_delays
    shaped = [f"{kind} {significant(cost, 2)}, {significant(1e3 * late[kind], 3)} ms later"
              for kind, cost in tuning.shaped_costs.items() if late[kind]]  # fmt: skip
    certainty = "certified stable" if guard.is_proven else f"certified for the first {guard.modes_used} modes"
    return (
        Fact(label="tuner against the best constant gain", note=f"median of {final.size} seeds",
             value=f"{significant(gain, 2)} % less cost" if gain > 100 * SAME_COST else "no improvement"),
        Fact(label="cost without moment feedback", value=significant(tuning.without.cost, 4)),
        Fact(label="best constant gain", value=significant(tuning.best_constant.cost, 4),
             note=f"{MOMENT_GAIN} = {significant(tuning.best_constant.gain, 3)}"),
        Fact(label="tuner", value=significant(median, 4),
             note=f"half between {significant(low, 4)} and {significant(high, 4)}"),
        Fact(label="bound", value=significant(tuning.bound.cost, 4), note="linear-quadratic optimum"),
        Fact(label="input shaping", value=significant(min(tuning.shaped_costs.values()), 3),
             note="; ".join(shaped) or "no mode slow enough to shape"),
        Fact(label="tip error at the end", value=tuned, unit="mm", note=f"constant gain: {constant} mm"),
        Fact(label="guard", value=f"{guard.lo:.3f} … {guard.hi:.3f}", note=f"any K(t) in it: {certainty}"),
    )  # fmt: skip


def tuner_section(case: Case) -> PageSection:
    """The tuner with the paper's figures on a damped arm and its own chain; one sentence for any other."""
    reason = why_not(case.arm, case.chain)
    if not reason:
        try:
            data = tuner_numbers(case.arm, case.chain)
            if math.isfinite(data.tuning.without.cost):
                return section_of(data)
            reason = prose("tuner_unstable", rate=RATE_GAIN)
        except CertificationError as error:
            reason = prose("tuner_unproven", error=error)
    return PageSection(anchor="tune", title=TUNER_TITLE, words=(reason,))


def section_of(data: TunerNumbers) -> PageSection:
    """The section on numbers that were computed already."""
    guard, n = data.tuning.training.guard.sentence, data.tuning.trial.n
    words = [tuner_in_short(data), prose("tuner", rate=RATE_GAIN, angle=ANGLE_GAIN, guard=guard)]
    if limits := limits_of(data):
        words.append(f"A trial has {n:,} samples. {'. '.join(limits)}.")
    tables = [comparison_table(data), residual_table(data)]
    if data.servo is not None:
        tables.append(servo_table(data, data.servo))
    pictures = _gain_picture(data), _slew_picture(data), _coarse_picture(data)
    blocks: list[Picture | Table] = [*pictures, *tables, _curves_picture(data)]
    return PageSection(anchor="tune", title=TUNER_TITLE, facts=tuner_facts(data), words=words, blocks=blocks)


def why_not(arm: Arm, chain: Chain) -> str:
    """The sentence for an arm or a chain on which no tuner is trained; empty of any other."""
    if not has_loop(arm):
        return why_no_loop(arm)
    if not arm.has_rigid_mode:
        return f"{what_holds(arm)}: it makes no slew, and there is nothing for the tuner to learn from."
    if arm.has_elastic_link:
        return prose("tuner_undamped", arm=arm)
    samples = trial_samples(arm, chain)
    return "" if samples <= LONGEST_TRIAL else prose("tuner_too_long", samples=samples, period=chain.sampling.period)


def limits_of(data: TunerNumbers) -> list[str]:
    """The extent of learning curves and comparison that long trials limit, none where nothing does."""
    n, seeds, gains = data.tuning.trial.n, data.curves.final.size, tried_gains(data.tuning.trial.n)
    limits = {
        f"Learning curves: {seeds} seeds instead of {CURVE_SEEDS}": seeds < CURVE_SEEDS,
        f"Comparison: {len(data.rows)} conditions, all on this arm": n > LONG_TRIAL,
        f"Constant gains: {gains} instead of {CONSTANT_GAINS}": gains < CONSTANT_GAINS,
    }
    return [words for words, is_limit in limits.items() if is_limit]


# ------------------------------------------------------------ pictures


def _gain_picture(data: TunerNumbers) -> Picture:
    tuning = data.tuning
    plane = stable_regions(data.arm, tuning.constant, tuning.trial.loop.chain)
    result = tuning.training.result
    columns = (
        Column("t_s", "time", "s", of=result.t),
        Column("K", "gain", of=result.K),
        Column("x_N_m", "x, as the controller reads it", "N m", of=result.x),
    )
    return Picture(
        stem="tune-gain",
        title="The tuner's path and its guard on the map",
        caption=prose("tuner_gain", guard=tuning.training.guard, low=float(result.K.min()), high=float(result.K.max()),
                      rate=tuning.constant.gain_text(RATE_GAIN, plain), moment=MOMENT_GAIN, seed=tuning.plan.seed),
        alt=f"Map of {' and '.join(PLANE)} with the tuner's guard, and its gain over time.",
        figure=draw_gain(tuning, *plane),
        data=Table(stem="tune-gain-data", title="The tuner's gain", columns=columns),
    )  # fmt: skip


def _slew_picture(data: TunerNumbers) -> Picture:
    return Picture(
        stem="tune-slew",
        title="The slew without and with the tuner",
        caption=prose("tuner_slew", piece=piece_of_bands(data.slews)),
        alt="Root moment, tip and motor torque of the slew, without and with the tuner.",
        figure=slew.figure(data.arm, data.slews, "the slew, ideal converters"),
        data=_signals(data.slews, data.arm, "tune-slew-data"),
    )


def _coarse_picture(data: TunerNumbers) -> Picture:
    """The slew with the converters and the delay of its chain."""
    chain = chain_words(data.arm, next(iter(data.coarse.values())).chain)
    return Picture(
        stem="tune-dsp",
        title="The same with the DSP's effects on",
        caption=prose("tuner_dsp", chain=chain, angle=ANGLE_GAIN, runs=data.coarse, piece=piece_of_bands(data.coarse)),
        alt="Root moment, tip and motor torque of the slew with converters and delay, without and with the tuner.",
        figure=slew.figure(data.arm, data.coarse, "the slew, with converters and delay"),
        data=_signals(data.coarse, data.arm, "tune-dsp-data"),
    )


def _signals(runs: Mapping[str, Simulation], arm: Arm, stem: str) -> Table:
    return responses_table(stem, "The slew", arm, dict(zip(("without", "tuner"), runs.values(), strict=True)))


def _curves_picture(data: TunerNumbers) -> Picture:
    curves = data.curves
    seeds, trials = curves.costs.shape
    columns = [Column("trial", "trial", of=np.arange(1, trials + 1))]
    for name, share in zip(("lower_quartile", "median", "upper_quartile"), QUARTILES, strict=True):
        columns.append(Column(name, name, of=curves.quantile(share)))
    columns += [Column(f"seed_{seed}", f"seed {seed}", of=costs) for seed, costs in enumerate(curves.costs)]
    return Picture(
        stem="tune-curves",
        title="Learning",
        caption=prose("tuner_curves", seeds=seeds, curves=curves, moment=MOMENT_GAIN),
        alt=f"Learning curves of {how_many(seeds, 'seed')}, the best constant gain and the bound.",
        figure=draw_curves(curves, data.tuning),
        data=Table(stem="tune-curves-data", title="Learning curves", columns=tuple(columns)),
    )


def comparison_table(data: TunerNumbers) -> Table:
    """Cost of a slew, a row a condition, a column a controller, and whether the guard is proven there too."""
    caption = prose("tuner_comparison", data=data, moment=MOMENT_GAIN)
    proven = Column("guard_proven", "guard proven", of=["yes" if row.proven else "no" for row in data.rows])
    columns, title = (*_of_each(data.rows, "cost", 4), proven), "Cost of the slew, compared with baselines"
    return Table(stem="tune-comparison", title=title, caption=caption, columns=columns)


def residual_table(data: TunerNumbers) -> Table:
    """The root moment after the slew."""
    caption = prose("tuner_residual", is_unstable=any(row.tuner.residual is None for row in data.rows))
    title, columns = "Root moment left after the slew", _of_each(data.rows, "residual", 3)
    return Table(stem="tune-residual", title=title, caption=caption, columns=columns)


def _of_each(rows: Sequence[Outcomes], name: str, digits: int) -> tuple[Column, ...]:
    """The condition, then one number of every controller."""

    def cells(values: Sequence[float | None]) -> list[str]:
        shown = iter(lined(digits, 2)([value for value in values if value is not None]))
        return ["–" if value is None else next(shown) for value in values]

    columns = [Column("condition", "condition", of=[row.condition for row in rows])]
    for key, title in CONTROLLERS.items():
        values = [getattr(getattr(row, key), name) for row in rows]
        columns.append(Column(f"{key}_{name}", title, of=values, digits=cells))
    return tuple(columns)
