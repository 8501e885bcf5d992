"""The gain tuner on an arm's page: costs against baselines, what it learns, and where it is proven."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.digits import plain, significant
from tfarm.dsp import Chain, Simulation, results, scenarios, traces
from tfarm.errors import CertificationError
from tfarm.loop.regions import stable_regions
from tfarm.plots import motion
from tfarm.records import record
from tfarm.report.page import ArmReport, Fact, PageSection, Picture, has_loop, picture, prose, sheet
from tfarm.report.sampled_section import chain_words, piece_of_bands, response_columns
from tfarm.schema import Column, Table, table
from tfarm.studies.cases import learning_curves
from tfarm.tuner import LearningCurves, Tuning, compare_controllers, tried_loops, tune
from tfarm.tuner.baselines import Outcomes, quantised_chain
from tfarm.tuner.tuning import usual_plan

WITHOUT = f"without moment feedback, {MOMENT_GAIN} = 0"
CURVE_SEEDS = 20  # of the learning curves
CURVE_SAMPLES = 80_000_000  # that their trials may have together, some 35 s of one core
LONG_TRIAL = 16_000  # samples: the comparison of a longer one is of the arm itself alone
LONGEST_TRIAL = 70_000  # samples: a page has no longer one
QUANTISED_AND_LATE = 3  # row of the comparison, which begins with those of the arm itself
SAME_COST = 1e-4  # relative difference of two costs below which they are called the same
TITLE = "The gain tuner against baselines"


def tuner_section(report: ArmReport) -> PageSection:
    """The tuner with the paper's figures on a damped arm and its own chain; one sentence for any other."""
    answer = why_not(report.arm, report.chain)
    try:
        if not answer:
            data = tuner_numbers(report.arm, report.chain)
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

    `slews` and `coarse` hold two simulations each, without and with the tuner.
    """

    arm: Arm
    tuning: Tuning
    slews: Mapping[str, Simulation]
    coarse: Mapping[str, Simulation]
    curves: LearningCurves
    rows: tuple[Outcomes, ...]


def tuner_numbers(arm: Arm, chain: Chain) -> TunerNumbers:
    """Train with the paper's figures, through the arm's own chain with its converters ideal, and measure.

    Raises ParameterError for an arm without a loop or a slew, CertificationError where no range of gains is proven.
    """
    plan = usual_plan(arm, chain)
    own = results.ideal_chain(chain)
    tuning = tune(arm, plan, own)
    trial, ideal, guard = tuning.trial, tuning.trial.loop.chain, tuning.training.guard
    conditions = QUANTISED_AND_LATE + 1 if trial.n > LONG_TRIAL else None
    listed = tried_loops(arm, ideal, quantised_chain(arm, chain))[:conditions]
    return TunerNumbers(
        arm=arm,
        tuning=tuning,
        slews=_simulated(tuning, ideal),
        coarse=_simulated(tuning, listed[QUANTISED_AND_LATE].chain),
        curves=learning_curves(arm, plan, own, curve_seeds(plan.trials * trial.n)),
        rows=tuple(compare_controllers(trial, tuning.gain(), guard, listed, tuning.best_constant.gain)),
    )


def curve_seeds(samples: int) -> int:
    """Number of seeds of the learning curves, for trainings of that length."""
    return min(CURVE_SEEDS, max(1, CURVE_SAMPLES // samples))


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
    return PageSection(
        title=TITLE,
        answer=tuner_in_short(data),
        facts=tuner_facts(data),
        words=[prose("tuner", guard=data.tuning.training.guard.sentence)],
        blocks=list(blocks_of(data)),
    )


def saved_cost(data: TunerNumbers) -> float:
    """How much the median cost of the tuner is below that of the best constant gain [%]."""
    return 100 * (1 - data.curves.final_quartiles[1] / data.tuning.best_constant.cost)


def tuner_in_short(data: TunerNumbers) -> str:
    """The median cost of the tuner over its seeds, compared with the best constant gain."""
    return prose("tuner_in_short", gain=saved_cost(data), same=100 * SAME_COST, median=data.curves.final_quartiles[1],
                 best=data.tuning.best_constant.cost, final=data.curves.final)  # fmt: skip


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """The costs, from no moment feedback to the bound, and where the tuner leaves the tip."""
    tuning, saved = data.tuning, saved_cost(data)
    low, median, high = (significant(cost, 4) for cost in data.curves.final_quartiles)
    left = float(traces.away(data.arm, data.slews["with the tuner"])[-1])
    less = f"{significant(saved, 2)} % less cost" if saved > 100 * SAME_COST else "no improvement"
    return (
        Fact("tuner against the best constant gain", less, note=f"median of {data.curves.seeds} seeds"),
        Fact("cost without moment feedback", significant(tuning.without.cost, 4)),
        Fact("best constant gain", significant(tuning.best_constant.cost, 4),
             note=f"{MOMENT_GAIN} = {significant(tuning.best_constant.gain, 3)}"),
        Fact("tuner", median, note=f"half between {low} and {high}"),
        Fact("bound", significant(tuning.bound.cost, 4), note="linear-quadratic optimum"),
        Fact("tip error at the end", significant(1e3 * abs(left), 2), "mm"),
    )  # fmt: skip


# ------------------------------------------------------------ pictures


def blocks_of(data: TunerNumbers) -> Iterator[Picture | Table]:
    """The gain, slews without and with the tuner, the costs, and the learning curves.

    The slews are through ideal converters, then with those and the delay of the arm's own chain.
    """
    tuning, result, curves = data.tuning, data.tuning.training.result, data.curves
    plane = stable_regions(data.arm, tuning.constant, tuning.trial.loop.chain)
    columns = Column("t_s", of=result.t), Column("K", of=result.K), Column("x_N_m", of=result.x)
    gain = tuning.constant.gain_text(RATE_GAIN, plain)
    yield picture("tune_gain", motion.draw_gain.figure(tuning, *plane), data=columns, tuning=tuning, gain=gain)
    chain = chain_words(data.arm, data.coarse[WITHOUT].chain)
    for kind, runs, how in (
        ("tune_slew", data.slews, "ideal converters"), ("tune_dsp", data.coarse, "with converters and delay"),
    ):  # fmt: skip
        figure = motion.slew.figure(data.arm, runs, f"the slew, {how}")
        slews = response_columns(data.arm, dict(zip(("without", "tuner"), runs.values(), strict=True)))
        yield picture(kind, figure, data=slews, runs=runs, piece=piece_of_bands(runs), how=how, chain=chain)
    yield sheet("tune_comparison", table(data.rows), data=data)
    learned = (
        Column("trial", of=range(1, curves.costs.shape[1] + 1)),
        *(Column(name, of=costs) for name, costs in curves.quartile_curves.items()),
        *(Column(f"seed_{seed}", of=costs) for seed, costs in enumerate(curves.costs)),
    )
    yield picture("tune_curves", motion.draw_curves.figure(curves, tuning), data=learned, curves=curves)
