"""The pages as a reader gets them: complete, the same on every run, and all or nothing."""

import hashlib
import json
import math
import re
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import pytest

import tfarm
from tests.hostile import LONG, NAME, PRINTED, Read, check_drawing, check_page
from tests.report.readme import PICTURES, write_pictures
from tests.report.written import (
    ARM,
    HELD,
    Links,
    Unmakeable,
    coarsen,
    files_of,
    ids_of,
    links_of,
    validated,
)
from tfarm.assessment.card import Graded, LoopCard
from tfarm.dsp import Chain, load_chain
from tfarm.loop.edges import LowerBound
from tfarm.plots.style import GOOD, LOW, MARGINAL, POOR, UNSTABLE
from tfarm.report import page as report_page
from tfarm.report import write, writing
from tfarm.report.blocks import TEMPLATES, explain_commands, prose, sheet, templates
from tfarm.report.overview import Card, results, save_card
from tfarm.report.page import ArmReport, GivenLaw
from tfarm.report.response_sections import arm_section
from tfarm.report.sections import PIECES, QUESTIONS, make_section, pieces_of
from tfarm.report.trust import write_trust, written_proofs
from tfarm.report.writing import navigation, read_records, write_index
from tfarm.schema import Column, quantities, to_dict
from tfarm.spectrum.gains import default_gains
from tfarm.synthesis.design import recommended_gains

# ------------------------------------------------------------ the same bytes


def test_another_process_with_other_hashes_writes_the_same_bytes(pages, audit_rows, tmp_path, monkeypatch):
    """What is quickly made, and the page on trust; of all sections: `python -m tests.report.twice`."""
    coarsen(monkeypatch.setattr)
    made = tmp_path / "made"
    made.mkdir()
    case = ArmReport(ARM, Chain())
    for piece in pieces_of(case):
        if piece.anchor in ("margins-map", "bode-root-moment", "margins", "margins-nyquist"):
            make_section(piece, case, made)
    there = files_of(pages / NAME)
    pictures = ("map", "bode-root-moment", "default-nyquist")
    assert {f"pictures/{picture}.svg" for picture in pictures} <= set(files_of(made))
    assert {f"data/{name}" for name in ("map-data.csv", "nyquist-count.csv", "nyquist-count.json")} <= set(
        files_of(made)
    )
    assert {name: there[name] == content for name, content in files_of(made).items() if there[name] != content} == {}
    write_trust(audit_rows, validated(), written_proofs(pages), tmp_path / "trust")
    assert files_of(tmp_path / "trust") == files_of(pages / "trust")
    again = tmp_path / "again"
    shutil.copytree(pages, again)
    assert index_of(again) == (pages / "index.html").read_text(encoding="utf-8")


def index_of(out):
    """The index of a folder of reports, written anew."""
    (out / "index.html").unlink(missing_ok=True)
    (out.parent / f"{out.name}-stage").mkdir()
    write_index(out, out.parent / f"{out.name}-stage")
    return (out / "index.html").read_text(encoding="utf-8")


@pytest.mark.survey
def test_two_processes_write_what_one_does(pages, tmp_path):
    """The modes, the card and the proof: by two processes, each with hashes of its own, and by the one of `pages`."""
    reports = []
    other = replace(HELD, name="other")
    page = write([ARM, other], tmp_path, only=("modes",), progress=lambda *what: reports.append(what))
    assert page == tmp_path / "index.html"
    alone = files_of(pages / NAME)
    for name, content in files_of(tmp_path / NAME).items():
        assert name == "modes.html" or content == alone[name], name
    text = (tmp_path / "other" / "modes.html").read_text(encoding="utf-8")
    assert "Modal table" in text
    assert "Bode" not in text
    assert "second assumption" in text
    assert {"other/modes.html", "other/pictures/card.svg"} <= set(Links(tmp_path / "index.html").targets)
    dones = [done for done, _, _ in reports]
    assert dones == sorted(dones)
    assert reports[-1] == (reports[0][1], reports[0][1], "pages")
    running = [names.split(", ") for _, _, names in reports[:-1]]
    assert max(map(len, running)) == 2
    assert {name for names in running for name in names} >= {f"{NAME}: modes", "other: modes", "other: card"}


# ------------------------------------------------------------ pages


