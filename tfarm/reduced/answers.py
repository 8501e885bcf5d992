"""What `tfarm reduce --json` prints: a plain dictionary of doubles, strings and lists."""

from __future__ import annotations

import math
from typing import Any

from tfarm.response import transfer

from .reduction import ReducedModel

NORM = "|dG| / (|G| + |w dG/dw|)"


def reduced_answer(reduced: ReducedModel) -> dict[str, Any]:
    """The model, its matrices and its error."""
    model = reduced.model
    G = transfer(model.arm, model.rows, x=model.x)
    A, B, C, D = reduced.matrices()
    poles = [[float(p.real), float(p.imag)] for p in model.eigenvalues.ravel()]
    poles += [[float(pole), 0.0] for pole in model.single]
    poles += [[-1 / model.arm.damping, 0.0]] if model.relaxation is not None else []
    return {
        "arm": model.arm.name,
        "method": reduced.method,
        "order": reduced.order,
        "band_rad_s": list(reduced.band),
        "worst_error": reduced.worst_error,
        "error_norm": NORM,
        "errors": dict(zip(model.outputs, map(float, reduced.errors), strict=True)),
        "worst_at_rad_s": dict(zip(model.outputs, map(float, reduced.worst_at), strict=True)),
        "first_mode_lacking": reduced.first_mode_lacking,
        "first_mode_lacking_rad_s": reduced.lacking_frequency,
        "first_mode_lacking_hz": reduced.lacking_frequency / (2 * math.pi),
        "note": reduced.note,
        **({} if model.x is None else {"x": model.x}),
        "input": model.input,
        "input_unit": G.input_unit,
        "inputs": [model.input],
        "outputs": list(model.outputs),
        "units": list(G.units),
        "states": list(model.states),
        "poles": poles,
        "A": A.tolist(),
        "B": B.tolist(),
        "C": C.tolist(),
        "D": D.tolist(),
    }
