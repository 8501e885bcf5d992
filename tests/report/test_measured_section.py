"""Measured responses on an arm's page: the numbers of the command, the picture, and the page that is made again."""

import tfarm
from tests.shell import answer, run
from tfarm.dsp import Chain
from tfarm.fitting.data import read_measured
from tfarm.report import writing
from tfarm.report.cases import Case
from tfarm.report.page import PIECES
from tfarm.report.response_sections import measured_section

FILE = "tests/data/sweep/tip.csv"
GIVEN = f"tip_acceleration/hub_torque={FILE}"


def test_the_tables_are_those_of_the_command(capsys):
    arm = tfarm.load("sasaki2012-lab")
    section = measured_section(Case(arm, Chain(), measured=(read_measured(FILE, "tip_acceleration", "hub_torque"),)))
    picture, modes, required = section.blocks
    assert (picture.stem, modes.stem, required.stem) == ("measured", "measured-modes", "measured-required")
    command = answer(capsys, "response", "sasaki2012-lab", "--measured", GIVEN)
    keys = {column.key for column in modes.columns}
    assert [dict(row) for row in modes] == [{key: row[key] for key in row if key in keys} for row in command["modes"]]
    assert f"{command['rms_log_error']:.3g}" in section.words[0]
    assert len(picture.data) == command["points"]


def test_the_page_has_the_command_that_makes_it(tmp_path, capsys, monkeypatch):
    for kept in ("save_proof", "save_card"):  # which have their own tests
        monkeypatch.setattr(writing, kept, lambda *_: None)
    monkeypatch.setattr("tfarm.report.page.PIECES", [each for each in PIECES if each.name == "measured responses"])
    given = ("report", "sasaki2012-lab", "--only", "bode", "--measured", GIVEN, "--out", str(tmp_path))
    code, out, _ = run(capsys, *given)
    assert code == 0
    page = (tmp_path / "sasaki2012-lab" / "bode.html").read_text()
    assert out.strip().endswith("bode.html")
    assert f"--measured {GIVEN} --only bode" in page
    assert "Single changes that explain a mode" in page