def test_every_link_leads_somewhere_on_the_disk_and_every_picture_has_words(pages):
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
        assert page.parent.name != NAME or all(alt and len(alt) > 30 for alt in links.alts)
        scripts = {"script"} if page.name != "live.html" else set()  # the one page that answers while one points
        assert not links.tags & ({"link", "iframe", "object", "b"} | scripts)
        text = page.read_text(encoding="utf-8")
        assert "http" not in text.replace("<meta http-equiv=", "")  # the policy that refuses other addresses
        assert "@import" not in text
        assert "url(" not in text


def test_no_file_is_left_unlinked_or_half_written(pages):
    linked = {unquote(target) for page in (pages / NAME).glob("*.html") for target in links_of(page).targets}
    for file in files_of(pages / NAME):
        assert file in linked or file in {"index.html", "card.json", "pictures/card.svg"}
        assert (pages / NAME / file).stat().st_size > 50
    linked = {unquote(target) for target in links_of(pages / "trust" / "index.html").targets}
    assert set(files_of(pages / "trust")) <= linked | {"index.html"}
    assert sorted(p.name for p in pages.iterdir()) == ["assets", "index.html", "trust", NAME]


def test_names_and_assumptions_are_text_and_nothing_else(pages):
    """On the page of the arm, the live one, the index and the one on trust, and in every drawing."""
    for page in pages.rglob("*.html"):
        text, is_live = page.read_text(encoding="utf-8"), page.name == "live.html"
        check_page(text, NAME, scripts=2 * is_live)
        kinds = ['type="application/json" id="live-data"', 'src="../assets/live.js"']  # its numbers, its code
        assert re.findall(r"<script ([^>]*)>", text) == kinds * is_live
    page = (pages / NAME / "modes.html").read_text(encoding="utf-8")
    check_page(page, PRINTED.partition("I_h")[0], "second assumption", LONG)
    assert "I<sub>h</sub> in kg m² \u05e9" in page
    for drawing in pages.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))


def test_the_foot_has_the_command_to_write_the_page_again(pages):
    page = (pages / NAME / "index.html").read_text(encoding="utf-8")
    toml = (pages / NAME / "arm.toml").read_bytes()
    assert hashlib.sha256(toml).hexdigest() in page
    assert tfarm.load(pages / NAME / "arm.toml") == ARM
    assert f"tfarm {tfarm.__version__}" in page
    assert "--out reports" in page


# ------------------------------------------------------------ what a reader sees at once


BLOCKS = ("result", "modes", "margins-map", "margins", "sampled", "locus", "arm")  # of a first page, in their order


def test_the_first_page_has_the_card_and_the_pictures_in_their_order(pages):
    page = pages / NAME / "index.html"
    text, links = page.read_text(encoding="utf-8"), links_of(page)
    assert [each for each in links.ids if each in BLOCKS] == list(BLOCKS)
    pictures = [target for target in links.targets if target.endswith(".svg") and not target.endswith("-narrow.svg")]
    assert pictures == [f"pictures/{name}.svg" for name in ("map", "default-bode", "sampled-slew", "locus-K2", "arm")]
    assert len(links.alts) == len(pictures)
    assert not links.tags & {"details", "figcaption"}
    for anchor in BLOCKS[1:]:
        heading = text.partition(f'id="{anchor}"')[2].partition("</h2>")[0]
        page = "modes" if anchor == "arm" else anchor.partition("-")[0]
        assert f'href="{page}.html"' in heading
    shown = tfarm.modes(ARM, 5).natural_frequency[1:]
    assert [row[1] for row in Read(text).rows if row[0].isdigit()] == [f"{omega:.6g}" for omega in shown]
    found, _ = recommended_gains(ARM, Chain())
    assert ('href="margins.html#margins-recommended"' in text) == (found is not None and found.is_met)
    assert tfarm.simulate(ARM, default_gains(ARM), duration=3.0).settling_time is None
    assert "<dt>settling time of the root moment</dt><dd>not settled within 3.000 s</dd>" in text


