"""The tables of written pages: their CSV and JSON are one, their cells roundings of these, their numbers the API's."""

import csv
import json
import re

import pytest

import tfarm
from tests.hostile import NAME
from tests.report.full import ARM
from tests.report.walked import read, shown_in, tables_in, untraced_cells
from tfarm.dsp import Chain
from tfarm.report.arm_section import is_from_paper, paper_section
from tfarm.report.cases import Case
from tfarm.report.response_sections import sensitivity_table
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
    for stem, (keys, cells) in tables_in((pages / NAME / "index.html").read_text(encoding="utf-8")).items():
        assert len(keys) == len(cells[0])
        assert untraced_cells(keys, cells, tables(pages, stem)[1], law) == [], stem
        count += sum(len(shown_in(cell)) for row in cells for cell in row)
    assert count > 700


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


def test_the_paper_is_corrected_where_the_arm_is_its_own():
    assert not is_from_paper(ARM)
    for name, density in (("sasaki2012", 2766.7), ("sasaki2012-as-printed", 2.7667)):
        arm = tfarm.load(name)
        assert is_from_paper(arm)
        (table,) = paper_section(Case(arm, Chain())).blocks
        rows = list(zip(*(column.values for column in table.columns), strict=True))
        (row,) = (row for row in rows if row[1] == "ρ")
        assert row[2:6] == (2.7667, "kg/m³", density, "kg/m³")
        assert row[6]
        assert [row[6] for row in rows if row[1] in ("I", "I_h")] == ["needed, but not in the paper: an assumption"] * 2
        assert next(row for row in rows if row[1] == "C")[2:6] == (0.0, "kg/s", 0.0, "s")
