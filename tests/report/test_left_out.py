"""Sections that cannot be made have their reason; sections of each page; files that cannot be written are named."""

import hashlib
import sys
from dataclasses import replace
from functools import partial
from urllib.parse import unquote

import pytest

import tfarm
from tests.hostile import NAME
from tests.report.coarse import plain_cards
from tests.report.full import ARM
from tests.report.written import ANCHORS, HELD, Links, Unmakeable, links_of
from tests.shell import run
from tfarm import processes
from tfarm.arm import to_toml
from tfarm.dsp import Chain, load_chain
from tfarm.report import write, writing
from tfarm.report import writing as card_room
from tfarm.report.cases import Case
from tfarm.report.sections import PageSection
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
    page = write([ARM], tmp_path, only=("locus",), notice=notices.append).read_text(encoding="utf-8")
    assert "stopped short of the pole" in page.partition('id="locus"')[2]
    assert "Parameters" in page
    assert len(notices) == 1
    assert "stopped short of the pole" in notices[0]


def test_an_index_without_the_picture_of_an_arm_names_it(tmp_path, monkeypatch):
    without_a_section(monkeypatch, tfarm.ConvergenceError("no zeros found", None, None))
    monkeypatch.setattr(card_room, "bode", Unmakeable(tfarm.ConvergenceError("no zeros found", None, None)))
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


def test_every_piece_has_the_anchor_of_its_section(pages):
    ids = links_of(pages / NAME / "index.html").ids
    assert [piece.anchor for piece in pieces_of(Case(ARM, Chain()))] == [i for i in ids if i in ANCHORS]


def test_a_page_has_the_same_sections_whatever_is_written_with_it(tmp_path, monkeypatch):
    """The note on an arm without a loop is on the pages of the loop alone."""
    kept = tuple(replace(each, make=partial(bare, each.anchor)) for each in PIECES)
    monkeypatch.setattr("tfarm.report.writing.PIECES", kept)
    monkeypatch.setattr(writing, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)
    for only in (("modes",), ("locus",), ("modes", "locus")):
        write([HELD], tmp_path, only=only)
        ids = {page: [i for i in Links(tmp_path / HELD.name / f"{page}.html").ids if i in ANCHORS] for page in only}
        assert ids == {page: {"modes": ["arm", "modes"], "locus": ["arm", "no-loop"]}[page] for page in only}


def bare(anchor, *_):
    """A section without content."""
    return PageSection(anchor=anchor, title=anchor)


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


def test_a_plain_script_starts_no_processes(monkeypatch):
    class Script:
        __file__ = "analysis.py"
        __spec__ = None

    monkeypatch.setitem(sys.modules, "__main__", Script())
    assert not processes.may_start_processes()
    monkeypatch.delattr(Script, "__file__")
    assert processes.may_start_processes()
