"""The gain tuner on an arm's page: costs against baselines, what it learns, and where it is proven."""

import math
from collections.abc import Iterator

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.assessment.stability_map import stable_regions
from tfarm.case import Case
from tfarm.digits import plain, significant
from tfarm.dsp import Chain, scenarios, traces
from tfarm.errors import CertificationError
from tfarm.plots import motion
from tfarm.report.page import ArmReport, Fact, PageSection, Picture, has_loop, picture, prose, sheet
from tfarm.report.sampled_section import chain_words, piece_of_bands, response_columns
from tfarm.schema import Column, Table, table
from tfarm.studies.candidates import WITHOUT, TunerNumbers, tuner_numbers

SAME_COST = 1e-4  # relative difference of two costs below which they are called the same
TITLE = "The gain tuner against baselines"


def tuner_section(report: ArmReport) -> PageSection:
    """Return the tuner with the paper's figures on a damped arm and its own chain; one sentence for any other."""
    answer = why_not(report.arm, report.chain)
    if not answer:
        try:
            data = tuner_numbers(report.arm, report.chain)
            if math.isfinite(data.tuning.without.cost):
                return section_of(data)
            answer = prose("tuner_unstable")
        except CertificationError as error:
            answer = prose("tuner_unproven", error=error)
    return PageSection(title=TITLE, answer=answer)


def why_not(arm: Arm, chain: Chain, longest: int = 70_000) -> str:
    """Return the sentence for an arm or a chain on which no tuner is trained; empty of any other.

    No trial on a page is of more samples than the `longest`.
    """
    period = chain.sampling.period
    samples = 1 + round(scenarios.TRIAL_SLEWS * chain.slew.rise_time / period)
    return prose("no_tuner", arm=arm, has_loop=has_loop(arm), samples=samples, most=longest, period=period)


def section_of(data: TunerNumbers) -> PageSection:
    """Return the section on numbers that were computed already."""
    return PageSection(
        title=TITLE,
        answer=tuner_in_short(data),
        facts=tuner_facts(data),
        words=[prose("tuner", guard=data.tuning.training.guard.sentence)],
        blocks=list(blocks_of(data)),
    )


def saved_cost(data: TunerNumbers) -> float:
    """Return by how much the median cost of the tuner is below that of the best constant gain [%]."""
    return 100 * (1 - data.curves.final_quartiles[1] / data.tuning.best_constant.cost)


def tuner_in_short(data: TunerNumbers) -> str:
    """Compare the median cost of the tuner over its seeds with the best constant gain."""
    curves = data.curves
    return prose(
        "tuner_in_short",
        gain=saved_cost(data),
        same=100 * SAME_COST,
        median=curves.final_quartiles[1],
        best=data.tuning.best_constant.cost,
        final=curves.final,
    )


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """Return the costs, from no moment feedback to the bound, and where the tuner leaves the tip."""
    tuning = data.tuning
    best = tuning.best_constant
    saved = saved_cost(data)
    low, median, high = (significant(cost, 4) for cost in data.curves.final_quartiles)
    left = float(traces.away(data.arm, data.slews["with the tuner"])[-1])
    less = f"{significant(saved, 2)} % less cost" if saved > 100 * SAME_COST else "no improvement"
    return (
        Fact("tuner against the best constant gain", less, note=f"median of {data.curves.seeds} seeds"),
        Fact("cost without moment feedback", significant(tuning.without.cost, 4)),
        Fact("best constant gain", significant(best.cost, 4), note=f"{MOMENT_GAIN} = {significant(best.gain, 3)}"),
        Fact("tuner", median, note=f"half between {low} and {high}"),
        Fact("bound", significant(tuning.bound.cost, 4), note="linear-quadratic optimum"),
        Fact("tip error at the end", significant(1e3 * abs(left), 2), "mm"),
    )


def blocks_of(data: TunerNumbers) -> Iterator[Picture | Table]:
    """Yield the gain, slews without and with the tuner, the costs, and the learning curves.

    The slews are through ideal converters, then with those and the delay of the arm's own chain.
    """
    tuning = data.tuning
    result = tuning.training.result
    regions = stable_regions(Case(data.arm, tuning.constant, tuning.trial.loop.chain))
    columns = Column("t_s", of=result.t), Column("K", of=result.K), Column("x_N_m", of=result.x)
    gain = tuning.constant.gain_text(RATE_GAIN, plain)
    yield picture("tune_gain", motion.draw_gain.figure(tuning, *regions), data=columns, tuning=tuning, gain=gain)
    chain = chain_words(data.arm, data.coarse[WITHOUT].chain)
    for kind, runs, how in (
        ("tune_slew", data.slews, "ideal converters"),
        ("tune_dsp", data.coarse, "with converters and delay"),
    ):
        figure = motion.slew.figure(data.arm, runs, f"the slew, {how}")
        slews = response_columns(data.arm, dict(zip(("without", "tuner"), runs.values(), strict=True)))
        yield picture(kind, figure, data=slews, runs=runs, piece=piece_of_bands(runs), how=how, chain=chain)
    yield sheet("tune_comparison", table(data.rows), data=data)
    curves = data.curves
    learned = [Column("trial", of=range(1, curves.costs.shape[1] + 1))]
    learned += [Column(name, of=costs) for name, costs in curves.quartile_curves.items()]
    learned += [Column(f"seed_{seed}", of=costs) for seed, costs in enumerate(curves.costs)]
    yield picture("tune_curves", motion.draw_curves.figure(curves, tuning), data=learned, curves=curves)
