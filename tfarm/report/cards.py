"""What a report keeps of each arm in its folder as JSON, and reads again for pages that are about all arms."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from tfarm.arm import PLANE, Arm
from tfarm.digits import plain
from tfarm.dsp import Chain
from tfarm.errors import TfarmError
from tfarm.plots.frequency import draw_card
from tfarm.plots.style import save_figure
from tfarm.report.arm_section import headline_numbers
from tfarm.report.cases import GivenLaw, LawOnArm, brief_on, cases_of, has_loop, margins_of
from tfarm.report.page import QUESTIONS, summary
from tfarm.report.sections import PICTURES, Fact
from tfarm.response.frequency import bode

COMPARISON_KIND = "compare"  # what is kept of a comparison
COMPARISON_PAGE = "compare.html"
LARGEST_READ = 1 << 20  # bytes of a file worth reading
T = TypeVar("T")
FACTS = 4  # of the headline numbers
INDEX_COLUMNS = ("law", "verdict", *PLANE, "sampled")  # columns of the index's table of arms
PAGES = {"index": "full report", "live": "live loop", **QUESTIONS}


def keep(folder: Path, kind: str, content: Mapping[str, Any]) -> None:
    """kind.json, with a mark of what it is."""
    text = json.dumps({f"tfarm_{kind}": 1, **content}, ensure_ascii=False, indent=1) + "\n"
    (folder / f"{kind}.json").write_text(text, encoding="utf-8", newline="")


def kept_in(folder: Path, kind: str, made_of: Callable[[dict[str, Any]], T | None]) -> T | None:
    """What `made_of` makes of a folder's kind.json; None where there is none, or none of ours."""
    file = folder / f"{kind}.json"
    try:
        read = json.loads(file.read_text(encoding="utf-8")) if file.stat().st_size <= LARGEST_READ else {}
        return made_of(read) if read.pop(f"tfarm_{kind}") == 1 else None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


def kept_comparison(out: Path) -> tuple[str, tuple[str, ...]]:
    """The title of compare.html beside the reports, and the arms that it compares; ("", ()) where there is none."""
    found = kept_in(out, COMPARISON_KIND, lambda read: (str(read["title"]), tuple(map(str, read["arms"]))))
    return found if found is not None and (out / COMPARISON_PAGE).is_file() else ("", ())


def kept(out: Path, kind: str, made_of: Callable[[dict[str, Any], Path], T | None]) -> list[T]:
    """What `made_of` makes of each folder's kind.json, by name; what is none of ours is passed over."""

    def made(folder: Path) -> T | None:
        return kept_in(folder, kind, lambda read: made_of(read, folder) if read["name"] == folder.name else None)

    folders = sorted((f for f in out.iterdir() if f.is_dir() and not f.name.startswith(".")), key=lambda f: f.name)
    return [each for each in map(made, folders) if each is not None]


def save_card(arm: Arm, folder: Path, laws: Sequence[GivenLaw], chain: Chain) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    (folder / PICTURES).mkdir(exist_ok=True)
    picture = ""
    with suppress(TfarmError):
        save_figure(draw_card(bode(arm, "root_moment")), folder / PICTURES, "card", formats=("svg",))
        picture = "card.svg"
    what = {
        "name": arm.name,
        "summary": summary(arm, [each.name for each in laws]),
        "facts": [[f.label, f.value, f.unit, f.beside] for f in headline_numbers(arm)[:FACTS]],
        "picture": picture,
        "loops": [loop_cells(each, chain) for each in cases_of(arm, laws)] if laws or has_loop(arm) else [],
    }
    keep(folder, "card", what)


def loop_cells(each: LawOnArm, chain: Chain) -> dict[str, str]:
    """A controller in cells of the table of arms by INDEX_COLUMNS; a verdict that cannot be had is left out."""
    cells = {"law": each.given.name}
    with suppress(TfarmError):
        if not each.law.is_discrete:
            found = margins_of(each.arm, each.law)
            cells["verdict"] = found.stability.verdict
            for name in found.windows.keys() & PLANE:  # a star at an end where no limit was found
                windows = found.windows[name]
                ends = (plain(end, 5) + "*" * (windows.end(end) == "search bound") for end in windows.around or ())
                cells[name] = " … ".join(ends) or "none"
    with suppress(TfarmError):
        cells["sampled"] = brief_on(each.arm, each.law, chain).short
    return cells


def written_cards(out: Path) -> Sequence[Mapping[str, Any]]:
    """The cards of all arms in the folder of reports, by name; what is no card of ours is passed over."""
    return kept(out, "card", _card)


def _card(read: dict[str, Any], folder: Path) -> Mapping[str, Any] | None:
    """An arm as the index shows it, `loops` being rows of the table of arms; None for an arm that has no page."""
    pages = tuple((f"{page}.html", title) for page, title in PAGES.items() if (folder / f"{page}.html").is_file())
    card = {
        "name": folder.name,
        "summary": str(read["summary"]),
        "facts": [Fact(label=str(a), value=str(b), unit=str(c), beside=str(d)) for a, b, c, d in read["facts"]],
        "pages": pages,
        "picture": "pictures/card.svg" if read.get("picture", "card.svg") else "",
        "loops": [{key: str(row.get(key, "")) for key in INDEX_COLUMNS} for row in read.get("loops") or [{}]],
    }
    return card if pages else None
