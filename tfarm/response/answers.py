"""Responses as commands have them: the answers of `tfarm response` and `tfarm bode`, and their tables."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tfarm.columns import Column, Table
from tfarm.digits import general, singly, within
from tfarm.exact.methods import roads_answer
from tfarm.spectrum.answers import EIGENVALUE_ERROR

from .frequency import Bode
from .transfer import TransferFunction

HERTZ = 2 * math.pi  # rad/s


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


def by_methods_answer(G: TransferFunction, s: np.ndarray[Any, Any]) -> dict[str, Any]:
    """One output at s by each method, and by what share of its size each differs from the closed form."""
    answer: dict[str, Any] = {"arm": G.arm.name, "output": G.outputs[0], "unit": G.units[0]}
    return answer | {"s": [[float(p.real), float(p.imag)] for p in s], **roads_answer(G.by_methods(s))}


def points_table(answer: dict[str, Any]) -> Table:
    """A row a point: s, and the output over the input."""
    output, unit, twelve = answer["output"], f"{answer['unit']} / {answer['input_unit']}", singly(general, 12)
    (re_s, im_s), (re, im) = (zip(*answer[name], strict=True) for name in ("s", "value"))
    return Table(
        columns=(
            Column("re_s", "Re s", "1/s", of=re_s, digits=twelve),
            Column("im_s", "Im s", "1/s", of=im_s, digits=twelve),
            Column(f"re_{output}", f"Re {output}", unit, of=re, digits=twelve),
            Column(f"im_{output}", f"Im {output}", unit, of=im, digits=twelve, head="Im"),
        )
    )


ROOT_COLUMNS = (  # of (s, |G| at i Im s, or of a real root at i |s|)
    Column(
        "re",
        "Re s",
        "1/s",
        of=lambda row: float(row[0].real),
        shown=lambda row: within(float(row[0].real), EIGENVALUE_ERROR * abs(row[0]), 10),
    ),
    Column("im", "Im s", "rad/s", of=lambda row: float(row[0].imag), digits=singly(general, 10)),
    Column("frequency_hz", "Im s/2 pi", "Hz", of=lambda row: float(row[0].imag) / HERTZ, digits=singly(general, 8)),
    Column("magnitude", "|G| there", of=lambda row: float(row[1]), digits=singly(general, 6)),
)
BODE_COLUMNS = (  # of `Bode`
    Column("omega_rad_s", "angular frequency", "rad/s", of="omega"),
    Column("frequency_hz", "frequency", "Hz", of=lambda data: data.omega / HERTZ),
    Column("real", "real part", of=lambda data: data.value.real),
    Column("imaginary", "imaginary part", of=lambda data: data.value.imag),
    Column("magnitude", "magnitude", of=lambda data: abs(data.value)),
    Column("phase_deg", "phase", "deg", of="phase"),
)


def bode_answer(data: Bode) -> dict[str, Any]:
    """Poles and zeros of a Bode plot with |G| there ("inf" and 0 on the axis), then its curve, refined around them.

    They are complete up to the band's end in Im s, and in Re s between the two numbers beside each.
    """
    roots = {"poles": (data.poles, data.peaks), "zeros": (data.zeros, data.dips)}
    return {
        "arm": data.arm.name,
        "input": "hub_angle" if data.arm.is_locked else data.arm.input,
        "output": data.output,
        **({} if data.x is None else {"x": data.x}),
        "unit": data.gain_unit,
        "band_rad_s": list(data.band),
        **{key: Table(columns=ROOT_COLUMNS, record=list(zip(*pair, strict=True))) for key, pair in roots.items()},
        "poles_between_re_1_s": list(data.pole_width),
        "zeros_between_re_1_s": list(data.zero_width),
        "omega_rad_s": data.omega.tolist(),
        "value": [[v.real, v.imag] for v in data.value.tolist()],
        "phase_deg": data.phase.tolist(),
    }


def bode_table(data: Bode) -> Table:
    """The curve of a Bode plot, a row a frequency."""
    return Table(columns=BODE_COLUMNS, record=data)
