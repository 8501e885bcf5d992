"""An arm's page: its sections in their order, what is seen of them at once, and the HTML by templates."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from markupsafe import Markup
from pydantic import TypeAdapter

from tfarm.arm import PLANE, Arm, as_law, load, presets
from tfarm.arm.writing import law_toml
from tfarm.dsp import Chain, load_chain
from tfarm.dsp.chain import file_text
from tfarm.errors import ParameterError, TfarmError
from tfarm.plots.frequency import draw_card
from tfarm.plots.style import save_figure
from tfarm.report.arm_section import arm_section, assumptions_section, headline_numbers, is_from_paper, paper_section
from tfarm.report.cases import Case, Controller, brief_on, has_loop, margins_of, sign_words
from tfarm.report.gains_section import locus_section, map_section
from tfarm.report.loop_section import law_section, margins_section, no_loop_section, nyquist_section
from tfarm.report.modes_section import modes_section
from tfarm.report.response_sections import bode_section, fit_section, measured_section
from tfarm.report.sampled_section import sampled_section
from tfarm.report.sections import PICTURES, Fact, PageSection, prose, render
from tfarm.report.tuner_section import tuner_section
from tfarm.response.frequency import bode
from tfarm.schema.glossary import GLOSSARY_TERMS
from tfarm.schema.html import with_symbols

BADGES = {"stable": "ok", "yes": "ok", "unstable": "corrected", "no": "corrected", "marginal": "undecided",
            "undecided": "undecided"}  # fmt: skip
OPEN_PICTURES = 2  # of a section: those that answer its question; the rest is a click away
PROMISES = (
    "certified", "complete", "converged", "default gains", "enclosed", "Lyapunov region", "not determined", "proven",
    "small gain", "winding number",
)  # fmt: skip
PROMISE = re.compile(rf"\b(?:{'|'.join(PROMISES)})\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Piece:
    """One section of one arm's page: a name for the progress bar, the section's anchor, and how to make it of a case.

    A page that it does not suit has no such section.  The page that `report --only` asks for is called by the first
    word of its sections' anchors; its `title` is that of one of them, and `is_also_on` picks the other pages of that
    kind that have the section.  The full page has all, and at its top the answers of those that have one.
    `seconds` is about how long a section takes to make, where that is long: the longest are begun first.  Sections of
    one `task` are made one after the other in one process, as they share a design or the damped modes of the arm.
    """

    name: str
    anchor: str
    make: Callable[[Case], PageSection]
    suits: Callable[[Case], Any] = lambda case: True
    title: str = ""
    is_also_on: Callable[[str], bool] = lambda page: False
    seconds: float = 0.0
    task: str = ""

    @property
    def page(self) -> str:
        """The page that has it when it is asked for alone."""
        return self.anchor.partition("-")[0]

    def is_on(self, page: str) -> bool:
        """Whether that page, asked for alone, has the section."""
        return page == self.page or self.is_also_on(page)


LOOP_TASK = "continuous loop"  # of the sections that have the gains of best damping
LOOP_PAGES = ("margins", "locus", "sampled", "tune")  # on which an arm without a loop has nothing but that it has none
OF_LAWS = (*LOOP_PAGES, "law", "no")  # first words of the sections that a page about laws begins with


def _in_s(case: Case) -> bool:
    """Whether a controller of the case acts in continuous time."""
    return not case.arm.is_locked and any(not each.law.is_discrete for each in case.controllers)


def _of_gains(case: Case) -> bool:
    """Whether the page is about both gains of the arm itself."""
    return not case.laws and has_loop(case.arm)


PIECES = (
    Piece("fit to measurements", "fit", fit_section, lambda case: case.fit),
    Piece("stability region of both gains", "margins-map", map_section, _of_gains, seconds=5.0, task=LOOP_TASK),
    Piece("the arm", "arm", arm_section, is_also_on=lambda page: True),
    Piece("the paper's values", "paper", paper_section, lambda case: is_from_paper(case.arm)),
    Piece("response of the root moment", "bode-root-moment", partial(bode_section, output="root_moment"),
          title="Bode plots"),
    Piece("response of the tip", "bode-tip-displacement", partial(bode_section, output="tip_displacement")),
    Piece("measured responses", "bode-measured", measured_section, lambda case: case.measured),
    Piece("modes", "modes", modes_section, title="Modes", seconds=1.0),
    Piece("the loop", "no-loop", no_loop_section, lambda case: not case.has_loop, is_also_on=LOOP_PAGES.__contains__),
    Piece("stability margins", "margins", margins_section, _in_s, "Gains and margins", task=LOOP_TASK),
    Piece("root loci", "locus", locus_section, _in_s, "Root loci", seconds=7.0, task=LOOP_TASK),
    Piece("Nyquist plot", "margins-nyquist", nyquist_section, _in_s, task=LOOP_TASK),
    Piece("sampled loop", "sampled", sampled_section, lambda case: case.has_loop, "The sampled loop", seconds=8.0),
    Piece("controllers", "law", law_section, lambda case: case.laws and not case.arm.is_locked,
           is_also_on=LOOP_PAGES.__contains__),
    Piece("gain tuner", "tune", tuner_section, _of_gains, "The gain tuner", seconds=6.0, task="sampled loop"),
    Piece("assumptions", "assumptions", assumptions_section, title="What the assumptions do"),
)  # fmt: skip
QUESTIONS = {piece.page: piece.title for piece in PIECES if piece.title}  # pages that may be asked for alone


def pieces_of(case: Case) -> list[Piece]:
    """The sections of a page, in their order; a page about laws begins with its loops."""
    suited = [piece for piece in PIECES if piece.suits(case)]
    return sorted(suited, key=lambda piece: bool(case.laws) and piece.page not in OF_LAWS)


def explained(text: str) -> Markup:
    """A sentence as a page shows it; a word that promises something leads to its meaning at its first place."""
    seen: set[str] = set()

    def linked(found: re.Match[str]) -> str:
        word, before = found[0].lower(), len(seen)
        seen.add(word)
        return found[0] if len(seen) == before else f'<a class="term" href="#{word_id(word)}">{found[0]}</a>'

    return Markup(PROMISE.sub(linked, str(with_symbols(text))))


def word_id(name: str) -> str:
    """The anchor of a word of the glossary on a page."""
    return f"word-{name.lower().replace(' ', '-')}"


def pages_in(folder: Path, written: Sequence[str] = ()) -> list[tuple[str, str]]:
    """(file, title) of the pages in an arm's folder, and of those that are being written."""
    there = {name: title for name, title in PAGES.items() if name in written or (folder / f"{name}.html").is_file()}
    return [(f"{name}.html", title) for name, title in there.items()]


