"""The page of a comparison: its numbers are the command's, names are text, and its files are there."""

import csv
import re

import pytest

import tfarm
from tests.hostile import LONG, TEXT, Read, check_drawing, check_page
from tests.shell import refused
from tfarm.dsp import Chain
from tfarm.errors import one_line
from tfarm.report.page import ArmReport
from tfarm.report.writing import _write_pages, write_comparison
from tfarm.schema import json_value, to_dict

LAB = tfarm.load("sasaki2012-lab")
HOSTILE = f"{TEXT} {LONG}"


@pytest.fixture(scope="module")
def compared():
    return tfarm.compare([LAB, LAB.with_numbers(hub_inertia=0.15)], names=("lab", HOSTILE), modes=2)


@pytest.fixture(scope="module")
def folder(compared, tmp_path_factory):
    """A folder that was not there before, with the page."""
    place = tmp_path_factory.mktemp("pages") / "new" / "folder"
    assert write_comparison(compared, place) == place / "compare.html"
    return place


def in_csv(cell):
    return "" if cell is None else " ".join(map(str, cell)) if isinstance(cell, list) else str(cell)


def test_the_tables_hold_the_numbers_of_the_command(compared, folder):
    answer = json_value(to_dict(compared))
    for name in ("modes", "poles", "margins"):
        with open(folder / "data" / f"compare-{name}.csv", encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        wanted = [{key: in_csv(cell) for key, cell in row.items()} for row in answer[name]]
        assert rows == wanted
        assert rows


def test_the_page_sets_its_numbers_and_every_column_has_a_key(folder):
    """No power of ten in the letters of a terminal, and no column that a file or a reader cannot name."""
    page = (folder / "compare.html").read_text(encoding="utf-8")
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page)
    assert any("−" in cell for cell in cells)
    assert [cell for cell in cells if re.search(r"\de[-+]\d|^-.|\binf", cell)] == []
    heads = re.findall(r'<th scope="col"[^>]*data-key="([^"]*)"[^>]*>([^<]*)', page)
    assert ("quantity", "quantity") in heads
    assert all(key and title for key, title in heads)
    assert ("one", "lab") in heads  # a column is named after its side
    assert "reach" not in dict(heads)  # both verdicts hold at every frequency
    headings = re.findall(r"<h\d>([^<]*)", page)
    assert len(headings) == len(set(headings)) >= 5
    assert re.search(r">[^<]* percentage points<", page)


def test_names_are_text_and_every_file_is_there(compared, folder, tmp_path):
    page = (folder / "compare.html").read_text(encoding="utf-8")
    check_page(page, one_line(HOSTILE, 60))
    assert "\u202e" not in page  # which would turn the line around
    for drawing in folder.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))
    names = [value for key, value in Read(page).attributes if key in ("src", "href") and not value.startswith("#")]
    assert names
    assert [name for name in names if not (folder / name).is_file()] == []
    assert {path.name for path in folder.iterdir()} == {"compare.html", "compare.json", "data", "pictures"}
    # the same comparison is the same bytes
    again = write_comparison(compared, tmp_path).parent
    files = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
    assert len(files) == 12
    assert [name for name in files if (folder / name).read_bytes() != (again / name).read_bytes()] == []


def test_an_index_leads_to_the_comparison_and_back(compared, tmp_path, monkeypatch):
    """One that is there; an arm's page that is made later leads to it too."""
    monkeypatch.setattr("tfarm.report.blocks.save_figure", lambda *_, **__: None)
    index, arm = tmp_path / "index.html", tmp_path / LAB.name
    index.write_text("an old index", encoding="utf-8")
    shown = write_comparison(compared, tmp_path)
    assert "index.html" in _leads_to(shown)
    assert "compare.html" in _leads_to(index)
    check_page(index.read_text(encoding="utf-8"), one_line(HOSTILE, 60))
    assert "prefers-color-scheme: dark" in shown.read_text(encoding="utf-8")
    arm.mkdir()
    _write_pages(ArmReport(LAB, Chain()), arm, [], ("modes",), "", arm)
    assert "../compare.html" in _leads_to(arm / "modes.html")


def _leads_to(page):
    return [value for key, value in Read(page.read_text(encoding="utf-8")).attributes if key == "href"]


def test_a_folder_that_cannot_be_written_is_one_line(capsys, tmp_path):
    (tmp_path / "taken").write_text("a file")
    err = refused(capsys, "compare", "sasaki2012", "sasaki2012-lab", "--modes", "1", "--out", str(tmp_path / "taken"))
    assert "--out" in err
    assert "give a folder that can" in err
