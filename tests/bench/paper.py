"""The paper's appendix as it stands, for any number type: the road that tfarm's own evaluation does not take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tfarm import Arm

Number = Any  # complex array, or mpmath number


@dataclass(frozen=True, slots=True)
class Appendix:
    """Rows of the 4x4 matrix a_ij at s, the wave numbers l1, l2, and what the outputs need of each wave.

    `waves` has a tuple (lambda, gamma(lambda), e^{lambda L}) for +l1, +l2, -l1, -l2.
    """

    rows: list[list[Number]]
    waves: list[tuple[Number, Number, Number]]
    EI: Number
    rhoA: Number


def appendix(arm: Arm, s: Number, *, number: Callable[[float], Number], sqrt: Any, exp: Any) -> Appendix:
    """The matrix of the appendix; `number` makes the parameters exact in the type that `sqrt` and `exp` work in."""
    link = arm.link
    E, rho, C, L = (number(v) for v in (link.youngs_modulus, link.density, link.damping, link.length))
    kG = number(link.shear_factor) * number(link.shear_modulus)
    A, second = number(link.section.area), number(link.section.second_moment)
    ms, Is, Ih = (number(v) * s**2 for v in (arm.payload.mass, arm.payload.inertia, arm.hub.inertia))
    EI, rhoA, Ed = E * second, rho * A, E * (1 + C * s)
    EId = Ed * second

    mean = (1 / Ed + 1 / kG) * rho * s**2 / 2
    spread = sqrt(((1 / Ed - 1 / kG) * rho * s**2) ** 2 - 4 * rhoA * s**2 / EId) / 2
    l1, l2 = sqrt(mean + spread), sqrt(mean - spread)
    waves = [(x, x - rho * s**2 / (kG * x), exp(x * L)) for x in (l1, l2, -l1, -l2)]
    rows = [
        [(ms + rhoA * s**2 / x) * e for x, _, e in waves],
        [g * (Is + EId * x) * e for x, g, e in waves],
        [1 + 0 * x for x, _, _ in waves],
        [g * (Ih - EId * x) for x, g, _ in waves],
    ]
    return Appendix(rows, waves, EI, rhoA)


def characteristic(arm: Arm, s: Number, **arithmetic: Any) -> Number:
    """Delta(s) l1 l2 / (4 EI rho A s^2 (l1^2 - l2^2)^2): zero at the natural frequencies only.  C = 0.

    Real on the imaginary axis, and entire: what Delta alone has of zeros and branch points is divided out.
    """
    a = appendix(arm, s, **arithmetic)
    l1, l2 = a.waves[0][0], a.waves[1][0]
    return determinant(a.rows) * l1 * l2 / (4 * a.EI * a.rhoA * s**2 * (l1**2 - l2**2) ** 2)


def determinant(a: list[list[Number]]) -> Number:
    """Laplace's expansion of a 4x4 determinant by its first two rows: no pivot that could be refused."""

    def minor(row: int, i: int, j: int) -> Number:
        return a[row][i] * a[row + 1][j] - a[row][j] * a[row + 1][i]

    pairs = ((0, 1, 2, 3, 1), (0, 2, 1, 3, -1), (0, 3, 1, 2, 1), (1, 2, 0, 3, 1), (1, 3, 0, 2, -1), (2, 3, 0, 1, 1))
    return sum(sign * minor(0, i, j) * minor(2, k, m) for i, j, k, m, sign in pairs)
