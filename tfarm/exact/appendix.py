"""The paper's appendix as it stands, letter by letter, with mpmath at any number of digits.

Advances in Acoustics and Vibration, 2012, article 852780, appendix: (A.1), (A.2), the a_ij and Cramer's rule.  It is
slow and heeds no cancellation: it is what the fast roads are measured against.  Three slips of the print are
mended: the inner square root of (A.2), the signs of k3 and k4 in Y of (A.1), and the units of C (seconds).

The arm's float64 parameters are taken as exact numbers.  Every public function doubles its working precision
until two evaluations agree to the digits asked for, and gives the better one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import mpmath
from mpmath import mp, mpc, mpf

from tfarm.arm import Arm
from tfarm.errors import ConvergenceError, ParameterError

from .outputs import OUTPUTS, Output, output

Number = Any  # mpmath.mpf or mpmath.mpc, which come without types

FEWEST_DIGITS = 15  # two noises never agree to as many
MOST_DIGITS = 20_000  # of working precision


class Appendix:
    """The appendix at one s, at the working precision it is used in.

    With l_3 = -l_1 and l_4 = -l_2 the four columns of a_ij, printed one by one in the paper, are one formula.  An
    infinite inertia divides its row: `_body` gives (1, 0) for (inertia s^2, 1).  The torque U is one; where the
    hub is locked the fourth row reads Psi(0) = 1, and U is the hub angle.
    """

    def __init__(self, arm: Arm, s: Number) -> None:
        link = arm.link
        self.L, self.rho, self.A, self.I = (
            mpf(value) for value in (link.length, link.density, link.section.area, link.section.second_moment)
        )
        self.E, self.C, self.s = mpf(link.youngs_modulus), mpf(link.damping), s
        self.kappa_G = mpf(link.shear_factor) * mpf(link.shear_modulus)
        self.bodies = tuple(
            _body(inertia, s) for inertia in (arm.payload.mass, arm.payload.inertia, arm.hub.inertia)
        )
        lambda_1, lambda_2 = self.wave_numbers()
        self.lambdas = (lambda_1, lambda_2, -lambda_1, -lambda_2)
        self.gammas = tuple(l - self.rho * s**2 / (self.kappa_G * l) for l in self.lambdas)

    def wave_numbers(self) -> tuple[Number, Number]:
        """lambda_1 and lambda_2 of (A.2), with its inner square root."""
        rho, s, kG, E = self.rho, self.s, self.kappa_G, self.E * (1 + self.C * self.s)
        first = (1 / E + 1 / kG) * rho * s**2
        inner = mpmath.sqrt((1 / E - 1 / kG) ** 2 * rho**2 * s**4 - 4 * rho * self.A * s**2 / (E * self.I))
        return mpmath.sqrt((first + inner) / 2), mpmath.sqrt((first - inner) / 2)

    @cached_property
    def a(self) -> list[list[Number]]:
        """a_ij: the tip's shear force, the tip's moment, W(0) = 0, the hub."""
        rho_A_s2, EI, L = self.rho * self.A * self.s**2, self.E * self.I * (1 + self.C * self.s), self.L
        (m_s2, force), (Ic_s2, moment), (Ih_s2, torque) = self.bodies
        waves = [(l, gamma, mpmath.exp(l * L)) for l, gamma in zip(self.lambdas, self.gammas, strict=True)]
        return [
            [(m_s2 + force * rho_A_s2 / l) * e for l, gamma, e in waves],
            [gamma * (Ic_s2 + moment * EI * l) * e for l, gamma, e in waves],
            [mpf(1)] * 4,
            [Ih_s2 * gamma - torque * EI * l * gamma for l, gamma, e in waves],
        ]

    @cached_property
    def Delta(self) -> Number:
        """Determinant of a_ij: zero at a natural frequency, and where l_1 = l_2."""
        return determinant_of(self.a)

    def Delta_k(self, i: int) -> Number:
        """Delta with its column i (1..4) replaced by (0, 0, 0, U), U = 1."""
        a = [row.copy() for row in self.a]
        for row, right_side in zip(a, (0, 0, 0, 1), strict=True):
            row[i - 1] = mpf(right_side)
        return determinant_of(a)

    @cached_property
    def k(self) -> tuple[Number, ...]:
        """k_1..k_4 by Cramer's rule."""
        return tuple(self.Delta_k(i) / self.Delta for i in (1, 2, 3, 4))

    def _sum(self, x: Number, weights: Any) -> Number:
        terms = zip(weights, self.k, self.lambdas, strict=True)
        return mpmath.fsum(weight * k * mpmath.exp(l * x) for weight, k, l in terms)

    def W(self, x: Number) -> Number:
        """Total displacement Y + x Theta."""
        return self._sum(x, (1, 1, 1, 1))

    def Psi(self, x: Number) -> Number:
        """Total rotation Phi + Theta."""
        return self._sum(x, self.gammas)

    @cached_property
    def Theta(self) -> Number:
        """Hub angle Psi(0), because Phi(0) = 0."""
        return self.Psi(mpf(0))

    def Y(self, x: Number) -> Number:
        """(A.1), deflection from the turned arm, with + before k_3 and k_4."""
        return self.W(x) - x * self.Theta

    def Phi(self, x: Number) -> Number:
        """(A.1), rotation against the hub."""
        return self.Psi(x) - self.Theta

    def moment(self, x: Number) -> Number:
        """E I (1 + C s) Phi'(x)."""
        slopes = [gamma * l for gamma, l in zip(self.gammas, self.lambdas, strict=True)]
        return self.E * self.I * (1 + self.C * self.s) * self._sum(x, slopes)

    def shear(self, x: Number) -> Number:
        """kappa G A (Y' - Phi), which is kappa G A (W' - Psi)."""
        angles = [l - gamma for gamma, l in zip(self.gammas, self.lambdas, strict=True)]
        return self.kappa_G * self.A * self._sum(x, angles)

    def value(self, wanted: Output, x: Number) -> Number:
        """The output's quantity at x [m], without its power of s."""
        if wanted.quantity == "theta":
            return self.Theta
        fields = {"W": self.W, "Y": self.Y, "Phi": self.Phi, "M": self.moment, "Q": self.shear}
        return fields[wanted.quantity](x) / (1 + self.C * self.s if wanted.gauge else 1)


