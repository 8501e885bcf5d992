"""The pages as a reader gets them: complete, the same on every run, and all or nothing."""

import csv
import hashlib
import json
import math
import re
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache, partial
from html.parser import HTMLParser
from operator import attrgetter
from pathlib import Path
from urllib.parse import unquote

import pytest

import tfarm
from tests.hostile import LONG, NAME, PRINTED, check_drawing, check_page
from tests.report.coarse import coarsen, plain_cards
from tests.report.full import ARM
from tests.shell import run
from tfarm import processes
from tfarm.arm import to_toml
from tfarm.audit.published import validate
from tfarm.cli import tables as cli_tables
from tfarm.digits import plain
from tfarm.dsp import Chain, load_chain
from tfarm.report import card as card_room
from tfarm.report import frame, making, readme_pictures, trust, unchanged, write, writing
from tfarm.report.card import written_cards
from tfarm.report.frame import first_sentence
from tfarm.report.given_laws import GivenLaw, Subject
from tfarm.report.page import index_page
from tfarm.report.paper import is_from_paper, paper_section
from tfarm.report.pieces import QUESTIONS
from tfarm.report.sections import PageSection
from tfarm.report.trust import Evidence, kept_evidence, write_trust
from tfarm.report.trust_proofs import written_proofs
from tfarm.spectrum.scales import default_gains

ANCHORS = {piece.anchor for piece in making.ARM_PIECES}
HELD = replace(ARM, hub=tfarm.Hub(inertia=math.inf))  # no loop: its proofs are quick
validated = cache(lambda: tuple(validate()))  # as this process has it


