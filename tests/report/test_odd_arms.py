"""What the pages say of eight legal arms unlike the paper's: each sentence against the numbers of its own page."""

import re

import numpy as np
import pytest

import tfarm
from tests.odd_arms import odd_arms
from tfarm.report.arm_section import arm_section
from tfarm.report.bode_section import bode_section
from tfarm.report.damped_table import damped_table
from tfarm.report.modes_section import modal_table, places
from tfarm.spectrum import DampedModes

ARMS = odd_arms()
DAMPED = [name for name, arm in ARMS.items() if arm.link.damping]


def column(table, key):
    return next(each for each in table.columns if each.key == key)


def number(text):
    """A number as the page prints it."""
    mantissa, _, power = text.replace("−", "-").partition(" × 10")
    return float(mantissa) * 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)


# ------------------------------------------------------------ the arm and its modes


def test_a_locked_hub_is_not_said_to_be_turned_by_a_torque():
    captions = {name: arm_section(arm).blocks[0].caption for name, arm in ARMS.items()}
    assert {name for name, caption in captions.items() if "turns the link by the torque u" in caption} == set(ARMS) - {
        "locked",
        "free-pin",
    }
    assert "led through the angle" in captions["locked"]


@pytest.mark.parametrize("name", ARMS)
def test_cells_of_the_modal_table_are_its_numbers_with_a_few_digits(name):
    """None rounded away, none with more decimals than it has a use for; nodes lie within the arm, and not at 0."""
    modes = tfarm.modes(ARMS[name], count=6)
    table = modal_table(modes)
    for each in table.columns[1:5]:
        assert [number(cell) for cell in each.cells] == pytest.approx(list(each.values), rel=5e-4, abs=0)
        assert max(len(cell) for cell in each.cells) <= 17
    for cell, nodes in zip(column(table, "nodes_m").cells, modes.nodes, strict=True):
        shown = [] if cell == "none" else [number(part) for part in cell.split(", ")]
        assert shown == pytest.approx(list(nodes), rel=0.05, abs=0)
    assert not np.any(modes.modal_moment) or name != "free-pin"


def test_a_node_next_to_the_hub_keeps_its_place():
    assert places(np.array([3.1e-6, 0.02468, 0.049]), 0.05) == ("3.1 × 10⁻⁶", "0.024680", "0.049000")
    assert places(np.array([1.5e-5, 0.4321]), 1.0) == ("1.5 × 10⁻⁵", "0.4321")


@pytest.mark.parametrize("name", DAMPED)
def test_rows_outside_the_certified_box_are_marked(name, monkeypatch):
    """The box and the count that the caption prints hold just the rows that are said to be in it."""
    monkeypatch.setattr(DampedModes, "certify", lambda self, digits: ())  # seconds, and its own tests
    arm = ARMS[name]
    table = damped_table(tfarm.modes(arm, count=6))
    count = int(re.search(r"All (\d+) eigenvalues", table.caption)[1])
    edges = re.search(r"with (\S+) < Re s < (.+?) 1/s and .Im s. < (.+?) rad", table.caption)
    left, right, top = (number(edge) for edge in edges.groups())
    marks = column(table, "complete").values
    re_s, im_s = (np.array(column(table, key).values) for key in ("eigenvalue_re", "eigenvalue_im"))
    assert [mark == "in the box" for mark in marks] == list((left < re_s) & (re_s < right) & (im_s < top))
    assert count == 2 * sum(mark == "in the box" for mark in marks)
    assert ("outside" in table.caption) == ("outside" in marks)


def test_a_gauge_on_a_free_pin_reads_the_torque():
    section = bode_section(ARMS["free-pin"], "root_moment")
    assert "−u/(1 + C s)" in section.blocks[0].caption
    assert "0 poles" not in section.blocks[0].caption
    assert section.words[0].endswith("There are none.")
    G, C = tfarm.transfer(ARMS["free-pin"], "root_moment"), ARMS["free-pin"].link.damping
    s = np.array([3j, 200j, 5 + 900j])
    assert G(s) * (1 + C * s) == pytest.approx(np.full(3, -1.0), rel=1e-12)
