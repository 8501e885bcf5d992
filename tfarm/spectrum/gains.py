"""Natural units of the gains of an arm, their limits, and its default gains.

The natural unit of a rate gain K1 is J w1 and that of an angle gain Kp is J w1^2, with J the arm's inertia about the
hub and w1 its first flexible frequency.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from tfarm.arm import Arm, Hub, HubFeedback, Payload, Section, input_words, must_be_arm
from tfarm.errors import require
from tfarm.spectrum.frequencies import ARMS_KEPT
from tfarm.spectrum.table import first_frequency

# of the paper's arms
PAPER_GAINS = HubFeedback(K1=0.3, K2=0.3)
# of J w1: K1 = 0.3 N m s/rad on the preset sasaki2012
RATE_SHARE = 6.42e-3
# of J w1, 1 and J w1^2: a smaller gain moves no pole in a lifetime
LEAST_UNITS = 1e-12
# of J w1, 1 and J w1^2: practically infinite, far from overflow
MOST_UNITS = 1e9


@lru_cache(maxsize=ARMS_KEPT)  # each loop of a search checks its gains
def turning_inertia(arm: Arm) -> float:
    """Return J, the arm's inertia about the hub without infinite parts.

    In kg m^2 for a torque, else in the unit of the input times s^2.
    """
    parts = (arm.hub.inertia, arm.payload.mass, arm.payload.inertia)
    hub, mass, inertia = (each if np.isfinite(each) else 0.0 for each in parts)
    payload = replace(arm.payload, mass=mass, inertia=inertia)
    return replace(arm, hub=replace(arm.hub, inertia=hub), payload=payload).turned_inertia


def rate_unit(arm: Arm) -> float:
    """Return J w1 [N m s/rad], the natural unit of K1."""
    return turning_inertia(arm) * first_frequency(arm)


def angle_unit(arm: Arm) -> float:
    """Return J w1^2 [N m/rad], the natural unit of Kp."""
    return turning_inertia(arm) * first_frequency(arm) ** 2


def gain_unit(arm: Arm, name: str) -> float:
    """Return the natural unit of the gain of that name on this arm, in its SI unit."""
    units = {"Kp": angle_unit, "K1": rate_unit}
    return units[name](arm) if name in units else arm.input_per_torque


def most_gain(arm: Arm, name: str) -> float:
    """Return the largest magnitude of the gain of that name on this arm."""
    return MOST_UNITS * gain_unit(arm, name)


def check_gains(arm: Arm, law: HubFeedback, least: float = LEAST_UNITS) -> None:
    """Raise ParameterError for a gain that is too large for the arm, or too small: 0 to `least` of its unit."""
    for name, unit in {"Kp": "J w1^2", "K1": "J w1", "K2": "1"}.items():
        value = law[name]
        own = gain_unit(arm, name)
        most = MOST_UNITS * own
        remedy = f"for this arm at most {MOST_UNITS:g} times {unit} in size, {most:.3g}"
        require(abs(value) <= most, name, value, remedy)
        smallest = least * own
        remedy = f"for this arm 0, or at least {least:g} times {unit} in size, {smallest:.3g}"
        require(not value or abs(value) >= smallest, name, value, remedy)


def default_gains(arm: Arm) -> HubFeedback:
    """Return the default law of an arm: K1 = 0.00642 J w1 to three digits, K2 = 0.3.

    On the paper's arm and its presets K1 = 0.3 N m s/rad.  For a hub without inertia K2 = 0, as any other value is an
    algebraic loop.
    """
    must_be_arm(arm)
    if _is_of_the_paper(arm):
        return PAPER_GAINS
    K1 = float(f"{RATE_SHARE * rate_unit(arm):.3g}")
    if arm.has_massless_hub:
        return HubFeedback(K1=K1)
    return HubFeedback(K1=K1, K2=float(f"{PAPER_GAINS.K2 * arm.input_per_torque:.3g}"))


def default_words(arm: Arm, names: Iterable[str] = ("K1", "K2")) -> str:
    """Return the default gains of these names and their reason, in one clause."""
    law = default_gains(arm)
    is_paper = _is_of_the_paper(arm)
    why = "as in the paper" if is_paper else f"{RATE_SHARE:g} J w1 of this arm"
    words = {name: law.gain_text(name, "{:g}".format, arm) for name in ("K1", "K2")}
    words["K1"] += f" ({why})"
    text = " and ".join(words[name] for name in names)
    if arm.input_per_torque != 1.0:
        return f"{text}, through {input_words(arm)}"
    return text


def _is_of_the_paper(arm: Arm) -> bool:
    """Whether link, hub and payload are those of one of the paper's presets."""
    # density [kg/m^3] and C [s]
    paper_materials = ((2766.7, 0.0), (2766.7, 1e-4), (2.7667, 0.0))
    section = Section.general(area=6e-4, second_moment=1.8e-9, shear_factor=5 / 6)
    link = arm.link
    is_material = (link.density, link.damping) in paper_materials
    is_link = (link.length, link.youngs_modulus, link.shear_modulus) == (1.0, 6.8944e10, 2.6517e10)
    is_ended = (arm.hub, arm.payload) == (Hub(inertia=0.1), Payload())
    return is_material and is_link and is_ended and link.section == section
