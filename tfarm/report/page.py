"""An arm's page: its sections in their order, what is seen of them at once, and the HTML by templates."""

from __future__ import annotations

import hashlib
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

import tfarm
from tfarm.arm import Arm, as_law, load, presets
from tfarm.arm.writing import law_toml
from tfarm.digits import listed
from tfarm.dsp import Chain, load_chain
from tfarm.dsp.chain import file_text
from tfarm.errors import ParameterError
from tfarm.glossary import GLOSSARY_TERMS, Term
from tfarm.report.arm_section import arm_section, is_from_paper, paper_section
from tfarm.report.assumptions_section import assumptions_section
from tfarm.report.cases import Subject, has_loop, has_rate_loop, sign_words
from tfarm.report.law_section import law_section
from tfarm.report.locus_section import locus_section
from tfarm.report.loop_section import margins_section, no_loop_section, nyquist_section, poles_section
from tfarm.report.map_section import map_section
from tfarm.report.modes_section import modes_section
from tfarm.report.response_sections import bode_section, fit_section, measured_section
from tfarm.report.sampled_section import sampled_section
from tfarm.report.sections import PageSection, SavedBlock, SavedSection
from tfarm.report.tuner_section import tuner_section
from tfarm.tables.html import with_symbols

SHORTEST = 40  # characters of an answer; one that is shorter takes the next sentence too
BADGES = {"stable": "ok", "yes": "ok", "unstable": "corrected", "no": "corrected", "marginal": "undecided",
            "undecided": "undecided"}  # fmt: skip
OPEN_PICTURES = 2  # of a section: those that answer its question; the rest is a click away
FOLDED_SECTIONS = ("assumptions",)  # sections whose pictures are for those who ask further
PROMISES = ("certified", "complete", "enclosed", "Lyapunov region", "proven", "settled", "small gain", "winding number",
        "band", "window", "default gains")  # fmt: skip
PLAIN_WORDS = ("band", "window")  # of these: too common in another sense to lead to their meaning wherever they stand
PROMISE = re.compile(rf"\b(?:{'|'.join(name for name in PROMISES if name not in PLAIN_WORDS)})\b", re.IGNORECASE)
ABREAST = ("bode-root-moment", "bode-tip-displacement")  # sections of one picture each that stand beside each other
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Piece:
    """One section of one arm's page: a name for the progress bar, the section's anchor, and how to make it.

    The page that `report --only` asks for is called by the first word of its sections' anchors; its `title` stands with
    one of them, and `is_also_on` says which other pages of that kind have a section.  The full page has all, and at
    its top the first words of those that are an answer (`is_answer`).  `seconds` is about how long a section takes to
    make, where that is long: the longest are begun first.

    `make` takes these parts of the page's subject (`of`), and a page where one is missing has no such section; `in_s`:
    only where one of the laws acts in continuous time.
    """

    name: str
    anchor: str
    make: Callable[..., PageSection]
    suits: Callable[[Arm], bool] = lambda arm: True
    title: str = ""
    is_also_on: Callable[[str], bool] = lambda page: False
    is_answer: bool = False
    seconds: float = 0.0
    of: tuple[str, ...] = ("arm",)
    in_s: bool = False

    @property
    def page(self) -> str:
        """The page that has it when it is asked for alone."""
        return self.anchor.partition("-")[0]

    def is_on(self, page: str) -> bool:
        """Whether that page, asked for alone, has the section."""
        return page == self.page or self.is_also_on(page)

    def is_for(self, subject: Subject) -> bool:
        """Whether a page on this subject has the section."""
        if not self.suits(subject.arm) or not all(getattr(subject, part) for part in self.of):
            return False
        return not self.in_s or not all(as_law(each.law).is_discrete for each in subject.laws)

    def made(self, subject: Subject) -> PageSection:
        """The section."""
        return self.make(*(getattr(subject, part) for part in self.of))


Answer = partial(Piece, is_answer=True)


SAMPLED, LAWS = ("arm", "chain"), ("arm", "chain", "laws")  # of what sections are that say what a clock does, or laws


def is_of_the_loop(page: str) -> bool:
    """Whether the page is one that an arm without a loop has nothing on, but that it has none."""
    return any(piece.page == page and piece.suits in (has_loop, has_rate_loop) for piece in ARM_PIECES)


