"""Proven values to measure errors against, and the measure."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
from numpy.typing import NDArray

import tfarm
from tfarm import Arm

from .paper import characteristic

OUTPUTS = ("hub_angle", "root_moment", "tip_displacement")
DIGITS = 40

Complex = NDArray[np.complex128]


class ExactResponse:
    """The three outputs at points s, 40 digits each, proven in ball arithmetic."""

    def __init__(self, arm: Arm, s: Complex) -> None:
        G = tfarm.transfer(arm, list(OUTPUTS))
        self.value = [[_number(pair) for pair in point] for point in (G.digits(complex(each), DIGITS) for each in s)]
        self.stiffness = abs(s * G.derivative(s) / G(s)).T

    def error(self, values: object) -> float:
        """The largest |error / G| / (1 + |s G'/G|) of `values`, shape (outputs, points), of any number type.

        The last factor forgives what one rounding of s itself would change: near a pole that is a lot.
        """
        with mpmath.workdps(DIGITS):
            rows = np.array(values, dtype=object).T
            relative = [[float(abs(mpmath.mpmathify(a) / b - 1)) for a, b in zip(*pair, strict=True)]
                        for pair in zip(rows, self.value, strict=True)]  # fmt: skip
        return float((np.array(relative) / (1 + self.stiffness)).max())


def _number(pair: tuple[str, str]) -> mpmath.mpc:
    with mpmath.workdps(DIGITS + 5):
        return mpmath.mpc(*pair)


def frequency_errors(arm: Arm, found: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative errors of natural frequencies [rad/s]: each against a 40-digit root of the paper's determinant.

    The root is polished by secants with mpmath, and is one because the determinant changes sign across it.
    The frequencies have to be distinct, and they are complete if tfarm's count is, which the tests check.
    """
    undamped = replace(arm, link=replace(arm.link, damping=0.0))
    return np.array([_error(undamped, omega) for omega in found])


def _error(arm: Arm, omega: float) -> float:
    bending = (arm.link.rhoA * omega**2 / arm.link.EI) ** 0.25 * arm.link.length
    with mpmath.workdps(DIGITS + 20 + int(bending)):  # e^{2 bending} cancels in the determinant, 0.87 bending digits

        def D(w: mpmath.mpf) -> mpmath.mpf:
            value = characteristic(arm, mpmath.mpc(0, w), number=mpmath.mpf, sqrt=mpmath.sqrt, exp=mpmath.exp)
            return value.real

        tiny = mpmath.mpf(10) ** -DIGITS
        w, before = mpmath.mpf(omega), mpmath.mpf(omega) * (1 + mpmath.mpf(10) ** -12)
        at_before = D(before)
        while abs(w - before) > tiny * w:
            at_w = D(w)
            w, before, at_before = w - at_w * (w - before) / (at_w - at_before), w, at_w
        if D(w * (1 - 9 * tiny)) * D(w * (1 + 9 * tiny)) >= 0:
            raise ArithmeticError(f"the determinant does not change sign at {mpmath.nstr(w, 20)} rad/s")
        return float(abs(omega - w) / w)
