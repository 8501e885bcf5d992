"""What the answers of all loops say of the law: its gains, or what it reads, and the sign convention."""

from __future__ import annotations

from typing import Any

from tfarm.arm import LISTED, SPELT_OUT, AnyLaw, Arm, Law, as_law, input_words, unit_of
from tfarm.response.signals import Signals

LAW_IN_WORDS = f"u = -{SPELT_OUT} + r"


def sign_of(arm: Arm) -> str:
    """The law, and what a gauge reads of a static torque: with it the sign of its gain; of a rig what u is."""
    if arm.is_uniform and arm.has_rigid_mode:
        return f"{LAW_IN_WORDS}; a static torque u gives the moment -(J - I_h)/J u"
    if not arm.has_rigid_mode:
        return f"{LAW_IN_WORDS}; u is {input_words(arm)}"
    share = arm.gauged_inertia / arm.total_inertia
    static = f"a static torque at the hub gives the moment {-share:.6g} times as much"
    return f"{LAW_IN_WORDS}; u is {input_words(arm)}, and {static}"


def law_answer(law: AnyLaw, arm: Arm) -> dict[str, Any]:
    """The gains, with the sign convention that they need, and what the loop closes through; or what a law reads."""
    plain = as_law(law)
    return signals_answer(plain, arm) if plain.gains is None else plain.gains.by_name | convention(arm)


def signals_answer(law: Law, arm: Arm) -> dict[str, Any]:
    """What a law reads, of which order, how late, and what it drives."""
    sign = "-" if law.sign < 0 else "+"
    late = f", {law.delay:g} s late" if law.delay else ""
    words = f"v = {sign}sum of C_i(s) y_i{late}; v is {input_words(arm)}, y = ({', '.join(law.signals)})"
    return {
        "law": law.name,
        "signals": dict(zip(law.signals, Signals(arm, law.signals).units, strict=True)),
        "law_order": law.order,
        "delay_s": law.delay,
        "sign_convention": words,
        "input": arm.input,
    }


def convention(arm: Arm) -> dict[str, Any]:
    """Of the answers of every loop: the sign of the moment's gain, the input, and each gain's unit."""
    units = {gain.name: unit_of(gain.name, arm) for gain in LISTED}
    return {"sign_convention": sign_of(arm), "input": arm.input, "gain_units": units}
