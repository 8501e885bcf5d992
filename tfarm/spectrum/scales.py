"""The units of an arm, in which its gains are neither small nor large, and the gains that it has where none are said.

A rate gain K1 is measured in J w1 and an angle gain Kp in J w1^2: J the arm's inertia about the hub, w1 its first
flexible frequency.  In these units a loop does not know whether the arm is a boom or a needle.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from tfarm.arm import GAINS, Arm, HubFeedback, input_words, load, must_be_arm, written_unit
from tfarm.errors import ParameterError

from .frequencies import ARMS_KEPT
from .table import modes

PAPER_GAINS = HubFeedback(K1=0.3, K2=0.3)  # of the paper's arms
RATE_SHARE = 6.42e-3  # of J w1: what K1 = 0.3 N m s/rad is on the preset sasaki2012
MOST_UNITS = 1e9  # of J w1, 1 and J w1^2: far beyond what a loop can tell from infinite, far from overflow
DEFAULT_DIGITS = 3  # of a default K1, so that it can be read and typed
OF_THE_PAPER = ("sasaki2012", "sasaki2012-lab", "sasaki2012-as-printed")  # presets


@lru_cache(maxsize=ARMS_KEPT)  # each loop of a search looks whether its gains are possible
def turning_inertia(arm: Arm) -> float:
    """J, the arm's inertia about the hub, without the parts that are infinite: these do not turn.

    In kg m^2 where torque is the input, else in the input's own unit times s^2.
    """
    finite = [each if np.isfinite(each) else 0.0 for each in (arm.hub.inertia, arm.payload.mass, arm.payload.inertia)]
    hub, mass, inertia = finite
    payload = replace(arm.payload, mass=mass, inertia=inertia)
    return replace(arm, hub=replace(arm.hub, inertia=hub), payload=payload).turned_inertia


def rate_unit(arm: Arm) -> float:
    """J w1 [N m s/rad], the unit of K1."""
    return turning_inertia(arm) * first_frequency(arm)


def angle_unit(arm: Arm) -> float:
    """J w1^2 [N m/rad], the unit of Kp."""
    return turning_inertia(arm) * first_frequency(arm) ** 2


UNITS_OF_OUTPUTS = {"hub_angle": ("J w1^2", angle_unit), "hub_rate": ("J w1", rate_unit)}  # of a gain on each, else 1


def gain_unit(arm: Arm, name: str) -> float:
    """The unit of the gain of that name on this arm, in that gain's SI unit."""
    (output,) = (gain.output for gain in GAINS if gain.name == name)
    return UNITS_OF_OUTPUTS[output][1](arm) if output in UNITS_OF_OUTPUTS else arm.input_per_torque


def most_gain(arm: Arm, name: str) -> float:
    """The largest size that the gain of that name may have on this arm: beyond any machine."""
    return MOST_UNITS * gain_unit(arm, name)


def check_gains(arm: Arm, law: HubFeedback) -> None:
    """Raise ParameterError for a gain that is too large for the arm, whatever it would be for another."""
    for gain in GAINS:
        value = law[gain.name]
        if value and not abs(value) <= (most := most_gain(arm, gain.name)):
            unit = UNITS_OF_OUTPUTS[gain.output][0] if gain.output in UNITS_OF_OUTPUTS else "1"
            remedy = f"for this arm at most {MOST_UNITS:g} times {unit} in size, {most:.3g}: beyond any machine"
            raise ParameterError(key=gain.name, value=value, remedy=remedy)


def default_gains(arm: Arm) -> HubFeedback:
    """The law of an arm for which no gains are given: K1 = 0.00642 J w1 to three digits, K2 = 0.3.

    On the paper's arm that is K1 = 0.3 N m s/rad, and all its presets have that.  A hub without inertia has K2 = 0:
    more would be an algebraic loop.
    """
    must_be_arm(arm)
    if _is_of_the_paper(arm):
        return PAPER_GAINS
    K1 = float(f"{RATE_SHARE * rate_unit(arm):.{DEFAULT_DIGITS}g}")
    K2 = float(f"{PAPER_GAINS.K2 * arm.input_per_torque:.{DEFAULT_DIGITS}g}")
    return HubFeedback(K1=K1, K2=0.0 if arm.has_massless_hub else K2)


def default_words(arm: Arm, names: Iterable[str] = ("K1", "K2")) -> str:
    """What `default_gains` gives to the gains of these names, and why, in one clause."""
    law, is_paper = default_gains(arm), _is_of_the_paper(arm)
    why = "as in the paper" if is_paper else f"{RATE_SHARE:g} J w1 of this arm"
    units = {name: written_unit(name, arm) for name in ("K1", "K2")}
    words = {"K1": f"K1 = {law.K1:g}{units['K1']} ({why})", "K2": f"K2 = {law.K2:g}{units['K2']}"}
    driven = f", through {input_words(arm)}" if arm.input_per_torque != 1.0 else ""
    return " and ".join(words[name] for name in names) + driven


@lru_cache(maxsize=ARMS_KEPT)
def first_frequency(arm: Arm) -> float:
    """w1 [rad/s], the lowest flexible frequency of the undamped arm."""
    return float(modes(arm.elastic, 1).natural_frequency[-1])


@lru_cache(maxsize=ARMS_KEPT)
def _is_of_the_paper(arm: Arm) -> bool:
    """Whether link, hub and payload are those of one of the paper's presets."""
    papers = (load(name) for name in OF_THE_PAPER)
    return any((arm.link, arm.hub, arm.payload) == (each.link, each.hub, each.payload) for each in papers)