def test_every_number_of_the_card_is_that_of_the_json(pages):
    """The table of the first page against the answer of `tfarm margins --json`; on each page the same in one line."""
    card = to_dict(tfarm.result_card(ARM, default_gains(ARM)))
    page = (pages / NAME / "index.html").read_text(encoding="utf-8")
    rows = {row[0]: row[1:] for row in Read(page.partition('id="result"')[2].partition("</section>")[0]).rows}
    units = {"gain_margin_db": "dB", "gain_reduction_db": "dB", "phase_margin_deg": "deg", "delay_margin_ms": "ms",
             "peak_sensitivity": ""}  # fmt: skip
    for column, loop in enumerate(("continuous", "sampled")):
        own = card[loop]
        named = f"{own['stability']}, {own['grade']}: {', '.join(own['limited_by'])}"
        assert rows["stability"][column].strip() == (named if own["limited_by"] else own["stability"])
        for of in quantities(LoopCard).values():
            if of.key in units:
                value, cell = own[of.key], rows[of.label][column].replace("−", "-")
                size = size_of(value["value"], units[of.key])
                assert cell.startswith(f"{size} {value['grade']}" if value["grade"] != "-" else "-")
        assert rows["disk margin"][column].strip() == size_of(own["disk_margin"])
        assert rows["dominant time constant"][column].replace("−", "-").strip() == size_of(own["time_constant_s"], "s")
        for name in (*QUESTIONS.keys() - {"law", "fit"},):
            line = Read((pages / NAME / f"{name}.html").read_text(encoding="utf-8").partition("</ul>")[0]).texts
            assert f"PM {size_of(own['phase_margin_deg']['value'], 'deg')}" in " ".join(" ".join(line).split())


def size_of(value, unit=""):
    """A number as a card has it."""
    return "-" if value is None else "no limit" if value == math.inf else f"{value:.4g} {unit}".rstrip()


def test_every_page_marks_itself_in_the_same_navigation(pages):
    own = [page for page in (pages / NAME).glob("*.html") if page.name != "live.html"]
    bars = set()
    for page in own:
        (bar,) = re.findall(r'<nav aria-label="Pages">.*?</nav>', page.read_text(encoding="utf-8"))
        assert re.findall(r'href="([^"]*)" aria-current="page"', bar) == [page.name]
        bars.add(bar.replace(' aria-current="page"', ""))
    (bar,) = bars
    leads = re.findall(r'href="([^"]*)"', bar)
    assert {"../index.html", "live.html", "../trust/index.html", *(page.name for page in own)} == set(leads)


def test_pages_lead_to_exported_files(tmp_path):
    """To those of the export alone, whatever else is in its folder."""
    arm, folder = tfarm.load("sasaki2012-lab"), tmp_path / "sasaki2012-lab"
    plain = navigation(arm, [], "", folder)
    (folder / "export").mkdir(parents=True)
    for name in ("controller.h", "controller.c", "loop.fmu", "<evil>.h"):
        (folder / "export" / name).write_bytes(b"")
    found = [each for each in navigation(arm, [], "", folder) if each not in plain]
    assert found == [("export/controller.h", "Exported: controller.h"), ("export/loop.fmu", "Exported: loop.fmu")]


def test_no_paragraph_is_on_two_pages_and_words_are_explained_in_one_place(pages):
    own = [page for page in (pages / NAME).glob("*.html") if page.name != "live.html"]
    texts = {page: page.read_text(encoding="utf-8") for page in (*own, pages / "trust" / "index.html")}
    seen = defaultdict(set)
    for page, text in texts.items():
        for paragraph in re.findall(r"<(?:p|figcaption)\b[^>]*>(.{60,}?)</", text.partition("<footer>")[0]):
            seen[paragraph].add(page)
    assert len(seen) > 20
    assert [paragraph for paragraph, where in seen.items() if len(where) > 1] == []
    every = "".join(texts.values())
    assert every.count("accelerates the hub") == 1
    for name in ("proven", "lyapunov-region"):
        assert every.count(f'<dt id="word-{name}">') == 1
    first = texts[pages / NAME / "index.html"]
    assert 'href="../trust/index.html#word-default-gains">default gains</a>' in first


def test_without_the_page_of_words_none_is_linked():
    assert explain_commands("Proven: `tfarm design`.") == "Proven: <code>tfarm design</code>."
    assert 'href="x.html#word-proven">Proven</a>' in explain_commands("Proven.", "x.html")


