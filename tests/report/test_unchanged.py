"""A report is written whole or not at all, and what has not changed is left as it is."""

import shutil
import time
from dataclasses import replace

import pytest

import tfarm
from tests.hostile import NAME
from tests.report.coarse import plain_cards
from tests.report.full import ARM
from tests.report.written import Unmakeable, files_of, validated
from tfarm.cli import tables as cli_tables
from tfarm.dsp import Chain
from tfarm.report import making, trust, unchanged, write, writing
from tfarm.report.given_laws import GivenLaw
from tfarm.report.trust import Evidence, kept_evidence

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
    assert "Not a directory" in str(caught.value)
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

    def scripts(folder, _):
        folder.mkdir()
        (folder / "half.js").write_text("half")

    monkeypatch.setattr(making, "ARM_PIECES", ())
    monkeypatch.setattr(making, "write_assets", scripts)
    monkeypatch.setattr(making, "save_card", fail)
    with pytest.raises(tfarm.ConvergenceError):
        write([ARM], tmp_path / "new" / "out")
    assert not (tmp_path / "new").exists()


def test_work_that_fails_leaves_an_earlier_report_as_it_was(pages, tmp_path, monkeypatch):
    def fail(*_):
        raise tfarm.ConvergenceError("stopped short", None, None)

    before, out = files_of(pages), tmp_path / "out"
    shutil.copytree(pages, out)
    monkeypatch.setattr(making, "ARM_PIECES", [piece for piece in making.ARM_PIECES if piece.name == "the arm"])
    monkeypatch.setattr(making, "save_card", fail)
    with pytest.raises(tfarm.ConvergenceError):
        write([ARM], out, only=("modes",))
    assert files_of(out) == before


# ------------------------------------------------------------ what has not changed


@pytest.fixture
def quick(monkeypatch):
    """Reports of one short section."""
    piece = next(piece for piece in making.ARM_PIECES if piece.name == "the arm")
    for pieces in ("ARM_PIECES", "LAW_PIECES"):
        monkeypatch.setattr(making, pieces, (piece,))
    monkeypatch.setattr(making, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)


def made_of(monkeypatch, arm, out, **options):
    """Which arms of a run were made, and what was said of the others."""
    made, told = [], []
    section = making.section_or_why_not
    with monkeypatch.context() as patch:
        patch.setattr(making, "section_or_why_not", lambda piece, of: [made.append(of.arm.name), section(piece, of)][1])
        write([arm], out, only=("modes",), notice=told.append, **options)
    return made, told


@pytest.mark.usefixtures("quick")
def test_an_arm_that_did_not_change_is_left_as_it_is(tmp_path, monkeypatch):
    arm = replace(ARM, name="plain")
    assert made_of(monkeypatch, arm, tmp_path) == (["plain"], [])
    before = files_of(tmp_path)
    made, (told,) = made_of(monkeypatch, arm, tmp_path)
    assert (made, files_of(tmp_path)) == ([], before)
    assert "plain: left as it is" in told
    assert made_of(monkeypatch, arm, tmp_path, force=True) == (["plain"], [])
    assert files_of(tmp_path) == before


@pytest.mark.survey
@pytest.mark.usefixtures("quick")
def test_what_changed_in_any_way_is_made_again(tmp_path, monkeypatch):
    """The arm's file, its chain, its laws, tfarm itself, or a file of the page that somebody has touched."""
    arm = replace(ARM, name="plain")
    made_of(monkeypatch, arm, tmp_path)
    changed = [
        (replace(arm, hub=tfarm.Hub(inertia=2 * arm.hub.inertia)), {}),
        (arm, {"chains": [replace(Chain(), sampling=replace(Chain().sampling, period=0.005))]}),
        (arm, {"laws": [[GivenLaw(law=tfarm.HubFeedback(K1=0.25))]]}),
    ]
    for other, options in changed:
        assert made_of(monkeypatch, other, tmp_path, **options)[0] == ["plain"], options
    made_of(monkeypatch, arm, tmp_path)
    page = tmp_path / "plain" / "modes.html"
    page.write_text("touched", encoding="utf-8")
    assert made_of(monkeypatch, arm, tmp_path)[0] == ["plain"]
    assert page.read_text(encoding="utf-8") != "touched"
    (tmp_path / "plain" / "made.json").write_text('{"tfarm_made": 1, "pages": {"modes": 3}}')
    assert made_of(monkeypatch, arm, tmp_path)[0] == ["plain"]
    monkeypatch.setattr(unchanged, "makers", lambda: "another tfarm")
    assert made_of(monkeypatch, arm, tmp_path)[0] == ["plain"]


@pytest.mark.usefixtures("quick")
def test_a_page_that_leaves_a_section_out_is_tried_again(tmp_path, monkeypatch):
    error = tfarm.ConvergenceError("stopped short", None, None)
    monkeypatch.setattr(making, "ARM_PIECES", (replace(making.ARM_PIECES[0], make=Unmakeable(error)),))
    for _ in range(2):
        made, told = made_of(monkeypatch, ARM, tmp_path)
        assert made == [NAME]
        assert "stopped short" in told[0]


def test_the_evidence_is_kept_for_the_same_tfarm_only(pages, audit_rows, monkeypatch):
    assert kept_evidence(pages / "trust") == Evidence(audit=tuple(audit_rows), published=validated())
    monkeypatch.setattr(trust, "makers", lambda: "another tfarm")
    assert kept_evidence(pages / "trust") is None
    assert kept_evidence(pages / NAME) is None


def test_the_folder_of_an_arm_is_small(pages):
    """Four arms have 20 MB; this one is made on coarse grids."""
    assert sum(len(content) for content in files_of(pages / NAME).values()) < 4e6


def test_progress_is_told_in_a_pipe_too(monkeypatch, capsys):
    monkeypatch.setattr(cli_tables, "PROGRESS_EVERY", 0.02)
    with cli_tables.progress() as advance:
        advance(3, 7, "a section")
        deadline = time.monotonic() + 30
        seen = ""
        while "a section" not in seen and time.monotonic() < deadline:
            time.sleep(0.02)
            seen += capsys.readouterr().err
    assert "tfarm: 3 of 7 done, running: a section" in seen.splitlines()
