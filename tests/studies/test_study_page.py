"""The page of a study: its numbers are the study's, names are text, and every file that it leads to is there."""

import csv
import json
import re
from dataclasses import replace

import pytest

import tfarm
from tests.hostile import NAME, TEXT, Read, check_drawing, check_page
from tests.shell import run
from tests.studies.pictured import planted_study
from tfarm.report import study_page
from tfarm.report.study_page import write_study
from tfarm.schema import json_value, text, to_dict
from tfarm.studies.study import SobolIndex, WorstArm

LAB = ("study", "sasaki2012-lab", "--over", "payload.mass=uniform:0,0.2", "--over", "hub.inertia=uniform:0.05,0.2")
WORST = WorstArm(
    quantity="sampled.phase_margin_deg", row=7, drawn=3.25, found=None, evaluations=60,
    numbers={"payload.mass": 0.0125, "law.K2": 0.9875}, file="worst.toml",
)  # fmt: skip
SOBOL = SobolIndex(
    quantity="sampled.phase_margin_deg", key="law.K2", first=0.875,
    first_interval=(0.8125, 0.9375), total=0.9275, total_interval=(0.8525, 1.0125),
)  # fmt: skip


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A study with a worst arm and Sobol' indices, and its page."""
    study = planted_study(tmp_path_factory.mktemp("study"))
    study = replace(study, worst=WORST, sobol=(SOBOL,))
    (study.parts.folder / "worst.toml").write_text("planted", encoding="utf-8")
    assert write_study(study) == study.parts.folder / "index.html"
    return study


@pytest.fixture(scope="module")
def page(found):
    return (found.parts.folder / "index.html").read_text(encoding="utf-8")


def test_the_facts_and_the_ranges_are_those_of_the_command(found, page):
    read, answer = Read(page), json_value(to_dict(found))
    shown = " ".join(read.texts)
    for share in answer["shares"]:
        assert share["finding"] in shown
        assert f"{share['stable']}" in read.texts
        assert f"of {found.done} arms stable" in read.texts
    cells = {tuple(row) for row in read.rows}
    for each in found.spreads:
        numbers = [text(x, 4).replace("-", "−") for x in (each.least, each.low, each.median, each.high, each.largest)]
        assert any(row[0] == each.label and row[3:8] == tuple(numbers) for row in cells), each.label
    with (found.parts.folder / "data" / "study-ranges.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["quantile_05"]) for row in rows] == [each["quantile_05"] for each in answer["spreads"]]


def test_the_confidence_is_named_for_draws_alone(found, page):
    assert "one-sided, by Clopper and Pearson" in page
    assert re.search(
        r"converged stable on \d+ of 40 arms \(\d+ not stable, \d+ not determined\): at least [\d.]+ %", page
    )
    counted = [each._replace(at_least=None).finding for each in found.shares]
    assert all("at least" not in each for each in counted)


def test_worst_arm_indices_and_failures(found, page):
    read = Read(page)
    assert ("href", "worst.toml") in read.attributes
    rows = {tuple(cell.strip() for cell in row) for row in read.rows}
    assert ("payload.mass", "uniform 0, 0.2", "0.0125") in rows
    assert any(row[:3] == (SOBOL.quantity, "law.K2", "0.875") for row in rows)
    words = " ".join(read.texts)
    assert "as its loop is not stable" in words
    assert "row 7, 3.25" in words
    (failure,) = found.failures
    assert any((row[1], row[2].split()[0]) == (str(failure.arms), str(failure.row)) for row in rows if len(row) == 3)


def test_names_are_text_and_every_file_is_there(found, page):
    folder = found.parts.folder
    check_page(page, NAME)
    assert "<evil" not in page
    assert "\u202e" not in page
    assert TEXT[:8] in " ".join(Read(page).texts)
    for drawing in folder.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))
    names = [value for key, value in Read(page).attributes if key in ("src", "href")]
    assert [name for name in names if not name.startswith("#") and not (folder / name).is_file()] == []
    anchors = {f"#{value}" for key, value in Read(page).attributes if key == "id" and value.startswith("study-")}
    assert {name for name in names if name.startswith("#")} == anchors
    assert not re.search(r"(?:src|href)=\"(?:https?:)?//", page)
    assert "prefers-color-scheme: dark" in page


def test_the_same_study_is_the_same_bytes(found, tmp_path):
    again = planted_study(tmp_path)
    write_study(replace(again, worst=WORST, sobol=(SOBOL,)))
    here = found.parts.folder
    files = [path.relative_to(here) for path in here.rglob("*") if path.is_file() and path.name != "worst.toml"]
    assert len(files) > 12
    assert [name for name in files if (here / name).read_bytes() != (tmp_path / name).read_bytes()] == []


def test_a_section_has_the_reason_of_a_missing_response(found, monkeypatch):
    def refused(*_):
        raise tfarm.ParameterError(key="response", value=TEXT, remedy="no arm of the study has it")

    monkeypatch.setattr(study_page.studies.study_band, "figure", refused)
    (section,) = (each for each in study_page.study_sections(found) if each.title == "Responses")
    assert list(section.blocks) == []
    assert section.words[0].startswith("root_moment: response = ")
    page = study_page.render("study.html", title="x", sections=[section], explained=study_page.explained, found=found)
    check_page(page, "no arm of the study has it")


def test_the_command_writes_page_and_figure_and_prints_the_findings(capsys, tmp_path):
    """Of a study of modes: no loop, no worst arm, no failure has no section."""
    out, figure = tmp_path / "out", tmp_path / "figure.svg"
    words = (*LAB, "--ask", "modes", "--draws", "12", "--workers", "1", "--out", str(out))
    code, printed, err = run(capsys, *words, "--report", "--figure", str(figure), "--json")
    assert code == 0, err
    answer = json.loads(printed)
    assert set(answer) >= {"arm", "rows", "done", "is_complete", "finding", "shares", "spreads", "failures", "sobol"}
    assert [each["name"] for each in answer["spreads"]] == [f"modes.natural_frequency_rad_s.{n}" for n in range(1, 6)]
    assert f"written: {out / 'index.html'}" in err
    check_drawing(figure.read_text(encoding="utf-8"))
    page = (out / "index.html").read_text(encoding="utf-8")
    assert re.findall(r"<h2>(.*?)</h2>", page) == ["Findings", "Distributions", "Drivers", "Responses"]
    code, printed, _ = run(capsys, *words, "--csv", str(tmp_path / "rows.csv"))
    assert code == 0
    assert printed.splitlines()[0].split() == ["arm", "sasaki2012-lab"]
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 13


def test_the_findings_come_first_a_line_a_loop(found, capsys):
    from tfarm.schema.terminal import show

    show(found)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "stable arms (confidence one-sided, Clopper-Pearson)"
    loops = [line.split()[0] for line in lines[2:6] if not line.startswith(" ")]
    assert loops[:2] == ["continuous-time", "sampled"]
    assert max(map(len, lines[:4])) <= 130
