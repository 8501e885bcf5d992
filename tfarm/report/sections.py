"""What a page is made of: sections of pictures and tables, each finished and saved before the page is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from tfarm.columns import Table
from tfarm.plots.files import save_figure
from tfarm.tables.files import save_table
from tfarm.tables.html import as_html

if TYPE_CHECKING:
    from tfarm.plots.style import Figure


PICTURES, DATA = "pictures", "data"  # the folders of an arm's folder, beside its pages


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact:
    """One headline number, or the word for it."""

    label: str
    value: str
    unit: str = ""
    beside: str = ""


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
    """A part of a page.  `words` are paragraphs, `items` a list; `blocks` pictures and tables.

    `failure` says why the section could not be made, where the words say so in its place; empty otherwise.
    """

    anchor: str
    title: str
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
            files = _below(DATA, save_table(block, folder / DATA))
            blocks.append(SavedBlock(**words, table=as_html(block), files=files))
            continue
        save_figure(block.figure, folder / PICTURES, block.stem, formats=("svg",))
        files = _below(PICTURES, [f"{block.stem}.svg"])
        if block.data is not None:
            files += _below(DATA, save_table(block.data, folder / DATA, kinds=("csv",)))
        blocks.append(SavedBlock(**words, alt=block.alt, size=block.size, files=files))
    return SavedSection(section=replace(section, blocks=()), blocks=tuple(blocks))


def _below(folder: str, names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{folder}/{name}" for name in names)