def test_a_page_has_a_narrow_picture_for_a_phone(tmp_path):
    """As wide as a screen of 400 pixels less its margins, the other half a page; both of the size that is stated."""
    piece = next(piece for piece in PIECES if piece.anchor == "bode-root-moment")
    section = make_section(piece, ArmReport(tfarm.load("sasaki2012-lab"), Chain()), tmp_path)
    source, image = re.findall(r"<(?:source|img) ([^>]*)>", section.blocks[0].html)
    assert 'media="(max-width: 40rem)" srcset="pictures/bode-root-moment-narrow.svg"' in source
    for tag, end, least, most in ((source, "-narrow", 360, 370), (image, "", 590, 600)):
        drawn = (tmp_path / "pictures" / f"bode-root-moment{end}.svg").read_text("utf-8")
        own = [float(re.search(rf'<svg [^>]*{key}="([\d.]+)pt"', drawn).group(1)) for key in ("width", "height")]
        stated = [float(re.search(rf'{key}="(\d+)"', tag).group(1)) for key in ("width", "height")]
        assert least <= stated[0] <= most
        assert stated == pytest.approx([x * 96 / 72 for x in own], abs=0.6)


def test_pills_have_the_colours_of_the_grades():
    """Those of the pictures; the words of each are on it, for grey print."""
    style_sheet = (TEMPLATES / "style.css").read_text(encoding="utf-8")
    light, dark, paper = (part.partition("}")[0] for part in style_sheet.split(":root {")[1:4])
    named = {"good": GOOD, "low": LOW, "poor": POOR, "marginal": MARGINAL, "unstable": UNSTABLE}
    for name, colour in named.items():
        assert f"--{name}: {colour};" in light
        assert f"--{name}: {colour};" in paper
        assert re.search(rf"--{name}: #", dark)
        assert re.search(rf"^\.(verdict\.)?{name} {{.*var\(--{name}\)", style_sheet, flags=re.MULTILINE)


@pytest.mark.parametrize(
    ("stability", "grade", "limits", "pill"),
    [
        ("stable", "good", (), ("stable", "good")),
        ("stable", "low", ("phase margin",), ("stable, low: phase margin", "low")),
        ("stable", "poor", ("phase margin", "Ms"), ("stable, poor: phase margin, Ms", "poor")),
        ("marginal", "-", (), ("marginal", "marginal")),
        ("unstable", "-", (), ("unstable", "unstable")),
    ],
)
def test_a_pill_is_green_for_a_good_loop_alone(stability, grade, limits, pill):
    card = tfarm.result_card(ARM, default_gains(ARM))
    own = replace(card.continuous, stability=stability, grade=grade, limited_by=limits)
    (loop,) = results(replace(card, continuous=own, sampled=None), "gains")
    words, look = pill
    shown = templates().get_template("blocks.html").module.pill(loop)
    assert shown == f'<span class="verdict {look}">{words}</span>'


def test_long_matter_is_folded_on_the_pages_of_sections_and_every_cell_has_its_title(pages):
    """No table outside <details>, but for a card; a table is stacked on a phone, so no heading is without words."""
    for page in (*(pages / NAME).glob("*.html"), pages / "index.html"):
        text = page.read_text(encoding="utf-8")
        if page.name not in ("index.html", "live.html"):
            outside = re.sub(r"<details>.*?</details>", "", text, flags=re.DOTALL)
            assert outside.count("<table") == outside.count('<table class="result"') <= (page.name == "margins.html")
            assert text.count("<details>") == text.count("</details>")
        if page.name != "live.html":
            body = "".join(re.findall(r"<tbody>.*?</tbody>", text, flags=re.DOTALL))
            assert all('data-label="' in cell for cell in re.findall(r"<td[^>]*>", body))
            assert not re.search(r"<th[^>]*></th>", text)
    assert "<td" in body  # of the index, which is the last


def test_the_pages_of_an_arm_lead_to_each_other(tmp_path):
    """To those that are written later too; and an arm that cannot turn nor move its tip is reported on."""
    held = replace(HELD, name="held", payload=tfarm.Payload(mass=math.inf, inertia=0.1), assumptions=())
    page = write([held], tmp_path, only=("bode",))
    assert page == tmp_path / "held" / "bode.html"
    text = page.read_text(encoding="utf-8")
    assert "From hub angle to root moment" in text
    assert "is zero at every frequency" in text
    assert "states no assumptions" in arm_section(ArmReport(held, Chain())).words[0]
    write([held], tmp_path, only=("modes", "assumptions"))
    assert {"bode.html", "assumptions.html"} <= set(Links(tmp_path / "held" / "modes.html").targets)
    assert {"bode.html", "modes.html"} <= set(Links(tmp_path / "held" / "assumptions.html").targets)


