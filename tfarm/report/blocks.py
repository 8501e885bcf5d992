"""What a page is made of: texts, pictures and tables, saved before it is written.

Texts are in templates/prose.txt, pages in the other templates; here is how both are filled in.
"""

import json
import math
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from pydantic import TypeAdapter

import tfarm
from tfarm.arm import ANGLE_GAIN, LISTED, MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, load, presets
from tfarm.assessment.card import LoopCard
from tfarm.digits import how_many, join_words, kept_digits, plain, scientific, significant
from tfarm.plots.files import save_figure
from tfarm.plots.style import Figure, drawn_for
from tfarm.schema import Column, Table, quantities, save_table, table, text, to_json
from tfarm.schema.html import as_html, with_symbols

TEMPLATES = Path(__file__).parent / "templates"
# folders in that of an arm
PICTURES = "pictures"
DATA = "data"
PageRecord = TypeVar("PageRecord")
# between title and caption, which no name has in it
PART = "\ue000"
PROMISES = (
    "certified",
    "complete",
    "converged",
    "default gains",
    "enclosed",
    "Lyapunov region",
    "not determined",
    "proven",
    "small gain",
    "winding number",
)


# ------------------------------------------------------------ texts


def upper(text: str) -> str:
    """Return a text as it begins a sentence."""
    return text[:1].upper() + text[1:]


