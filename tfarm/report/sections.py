"""What a page is made of: sections of texts, pictures and tables, each saved before the page is written.

Texts are in templates/prose.txt, pages in the other templates; here is how both are filled in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from pydantic import TypeAdapter

import tfarm
from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN
from tfarm.digits import how_many, listed, plain, scientific, significant
from tfarm.plots.style import Figure, save_figure
from tfarm.schema import Column, Table, save_table, text
from tfarm.schema.html import as_html, with_symbols

TEMPLATES = Path(__file__).parent / "templates"
PICTURES, DATA = "pictures", "data"  # folders in that of an arm
T = TypeVar("T")
PART = "\ue000"  # between title and caption, which no name has in it


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
        listed=listed, how_many=how_many, as_html=as_html,
    )  # fmt: skip
    return environment


@cache
def _texts() -> Any:
    """All texts by name; a line break behind a tag is a space in them."""
    source = (TEMPLATES / "prose.txt").read_text(encoding="utf-8").replace("¶", PART)
    return templates().overlay(trim_blocks=False).from_string(source).module


def prose(name: str, /, **values: Any) -> str:
    """The text of that name in templates/prose.txt with these values."""
    return " ".join(getattr(_texts(), name)(**values).split())


def _parts(name: str, values: dict[str, Any]) -> list[str]:
    return [part.strip() for part in prose(name, **values).split(PART)]


def render(template: str, **values: Any) -> str:
    """A page from its template."""
    return templates().get_template(template).render(version=tfarm.__version__, **values)


class Fact(NamedTuple):
    """One headline number, or the word for it."""

    label: str
    value: str
    unit: str = ""
    note: str = ""


class Picture(NamedTuple):
    """A finished figure with its words.  `stem` names its files; `data` are the numbers that it draws."""

    stem: str
    title: str
    caption: str
    alt: str
    figure: Figure
    data: tuple[Column, ...] = ()


def picture(
    kind: str, figure: Figure, *, data: Table | Iterable[Column] = (), stem: str = "", **values: Any
) -> Picture:
    """A picture with the title, the caption and the alternative text of its kind; `stem` names its files."""
    title, caption, alt = _parts(kind, values)
    return Picture(stem or kind.replace("_", "-"), title, caption, alt, figure, _columns(data))


def sheet(kind: str, columns: Table | Iterable[Column], /, *, stem: str = "", **values: Any) -> Table:
    """A table with the title and the caption of its kind; `stem` names its files."""
    title, caption = _parts(kind, values)
    return Table(columns=_columns(columns), stem=stem or kind.replace("_", "-"), title=title, caption=caption)


def _columns(of: Table | Iterable[Column]) -> tuple[Column, ...]:
    return of.columns if isinstance(of, Table) else tuple(of)


class SavedBlock(NamedTuple):
    """A picture or table as the page shows it, its files saved."""

    stem: str
    title: str
    is_table: bool
    html: Markup


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSection:
    """A part of a page.  `answer` is its result in a sentence or two, at the top of the full page too.

    `words` are paragraphs, `items` a list; `blocks` pictures and tables, of which one without columns is not shown.
    `failure` is the reason why the section could not be made, which its words have too; empty otherwise.
    """

    anchor: str = ""
    title: str = ""
    answer: str = ""
    words: Sequence[str] = ()
    items: Sequence[str] = ()
    facts: Sequence[Fact] = ()
    blocks: Sequence[Any] = ()
    failure: str = ""


def save_section(section: PageSection, folder: Path) -> PageSection:
    """The section with its blocks saved: what remains to be written are words."""
    for name in (PICTURES, DATA):
        (folder / name).mkdir(exist_ok=True)
    shown = [block for block in section.blocks if getattr(block, "columns", True)]
    return replace(section, blocks=[save_block(block, folder) for block in shown])


def save_block(block: Picture | Table, folder: Path) -> SavedBlock:
    """A picture as pictures/*.svg, its numbers as data/*.csv; a table as data/*.csv and .json."""
    shape: Any = templates().get_template("blocks.html").module
    is_table = isinstance(block, Table)
    if isinstance(block, Table):
        html = shape.table(block, [f"{DATA}/{name}" for name in save_table(block, folder / DATA)])
    else:
        save_figure(block.figure, folder / PICTURES, block.stem, formats=("svg",))
        numbers = Table(columns=block.data, stem=f"{block.stem}-data")
        saved = save_table(numbers, folder / DATA, kinds=("csv",)) if block.data else ()
        html = shape.picture(block, [f"{PICTURES}/{block.stem}.svg", *(f"{DATA}/{name}" for name in saved)])
    return SavedBlock(block.stem, block.title, is_table, html)


def write_text(file: Path, text: str) -> None:
    """A file of text, the same bytes on every system."""
    file.write_text(text, encoding="utf-8", newline="")


# ------------------------------------------------------------ what an index reads in the folders of arms


def keep(folder: Path, kind: str, content: Mapping[str, Any]) -> None:
    """kind.json, with a mark of what it is."""
    text = json.dumps({f"tfarm_{kind}": 1, **content}, ensure_ascii=False, indent=1) + "\n"
    write_text(folder / f"{kind}.json", text)


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
