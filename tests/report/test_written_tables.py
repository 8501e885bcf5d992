"""The tables of written pages: their cells are roundings of their files, and these numbers are the API's."""

import csv
import html
import json
import math
import re

import numpy as np
import pytest

import tfarm
from tests.hostile import NAME
from tests.report.written import ARM
from tfarm.report.response_sections import sensitivity_table
from tfarm.schema import curve_table
from tfarm.spectrum.gains import default_gains

DRAWN_DIGITS = 7  # of the numbers of a picture


def rows_of(pages, stem):
    return json.loads((pages / NAME / "data" / f"{stem}.json").read_text(encoding="utf-8"))["rows"]


def test_every_cell_rounds_the_value_under_its_key(pages):
    """Each number in a cell is one of those of the file in some unit; a cell may name a gain ("0 … 5, not 77.7")."""
    law, count = [default_gains(ARM).K1, default_gains(ARM).K2], 0
    own = [page for page in (pages / NAME).glob("*.html") if page.name != "live.html"]
    for stem, (keys, cells) in tables_in("".join(page.read_text(encoding="utf-8") for page in own)).items():
        for row, shown in zip(rows_of(pages, stem), cells, strict=True):
            for key, cell in zip(keys, shown, strict=True):
                values = [value for value, *_ in shown_in(json.dumps(row[key], ensure_ascii=False))]
                values += law if ", not " in cell else []
                bare = re.sub(r"\(±[^)]*\)", "", cell)  # without the error that rounding leaves
                for value, half, unit in shown_in(re.sub(r"− (?=\S+(?: × \S+)? i\b)", "−", bare)):
                    off = abs(np.multiply.outer(SCALES.get(unit, (1.0,)), values) - value)
                    assert (off <= half + ROUNDED * abs(value)).any(), (stem, key, cell)
                    count += 1
    assert count > 700


def test_the_data_of_a_picture_have_the_digits_that_it_shows(pages):
    """Against the curve itself; tables have every digit."""
    with open(pages / NAME / "data" / "bode-root-moment-data.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    curve = {column.key: column.values for column in curve_table(tfarm.bode(ARM, "root_moment")).columns}
    assert set(rows[0]) == set(curve)
    for key, values in curve.items():
        shown = [row[key] for row in rows]
        assert [float(each) for each in shown] == pytest.approx(values, rel=0.51 * 10.0 ** (1 - DRAWN_DIGITS), abs=0)
        assert max(len(re.sub(r"e.*|\D", "", each).lstrip("0")) for each in shown) <= DRAWN_DIGITS + 1  # 12345.0
    size = sum(file.stat().st_size for file in (pages / NAME / "data").iterdir())
    assert size < 2.2e6


def test_the_modal_table_is_the_api_to_the_digits_that_hold_everywhere(pages):
    """Frequencies to the last bit; what shapes are needed for to ten digits, as on every processor."""
    records, modes = rows_of(pages, "modal-table"), tfarm.modes(ARM, count=10)
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
    left_out = "Left out, as one per cent more of it changes no frequency here: payload mass and payload inertia."
    assert left_out in table.caption


# ------------------------------------------------------------ numbers in cells


POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
NUMBER = re.compile(
    r"(?<![\w.,^_⁰-⁹])(?P<sign>[−-](?=\d))?(?P<mantissa>\d+(?:\.\d+)?)"
    r"(?: × 10(?P<power>⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)|e(?P<e>[-+]?\d+))?(?![\w/²³]|\.\d)(?P<unit> ?(?:%|[a-zA-Z]+)(?![\w/]))?"
)
SCALES = {"Hz": (1.0, 1 / (2 * math.pi)), "%": (1.0, 100.0), "ms": (1.0, 1e3), "mm": (1.0, 1e3), "samples": (1.0,)}
ROUNDED = 1e-9  # of a number: what a double may miss of a tie, or two methods of each other


def shown_in(text):
    """The numbers of a text: value, half a unit of the last digit, and the unit behind it."""
    for number in NUMBER.finditer(re.sub(r"(?<=\d)i\b", " i", text)):
        mantissa, power = number["mantissa"], int((number["power"] or number["e"] or "0").translate(POWERS))
        size, half = float(mantissa) * 10.0**power, 0.5 * 10.0 ** (power - len(mantissa.partition(".")[2]))
        yield -size if number["sign"] else size, half, (number["unit"] or "").strip()


def tables_in(page):
    """The keys of the columns and the cells of the rows of each table of a page, by its stem."""
    found = {}
    for stem, table in re.findall(r'<figure id="table-([^"]*)">(.*?)</figure>', page, flags=re.DOTALL):
        head, _, body = table.partition("<tbody>")
        rows = (re.findall(r"<td[^>]*>(.*?)</td>", row, flags=re.DOTALL) for row in body.split("</tr>")[:-1])
        texts = [[re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", "", cell))) for cell in row] for row in rows]
        found[stem] = re.findall(r'data-key="([^"]*)"', head), texts
    return found