def arm_page(
    case: Case,
    sections: Sequence[PageSection],
    only: str | None,
    *,
    trust: str,
    live: bool,
    others: Sequence[tuple[str, str]],
) -> str:
    """The page of one case, with every section or with those of one question.

    `trust` is the page on trust, as seen from the arm's folder; empty if there is none.
    `live`: whether there is a live page in the folder.  `others` are the file and title of each other page of this arm.
    """
    arm = case.arm
    return render(
        "arm.html",
        title=f"{arm.name}: {QUESTIONS[only]}" if only else arm.name,
        sections=sections,
        looks=BADGES,
        open_pictures=OPEN_PICTURES,
        only=only,
        others=others,
        signs="" if arm.is_locked else sign_words(arm),
        glossary=[term for term in GLOSSARY_TERMS if term.name in PROMISES],
        trust=trust,
        live=live,
        summary=summary(case),
        sha256=hashlib.sha256(file_of(case).encode()).hexdigest(),
        command=command_of(case, only),
        has_proof=not (case.laws and only),
        explained=explained,
        word_id=word_id,
    )


def summary(case: Case) -> str:
    """The arm in one sentence, and the laws that its page is about in another."""
    return prose("summary", arm=case.arm, laws=[each.name for each in case.laws])


# ------------------------------------------------------------ files and commands


def file_of(case: Case) -> str:
    """The arm's file with its chain, and with the law that the page is about where TOML can say that alone."""
    law = own_law(case)
    return file_text(case.arm, case.chain) + ("" if law is None else f"\n{law}")


def own_law(case: Case) -> str | None:
    """The table [law] of the one law of a page; None of none or several, or of one with files of its own."""
    with suppress(ParameterError):
        if len(case.laws) == 1 and case.laws[0].measured is None:
            return law_toml(as_law(case.laws[0].law))
    return None


def command_of(case: Case, only: str | None) -> str:
    """The command that writes this page; an arm that is no preset is named by its file, as are laws with theirs."""
    law = own_law(case)
    options = [] if law is not None else [f"--law {shlex.quote(each.file or 'FILE')}" for each in case.laws]
    options += [f"--measured {shlex.quote(f'{each.name}={each.source}')}" for each in case.measured]
    options += [f"--only {only}"] * bool(only)
    name = argument(case.arm.name, law is None and is_preset(case.arm, case.chain))
    return " ".join(["tfarm report", name, *options, "--out reports"])


