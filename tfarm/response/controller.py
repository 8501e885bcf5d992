"""A controller in the results of its loops: gains or transfer functions, signals, units, sign convention."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tfarm.arm import LISTED, SPELT_OUT, Arm, Law, input_words, unit_of
from tfarm.schema import Quantity

from .signals import Signals


@dataclass(frozen=True)
class Controller:
    """A law on an arm.  `gains` are those at the hub, empty of another law; `signals` have their SI units."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    law: Annotated[str, Quantity("controller", help="its gains at the hub, or its name")]
    gains: Annotated[dict[str, float], Quantity(help="gain at the hub", flat=True)]
    gain_units: Annotated[dict[str, str], Quantity(help="SI unit of each gain")]
    signals: Annotated[dict[str, str], Quantity("signals", help="outputs that are fed back, with their SI units")]
    law_order: Annotated[int, Quantity("order of the controller", help="number of its states, without delays")]
    delay: Annotated[float, Quantity(unit="s", help="delay of the controller")]
    sign_convention: Annotated[str, Quantity("sign convention", help="control law from the signals to the input")]
    input: Annotated[str, Quantity("input", help="actuating signal")]


def controller(law: Law, arm: Arm) -> Controller:
    """Return the description of a law on an arm."""
    gains = {} if law.gains is None else law.gains.by_name
    units = {gain.name: unit_of(gain.name, arm) for gain in LISTED} if gains else {}
    return Controller(
        arm=arm.name,
        law=", ".join(f"{name} = {value:g}" for name, value in gains.items()) or law.name,
        gains=gains,
        gain_units=units,
        signals=dict(zip(law.signals, Signals(arm, law.signals).units, strict=True)),
        law_order=law.order,
        delay=law.delay,
        sign_convention=sign_convention(law, arm),
        input=arm.input,
    )


def sign_convention(law: Law, arm: Arm) -> str:
    """Return the control law in words; for gains at the hub with the moment of a static torque."""
    if law.gains is not None:
        return sign_of(arm)
    sign, variable = "-" if law.sign < 0 else "+", "z" if law.is_discrete else "s"
    late = f", delay {law.delay:g} s" if law.delay else ""
    return f"v = {sign}sum of C_i({variable}) y_i{late}; v is {input_words(arm)}, y = ({', '.join(law.signals)})"


def sign_of(arm: Arm) -> str:
    """Return the law of gains at the hub in words, and the moment of a static torque, which fixes the sign of K2."""
    words = f"u = -{SPELT_OUT} + r"
    if arm.is_uniform and arm.has_rigid_mode:
        return f"{words}; a static torque u gives the moment -(J - I_h)/J u"
    if not arm.has_rigid_mode:
        return f"{words}; u is {input_words(arm)}"
    share = arm.gauged_inertia / arm.total_inertia
    return (
        f"{words}; u is {input_words(arm)}, and a static torque at the hub gives the moment {-share:.6g} times as much"
    )
