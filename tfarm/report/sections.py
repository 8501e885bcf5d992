"""What a page is made of: sections of texts, pictures and tables, each saved before the page is written.

Texts are in templates/prose.txt, pages in the other templates; here is how both are filled in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

import tfarm
from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN
from tfarm.digits import how_many, listed, plain, scientific, significant
from tfarm.plots.style import save_figure
from tfarm.schema import Table, save_table, text
from tfarm.schema.html import as_html, with_symbols

if TYPE_CHECKING:
    from tfarm.plots.style import Figure

TEMPLATES = Path(__file__).parent / "templates"
PICTURES, DATA = "pictures", "data"  # folders in that of an arm


def upper(text: str) -> str:
    """A text as it begins a sentence."""
    return text[:1].upper() + text[1:]


@cache
def templates() -> Environment:
    """All templates; only those of pages escape what is put into them."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=lambda name: name is not None and name.endswith(".html"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals |= {"inf": math.inf, "rate": RATE_GAIN, "moment": MOMENT_GAIN, "angle": ANGLE_GAIN,
                            "plane": " and ".join(PLANE)}  # fmt: skip
    environment.filters.update(
        symbol=with_symbols, text=text, plain=plain, significant=significant, scientific=scientific, upper_first=upper,
        listed=listed, how_many=how_many,
    )  # fmt: skip
    return environment


@cache
def _texts() -> Any:
    """All texts by name; a line break behind a tag is a space in them."""
    return templates().overlay(trim_blocks=False).get_template("prose.txt").module


def prose(name: str, /, **values: Any) -> str:
    """The text of that name in templates/prose.txt with these values."""
    return " ".join(getattr(_texts(), name)(**values).split())


def render(template: str, **values: Any) -> str:
    """A page from its template."""
    return templates().get_template(template).render(version=tfarm.__version__, **values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact:
    """One headline number, or the word for it."""

    label: str
    value: str
    unit: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A finished figure with its words.  `stem` names its files; `data` are the numbers that it draws."""

    stem: str
    title: str
    caption: str
    alt: str
    figure: Figure
    data: Table | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height on the page [CSS pixels], at 96 an inch."""
        width, height = self.figure.get_size_inches() * 96
        return round(width), round(height)


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSection:
    """A part of a page.  `answer` is its result in a sentence or two, at the top of the full page too.

    `words` are paragraphs, `items` a list; `blocks` pictures and tables.
    `failure` is the reason why the section could not be made, which its words have too; empty otherwise.
    """

    anchor: str
    title: str
    answer: str = ""
    words: Sequence[str] = ()
    items: Sequence[str] = ()
    facts: Sequence[Fact] = ()
    blocks: Sequence[Picture | Table] = ()
    failure: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedBlock:
    """A picture or table as the page refers to it, its files saved."""

    stem: str
    title: str
    caption: str
    table: Markup | None = None
    alt: str = ""
    size: tuple[int, int] = (0, 0)
    files: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedSection:
    """A section without its figures: what remains to be written are words."""

    section: PageSection
    blocks: tuple[SavedBlock, ...]


def save_section(section: PageSection, folder: Path) -> SavedSection:
    """Every picture as pictures/*.svg, its numbers as data/*.csv; every table as data/*.csv and .json."""
    for name in (PICTURES, DATA):
        (folder / name).mkdir(exist_ok=True)
    blocks = []
    for block in section.blocks:
        words: dict[str, Any] = {"stem": block.stem, "title": block.title, "caption": block.caption}
        if isinstance(block, Table):
            files = [f"{DATA}/{name}" for name in save_table(block, folder / DATA)]
            blocks.append(SavedBlock(**words, table=as_html(block), files=tuple(files)))
            continue
        save_figure(block.figure, folder / PICTURES, block.stem, formats=("svg",))
        files = [f"{PICTURES}/{block.stem}.svg"]
        if block.data is not None:
            files += [f"{DATA}/{name}" for name in save_table(block.data, folder / DATA, kinds=("csv",))]
        blocks.append(SavedBlock(**words, alt=block.alt, size=block.size, files=tuple(files)))
    return SavedSection(section=replace(section, blocks=()), blocks=tuple(blocks))
