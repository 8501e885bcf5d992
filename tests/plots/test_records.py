"""Pictures and pages read records: what computes one is called in `tfarm/report/page.py` alone."""

import ast
import importlib
from inspect import ismodule
from pathlib import Path

import pytest

import tfarm

ROOT = Path(tfarm.__file__).parent
ROOMS = (
    "assessment", "audit", "crossing", "dsp", "exact", "exported", "fitting", "loop", "reduced", "response", "spectrum",
    "studies", "synthesis", "tuner",
)  # fmt: skip
# words, units and rounding; a record that is there in decibels, at other times, or as the pieces of a line
READERS = {
    "tfarm.audit.rows.is_zero",
    "tfarm.crossing.turning.pieces",
    "tfarm.dsp.discretise.rule_in_words",
    *(f"tfarm.dsp.traces.{name}" for name in ("away", "curve", "curve_of", "held_at", "points_a_period")),
    "tfarm.dsp.traces.tip_deviation",
    "tfarm.exact.outputs.signal_words",
    "tfarm.exact.outputs.unit_over",
    "tfarm.loop.branches.origin_name",
    "tfarm.loop.curve.decibels",
    "tfarm.loop.curve.gain_margin",
    "tfarm.loop.loci.round_branches",
    *(f"tfarm.loop.locus.{name}" for name in ("frame", "view")),
    "tfarm.loop.nyquist.compress_radius",
    "tfarm.response.signals.sign_convention",
    "tfarm.spectrum.listing.beyond_the_box",
    *(f"tfarm.studies.quantities.{name}" for name in ("column_names", "loop_of", "quantity_of", "stability_of")),
}
# at the door: what is asked of an arm and a chain together, and the film of a run that a person has
DOORS = {"tfarm.dsp.plant.arm_under_chain", "tfarm.dsp.stages.admit", "tfarm.dsp.traces.motion_of"}
FILES = sorted({*ROOT.glob("plots/*.py"), *ROOT.glob("report/*.py")} - {ROOT / "report" / "page.py"})


def computing(source, package):
    """The functions of computing rooms that a file names, by import or as attributes of a module."""
    tree = ast.parse(source)
    known = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            known |= {each.asname or each.name: importlib.import_module(each.name) for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            name = f"{package}.{node.module}" if node.level else node.module
            known |= {each.asname or each.name: member(name, each.name) for each in node.names}
    named = [
        getattr(known[node.value.id], node.attr)
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and ismodule(known.get(node.value.id))
    ]
    functions = (each for each in (*known.values(), *named) if callable(each) and not isinstance(each, type))
    places = {f"{each.__module__}.{each.__name__}" for each in functions}
    return {place for place in places if place.startswith(tuple(f"tfarm.{room}." for room in ROOMS))}


def member(module, name):
    own = importlib.import_module(module)
    return getattr(own, name) if hasattr(own, name) else importlib.import_module(f"{module}.{name}")


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_no_picture_and_no_section_computes(file):
    assert computing(file.read_text(encoding="utf-8"), f"tfarm.{file.parent.name}") <= READERS | DOORS


@pytest.mark.parametrize(
    "source",
    [
        "from tfarm.loop.margins import margins",
        "import tfarm\nfound = tfarm.modes(arm)",
        "from tfarm.loop import poles\npoles.closed_loop_poles",
    ],
)
def test_a_call_of_a_computing_room_is_found(source):
    assert len(computing(source, "tfarm.plots") - READERS - DOORS) == 1