ARM_PIECES = (
    Answer("the fit", "fit", fit_section, of=("fit",)),
    Answer("map of the gains", "margins-map", map_section, has_loop, of=SAMPLED),
    Piece("the arm", "arm", arm_section, is_also_on=lambda page: True),
    Piece("the paper's values", "paper", paper_section, is_from_paper),
    Piece("root moment", "bode-root-moment", partial(bode_section, output="root_moment"), title="Bode plots"),
    Piece("tip displacement", "bode-tip-displacement", partial(bode_section, output="tip_displacement")),
    Piece("measured responses", "bode-measured", measured_section, of=("arm", "measured")),
    Piece("modes", "modes", modes_section, title="Modes", seconds=1.0),
    Answer("no loop", "no-loop", no_loop_section, lambda arm: not has_loop(arm), is_also_on=is_of_the_loop),
    Answer("margins", "margins", margins_section, has_rate_loop, "Gains and margins", of=SAMPLED),
    Answer("root loci", "locus", locus_section, has_rate_loop, "Root loci", seconds=2.0, of=SAMPLED),
    Piece("Nyquist", "margins-nyquist", nyquist_section, has_rate_loop, of=SAMPLED),
    Answer("sampled loop", "sampled", sampled_section, has_loop, "The sampled loop", seconds=8.0, of=SAMPLED),
    Answer("gain tuner", "tune", tuner_section, has_loop, "The gain tuner", seconds=10.0, of=SAMPLED),
    Piece("assumptions", "assumptions", assumptions_section, title="What the assumptions do"),
)


QUESTIONS = {piece.page: piece.title for piece in ARM_PIECES if piece.title}  # pages that may be asked for alone


LAW_PIECES = (
    Answer("margins", "margins", margins_section, has_rate_loop, of=LAWS, in_s=True),
    Answer("sampled loop", "sampled", sampled_section, has_rate_loop, seconds=8.0, of=LAWS),
    Answer("the law", "law", law_section, has_rate_loop, is_also_on=is_of_the_loop, of=LAWS),
    Piece("Nyquist", "margins-nyquist", nyquist_section, has_rate_loop, of=LAWS, in_s=True),
    Answer("poles", "locus", poles_section, has_rate_loop, seconds=2.0, of=LAWS, in_s=True),
    Answer("no loop", "no-loop", no_loop_section, lambda arm: not has_rate_loop(arm), is_also_on=is_of_the_loop),
    *(
        piece
        for piece in ARM_PIECES
        if not is_of_the_loop(piece.page) and piece.is_also_on is not is_of_the_loop  # which laws have their own of
    ),
)
ANSWERS = {piece.anchor for piece in (*ARM_PIECES, *LAW_PIECES) if piece.is_answer}


@dataclass(frozen=True, slots=True, kw_only=True)
class Framed:
    """A section as its page shows it: in the contents with a badge, answered above, long matter folded away.

    `badge` is the verdict, with the class of its look; `answer` the sentence for the top of the page; both may be "".
    """

    saved: SavedSection
    badge: tuple[str, str]
    answer: str
    words: Sequence[str]
    more_words: Sequence[str]
    blocks: Sequence[SavedBlock]
    more_blocks: Sequence[SavedBlock]


def framed(saved: SavedSection) -> Framed:
    """What is seen at once of a section, and what is folded away."""
    section, pictures = saved.section, [block for block in saved.blocks if block.table is None]
    shown = pictures[: 0 if section.anchor in FOLDED_SECTIONS else OPEN_PICTURES]
    return Framed(
        saved=saved,
        badge=next(
            ((word, BADGES[word]) for fact in section.facts if (word := fact.value.lower()) in BADGES), ("", "")
        ),
        answer=first_sentence(section.words[0]) if section.anchor in ANSWERS and section.words else "",
        words=section.words[:1],
        more_words=section.words[1:],
        blocks=shown,
        more_blocks=[block for block in saved.blocks if block not in shown],
    )


def section_rows(sections: Sequence[Framed]) -> Sequence[Sequence[Framed]]:
    """The sections in their order, those that stand beside each other in one row."""
    found: list[list[Framed]] = []
    for each in sections:
        anchors = [found[-1][-1].saved.section.anchor, each.saved.section.anchor] if found else []
        if tuple(anchors) == ABREAST:
            found[-1].append(each)
        else:
            found.append([each])
    return found


def explained(text: str) -> Markup:
    """A sentence as a page shows it; a word that promises something leads to its meaning, where it stands first."""
    seen: set[str] = set()

    def linked(found: re.Match[str]) -> str:
        word = found[0].lower()
        if word in seen:
            return found[0]
        seen.add(word)
        return f'<a class="term" href="#{word_id(word)}">{found[0]}</a>'

    return Markup(PROMISE.sub(linked, str(with_symbols(text))))


def word_id(name: str) -> str:
    """Where a word of the glossary stands on a page."""
    return f"word-{name.lower().replace(' ', '-')}"


def first_sentence(text: str) -> str:
    """A text up to the end of its first sentence that says something, its full stop included."""
    ends = [found.end() for found in re.finditer(r"(?<=[\w%)])\.(?= [A-Z])", text)]
    return next((text[:end] for end in ends if end >= SHORTEST), text)


def signs(arm: Arm) -> str:
    """The law and the sign of its moment gain, once a page; empty where there is no loop."""
    return sign_words(arm) if has_rate_loop(arm) else ""


def promises() -> Sequence[Term]:
    """The words of these pages that promise something."""
    return [term for term in GLOSSARY_TERMS if term.name in PROMISES]