def test_the_index_has_a_row_a_loop(pages):
    """Verdicts and margins are those of `tfarm margins`; with the small picture and the first three frequencies."""
    card, text = tfarm.result_card(ARM, default_gains(ARM)), (pages / "index.html").read_text(encoding="utf-8")
    assert text.count("<table") == 1
    assert "pictures/card.svg" in text
    rows = [row for row in Read(text).rows if row[0] != "arm"]
    for row, own in zip(rows, (card.continuous, card.sampled), strict=True):
        assert row[-5].strip() == own.finding
        assert row[-3].startswith(size_of(own.phase_margin.value, "deg"))
        assert row[-1].startswith(size_of(own.peak_sensitivity.value))
        assert row[-3].endswith(own.phase_margin.grade)
    for omega in tfarm.modes(ARM, 3).natural_frequency[1:]:
        assert f"{omega:.6g}" in rows[0][2]


# ------------------------------------------------------------ the README, processes


def test_the_pictures_of_the_readme(tmp_path, monkeypatch):
    coarsen(monkeypatch.setattr)
    write_pictures(tmp_path)
    assert {path.name for path in PICTURES.iterdir()} == set(files_of(tmp_path))


POOL = """
import os, time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from tfarm.processes import leave_with_parent
if __name__ == "__main__":
    pool = ProcessPoolExecutor(1, get_context("forkserver"), leave_with_parent)
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


# ------------------------------------------------------------ texts


TEXTS = (TEMPLATES / "prose.txt").read_text(encoding="utf-8")
NAMES = set(re.findall(r"{% macro (\w+)\(", TEXTS))
OF_TRUST = {f"trust_{name}" for name in ("proofs", "accuracy", "published")}  # used by its template


def test_every_text_is_used():
    code = "\n".join(file.read_text(encoding="utf-8") for file in TEMPLATES.parent.glob("*.py"))
    assert set(re.findall(r'(?:prose|picture|sheet)\(\s*"(\w+)"', code)) <= NAMES
    used = {name for name in NAMES if f'"{name}"' in code} | OF_TRUST
    assert all(TEXTS.count(f"{name}(") > 1 for name in NAMES - used)  # which other texts have in them


def test_line_breaks_of_a_text_are_spaces_and_a_table_has_title_and_caption():
    assert prose("fit", verdict="fitted", found="3 numbers").startswith("Fitted: 3 numbers. The interval holds")
    controller = SimpleNamespace(name="A ¶ <law>")
    table = sheet("intervals", [Column("row", "", of=["x1"])], stem="of-a-law", each=controller, note="B ¶")
    assert (table.stem, table.title) == ("of-a-law", "Stability intervals of A ¶ <law>")
    assert table.caption.endswith("B ¶.")


# ------------------------------------------------------------ the index


LAB = tfarm.load("sasaki2012-lab")
FAST = tfarm.Law({"hub_angle": ((2.0, 30.0), (0.002, 1.0)), "root_moment": -0.2}, delay=0.002, name="PD, fast")
SLOW = tfarm.Law({"hub_angle": ((0.2, 0.3), (0.1, 1.0))}, name="PD, slow")
SAMPLED = tfarm.Law({"hub_rate": ((0.3,), (1.0,))}, period=0.01, name="sampled")


def rows_of(tmp_path, laws, chain):
    """The rows that the index has of an arm with a page."""
    folder = tmp_path / LAB.name
    folder.mkdir()
    save_card(ArmReport(LAB, chain, tuple(laws)), folder)
    (folder / "index.html").write_text("a page")
    (card,) = read_records(tmp_path, "card", Card).values()
    return card.loops, index_of(tmp_path)


@pytest.mark.parametrize("law", [FAST, SLOW])
def test_a_law_has_its_own_verdicts_and_nothing_of_the_default_gains(tmp_path, law):
    """Those of the answers to `margins` and `sampled`; at 10 ms one of them does not hold."""
    chain = load_chain(LAB.name)
    (row, sampled), page = rows_of(tmp_path, [GivenLaw(law)], chain)
    assert row["controller"] == sampled["controller"] == law.name
    assert row["finding"].split(",")[0] == tfarm.margins(LAB, law).stability.word == "stable"
    assert sampled["finding"].split(",")[0] == tfarm.sampled(LAB, law).verdict.word
    assert (sampled["stability"] == "unstable") == (law is FAST)
    assert sampled["loop"] == "sampled, 10 ms"
    assert f">{sampled['finding']}</span></td>" in page
    assert law.name in page
    assert "K1 = 0.3" not in page


def test_each_law_has_a_row_and_one_in_z_no_continuous_verdict(tmp_path):
    rows, page = rows_of(tmp_path, [GivenLaw(SAMPLED), GivenLaw(tfarm.HubFeedback(K1=0.3, K2=0.3))], Chain())
    assert [row["loop"] for row in rows] == ["sampled, 10 ms", "continuous-time", "sampled, 10 ms"]
    assert [row["finding"].split(",")[0] for row in rows] == ["stable"] * 3
    assert page.count('rowspan="3"') == 3


def test_the_overview_says_what_limits_what_sampling_costs_and_what_is_next(tmp_path):
    """Each number is that of a record: result card, modes, recommended gains."""
    save_card(ArmReport(LAB, Chain()), tmp_path)
    mode, sampling, following = json.loads((tmp_path / "card.json").read_text(encoding="utf-8"))["words"]
    card = tfarm.result_card(LAB, default_gains(LAB))
    phase = card.sampled.phase_margin
    omega = tfarm.modes(LAB, 1).natural_frequency[-1]
    assert f"phase margin limits the sampled loop: {phase.value:.4g} deg at {phase.omega:.4g}" in mode.replace(
        "63.40", "63.4"
    )
    assert f"mode 1 ({omega:.4g} rad/s)" in mode
    lost = card.continuous.delay_margin_periods - card.sampled.delay_margin_periods
    assert f"({lost:.3g} lost)" in sampling
    gains = recommended_gains(LAB, Chain())[0].law
    assert f"`tfarm step sasaki2012-lab --K1 {gains.K1:g} --K2 {gains.K2:g}`" in following
    time_constant = tfarm.result_card(LAB, gains).sampled.time_constant
    assert f"{time_constant:.4g} s instead of {card.sampled.time_constant:.4g} s" in following
    good = [GivenLaw(gains)]
    save_card(ArmReport(LAB, Chain(), tuple(good)), tmp_path)
    *_, following = json.loads((tmp_path / "card.json").read_text(encoding="utf-8"))["words"]
    assert following.startswith("Next: `tfarm export`")


def test_an_arm_without_hub_inertia_has_its_loops_and_the_reason_why_there_is_no_other(tmp_path):
    bare = replace(LAB, hub=tfarm.Hub(inertia=0.0))
    save_card(ArmReport(bare, Chain()), tmp_path)
    card = json.loads((tmp_path / "card.json").read_text(encoding="utf-8"))
    assert [loop["loop"] for loop in card["loops"]] == ["continuous-time", "sampled, 10 ms"]
    assert "The hub of this arm has no inertia" in card["notes"][0]
    writing._write_pages(ArmReport(bare, Chain()), tmp_path, [], (), "", tmp_path)
    assert "The hub of this arm has no inertia" in (tmp_path / "index.html").read_text(encoding="utf-8")


def test_a_lower_bound_is_one_on_a_card():
    card = tfarm.result_card(LAB, tfarm.HubFeedback(K1=0.3))
    margin = replace(card.sampled, delay_margin=Graded(LowerBound(200.0), None, "good"), delay_margin_periods=20.0)
    (loop,) = results(replace(card, continuous=None, sampled=margin), "gains")
    cell = str(templates().get_template("blocks.html").module.cell(loop, "delay_margin_ms"))
    words = " ".join("".join(Read(cell).texts).split())
    assert words == "≥ 200 ms good 20 periods"


def test_a_card_that_is_not_determined_has_its_reason(tmp_path, monkeypatch):
    monkeypatch.setattr(report_page, "result_card", Unmakeable(tfarm.ConvergenceError("stopped short", None, None)))
    loops, page = rows_of(tmp_path, [], Chain())
    assert (loops, "no loop" in page) == ((), True)
    (card,) = read_records(tmp_path, "card", Card).values()
    assert "default gains: not determined, stopped short" in card.notes[0]
