"""Sections that cannot be made have their reason; a report is written whole or not at all; hostile texts are text."""

import hashlib
import re
import shutil
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

import tfarm
from tests.hostile import NAME, TEXT, check_drawing, check_page
from tests.report.written import ANCHORS, ARM, HELD, Links, Unmakeable, files_of, links_of, plain_cards
from tests.shell import refused, run
from tfarm.arm import to_toml
from tfarm.cli.progress import progress
from tfarm.dsp import Chain, load_chain
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import fit
from tfarm.report import page as report_page
from tfarm.report import sections, write, writing
from tfarm.report.blocks import render
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import fit_section
from tfarm.report.sections import SectionSpec, make_section, pieces_of

OMEGA = np.geomspace(8.0, 300.0, 30)
NOT_OF_IT = Measured(output="root_moment", input="hub_torque", omega=OMEGA, values=OMEGA + 0j)  # of a hub that turns
REASON = "drives no locked hub"
SHORT = tfarm.ConvergenceError("stopped short", None, None)


def test_a_page_is_about_the_arms_own_file(tmp_path, capsys):
    """Its sampling, converters and motor are those of its arm.toml, and of the hash on its page."""
    file = tmp_path / "bench.toml"
    tables = "[sampling]\nperiod = 0.004\n[converters]\nmoment_bits = 12\nmoment_range = 5.0\n[slew]\ntravel = 0.7\n"
    file.write_text(to_toml(HELD) + tables, encoding="utf-8")
    code, _, _ = run(capsys, "report", str(file), "--only", "locus", "--out", str(tmp_path / "out"))
    written = tmp_path / "out" / ARM.name / "arm.toml"
    assert (code, tfarm.load(written), load_chain(written)) == (0, HELD, load_chain(file))
    page = (tmp_path / "out" / ARM.name / "locus.html").read_text(encoding="utf-8")
    assert hashlib.sha256(written.read_bytes()).hexdigest() in page


def test_a_section_that_cannot_be_made_has_its_reason_in_its_place_and_on_standard_error(tmp_path, capsys):
    arm = tmp_path / "arm.toml"
    arm.write_text(to_toml(replace(HELD, name="held")), encoding="utf-8")
    sweep = "tip_acceleration/hub_torque=tests/data/sweep/tip.csv"
    given = ("--measured", sweep, "--only", "bode", "--out", str(tmp_path / "out"))
    code, out, err = run(capsys, "report", str(arm), *given)
    assert (code, out.strip()) == (0, str(tmp_path / "out" / "held" / "bode.html"))
    assert (err.count("\n"), err.startswith("tfarm: held: "), REASON in err) == (1, True, True)
    assert REASON in Path(out.strip()).read_text(encoding="utf-8").partition('id="bode-measured"')[2]


@pytest.mark.parametrize(
    "error",
    [SHORT, tfarm.CertificationError("stopped short"), tfarm.ParameterError(key="K2", value=2.0, remedy="short")],
)
def test_a_section_fails_by_an_error_of_tfarm_alone(tmp_path, error):
    saved = make_section(SectionSpec("of it", "locus", Unmakeable(error)), ArmReport(HELD, Chain()), tmp_path)
    assert (saved.title, saved.failure) == ("Of it", str(error))
    with pytest.raises(ValueError, match="infeasible"):
        make_section(
            SectionSpec("of it", "locus", Unmakeable(ValueError("infeasible"))), ArmReport(HELD, Chain()), tmp_path
        )


def test_an_index_without_the_picture_of_an_arm_names_it(tmp_path, monkeypatch):
    monkeypatch.setattr(report_page, "bode", Unmakeable(SHORT))
    write([HELD], tmp_path, only=("locus",))
    targets = Links(tmp_path / "index.html").targets
    assert not any(target.endswith(".svg") for target in targets)
    assert any(unquote(target) == f"{NAME}/locus.html" for target in targets)


def with_a_bug(monkeypatch):
    """Put a section of a bug in the place of the page of the arm: what is written first is made before it."""
    broken = SectionSpec("the arm", "arm", Unmakeable(ValueError("a bug")), on="modes")
    monkeypatch.setattr(sections, "PIECES", (broken,))


def test_overview_and_live_page_are_written_first_and_stay(tmp_path, monkeypatch):
    """They are whole when a later section fails: every file that they name is there."""
    with_a_bug(monkeypatch)
    plain_cards(monkeypatch.setattr)
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


def test_a_page_has_the_same_sections_whatever_is_written_with_it(tmp_path):
    """A page of the loop of an arm that has none has no section, but the reason."""
    for only in (("modes",), ("locus",), ("modes", "locus")):
        write([HELD], tmp_path, only=only)
        ids = {page: [i for i in Links(tmp_path / HELD.name / f"{page}.html").ids if i in ANCHORS] for page in only}
        assert ids == {page: {"modes": ["arm", "modes"], "locus": []}[page] for page in only}
    assert "The hub of this arm is locked" in (tmp_path / HELD.name / "locus.html").read_text(encoding="utf-8")


def test_an_unknown_page_is_refused(capsys):
    assert "--only = 'bodes': did you mean \"bode\"?" in refused(capsys, "report", "sasaki2012", "--only", "bodes")


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


