"""The page of a study and its pictures: what is shown is the study's, names are text, every file is there."""

import csv
import json
import re
from dataclasses import replace
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

import tfarm
from tests.hostile import NAME, TEXT, Read, check_drawing, check_page
from tests.plots.labels import complaints
from tests.shell import run
from tests.studies.pictured import DRAWS, LAB, planted_study
from tfarm.plots.motion import OF_STABILITY
from tfarm.plots.studies import distributions, study, study_band, study_scatter
from tfarm.plots.style import GREY, column
from tfarm.report import study_page
from tfarm.report.study_page import write_study
from tfarm.response.transfer import transfer
from tfarm.schema import json_value, text, to_dict
from tfarm.schema.terminal import show
from tfarm.studies.sobol import SobolIndex
from tfarm.studies.worst import WorstArm

COMMAND = ("study", "sasaki2012-lab", "--over", "payload.mass=uniform:0,0.2", "--over", "hub.inertia=uniform:0.05,0.2")
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
    """Confidence is named for independent draws."""
    read, answer = Read(page), json_value(to_dict(found))
    shown = " ".join(read.texts)
    for share in answer["shares"]:
        assert share["finding"] in shown
        assert f"{share['stable']}" in read.texts
        assert f"of {found.done} arms stable" in read.texts
    assert "one-sided, by Clopper and Pearson" in page
    confident = r"converged stable on \d+ of 40 arms \(\d+ not stable, \d+ not determined\): at least [\d.]+ %"
    assert re.search(confident, page)
    assert all("at least" not in each._replace(at_least=None).finding for each in found.shares)
    cells = {tuple(row) for row in read.rows}
    for each in found.spreads:
        numbers = [text(x, 4).replace("-", "−") for x in (each.least, each.low, each.median, each.high, each.largest)]
        assert any(row[0] == each.label and row[3:8] == tuple(numbers) for row in cells), each.label
    with (found.parts.folder / "data" / "study-ranges.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["quantile_05"]) for row in rows] == [each["quantile_05"] for each in answer["spreads"]]


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
    explained = study_page.explain_commands
    page = study_page.render("study.html", title="x", sections=[section], explained=explained, found=found)
    check_page(page, "no arm of the study has it")


def test_the_command_writes_page_and_figure_and_prints_the_findings(capsys, tmp_path):
    """Of a study of modes: no loop, no worst arm, no failure has no section."""
    out, figure = tmp_path / "out", tmp_path / "figure.svg"
    words = (*COMMAND, "--ask", "modes", "--draws", "12", "--workers", "1", "--out", str(out))
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
    show(found)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "stable arms (confidence one-sided, Clopper-Pearson)"
    loops = [line.split()[0] for line in lines[2:6] if not line.startswith(" ")]
    assert loops[:2] == ["continuous-time", "sampled"]
    assert max(map(len, lines[:4])) <= 130


def test_each_histogram_counts_the_arms(found):
    figure = study.figure(found)
    table, shown = found.table(), distributions(found)
    assert len(figure.axes) == len(shown) == 4
    for ax, both in zip(figure.axes, shown, strict=True):
        for n, of in enumerate(both):
            counts, edges, _ = ax.patches[n].get_data()
            values = table[of.name][np.isfinite(table[of.name])]
            inside = [((values >= low) & (values < high)).sum() for low, high in pairwise(edges)]
            inside[-1] += (values == edges[-1]).sum()
            assert counts.tolist() == inside
            assert counts.sum() == of.arms == values.size
            assert ax.lines[n].get_xdata() == pytest.approx(np.percentile(values, [5, 50, 95]), rel=1e-12)
        assert re.fullmatch(r"[\w ,\n]+ ?\[(dB|deg|ms|−)\]", ax.get_xlabel()), ax.get_xlabel()
        assert ax.get_ylabel() == "arms [−]"
    titles = [ax.get_title("left") for ax in figure.axes]
    assert all(f"of {DRAWS} arms" in each for each in titles)  # some failed in each


def test_a_quantity_has_one_name_and_another_is_refused(found):
    by_place, by_name = study.figure(found, "phase_margin_deg"), study.figure(found, quantity="phase_margin_deg")
    assert [ax.get_xlabel() for ax in by_place.axes] == [ax.get_xlabel() for ax in by_name.axes]
    assert len(by_name.axes) == 1
    assert len(study.figure(found, "sampled.phase_margin_deg").axes[0].patches) == 1
    ax = Figure().subplots()
    assert tfarm.plots.study(found, quantity="phase_margin_deg", ax=ax) == (ax,)
    assert ax.get_xlabel() == by_name.axes[0].get_xlabel()
    for draw in (study, study_scatter):
        with pytest.raises(tfarm.ParameterError, match=r"quantity = 'natural_frequency_rad_s': .*name it in `ask`"):
            draw.figure(found, "natural_frequency_rad_s")
        with pytest.raises(tfarm.ParameterError, match="phase_margin"):
            draw.figure(found, "phase_margine")


def test_each_arm_is_one_mark_in_the_colour_of_its_loop(found):
    """With a value at its height; without a limit at the upper edge, without a value at the lower one.

    The study has every kind of them.
    """
    table, figure = found.table(), study_scatter.figure(found)
    assert {*table["sampled.stability"]} == {"stable", "unstable", ""}
    assert all(check(table["sampled.gain_margin_db"]).any() for check in (np.isinf, np.isnan, np.isfinite))
    shown = [both[-1].name for both in distributions(found)][:3]
    keys = [re.match(r"[\w.]+", ax.get_xlabel())[0] for ax in figure.axes[-2:]]
    assert len(figure.axes) == 6
    for n, ax in enumerate(figure.axes):
        y = table[shown[n // 2]]
        x = table[{"K2": "law.K2"}.get(keys[n % 2], keys[n % 2])]
        height = np.where(np.isnan(y), 0.02, np.where(np.isinf(y), 0.98, y))
        wanted = {}
        for word in ("stable", "unstable", ""):
            colour = OF_STABILITY[word][0] if word else GREY
            wanted[colour] = sorted(zip(x[own := table["sampled.stability"] == word], height[own], strict=True))
        drawn = {
            colour: sorted(
                p for line in ax.lines if same_color(line.get_color(), colour) for p in map(tuple, line.get_xydata())
            )
            for colour in wanted
        }
        assert drawn == wanted
        assert sum(map(len, drawn.values())) == DRAWS
        edge = [line for line in ax.lines if line.get_transform() is not ax.transData]
        assert sum(len(line.get_xdata()) for line in edge) == (~np.isfinite(y)).sum()


def test_of_many_arms_some_are_drawn(found):
    ax = study_scatter.figure(found, "least_damping", most=10).axes[0]
    assert sum(len(line.get_xdata()) for line in ax.lines) == 10


def test_a_band_has_the_curves_of_the_arms(found):
    """By arms made in another way than the study makes them."""
    masses = found.table()["payload.mass"]
    ax = study_band.figure(found).axes[0]
    lines = {line.get_label(): line for line in ax.lines}
    omega, median = lines["median, at each frequency"].get_data()
    exact = 20 * np.log10(
        [abs(tfarm.transfer(LAB.with_numbers(payload_mass=m), "root_moment")(1j * omega)) for m in masses]
    )
    assert lines["single arms"].get_ydata() == pytest.approx(exact[0], abs=1e-9)
    below, above = np.sort(exact, axis=0)[[DRAWS // 2 - 1, DRAWS // 2]]  # of an even number of arms
    assert np.all((median > below - 1e-9) & (median < above + 1e-9))
    (area,) = (each.get_paths()[0].vertices for each in ax.collections)
    for end in np.percentile(exact, [5, 95], axis=0):
        assert all(np.min(abs(area[area[:, 0] == w, 1] - y)) < 1e-9 for w, y in zip(omega, end, strict=True))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("angular frequency [rad/s]", "root moment [dB re 1 N m/(N m)]")


def test_an_arm_without_a_response_is_left_out_and_none_at_all_is_an_error(found):
    refused, place = tfarm.ConvergenceError("no", None, None), "tfarm.studies.findings.transfer"
    ready = transfer(found.parts.plan.case.arm, "root_moment")
    with mock.patch(place, side_effect=[ready, *[refused] * (DRAWS - 1), lambda s: 0 * s + 10]):
        (line, *_) = study_band.figure(found).axes[0].lines
    assert line.get_ydata().tolist() == [20.0] * 1200
    with (
        mock.patch(place, side_effect=[ready, *[refused] * DRAWS]),
        pytest.raises(tfarm.ParameterError, match="no arm of the study has"),
    ):
        study_band.figure(found)
    with pytest.raises(tfarm.ParameterError, match="output"):
        study_band.figure(found, "root_momentum")


def test_no_words_of_a_picture_overlap_in_any_size(found):
    drawn = [(study, found), (study_scatter, found), (study_band, found)]
    figures = [picture.figure(record) for picture, record in drawn]
    with column():
        figures += [picture.figure(record) for picture, record in drawn]
    assert [line for figure in figures for line in complaints(figure)] == []
