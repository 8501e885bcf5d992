"""The paper's appendix, letter by letter, with mpmath at any number of digits.

Advances in Acoustics and Vibration, 2012, article 852780, appendix: (A.1), (A.2), the a_ij and Cramer's rule.  It is
slow, without measures against cancellation, and the reference of the fast methods.  Three misprints are corrected: the
inner square root of (A.2), the signs of k3 and k4 in Y (A.1), and the unit of C (s).

The arm's float64 parameters are exact numbers.  Every public function doubles its working precision until two
evaluations agree to the required digits, and returns the better one.
"""

import math
from collections.abc import Callable
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any

import mpmath
from mpmath import mp, mpc, mpf

from tfarm.arm import Arm
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.exact.outputs import Output, output
from tfarm.exact.series import constant_of
from tfarm.exact.system import system_of
from tfarm.exact.waves import Number

# of agreement, beyond coincidence
FEWEST_DIGITS = 15


class Appendix:
    """The appendix at one s, at the working precision, with the torque U = 1.

    With lambda_3 = -lambda_1 and lambda_4 = -lambda_2 the four columns of a_ij are one formula.  A row with an infinite
    inertia is divided by it: motion = 0 at the tip, and Psi(0) = U at a locked hub, the hub angle being its input.
    """

    def __init__(self, arm: Arm, s: Number) -> None:
        link = arm.link
        payload = arm.payload
        self.L = mpf(link.length)
        self.A = mpf(link.section.area)
        self.rho = mpf(link.density)
        self.kappa_G = mpf(link.shear_factor) * mpf(link.shear_modulus)
        self.EI = mpf(link.youngs_modulus) * mpf(link.section.second_moment)
        self.s = s
        self.damper = 1 + mpf(link.damping) * s
        # of each row the weights of motion and force
        inertias = (payload.mass, payload.inertia, arm.hub.inertia)
        self.ends = [(mpf(1), mpf(0)) if math.isinf(each) else (each * s**2, mpf(1)) for each in inertias]
        lambda_1, lambda_2 = self.wave_numbers(mpf(link.youngs_modulus) * self.damper)
        self.lambdas = (lambda_1, lambda_2, -lambda_1, -lambda_2)
        self.gammas = tuple(l - self.rho * s**2 / (self.kappa_G * l) for l in self.lambdas)
        self.waves = tuple(zip(self.lambdas, self.gammas, strict=True))

    def wave_numbers(self, Ed: Number) -> tuple[Number, Number]:
        """Return lambda_1 and lambda_2 of (A.2), with its inner square root; Ed = E (1 + C s)."""
        rho = self.rho
        A = self.A
        s = self.s
        kG = self.kappa_G
        EI = self.EI * self.damper
        outer = (1 / Ed + 1 / kG) * rho * s**2
        inner = mpmath.sqrt((1 / Ed - 1 / kG) ** 2 * rho**2 * s**4 - 4 * rho * A * s**2 / EI)
        return mpmath.sqrt((outer + inner) / 2), mpmath.sqrt((outer - inner) / 2)

    @cached_property
    def a(self) -> list[list[Number]]:
        """a_ij: the tip's shear force, the tip's moment, W(0) = 0, the hub."""
        rhoA_s2 = self.rho * self.A * self.s**2
        EI = self.EI * self.damper
        (m_s2, force), (Ic_s2, moment), (Ih_s2, torque) = self.ends
        waves = [(l, gamma, mpmath.exp(l * self.L)) for l, gamma in self.waves]
        return [
            [(m_s2 + force * rhoA_s2 / l) * e for l, gamma, e in waves],
            [gamma * (Ic_s2 + moment * EI * l) * e for l, gamma, e in waves],
            [mpf(1)] * 4,
            [Ih_s2 * gamma - torque * EI * l * gamma for l, gamma, e in waves],
        ]

    @cached_property
    def Delta(self) -> Number:
        """Determinant of a_ij: zero at a natural frequency, and where lambda_1 = lambda_2."""
        return _determinant(self.a)

    def Delta_k(self, i: int) -> Number:
        """Return Delta with (0, 0, 0, U) for its column i."""
        rows = zip(self.a, (0, 0, 0, 1), strict=True)
        return _determinant([[*row[: i - 1], mpf(right_side), *row[i:]] for row, right_side in rows])

    @cached_property
    def k(self) -> list[Number]:
        """k_1..k_4 by Cramer's rule."""
        return [self.Delta_k(i) / self.Delta for i in (1, 2, 3, 4)]

    @cached_property
    def Theta(self) -> Number:
        """Psi(0), because Phi(0) = 0 (14)."""
        return self.sum(self.gammas, mpf(0))

    def Y(self, x: Number) -> Number:
        """Return the deflection (A.1), with + before k_3 and k_4."""
        return self.sum([mpf(1)] * 4, x) - x * self.Theta

    def Phi(self, x: Number) -> Number:
        """Return the rotation (A.1)."""
        return self.sum(self.gammas, x) - self.Theta

    def sum(self, weights: Any, x: Number) -> Number:
        """Return the sum over j of weight_j k_j e^{lambda_j x}."""
        terms = zip(weights, self.k, self.lambdas, strict=True)
        return mpmath.fsum(weight * k * mpmath.exp(l * x) for weight, k, l in terms)

    def value(self, wanted: Output, x: Number) -> Number:
        """Return the output's quantity at x [m]; M = E I (1 + C s) Phi', Q = kappa G A (Y' - Phi)."""
        EI = self.EI
        if not wanted.gauge:
            EI = EI * self.damper
        fields: dict[str, Callable[[], Number]] = {
            "theta": lambda: self.Theta,
            "W": lambda: self.Y(x) + x * self.Theta,
            "Y": lambda: self.Y(x),
            "Phi": lambda: self.Phi(x),
            "M": lambda: EI * self.sum([gamma * l for l, gamma in self.waves], x),
            "Q": lambda: self.kappa_G * self.A * self.sum([l - gamma for l, gamma in self.waves], x),
        }
        return fields[wanted.quantity]()


