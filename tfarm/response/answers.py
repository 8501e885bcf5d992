"""A response as commands have it: the answer of `tfarm response`, and its table for a terminal or a file."""

from __future__ import annotations

from typing import Any

import numpy as np

from tfarm.columns import Column, Table
from tfarm.digits import general, singly

from .transfer import TransferFunction


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


def response_table(answer: dict[str, Any]) -> Table:
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
