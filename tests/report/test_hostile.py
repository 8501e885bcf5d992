"""Hostile names and texts are text on the pages that a report has not always: of a fit, and of what cannot be made."""

from dataclasses import replace

import numpy as np

import tfarm
from tests.hostile import NAME, TEXT, check_drawing, check_page
from tfarm.dsp import Chain
from tfarm.fitting.fit import fit
from tfarm.report import writing
from tfarm.report.cases import Case
from tfarm.report.live import save_live
from tfarm.report.response_sections import fit_section
from tfarm.report.sections import save_section

LAB = replace(tfarm.load("sasaki2012-lab"), name=NAME)
OMEGA = np.geomspace(8.0, 300.0, 30)


def test_of_a_fit(tmp_path):
    H = tfarm.transfer(LAB, "root_moment")(1j * OMEGA)
    seen = tfarm.Measured(output="root_moment", input="hub_torque", omega=OMEGA, values=H, sigma=abs(H), source=TEXT)
    found = fit(LAB, [seen], free=["hub.inertia"], profile=False)
    saved = save_section(fit_section(Case(found.arm, Chain(), (), found), 2), tmp_path)
    for suffix in ("svg", "json"):
        assert list(tmp_path.rglob(f"*.{suffix}"))
    for drawing in tmp_path.rglob("*.svg"):
        check_drawing(drawing.read_text(encoding="utf-8"))
    writing._write_pages(Case(found.arm, Chain(), (), found), tmp_path, [saved], None, "", tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    check_page(page, NAME)
    assert "\u202e" not in page


def test_of_a_section_and_a_live_page_that_cannot_be_made(tmp_path, monkeypatch):
    error = tfarm.ConvergenceError(TEXT, 0.0, 1.0)

    def fails(*_):
        raise error

    monkeypatch.setattr("tfarm.report.live.live_data", fails)
    save_live(Case(LAB, Chain()), tmp_path)
    check_page((tmp_path / "live.html").read_text(encoding="utf-8"), NAME, TEXT)
    saved = writing.make_section("stability region of both gains", "margins-map", fails, Case(LAB, Chain()), tmp_path)
    assert saved.failure
    writing._write_pages(Case(LAB, Chain()), tmp_path, [saved], None, "", tmp_path)
    check_page((tmp_path / "index.html").read_text(encoding="utf-8"), NAME, TEXT.partition(" & ")[0])
