"""What the commands print with --json: plain dictionaries of doubles, strings and lists.

Infinities are the strings "inf" and "-inf"; NaN does not occur.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.exact.methods import Method
from tfarm.response import TransferFunction
from tfarm.spectrum import Modes, compare_theories, damped_modes


def to_json(answer: dict[str, Any]) -> str:
    """One JSON object in ASCII, which every pipe takes, with infinities as strings; NaN raises ValueError."""
    return json.dumps(_plain(answer), allow_nan=False)


def modes_answer(
    modes: Modes, digits: int | None, certify: bool = False, method: Method = "closed-form"
) -> dict[str, Any]:
    """The modal table, frequencies as strings of so many digits where more than 15 are asked for.

    With `certify` each flexible mode gets its proven bracket, and the whole the count that proves it complete; `method`
    is the road to the frequencies.
    """
    exact = modes.digits(digits) if digits is not None else []
    strings = exact if digits is not None and digits > 15 else None
    by_theory, found = compare_theories(modes), modes.frequencies(method)
    rows = []
    for row, index in enumerate(modes.index):
        frequency: Any = float(found[row]) if strings is None else strings[row]
        rows.append({
            "index": int(index),
            "natural_frequency_rad_s": frequency,
            "natural_frequency_hz": float(found[row]) / (2 * math.pi),
            "hub_participation": float(modes.hub_participation[row]),
            "modal_moment": float(modes.modal_moment[row]),
            "nodes_m": [float(x) for x in modes.nodes[row]],
            "theories_rad_s": {theory: float(values[row]) for theory, values in by_theory.items()},
            "sensitivity": {name: float(values[row]) for name, values in modes.sensitivity.items()},
        })  # fmt: skip
    answer: dict[str, Any] = {
        "arm": modes.arm.name,
        "count": int(modes.index.max()),
        "complete": True,
        "theory": modes.theory,
        "method": method,
    }
    if digits is not None:
        answer["digits"] = digits
    if certify:
        proof = modes.certify(15 if digits is None else digits)
        for mode, (lower, upper) in zip(rows[-len(proof.brackets) :], proof.brackets, strict=True):
            mode |= {"lower_rad_s": lower, "upper_rad_s": upper}
        answer |= {"proven_complete": True, "proof": {"count": proof.count, "below_rad_s": proof.below}}
    if modes.arm.link.damping:
        answer |= _damped(modes, rows, digits, certify)
    return answer | {"modes": rows}


IN_THE_BOX = "complete in the box; lightly damped shear modes exist above any box, real eigenvalues accumulate at -1/C"


def _damped(modes: Modes, rows: list[dict[str, Any]], digits: int | None, certify: bool) -> dict[str, Any]:
    """Eigenvalues beside each mode, and the box where they are all there are; with `certify` each in a proven disc."""
    damped = damped_modes(modes)
    for row, pair, ratio in zip(rows, damped.eigenvalues, damped.damping_ratio, strict=False):
        if pair[0].imag or not row["index"]:
            row["eigenvalue"] = [float(pair[0].real), float(pair[0].imag)]
        else:
            row["eigenvalues"] = [float(zero.real) for zero in pair]
        row["damping_ratio"] = float(ratio)
    answer = {"box": list(damped.box), "eigenvalues_in_box": damped.count, "box_note": IN_THE_BOX}
    if damped.left_out:
        answer["damped_note"] = f"eigenvalues up to mode {damped.index[-1]} only: branches above cannot be told apart"
    if certify:
        discs = damped.certify(15 if digits is None else digits)
        for row, of_mode in zip((row for row in rows if row["index"]), discs, strict=False):
            row["discs"] = [{"re": disc.re, "im": disc.im, "radius": disc.radius} for disc in of_mode]
        answer["proven_complete_in_box"] = True
    return answer


def response_answer(G: TransferFunction, s: np.ndarray[Any, Any], digits: int | None) -> dict[str, Any]:
    """Values of one output at the points s; pairs of strings where more than 15 digits are asked for."""
    if digits is not None and digits > 15:
        value: list[Any] = [list(G.digits(complex(point), digits)) for point in s]
    else:
        value = [[float(v.real), float(v.imag)] for v in G(s)]
    answer: dict[str, Any] = {
        "arm": G.arm.name,
        "input": G.input,
        "input_unit": G.input_unit,
        "output": G.outputs[0],
        "unit": G.units[0],
        "method": G.method,
    }
    if G.x is not None:
        answer["x"] = G.x
    return answer | {"s": [[float(p.real), float(p.imag)] for p in s], "value": value}


def presets_answer(arms: list[Arm]) -> dict[str, Any]:
    """Name, size and assumptions of each preset."""
    return {"presets": [_arm(arm) for arm in arms]}


def _arm(arm: Arm) -> dict[str, Any]:
    return {
        "name": arm.name,
        "length": arm.link.length,
        "damping": arm.link.damping,
        "hub_inertia": arm.hub.inertia,
        "payload_mass": arm.payload.mass,
        "payload_inertia": arm.payload.inertia,
        "assumptions": list(arm.assumptions),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0 else "-inf"
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value