def test_a_name_too_long_for_a_folder_is_refused(tmp_path):
    with pytest.raises(tfarm.ParameterError, match="320 bytes; at most 200"):
        write([replace(HELD, name="𝒳" * 80)], tmp_path / "new" / "folder", only=("locus",))
    assert not (tmp_path / "new").exists()


STRANGE_CARDS = (
    "",
    "[]",
    "null",
    '{"tfarm_card": 1}',
    "[" * 5000,
    '{"tfarm_card": 1, "name": "x5", "summary": "", "facts": 3}',
    '{"tfarm_card": 1, "name": "elsewhere", "summary": "", "facts": []}',
)


def test_other_files_in_the_folder_are_kept_and_strange_cards_passed_over(tmp_path):
    (tmp_path / NAME).mkdir()
    (tmp_path / NAME / "mine.txt").write_text("mine")
    for i, card in enumerate(STRANGE_CARDS):
        (tmp_path / f"x{i}").mkdir()
        (tmp_path / f"x{i}" / "card.json").write_text(card)
        (tmp_path / f"x{i}" / "index.html").write_text("mine")
    write([HELD], tmp_path, only=("locus",))
    assert (tmp_path / NAME / "mine.txt").read_text() == "mine"
    links = Links(tmp_path / "index.html").targets
    assert not any(target.startswith("x") for target in links)
    assert len(links) > 1


# ------------------------------------------------------------ all or nothing


@pytest.mark.parametrize("where", ["file", "file/below/it", "taken"])
def test_an_unwritable_out_is_refused_and_left_alone(tmp_path, where):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / NAME).write_text("mine")
    before = files_of(tmp_path)
    with pytest.raises(tfarm.ParameterError, match=r"File exists|Not a directory") as caught:
        write([HELD], tmp_path / where, only=("locus",))
    assert (caught.value.key, "\n" in str(caught.value)) == ("out", False)
    assert files_of(tmp_path) == before


def test_work_that_fails_leaves_nothing_and_an_earlier_report_as_it_was(pages, tmp_path, monkeypatch):
    with_a_bug(monkeypatch)
    shutil.copytree(pages, tmp_path / "earlier")
    for out in (tmp_path / "earlier", tmp_path / "new" / "out"):
        with pytest.raises(ValueError, match="a bug"):
            write([HELD], out, only=("modes",))
    assert files_of(tmp_path / "earlier") == files_of(pages)
    assert not (tmp_path / "new").exists()


def test_pages_are_moved_after_what_they_name(tmp_path):
    (tmp_path / "made" / "data").mkdir(parents=True)
    for name in ("a.html", "data/x.csv"):
        (tmp_path / "made" / name).touch()
    writing.move_into(tmp_path / "made", tmp_path / "out")
    page, data = (tmp_path / "out" / name for name in ("a.html", "data/x.csv"))
    assert page.stat().st_ctime_ns >= data.stat().st_ctime_ns


def test_the_folder_of_an_arm_is_small(pages):
    """Six arms have 40 MB; this one is made on coarse grids.  A page's pictures and a phone's are of like size."""
    sizes = {path: len(content) for path, content in files_of(pages / NAME).items()}
    of_phones = sum(size for path, size in sizes.items() if "-narrow" in str(path))
    assert sum(sizes.values()) - of_phones < 4e6
    assert of_phones < 2e6


def test_progress_is_a_line_in_a_pipe_too(capsys):
    with progress(0.02) as advance:
        advance(3, 7, "a section")
        deadline = time.monotonic() + 30
        seen = ""
        while "a section" not in seen and time.monotonic() < deadline:
            time.sleep(0.02)
            seen += capsys.readouterr().err
    assert re.fullmatch(r"tfarm: 3 of 7 done, running: a section \(\d+ s\)", seen.splitlines()[0])


# ------------------------------------------------------------ hostile names


LAB = replace(tfarm.load("sasaki2012-lab"), name=NAME)


def test_of_a_fit(tmp_path):
    H = tfarm.transfer(LAB, "root_moment")(1j * OMEGA)
    seen = Measured(output="root_moment", input="hub_torque", omega=OMEGA, values=H, sigma=abs(H), source=TEXT)
    found = fit(LAB, [seen], free=["hub.inertia"], profile=False)
    report = ArmReport(found.arm, Chain(), (), found)
    saved = make_section(SectionSpec("fit", "fit", partial(fit_section, count=2)), report, tmp_path)
    for drawing in tmp_path.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))
    assert list(tmp_path.rglob("*.json"))
    writing._write_pages(report, tmp_path, [saved], None, "", tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    check_page(page, NAME)
    assert "\u202e" not in page
    assert [each for each in links_of(tmp_path / "index.html").ids if each in ANCHORS] == ["fit"]


def test_of_a_section_and_a_live_page_that_cannot_be_made(tmp_path):
    check_page(render("live_failed.html", title=NAME, why=TEXT), NAME, TEXT)
    report = ArmReport(LAB, Chain())
    region = SectionSpec(
        "stability region of both gains", "margins-map", Unmakeable(tfarm.ConvergenceError(TEXT, 0.0, 1.0))
    )
    saved = make_section(region, report, tmp_path)
    assert saved.failure
    writing._write_pages(report, tmp_path, [saved], None, "", tmp_path)
    check_page((tmp_path / "index.html").read_text(encoding="utf-8"), NAME, TEXT.partition(" & ")[0])
