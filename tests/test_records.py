"""Records of the whole package: their arrays cannot be written, `==` answers, their repr is short."""

import dataclasses
import importlib
import pkgutil
import re
from functools import cached_property

import numpy as np
import pytest

import tfarm
from tests.hostile import Read
from tfarm import HubFeedback
from tfarm.dsp import Chain
from tfarm.dsp.crossings import sampled_map
from tfarm.dsp.scenarios import slew
from tfarm.dsp.simulate import Simulator
from tfarm.loop.locus import locus
from tfarm.loop.loop import Loop
from tfarm.loop.plane import gain_map
from tfarm.records import LONGEST_REPR, record
from tfarm.reduced import modal_model

LAB = tfarm.load("sasaki2012-lab")
LAW = HubFeedback(K1=0.3, K2=0.3)


def small_map():
    return sampled_map(tfarm.sampled(LAB, LAW, count=4).verdict.loop, np.array([0.1, 0.3]), np.array([0.0, 0.5]))


MAKERS = {
    "modes": lambda: tfarm.modes(LAB, 3),
    "proof": lambda: tfarm.modes(LAB, 30).certify(20),
    "damped modes": lambda: tfarm.damped_modes(tfarm.modes(LAB, 3)),
    "zeros": lambda: tfarm.transfer(LAB, "tip_displacement").zeros(up_to=500.0),
    "poles": lambda: tfarm.closed_loop_poles(LAB, LAW, 5),
    "margins": lambda: tfarm.margins(LAB, LAW),
    "locus": lambda: locus(LAB, LAW, "K2", 0.0, 1.0, 5, 4),
    "region": lambda: gain_map(LAB, np.linspace(0.1, 1, 3), np.linspace(0, 0.5, 3)),
    "model": lambda: modal_model(LAB, ["root_moment"], 4),
    "sampled": lambda: tfarm.sampled(LAB, LAW, count=4),
    "sampled map": small_map,
    "slew": lambda: Simulator(LAB, Chain(), slew(LAB, Chain(), 0.5), count=3).linear(LAW),
}


def inside(value):
    """Every record in a value, and every array, with those of cached properties."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, dict):
        yield from (found for entry in value.values() for found in inside(entry))
    elif isinstance(value, tuple | list):
        yield from (found for entry in value for found in inside(entry))
    elif dataclasses.is_dataclass(value):
        yield value
        for name, attribute in vars(type(value)).items():
            if isinstance(attribute, cached_property) and getattr(value, name) is not value:  # as `Loop.freed` may be
                yield from inside(getattr(value, name))
        yield from (found for each in dataclasses.fields(value) for found in inside(getattr(value, each.name)))


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_what_the_package_answers_is_frozen_compared_and_short(make) -> None:
    answer, again = make(), make()
    found = list(inside(answer))
    arrays = [each for each in found if isinstance(each, np.ndarray)]
    assert not [each for each in arrays if each.flags.writeable]
    assert answer == again
    assert hash(answer) == hash(again)
    assert answer != 3
    for each in found:
        if not isinstance(each, np.ndarray | tfarm.Arm | Chain):  # what a user types is shown as it is typed
            assert len(repr(each)) <= LONGEST_REPR + 40
            assert "\n" not in repr(each)


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


def test_the_verdict_stands_first() -> None:
    assert repr(tfarm.margins(LAB, LAW)).startswith("Margins(stability='stable', ")
    assert repr(tfarm.margins(LAB, LAW).stability).startswith("Stability(verdict='stable', ")
    assert repr(tfarm.sampled(LAB, LAW, count=4)).startswith("Analysis(verdict='stable', ")
    assert repr(tfarm.closed_loop_poles(LAB, LAW, 5)).startswith("Poles(unstable=0, ")


LEAD = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "deflection@0.3": 0.5}, delay=0.002)


def test_what_was_found_stands_first_in_words() -> None:
    """Each number in the words is counted here from the record's own arrays."""
    plane = tfarm.map(LAB, np.linspace(0.1, 1, 3), np.linspace(0.5, 1.5, 4))
    assert repr(plane).startswith(f"Plane(finding='stable at {(plane.unstable == 0).sum()} of 12 points', ")
    found = locus(LAB, LAW, "K2", 0.0, 2.0, 5, 4)
    (_, window) = tfarm.margins(LAB, LAW).windows["K2"].around
    assert repr(found).startswith(f"Locus(finding='a pole becomes unstable at K2 = {window:.6g}', ")
    assert "no branch crosses" in repr(tfarm.locus(LAB, LEAD, "gain", 0.5, 0.6, 3, 2))
    counts = tfarm.map(LAB, np.array([0.5, 40.0]), np.array([0.0, 0.03]), law=LEAD, vary=("gain", "delay"))
    assert repr(counts).startswith(f"Plane(finding='stable at {(counts.unstable == 0).sum()} of 4 points', ")
    table = tfarm.modes(LAB, 3)
    ends = "{:.6g} to {:.6g}".format(*table.natural_frequency[[1, 3]])
    assert repr(table).startswith(f"Modes(finding='3 flexible, {ends} rad/s', ")
    data = tfarm.bode(LAB, "root_moment", (1.0, 300.0))
    assert repr(data).startswith(f"Bode(finding='{data.poles.size} poles and {data.zeros.size} zeros up to 300 rad/s'")


