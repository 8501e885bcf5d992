"""Records of the whole package: their arrays cannot be written, `==` answers, their repr is short."""

import dataclasses
import importlib
import os
import pickle
import pkgutil
import re
import subprocess
import sys
from functools import cached_property

import numpy as np
import pytest

import tfarm
from tests.hostile import Read
from tfarm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.simulate import Simulator
from tfarm.loop.circle_crossings import sampled_map
from tfarm.loop.locus import locus
from tfarm.loop.plane import gain_map
from tfarm.records import record
from tfarm.reduced import modal_model

LAB = tfarm.load("sasaki2012-lab")
LAW = HubFeedback(K1=0.3, K2=0.3)
OMEGA = np.linspace(5.0, 250.0, 120)


def small_map():
    return sampled_map(tfarm.sampled(LAB, LAW, count=4).verdict.loop, np.array([0.1, 0.3]), np.array([0.0, 0.5]))


def too_high():
    """The arm's own response, a tenth too high everywhere."""
    values = 1.1 * tfarm.transfer(LAB, "root_moment")(1j * OMEGA)
    return tfarm.Measured(output="root_moment", input="hub_torque", omega=OMEGA, values=values)


MAKERS = {  # of a record: how it is made, and how its repr begins: with the finding
    "modes": (lambda: tfarm.modes(LAB, 3), "Modes(finding='3 flexible, 71.5057 to 537.953 rad/s', "),
    "proof": (lambda: tfarm.modes(LAB, 30).certify(20), "Certificate(brackets=(30 entries), count=31, "),
    "damped modes": (lambda: tfarm.damped_modes(tfarm.modes(LAB, 3)), "DampedModes(undamped='3 flexible, "),
    "zeros": (lambda: tfarm.transfer(LAB, "tip_displacement").zeros(up_to=500.0), "Roots(values=[-96.265+0j, "),
    "poles": (lambda: tfarm.closed_loop_poles(LAB, LAW, 5), "Poles(unstable=0, "),
    "margins": (lambda: tfarm.margins(LAB, LAW), "Margins(stability='stable'"),
    "locus": (lambda: locus(LAB, LAW, "K2", 0.0, 2.0, 5, 4), "Locus(finding='a pole becomes unstable at K2 = 1.03054'"),
    "region": (lambda: gain_map(LAB, np.linspace(0.1, 1, 3), np.linspace(0.5, 1.5, 4)), "Plane(finding='stable at 6"),
    "model": (lambda: modal_model(LAB, ["root_moment"], 4), "PartialFractions(arm='sasaki2012-lab', "),
    "sampled": (lambda: tfarm.sampled(LAB, LAW, count=4), "Analysis(verdict='stable', "),
    "sampled map": (small_map, "GainMap(finding='stable at 4 of 4 points', "),
    "slew": (lambda: Simulator(Case(LAB, HubFeedback()), slew_scenario(LAB, Chain(), 0.5), count=3).linear(LAW),
             "Simulation(finding='ran to 0.5 s, root moment up to 4.653 N m', "),
    "bode": (lambda: tfarm.bode(LAB, "root_moment", (1.0, 300.0)), "Bode(finding='2 poles and 1 zeros up to 300"),
}  # fmt: skip


def inside(value, seen=None):
    """Every record in a value, once, and every array, with those of cached properties."""
    seen = {} if seen is None else seen
    if id(value) in seen:
        return
    seen[id(value)] = value
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, dict):
        yield from (found for entry in value.values() for found in inside(entry, seen))
    elif isinstance(value, tuple | list):
        yield from (found for entry in value for found in inside(entry, seen))
    elif dataclasses.is_dataclass(value):
        yield value
        for name, attribute in vars(type(value)).items():
            if isinstance(attribute, cached_property) and name != "smooth":  # a locus, which has one too, and so on
                yield from inside(getattr(value, name), seen)
        yield from (found for each in dataclasses.fields(value) for found in inside(getattr(value, each.name), seen))


@pytest.mark.parametrize("name", MAKERS)
def test_records_are_frozen_comparable_and_short(name) -> None:
    """A notebook shows the uncut repr, an entry a row, and the same entry first."""
    make, start = MAKERS[name]
    answer, again = make(), make()
    found = list(inside(answer))
    assert not [each for each in found if isinstance(each, np.ndarray) and each.flags.writeable]
    assert answer == again
    assert hash(answer) == hash(again)
    assert answer != 3
    assert repr(answer).startswith(start)
    for each in found:
        if not isinstance(each, np.ndarray | tfarm.Arm | Chain):  # what a user types is shown as it is typed
            assert len(repr(each)) <= 240
            assert "\n" not in repr(each)
    shown = Read(answer._repr_html_())
    assert shown.tags == {"table", "caption", "tbody", "tr", "th", "td"}
    first, *_ = ("=".join(row) for row in shown.rows)
    assert repr(answer).startswith(f"{type(answer).__name__}({first}"[:150])
    assert len(answer._repr_html_()) < 10_000


