"""The first page of an arm, and its row in the table of arms: result card, pictures in their order, first modes."""

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup

from tfarm.case.card import GRADED, UNDEFINED, LoopCard, ResultCard, result_card
from tfarm.errors import TfarmError
from tfarm.plots.frequency import draw_card
from tfarm.plots.style import save_figure
from tfarm.report.page import (
    PICTURES,
    Case,
    Cell,
    Controller,
    LoopResult,
    PageSection,
    keep,
    margins_of,
    prose,
)
from tfarm.response.frequency import bode
from tfarm.schema import Quantity, quantities, text
from tfarm.spectrum import modes
from tfarm.spectrum.listing import listed_modes

SHOWN_MODES = 5  # on the first page; the page of modes has ten
DIGITS = 4
IN_PILL = ("stability", "grade", "limited_by", "delay_margin_periods")  # quantities without a cell of their own
SHORT = {"gain_margin": "GM", "phase_margin": "PM", "delay_margin": "DM", "peak_sensitivity": "Ms"}  # of one line
SHOWN = (  # sections of the first page in their order: anchor, name of a picture, which of several; of modes a table
    ("margins-map", "map", 0),
    ("margins", ".+-bode", 0),
    ("sampled", "sampled-(slew|measured)", 0),
    ("bode-root-moment", "bode-root-moment", 0),  # where there is no loop function
    ("modes", "", 0),
    ("locus", "locus-.+", -1),
    ("fit", "fit-overlay", 0),
)


class Mode(NamedTuple):
    """A flexible mode in words."""

    number: int
    omega: str
    hertz: str
    damping: str


@dataclass(frozen=True)
class Card:
    """An arm as its pages and the table of arms show it; `picture` is empty where there is none."""

    name: str
    summary: str
    picture: str
    modes: tuple[Mode, ...]
    loops: tuple[LoopResult, ...]
    notes: tuple[str, ...]


def save_card(case: Case, folder: Path) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    (folder / PICTURES).mkdir(exist_ok=True)
    arm, picture = case.arm, ""
    with suppress(TfarmError):
        save_figure(draw_card.figure(bode(arm, "root_moment")), folder / PICTURES, "card", formats=("svg",))
        picture = "card.svg"
    loops, notes = list[LoopResult](), [] if not arm.is_locked else [prose("no_loop", arm=arm)]
    for each in () if arm.is_locked else case.controllers:
        try:
            found = card_of(each, case)
            loops += results(found, each.name if case.laws else each.title)
            notes += found.notes
        except TfarmError as error:
            notes.append(f"{each.name}: not determined, {error}.")
    shown = Card(arm.name, summary(case), picture, first_modes(case), tuple(loops), tuple(dict.fromkeys(notes)))
    keep(folder, "card", asdict(shown))


def summary(case: Case) -> str:
    """The arm in one sentence, and the laws that its page is about in another."""
    return prose("summary", arm=case.arm, laws=[each.name for each in case.laws])


def card_of(each: Controller, case: Case) -> ResultCard:
    """The result card of a controller, with the margins that the page has already."""
    known = None if each.law.is_discrete else margins_of(each.arm, each.law)
    return result_card(each.arm, each.law, case.chain, continuous=known)


def first_modes(case: Case) -> tuple[Mode, ...]:
    """The first flexible modes: natural frequencies at C = 0, damping ratios of the arm as it is."""
    rows = [row for row in listed_modes(modes(case.arm, SHOWN_MODES)).modes if row.index > 0]
    return tuple(
        Mode(row.index, text(row.natural_frequency), text(row.natural_frequency_hz),
             text(row.damping_ratio, DIGITS)) for row in rows
    )  # fmt: skip


def results(found: ResultCard, controller: str) -> list[LoopResult]:
    """The loops of a card as pages show them; the look of a pill is the grade of a stable loop, else its stability."""
    return [
        LoopResult(controller, name, own.finding, own.stability if own.grade == UNDEFINED else own.grade, cells_of(own))
        for name, own in found.loops.items()
    ]


def cells_of(own: LoopCard) -> dict[str, Cell]:
    """The quantities of a loop in words."""
    return {name: _cell(own, name, of) for name, of in quantities(LoopCard).items() if name not in IN_PILL}


def _cell(own: LoopCard, name: str, of: Quantity) -> Cell:
    """A quantity in words: a margin with its frequency, or in sampling periods; a damping ratio with its mode."""
    value, at, grade = getattr(own, name), "", ""
    if name in GRADED:
        value, omega, grade = value
        at = "" if omega is None else f"{text(omega, DIGITS)} rad/s"
        if name == "delay_margin" and value is not None and math.isfinite(value):
            at = f"{text(own.delay_margin_periods, DIGITS)} periods"
    elif name == "least_damping" and value is not None:
        value, at = value
    shown = "no limit" if value == math.inf else text(value, DIGITS)
    return Cell(of.label, shown, of.unit if shown[-1:].isdigit() else "", at, grade)


class Block(NamedTuple):
    """What the first page shows of a section: a picture, or the reason why there is none; `page` has the rest."""

    anchor: str
    title: str
    page: str
    image: Markup | None = None
    failure: str = ""


def blocks(sections: Mapping[str, PageSection]) -> list[Block]:
    """The blocks of the first page, in their order, of the sections that there are by anchor."""
    found = []
    for anchor, stem, place in SHOWN:
        section, page = sections.get(anchor), f"{anchor.partition('-')[0]}.html"
        if section is None or (page == "bode.html" and "margins" in sections):
            continue
        pictures = [each for each in section.blocks if each.image and re.fullmatch(stem, each.stem)]
        if section.failure or not stem:
            found.append(Block(anchor, section.title, page, failure=section.failure))
        elif pictures:
            found.append(Block(anchor, pictures[place].title, page, pictures[place].image))
    return found