def files_of(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@cache
def links_of(page):
    """What a page that stays holds, read once."""
    return Links(page)


@cache
def ids_of(page):
    return set(links_of(page).ids)


class Links(HTMLParser):
    """Every href, src, id and tag of a page."""

    def __init__(self, page):
        super().__init__()
        self.targets, self.ids, self.tags, self.alts = [], [], set(), []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        for key, value in attrs:
            if key in ("href", "src", "srcset", "action", "data"):
                self.targets.append(value)
            elif key == "id":
                self.ids.append(value)
        if tag == "img":
            self.alts.append(dict(attrs).get("alt"))


# ------------------------------------------------------------ the same bytes


def test_another_process_with_other_hashes_writes_the_same_bytes(pages, audit_rows, tmp_path, monkeypatch):
    """What is quickly made, and the page on trust; of all sections: `python -m tests.report.twice`."""
    coarsen(monkeypatch.setattr)
    made = tmp_path / "made"
    made.mkdir()
    for i, piece in enumerate(making.ARM_PIECES):
        if piece.anchor in ("margins-map", "bode-root-moment", "margins", "margins-nyquist"):
            making.make(Subject(ARM, Chain()), i, made)
    there = files_of(pages / NAME)
    pictures = ("map", "bode-root-moment", "nyquist")
    assert {f"pictures/{picture}.svg" for picture in pictures} <= set(files_of(made))
    assert {f"data/{name}" for name in ("map-data.csv", "nyquist-count.csv", "nyquist-count.json")} <= set(
        files_of(made)
    )
    assert {name: there[name] == content for name, content in files_of(made).items() if there[name] != content} == {}
    write_trust(Evidence(audit=audit_rows, published=validated()), written_proofs(pages), tmp_path / "trust")
    assert files_of(tmp_path / "trust") == files_of(pages / "trust")
    index = index_page(written_cards(pages), trust="trust/index.html")
    assert (pages / "index.html").read_text(encoding="utf-8") == index


@pytest.mark.survey
def test_two_processes_write_what_one_does(pages, tmp_path):
    """The modes, the card and the proof: by two processes, each with hashes of its own, and by the one of `pages`."""
    told = []
    other = replace(HELD, name="other")
    page = write([ARM, other], tmp_path, only=("modes",), progress=lambda *what: told.append(what))
    assert page == tmp_path / "index.html"
    alone = files_of(pages / NAME)
    for name, content in files_of(tmp_path / NAME).items():
        assert name in ("modes.html", "made.json") or content == alone[name], name
    text = (tmp_path / "other" / "modes.html").read_text(encoding="utf-8")
    assert "Modal table" in text
    assert "Bode" not in text
    assert "second assumption" in text
    assert {"other/modes.html", "other/pictures/card.svg"} <= set(Links(tmp_path / "index.html").targets)
    assert [done for done, _, _ in told] == list(range(told[0][1] + 1))
    assert told[-1][0] == told[-1][1]


# ------------------------------------------------------------ pages


def test_every_link_leads_somewhere_and_none_leaves_the_disk(pages):
    for page in pages.rglob("*.html"):
        links = links_of(page)
        for target in links.targets:
            assert ":" not in target.replace("%3A", ""), target
            assert not target.startswith("//")
            path, _, anchor = target.partition("#")
            file = page.parent / unquote(path) if path else page
            assert file.resolve().is_file(), target
            assert not anchor or anchor in ids_of(file)
        assert len(set(links.ids)) == len(links.ids)
        scripts = {"script"} if page.name != "live.html" else set()  # the one page that answers while one points
        assert not links.tags & ({"link", "iframe", "object", "b"} | scripts)
        text = page.read_text(encoding="utf-8")
        assert "http" not in text
        assert "@import" not in text
        assert "url(" not in text


def test_every_picture_has_words(pages):
    links = links_of(pages / NAME / "index.html")
    pictures = [target for target in links.targets if target.endswith(".svg")]
    assert len(set(pictures)) >= 5
    assert all(alt and len(alt) > 30 for alt in links.alts)


def test_no_file_is_left_unlinked_or_half_written(pages):
    linked = {unquote(target) for target in links_of(pages / NAME / "index.html").targets}
    for file in files_of(pages / NAME):
        assert file in linked or file in {"index.html", "card.json", "made.json", "pictures/card.svg"}
        assert (pages / NAME / file).stat().st_size > 100
    linked = {unquote(target) for target in links_of(pages / "trust" / "index.html").targets}
    assert set(files_of(pages / "trust")) <= linked | {"index.html", "evidence.json"}
    assert sorted(p.name for p in pages.iterdir()) == ["assets", "index.html", "trust", NAME]


def test_names_and_assumptions_are_text_and_nothing_else(pages):
    """On the page of the arm, the live one, the index and the one on trust, and in every drawing."""
    for page in pages.rglob("*.html"):
        check_page(page.read_text(encoding="utf-8"), NAME, scripts=3 * (page.name == "live.html"))
    page = (pages / NAME / "index.html").read_text(encoding="utf-8")
    check_page(page, PRINTED.partition("I_h")[0], "second assumption", LONG)
    assert "I<sub>h</sub> in kg m² \u05e9" in page
    for drawing in pages.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))


def test_the_foot_tells_how_to_write_the_page_again(pages):
    page = (pages / NAME / "index.html").read_text(encoding="utf-8")
    toml = (pages / NAME / "arm.toml").read_bytes()
    assert hashlib.sha256(toml).hexdigest() in page
    assert tfarm.load(pages / NAME / "arm.toml") == ARM
    assert f"tfarm {tfarm.__version__}" in page
    assert "--out reports" in page


# ------------------------------------------------------------ what a reader sees at once


def test_the_sign_of_the_gains_stands_once_and_the_words_are_explained(pages):
    text = (pages / NAME / "index.html").read_text(encoding="utf-8")
    assert text.count("accelerates the hub") == 1
    for name in ("proven", "lyapunov-region"):
        assert text.count(f'<dt id="word-{name}">') == 1
    answers = text.partition('id="answers"')[2].partition("</section>")[0]
    assert 'href="#word-default-gains">default gains</a>' in answers


