"""A gain more than the law has, on what is not at the hub: no theorem on the hub's gains may speak of it.

The second road is the same law as a `Law` of named signals, in a program that has not that gain.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tfarm
from tests.fourth_gain import AXES, OUTPUT, answers_of
from tests.shared import remembered, thinned
from tfarm import Law
from tfarm.dsp.verdict import sampled_verdict
from tfarm.loop.regions import region

SIGNALS = {"K1": "hub_rate", "K2": "root_moment", "Kp": "hub_angle", "K3": OUTPUT}
CASES: list[dict[str, Any]] = [
    {"arm": arm, "friction": friction, "gains": {"K1": 0.3, "K2": 0.3, "Kp": Kp, "K3": K3}}
    for arm, friction, Kp, K3 in (
        ("sasaki2012", 0.0, 0.0, 0.5),
        ("sasaki2012", 0.0, 0.0, -0.5),
        ("sasaki2012", 0.02, 2.0, 0.3),
        ("sasaki2012-lab", 0.0, 2.0, 0.3),
        ("sasaki2012-lab", 0.0, 0.0, -0.5),
    )
]
WITHOUT_RATE = {"arm": "sasaki2012", "friction": 0.0, "gains": {"K3": 0.2}}
THINNED = thinned(range(len(CASES)), 2)


@remembered
def answers_at(numbers: tuple[int, ...]) -> dict[int, dict[str, Any]]:
    return dict(zip(numbers, answers_of([[*CASES, WITHOUT_RATE][number] for number in numbers]), strict=True))


def answered(number: int) -> dict[str, Any]:
    """The answers on a case: from one process for those of `make test`, from another for the others."""
    kept = (0, 2, 4, len(CASES))
    return answers_at(kept if number in kept else (1, 3))[number]


def arm_of(case: dict[str, Any]) -> tfarm.Arm:
    arm = tfarm.load(case["arm"])
    return replace(arm, hub=replace(arm.hub, friction=case["friction"]))


def law_of(case: dict[str, Any], **more: float) -> Law:
    return Law({SIGNALS[name]: gain for name, gain in {**case["gains"], **more}.items()})


@pytest.mark.parametrize("number", THINNED)
def test_verdict_poles_and_margins_are_those_of_the_same_law_by_its_signals(number) -> None:
    case, found = CASES[number], answered(number)["loop"]
    known = tfarm.margins(arm_of(case), law_of(case))
    assert (found["verdict"], found["unstable"]) == (known.stability.verdict, known.stability.unstable_roots)
    assert not found["infinite"]
    poles = np.array(found["poles"]) @ [1, 1j]
    assert poles == pytest.approx(known.stability.poles.values[:6], rel=1e-9)
    if known.in_band is None:
        assert found["margins"] is None
    else:
        assert found["margins"] == pytest.approx([*known.in_band.gain, known.in_band.phase, known.in_band.disk])
    ends = np.array(found["ends"]) @ [1, 1j]
    assert (abs(ends[:, None] - np.r_[poles, poles.conj()]).min(axis=1) < 1e-9 * abs(ends)).all()


@pytest.mark.parametrize("number", THINNED)
def test_no_theorem_on_the_hubs_gains_is_told_of_it(number) -> None:
    found = answered(number)["loop"]
    assert not found["proven"]
    assert "Lyapunov" not in found["tail"]
    if "lab" not in CASES[number]["arm"]:
        assert not found["known"]
        assert found["exact"] == [None, None]


@pytest.mark.parametrize("number", THINNED)
def test_its_windows_end_where_the_law_by_its_signals_loses_its_stability(number) -> None:
    case = CASES[number]
    arm, edges = arm_of(case), 0
    for low, high in answered(number)["loop"]["windows"]["K3"]:
        for end, way in ((low, 1), (high, -1)):
            if abs(end) < 10.0:  # an edge, and no end of the search
                sides = (end + way * 0.01, end - way * 0.01)
                verdicts = [tfarm.margins(arm, law_of(case, K3=side)).stability.is_stable for side in sides]
                assert verdicts == [True, False]
                edges += 1
    assert edges


def test_without_losses_it_stabilises_nothing_and_a_rate_gain_does_from_0_on() -> None:
    """D is even in s: every pole has its mirror image, and K1 alone has a part that is odd."""
    found = answered(len(CASES))["loop"]
    assert found["verdict"] == "marginal"
    assert found["windows"]["K3"] == found["windows"]["K2"] == found["windows"]["Kp"] == []
    ((low, high),) = found["windows"]["K1"]
    assert low == 0.0
    for K1, is_stable in ((1e-3, True), (-1e-3, False), (0.5 * high, True)):
        assert tfarm.margins(arm_of(WITHOUT_RATE), law_of(WITHOUT_RATE, K1=K1)).stability.is_stable is is_stable


@pytest.mark.parametrize("number", THINNED)
def test_the_map_without_it_is_that_of_the_program_without_it(number) -> None:
    """There an arm is a chain of one link, here a link in closed form."""
    case = CASES[number]
    assert (
        answered(number)["map"]
        == region(arm_of(case), *AXES, tfarm.HubFeedback(Kp=case["gains"]["Kp"])).unstable.tolist()
    )


@pytest.mark.parametrize("number", THINNED)
def test_the_map_that_holds_it_is_that_of_the_same_law_by_its_signals(number) -> None:
    case = CASES[number]
    plane = "hub_rate", "root_moment"
    assert (
        answered(number)["map_of_law"] == tfarm.map(arm_of(case), *AXES, law=law_of(case), vary=plane).unstable.tolist()
    )


@pytest.mark.parametrize("number", THINNED)
def test_what_no_law_has_a_part_in_is_that_of_the_program_without_it(number) -> None:
    arm, found = arm_of(CASES[number]), answered(number)["without_law"]
    known = tfarm.transfer(arm, "root_moment").poles(up_to=300.0).values
    assert np.array(found["poles"]) @ [1, 1j] == pytest.approx(known, rel=1e-12)
    shape = tfarm.damped_modes(tfarm.modes(arm, 2)).shape(np.linspace(0.0, 1.0, 3))
    assert np.array(found["shape"]) == pytest.approx(abs(np.asarray(shape)), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("number", THINNED)
def test_the_sampled_loop_is_that_of_the_same_law_by_its_signals(number) -> None:
    case, found = CASES[number], answered(number)["sampled"]
    arm = arm_of(case)
    known = sampled_verdict(arm, law_of(case))
    assert found["outside"] == known.loop.poles.unstable
    assert found["sentence"].split(" (")[0] == known.sentence.split(" (")[0]
    assert found["log_radius"] == pytest.approx(known.log_radius, rel=1e-9)
    for window in found["windows"]:
        for end, way in zip(window, (1, -1), strict=True):
            sides = [sampled_verdict(arm, law_of(case, K3=end + side * way * 0.01)) for side in (1, -1)]
            assert [each.is_stable for each in sides] == [True, False]
    assert found["windows"] or not known.is_stable


@pytest.mark.parametrize("number", THINNED)
def test_to_first_order_it_moves_each_mode_of_the_sampled_loop_as_its_poles_move(number) -> None:
    found = answered(number)["sampled"]
    size, off = np.array(found["size"])[:5], np.array(found["off"])[:5]  # of higher ones damping leaves no digits
    assert (abs(off) < 1e-4 * abs(size) + 1e-6 * abs(size).max()).all()


@pytest.mark.parametrize("number", THINNED)
def test_a_slew_under_it_is_that_of_the_same_law_by_its_signals_with_references_at_the_hub(number) -> None:
    case, found = CASES[number], answered(number)["simulated"]
    law = law_of(case)
    led = replace(law, references=tuple(name for name in law.signals if name != OUTPUT))
    known = tfarm.simulate(arm_of(case), led, duration=1.0, count=4)
    for ours, theirs in ((found["torque"], known.torque), (found["tip"], known.at_samples.tip_displacement)):
        assert ours == pytest.approx(theirs, rel=0, abs=1e-10 * abs(theirs).max())
    gains = {name: gain for name, gain in case["gains"].items() if name != "K3"}
    without = tfarm.simulate(arm_of(case), tfarm.HubFeedback(**gains), duration=1.0, count=4)
    assert abs(without.torque - known.torque).max() > 0.02 * abs(known.torque).max()


def test_a_controller_of_three_signals_refuses_it() -> None:
    refused = answered(0)["simulated"]["refused"]
    assert refused.startswith("K3")
    assert "hub angle, hub rate and root moment alone" in refused
