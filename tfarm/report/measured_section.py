"""Runs measured under the controllers of a page: what was measured, what is known of the arm, and the predictions."""

from collections.abc import Iterator, Sequence

from tfarm.fitting.prediction import Prediction
from tfarm.plots import motion
from tfarm.report.blocks import Fact, PageSection, Picture, picture_block, prose, record_sheet, sheet
from tfarm.report.page import ArmReport, PageCase
from tfarm.schema import Column, Table, table, text


def measured_runs_section(report: ArmReport) -> PageSection:
    """Return the measured runs, the verdict on each loop, and the predictions with bands and null models."""
    found = [(each, run) for each in report.cases if (run := each.prediction) is not None]
    answers = []
    words = [prose("run_method")]
    facts: list[Fact] = []
    for each, run in found:
        answers.append(prose("run_answer", each=each, found=run, verdict=each.sampled.verdict))
        words.append(prose("run_words", each=each, found=run))
        facts += run_facts(each, run, len(found) > 1)
    return PageSection(
        title="Measured, certified, predicted",
        answer=" ".join(answers),
        facts=facts,
        words=words,
        blocks=list(run_blocks(found)),
    )


def run_facts(each: PageCase, found: Prediction, is_named: bool) -> Iterator[Fact]:
    """Yield the rms of each signal, and the best null model with its own."""
    for name in found.run.names:
        nulls = {
            origin: rms for origin in found.null_models if (rms := found.rms_of(origin, name)) is not None
        }
        best = min(nulls, key=lambda origin: nulls[origin])
        row = next(row for row in found.rows if row.signal == name)
        label = f"rms of {name}, measured less predicted{f', {each.name}' * is_named}"
        note = f"best null model: {best}, {text(nulls[best], 3)}"
        yield Fact(label, text(found.rms_of("predicted", name), 3), row.unit, note)


def run_blocks(found: Sequence[tuple[PageCase, Prediction]]) -> Iterator[Picture | Table]:
    """Yield the curves of all runs, then of each its figures, residuals and causes."""
    named = {each.name: it for each, it in found}
    columns = [column for each, it in found for column in run_columns(each.key, it)]
    yield picture_block("measured_runs", motion.draw_measured_runs.figure(named), data=columns, found=named)
    for each, it in found:
        stem = each.key.replace("_", "-")
        yield sheet("measured_run", table(it.rows), stem=f"measured-{stem}", name=each.name)
        yield record_sheet(
            "measured_residuals", it.residuals, stem=f"measured-residuals-{stem}", name=each.name
        )
        if it.causes:
            yield record_sheet(
                "measured_causes", it.causes, stem=f"measured-causes-{stem}", name=each.name, found=it
            )


def run_columns(key: str, found: Prediction) -> Iterator[Column]:
    """Yield the curves of one run: a row a sample."""
    for column in found.csv_table.columns:
        unit = column.unit.replace(" ", "_").replace("^", "")
        yield Column(f"{column.key}_{key}_{unit}", unit=column.unit, of=column.of)
