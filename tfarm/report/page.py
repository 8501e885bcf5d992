"""Pages from sections: HTML by templates, everything inline, nothing fetched."""

from __future__ import annotations

import hashlib
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

import tfarm
from tfarm.arm import Arm, as_law, load, presets
from tfarm.arm.writing import law_toml
from tfarm.digits import listed
from tfarm.dsp import Chain, load_chain
from tfarm.dsp.chain import file_text
from tfarm.errors import ParameterError
from tfarm.report.frame import BADGES, explained, framed, promises, section_rows, signs, word_id
from tfarm.report.given_laws import Subject
from tfarm.report.pieces import QUESTIONS
from tfarm.report.sections import Fact, SavedSection
from tfarm.tables.html import with_symbols

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """An arm on the index: its folder's name, a few numbers, its pages and whether there is a picture.

    `loops` are rows of cells in the table of arms, one a law that its page is about, else of the default gains; all ""
    where there is no loop.
    """

    name: str
    summary: str
    facts: Sequence[Fact]
    pages: Sequence[tuple[str, str]]
    picture: str
    loops: Sequence[Mapping[str, str]]


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
        summary=summary(arm, [each.given_name for each in subject.laws]),
        foot=foot(subject, only),
        has_proof=not (subject.laws and only),
    )


def index_page(cards: Sequence[Card], *, trust: str, compared: str = "") -> str:
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
