"""Sections that cannot be made have their reason; a report is written whole or not at all; hostile texts are text."""

import hashlib
import os
import re
import shutil
import time
from dataclasses import replace
from functools import partial
from urllib.parse import unquote

import numpy as np
import pytest

import tfarm
from tests.hostile import NAME, TEXT, check_drawing, check_page
from tests.report.written import ANCHORS, ARM, HELD, Links, Unmakeable, files_of, links_of, plain_cards
from tests.shell import refused, run
from tfarm.arm import to_toml
from tfarm.cli import app as cli_app
from tfarm.dsp import Chain, load_chain
from tfarm.fitting.fit import fit
from tfarm.report import overview, write, writing
from tfarm.report.live import save_live
from tfarm.report.page import ArmReport, PageSection
from tfarm.report.response_sections import fit_section
from tfarm.report.writing import PIECES, Piece, pieces_of


def test_a_page_is_about_the_arms_own_file(tmp_path, monkeypatch, capsys):
    """Its sampling, converters and motor are those of the page, of its arm.toml, and of the hash."""
    seen = []

    def section(case):
        seen.append((case.arm.name, case.chain))
        return PageSection(anchor="sampled", title="The sampled loop")

    monkeypatch.setattr("tfarm.report.writing.PIECES", (Piece("s", "sampled", section),))
    monkeypatch.setattr(writing, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)
    file = tmp_path / "bench.toml"
    tables = "[sampling]\nperiod = 0.004\n[converters]\nmoment_bits = 12\nmoment_range = 5.0\n[slew]\ntravel = 0.7\n"
    file.write_text(to_toml(ARM) + tables, encoding="utf-8")
    code, _, _ = run(capsys, "report", str(file), "--only", "sampled", "--out", str(tmp_path / "out"))
    chain = load_chain(file)
    assert (code, seen) == (0, [(ARM.name, chain)])
    written = tmp_path / "out" / ARM.name / "arm.toml"
    assert (tfarm.load(written), load_chain(written)) == (ARM, chain)
    page = (tmp_path / "out" / ARM.name / "sampled.html").read_text(encoding="utf-8")
    assert hashlib.sha256(written.read_bytes()).hexdigest() in page


def without_a_section(monkeypatch, error):
    """A report of two sections, the second of which meets that error."""
    pieces = {piece.name: piece for piece in PIECES}
    broken = replace(pieces["root loci"], make=Unmakeable(error))
    monkeypatch.setattr("tfarm.report.writing.PIECES", (pieces["the arm"], broken))
    monkeypatch.setattr(writing, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)


@pytest.mark.parametrize(
    "error",
    [
        tfarm.ConvergenceError("stopped short of the pole", None, None),
        tfarm.CertificationError("not proven: stopped short of the pole"),
        tfarm.ParameterError(key="K2", value=2.0, remedy="stopped short of the pole"),
    ],
)
def test_a_section_that_cannot_be_made_has_its_reason_in_its_place(tmp_path, monkeypatch, error):
    without_a_section(monkeypatch, error)
    notices = []
    write([ARM], tmp_path, only=("modes", "locus"), notice=notices.append)
    page, modes = ((tmp_path / NAME / f"{name}.html").read_text(encoding="utf-8") for name in ("locus", "modes"))
    assert "stopped short of the pole" in page.partition('id="locus"')[2]
    assert "Parameters" in modes
    assert len(notices) == 1
    assert "stopped short of the pole" in notices[0]


def test_an_index_without_the_picture_of_an_arm_names_it(tmp_path, monkeypatch):
    without_a_section(monkeypatch, tfarm.ConvergenceError("no zeros found", None, None))
    monkeypatch.setattr(overview, "bode", Unmakeable(tfarm.ConvergenceError("no zeros found", None, None)))
    write([ARM], tmp_path, only=("locus",))
    targets = Links(tmp_path / "index.html").targets
    assert not any(target.endswith(".svg") for target in targets)
    assert any(unquote(target) == f"{NAME}/locus.html" for target in targets)


