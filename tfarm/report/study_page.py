"""The page of a study: findings, distributions, drivers, responses, worst arm, and arms without a result."""

from dataclasses import replace
from pathlib import Path

from tfarm.digits import how_many
from tfarm.errors import TfarmError
from tfarm.exact.outputs import signal_words
from tfarm.files import move_into, place_in
from tfarm.plots import studies
from tfarm.plots.style import drawn_for
from tfarm.report.blocks import (
    Fact,
    PageSection,
    Picture,
    anchor,
    explain_commands,
    picture_block,
    prose,
    record_sheet,
    render,
    save_section,
    sheet,
    write_text,
)
from tfarm.schema import Table
from tfarm.studies.study import Study


def write_study(found: Study) -> Path:
    """Write index.html with its pictures and tables to the folder of a study: the page.

    Raises ParameterError where it cannot be written.
    """
    folder = found.parts.folder
    with place_in(folder, "--out") as made:
        with drawn_for("page"):
            saved = [save_section(each, made) for each in study_sections(found)]
        sections = [each for each in saved if each.words or each.blocks]
        title = f"{found.arm}: study of {how_many(found.rows, 'arm')}"
        page = render("study.html", title=title, sections=sections, explained=explain_commands, found=found)
        write_text(made / "index.html", page)
        move_into(made, folder)
    return folder / "index.html"


def study_sections(found: Study) -> list[PageSection]:
    """Return findings, distributions, drivers, responses, worst arm and failures of a study, as far as it has them."""
    of_all = f"of {found.done:,} arms stable"
    facts = [Fact(each.loop, f"{each.stable:,}", of_all, each.finding) for each in found.shares]
    facts.append(Fact("arms computed", f"{found.done:,}", note=f"of {found.rows:,}"))
    distributions: list[Picture | Table] = []
    drivers: list[Picture | Table] = [record_sheet("study_sobol", found.sobol)]
    if found.spreads:
        distributions.append(picture_block("study_distributions", studies.study.figure(found), found=found))
        drivers.insert(0, picture_block("study_scatter", studies.study_scatter.figure(found), found=found))
    responses: list[Picture] = []
    missing: list[str] = []
    for output in ("root_moment", "tip_displacement"):
        try:
            figure = studies.study_band.figure(found, output)
            name, _ = signal_words(output)
            stem = anchor("study", output)
            responses.append(picture_block("study_band", figure, stem=stem, name=name))
        except TfarmError as error:
            missing.append(f"{output}: {error}.")
    numbers = [
        record_sheet("study_ranges", found.spreads),
        sheet("study_numbers", found.varied_numbers, found=found),
    ]
    worst = [] if found.worst is None else [prose("study_worst", worst=found.worst)]
    sections = (
        PageSection(title="Findings", facts=facts, words=[prose("study", found=found)], blocks=numbers),
        PageSection(title="Distributions", blocks=distributions),
        PageSection(title="Drivers", blocks=drivers),
        PageSection(title="Responses", words=missing, blocks=responses),
        PageSection(title="Worst arm", words=worst),
        PageSection(title="Arms without a result", blocks=[record_sheet("study_failures", found.failures)]),
    )
    return [replace(each, anchor=anchor("study", each.title)) for each in sections]