def test_a_comparison_with_measured_data_and_a_fit_begin_with_the_finding() -> None:
    """Ln 1.1 off, at each of its poles in the band."""
    within = (tfarm.modes(LAB, 4).natural_frequency[1:] < OMEGA[-1]).sum()
    words = f"Overlay(finding='{within} of {within} poles measured, ln |measured/exact| {np.log(1.1):.2g} rms', "
    assert repr(tfarm.overlay(LAB, too_high())).startswith(words)
    fitted = tfarm.fit(LAB, too_high(), ["gain"], profile=False)
    assert repr(fitted).startswith("Fit(verdict='fitted', finding='sensor gain = 1.1; chi-squared ")


def test_one_number_makes_a_difference() -> None:
    table = tfarm.modes(LAB, 3)
    moved = table.natural_frequency.copy()
    moved[-1] = np.nextafter(moved[-1], np.inf)
    assert table != dataclasses.replace(table, natural_frequency=moved)
    assert table != tfarm.modes(LAB, 2)
    with pytest.raises(ValueError, match="read-only"):
        table.natural_frequency[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        table.hub_participation[0] = 1.0


def test_the_array_that_went_in_stays_its_owners() -> None:
    values = np.array([1.0, np.nan])
    one, other = Pair(values, {"a": [values]}), Pair(values.copy(), {"a": [values.copy()]})
    values[0] = 1.0
    assert one == other
    assert one != Pair(values, {"a": [np.zeros(2)]})
    assert one != Pair(values, {"b": [values]})
    assert repr(one) == "Pair(here=[1, nan], there=<a>)"


@dataclasses.dataclass(frozen=True)
@record
class Pair:
    """Two entries."""

    here: np.ndarray
    there: dict


LEAD = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "deflection@0.3": 0.5}, delay=0.002)


def test_a_law_is_shown_as_it_is_typed() -> None:
    assert repr(LEAD) == "Law(hub_angle=([2, 1], [0.01, 1]), deflection@0.3=0.5, delay=0.002)"
    assert repr(tfarm.Law({"hub_rate": 0.3}, name="servo")) == "Law(hub_rate=0.3, name='servo')"
    A, row = -np.eye(2), np.ones((1, 2))
    matrices = tfarm.Law.of_matrices(A, -A, row, 0 * row, ["hub_angle", "hub_rate"])
    assert repr(matrices) == "Law(hub_angle, hub_rate=<2 states>)"
    assert Read(LEAD._repr_html_()).rows == [
        ["hub_angle", "([2, 1], [0.01, 1])"],
        ["deflection@0.3", "0.5"],
        ["delay", "0.002"],
    ]
    assert "law=Law(hub_angle=([2, 1], [0.01, 1]), deflection@0.3=0.5, delay=0.002)" in repr(Case(LAB, LEAD))


def test_every_record_with_arrays_is_one() -> None:
    """Whatever is frozen and holds an array, or a record that does, is decorated."""
    classes = {}
    for module in pkgutil.walk_packages(tfarm.__path__, "tfarm."):
        if not module.name.endswith("__main__"):
            for name, value in vars(importlib.import_module(module.name)).items():
                if "__dataclass_params__" in getattr(value, "__dict__", {}) and value.__module__ == module.name:
                    classes[module.name, name] = value
    assert len(classes) > 60
    for (module, name), value in classes.items():
        types = " ".join(str(each.type) for each in dataclasses.fields(value))
        if value.__dataclass_params__.frozen and re.search(r"\b(NDArray|Real|Complex|Whole)\b", types):
            assert name.startswith("_") or value.__repr__.__module__ == "tfarm.records", (module, name)


def test_the_hash_of_a_record_is_computed_once_and_stays_in_its_process() -> None:
    """Texts have other hashes in another process: a table read there is the key of what was kept under its equal."""
    asked = []

    class Counted:
        def __hash__(self) -> int:
            return len(asked.append(0) or asked)

    @record
    @dataclasses.dataclass(frozen=True)
    class Kept:
        entry: Counted

    kept = Kept(Counted())
    assert hash(kept) == hash(kept)
    assert len(asked) == 1
    table = tfarm.modes(LAB, 1)
    hash(table)
    code = (
        "import pickle, sys, tfarm; table = pickle.load(sys.stdin.buffer); "
        "print({tfarm.modes(tfarm.load('sasaki2012-lab'), 1): 'found'}.get(table))"
    )
    seed = {**os.environ, "PYTHONHASHSEED": "7"}
    found = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(table), env=seed, capture_output=True)
    assert found.stdout.decode().strip() == "found"
