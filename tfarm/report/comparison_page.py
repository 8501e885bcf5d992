"""The page of two arms, or of two laws on one arm: verdicts, one picture of both, and the tables with differences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from tfarm.arm import PLANE
from tfarm.columns import Table
from tfarm.comparing import Comparison
from tfarm.comparing.answers import margins_table, modes_table, poles_table, verdict_words
from tfarm.errors import ParameterError
from tfarm.files import temporary_folder
from tfarm.plots.compared import draw_comparison
from tfarm.report.card import written_cards
from tfarm.report.kept import COMPARED, COMPARISON, keep
from tfarm.report.page import index_page, render
from tfarm.report.sections import Picture, Section, save_section
from tfarm.report.words import typeset, upper
from tfarm.report.writing import TRUST, move_into

LEADING = re.compile(r"^-(?=\d)")  # a minus sign before a number
FREQUENCY = re.compile(r"^w(?= of )")
NUMBERS = {"inf": "∞", "-inf": "−∞", "-": "–"}
APART = "Differences are those of the second from the first, in per cent of the first."
ORDER = "The n-th of both in the order of Im s, which need not be the same mode of the link."
IN_Z = "One of the laws is a law in z: both loops are compared at their samples, each pole z as s = ln(z)/T."
AT_SAMPLES = "Of the exact loop at its samples, with as many modes as its verdict takes."
KNOWN = "Exact: of the loop at every frequency. In the band: read up to the verdict's band, no exact value being known."


def write_comparison(found: Comparison, out: Path, *, key: str = "--out") -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot.

    An index of reports that is there leads to it from then on, and pages of its arms that are made later.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with temporary_folder(out) as made:
            saved = [save_section(section, made) for section in _sections(found)]
            arms = list(dict.fromkeys(side.arm.name for side in found.sides))
            page = render(COMPARISON, title=_title(found), lead=_lead(found), sections=saved, pages=_beside(out, arms))
            (made / COMPARISON).write_text(page, encoding="utf-8", newline="")
            keep(made, COMPARED, {"title": _title(found), "arms": arms})
            if (out / "index.html").is_file():
                trust = TRUST if (out / TRUST).is_file() else ""
                index = index_page(written_cards(out), trust=trust, compared=_title(found))
                (made / "index.html").write_text(index, encoding="utf-8", newline="")
            move_into(made, out)
    except OSError as error:
        remedy = f"cannot be written to ({error.strerror or error}); give a folder that can"
        raise ParameterError(key=key, value=str(out), remedy=remedy) from None
    return out / COMPARISON


def _beside(out: Path, arms: Sequence[str]) -> list[tuple[str, str]]:
    """(file, title) of the index and of the arms' own pages, as far as they are in the folder."""
    pages = [("index.html", "all arms"), *((f"{name}/index.html", name) for name in arms)]
    return [(file, title) for file, title in pages if (out / file).is_file()]


def _title(found: Comparison) -> str:
    return f"{found.one.name} beside {found.other.name}"


def _lead(found: Comparison) -> str:
    return "Two arms, exact." if found.is_of_arms else f"Two laws on {found.one.arm.name}, exact."


def _sections(found: Comparison) -> Iterator[Section]:
    words = [*(f"{typeset(verdict_words(side))}." for side in found.sides), *[IN_Z] * found.is_clocked]
    yield Section(anchor="verdicts", title="Verdicts", words=words)
    yield Section(anchor="both", title="Both in one picture", blocks=(_picture(found),))
    if found.is_of_arms:
        table = replace(
            _set(modes_table(found)), stem="compare-modes", title="Natural frequencies and damping", caption=APART
        )
        yield Section(anchor="modes", title="Modes", blocks=(table,))
    poles = replace(
        _set(poles_table(found)), stem="compare-poles", title="Those that oscillate", caption=f"{ORDER} {APART}"
    )
    known = AT_SAMPLES if found.is_clocked else KNOWN
    yield Section(anchor="poles", title="Closed-loop poles", blocks=(poles,))
    margins = replace(
        _set(margins_table(found)), stem="compare-margins", title="How far from unstable", caption=f"{known} {APART}"
    )
    yield Section(anchor="margins", title="Margins", blocks=(margins,))


def _set(table: Table) -> Table:
    """The table as pages show such: powers of ten, minus signs, infinity, and w in Greek."""
    columns = [
        replace(
            each, title=FREQUENCY.sub("ω", each.title), shown=[NUMBERS.get(cell, _number(cell)) for cell in each.cells]
        )
        for each in table.columns
    ]
    return replace(table, columns=tuple(columns), record=None)


def _number(cell: str) -> str:
    return LEADING.sub("−", typeset(cell))


def _picture(found: Comparison) -> Picture:
    curves = "exact response" if found.is_of_arms else "loop function"
    plane = (
        "further delay and a factor on its law, with exact edges"
        if found.is_clocked
        else f"{' and '.join(PLANE)}, with exact edges"
        if found.regions is not None
        else "a factor on each law and its delay, on a grid"
    )
    caption = (
        f"The {curves} of both over frequency, and where each loop is stable over {plane}; the points are the laws."
    )
    return Picture(
        stem="comparison", title=f"{upper(curves)} and stable region", caption=caption, alt=f"{found.verdict}.",
        figure=draw_comparison(found),
    )  # fmt: skip
