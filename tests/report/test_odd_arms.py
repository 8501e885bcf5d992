"""Pages of eight legal arms unlike the paper's: each sentence against the numbers of its page."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.odd_arms import odd_arms
from tests.report import plausible
from tests.report.written import blocks_of, report_with
from tests.shared import thinned
from tfarm import HubFeedback
from tfarm.arm import implausible
from tfarm.assessment.card import margins_of
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.poles import poles_below
from tfarm.report.blocks import prose
from tfarm.report.loop_section import (
    continuous_interval_facts,
    locus_section,
    margin_table,
    margins_section,
)
from tfarm.report.page import ArmReport, GivenLaw, has_loop, sign_words
from tfarm.report.response_sections import (
    arm_section,
    assumptions_section,
    bode_section,
    damped_tables,
    derived_table,
    modal_table,
)
from tfarm.report.sections import pieces_of
from tfarm.spectrum import DampedModes
from tfarm.spectrum.gains import default_gains

ARMS = odd_arms()
DAMPED = [name for name, arm in ARMS.items() if arm.link.damping]


def column(table, key):
    return next(each for each in table.columns if each.key == key)


def number(text):
    """A number as the page prints it."""
    mantissa, _, power = text.replace("−", "-").partition(" × 10")
    return float(mantissa) * 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)


# ------------------------------------------------------------ the arm and its modes


def test_a_locked_hub_is_not_turned_by_a_torque():
    captions = {name: arm_section(ArmReport(arm, Chain())).blocks[0].caption for name, arm in ARMS.items()}
    assert {name for name, caption in captions.items() if "turns the link by the torque u" in caption} == set(ARMS) - {
        "locked",
        "free-pin",
    }
    assert "its input is the angle" in captions["locked"]


@pytest.mark.parametrize("name", ARMS)
def test_cells_of_the_modal_table_are_its_numbers_with_a_few_digits(name):
    """None rounded away, none with more decimals than it has a use for; nodes lie within the arm, and not at 0."""
    modes = tfarm.modes(ARMS[name], count=10)
    table = modal_table(ArmReport(ARMS[name], Chain()))
    for each in table.columns[1:5]:
        assert [number(cell) for cell in each.cells] == pytest.approx(list(each.values), rel=5e-4, abs=0)
        assert max(len(cell) for cell in each.cells) <= 17
    for cell, nodes in zip(table.columns[5].cells, modes.nodes, strict=True):
        shown = [] if cell == "-" else [number(part) for part in cell.split(", ")]
        assert shown == pytest.approx(list(nodes), rel=0.05, abs=0)
    assert not np.any(modes.modal_moment) or name != "free-pin"


@pytest.mark.parametrize("name", DAMPED)
def test_rows_outside_the_certified_box_are_marked(name, monkeypatch):
    """The box and the count that the caption prints hold just the rows marked as inside."""
    monkeypatch.setattr(DampedModes, "certify", lambda self, digits: ())  # seconds, and its own tests
    arm = ARMS[name]
    table, *_ = damped_tables(ArmReport(arm, Chain()), 6)
    count = int(re.search(r"All (\d+) eigenvalues", table.caption)[1])
    edges = re.search(r"with (\S+) < Re s < (.+?) 1/s and .Im s. < (.+?) rad", table.caption)
    left, right, top = (number(edge) for edge in edges.groups())
    marks = column(table, "complete").values
    re_s, im_s = np.array(column(table, "eigenvalue").values).T
    assert [mark == "in the box" for mark in marks] == list((left < re_s) & (re_s < right) & (im_s < top))
    assert count == 2 * sum(mark == "in the box" for mark in marks)
    assert ("outside" in table.caption) == ("outside" in marks)


def test_a_gauge_on_a_free_pin_reads_the_torque():
    section = bode_section(ArmReport(ARMS["free-pin"], Chain()), "root_moment")
    assert "0 poles" not in section.blocks[0].caption
    assert section.words[0].endswith("There are none.")
    assert "zeros ," not in section.words[0]
    G, C = tfarm.transfer(ARMS["free-pin"], "root_moment"), ARMS["free-pin"].link.damping
    s = np.array([3j, 200j, 5 + 900j])
    assert G(s) * (1 + C * s) == pytest.approx(np.full(3, -1.0), rel=1e-12)


def test_a_ratio_that_no_isotropic_material_has_is_not_called_poissons():
    """The boom's E/2G - 1 is 11: of a laminate."""
    named = {name: "E/2G − 1" in column(derived_table(arm), "symbol").values for name, arm in ARMS.items()}
    assert named == {name: name != "boom" for name in ARMS}


def test_a_slip_of_units_is_named_on_the_page():
    link = ARMS["boom"].link
    slip = replace(ARMS["boom"], link=replace(link, density=1.6, length=800.0))
    words = arm_section(ArmReport(slip, Chain())).words
    assert words[0].startswith("Check the units, ")
    assert all(key in words[0] for key in ("link.density = 1.6", "link.length = 800.0"))
    for arm in ARMS.values():
        assert len(arm_section(ArmReport(arm, Chain())).words) == (0 if arm.assumptions else 1) + bool(implausible(arm))


def test_a_contradiction_on_a_page_is_found(tmp_path):
    """The survey of plausible arms sees a count that differs from another, NaN, and a picture that is missing."""
    (tmp_path / "index.html").write_text("<p>K2 up to nan, at 1e-05</p><img src='gone.svg'>")
    counts = {plausible.BY_NYQUIST: 5, "unstable poles": 7, "poles on the axis to working precision": 0}
    rows = [{"quantity": name, "unit": "", "x": count} for name, count in counts.items()]
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "nyquist-count.json").write_text(json.dumps({"rows": rows}))
    found = " ".join(plausible.contradictions(tmp_path))
    assert all(word in found for word in ("gone.svg", "'nan'", "'1e-05'", "5 by Nyquist, 7 in a box"))