def determinant(arm: Arm, s: complex, digits: int) -> Number:
    """Return the paper's Delta at s [1/s] to `digits`.  Raises ConvergenceError at s = 0 and at the cut-off."""
    try:
        return _repeat_to_agreement(lambda: [Appendix(arm, mpc(s)).Delta], digits, f"Delta at s = {s}")[0]
    except ZeroDivisionError:
        raise ConvergenceError(
            f"Delta has no value at s = {s}, where a wave number is zero", None, None
        ) from None


def output_value(arm: Arm, name: str | Output, s: complex, digits: int, x: float | None = None) -> Number:
    """Return an output for unit torque (for unit hub angle of a locked hub) at s [1/s] to `digits`.

    Real and imaginary part have that many right digits each; x [m] is for the outputs along the arm.  Where two of the
    four waves coincide the appendix is 0/0: s is changed by a share that falls with the precision.
    Raises ConvergenceError at a pole, ParameterError for an unknown output or an x outside the arm.
    """
    wanted = output(name)
    place = {"root": 0.0, "tip": arm.link.length, "x": x}[wanted.place]
    if place is None or not 0.0 <= place <= arm.link.length:
        raise ParameterError(
            key="x", value=x, remedy=f"a point of the arm lies between 0 and {arm.link.length} m"
        )
    constant = constant_of(system_of(arm), wanted, place / arm.link.length)
    # by an end condition: no digits would agree
    if constant == 0:
        return mpf(0)
    is_damped = wanted.gauge and arm.link.damping
    # there the output over s^power is real, as for real s
    on_axis = s.real == 0 and arm.link.damping == 0
    is_real = s.imag == 0 or on_axis or (constant is not None and not is_damped)

    def parts() -> list[Number]:
        at = mpc(s)
        try:
            value = Appendix(arm, at).value(wanted, mpf(place))
        except ZeroDivisionError:
            aside = at + (at or 1) * mpf(10) ** (-mp.dps // 8)
            value = Appendix(arm, aside).value(wanted, mpf(place))
        if is_real:
            return [value.real]
        value = value * at**wanted.power
        return [value.real, value.imag]

    found = _repeat_to_agreement(parts, digits, f"{wanted.name} at s = {s}")
    with mpmath.workdps(2 * digits + FEWEST_DIGITS):
        if is_real:
            return found[0] * mpc(s) ** wanted.power
        return mpc(*found)


def _smooth(arm: Arm, w: Number) -> Number:
    """Return Delta lambda_1 lambda_2 at s = i w: for real w and C = 0 it is real, without a branch."""
    at = Appendix(arm, mpc(0, 1) * w)
    return at.Delta * at.lambdas[0] * at.lambdas[1]


def roots_near(arm: Arm, omega: float | str | Number, digits: int) -> int:
    """Return the number of roots of Delta(i w), undamped, within 10^-digits omega of omega [rad/s]; 2 if double.

    It is the change of phase of Delta lambda_1 lambda_2 along a half circle about omega, in half turns.  omega may be a
    text or an mpmath number of any number of digits.
    """
    undamped = arm.with_numbers(damping=0.0)
    with mpmath.workdps(2 * digits + FEWEST_DIGITS):
        half_circle = [mpf(omega) * (1 + mpmath.expjpi(mpf(n) / 8) / mpf(10) ** digits) for n in range(9)]

    def delta(w: Number) -> Number:
        return _repeat_to_agreement(lambda: [_smooth(undamped, w)], FEWEST_DIGITS, f"Delta at {w}")[0]

    values = [delta(w) for w in half_circle]
    turns = [float(mpmath.arg(after / before)) for before, after in pairwise(values)]
    return round(sum(turns) / math.pi)


def natural_frequency(arm: Arm, near: float, digits: int) -> Number:
    """Return the root w [rad/s] of Delta(i w), undamped, next to `near`, to `digits`, by the secant method.

    Raises ConvergenceError where two precisions do not agree: at a double frequency.
    """
    undamped = arm.with_numbers(damping=0.0)

    def real_part(w: Number) -> Number:
        return _smooth(undamped, w).real

    def root() -> list[Number]:
        start = mpf(near)
        ends = start, start * (1 + mpf(10) ** -8)
        try:
            found = mpmath.findroot(real_part, ends, solver="secant", tol=0, verify=False)
        except ZeroDivisionError:
            # both ends are the root, to the last digit
            return [start]
        return [found]

    return _repeat_to_agreement(root, digits, f"the root of Delta near {near} rad/s")[0]


def _repeat_to_agreement(evaluate: Callable[[], list[Number]], digits: int, what: str) -> list[Number]:
    """Return evaluate() at a working precision doubled until two results agree, each number to its digits."""
    # of working precision
    most_digits = 10_000
    digits = max(digits, FEWEST_DIGITS)
    work = digits + FEWEST_DIGITS
    last = [mpf(0)]
    misses = [mpf(0)]
    while work < most_digits + 4 * digits:
        with mpmath.workdps(work):
            values = evaluate()
            misses = [abs(value - before) for value, before in zip(values, last, strict=False)]
            if all(miss < abs(value) / 10**digits / 4 for miss, value in zip(misses, values, strict=False)):
                return values
        work = 2 * work
        last = values
    raise ConvergenceError(f"no {digits} digits of {what}: a pole, a zero, or no limit there", last, misses)


def _determinant(a: list[list[Number]]) -> Number:
    """Return a determinant by Laplace's expansion in 2x2 minors, as mpmath's fails for a badly scaled matrix."""
    upper = _minors(a[0], a[1])
    lower = _minors(a[2], a[3])
    signs = (1, -1, 1, 1, -1, 1)
    return sum(sign * m * n for sign, m, n in zip(signs, upper, reversed(lower), strict=True))


def _minors(above: list[Number], below: list[Number]) -> list[Number]:
    """Return the 2x2 minors of two rows."""
    return [above[i] * below[j] - above[j] * below[i] for i, j in combinations(range(4), 2)]
