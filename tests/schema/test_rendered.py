"""Tables read back by the standard library's own readers: csv, json, html.parser."""

import csv
import io
import json
import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from markupsafe import escape

import tfarm
from tests.hostile import Read
from tfarm.digits import column_format, significant, singly
from tfarm.loop.margins import LoopMargins
from tfarm.schema import Column, Table, across, as_csv, as_json, quantities, save_table, to_json
from tfarm.schema.html import as_html, with_symbols


@dataclass
class Found:
    """A record of arrays, as a spectrum is."""

    omega: np.ndarray = field(default_factory=lambda: np.array([71.50568246689, 1e-9, math.inf]))
    index: np.ndarray = field(default_factory=lambda: np.array([1, 2, 3]))
    words: tuple = ("<b> & 'c'", 'a, "quoted" line\nand another', "I_h in m^2")


FOUND = Found()
COLUMNS = (
    Column("index", "mode", of=FOUND.index),
    Column("omega_rad_s", "frequency", "rad/s", of=FOUND.omega, digits=singly(significant, 5)),
    Column("frequency_hz", "", "Hz", of=FOUND.omega / (2 * math.pi), digits=column_format(5, 3)),
    Column("words", "what & why", of=FOUND.words, tint=("", "#fff", "")),
    Column("nodes_m", "nodes", "m", of=[(0.1, 0.25), (), (1e-300,)], shown=["0.1, 0.25", "none", "1e-300"]),
)


@pytest.fixture
def table():
    return Table(columns=COLUMNS, stem="found", title="What is <found>")


def test_csv_has_every_digit(table):
    head, *rows = csv.reader(io.StringIO(as_csv(table)))
    assert head == [column.key for column in COLUMNS]
    record = Found()
    assert [float(row[1]) for row in rows] == record.omega.tolist()
    assert [float(row[2]) for row in rows] == (record.omega / (2 * math.pi)).tolist()
    assert [row[3] for row in rows] == list(record.words)
    assert [tuple(map(float, row[4].split())) for row in rows] == [(0.1, 0.25), (), (1e-300,)]


def test_records_in_a_cell_of_csv_are_their_text():
    intervals = Column("k", of=[[{"low": 0.0, "high": 1.0}], []], shown=["(0, 1)", "-"])
    assert as_csv(Table(columns=(intervals,))) == 'k\n"(0, 1)"\n""\n'


def test_units_stand_behind_the_keys_of_a_command_s_file(table):
    assert next(csv.reader(io.StringIO(as_csv(table, units=True))))[:2] == ["index", "omega_rad_s [rad/s]"]


def test_json_has_the_numbers_and_their_units(table):
    found = json.loads(as_json(table))
    assert found["table"] == "What is <found>"
    assert found["units"] == {column.key: column.unit for column in COLUMNS if column.unit}
    omega = Found().omega.tolist()
    assert [row["omega_rad_s"] for row in found["rows"]] == [*omega[:2], "inf"]
    assert [row["nodes_m"] for row in found["rows"]] == [[0.1, 0.25], [], [1e-300]]
    assert found["rows"] == json.loads(to_json({"rows": table}))["rows"]


def test_the_page_has_the_cells_of_the_files_rounded(table):
    heads, *rows = Read(as_html(table)).rows
    assert heads == ["mode", "frequencyrad/s", "Hz", "what & why", "nodesm\n\n\n"]
    assert [row[1] for row in rows] == ["71.506", "1.0000 × 10⁻⁹", "∞"]
    assert [row[3] for row in rows] == [*Found().words[:2], "Ih in m²"]
    head, *lines = as_html(table).replace("\nand another", "").splitlines()[2:-2:1]
    assert ["background:#fff" in line for line in lines if line.startswith("<tr>")] == [False, True, False]
    assert 'class="text tinted" data-key="words"' in head
    assert 'class="" data-key="omega_rad_s"' in head


def test_no_nan_is_written(table):
    columns = (Column("x", of=np.array([math.nan])),)
    for render in (as_json, as_csv, to_json):
        with pytest.raises(ValueError, match="NaN"):
            render(Table(columns=columns))


def test_two_columns_of_one_key_are_a_slip():
    with pytest.raises(AssertionError, match="two columns of one key"):
        Table(columns=(Column("a", of=[1]), Column("a", of=[2])))


def test_a_report_s_table_has_two_files(table, tmp_path):
    assert save_table(table, tmp_path) == ("found.csv", "found.json")
    assert (tmp_path / "found.csv").read_text(encoding="utf-8") == as_csv(table)
    assert (tmp_path / "found.json").read_bytes().decode() == as_json(table)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (
            "-3.59743-75.9066i, 1e-07+5.3e+06i",
            "−3.59743\u00a0−\u00a075.9066\u00a0i, 1 × 10⁻⁷\u00a0+\u00a05.3 × 10⁶\u00a0i",
        ),
        ("I = 1.8e-9 m^4, E = 2.07e11 Pa.", "I = 1.8 × 10⁻⁹ m⁴, E = 2.07 × 10¹¹ Pa."),
        (
            "I_h of commit 48ab0ce, 1e5f, file1e5.mat <i>",
            "I<sub>h</sub> of commit 48ab0ce, 1e5f, file1e5.mat &lt;i&gt;",
        ),
        ("L (w^2 rhoA/EI)^(1/4), nu = 0.3", "L (ω² ρA/EI)<sup>1/4</sup>, ν = 0.3"),
        ("numbers of a rhombus", "numbers of a rhombus"),
    ],
)
def test_texts_of_files_have_their_powers_of_ten_set(text, shown):
    assert with_symbols(text) == shown


def test_the_meaning_of_a_quantity_is_a_tooltip_of_its_heading_or_of_its_cell():
    meanings = ("the first & <lowest>", "")
    page = Read(as_html(Table(columns=(
        Column("omega", "frequency", "rad/s", of=[1.0, 2.0], help="natural <frequency>"),
        Column("quantity", "quantity", of=["a", "b"], helps=meanings),
    ))))  # fmt: skip
    assert [value for key, value in page.attributes if key == "title"] == ["natural <frequency>", meanings[0]]


def test_declared_meanings_come_to_the_tables_of_records():
    damped = tfarm.load("sasaki2012-lab")
    page = as_html(across({"one": tfarm.margins(damped, tfarm.HubFeedback(K1=0.3, K2=0.3)).in_band}))
    assert f'title="{escape(quantities(LoopMargins)["delay_margin"].help)}"' in page