def test_long_matter_is_folded_away_and_answers_stand_first(pages):
    """No table outside <details>; the verdict in the contents; each answer at the top leads to its section."""
    text = (pages / NAME / "index.html").read_text(encoding="utf-8")
    assert "<table" not in re.sub(r"<details>.*?</details>", "", text, flags=re.DOTALL)
    assert text.count("<details>") == text.count("</details>")
    contents = text.partition('class="contents"')[2].partition("</nav>")[0]
    assert 'href="#margins">Is the loop stable, and by how much? <span class="verdict ok">stable</span>' in contents
    answers = text.partition('id="answers"')[2].partition("</section>")[0]
    assert "the loop is stable" in answers
    assert {f'href="#{anchor}"' for anchor in ("margins-map", "margins", "sampled")} <= set(
        re.findall(r'href="#[^"]*"', answers)
    )


def test_every_cell_of_a_narrow_page_says_what_it_is(pages):
    """A table is stacked on a phone: each cell bears the title that stands above its column."""
    text = (pages / NAME / "index.html").read_text(encoding="utf-8")
    assert "<td" in text
    body = "".join(re.findall(r"<tbody>.*?</tbody>", text, flags=re.DOTALL))
    assert all('data-label="' in cell for cell in re.findall(r"<td[^>]*>", body))
    assert not re.search(r"<th[^>]*></th>", text)  # no heading without words


def test_the_pages_of_an_arm_lead_to_each_other(tmp_path, monkeypatch):
    piece = next(piece for piece in making.ARM_PIECES if piece.name == "the arm")
    monkeypatch.setattr(making, "ARM_PIECES", (piece,))
    monkeypatch.setattr(making, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)
    write([replace(ARM, name="plain")], tmp_path, only=("modes", "bode"))
    assert "bode.html" in Links(tmp_path / "plain" / "modes.html").targets
    assert "modes.html" in Links(tmp_path / "plain" / "bode.html").targets
    write([replace(ARM, name="plain")], tmp_path, only=("locus",))
    assert {"bode.html", "modes.html"} <= set(Links(tmp_path / "plain" / "locus.html").targets)


def test_the_index_compares_the_arms(pages):
    """The cells are those of `tfarm margins`: verdict and windows of the default gains."""
    law = default_gains(ARM)
    windows = tfarm.margins(ARM, law).windows
    table = (pages / "index.html").read_text(encoding="utf-8").partition('id="compared"')[2].partition("</section>")[0]
    assert '<span class="verdict ok">stable</span>' in table
    for name in ("K1", "K2"):
        ends = [f"{plain(end, 5)}{'*' * (windows[name].end(end) == 'search bound')}" for end in windows[name].around]
        assert f">{' … '.join(ends)}</td>" in table


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("A little. A constant K2 of 0.336 takes 65 % off the cost. And more.",
         "A little. A constant K2 of 0.336 takes 65 % off the cost."),
        ("One sentence alone", "One sentence alone"),
        ("Stable up to 12.5 rad/s, and no further than that at all (see below). Next.",
         "Stable up to 12.5 rad/s, and no further than that at all (see below)."),
    ],
)  # fmt: skip
def test_a_short_answer_ends_where_a_sentence_does(text, first):
    assert first_sentence(text) == first


# ------------------------------------------------------------ tables


