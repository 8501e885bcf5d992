"""The first page of an arm, and its row in the table of arms: result card, pictures in their order, first modes."""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tfarm.assessment.card import ResultCard
from tfarm.errors import TfarmError
from tfarm.plots.files import save_figure
from tfarm.plots.frequency import draw_card
from tfarm.report.blocks import PICTURES, PageSection, SavedBlock, keep, prose
from tfarm.report.page import ArmReport, PageCase
from tfarm.schema import table, text, to_dict

# a line
SHORT = {"gain_margin_db": "GM", "phase_margin_deg": "PM", "delay_margin_ms": "DM", "peak_sensitivity": "Ms"}


@dataclass(frozen=True)
class Card:
    """An arm as its pages and the table of arms show it; `picture` is empty where there is none.

    `modes` are rows of `tfarm modes --json`, `loops` the loops of the summary of `tfarm sampled --json` in words;
    `words` are the limits of each controller in sentences.
    """

    name: str
    summary: str
    picture: str
    modes: tuple[dict[str, Any], ...]
    loops: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]
    words: tuple[str, ...] = ()


def save_card(report: ArmReport, folder: Path) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    (folder / PICTURES).mkdir(exist_ok=True)
    arm = report.arm
    picture = ""
    with suppress(TfarmError):
        save_figure(draw_card.figure(report.bode("root_moment")), folder / PICTURES / "card.svg")
        picture = "card.svg"
    loops: list[dict[str, Any]] = []
    notes = [] if report.has_loop else [prose("no_loop", arm=arm)]
    words: list[str] = []
    for each in () if arm.is_locked else report.cases:
        try:
            found = each.card
            loops += results(found, each.name if report.laws else each.title)
            notes += found.notes
            words += limits_in_words(report, each)
        except TfarmError as error:
            notes.append(f"{each.name}: not determined, {error}.")
    # the first five; the page of modes has ten
    rows = [row for row in report.mode_list(5).modes if row.index > 0]
    first = table(rows, ("index", "natural_frequency", "natural_frequency_hz", "damping_ratio"))
    shown = Card(
        arm.name,
        summary(report),
        picture,
        tuple(first),
        tuple(loops),
        tuple(dict.fromkeys(notes)),
        tuple(words),
    )
    keep(folder, "card", asdict(shown))


def summary(report: ArmReport) -> str:
    """Return the arm in one sentence, and the laws that its page is about in another."""
    return prose("summary", arm=report.arm, laws=[each.own_name for each in report.cases if report.laws])


def limits_in_words(report: ArmReport, each: PageCase) -> list[str]:
    """Return the limiting mode of a case, the costs of sampling and the next step, a sentence or two each."""
    name = each.own_name if len(report.cases) > 1 else ""
    found = report.limits(each)
    parts = ("limits_mode", "limits_sampling", "limits_next")
    words = [prose(part, found=found, name=name, command=report.command_name) for part in parts]
    return [sentence for sentence in words if sentence]


def results(found: ResultCard, controller: str) -> list[dict[str, Any]]:
    """The loops of a card in words under their keys in JSON, each with its controller, its name and its finding."""
    return [
        {"controller": controller, "loop": name, "finding": own.finding, **in_words(to_dict(own))}
        for name, own in found.loops.items()
    ]


def in_words(value: Any) -> Any:
    """Return a value of JSON as a page shows it."""
    digits = 4
    if isinstance(value, dict):
        return {key: in_words(each) for key, each in value.items()}
    return text(value, digits)


def blocks(sections: Mapping[str, PageSection]) -> Iterator[tuple[PageSection, SavedBlock | None]]:
    """The sections of the first page, in their order, each with its picture: none of modes, or where it failed."""
    # anchor, name of a picture, which of several; of modes a table
    shown = (
        ("margins-map", "map", 0),
        ("margins", ".+-bode", 0),
        ("sampled", "sampled-(slew|measured)", 0),
        # where there is no loop function
        ("bode-root-moment", "bode-root-moment", 0),
        ("modes", "", 0),
        ("locus", "locus-.+", -1),
        ("arm", "arm", 0),
        ("fit", "fit-overlay", 0),
    )
    for anchor, stem, place in shown:
        section = sections.get(anchor)
        if section is None or (anchor.startswith("bode") and "margins" in sections):
            continue
        pictures = [each for each in section.blocks if each.image and re.fullmatch(stem, each.stem)]
        if pictures:
            yield section, pictures[place]
        elif section.failure or not stem:
            yield section, None