def is_preset(arm: Arm, chain: Chain) -> bool:
    """Whether the arm comes with tfarm, and its chain is the one that comes with it."""
    return arm.name in presets() and (load(arm.name), load_chain(arm.name)) == (arm, chain)


def argument(name: str, preset: bool) -> str:
    """The name of an arm in a command."""
    return shlex.quote(name if preset else f"{name}.toml")


# ------------------------------------------------------------ the index, and what it reads in the folders of arms


COMPARISON_PAGE = "compare.html"
FACTS = 4  # of the headline numbers
INDEX_COLUMNS = ("law", "verdict", *PLANE, "sampled")  # columns of the index's table of arms
PAGES = {"index": "full report", "live": "live loop", **QUESTIONS}
T = TypeVar("T")


@dataclass(frozen=True)
class Card:
    """An arm as the index shows it; `picture` is empty where there is none."""

    name: str
    summary: str
    facts: list[Fact]
    picture: str
    loops: list[dict[str, str]]

    @property
    def rows(self) -> list[dict[str, str]]:
        """The rows of the table of arms by INDEX_COLUMNS: one a loop, an empty one without a loop."""
        return [dict.fromkeys(INDEX_COLUMNS, "") | row for row in self.loops or [{}]]


@dataclass(frozen=True)
class KeptComparison:
    """The title of the comparison in a folder of reports, and the arms that it compares."""

    title: str = ""
    arms: tuple[str, ...] = ()


def keep(folder: Path, kind: str, content: Mapping[str, Any]) -> None:
    """kind.json, with a mark of what it is."""
    text = json.dumps({f"tfarm_{kind}": 1, **content}, ensure_ascii=False, indent=1) + "\n"
    (folder / f"{kind}.json").write_text(text, encoding="utf-8", newline="")


def kept_in(folder: Path, kind: str, record: type[T]) -> T | None:
    """The record in a folder's kind.json; None where there is none, or none of ours."""
    try:
        return TypeAdapter(record).validate_json((folder / f"{kind}.json").read_bytes())
    except (OSError, ValueError):
        return None


def kept(out: Path, kind: str, record: type[T]) -> dict[Path, T]:
    """The records of that kind in the folders of arms, by folder; what is none of ours is passed over."""
    folders = sorted((f for f in out.iterdir() if f.is_dir() and not f.name.startswith(".")), key=lambda f: f.name)
    found = ((folder, kept_in(folder, kind, record)) for folder in folders)
    return {folder: each for folder, each in found if each is not None and getattr(each, "name", "") == folder.name}


def kept_comparison(out: Path) -> KeptComparison:
    """The comparison in a folder of reports; an empty one where there is none."""
    found = kept_in(out, "compare", KeptComparison) if (out / COMPARISON_PAGE).is_file() else None
    return found or KeptComparison()


def save_card(case: Case, folder: Path) -> None:
    """pictures/card.svg and card.json; a picture that cannot be made is left out, as its section on the page is."""
    (folder / PICTURES).mkdir(exist_ok=True)
    arm, picture = case.arm, ""
    with suppress(TfarmError):
        save_figure(draw_card(bode(arm, "root_moment")), folder / PICTURES, "card", formats=("svg",))
        picture = "card.svg"
    loops = [loop_cells(each, case.chain) for each in case.controllers if case.laws or has_loop(arm)]
    facts = list(headline_numbers(arm)[:FACTS])
    keep(folder, "card", asdict(Card(arm.name, summary(case), facts, picture, loops)))


def loop_cells(each: Controller, chain: Chain) -> dict[str, str]:
    """A controller in cells of the table of arms by INDEX_COLUMNS; a verdict that cannot be had is left out."""
    cells = {"law": each.given.name}
    with suppress(TfarmError):
        if not each.law.is_discrete:
            found = margins_of(each.arm, each.law)
            cells["verdict"] = found.stability.verdict
            for row in found.stability_intervals:
                if row.name in PLANE:
                    cells[row.name] = f"{row.interval.as_text(5)} {row.unit}".rstrip() if row.interval else "none"
    with suppress(TfarmError):
        cells["sampled"] = brief_on(each.arm, each.law, chain).short
    return cells


def index_page(out: Path, *, trust: str) -> str:
    """The page that leads to all others in a folder of reports."""
    cards = [
        asdict(card) | {"pages": pages, "loops": card.rows} for folder, card in kept(out, "card", Card).items()
        if (pages := pages_in(folder))
    ]  # fmt: skip
    compared = kept_comparison(out).title
    return render("index.html", title="tfarm reports", cards=cards, trust=trust, compared=compared, looks=BADGES)
