"""What a page is made of: sections of words, pictures and tables, each saved before the page is written."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from tfarm.columns import Table
from tfarm.crossing import Window
from tfarm.digits import plain, significant
from tfarm.dsp.chain import Chain
from tfarm.dsp.crossings import around
from tfarm.plots.style import save_figure
from tfarm.tables.files import save_table
from tfarm.tables.html import as_html

if TYPE_CHECKING:
    from tfarm.plots.style import Figure

EVERYWHERE = (-math.inf, math.inf)  # gains of any size: an interval that has no end but its own
TYPESET = {
    "theta_t^2": "(dθ/dt)²", "theta_t": "dθ/dt", "phi_xt(0)": "∂φ′(0)/∂t", " theta": " θ", "phi'(0)": "φ′(0)",
    "L(iw)": "L(iω)", "J w1": "J ω₁",
    "(alpha_c, eta_c)": "momentum and learning rate",
}  # fmt: skip
POWER_WRITTEN, MINUS_WRITTEN = re.compile(r"\d(?:\.\d+)?e[-+]\d+"), re.compile(r"(?<= )-(?= ?[\w(])")
PICTURES, DATA = "pictures", "data"  # the folders of an arm's folder, beside its pages


def typeset(text: str) -> str:
    """A sentence of the rooms below as a page shows it: Greek letters, powers of ten, and minus signs."""
    for plain_text, shown in TYPESET.items():
        text = text.replace(plain_text, shown)
    return MINUS_WRITTEN.sub("−", POWER_WRITTEN.sub(lambda number: plain(float(number[0])), text))


def residual_words(rms: float | None) -> str:
    """The root moment left after a slew [N m]; None where the loop ran away."""
    return "not computed (the loop ran away)" if rms is None else f"{significant(rms, 3)} N m rms"


def upper(text: str) -> str:
    """A text as it begins a sentence."""
    return text[:1].upper() + text[1:]


def in_ms(chain: Chain) -> str:
    """The sampling period in ms."""
    return plain(1e3 * chain.sampling.period)


def spans(windows: Sequence[Window], gain: float, here: Window | None = None) -> str:
    """The interval around a gain in a few digits, or the others where there is none around it."""
    here = here or around(list(windows), gain)
    if here is not None:
        return span(here)
    others = " or ".join(span(window) for window in windows)
    return f"{others}, not {plain(gain, 3)}" if others else "none"


def span(window: Window | None, looked_at: Window = EVERYWHERE) -> str:
    """An interval of a gain in a few digits; an end of what was looked at is no end."""
    if window is None:
        return "none"
    low, high = window
    no_low, no_high = low <= looked_at[0], high >= looked_at[1]
    if no_low:
        return "any" if no_high else f"< {significant(high, 4)}"
    lower = f"{low:.2g}".replace("-", "−") if 1e-4 < abs(low) < 1e-3 else significant(low, 3)
    return f"> {lower}" if no_high else f"{lower} … {significant(high, 4)}"


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
