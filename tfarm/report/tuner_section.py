"""The gain tuner on an arm's page: costs against baselines, what it learns, and where it is proven."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, NamedTuple

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.digits import lined, plain, significant
from tfarm.dsp import Chain, Simulation, results, scenarios, traces
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.plots import motion, regions
from tfarm.records import record
from tfarm.report.page import Case, Fact, PageSection, Picture, has_loop, picture, prose, sheet
from tfarm.report.sampled_section import chain_words, piece_of_bands, response_columns
from tfarm.schema import Column, Quantity, Table, table
from tfarm.spectrum.table import first_frequency
from tfarm.tuner import LearningCurves, Plan, Tuning, compare_controllers, learning_curves, tried_loops, tune
from tfarm.tuner.baselines import CONSTANT_GAINS, Outcomes, quantised_chain, tried_gains
from tfarm.tuner.trial import usual_rate_gain
from tfarm.tuner.tuning import SlewEnd, usual_plan

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
CURVE_SEEDS = 20  # of the learning curves
CURVE_SAMPLES = 80_000_000  # that their trials may have together, some 35 s of one core
LONG_TRIAL = 16_000  # samples: the comparison of a longer one is of the arm itself alone
LONGEST_TRIAL = 70_000  # samples: a page has no longer one
QUANTISED_AND_LATE = 3  # row of the comparison, which begins with those of the arm itself
SAME_COST = 1e-4  # relative difference of two costs below which they are called the same
CONTROLLERS = {
    "without": "none", "best_constant": "constant", "own_constant": "own constant", "tuner": "tuner", "bound": "bound",
    "ZV": "ZV", "EI": "EI",
}  # fmt: skip
TITLE = "The gain tuner against baselines"


def tuner_section(case: Case) -> PageSection:
    """The tuner with the paper's figures on a damped arm and its own chain; one sentence for any other."""
    answer = why_not(case.arm, case.chain)
    try:
        if not answer:
            data = tuner_numbers(case.arm, case.chain)
            if math.isfinite(data.tuning.without.cost):
                return section_of(data)
            answer = prose("tuner_unstable")
    except CertificationError as error:
        answer = prose("tuner_unproven", error=error)
    return PageSection(title=TITLE, answer=answer)


def why_not(arm: Arm, chain: Chain) -> str:
    """The sentence for an arm or a chain on which no tuner is trained; empty of any other."""
    period = chain.sampling.period
    samples = 1 + round(scenarios.TRIAL_SLEWS * chain.slew.rise_time / period)  # of each trial
    return prose("no_tuner", arm=arm, has_loop=has_loop(arm), samples=samples, most=LONGEST_TRIAL, period=period)


# ------------------------------------------------------------ numbers


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
    tuning = tune(arm, plan, results.ideal_chain(chain))
    trial, ideal, guard = tuning.trial, tuning.trial.loop.chain, tuning.training.guard
    conditions = QUANTISED_AND_LATE + 1 if trial.n > LONG_TRIAL else None
    listed = tried_loops(arm, ideal, quantised_chain(arm, chain))[:conditions]
    return TunerNumbers(
        arm=arm,
        tuning=tuning,
        slews=_simulated(tuning, ideal),
        constant=trial.simulator(chain=ideal).linear(tuning.constant),
        coarse=_simulated(tuning, listed[QUANTISED_AND_LATE].chain),
        curves=learning_curves(tuning, curve_seeds(plan.trials * trial.n)),
        rows=tuple(compare_controllers(trial, tuning.gain(), guard, listed, tuning.best_constant.gain)),
        servo=_servo_tuning(arm, plan, ideal),
    )


