"""What stands around the sections of an arm's page: the answers in short, contents with verdicts, signs, a glossary."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from tfarm.arm import Arm
from tfarm.glossary import GLOSSARY_TERMS, Term
from tfarm.report.loop_laws import has_rate_loop, sign_words
from tfarm.report.pieces import ARM_PIECES, LAW_PIECES, QUESTIONS
from tfarm.report.sections import SavedBlock, SavedSection
from tfarm.tables.html import with_symbols

SHORTEST = 40  # characters of an answer; one that is shorter takes the next sentence too
ANSWERS = {piece.anchor for piece in (*ARM_PIECES, *LAW_PIECES) if piece.is_answer}
BADGES = {"stable": "ok", "yes": "ok", "unstable": "corrected", "no": "corrected", "marginal": "undecided",
            "undecided": "undecided"}  # fmt: skip
OPEN_PICTURES = 2  # of a section: those that answer its question; the rest is a click away
FOLDED_SECTIONS = ("assumptions",)  # sections whose pictures are for those who ask further
PROMISES = ("certified", "complete", "enclosed", "Lyapunov region", "proven", "settled", "small gain", "winding number",
        "band", "window", "default gains")  # fmt: skip
PLAIN_WORDS = ("band", "window")  # of these: too common in another sense to lead to their meaning wherever they stand
PROMISE = re.compile(rf"\b(?:{'|'.join(name for name in PROMISES if name not in PLAIN_WORDS)})\b", re.IGNORECASE)
ABREAST = ("bode-root-moment", "bode-tip-displacement")  # sections of one picture each that stand beside each other


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