def determinant_of(a: list[list[Number]]) -> Number:
    """A 4x4 determinant by Laplace's expansion in 2x2 minors of its upper and lower half.

    mpmath's own judges pivots by absolute size and calls a badly scaled matrix singular.
    """
    total = mpf(0)
    for i, j, k, l, sign in (
        (0, 1, 2, 3, 1), (0, 2, 1, 3, -1), (0, 3, 1, 2, 1), (1, 2, 0, 3, 1), (1, 3, 0, 2, -1), (2, 3, 0, 1, 1)
    ):  # fmt: skip
        upper = a[0][i] * a[1][j] - a[0][j] * a[1][i]
        total += sign * upper * (a[2][k] * a[3][l] - a[2][l] * a[3][k])
    return total


def determinant(arm: Arm, s: complex, digits: int) -> Number:
    """The paper's Delta at s [1/s], right to `digits`.

    Raises ConvergenceError at the shear cut-off, where one wave number vanishes and Delta has a branch pole.
    """
    return _proven(lambda: (Appendix(arm, _exact(s)).Delta,), digits, f"Delta at s = {s}")[0]


def response(arm: Arm, output_name: str, s: complex, digits: int, x: float | None = None) -> Number:
    """An output of `OUTPUTS` per unit torque (per unit hub angle where the hub is locked) at s, right to `digits`.

    x [m] is wanted by the outputs along the arm only.  Where two of the four waves coincide the appendix is 0/0: there s
    is moved aside by a little that shrinks as the precision grows.  The real and the imaginary part are proven each, unless
    one is zero because s^2 (C = 0) or s is real.  Raises ConvergenceError at a pole.
    """
    wanted = output(output_name)
    place = arm.link.length if wanted.place == "tip" else 0.0 if wanted.place == "root" else x
    if place is None or not 0.0 <= place <= arm.link.length:
        remedy = f"{output_name} is asked for at a point of the arm, 0 to {arm.link.length} m"
        raise ParameterError(key="x", value=x, remedy=remedy)
    if _vanishes(arm, wanted, place):
        return mpf(0)
    is_real = s.imag == 0 or (s.real == 0 and arm.link.damping == 0)

    def parts() -> tuple[Number, ...]:
        value = _beside(lambda at: Appendix(arm, at).value(wanted, mpf(place)), _exact(s))
        if is_real:
            return (value.real,)
        value *= _exact(s) ** wanted.power
        return value.real, value.imag

    found = _proven(parts, digits, f"{output_name} at s = {s}")
    with mpmath.workdps(2 * digits + FEWEST_DIGITS):
        return found[0] * _exact(s) ** wanted.power if is_real else mpc(*found)