def tables(pages, stem):
    """The rows of a table's CSV and JSON file."""
    with open(pages / NAME / "data" / f"{stem}.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return rows, json.loads((pages / NAME / "data" / f"{stem}.json").read_text(encoding="utf-8"))["rows"]


def from_csv(text):
    try:
        return float(text)
    except ValueError:
        return text


def test_csv_and_json_hold_the_same_numbers(pages):
    stems = {p.stem for p in (pages / NAME / "data").glob("*.json")}
    assert len(stems) >= 10
    for stem in stems:
        rows, records = tables(pages, stem)
        assert len(rows) == len(records) > 0
        for row, record in zip(rows, records, strict=True):
            assert list(row) == list(record)
            for key, value in record.items():
                if isinstance(value, list):
                    assert [float(part) for part in row[key].split()] == value
                else:
                    assert from_csv(row[key]) == (from_csv(value) if isinstance(value, str) else value)
    for file in (pages / NAME / "data").iterdir():
        assert "nan" not in file.read_text(encoding="utf-8").lower()


def test_the_modal_table_is_the_api_to_the_digits_that_hold_everywhere(pages):
    """Frequencies to the last bit; what shapes are needed for to ten digits, as on every processor."""
    _, records = tables(pages, "modal-table")
    modes = tfarm.modes(ARM, count=10)
    assert [r["index"] for r in records] == list(range(11))
    assert [r["natural_frequency_rad_s"] for r in records] == modes.natural_frequency.tolist()
    assert [r["natural_frequency_hz"] for r in records] == modes.natural_frequency_hz.tolist()
    for key in ("hub_participation", "modal_moment"):
        assert [r[key] for r in records] == pytest.approx(getattr(modes, key), rel=5.1e-10, abs=0)
    for record, nodes in zip(records, modes.nodes, strict=True):
        assert record["nodes_m"] == pytest.approx(nodes, rel=0, abs=1e-9 * ARM.link.length)


def test_the_theories_and_sensitivities_are_the_api_too(pages):
    _, records = tables(pages, "theories")
    for theory in ("shear", "rayleigh", "euler-bernoulli"):
        key = theory.replace("-", "_")
        omega = tfarm.modes(ARM, count=10, theory=theory).natural_frequency[1:]
        assert [r[f"{key}_rad_s"] for r in records] == omega.tolist()
        percent = [100 * (r[f"{key}_rad_s"] / r["timoshenko_rad_s"] - 1) for r in records]
        assert [r[f"{key}_difference_percent"] for r in records] == pytest.approx(percent, rel=1e-12)
    _, records = tables(pages, "sensitivities")
    sensitivity = tfarm.modes(ARM, count=10).sensitivity
    named = {r["parameter"].replace("'", "").replace(" ", "_").lower(): r for r in records}
    assert set(named) == set(sensitivity)
    for name, record in named.items():
        assert [record[f"mode_{i}"] for i in range(1, 11)] == pytest.approx(sensitivity[name][1:], rel=0, abs=5.1e-10)


def test_the_responses_are_the_api_too(pages):
    for output in ("root_moment", "tip_displacement"):
        file = pages / NAME / "data" / f"bode-{output.replace('_', '-')}-data.csv"
        records = list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))
        s = [1j * float(r["omega_rad_s"]) for r in records]
        values = tfarm.transfer(ARM, output)(s)
        assert [float(r["real"]) for r in records] == values.real.tolist()
        assert [float(r["imaginary"]) for r in records] == values.imag.tolist()
    _, roots = tables(pages, "bode-root-moment-roots")
    assert {r["magnitude"] for r in roots if r["kind"] == "pole"} == {"inf"}


def test_parameters_that_change_nothing_are_left_out_with_a_word():
    from tfarm.report.modes_section import sensitivity_table

    table = sensitivity_table(tfarm.modes(tfarm.load("sasaki2012"), count=3))
    assert not any("payload" in name for name in table.columns[0].values)
    assert (
        "Left out, as one per cent more of it changes no frequency here: payload mass and payload inertia."
        in table.caption
    )


def test_the_paper_is_corrected_where_the_arm_is_its_own():
    assert not is_from_paper(ARM)
    for name, density in (("sasaki2012", "2766.7 kg/m³"), ("sasaki2012-as-printed", "2.7667 kg/m³")):
        arm = tfarm.load(name)
        assert is_from_paper(arm)
        (table,) = paper_section(arm).blocks
        rows = list(zip(*(column.values for column in table.columns), strict=True))
        (row,) = (row for row in rows if row[1] == "ρ")
        assert row[2:4] == ("2.7667 kg/m³", density)
        assert row[4]
        assert [row[4] for row in rows if row[1] in ("I", "I_h")] == ["needed, but not in the paper: an assumption"] * 2
        assert next(row for row in rows if row[1] == "C")[2:4] == ("0 kg/s", "0 s")


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
    assert "tfarm: 3 of 7 done, last: a section" in seen.splitlines()


class Unmakeable:
    """A piece of the page that cannot be made: in a class, so that a process may be sent it."""

    def __init__(self, error):
        self.error = error

    def __call__(self, *_):
        raise self.error


