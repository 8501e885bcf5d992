"""The page of two arms, or of two laws on one arm: verdicts, one picture of both, and the tables with differences."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tfarm.arm import PLANE
from tfarm.columns import Table
from tfarm.comparing import Comparison
from tfarm.comparing.answers import compared_margins, compared_modes, compared_poles, side_words, unpaired_poles
from tfarm.errors import ParameterError
from tfarm.files import temporary_folder
from tfarm.plots.compared import comparison
from tfarm.report.card import written_cards
from tfarm.report.kept import COMPARISON_KIND, COMPARISON_PAGE, keep
from tfarm.report.page import index_page, render
from tfarm.report.sections import PageSection, Picture, save_section
from tfarm.report.words import typeset, upper
from tfarm.report.writing import TRUST_PAGE, move_into

LEADING_MINUS = re.compile(r"^-(?=\d)")  # a minus sign before a number
LEADING_OMEGA = re.compile(r"^w(?= of )")
NUMBER_WORDS = {"inf": "∞", "-inf": "−∞", "-": "–"}
DIFFERENCE_NOTE = "Differences are those of the second from the first, in per cent of the first, of angles in degrees."
PAIRED_NOTE = "By the mode whose open-loop pole each is nearest to."
UNPAIRED_NOTE = "Of a mode that has no oscillating pole on the other side, or of none."
IN_Z_NOTE = "One of the laws is a law in z: both loops are compared at their samples, each pole z as s = ln(z)/T."
AT_SAMPLES_NOTE = "Of the exact loop at its samples, with as many modes as its verdict takes."
KNOWN_NOTE = (
    "Exact: of the loop at every frequency. In the band: read up to the verdict's band, no exact value being known."
)


def write_comparison(found: Comparison, out: Path) -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot.

    It leads to the index and to the arms' own pages, as far as they are in the folder.  An index of reports that is
    there leads to it from then on, and pages of its arms that are made later.
    """
    title, arms = f"{found.one.name} beside {found.other.name}", list(dict.fromkeys(s.arm.name for s in found.sides))
    lead = "Two arms, exact." if found.is_of_arms else f"Two laws on {found.one.arm.name}, exact."
    try:
        out.mkdir(parents=True, exist_ok=True)
        with temporary_folder(out) as made:
            saved = [save_section(section, made) for section in _sections(found)]
            others = [("index.html", "all arms"), *((f"{name}/index.html", name) for name in arms)]
            pages = [(file, name) for file, name in others if (out / file).is_file()]
            page = render(COMPARISON_PAGE, title=title, lead=lead, sections=saved, pages=pages)
            (made / COMPARISON_PAGE).write_text(page, encoding="utf-8", newline="")
            keep(made, COMPARISON_KIND, {"title": title, "arms": arms})
            if (out / "index.html").is_file():
                trust = TRUST_PAGE if (out / TRUST_PAGE).is_file() else ""
                index = index_page(written_cards(out), trust=trust, compared=title)
                (made / "index.html").write_text(index, encoding="utf-8", newline="")
            move_into(made, out)
    except OSError as error:
        remedy = f"cannot be written to ({error.strerror or error}); give a folder that can"
        raise ParameterError(key="--out", value=str(out), remedy=remedy) from None
    return out / COMPARISON_PAGE


def _sections(found: Comparison) -> Iterator[PageSection]:
    words = [*(f"{typeset(side_words(side))}." for side in found.sides), *[IN_Z_NOTE] * found.is_sampled]
    yield PageSection(anchor="verdicts", title="Verdicts", words=words)
    curves = "exact response" if found.is_of_arms else "loop function"
    plane = f"{' and '.join(PLANE)}, with exact edges"
    if found.is_sampled:
        plane = "further delay and a factor on its law, with exact edges"
    elif found.regions is None:
        plane = "a factor on each law and its delay, on a grid"
    picture = Picture(
        stem="comparison", title=f"{upper(curves)} and stable region", alt=f"{found.verdict}.",
        caption=f"The {curves} of both over frequency, and where each loop is stable over {plane}; the points are the "
        "laws.",
        figure=comparison.figure(found),
    )  # fmt: skip
    yield PageSection(anchor="both", title="Both in one picture", blocks=(picture,))
    if found.is_of_arms:
        modes = _set(compared_modes(found), "modes", "Natural frequencies and damping", DIFFERENCE_NOTE)
        yield PageSection(anchor="modes", title="Modes", blocks=(modes,))
    poles = [_set(compared_poles(found), "poles", "Those that oscillate", f"{PAIRED_NOTE} {DIFFERENCE_NOTE}")]
    if len(apart := unpaired_poles(found)):
        poles.append(_set(apart, "unpaired-poles", "Poles of one side alone", UNPAIRED_NOTE))
    yield PageSection(anchor="poles", title="Closed-loop poles", blocks=tuple(poles))
    known = AT_SAMPLES_NOTE if found.is_sampled else KNOWN_NOTE
    margins = _set(compared_margins(found), "margins", "How far from unstable", f"{known} {DIFFERENCE_NOTE}")
    yield PageSection(anchor="margins", title="Margins", blocks=(margins,))


def _set(table: Table, of: str, title: str, caption: str) -> Table:
    """The table as pages show such: powers of ten, minus signs, infinity, and w in Greek."""
    columns = []
    for each in table.columns:
        cells = [NUMBER_WORDS.get(cell) or LEADING_MINUS.sub("−", typeset(cell)) for cell in each.cells]
        columns.append(replace(each, title=LEADING_OMEGA.sub("ω", each.title), shown=cells))
    return replace(table, stem=f"compare-{of}", title=title, caption=caption, columns=tuple(columns), record=None)
