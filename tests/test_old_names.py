"""Public names of version 1.0, of `__all__` of the package and its rooms and of the documentation, are found."""

import re
import warnings
from importlib import import_module
from pathlib import Path

import pytest

import tfarm
from tfarm import HubFeedback, closed_loop_poles
from tfarm.arm import as_law
from tfarm.case import Case
from tfarm.loop.sampled import sampled_loop

NAMES = (Path(__file__).parent / "data" / "names-1.0.txt").read_text(encoding="utf-8").split()


def found(name):
    """What a dotted name is, and the words of the warnings on the way: a module, or an attribute of the last one."""
    place, _, own = name.rpartition(".")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            value = import_module(name)
        except ModuleNotFoundError:
            value = getattr(import_module(place), own)
    return value, [str(each.message) for each in heard if each.category is DeprecationWarning]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_of_version_1_is_found_and_a_moved_one_names_its_place(name):
    value, words = found(name)
    if words:
        (text,) = words
        head, _, news = text.partition(" ")
        renamed = re.fullmatch(r"(?:has moved: import it|is (\w+) now: import that) from ([\w.]+)", news)
        assert head == name
        assert getattr(import_module(renamed[2]), renamed[1] or name.rpartition(".")[2]) is value


def test_moved_names_warn_and_unknown_ones_are_none():
    assert found("tfarm.dsp.chain.load_chain")[1] == [
        "tfarm.dsp.chain.load_chain has moved: import it from tfarm.arm.chain"
    ]
    for name in ("tfarm.dsp.sampled.Sampled", "tfarm.case.result_card", "tfarm.dsp.stable_windows"):
        assert found(name)[1]
    assert not found("tfarm.dsp.Chain")[1]
    with pytest.raises(AttributeError, match=r"module 'tfarm\.dsp\.chain' has no attribute 'Chains'"):
        found("tfarm.dsp.chain.Chains")


def former_values():
    """Records with a method or property that was renamed: what the former name gives and what the present one does."""
    arm = tfarm.load("sasaki2012-lab")
    gains = HubFeedback(K1=0.3, K2=0.3)
    law = as_law(gains)
    poles = closed_loop_poles(arm, gains, 3)
    case = Case(arm, gains)
    loop = sampled_loop(case, count=1)
    yield lambda: arm.having(damping=0.0), arm.with_numbers(damping=0.0)
    yield lambda: gains.having("K1", 1.0), gains.with_number("K1", 1.0)
    yield lambda: law.having("K1", 1.0), law.with_number("K1", 1.0)
    yield lambda: law.weighted([2.0, 3.0]), law.with_factors([2.0, 3.0])
    yield lambda: case.having("K1", 1.0), case.with_number("K1", 1.0)
    yield lambda: loop.having("K1", 1.0).number("K1"), 1.0
    yield lambda: loop.weighted([1.0, 2.0, 3.0]).weights, (1.0, 2.0, 3.0)
    yield lambda: poles.moving.tolist(), poles.nonzero.tolist()
    yield lambda: poles.certified().discs, poles.certify()


def test_former_names_of_methods_warn_and_serve():
    for former, value in former_values():
        with pytest.warns(DeprecationWarning, match=r"^\w+\.\w+ is \w+ now$"):
            assert former() == value