@cache
def templates() -> Environment:
    """Return all templates; only those of pages escape what is put into them."""
    # but for those of a pill
    without = ("stability", "grade", "limited_by", "delay_margin_periods")
    card_rows = {of.key: of for name, of in quantities(LoopCard).items() if name not in without}
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=lambda name: name is not None and name.endswith(".html"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals |= {
        "inf": math.inf,
        "rate": RATE_GAIN,
        "moment": MOMENT_GAIN,
        "angle": ANGLE_GAIN,
        "plane": " and ".join(PLANE),
        "arm_python": arm_python,
        "gains_python": gains_python,
        "card_rows": card_rows,
    }
    environment.filters.update(
        symbol=with_symbols,
        text=text,
        plain=plain,
        significant=significant,
        scientific=scientific,
        upper_first=upper,
        listed=join_words,
        how_many=how_many,
        as_html=as_html,
    )
    return environment


@cache
def _texts() -> Any:
    """Return all texts by name; a line break behind a tag is a space in them."""
    source = (TEMPLATES / "prose.txt").read_text(encoding="utf-8").replace("¶", PART)
    return templates().overlay(trim_blocks=False).from_string(source).module


def prose(name: str, /, **values: Any) -> str:
    """Return the text of that name in templates/prose.txt with these values."""
    return " ".join(getattr(_texts(), name)(**values).split())


def _parts(name: str, values: dict[str, Any]) -> list[str]:
    return [part.strip() for part in prose(name, **values).split(PART)]


def render(template: str, **values: Any) -> str:
    """Return a page from its template."""
    return templates().get_template(template).render(version=tfarm.__version__, **values)


def arm_python(arm: Arm) -> str:
    """Python that loads an arm: by its name where it comes with tfarm, else from the file in the folder of its page."""
    name = arm.name if arm.name in presets() and load(arm.name) == arm else "arm.toml"
    return f"tfarm.load({json.dumps(name)})"


def gains_python(gains: HubFeedback) -> str:
    """Return the Python that makes gains at the hub."""
    values = {gain.name: float(gains[gain.name]) for gain in LISTED}
    return f"tfarm.HubFeedback({', '.join(f'{name}={value!r}' for name, value in values.items() if value)})"


def argument(name: str, preset: bool) -> str:
    """Return the name of an arm in a command."""
    return shlex.quote(name if preset else f"{name}.toml")


class Fact(NamedTuple):
    """One headline number, or the word for it."""

    label: str
    value: str
    unit: str = ""
    note: str = ""


class Picture(NamedTuple):
    """A finished figure with its words.  `stem` names its files; `data` are the numbers that it draws.

    `film` is a GIF, whose still picture is the figure.  `python` is the line of Python that draws it, empty where no
    public function does.
    """

    stem: str
    title: str
    caption: str
    alt: str
    figure: Figure
    data: tuple[Column, ...] = ()
    python: str = ""
    film: bytes = b""


def picture_block(
    kind: str, figure: Figure, *, data: Table | Iterable[Column] = (), stem: str = "", **values: Any
) -> Picture:
    """Return a picture with title, caption, alternative text and line of Python of its kind; `stem` names its files."""
    title, caption, alt, *python = _parts(kind, values)
    return Picture(
        stem or kind.replace("_", "-"), title, caption, alt, figure, _columns(data), "".join(python)
    )


def sheet(kind: str, columns: Table | Iterable[Column], /, *, stem: str = "", **values: Any) -> Table:
    """Return a table with the title and the caption of its kind; `stem` names its files."""
    title, caption = _parts(kind, values)
    return Table(columns=_columns(columns), stem=stem or kind.replace("_", "-"), title=title, caption=caption)


def record_sheet(kind: str, records: Any, /, *, stem: str = "", **values: Any) -> Table:
    """Return a table of records, a row each, with the title and the caption of its kind."""
    return sheet(kind, table(records), stem=stem, **values)


def _columns(of: Table | Iterable[Column]) -> tuple[Column, ...]:
    return of.columns if isinstance(of, Table) else tuple(of)


def columns_of(keys: Sequence[str], rows: Iterable[Sequence[Any]]) -> list[Column]:
    """Return the columns of these rows, as the data of a picture have them."""
    return [Column(key, of=of) for key, of in zip(keys, zip(*rows, strict=True), strict=True)]


class SavedBlock(NamedTuple):
    """A picture or table as the page shows it, its files saved; `image` is the picture without words."""

    stem: str
    title: str
    html: Markup
    image: Markup | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSection:
    """A part of a page.  `answer` is its result in a sentence or two, `card` the loops of a controller of its own.

    `words` are paragraphs, `items` a list; `blocks` pictures and tables, of which one without columns is not shown.
    `failure` is the reason why the section could not be made, which its words have too; empty otherwise.
    """

    anchor: str = ""
    title: str = ""
    answer: str = ""
    words: Sequence[str] = ()
    items: Sequence[str] = ()
    facts: Sequence[Fact] = ()
    card: Sequence[Mapping[str, Any]] = ()
    blocks: Sequence[Any] = ()
    failure: str = ""


def save_section(section: PageSection, folder: Path, is_paper: bool = False) -> PageSection:
    """Return the section with its blocks saved: what remains to be written are words."""
    for name in (PICTURES, DATA):
        (folder / name).mkdir(exist_ok=True)
    blocks = [block for block in section.blocks if getattr(block, "columns", True)]
    return replace(section, blocks=[save_block(block, folder, is_paper) for block in blocks])


def save_block(block: Picture | Table, folder: Path, is_paper: bool = False) -> SavedBlock:
    """Save a picture as pictures/*.svg, for a paper *.pdf too, its data as data/*.csv; a table as data/*.csv and .json.

    Of a picture there is a narrow one for phones, *-narrow.svg; a film is small enough.
    """
    shape: Any = templates().get_template("blocks.html").module
    if isinstance(block, Table):
        files = [f"{DATA}/{name}" for name in save_table(block, folder / DATA)]
        return SavedBlock(block.stem, block.title, shape.table(block, files))
    files = [f"{PICTURES}/{block.stem}.svg"]
    save_figure(block.figure, folder / files[0])
    again = block.figure.again  # type: ignore[attr-defined]
    narrow = None
    if not block.film:
        with drawn_for("phone"):
            narrow = again()
            save_figure(narrow, folder / PICTURES / f"{block.stem}-narrow.svg")
    if is_paper:
        files.append(f"{PICTURES}/{block.stem}.pdf")
        with drawn_for("column"):
            save_figure(again(), folder / files[-1])
    if block.film:
        files.append(f"{PICTURES}/{block.stem}.gif")
        (folder / files[-1]).write_bytes(block.film)
    if block.data:
        columns = tuple(replace(each, of=list(map(drawn_number, each.of))) for each in block.data)
        saved = save_table(Table(columns=columns, stem=f"{block.stem}-data"), folder / DATA, ("csv",))
        files += [f"{DATA}/{name}" for name in saved]
    return SavedBlock(
        block.stem, block.title, shape.picture(block, files, narrow), shape.image(block, narrow)
    )


def drawn_number(x: Any, digits: int = 7) -> Any:
    """Return a number of a picture as its file has it: a hundredth of the width of a line is four digits."""
    if isinstance(x, float):
        return kept_digits((x,), digits)[0]
    return x


def explain_commands(text: str, words: str = "") -> Markup:
    """Return a sentence as a page shows it, commands in `...`; a promise leads to its meaning on the page `words`."""
    shown = re.sub("`(.+?)`", r"<code>\1</code>", str(with_symbols(text)))
    for word in PROMISES if words else ():
        linked = rf'<a class="term" href="{words}#{anchor("word", word)}">\g<0></a>'
        shown = re.sub(rf"\b{word}\b", linked, shown, count=1, flags=re.IGNORECASE)
    return Markup(shown)


def anchor(kind: str, name: str) -> str:
    """Return a name for links: the equation "(A.1)" becomes "eq-a-1"."""
    return f"{kind}-{re.sub(r'[^a-z0-9]+', '-', name.lower()).strip('-')}"


def write_text(file: Path, text: str) -> None:
    """Write a file of text, the same bytes on every system."""
    file.write_text(text, encoding="utf-8", newline="")


# ------------------------------------------------------------ what an index reads in the folders of arms


def keep(folder: Path, kind: str, content: Mapping[str, Any]) -> None:
    """kind.json, with a mark of what it is."""
    text = to_json({f"tfarm_{kind}": 1, **content}, ensure_ascii=False, indent=1)
    write_text(folder / f"{kind}.json", f"{text}\n")


def kept_in(folder: Path, kind: str, record: type[PageRecord]) -> PageRecord | None:
    """Return the record in a folder's kind.json; None where there is none, or none of ours."""
    try:
        return TypeAdapter(record).validate_json((folder / f"{kind}.json").read_bytes())
    except (OSError, ValueError):
        return None


def read_records(out: Path, kind: str, record: type[PageRecord]) -> dict[Path, PageRecord]:
    """Return the records of that kind in the folders of arms, by folder; what is none of ours is passed over."""
    found: dict[Path, PageRecord] = {}
    for folder in sorted(out.iterdir(), key=lambda folder: folder.name):
        if folder.is_dir() and not folder.name.startswith("."):
            each = kept_in(folder, kind, record)
            if each is not None and getattr(each, "name", "") == folder.name:
                found[folder] = each
    return found
