"""Measured responses on an arm's page: the numbers of the command, the picture, and the page that is made again."""

from tests.shell import run
from tfarm.report import writing
from tfarm.report.writing import PIECES

FILE = "tests/data/sweep/tip.csv"
GIVEN = f"tip_acceleration/hub_torque={FILE}"


def test_the_page_has_the_command_that_makes_it(tmp_path, capsys, monkeypatch):
    for kept in ("save_proof", "save_card"):  # which have their own tests
        monkeypatch.setattr(writing, kept, lambda *_: None)
    monkeypatch.setattr("tfarm.report.writing.PIECES", [each for each in PIECES if each.name == "measured responses"])
    given = ("report", "sasaki2012-lab", "--only", "bode", "--measured", GIVEN, "--out", str(tmp_path))
    code, out, _ = run(capsys, *given)
    assert code == 0
    page = (tmp_path / "sasaki2012-lab" / "bode.html").read_text()
    assert out.strip().endswith("bode.html")
    assert f"--measured {GIVEN} --only bode" in page
    assert "Single changes that explain a mode" in page