def test_a_section_left_out_is_one_line_on_standard_error(tmp_path, monkeypatch, capsys):
    without_a_section(monkeypatch, tfarm.ConvergenceError("stopped\nshort", None, None))
    code, out, err = run(capsys, "report", "stocky-steel", "--only", "locus", "--out", str(tmp_path))
    assert (code, out.strip()) == (0, str(tmp_path / "stocky-steel" / "locus.html"))
    lines = [line for line in err.splitlines() if " done" not in line]  # but for progress, on a slow machine
    assert len(lines) == 1
    assert lines[0].startswith("tfarm: stocky-steel: ")


def test_a_bug_of_ours_stays_loud(tmp_path, monkeypatch):
    without_a_section(monkeypatch, ValueError("cost matrix is infeasible"))
    with pytest.raises(ValueError, match="infeasible"):
        write([ARM], tmp_path / "out", only=("locus",))
    assert not (tmp_path / "out").exists()


def test_overview_and_live_page_are_written_first_and_stay(tmp_path, monkeypatch):
    """They are whole when a later section fails: every file that they name is there."""
    without_a_section(monkeypatch, ValueError("a bug"))
    monkeypatch.setattr(writing, "gather", lambda: None)
    announced = []
    with pytest.raises(ValueError, match="a bug"):
        write([ARM], tmp_path, announce=announced.append)
    first = [tmp_path / NAME / "index.html", tmp_path / NAME / "live.html"]
    assert announced == [f"written first: {first[0]} and {first[1]}; the other pages follow"]
    for page in first:
        targets = [unquote(target.partition("#")[0]) for target in Links(page).targets]
        assert [each for each in targets if each and "://" not in each and not (page.parent / each).is_file()] == []
    assert (tmp_path / "assets" / "live.js").is_file()
    assert not list(tmp_path.glob(".writing-*"))


def test_every_piece_has_the_anchor_of_its_section(pages):
    pieces = pieces_of(ArmReport(ARM, Chain()))
    for page in {piece.page for piece in pieces}:
        ids = links_of(pages / NAME / f"{page}.html").ids
        assert [piece.anchor for piece in pieces if piece.page == page] == [i for i in ids if i in ANCHORS]


def test_a_page_has_the_same_sections_whatever_is_written_with_it(tmp_path, monkeypatch):
    """A page of the loop of an arm that has none has no section, but the reason."""
    kept = tuple(replace(each, make=partial(bare, each.anchor)) for each in PIECES)
    monkeypatch.setattr("tfarm.report.writing.PIECES", kept)
    monkeypatch.setattr(writing, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)
    for only in (("modes",), ("locus",), ("modes", "locus")):
        write([HELD], tmp_path, only=only)
        ids = {page: [i for i in Links(tmp_path / HELD.name / f"{page}.html").ids if i in ANCHORS] for page in only}
        assert ids == {page: {"modes": ["arm", "modes"], "locus": []}[page] for page in only}
    assert "The hub of this arm is locked" in (tmp_path / HELD.name / "locus.html").read_text(encoding="utf-8")


def bare(anchor, *_):
    """A section without content."""
    return PageSection(anchor=anchor, title=anchor)


def test_an_unknown_page_is_refused_before_anything_is_read(capsys):
    assert "--only = 'bodes': did you mean \"bode\"?" in refused(capsys, "report", "no-such-arm", "--only", "bodes")


@pytest.mark.parametrize(
    ("arms", "only", "key"),
    [
        ((), None, "arms"),
        ((ARM, replace(ARM, assumptions=())), None, "name"),
        ((replace(ARM, name="Pictures"),), None, "name"),
        ((replace(ARM, name="Trust"),), None, "name"),
        ((ARM,), ("bodes",), "only"),
    ],
)
def test_what_cannot_be_written_is_named(tmp_path, arms, only, key):
    with pytest.raises(tfarm.ParameterError) as caught:
        write(arms, tmp_path / "out", only=only)
    assert caught.value.key == key
    assert not (tmp_path / "out").exists()


