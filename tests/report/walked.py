"""Every number that a page shows, with the text around it, and whether a value rounds to it in the digits shown."""

from __future__ import annotations

import io
import json
import math
import re
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, field
from html.parser import HTMLParser

import numpy as np

from tfarm.cli import main

VOID = {"meta", "img", "br", "link", "input"}
TEXTS = {"p", "figcaption", "li", "dt", "dd", "h2", "h3", "summary", "td", "th", "a"}  # what is read as one text
POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
NUMBER = re.compile(
    r"(?<![\w.,^_⁰-⁹])(?P<sign>[−-](?=\d))?(?P<mantissa>\d+(?:\.\d+)?)"
    r"(?: × 10(?P<power>⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)|e(?P<e>[-+]?\d+))?(?![\w/²³]|\.\d)(?P<unit> ?(?:%|[a-zA-Z]+)(?![\w/]))?"
)
SCALES = {"Hz": (1.0, 1 / (2 * math.pi)), "%": (1.0, 100.0), "ms": (1.0, 1e3), "mm": (1.0, 1e3), "samples": (1.0,)}
ROUNDED = 1e-9  # of a number: what a double may miss of a tie, and two roads to it of each other


@dataclass(frozen=True)
class Shown:
    """A number on a page: its value, half a unit of its last digit, the unit behind it, and the text around it."""

    value: float
    half: float
    unit: str
    where: str

    def is_rounding_of(self, values):
        """Whether it is one of these values, in some unit that its own stands for, to the digits shown."""
        off = np.abs(np.multiply.outer(SCALES.get(self.unit, (1.0,)), values) - self.value)
        return bool((off <= self.half + ROUNDED * abs(self.value)).any())


def shown_in(text, where=""):
    """The numbers of a text, in their order."""
    found = []
    for number in NUMBER.finditer(text):
        mantissa, power = number["mantissa"], int((number["power"] or number["e"] or "0").translate(POWERS))
        digits = -len(mantissa.partition(".")[2]) or len(mantissa) - len(mantissa.rstrip("0")) * (len(mantissa) > 3)
        size = float(mantissa) * 10.0**power
        around = text[max(0, number.start() - 50) : number.end() + 25]
        half = 0.5 * 10.0 ** (power + (digits if digits < 0 else 0))
        found.append(Shown(-size if number["sign"] else size, half, (number["unit"] or "").strip(), where or around))
    return found


@dataclass
class Sheet:
    """A table: the keys of its columns, the cells of its rows."""

    keys: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


@dataclass
class Part:
    """A section: its anchor, its texts, its tables by their stems, and the names of its files."""

    anchor: str
    texts: list[str] = field(default_factory=list)
    tables: dict[str, Sheet] = field(default_factory=dict)
    files: list[str] = field(default_factory=list)


class Walk(HTMLParser):
    """The sections of a page, in `parts`; what stands outside them is one called ""."""

    def __init__(self, page):
        super().__init__()
        self.parts, self.open, self.text, self.sheet, self.hidden = [Part("")], [], None, None, 0
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "img":
            self.parts[-1].texts.append(attributes.get("alt", ""))
        if tag in VOID:
            return
        self.open.append(tag)
        if tag == "section":
            self.parts.append(Part(attributes["id"]))
        if tag in ("figure",) and attributes.get("id", "").startswith("table-"):
            self.sheet = self.parts[-1].tables.setdefault(attributes["id"].removeprefix("table-"), Sheet())
        if tag == "tr" and self.sheet is not None and "tbody" in self.open:
            self.sheet.rows.append([])
        if self.sheet is not None and attributes.get("data-key"):
            self.sheet.keys.append(attributes["data-key"])
        if tag == "a" and "data/" in attributes.get("href", ""):
            self.parts[-1].files.append(attributes["href"].partition("data/")[2])
        if tag in TEXTS and self.text is None:
            self.text = (tag, len(self.open), [])

    def handle_endtag(self, tag):
        if self.text is not None and len(self.open) == self.text[1] and tag == self.text[0]:
            said = re.sub(r"\s+", " ", "".join(self.text[2])).strip()
            if tag == "td" and self.sheet is not None and "tbody" in self.open:
                self.sheet.rows[-1].append(said)
            elif said:
                self.parts[-1].texts.append(said)
            self.text = None
        if tag == "figure":
            self.sheet = None
        while self.open and self.open.pop() != tag:
            pass
        if tag == "section":
            self.parts.append(Part(""))

    def handle_data(self, data):
        if self.text is not None:
            self.text[2].append(data)


LONG = 64  # entries of a list from which it is a curve: of that only length, ends, and extremes are taken


def numbers_of(answer):
    """Every number in an answer, those in its words too; of a curve its length, ends and extremes."""
    if isinstance(answer, bool) or answer is None:
        return []
    if isinstance(answer, int | float):
        return [float(answer)] * math.isfinite(answer)
    if isinstance(answer, str):
        return [each.value for each in shown_in(re.sub(r"(?<=\d)i\b", " i", answer))]
    if isinstance(answer, dict):
        return [number for each in answer.values() for number in numbers_of(each)]
    parts = [numbers_of(each) for each in answer]
    every = [number for part in parts for number in part]
    if len(answer) <= LONG or not every:
        return [*every, float(len(answer))]
    ends = [parts[0], parts[-1], *([min(column), max(column)] for column in zip(*parts, strict=False))]
    return [*(number for part in ends for number in part), float(len(answer))]


def untraced_cells(sheet, rows, law):
    """The numbers in a table's cells that are no rounding of the value under their column's key in their row.

    A cell may name a gain of the `law` beside its value ("0 … 5, not 77.7").
    """
    left = []
    for cells, row in zip(sheet.rows, rows, strict=True):
        for key, cell in zip(sheet.keys, cells, strict=True):
            values = numbers_of(row[key]) if key in row else numbers_of(list(row.values()))
            values += law if ", not " in cell else []
            bare = re.sub(r"\(±[^)]*\)", "", cell)  # without the error that rounding leaves
            shown = shown_in(re.sub(r"− (?=\S+(?: × \S+)? i\b)", "−", bare))  # of an imaginary part
            left += [(key, cell, each.value) for each in shown if not each.is_rounding_of(values)]
    return left


def read(file):
    """A JSON file."""
    return json.loads(file.read_text(encoding="utf-8"))


def told(*words):
    """What a command answers with --json, in this process."""
    out = io.StringIO()
    with redirect_stdout(out), suppress(SystemExit):
        main([*words, "--json"])
    return json.loads(out.getvalue())
