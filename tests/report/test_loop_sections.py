"""The loop on an arm's page: what is drawn is what the loop room computes, by a second method where there is one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.contour import QuadContourSet

import tfarm
from tests.plots.labels import complaints
from tests.report.written import coarsen, report_with, values_of
from tfarm.arm import Hub, HubFeedback
from tfarm.arm.chain import Sampling
from tfarm.assessment.card import margins_of
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.loop.continuous import frequency_above_mode
from tfarm.loop.loci import loci
from tfarm.loop.nyquist import nyquist
from tfarm.loop.poles import closed_loop_poles
from tfarm.report import write
from tfarm.report.blocks import prose
from tfarm.report.loop_section import (
    map_section,
    margin_table,
    margins_section,
    recommended_section,
)
from tfarm.report.page import ArmReport, GivenLaw, has_loop
from tfarm.spectrum.gains import PAPER_GAINS, default_gains
from tfarm.synthesis import stability_map
from tfarm.synthesis.design import recommended_gains
from tfarm.synthesis.goals import Checked

LAB, PURE, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))
EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def lab():
    return stability_map.stability_map(LAB, Chain())


@pytest.fixture(scope="module")
def section():
    """The map of the lab's gains on its page."""
    return map_section(ArmReport(LAB, Chain()))


@pytest.fixture(scope="module")
def coarse():
    """The map of the paper's arm on its page: a coarse one."""
    with pytest.MonkeyPatch.context() as patch:
        coarsen(patch.setattr)
        return map_section(ArmReport(PURE, Chain()))


# ------------------------------------------------------------ the map


def test_the_edge_is_smooth_and_inside_the_picture(lab):
    """Neighbours lie close as seen, so that what is drawn between them is the curve itself."""
    places = np.stack([lab.x.place(lab.boundary.points[:, 0]), lab.y.place(lab.boundary.points[:, 1])])
    assert np.nanmax(np.hypot(*np.diff(places))) < 0.03  # of the picture
    assert np.isnan(lab.boundary.points[-1]).all()


def test_no_part_of_the_edge_is_missing(lab):
    """Where the count changes between neighbours of the grid in a row or column, the line passes between them."""
    edge = np.stack([lab.x.place(lab.boundary.points[:, 0]), lab.y.place(lab.boundary.points[:, 1])], axis=1)
    edge = edge[~np.isnan(edge[:, 0])]
    across, up = lab.x.place(lab.region.K1), lab.y.place(lab.region.K2)
    for axis in (0, 1):
        for row, column in np.argwhere(np.diff(lab.region.unstable, axis=axis)):
            if axis == 1 and lab.region.K1[column] < 0 < lab.region.K1[column + 1]:
                continue  # the line K1 = 0 is drawn on its own
            half = (0.5 / stability_map.GRID_COLUMNS) * axis, (0.5 / stability_map.GRID_ROWS) * (1 - axis)
            middle = across[column] + half[0], up[row] + half[1]
            assert np.hypot(*(edge - middle).T).min() < 0.008


def test_contours_reach_the_frame_and_words_overlap_nothing(lab, section):
    """A line of equal damping ends at the frame, at the stability boundary, or where it began."""
    figure = section.blocks[0].figure.again()
    assert complaints(figure) == []
    assert (*lab.coarse.axes[0][[0, -1]], *lab.coarse.axes[1][[0, -1]]) == (
        lab.x.low,
        lab.x.high,
        lab.y.low,
        lab.y.high,
    )
    drawn = [each for each in figure.axes[0].collections if isinstance(each, QuadContourSet)]
    (contours,) = [each for each in drawn if not each.filled]
    ends = [line[[0, -1], 1].min() for level in contours.allsegs for line in level if len(line) > 20]
    assert sum(low == lab.y.low for low in ends) > 3
    to_view = figure.axes[0].transData - figure.axes[0].transAxes
    lines = [to_view.transform(line) for level in contours.allsegs for line in level]
    stubs = [line for line in lines if np.hypot(*np.ptp(line, axis=0)) < 0.05 and (line[0] != line[-1]).any()]
    assert not stubs  # of which one next to K1 = 0


def test_the_contours_are_the_damping_of_the_poles(lab):
    """Least damping ratio by the exact poles in a box, below the band that the caption names."""
    for row, column in ((5, 20), (25, 40), (30, 55)):
        law = HubFeedback(K1=float(lab.coarse.axes[0][column]), K2=float(lab.coarse.axes[1][row]))
        poles = closed_loop_poles(LAB, law, 6).values
        poles = poles[(poles.imag > 0) & (poles.imag < frequency_above_mode(LAB, stability_map.DESIGNED_MODES))]
        expected = (-poles.real / abs(poles)).min()
        assert lab.damping[row, column] == pytest.approx(expected, rel=1e-3, abs=0)  # of a model of eight modes


# ------------------------------------------------------------ margins


def test_the_verdict_comes_before_any_margin():
    """On the page and in the table; and where the loop is not stable there is no margin at all."""
    section = margins_section(ArmReport(LAB, Chain()))
    (table,) = (block for block in section.blocks if block.stem == "margins")
    quantities = table.columns[0].values
    assert quantities.index("stability") < min(n for n, name in enumerate(quantities) if "margin" in name)
    (wrong,) = ArmReport(PURE, Chain(), (GivenLaw(HubFeedback(K1=0.3, K2=1.5)),)).cases
    table = margin_table([(wrong, wrong.margins)])
    values = dict(zip(table.columns[0].values, table.columns[2].values, strict=True))
    assert values["stability"] == "unstable"
    assert not [name for name in values if "margin" in name or "peak" in name]


