"""The tables of written pages: their CSV and JSON are one, their cells roundings of these, their numbers the API's."""

from __future__ import annotations

import csv
import html
import json
import math
import re
from dataclasses import dataclass

import numpy as np
import pytest

import tfarm
from tests.hostile import NAME
from tests.report.written import ARM
from tfarm.report.page import DRAWN_DIGITS
from tfarm.report.response_sections import sensitivity_table
from tfarm.schema import curve_table
from tfarm.spectrum.table import default_gains


def tables(pages, stem):
    """The rows of a table's CSV and JSON file."""
    with open(pages / NAME / "data" / f"{stem}.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return rows, read(pages / NAME / "data" / f"{stem}.json")["rows"]


def from_csv(text):
    try:
        return float(text)
    except ValueError:
        return text


def test_csv_and_json_hold_the_same_numbers(pages):
    stems = {p.stem for p in (pages / NAME / "data").glob("*.json")}
    assert len(stems) >= 10
    for stem in stems:
        rows, records = tables(pages, stem)
        assert len(rows) == len(records) > 0
        for row, record in zip(rows, records, strict=True):
            assert list(row) == list(record)
            for key, value in record.items():
                if "{" in json.dumps(value):  # an interval, of which a cell is the text
                    assert row[key]
                elif isinstance(value, list):
                    assert [float(part) for part in row[key].split()] == value
                else:
                    same = (
                        from_csv(value) if isinstance(value, str) else str(value) if isinstance(value, bool) else value
                    )
                    assert from_csv(row[key]) == ("" if same is None else same)
    for file in (pages / NAME / "data").iterdir():
        assert not re.search(r"\bnan\b", file.read_text(encoding="utf-8").lower())


def test_every_cell_rounds_the_value_under_its_key(pages):
    law, count = [default_gains(ARM).K1, default_gains(ARM).K2], 0
    own = [page for page in (pages / NAME).glob("*.html") if page.name != "live.html"]
    text = "".join(page.read_text(encoding="utf-8") for page in own)
    for stem, (keys, cells) in tables_in(text).items():
        assert len(keys) == len(cells[0])
        assert untraced_cells(keys, cells, tables(pages, stem)[1], law) == [], stem
        count += sum(len(shown_in(cell)) for row in cells for cell in row)
    assert count > 700


def test_the_data_of_a_picture_have_the_digits_that_it_shows(pages):
    """Against the curve itself; tables have every digit."""
    with open(pages / NAME / "data" / "bode-root-moment-data.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    found = tfarm.bode(ARM, "root_moment")
    curve = {column.key: column.values for column in curve_table(found).columns}
    assert set(rows[0]) == set(curve)
    for key, values in curve.items():
        shown = [row[key] for row in rows]
        assert [float(each) for each in shown] == pytest.approx(values, rel=0.51 * 10.0 ** (1 - DRAWN_DIGITS), abs=0)
        assert max(len(re.sub(r"e.*|\D", "", each).lstrip("0")) for each in shown) <= DRAWN_DIGITS + 1  # 12345.0
    size = sum(file.stat().st_size for file in (pages / NAME / "data").iterdir())
    assert size < 2.2e6


def test_the_modal_table_is_the_api_to_the_digits_that_hold_everywhere(pages):
    """Frequencies to the last bit; what shapes are needed for to ten digits, as on every processor."""
    _, records = tables(pages, "modal-table")
    modes = tfarm.modes(ARM, count=10)
    assert [r["index"] for r in records] == list(range(11))
    assert [r["natural_frequency_rad_s"] for r in records] == modes.natural_frequency.tolist()
    assert [r["natural_frequency_hz"] for r in records] == modes.natural_frequency_hz.tolist()
    for key in ("hub_participation", "modal_moment"):
        assert [r[key] for r in records] == pytest.approx(getattr(modes, key), rel=5.1e-10, abs=0)
    for record, nodes in zip(records, modes.nodes, strict=True):
        assert record["nodes_m"] == pytest.approx(nodes, rel=0, abs=1e-9 * ARM.link.length)


def test_parameters_that_change_nothing_are_left_out_with_a_word():
    table = sensitivity_table(tfarm.modes(tfarm.load("sasaki2012"), count=3))
    assert not any("payload" in name for name in table.columns[0].values)
    assert (
        "Left out, as one per cent more of it changes no frequency here: payload mass and payload inertia."
        in table.caption
    )


# ------------------------------------------------------------ numbers in cells


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
