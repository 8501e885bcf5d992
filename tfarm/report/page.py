"""Pages from sections: HTML by templates, everything inline, nothing fetched."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

import tfarm
from tfarm.arm import Arm, load, presets
from tfarm.dsp import Chain, load_chain
from tfarm.report.sections import Fact, SavedSection
from tfarm.report.trust_proofs import hash_of
from tfarm.tables.html import symbol

TEMPLATES = Path(__file__).parent / "templates"
QUESTIONS = {
    "bode": "Bode plots",
    "modes": "Modes",
    "margins": "Gains and margins",
    "locus": "Root loci",
    "sampled": "The sampled loop",
    "tune": "The gain tuner",
    "assumptions": "What the assumptions do",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """An arm on the index: its folder's name, a few numbers, its pages and whether there is a picture."""

    name: str
    summary: str
    facts: Sequence[Fact]
    pages: Sequence[tuple[str, str]]
    picture: str


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
    environment.filters["symbol"] = symbol
    return environment


def arm_page(arm: Arm, chain: Chain, sections: Sequence[SavedSection], only: str | None, *, trust: str) -> str:
    """The page of one arm, with every section or with those of one question.

    `trust` is the page that says why it can be trusted, as seen from the arm's folder; empty if there is none.
    """
    title = f"{arm.name}: {QUESTIONS[only].lower()}" if only else arm.name
    return render(
        "arm.html",
        title=title,
        arm=arm,
        sections=sections,
        only=only,
        trust=trust,
        summary=summary(arm),
        foot=foot(arm, chain, only),
    )


def index_page(cards: Sequence[Card], *, trust: str) -> str:
    """The page that leads to all others."""
    return render("index.html", title="tfarm reports", cards=cards, trust=trust)


def foot(arm: Arm, chain: Chain, only: str | None) -> dict[str, str]:
    """What a reader needs to make the page again: version, hash of the arm's file, command."""
    return {"sha256": hash_of(arm, chain), "command": command(arm, chain, only)}


def command(arm: Arm, chain: Chain, only: str | None) -> str:
    """The command that writes this page; an arm that is no preset is named by its file."""
    choice = f" --only {only}" if only else ""
    return f"tfarm report {_argument(arm.name, is_preset(arm, chain))}{choice} --out reports"


def command_for_all(arms: Sequence[tuple[str, bool]]) -> str:
    """The command that writes the pages of these arms, each a name and whether it is a preset."""
    if sorted(name for name, preset in arms if preset) == sorted(presets()) and all(preset for _, preset in arms):
        return "tfarm report --out reports"
    return f"tfarm report {' '.join(_argument(name, preset) for name, preset in arms)} --out reports"


def is_preset(arm: Arm, chain: Chain) -> bool:
    """Whether the arm comes with tfarm, and its chain is the one that comes with it."""
    return arm.name in presets() and (load(arm.name), load_chain(arm.name)) == (arm, chain)


def _argument(name: str, preset: bool) -> str:
    return shlex.quote(name if preset else f"{name}.toml")


def summary(arm: Arm) -> str:
    """The arm in one sentence."""
    hub = "a locked hub" if arm.is_locked else "a free pin" if arm.has_massless_hub else "a hub"
    tip = "with a payload" if arm.payload.mass or arm.payload.inertia else "without payload"
    tip = "its tip pinned" if math.isinf(arm.payload.mass) else tip
    damping = "undamped" if arm.is_undamped else "damped"
    link = f"A flexible link of {len(arm.links)} segments" if arm.outer else "A flexible link"
    hub = hub if arm.motor is None else f"{hub} with a motor"
    theory = "-".join(part.capitalize() for part in arm.theory.split("-"))
    return f"{link} on {hub}, {tip}, {damping}; {theory} theory, exact."


def render(template: str, **values: Any) -> str:
    """A page from its template."""
    return _templates().get_template(template).render(version=tfarm.__version__, **values)