# ------------------------------------------------------------ loci


def test_the_answer_of_the_loci_names_the_crossing():
    data = loci(Case(LAB, PAPER_GAINS), "K2", -1.0, 1.6)
    assert "unstable from K2 = 1.0305; mode 1" in prose("locus_lead", found={"K2": data}, gains={"K2": "K1 = 0.3"})


# ------------------------------------------------------------ Nyquist


def test_every_pole_on_the_axis_is_passed_on_its_right():
    """At C = 0 half a circle a natural frequency, a quarter at 0; nothing infinite is evaluated."""
    plot = nyquist(PURE, PAPER_GAINS)
    omega = tfarm.modes(PURE, 12).natural_frequency
    assert plot.poles == pytest.approx(omega, rel=4 * EPS, abs=0)
    starts = np.flatnonzero(np.diff(np.r_[0, plot.is_arc.astype(int)]) == 1)
    assert starts.size == omega.size
    assert (plot.s[plot.is_arc].real >= 0).all()
    assert np.isfinite(plot.L).all()
    assert abs(plot.L[plot.is_arc]).min() > 10


# ------------------------------------------------------------ pages


@pytest.mark.parametrize(("inertia", "reason"), [(math.inf, "locked"), (0.0, "no inertia")])
def test_an_arm_without_a_loop_gets_a_sentence(tmp_path, inertia, reason):
    arm = replace(PURE, name="held", hub=Hub(inertia=inertia))
    assert not has_loop(arm)
    page = write([arm], tmp_path, only=("margins",)).read_text()
    assert reason in page
    assert "map.svg" not in page


def test_the_map_shows_its_proof(coarse, section):
    """The whole frame at C = 0; at C > 0 it is drawn dashed and called no proof, in the picture and below it."""
    for page, words, style in ((coarse, "proven", "-"), (section, "not a proof here", "--")):
        picture = page.blocks[0]
        (frame,) = [
            line
            for line in picture.figure.axes[0].lines
            if words in str(line.get_label()) and "K2 < 1" in str(line.get_label())
        ]
        assert frame.get_linestyle() == style
        assert ("not a proof here" in picture.caption) == (page is section)
        assert ("were not looked for" in picture.caption) == (page is section)  # a theorem reaches however deep


# ------------------------------------------------------------ the same gains, sampled


@pytest.mark.parametrize("period", [1e-2, 2e-3])
def test_the_recommended_gains_are_good_at_the_period_of_their_page(section, period):
    """Both loops of their card have the grade good; the table has its values, the map their mark in the region."""
    report = ArmReport(LAB, Chain(sampling=Sampling(period=period)))
    gains = report.in_s[1].law.gains
    card = tfarm.result_card(LAB, gains, report.chain)
    assert (card.sampled.grade, card.continuous.grade) == ("good", "good")
    assert card.sampled.time_constant < tfarm.result_card(LAB, default_gains(LAB), report.chain).sampled.time_constant
    page = recommended_section(report)
    assert page.title == "Recommended gains"
    assert f"K1 = {gains.K1:.6g}" in page.answer
    values = dict(zip(values_of(page.blocks[0])["requirement"], values_of(page.blocks[0])["sampled"], strict=True))
    assert values["PM>=45"] == pytest.approx(card.sampled.phase_margin.value, rel=1e-9)
    if period == report.default.chain.sampling.period == 1e-2:
        labels = [text.get_text() for text in section.blocks[0].figure.legends[0].get_texts()]
        assert any(label.startswith("recommended gains") for label in labels)
        assert any("the paper's, scaled" in label for label in labels)
        assert any(label == "grade good in both loops, approximate" for label in labels)


def test_intervals_are_short_facts_of_the_map(section):
    rows = {row.name: row for row in margins_of(LAB, default_gains(LAB)).stability_intervals}
    assert [fact.label for fact in section.facts] == ["K1, continuous", "K2, continuous"]
    for fact, name in zip(section.facts, ("K1", "K2"), strict=True):
        low, high = (float(end.strip("<> ")) for end in fact.value.strip("()").split(","))
        assert (low, high) == pytest.approx(rows[name].around, rel=5e-4)


def test_without_recommended_gains_there_is_the_reason():
    section = recommended_section(report_with(LAB, recommended=None, why_none="no law K1-K2 is stable"))
    assert section.answer == "None: no law K1-K2 is stable."
    assert not section.card


@pytest.mark.parametrize(
    ("conflicts", "alternatives", "next_step"),
    [
        ((), (), "`tfarm design sasaki2012-lab --trade-off`"),
        (("PM>=45",), (), '`tfarm design sasaki2012-lab --require "delay>=1"`'),
        (("PM>=45",), ("PD",), "`tfarm design sasaki2012-lab --structure PD`"),
    ],
)
def test_gains_that_miss_a_requirement_are_not_recommended(conflicts, alternatives, next_step):
    """The section names what is not met and the next step, and has no card of a controller."""
    missed = Checked("PM>=45", LAB.name, 26.15, 7.901, 0.824)
    met = Checked("delay>=1", LAB.name, 3.0, 4.0, -1.0)
    found = replace(
        recommended_gains(LAB, Chain())[0],
        requirements=(missed, met),
        conflicts=conflicts,
        alternatives=alternatives,
    )
    section = recommended_section(report_with(LAB, recommended=found))
    assert "with the least violation not met: PM>=45." in section.answer
    assert ("Without PM>=45" in section.answer) == bool(conflicts)
    assert next_step in section.answer
    assert not section.card
    assert values_of(section.blocks[0])["sampled"] == [26.15, 3.0]