def test_a_simulation_says_how_it_went() -> None:
    run = MAKERS["slew"]()
    largest = abs(run.at_samples.root_moment).max()
    assert repr(run).startswith(f"Simulation(finding='ran to 0.5 s, root moment up to {largest:.4g} N m', ")
    lost = tfarm.simulate(LAB, LAW.having("K2", 1.5), duration=2.0, count=4)
    assert "finding='unstable, stopped at " in repr(lost)


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
    assert "law=Law(hub_angle=([2, 1], [0.01, 1]), deflection@0.3=0.5, delay=0.002)" in repr(Loop(LAB, LEAD))


def test_a_measurement_says_how_well_it_is_explained() -> None:
    """The arm's own response, a tenth too high everywhere: ln 1.1 off, at each of its poles in the band."""
    omega = np.linspace(5.0, 250.0, 120)
    values = 1.1 * tfarm.transfer(LAB, "root_moment")(1j * omega)
    data = tfarm.Measured(output="root_moment", input="hub_torque", omega=omega, values=values)
    within = (tfarm.modes(LAB, 4).natural_frequency[1:] < 250).sum()
    begins = f"Overlay(finding='{within} of {within} poles measured, ln |measured/exact| {np.log(1.1):.2g} rms', "
    assert repr(tfarm.overlay(LAB, data)).startswith(begins)
    found = tfarm.fit(LAB, data, ["gain"], profile=False)
    assert repr(found).startswith("Fit(verdict='fitted', finding='sensor gain = 1.1; chi-squared ")


def test_a_few_numbers_by_name_are_shown() -> None:
    assert repr(Pair(np.zeros(1), {"Kp": 2.0, "K1": 0.25})) == "Pair(here=[0], there=<Kp=2, K1=0.25>)"
    assert repr(Pair(np.zeros(1), dict.fromkeys("abcd", 1.0))) == "Pair(here=[0], there=<a, b, c, d>)"


def test_no_figure_is_cut() -> None:
    """Digits that hold, not those of a double: an edge of a sampled loop in the repr of all that is said of it."""
    found = tfarm.sampled(LAB, LAW, count=4).delay
    assert repr(found).startswith(f"Figure(text='{found.text}', ")
    assert "..." not in repr(found)


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


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_a_notebook_shows_a_record_as_a_small_table(make) -> None:
    """What the repr says where it is not cut, an entry a row, and the same entry first."""
    answer = make()
    found = Read(answer._repr_html_())
    assert found.tags == {"table", "caption", "tbody", "tr", "th", "td"}
    first, *_ = ("=".join(row) for row in found.rows)
    assert repr(answer).startswith(f"{type(answer).__name__}({first}"[:150])
    assert len(answer._repr_html_()) < 10_000


def test_a_hostile_name_is_text_in_a_notebook() -> None:
    hostile = "<script>alert('&amp;')</script>"
    html = Pair(np.zeros(1), {hostile: 1})._repr_html_()
    assert "<script" not in html
    assert Read(html).rows == [["here", "[0]"], ["there", f"<{hostile}>"]]