# ------------------------------------------------------------ the loop


LOOPS = [name for name, arm in ARMS.items() if has_loop(arm)]


def is_stable(arm, law, up_to):
    """By finding every pole below a frequency: a method without stability intervals."""
    return poles_below(ContinuousLoop(Case(arm, law)), up_to).unstable == 0


@pytest.mark.parametrize("name", thinned(LOOPS, 2))
def test_the_interval_of_K2_is_that_of_the_poles(name):
    """On either side of an edge; at the end of a search nothing happens, and no edge is claimed."""
    arm, law = ARMS[name], default_gains(ARMS[name])
    _, fact = continuous_interval_facts(ArmReport(arm, Chain()))
    down, up = (number(end.strip("<> ()")) for end in re.search(r"\(.+?\)", fact.value)[0].split(", "))
    band = 3 * tfarm.modes(arm, 3).natural_frequency[-1]
    assert is_stable(arm, replace(law, K2=0.999 * up), band)
    assert ">" in fact.value or not is_stable(arm, replace(law, K2=1.001 * up), band)
    assert is_stable(arm, replace(law, K2=down), band)


@pytest.mark.parametrize("name", LOOPS)
def test_sentences_about_the_pole_at_0_and_J_are_for_arms_that_turn_freely(name):
    arm = ARMS[name]
    section = margins_section(ArmReport(arm, Chain(), (GivenLaw(default_gains(arm)),)))
    windows, margins = (blocks_of(section)[stem] for stem in ("law-windows", "margins"))
    shown = [cell for each in margins.columns for cell in each.cells]
    words = " ".join([*section.words, *shown, windows.caption, sign_words(arm)])
    assert ("free hub angle" in words) == ("(J - I_h)/J" in words) == arm.has_rigid_mode
    for interval, searched in zip(*(column(windows, key).values for key in ("interval", "search_range")), strict=True):
        for side, end in zip(("low", "high"), searched, strict=True):
            assert interval is None or (interval[f"{side}_is"] == "search bound") == (interval[side] == end)


def test_branches_that_cannot_be_followed_are_left_out_with_a_word():
    """And never a text of the search."""

    def follow(report, name):
        if name == "K1":
            raise tfarm.ConvergenceError("the damped mode 1 cannot be separated from its neighbours", None, None)
        return ArmReport.locus(report, name)

    section = locus_section(report_with(ARMS["rubber"], locus=follow))
    words = " ".join(section.words)
    assert "separated from its neighbours" not in words
    assert "Along K1 the branches of this arm could not be followed" in words
    stems = ["locus-K2", "locus-K2-branches", "locus-K2-crossings"]
    assert [block.stem for block in section.blocks][:3] == stems


def test_a_free_pin_has_its_rate_loop():
    """K1 at K2 = 0: verdict, windows and locus; no K2, and the gauge as it is."""
    arm = ARMS["free-pin"]
    assert "−u/(1 + C s)" in prose("no_loop", arm=arm)
    assert "at every instant" in prose("no_loop", arm=replace(arm, link=replace(arm.link, damping=0.0)))
    section = margins_section(ArmReport(arm, Chain()))
    assert margins_of(arm, default_gains(arm)).stability.is_stable
    (windows,) = (block for block in section.blocks if block.stem == "default-windows")
    stable = dict(zip(column(windows, "number").values, column(windows, "intervals").values, strict=True))
    assert (stable["K2"], [len(stable[name]) for name in ("K1", "Kp")]) == ([], [1, 1])
    pieces = pieces_of(ArmReport(arm, Chain()))
    names = [each.name for each in pieces if each.page in ("margins", "locus", "sampled", "tune")]
    assert names == ["stability margins", "Nyquist plot", "root loci"]


def test_a_margin_without_end_has_no_frequency():
    (named,) = ArmReport(ARMS["pinned"], Chain(), (GivenLaw(HubFeedback(K1=5.0338, K2=-3.0)),)).cases
    table = margin_table([(named, named.margins)])
    rows = dict(zip(column(table, "quantity").values, table.columns[2].values, strict=True))
    assert rows["margins in the frequency range: phase margin for lead"] == math.inf
    assert rows["margins in the frequency range: phase margin for lag"][1] == pytest.approx(488.89, rel=1e-4)
    (passive,) = ArmReport(ARMS["free-pin"], Chain(), (GivenLaw(HubFeedback(K1=0.283)),)).cases
    table = margin_table([(passive, passive.margins)])
    rows = dict(zip(column(table, "quantity").values, table.columns[2].values, strict=True))
    assert rows["margins in the frequency range: disk margin"] == pytest.approx(2.0)


# ------------------------------------------------------------ what the assumptions do


def test_frequencies_over_the_hub_inertia_are_those_of_arms_that_have_it():
    """The arm's own value once."""
    arm = tfarm.load("sasaki2012-lab")
    _, table = assumptions_section(ArmReport(arm, Chain())).blocks
    assert table.title == "Candidate hub inertias"
    assert sum(column(table, "is_own").values) == 1
    for inertia, omega in zip(
        *(column(table, key).values for key in ("hub_inertia_kg_m2", "natural_frequency_rad_s")), strict=True
    ):
        assert omega == tfarm.modes(arm.with_numbers(hub_inertia=inertia), 4).natural_frequency[1:].tolist()