STRANGE_CARDS = (
    "",
    "[]",
    "null",
    '{"tfarm_card": 1}',
    "[" * 5000,
    '{"tfarm_card": 1, "name": "x5", "summary": "", "facts": 3}',
    '{"tfarm_card": 1, "name": "elsewhere", "summary": "", "facts": []}',
)


@pytest.mark.usefixtures("audited")
def test_other_files_in_the_folder_are_kept_and_strange_cards_passed_over(tmp_path, monkeypatch):
    monkeypatch.setattr("tfarm.report.writing.PIECES", ())
    (tmp_path / NAME).mkdir()
    (tmp_path / NAME / "mine.txt").write_text("mine")
    for i, card in enumerate(STRANGE_CARDS):
        (tmp_path / f"x{i}").mkdir()
        (tmp_path / f"x{i}" / "card.json").write_text(card)
        (tmp_path / f"x{i}" / "index.html").write_text("mine")
    write([HELD], tmp_path)
    assert (tmp_path / NAME / "mine.txt").read_text() == "mine"
    links = Links(tmp_path / "index.html").targets
    assert not any(target.startswith("x") for target in links)
    assert len(links) > 1
    assert NAME in (tmp_path / "trust" / "index.html").read_text(encoding="utf-8").replace("&amp;", "&").replace(
        "&#39;", "'"
    )


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


def test_pages_are_moved_after_what_they_name(tmp_path, monkeypatch):
    (tmp_path / "made" / "data").mkdir(parents=True)
    for name in ("a.html", "data/x.csv"):
        (tmp_path / "made" / name).touch()
    moved = []
    monkeypatch.setattr(os, "replace", lambda _, place: moved.append(place.name))
    writing.move_into(tmp_path / "made", tmp_path / "out")
    assert moved == ["x.csv", "a.html"]


def test_the_folder_of_an_arm_is_small(pages):
    """Six arms have 40 MB; this one is made on coarse grids.  A page's pictures and a phone's are of like size."""
    sizes = {path: len(content) for path, content in files_of(pages / NAME).items()}
    of_phones = sum(size for path, size in sizes.items() if "-narrow" in str(path))
    assert sum(sizes.values()) - of_phones < 4e6
    assert of_phones < 2e6


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


# ------------------------------------------------------------ hostile names


LAB = replace(tfarm.load("sasaki2012-lab"), name=NAME)
OMEGA = np.geomspace(8.0, 300.0, 30)


def test_of_a_fit(tmp_path):
    H = tfarm.transfer(LAB, "root_moment")(1j * OMEGA)
    seen = tfarm.Measured(output="root_moment", input="hub_torque", omega=OMEGA, values=H, sigma=abs(H), source=TEXT)
    found = fit(LAB, [seen], free=["hub.inertia"], profile=False)
    case = ArmReport(found.arm, Chain(), (), found)
    saved = writing.make_section("fit", "fit", partial(fit_section, count=2), case, tmp_path)
    for suffix in ("svg", "json"):
        assert list(tmp_path.rglob(f"*.{suffix}"))
    for drawing in tmp_path.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))
    writing._write_pages(case, tmp_path, [saved], None, "", tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    check_page(page, NAME)
    assert "\u202e" not in page
    assert [each for each in links_of(tmp_path / "index.html").ids if each in ANCHORS] == ["fit"]


def test_of_a_section_and_a_live_page_that_cannot_be_made(tmp_path, monkeypatch):
    error = tfarm.ConvergenceError(TEXT, 0.0, 1.0)

    def fails(*_):
        raise error

    monkeypatch.setattr("tfarm.report.live.live_data", fails)
    save_live(ArmReport(LAB, Chain()), tmp_path)
    check_page((tmp_path / "live.html").read_text(encoding="utf-8"), NAME, TEXT)
    saved = writing.make_section(
        "stability region of both gains", "margins-map", fails, ArmReport(LAB, Chain()), tmp_path
    )
    assert saved.failure
    writing._write_pages(ArmReport(LAB, Chain()), tmp_path, [saved], None, "", tmp_path)
    check_page((tmp_path / "index.html").read_text(encoding="utf-8"), NAME, TEXT.partition(" & ")[0])
