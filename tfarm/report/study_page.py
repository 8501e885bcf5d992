"""The page of a study."""

from dataclasses import replace
from pathlib import Path

from tfarm.digits import how_many
from tfarm.errors import TfarmError, one_line
from tfarm.exact.outputs import signal_words
from tfarm.files import move_into, place_in
from tfarm.plots import studies
from tfarm.plots.style import drawn_for
from tfarm.report.page import (
    Fact,
    PageSection,
    Picture,
    anchor,
    explained,
    picture,
    prose,
    render,
    save_section,
    sheet,
    write_text,
)
from tfarm.schema import Column, Table, table, text
from tfarm.studies.study import Study


def write_study(found: Study) -> Path:
    """Write index.html with its pictures and tables to the folder of a study: the page.

    Raises ParameterError where it cannot be written.
    """
    folder = found.parts.folder
    with place_in(folder, "--out") as made:
        with drawn_for("page"):
            sections = [save_section(each, made) for each in study_sections(found)]
        title = f"{found.arm}: study of {how_many(found.rows, 'arm')}"
        page = render("study.html", title=title, sections=sections, explained=explained, found=found)
        write_text(made / "index.html", page)
        move_into(made, folder)
    return folder / "index.html"


def study_sections(found: Study) -> list[PageSection]:
    """Return findings, distributions, drivers, responses, worst arm and failures of a study, as far as it has them."""
    facts = [
        *(Fact(each.loop, f"{each.stable:,}", f"of {found.done:,} arms stable", each.finding) for each in found.shares),
        Fact("arms computed", f"{found.done:,}", note=f"of {found.rows:,}"),
    ]
    numbers = [sheet("study_ranges", table(found.spreads)), sheet("study_numbers", _numbers(found), found=found)]
    distributions: list[Picture | Table] = []
    drivers: list[Picture | Table] = []
    if found.spreads:
        distributions.append(picture("study_distributions", studies.study.figure(found), found=found))
        drivers.append(picture("study_scatter", studies.study_scatter.figure(found), found=found))
    drivers.append(sheet("study_sobol", table(found.sobol)))
    missing: list[str] = []
    bands: list[Picture] = []
    for output in ("root_moment", "tip_displacement"):
        try:
            figure = studies.study_band.figure(found, output)
            stem = f"study-{output.replace('_', '-')}"
            bands.append(picture("study_band", figure, stem=stem, name=signal_words(output)[0]))
        except TfarmError as error:
            missing.append(f"{output}: {error}.")
    worst = [] if found.worst is None else [prose("study_worst", worst=found.worst)]
    sections = (
        PageSection(title="Findings", facts=facts, words=[prose("study", found=found)], blocks=numbers),
        PageSection(title="Distributions", blocks=distributions),
        PageSection(title="Drivers", blocks=drivers),
        PageSection(title="Responses", words=missing, blocks=bands),
        PageSection(title="Worst arm", words=worst),
        PageSection(title="Arms without a result", blocks=[sheet("study_failures", table(found.failures))]),
    )
    shown = [each for each in sections if each.words or any(getattr(block, "columns", True) for block in each.blocks)]
    return [replace(each, anchor=anchor("study", each.title)) for each in shown]


def _numbers(found: Study) -> list[Column]:
    """A row a varied number: its distribution or grid, and its value of the worst arm where that was searched."""
    space = found.parts.plan.space
    worst = [] if found.worst is None else list(found.worst.numbers.values())
    kinds = {key: one_line(f"{each.kind} {', '.join(map(text, each.numbers))}", 60) for key, each in space.over.items()}
    columns = [
        Column("key", "number", of=space.keys),
        Column("distribution", "distribution", of=[kinds.get(key, "list or posterior") for key in space.keys]),
    ]
    return columns + [Column("worst", "worst arm", of=worst, shown=list(map(text, worst)))] * bool(worst)
