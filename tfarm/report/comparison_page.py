"""The page of two arms, or of two laws on one arm: verdicts, one picture of both, and the tables with differences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tfarm.comparing import Comparison
from tfarm.comparing.answers import margins_table, modes_table, poles_table, verdict_words
from tfarm.errors import ParameterError
from tfarm.files import temporary_folder
from tfarm.plots.compared import draw_comparison
from tfarm.report.page import render
from tfarm.report.sections import Picture, Section, save_section
from tfarm.report.writing import move_into

APART = "Differences are those of the second from the first, in per cent of the first."
ORDER = "The n-th of both in the order of Im s, which need not be the same mode of the link."
KNOWN = "Exact: of the loop at every frequency. In the band: read up to the verdict's band, no exact value being known."


def write_comparison(found: Comparison, out: Path, *, key: str = "--out") -> Path:
    """Write compare.html with its picture and tables to a folder: the page.  Raises ParameterError where it cannot."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with temporary_folder(out) as made:
            saved = [save_section(section, made) for section in _sections(found)]
            page = render("compare.html", title=_title(found), lead=_lead(found), sections=saved)
            (made / "compare.html").write_text(page, encoding="utf-8", newline="")
            move_into(made, out)
    except OSError as error:
        remedy = f"cannot be written to ({error.strerror or error}); give a folder that can"
        raise ParameterError(key=key, value=str(out), remedy=remedy) from None
    return out / "compare.html"


def _title(found: Comparison) -> str:
    return f"{found.one.name} beside {found.other.name}"


def _lead(found: Comparison) -> str:
    return "Two arms, exact." if found.is_of_arms else f"Two laws on {found.one.arm.name}, exact."


def _sections(found: Comparison) -> Iterator[Section]:
    yield Section(anchor="verdicts", title="Verdicts", words=[verdict_words(side) for side in found.sides])
    yield Section(anchor="both", title="Both in one picture", blocks=(_picture(found),))
    if found.is_of_arms:
        table = replace(
            modes_table(found), stem="compare-modes", title="Natural frequencies and damping", caption=APART
        )
        yield Section(anchor="modes", title="Modes", blocks=(table,))
    poles = replace(poles_table(found), stem="compare-poles", title="Closed-loop poles", caption=f"{ORDER} {APART}")
    yield Section(anchor="poles", title="Closed-loop poles", blocks=(poles,))
    margins = replace(margins_table(found), stem="compare-margins", title="Margins", caption=f"{KNOWN} {APART}")
    yield Section(anchor="margins", title="Margins", blocks=(margins,))


def _picture(found: Comparison) -> Picture:
    curves = "exact response" if found.is_of_arms else "loop function"
    plane = (
        "K1 and K2, with exact edges" if found.regions is not None else "a factor on each law and its delay, on a grid"
    )
    caption = (
        f"The {curves} of both over frequency, and where each loop is stable over {plane}; the points are the laws."
    )
    return Picture(
        stem="comparison", title="Both in one picture", caption=caption, alt=f"{found.verdict}.",
        figure=draw_comparison(found),
    )  # fmt: skip
