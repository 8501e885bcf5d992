"""Every number in the tables of a page, and whether a value rounds to it in the digits shown."""

from __future__ import annotations

import html
import json
import math
import re
from dataclasses import dataclass

import numpy as np

POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
NUMBER = re.compile(
    r"(?<![\w.,^_⁰-⁹])(?P<sign>[−-](?=\d))?(?P<mantissa>\d+(?:\.\d+)?)"
    r"(?: × 10(?P<power>⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)|e(?P<e>[-+]?\d+))?(?![\w/²³]|\.\d)(?P<unit> ?(?:%|[a-zA-Z]+)(?![\w/]))?"
)
SCALES = {"Hz": (1.0, 1 / (2 * math.pi)), "%": (1.0, 100.0), "ms": (1.0, 1e3), "mm": (1.0, 1e3), "samples": (1.0,)}
ROUNDED = 1e-9  # of a number: what a double may miss of a tie, or two methods of each other


@dataclass(frozen=True)
class Shown:
    """A number on a page: its value, half a unit of its last digit, and the unit behind it."""

    value: float
    half: float
    unit: str

    def is_rounding_of(self, values):
        """Whether it is one of these values, in some unit that its own may mean, to the digits shown."""
        off = np.abs(np.multiply.outer(SCALES.get(self.unit, (1.0,)), values) - self.value)
        return bool((off <= self.half + ROUNDED * abs(self.value)).any())


def shown_in(text):
    """The numbers of a text, in their order."""
    found = []
    for number in NUMBER.finditer(text):
        mantissa, power = number["mantissa"], int((number["power"] or number["e"] or "0").translate(POWERS))
        digits = -len(mantissa.partition(".")[2]) or len(mantissa) - len(mantissa.rstrip("0")) * (len(mantissa) > 3)
        size, half = float(mantissa) * 10.0**power, 0.5 * 10.0 ** (power + (digits if digits < 0 else 0))
        found.append(Shown(-size if number["sign"] else size, half, (number["unit"] or "").strip()))
    return found


def tables_in(page):
    """The keys of the columns and the cells of the rows of each table of a page, by its stem."""
    found = {}
    for stem, table in re.findall(r'<figure id="table-([^"]*)">(.*?)</figure>', page, flags=re.DOTALL):
        head, _, body = table.partition("<tbody>")
        rows = (re.findall(r"<td[^>]*>(.*?)</td>", row, flags=re.DOTALL) for row in body.split("</tr>")[:-1])
        texts = [[re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", "", cell))) for cell in row] for row in rows]
        found[stem] = re.findall(r'data-key="([^"]*)"', head), texts
    return found


def numbers_of(answer):
    """Every number in an answer, those in its words too."""
    if isinstance(answer, bool) or answer is None:
        return []
    if isinstance(answer, int | float):
        return [float(answer)] * math.isfinite(answer)
    if isinstance(answer, str):
        return [each.value for each in shown_in(re.sub(r"(?<=\d)i\b", " i", answer))]
    parts = answer.values() if isinstance(answer, dict) else answer
    return [number for each in parts for number in numbers_of(each)]


def untraced_cells(keys, cells, rows, law):
    """The numbers in a table's cells that are no rounding of the value under their column's key in their row.

    A cell may name a gain of the `law` with its value ("0 … 5, not 77.7").
    """
    left = []
    for own, row in zip(cells, rows, strict=True):
        for key, cell in zip(keys, own, strict=True):
            values = numbers_of(row[key]) + (law if ", not " in cell else [])
            bare = re.sub(r"\(±[^)]*\)", "", cell)  # without the error that rounding leaves
            shown = shown_in(re.sub(r"− (?=\S+(?: × \S+)? i\b)", "−", bare))  # of an imaginary part
            left += [(key, cell, each.value) for each in shown if not each.is_rounding_of(values)]
    return left


def read(file):
    """A JSON file."""
    return json.loads(file.read_text(encoding="utf-8"))
