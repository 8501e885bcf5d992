"""The index's card of an arm: a small picture, a few numbers, links.  Kept in the arm's folder as card.json.

So the index names every arm that has been reported on in that folder, whichever the last command was about.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tfarm.arm import Arm
from tfarm.errors import TfarmError
from tfarm.plots.files import save
from tfarm.plots.frequency import draw_card
from tfarm.report.arm_section import headline_numbers
from tfarm.report.kept import keep, kept
from tfarm.report.page import QUESTIONS, Card, summary
from tfarm.report.sections import PICTURES, Fact
from tfarm.response.frequency import bode

FACTS = 4  # of the headline numbers
PAGES = {"index": "full report", "live": "live loop", **QUESTIONS}


def save_card(arm: Arm, folder: Path, laws: Sequence[str] = ()) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    try:
        (folder / PICTURES).mkdir(exist_ok=True)
        save(draw_card(bode(arm, "root_moment")), folder / PICTURES, "card", formats=("svg",))
    except TfarmError:
        picture = ""
    else:
        picture = "card.svg"
    facts = [[f.label, f.value, f.unit, f.beside] for f in headline_numbers(arm)[:FACTS]]
    keep(folder, "card", {"name": arm.name, "summary": summary(arm, laws), "facts": facts, "picture": picture})


def written_cards(out: Path) -> Sequence[Card]:
    """The cards of all arms in the folder of reports, by name; what is no card of ours is passed over."""
    return kept(out, "card", _card)


def _card(read: dict[str, Any], folder: Path) -> Card | None:
    """None for an arm that has no page."""
    pages = tuple((f"{page}.html", title) for page, title in PAGES.items() if (folder / f"{page}.html").is_file())
    facts = [Fact(label=str(a), value=str(b), unit=str(c), beside=str(d)) for a, b, c, d in read["facts"]]
    picture = "pictures/card.svg" if read.get("picture", "card.svg") else ""
    card = Card(name=folder.name, summary=str(read["summary"]), facts=facts, pages=pages, picture=picture)
    return card if pages else None
