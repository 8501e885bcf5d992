"""The loop on an arm's page: what is drawn is what the loop room computes, by a second method where there is one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.contour import QuadContourSet

import tfarm
from tests.plots.labels import complaints
from tests.report.written import coarsen
from tfarm.arm import Hub, HubFeedback
from tfarm.dsp import Chain
from tfarm.dsp.chain import Sampling
from tfarm.dsp.verdict import sampled_brief
from tfarm.errors import ConvergenceError
from tfarm.loop import plane as edges
from tfarm.loop.loci import loci
from tfarm.loop.loop import band_of
from tfarm.loop.nyquist import nyquist, nyquist_of
from tfarm.loop.poles import closed_loop_poles
from tfarm.loop.stability import stability
from tfarm.report import loop_section as map_room
from tfarm.report import page as cases
from tfarm.report import write, writing
from tfarm.report.loop_section import (
    draw_map_of_arm,
    map_data,
    map_of_arm,
    map_section,
    margin_table,
    margins_section,
    verdict_fact,
)
from tfarm.report.page import DESIGNED_MODES, Case, brief_on, has_loop, margins_of, on_hub, prose
from tfarm.spectrum.table import PAPER_GAINS, default_gains

LAB, PURE, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))
EPS = np.finfo(float).eps


@pytest.fixture(scope="module")
def lab():
    return map_of_arm(Case(LAB, Chain()))


@pytest.fixture(scope="module")
def section(lab):
    """The map of the lab's gains on its page."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(map_room, "map_of_arm", lambda case: {lab.case: lab}[case])
        return map_section(Case(LAB, Chain()))


@pytest.fixture(scope="module")
def coarse():
    """The map of the paper's arm on its page: a coarse one, and without the search for the best gains.

    That takes longest and has its own tests.
    """
    with pytest.MonkeyPatch.context() as patch:
        for room in (cases, map_room):
            patch.setattr(room, "best", lambda arm, chain: None)
        coarsen(patch.setattr)
        return map_section(Case(PURE, Chain()))


# ------------------------------------------------------------ the map


def test_the_edge_is_smooth_and_inside_the_picture(lab):
    """Neighbours lie close as seen, so that what is drawn between them is the curve itself."""
    places = np.stack([lab.x.place(lab.edge[:, 0]), lab.y.place(lab.edge[:, 1])])
    assert np.nanmax(np.hypot(*np.diff(places))) < edges.LONG_SEGMENT
    assert np.isnan(lab.edge[-1]).all()


def test_no_part_of_the_edge_is_missing(lab):
    """Where the count changes between neighbours of the grid in a row or column, the line passes between them."""
    edge = np.stack([lab.x.place(lab.edge[:, 0]), lab.y.place(lab.edge[:, 1])], axis=1)
    edge = edge[~np.isnan(edge[:, 0])]
    across, up = lab.x.place(lab.region.K1), lab.y.place(lab.region.K2)
    for axis in (0, 1):
        for row, column in np.argwhere(np.diff(lab.region.unstable, axis=axis)):
            if axis == 1 and lab.region.K1[column] < 0 < lab.region.K1[column + 1]:
                continue  # the line K1 = 0 is drawn on its own
            half = (0.5 / map_room.GRID_COLUMNS) * axis, (0.5 / map_room.GRID_ROWS) * (1 - axis)
            middle = across[column] + half[0], up[row] + half[1]
            assert np.hypot(*(edge - middle).T).min() < edges.SHORT_SEGMENT


def test_contours_reach_the_frame_and_words_overlap_nothing(lab):
    """A line of equal damping ends at the frame, at the stability boundary, or where it began."""
    figure = draw_map_of_arm.figure(lab)
    assert complaints(figure) == []
    assert (*lab.axes[0][[0, -1]], *lab.axes[1][[0, -1]]) == (lab.x.low, lab.x.high, lab.y.low, lab.y.high)
    (contours,) = (each for each in figure.axes[0].collections if isinstance(each, QuadContourSet))
    ends = [line[[0, -1], 1].min() for level in contours.allsegs for line in level if len(line) > 20]
    assert sum(low == lab.y.low for low in ends) > 3


def test_the_contours_are_the_damping_of_the_poles(lab):
    """Least damping ratio by the exact poles in a box, below the band that the caption names."""
    for row, column in ((5, 20), (25, 40), (30, 55)):
        law = HubFeedback(K1=float(lab.axes[0][column]), K2=float(lab.axes[1][row]))
        poles = closed_loop_poles(LAB, law, 6).values
        poles = poles[(poles.imag > 0) & (poles.imag < band_of(LAB, DESIGNED_MODES))]
        expected = (-poles.real / abs(poles)).min()
        assert lab.damping[row, column] == pytest.approx(expected, rel=1e-3, abs=0)  # of a model of eight modes


# ------------------------------------------------------------ margins