def roots_near(arm: Arm, omega: float | str | Number, digits: int) -> int:
    """How many roots of Delta(i w) lie within 10^-digits omega of omega [rad/s]: 1 confirms a natural frequency, 2 a double one.

    Delta l_1 l_2, undamped, is real for real w and has no branch: the turns of its phase along a half circle
    about omega count its roots inside.  omega may be a text or an mpmath number of more digits than a float has.
    """
    undamped = replace(arm, link=replace(arm.link, damping=0.0))
    with mpmath.workdps(2 * digits + FEWEST_DIGITS):
        centre = mpf(omega)
        circle = [centre * (1 + mpmath.expjpi(mpf(n) / 8) / mpf(10) ** digits) for n in range(9)]

    def phase(w: Number) -> Number:
        appendix = Appendix(undamped, mpc(0, 1) * w)
        return appendix.Delta * appendix.lambdas[0] * appendix.lambdas[1]

    values = [_proven(lambda w=w: (phase(w),), FEWEST_DIGITS, f"Delta near {w}")[0] for w in circle]  # type: ignore[misc]
    turns = [mpmath.arg(after / before) for before, after in zip(values, values[1:], strict=False)]
    return round(float(mpmath.fsum(turns)) / math.pi)


def _proven(evaluate: Callable[[], tuple[Number, ...]], digits: int, what: str) -> tuple[Number, ...]:
    """What evaluate() gives, at a working precision doubled until two results agree in the digits of each number."""
    digits = max(digits, FEWEST_DIGITS)
    work, last, misses = digits + FEWEST_DIGITS, (), ()
    while work < MOST_DIGITS + 4 * digits:
        with mpmath.workdps(work):
            values = evaluate()
            misses = tuple(abs(value - before) for value, before in zip(values, last, strict=False))
            if misses and all(
                miss <= abs(value) / 10**digits / 4 for miss, value in zip(misses, values, strict=True)
            ):
                return values
        work, last = 2 * work, values
    raise ConvergenceError(f"no {digits} digits of {what}: a pole, a zero, or no limit there", last, misses)


def _beside(function: Callable[[Number], Number], s: Number) -> Number:
    """function(s), or next to s where it is 0/0."""
    try:
        return function(s)
    except ZeroDivisionError:
        return function(s + (s if s else 1) * mpf(10) ** (-mp.dps // 8))


def _body(inertia: float, s: Number) -> tuple[Number, Number]:
    """What a body's row gives its motion and its force: (inertia s^2, 1), or (1, 0) for an infinite inertia."""
    return (mpf(1), mpf(0)) if math.isinf(inertia) else (inertia * s**2, mpf(1))


def _vanishes(arm: Arm, wanted: Output, x: float) -> bool:
    """Whether an end condition makes the output zero: no digits would ever agree."""
    if x == 0.0:
        return wanted.quantity in ("Y", "Phi")
    held = {"W": math.isinf(arm.payload.mass), "Q": arm.payload.mass == 0, "M": arm.payload.inertia == 0}
    return x == arm.link.length and held.get(wanted.quantity, False)


def _exact(s: complex) -> Number:
    return mpc(s.real, s.imag)
