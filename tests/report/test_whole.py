"""A report is written whole or not at all."""

import re
import shutil
import time
from dataclasses import replace

import pytest

import tfarm
from tests.hostile import NAME
from tests.report.full import ARM
from tests.report.written import files_of
from tfarm.cli import app as cli_app
from tfarm.report import write, writing
from tfarm.report.writing import PIECES

# ------------------------------------------------------------ all or nothing


@pytest.mark.parametrize("where", ["file", "file/below/it", "taken"])
def test_an_unwritable_out_is_refused_before_any_work_and_left_alone(tmp_path, monkeypatch, where):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / NAME).write_text("mine")
    monkeypatch.setattr(writing, "make_all", lambda *_: pytest.fail("work began"))
    before = files_of(tmp_path)
    with pytest.raises(tfarm.ParameterError) as caught:
        write([ARM], tmp_path / where)
    assert caught.value.key == "out"
    assert "\n" not in str(caught.value)
    assert ("File exists" if where == "file" or where == "taken" else "Not a directory") in str(caught.value)
    assert files_of(tmp_path) == before


def test_a_name_too_long_for_a_folder_is_refused_too(tmp_path):
    with pytest.raises(tfarm.ParameterError, match=r"name = .*320 bytes; at most 200"):
        write([replace(ARM, name="𝒳" * 80)], tmp_path / "new" / "folder")
    assert files_of(tmp_path) == {}
    assert not (tmp_path / "new").exists()


@pytest.mark.usefixtures("audited")
def test_work_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def fail(_, folder, *__):
        (folder / "half.svg").write_text("half")
        raise tfarm.ConvergenceError("stopped short", None, None)

    def scripts(folder):
        folder.mkdir()
        (folder / "half.js").write_text("half")

    monkeypatch.setattr("tfarm.report.writing.PIECES", ())
    monkeypatch.setattr(writing, "write_assets", scripts)
    monkeypatch.setattr(writing, "save_card", fail)
    with pytest.raises(tfarm.ConvergenceError):
        write([ARM], tmp_path / "new" / "out")
    assert not (tmp_path / "new").exists()


def test_work_that_fails_leaves_an_earlier_report_as_it_was(pages, tmp_path, monkeypatch):
    def fail(*_):
        raise tfarm.ConvergenceError("stopped short", None, None)

    before, out = files_of(pages), tmp_path / "out"
    shutil.copytree(pages, out)
    monkeypatch.setattr("tfarm.report.writing.PIECES", [piece for piece in PIECES if piece.name == "the arm"])
    monkeypatch.setattr(writing, "save_card", fail)
    with pytest.raises(tfarm.ConvergenceError):
        write([ARM], out, only=("modes",))
    assert files_of(out) == before


def test_the_folder_of_an_arm_is_small(pages):
    """Four arms have 20 MB; this one is made on coarse grids."""
    assert sum(len(content) for content in files_of(pages / NAME).values()) < 4e6


def test_progress_is_a_line_in_a_pipe_too(monkeypatch, capsys):
    monkeypatch.setattr(cli_app, "PROGRESS_AFTER", 0.02)
    with cli_app.progress() as advance:
        advance(3, 7, "a section")
        deadline = time.monotonic() + 30
        seen = ""
        while "a section" not in seen and time.monotonic() < deadline:
            time.sleep(0.02)
            seen += capsys.readouterr().err
    assert re.fullmatch(r"tfarm: 3 of 7 done, running: a section \(\d+ s\)", seen.splitlines()[0])
