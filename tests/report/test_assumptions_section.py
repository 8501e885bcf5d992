"""What the assumptions do, on the page: the studies' own numbers, the arm marked, and odd hubs said openly."""

import math
from dataclasses import replace

import pytest

import tfarm
from tests.report.coarse import coarsen
from tfarm.report.assumptions_section import assumptions_section

PAPER = tfarm.load("sasaki2012")


@pytest.fixture(scope="module")
def section():
    return assumptions_section(PAPER)


def values_of(table):
    return {column.key: list(column.values) for column in table.columns}


def test_the_words_carry_the_numbers(section):
    words = " ".join(section.words)
    assert "neither its second moment I nor the hub inertia I_h" in words
    assert "from 23.836 to 713.35 rad/s" in words
    assert "one per cent more depth changes it by 1.000 %" in words
    assert "outside 30.399 to 133.30 rad/s" in words


@pytest.mark.parametrize(("inertia", "word"), [(math.inf, "locked"), (0.0, "a free pin")])
def test_a_hub_without_an_inertia_is_said_openly(inertia, word, monkeypatch):
    coarsen(monkeypatch.setattr)
    arm = replace(tfarm.load("stocky-steel"), hub=tfarm.Hub(inertia=inertia))
    section = assumptions_section(arm)
    assert section.words[-1] == f"The hub of this arm is {word}, so there is no inertia to choose."
    assert [block.stem for block in section.blocks] == ["assumptions-section"]
    assert "paper" not in " ".join(section.words)