def test_the_verdict_comes_before_any_margin():
    """On the page and in the table; and where the loop is not stable there is no margin at all."""
    section = margins_section(Case(LAB, Chain()))
    assert all(fact.value == "STABLE" for fact in section.facts)
    (table,) = (block for block in section.blocks if block.stem == "margins")
    quantities = table.columns[0].values
    assert quantities.index("stability") < min(n for n, name in enumerate(quantities) if "margin" in name)
    wrong = on_hub(PURE, HubFeedback(K1=0.3, K2=1.5), "wrong", "wrong")
    table = margin_table([(wrong, margins_of(PURE, wrong.law))])
    values = dict(zip(table.columns[0].values, table.columns[2].values, strict=True))
    assert values["stability"] == "unstable"
    assert not [name for name in values if "margin" in name or "peak" in name]


# ------------------------------------------------------------ loci


def test_the_answer_of_the_loci_names_the_crossing():
    data = loci(LAB, PAPER_GAINS, "K2", -1.0, 1.6)
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
def test_an_arm_without_a_loop_gets_a_sentence(tmp_path, monkeypatch, inertia, reason):
    for kept in ("save_proof", "save_card"):  # which have their own tests
        monkeypatch.setattr(writing, kept, lambda *_: None)
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


def test_the_star_is_stable_at_the_period_of_its_page(lab, section):
    """The best gains of a page are those of its own chain, and stable there; an unstable law has it in its card."""
    assert all(brief_on(LAB, each.law, Chain()).is_stable for each in lab.case.in_s)
    labels = [text.get_text() for text in draw_map_of_arm.figure(lab).legends[0].get_texts()]
    assert any(label.startswith("best damping") and "stable when sampled every 10 ms" in label for label in labels)
    assert "stable when sampled every 10 ms" in section.answer
    facts = margins_section(Case(LAB, Chain())).facts
    assert all(fact.note.endswith("; stable when sampled every 10 ms") for fact in facts)
    quick = Chain(sampling=Sampling(period=2e-3))
    assert all(
        fact.note.endswith("; stable when sampled every 2 ms") for fact in margins_section(Case(LAB, quick)).facts
    )
    slow, fast = (Case(LAB, each).in_s[1].law.gains.K1 for each in (Chain(), quick))
    assert fast > slow
    lost = on_hub(LAB, HubFeedback(K1=26.0, K2=-3.0), "best in continuous time", "best")
    fact = verdict_fact(lost, margins_of(LAB, lost.law), sampled_brief(LAB, lost.law, Chain()).short)
    assert fact.note.endswith("UNSTABLE when sampled every 10 ms")
    assert set(map_data(lab)[0].values) == {"grid", "boundary"}


@pytest.mark.parametrize("arm", [PURE, LAB], ids=lambda arm: arm.name)
@pytest.mark.parametrize("Kp", [-1e-3, -1e-8, -1e-14])
def test_a_small_unstable_pole_is_not_indented_away(arm, Kp):
    """Kp < 0 leaves one real unstable pole near -Kp/K1, however near to the double pole of L at 0."""
    law = HubFeedback(K1=0.3, K2=0.3, Kp=Kp)
    plot = nyquist(arm, law)
    assert (plot.unstable_by_nyquist, plot.verdict.unstable_roots) == (1, 1)
    radius = abs(plot.s[plot.is_arc][plot.s[plot.is_arc].imag < 1e-2]).min()
    assert radius < plot.verdict.poles.values.real.max() == pytest.approx(-Kp / 0.3, rel=1e-2)


def test_both_counts_of_a_nyquist_plot_are_compared():
    """With a verdict that has lost its unstable poles there is no plot."""
    law = HubFeedback(K1=0.3, K2=1.5)
    verdict = replace(stability(LAB, law), unstable_roots=0)
    with pytest.raises(ConvergenceError, match="by the encirclements of -1, 0 by finding all"):
        nyquist_of(verdict)


def test_poles_within_rounding_of_the_axis_may_count_on_either_side():
    """On a hub of 10,000 beams modes grow by 1e-9 of a rad/s at 1e5: the verdict has them, encirclements may not."""
    arm = PURE.having(hub_inertia=1e4 * PURE.carried_inertia)
    plot = nyquist(arm, HubFeedback(K1=-0.05 * arm.total_inertia))
    assert plot.verdict.unstable_roots_infinite
    assert plot.on_axis > 0
    assert plot.clear + plot.on_axis == plot.verdict.unstable_roots
    assert plot.clear <= plot.unstable_by_nyquist <= plot.verdict.unstable_roots


def test_a_rate_gain_that_only_takes_damping_is_not_shown_to_add_it():
    """The geared rig's own friction damps its first mode most; more rate gain takes of it (poles at a few gains)."""
    rig = tfarm.load("quanser-2dsfl")
    law = default_gains(rig)
    found = loci(rig, law, "K1", 0.0, 2 * law.K1)
    branch = found.exact.branches[found.exact.mode == 1][0]
    first = -branch.real / abs(branch)
    assert (np.diff(first) < 0).all()
    assert (found.best.gain, found.best.damping_ratio) == (0.0, pytest.approx(first[0]))