def other_pages(folder: Path, writing: Sequence[str], page: str) -> Sequence[tuple[str, str]]:
    """(file, title) of the arm's other pages: those in its folder, and those written with this one."""
    names = {"index": "full report", **QUESTIONS}
    there = [name for name in names if name in writing or (folder / f"{name}.html").is_file()]
    return [(f"{name}.html", names[name]) for name in there if name != page]


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(symbol=with_symbols, explained=explained, word_id=word_id)
    return environment


def arm_page(
    subject: Subject,
    sections: Sequence[SavedSection],
    only: str | None,
    *,
    trust: str,
    live: bool,
    others: Sequence[tuple[str, str]],
) -> str:
    """The page of one arm, under its laws where they are given, with every section or with those of one question.

    `trust` is the page that says why it can be trusted, as seen from the arm's folder; empty if there is none.
    `live`: whether a live page is beside it.  `others` are the file and title of each other page of this arm.
    """
    arm = subject.arm
    title = f"{arm.name}: {QUESTIONS[only].lower()}" if only else arm.name
    shown = [framed(saved) for saved in sections]
    return render(
        "arm.html",
        title=title,
        arm=arm,
        framed=shown,
        rows=section_rows(shown),
        only=only,
        others=others,
        signs=signs(arm),
        glossary=promises(),
        trust=trust,
        live=live,
        summary=summary(arm, [each.name for each in subject.laws]),
        foot=foot(subject, only),
        has_proof=not (subject.laws and only),
    )


def index_page(cards: Sequence[Mapping[str, Any]], *, trust: str, compared: str = "") -> str:
    """The page that leads to all others; `compared` is the title of the comparison beside it, if there is one."""
    return render("index.html", title="tfarm reports", cards=cards, trust=trust, compared=compared, looks=BADGES)


def foot(subject: Subject, only: str | None) -> dict[str, str]:
    """What a reader needs to make the page again: version, hash of the arm's file, command."""
    sha256 = hashlib.sha256(file_of(subject).encode()).hexdigest()
    return {"sha256": sha256, "command": command_of(subject, only)}


def file_of(subject: Subject) -> str:
    """The arm's file with its chain, and with the law that the page is about where TOML can say that alone."""
    law = own_law(subject)
    return file_text(subject.arm, subject.chain) + ("" if law is None else f"\n{law}")


def own_law(subject: Subject) -> str | None:
    """The table [law] of the one law of a page; None where there are none or several, or that needs files beside it."""
    if len(subject.laws) != 1 or subject.laws[0].measured is not None:
        return None
    try:
        return law_toml(as_law(subject.laws[0].law))
    except ParameterError:
        return None


def command_of(subject: Subject, only: str | None) -> str:
    """The command that writes this page; an arm that is no preset is named by its file, as are laws beside it."""
    arm, chain, laws, *_ = subject
    law = own_law(subject)
    files = "" if law is not None else "".join(f" --law {shlex.quote(each.file or 'FILE')}" for each in laws)
    files += "".join(f" --measured {shlex.quote(f'{each.name}={each.source}')}" for each in subject.measured)
    choice = f"{files} --only {only}" if only else files
    return f"tfarm report {argument(arm.name, law is None and is_preset(arm, chain))}{choice} --out reports"


def command_for_all(arms: Sequence[tuple[str, bool]]) -> str:
    """The command that writes the pages of these arms, each a name and whether it is a preset."""
    if sorted(name for name, preset in arms if preset) == sorted(presets()) and all(preset for _, preset in arms):
        return "tfarm report --out reports"
    return f"tfarm report {' '.join(argument(name, preset) for name, preset in arms)} --out reports"


def is_preset(arm: Arm, chain: Chain) -> bool:
    """Whether the arm comes with tfarm, and its chain is the one that comes with it."""
    return arm.name in presets() and (load(arm.name), load_chain(arm.name)) == (arm, chain)


def argument(name: str, preset: bool) -> str:
    """How a command names an arm."""
    return shlex.quote(name if preset else f"{name}.toml")


def summary(arm: Arm, laws: Sequence[str] = ()) -> str:
    """The arm in one sentence, and the laws that its page is about in another."""
    hub = "a locked hub" if arm.is_locked else "a free pin" if arm.has_massless_hub else "a hub"
    tip = "with a payload" if arm.payload.mass or arm.payload.inertia else "without payload"
    tip = "its tip pinned" if math.isinf(arm.payload.mass) else tip
    damping = "undamped" if arm.is_undamped else "damped"
    link = f"A flexible link of {len(arm.links)} segments" if arm.outer else "A flexible link"
    hub = hub if arm.motor is None else f"{hub} with a motor"
    theory = "-".join(part.capitalize() for part in arm.theory.split("-"))
    under = f" Under {listed(laws)}." if laws else ""
    return f"{link} on {hub}, {tip}, {damping}; {theory} theory, exact.{under}"


def render(template: str, **values: Any) -> str:
    """A page from its template."""
    return _templates().get_template(template).render(version=tfarm.__version__, **values)