def test_a_page_is_about_the_arms_own_file(tmp_path, monkeypatch, capsys):
    """Its sampling, converters and motor are those of the page, of the arm.toml beside it, and of the hash."""
    seen = []

    def section(arm, chain):
        seen.append((arm.name, chain))
        return PageSection(anchor="sampled", title="The sampled loop")

    monkeypatch.setattr(making, "ARM_PIECES", (making.Piece("s", "sampled", section, of=("arm", "chain")),))
    monkeypatch.setattr(making, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)
    file = tmp_path / "bench.toml"
    tables = "[sampling]\nperiod = 0.004\n[converters]\nmoment_bits = 12\nmoment_range = 5.0\n[slew]\ntravel = 0.7\n"
    file.write_text(to_toml(ARM) + tables, encoding="utf-8")
    code, _, _ = run(capsys, "report", str(file), "--only", "sampled", "--out", str(tmp_path / "out"))
    chain = load_chain(file)
    assert (code, seen) == (0, [(ARM.name, chain)])
    beside = tmp_path / "out" / ARM.name / "arm.toml"
    assert (tfarm.load(beside), load_chain(beside)) == (ARM, chain)
    page = (tmp_path / "out" / ARM.name / "sampled.html").read_text(encoding="utf-8")
    assert hashlib.sha256(beside.read_bytes()).hexdigest() in page


def without_a_section(monkeypatch, error):
    """A report of two sections, the second of which meets that error."""
    pieces = {piece.name: piece for piece in making.ARM_PIECES}
    broken = replace(pieces["root loci"], make=Unmakeable(error))
    monkeypatch.setattr(making, "ARM_PIECES", (pieces["the arm"], broken))
    monkeypatch.setattr(making, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)


@pytest.mark.parametrize(
    "error",
    [
        tfarm.ConvergenceError("stopped short of the pole", None, None),
        tfarm.CertificationError("not proven: stopped short of the pole"),
        tfarm.ParameterError(key="K2", value=2.0, remedy="stopped short of the pole"),
    ],
)
def test_a_section_that_cannot_be_made_says_why_in_its_place(tmp_path, monkeypatch, error):
    without_a_section(monkeypatch, error)
    told = []
    page = write([ARM], tmp_path, only=("locus",), notice=told.append).read_text(encoding="utf-8")
    assert "stopped short of the pole" in page.partition('id="locus"')[2]
    assert "Parameters" in page
    assert len(told) == 1
    assert "stopped short of the pole" in told[0]


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
    said = [line for line in err.splitlines() if " done" not in line]  # but for progress, on a slow machine
    assert len(said) == 1
    assert said[0].startswith("tfarm: stocky-steel: ")


def test_a_bug_of_ours_stays_loud(tmp_path, monkeypatch):
    without_a_section(monkeypatch, ValueError("cost matrix is infeasible"))
    with pytest.raises(ValueError, match="infeasible"):
        write([ARM], tmp_path / "out", only=("locus",))
    assert not (tmp_path / "out").exists()


def test_every_piece_knows_the_anchor_of_its_section(pages):
    ids = links_of(pages / NAME / "index.html").ids
    assert [piece.anchor for piece in making.ARM_PIECES if piece.is_for(Subject(ARM, Chain()))] == [
        i for i in ids if i in ANCHORS
    ]


PAGES = {  # asked for alone, in their order: their sections of an arm's own loop, and of given laws
    "bode": (("arm", "bode-root-moment", "bode-tip-displacement", "bode-measured"),) * 2,
    "modes": (("arm", "modes"),) * 2,
    "margins": (
        ("margins-map", "arm", "no-loop", "margins", "margins-nyquist"),
        ("margins", "law", "margins-nyquist", "no-loop", "arm"),
    ),
    "locus": (("arm", "no-loop", "locus"), ("law", "locus", "no-loop", "arm")),
    "sampled": (("arm", "no-loop", "sampled"), ("sampled", "law", "no-loop", "arm")),
    "tune": (("arm", "no-loop", "tune"), ("law", "no-loop", "arm")),
    "assumptions": (("arm", "assumptions"),) * 2,
}


