"""Loops, sampling, reduction and the tuner see an arm by its numbers: what it is made of is known up to `response`."""

import ast
from pathlib import Path

import pytest

import tfarm

PARTS = {"link", "payload", "section"}  # a hub's damping is an actuator's word too
ROOMS = ("response", "reduced", "crossing", "loop", "dsp", "tuner")
FILES = sorted(path for room in ROOMS for path in (Path(tfarm.__file__).parent / room).glob("*.py"))


def parts_read(text):
    """What is read of an arm's parts: `something.link` and so on, with the line."""
    read = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Attribute)]
    of_hub = {id(node) for node in read if node.attr == "inertia" and getattr(node.value, "attr", "") == "hub"}
    return {(node.attr, node.lineno) for node in read if node.attr in PARTS or id(node) in of_hub}


def test_a_part_that_is_read_is_seen():
    assert parts_read("x = arm.link.rhoA + arm.hub.inertia") == {("link", 1), ("inertia", 1)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_no_file_above_the_spectrum_reads_a_part_of_the_arm(path):
    assert parts_read(path.read_text()) == set()
