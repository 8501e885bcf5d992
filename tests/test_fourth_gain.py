"""A gain more than the law has, on what is not at the hub: no theorem on the hub's gains may speak of it.

The second road is the same law as a `Law` of named signals, in a program that has not that gain.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tfarm
from tests.fourth_gain import OUTPUT, answers_of
from tfarm import Law

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


@pytest.fixture(scope="module")
def answers() -> list[dict[str, Any]]:
    return answers_of(CASES)


def arm_of(case: dict[str, Any]) -> tfarm.Arm:
    arm = tfarm.load(case["arm"])
    return replace(arm, hub=replace(arm.hub, friction=case["friction"]))


def law_of(case: dict[str, Any], **more: float) -> Law:
    return Law({SIGNALS[name]: gain for name, gain in {**case["gains"], **more}.items()})


@pytest.mark.parametrize("number", range(len(CASES)))
def test_verdict_poles_and_margins_are_those_of_the_same_law_by_its_signals(number, answers) -> None:
    case, found = CASES[number], answers[number]
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


@pytest.mark.parametrize("number", range(len(CASES)))
def test_no_theorem_on_the_hubs_gains_is_told_of_it(number, answers) -> None:
    found = answers[number]
    assert not found["proven"]
    assert "Lyapunov" not in found["tail"]
    if "lab" not in CASES[number]["arm"]:
        assert not found["known"]
        assert found["exact"] == [None, None]


@pytest.mark.parametrize("number", range(len(CASES)))
def test_its_windows_end_where_the_law_by_its_signals_loses_its_stability(number, answers) -> None:
    case = CASES[number]
    arm, edges = arm_of(case), 0
    for low, high in answers[number]["windows"]["K3"]:
        for end, way in ((low, 1), (high, -1)):
            if abs(end) < 10.0:  # an edge, and no end of the search
                sides = (end + way * 0.01, end - way * 0.01)
                verdicts = [tfarm.margins(arm, law_of(case, K3=side)).stability.is_stable for side in sides]
                assert verdicts == [True, False]
                edges += 1
    assert edges
