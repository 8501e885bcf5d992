"""How far the float64 response is from the exact one, in ball arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from tfarm.arm import Arm
from tfarm.errors import CertificationError, ConvergenceError

from .transfer import transfer

BAND_POINTS = 100  # at which the error is looked at, even in ln w
RIGHT_DIGITS = 30  # of the value that is taken for exact: twice those of float64


def worst_error(arm: Arm, output: str, band: tuple[float, float]) -> float | None:
    """The worst error along the imaginary axis over a band [rad/s]; None where the response is zero throughout.

    Counted in the change of G that a relative change of its argument brings about: |G_64/G - 1| / (1 + |s G'/G|).
    """
    G = transfer(arm, output)
    s = 1j * np.geomspace(*band, BAND_POINTS)
    values, slopes = G(s), G.derivative(s)
    if not np.any(values):
        return None
    errors = []
    for point, value, slope in zip(s, values, slopes, strict=True):
        try:
            pair = G.digits(complex(point), RIGHT_DIGITS)
        except (CertificationError, ConvergenceError):  # a zero of G, where a relative error means nothing
            continue
        parts = zip(pair, (value.real, value.imag), strict=True)
        off = complex(*(float(Fraction(exact) - Fraction(float(part))) for exact, part in parts))
        errors.append(abs(off) / (abs(value) + abs(point * slope)))
    return float(max(errors)) if errors else None
