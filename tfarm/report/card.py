"""The index's card of an arm: a small picture, a few numbers, links.  Kept in the arm's folder as card.json.

So the index names every arm that has been reported on in that folder, whichever the last command was about.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tfarm.arm import PLANE, Arm
from tfarm.digits import plain
from tfarm.dsp import Chain
from tfarm.errors import TfarmError
from tfarm.plots.files import save_figure
from tfarm.plots.frequency import draw_card
from tfarm.plots.words import gains_words
from tfarm.report.arm_section import headline_numbers
from tfarm.report.kept import keep, kept
from tfarm.report.loop_laws import brief_on, has_loop, margins_of
from tfarm.report.page import QUESTIONS, Card, summary
from tfarm.report.sections import PICTURES, Fact
from tfarm.response.frequency import bode
from tfarm.spectrum.scales import default_gains

FACTS = 4  # of the headline numbers
INDEX_COLUMNS = ("gains", "verdict", *PLANE, "sampled")  # columns of the index's table of arms
PAGES = {"index": "full report", "live": "live loop", **QUESTIONS}


def save_card(arm: Arm, folder: Path, laws: Sequence[str], chain: Chain) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    try:
        (folder / PICTURES).mkdir(exist_ok=True)
        save_figure(draw_card(bode(arm, "root_moment")), folder / PICTURES, "card", formats=("svg",))
    except TfarmError:
        picture = ""
    else:
        picture = "card.svg"
    facts = [[f.label, f.value, f.unit, f.beside] for f in headline_numbers(arm)[:FACTS]]
    loop = index_cells(arm, chain)
    what = {"name": arm.name, "summary": summary(arm, laws), "facts": facts, "picture": picture, "loop": loop}
    keep(folder, "card", what)


def index_cells(arm: Arm, chain: Chain) -> dict[str, str]:
    """The loop of the default gains, in cells of the table of arms by COMPARED; empty where there is no loop."""
    if not has_loop(arm):
        return {}
    law = default_gains(arm)
    try:
        found, sampled = margins_of(arm, law), brief_on(arm, law, chain)
    except TfarmError:
        return {}
    cells = {"gains": gains_words(law), "verdict": found.stability.verdict}
    for name in PLANE:  # from where to where the gain may move; a star at an end where no limit was found
        windows = found.windows[name]
        ends = (plain(end, 5) + "*" * (windows.end(end) == "search bound") for end in windows.around or ())
        cells[name] = " … ".join(ends) or "none"
    return cells | {"sampled": sampled.short}


def written_cards(out: Path) -> Sequence[Card]:
    """The cards of all arms in the folder of reports, by name; what is no card of ours is passed over."""
    return kept(out, "card", _card)


def _card(read: dict[str, Any], folder: Path) -> Card | None:
    """None for an arm that has no page."""
    pages = tuple((f"{page}.html", title) for page, title in PAGES.items() if (folder / f"{page}.html").is_file())
    facts = [Fact(label=str(a), value=str(b), unit=str(c), beside=str(d)) for a, b, c, d in read["facts"]]
    picture = "pictures/card.svg" if read.get("picture", "card.svg") else ""
    loop = {key: str(read.get("loop", {}).get(key, "")) for key in INDEX_COLUMNS}
    card = Card(name=folder.name, summary=str(read["summary"]), facts=facts, pages=pages, picture=picture, loop=loop)
    return card if pages else None
