"""The index's card of an arm: a small picture, a few numbers, links.  Kept in the arm's folder as card.json.

So the index names every arm that has been reported on in that folder, whichever the last command was about.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tfarm.arm import Arm
from tfarm.errors import TfarmError
from tfarm.plots.files import save
from tfarm.plots.frequency import draw_card
from tfarm.report.arm_section import headline_numbers
from tfarm.report.page import QUESTIONS, Card, summary
from tfarm.report.sections import Fact
from tfarm.response.frequency import bode

FACTS = 4  # of the headline numbers
PAGES = {"index": "full report", **QUESTIONS}
LARGEST = 1 << 16  # bytes of a card.json worth reading


def save_card(arm: Arm, folder: Path) -> None:
    """card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    try:
        save(draw_card(bode(arm, "root_moment")), folder, "card", formats=("svg",))
    except TfarmError:
        picture = ""
    else:
        picture = "card.svg"
    facts = [[f.label, f.value, f.unit, f.beside] for f in headline_numbers(arm)[:FACTS]]
    card = {"tfarm_card": 1, "name": arm.name, "summary": summary(arm), "facts": facts, "picture": picture}
    text = json.dumps(card, ensure_ascii=False, indent=1) + "\n"
    (folder / "card.json").write_text(text, encoding="utf-8", newline="")


def written_cards(out: Path) -> Sequence[Card]:
    """The cards of all arms in the folder of reports, by name; what is no card of ours is passed over."""
    folders = sorted((f for f in out.iterdir() if f.is_dir() and not f.name.startswith(".")), key=lambda f: f.name)
    return [card for folder in folders if (card := _read(folder)) is not None]


def _read(folder: Path) -> Card | None:
    pages = tuple((f"{page}.html", title) for page, title in PAGES.items() if (folder / f"{page}.html").is_file())
    file = folder / "card.json"
    try:
        if not pages or file.stat().st_size > LARGEST:
            return None
        return _card(json.loads(file.read_text(encoding="utf-8")), folder.name, pages)
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None


def _card(read: Any, folder: str, pages: Sequence[tuple[str, str]]) -> Card | None:
    if read["tfarm_card"] != 1 or read["name"] != folder:
        return None
    facts = [Fact(label=str(a), value=str(b), unit=str(c), beside=str(d)) for a, b, c, d in read["facts"]]
    picture = "card.svg" if read.get("picture", "card.svg") else ""
    return Card(name=folder, summary=str(read["summary"]), facts=facts, pages=pages, picture=picture)
