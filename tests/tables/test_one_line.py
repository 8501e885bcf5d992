"""A column more of a record is one line beside the record: JSON, terminal, CSV and page all have it."""

import csv
import io
import json

import pytest

import tfarm
from tests.shell import run
from tests.tables.test_rendered import Parsed
from tfarm.columns import Column
from tfarm.digits import general, singly
from tfarm.report.modes_section import modal_table
from tfarm.spectrum import answers
from tfarm.tables.files import as_csv, as_json
from tfarm.tables.html import as_html

TWICE = Column(
    "twice_1_s", "twice the frequency", "1/s",
    of=lambda modes: 2 * modes.natural_frequency, digits=singly(general, 6),
)  # fmt: skip


def test_one_more_column_of_the_modal_table_is_everywhere(monkeypatch, capsys):
    monkeypatch.setattr(answers, "MODE_COLUMNS", (*answers.MODE_COLUMNS, TWICE))
    modes = tfarm.modes(tfarm.load("sasaki2012"), count=2)
    exact = (2 * modes.natural_frequency).tolist()
    table = modal_table(modes)
    rows = list(csv.DictReader(io.StringIO(as_csv(table))))
    assert [float(row["twice_1_s"]) for row in rows] == exact
    found = json.loads(as_json(table))
    assert found["units"]["twice_1_s"] == "1/s"
    assert [row["twice_1_s"] for row in found["rows"]] == exact
    heads, *cells = Parsed(as_html(table)).rows
    place = heads.index("twice the frequency1/s")
    assert [float(row[place]) for row in cells] == pytest.approx(exact, rel=1e-5, abs=0)
    _, out, _ = run(capsys, "modes", "sasaki2012", "--count", "2", "--json")
    assert [mode["twice_1_s"] for mode in json.loads(out)["modes"]] == exact
    _, out, _ = run(capsys, "modes", "sasaki2012", "--count", "2")
    head, *lines = out.splitlines()[:4]
    assert head.endswith("twice the frequency [1/s]")
    assert [float(line.split()[-1]) for line in lines] == pytest.approx(exact, rel=1e-5, abs=0)