def test_each_page_asked_for_alone_has_its_sections():
    assert [page for page in QUESTIONS if page in PAGES] == list(PAGES)  # and others that came later
    found = {
        page: tuple(
            tuple(each.anchor for each in those if each.is_on(page)) for those in (making.ARM_PIECES, making.LAW_PIECES)
        )
        for page in PAGES
    }
    assert found == PAGES


def test_sections_that_answer_and_those_that_are_begun_first():
    """What lasts seconds is begun before all else; the card, which shares proofs with the modes, right after these."""
    answers = {"margins-map", "margins", "locus", "sampled", "tune", "fit", "law", "no-loop"}
    assert answers == frame.ANSWERS
    slow = sorted((each for each in making.ARM_PIECES if each.seconds), key=attrgetter("seconds"), reverse=True)
    assert [each.anchor for each in slow] == ["tune", "sampled", "locus", "modes"]
    assert 0 < making.CARD_SECONDS < slow[-1].seconds


def test_a_page_has_the_same_sections_whatever_is_written_with_it(tmp_path, monkeypatch):
    """Of an arm without a loop: what says so stands on the pages of the loop, and on no other."""
    kept = tuple(replace(each, make=partial(bare, each.anchor)) for each in making.ARM_PIECES)
    monkeypatch.setattr(making, "ARM_PIECES", kept)
    monkeypatch.setattr(making, "save_proof", lambda *_: None)
    plain_cards(monkeypatch.setattr)
    for only in (("modes",), ("locus",), ("modes", "locus")):
        write([HELD], tmp_path, only=only, force=True)
        ids = {page: [i for i in Links(tmp_path / HELD.name / f"{page}.html").ids if i in ANCHORS] for page in only}
        assert ids == {page: {"modes": ["arm", "modes"], "locus": ["arm", "no-loop"]}[page] for page in only}


def bare(anchor, *_):
    """A section that says nothing."""
    return PageSection(anchor=anchor, title=anchor)


@pytest.mark.parametrize(
    ("arms", "only", "key"),
    [
        ((), None, "arms"),
        ((ARM, replace(ARM, assumptions=())), None, "name"),
        ((replace(ARM, name="Pictures"),), None, "name"),
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
    monkeypatch.setattr(making, "ARM_PIECES", ())
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


# ------------------------------------------------------------ odd arms, the README


def test_an_arm_that_cannot_turn_nor_move_its_tip_is_reported_on_too(tmp_path, monkeypatch):
    plain_cards(monkeypatch.setattr)
    arm = replace(
        ARM,
        name="held",
        hub=tfarm.Hub(inertia=math.inf),
        payload=tfarm.Payload(mass=math.inf, inertia=0.1),
        assumptions=(),
    )
    page = write([arm], tmp_path, only=("bode",))
    assert page == tmp_path / "held" / "bode.html"
    text = page.read_text(encoding="utf-8")
    assert "From hub angle to root moment" in text
    assert "is zero at every frequency" in text
    assert "states no assumptions" in text


def test_the_pictures_of_the_readme(tmp_path, monkeypatch):
    coarsen(monkeypatch.setattr)
    paths = readme_pictures(tmp_path)
    assert [path.name for path in paths] == ["bode-root-moment.png", "gains.png", "mode-shapes.png"]
    kept = Path(__file__).parents[2] / "reports" / "pictures"
    assert {path.name for path in kept.iterdir()} == {path.name for path in paths}


POOL = """
import os, time
from concurrent.futures import ProcessPoolExecutor
from tfarm.processes import leave_with_parent, load_beforehand
if __name__ == "__main__":
    pool = ProcessPoolExecutor(1, load_beforehand(["tfarm.errors"]), leave_with_parent)
    print(pool.submit(os.getpid).result(), flush=True)
    time.sleep(60)
"""


def test_the_workers_of_a_run_that_is_killed_leave_with_it(tmp_path):
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        worker = int(process.stdout.readline())
        assert is_alive(worker)
        process.kill()
    deadline = time.monotonic() + 30
    while is_alive(worker):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def is_alive(process):
    """Whether it runs, and is not just waiting for its exit code to be read."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