def curve_seeds(samples: int) -> int:
    """Number of seeds of the learning curves, for trainings of that length."""
    return min(CURVE_SEEDS, max(1, CURVE_SAMPLES // samples))


def _servo_tuning(arm: Arm, plan: Plan, chain: Chain) -> Tuning | None:
    """The same tuning with an angle loop a twentieth as fast as the first mode, or slower at a long period."""
    speed = min(first_frequency(arm) / 20, 0.03 / chain.sampling.period)  # it leaves the mode alone; rad a sample
    Kp = float(f"{arm.turned_inertia * speed**2:.2g}")
    try:
        return tune(arm, replace(plan, Kp=Kp, K1=usual_rate_gain(arm, Kp)), chain)
    except (CertificationError, ConvergenceError):
        return None


def _simulated(tuning: Tuning, chain: Chain) -> dict[str, Simulation]:
    without, tuned = traces.resolved(
        tuning.trial.simulator(chain=chain),
        tuning.trial.arm,
        lambda each: each.linear(tuning.gain().servo),
        lambda each: tuning.gain().run(each),
    )
    return {WITHOUT: without, "with the tuner": tuned}


# ------------------------------------------------------------ the section


def section_of(data: TunerNumbers) -> PageSection:
    """The section on numbers that were computed already."""
    n = data.tuning.trial.n
    limits = prose("tuner_limits", data=data, usual_seeds=CURVE_SEEDS, long=LONG_TRIAL, usual_gains=CONSTANT_GAINS,
                   gains=tried_gains(n))  # fmt: skip
    words = [prose("tuner", guard=data.tuning.training.guard.sentence), *filter(None, [limits])]
    servo = [] if data.servo is None else [servo_table(data, data.servo)]
    blocks = [_gain_picture(data), *slew_pictures(data), *cost_tables(data), *servo, _curves_picture(data)]
    answer, facts = tuner_in_short(data), tuner_facts(data)
    return PageSection(title=TITLE, answer=answer, facts=facts, words=words, blocks=blocks)


def saved_cost(data: TunerNumbers) -> float:
    """How much the median cost of the tuner is below that of the best constant gain [%]."""
    return 100 * (1 - data.curves.final_quartiles[1] / data.tuning.best_constant.cost)


def tuner_in_short(data: TunerNumbers) -> str:
    """The median cost of the tuner over its seeds, compared with the best constant gain."""
    return prose("tuner_in_short", gain=saved_cost(data), same=100 * SAME_COST, median=data.curves.final_quartiles[1],
                 best=data.tuning.best_constant.cost, final=data.curves.final)  # fmt: skip


def off_target(data: TunerNumbers, error: float) -> str:
    """How far from its target the tip ends [mm]; 0 where rounding is all there is of it."""
    travel = data.arm.reach * float(abs(data.constant.scenario.hub_angle).max())
    return significant(1e3 * abs(error) * (abs(error) > 1e-10 * travel), 2)


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """The costs, from no moment feedback to the bound."""
    tuning, seeds, guard = data.tuning, data.curves.seeds, data.tuning.training.guard
    low, median, high = (significant(cost, 4) for cost in data.curves.final_quartiles)
    ends = [
        off_target(data, float(traces.away(data.arm, run)[-1])) for run in (data.slews["with the tuner"], data.constant)
    ]
    shaped = [f"{kind} {significant(each.cost, 2)}, {significant(1e3 * each.later, 3)} ms later"
              for kind, each in tuning.shaped.items() if each.later]  # fmt: skip
    certainty = "certified stable" if guard.is_proven else f"certified for the first {guard.modes_used} modes"
    saved = saved_cost(data)
    less = f"{significant(saved, 2)} % less cost" if saved > 100 * SAME_COST else "no improvement"
    return (
        Fact("tuner against the best constant gain", less, note=f"median of {seeds} seeds"),
        Fact("cost without moment feedback", significant(tuning.without.cost, 4)),
        Fact("best constant gain", significant(tuning.best_constant.cost, 4),
             note=f"{MOMENT_GAIN} = {significant(tuning.best_constant.gain, 3)}"),
        Fact("tuner", median, note=f"half between {low} and {high}"),
        Fact("bound", significant(tuning.bound.cost, 4), note="linear-quadratic optimum"),
        Fact("input shaping", significant(min(each.cost for each in tuning.shaped.values()), 3),
             note="; ".join(shaped) or "no mode slow enough to shape"),
        Fact("tip error at the end", ends[0], "mm", f"constant gain: {ends[1]} mm"),
        Fact("guard", f"{guard.lo:.3f} … {guard.hi:.3f}", note=f"any K(t) in it: {certainty}"),
    )  # fmt: skip


# ------------------------------------------------------------ tables


class Cost(NamedTuple):
    """The cost of the slew under one controller."""

    controller: Annotated[str, Quantity("controller", help="what sets the moment gain")]
    cost: Annotated[float, Quantity("cost", digits=4, help="cost of the slew, the integral that the tuner minimises")]


def servo_table(data: TunerNumbers, servo: Tuning) -> Table:
    """The costs of the slew with the angle regulated too."""
    law, error = servo.gain().servo, SlewEnd.of(servo).tip_error
    rows = [
        Cost("no moment feedback", servo.without.cost),
        Cost("best constant gain", servo.best_constant.cost),
        Cost("tuner", servo.training.result.cost),
        *(Cost(kind, each.cost) for kind, each in servo.shaped.items()),
        Cost("bound", servo.bound.cost),
    ]
    gains = ", ".join(law.gain_text(name, partial(significant, digits=3), data.arm) for name in (ANGLE_GAIN, RATE_GAIN))
    left = None if error is None else off_target(data, error)
    return sheet("tune_servo", table(rows), gains=gains, guard=servo.training.guard, error=left)


def cost_tables(data: TunerNumbers) -> list[Table]:
    """Cost of a slew and root moment after it: a row a condition, a column a controller, and where the guard holds."""
    proven = Column("guard_proven", "guard proven", of=["yes" if row.proven else "no" for row in data.rows])
    is_unstable = any(row.tuner.residual is None for row in data.rows)
    return [
        sheet("tune_comparison", (*_of_each(data.rows, "cost", 4), proven), data=data),
        sheet("tune_residual", _of_each(data.rows, "residual", 3), is_unstable=is_unstable),
    ]


def _of_each(rows: Sequence[Outcomes], name: str, digits: int) -> tuple[Column, ...]:
    """The condition, then one number of every controller."""

    def cells(values: Sequence[float | None]) -> list[str]:
        shown = iter(lined(digits, 2)([value for value in values if value is not None]))
        return ["–" if value is None else next(shown) for value in values]

    return (
        Column("condition", "condition", of=[row.condition for row in rows]),
        *(Column(f"{key}_{name}", title, of=[getattr(getattr(row, key), name) for row in rows], digits=cells)
          for key, title in CONTROLLERS.items()),
    )  # fmt: skip


# ------------------------------------------------------------ pictures


def _gain_picture(data: TunerNumbers) -> Picture:
    tuning, result = data.tuning, data.tuning.training.result
    plane = regions.stable_regions(data.arm, tuning.constant, tuning.trial.loop.chain)
    columns = Column("t_s", of=result.t), Column("K", of=result.K), Column("x_N_m", of=result.x)
    gain = tuning.constant.gain_text(RATE_GAIN, plain)
    return picture("tune_gain", motion.draw_gain.figure(tuning, *plane), data=columns, tuning=tuning, gain=gain)


def slew_pictures(data: TunerNumbers) -> Iterator[Picture]:
    """The slew without and with the tuner: through ideal converters, then with those and the delay of its chain."""
    chain = chain_words(data.arm, data.coarse[WITHOUT].chain)
    for kind, runs, how in (
        ("tune_slew", data.slews, "ideal converters"), ("tune_dsp", data.coarse, "with converters and delay"),
    ):  # fmt: skip
        figure = motion.slew.figure(data.arm, runs, f"the slew, {how}")
        columns = response_columns(data.arm, dict(zip(("without", "tuner"), runs.values(), strict=True)))
        yield picture(kind, figure, data=columns, runs=runs, piece=piece_of_bands(runs), how=how, chain=chain)


def _curves_picture(data: TunerNumbers) -> Picture:
    curves = data.curves
    columns = (
        Column("trial", of=range(1, curves.costs.shape[1] + 1)),
        *(Column(name, of=costs) for name, costs in curves.quartile_curves.items()),
        *(Column(f"seed_{seed}", of=costs) for seed, costs in enumerate(curves.costs)),
    )
    return picture("tune_curves", motion.draw_curves.figure(curves, data.tuning), data=columns, curves=curves)
