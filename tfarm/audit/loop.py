"""Numbers behind two rows of section 3: an unstable root beyond K2 = 1, and energy pumped by switching K2."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
from mpmath import mpc, mpf
from numpy.polynomial import legendre
from numpy.typing import NDArray

from tfarm.arm import Arm, load

K1 = 0.3  # N m s/rad
ROOT_DIGITS = 30  # of a root, of which four are shown
POLYNOMIALS = 8  # polynomials a field
Matrix = NDArray[np.float64]


def end_determinant(arm: Arm, K2: float, s: Any) -> Any:
    """Determinant of the ends' conditions, undamped, under (19), by exp(A(s) L) instead of the appendix."""
    link = arm.link
    EI, kGA = mpf(link.EI), mpf(link.kGA)
    rhoA, rhoI = mpf(link.rhoA), mpf(link.rhoI)
    A = mpmath.matrix([[0, 1, 1 / kGA, 0], [0, 0, 0, 1 / EI], [rhoA * s**2, 0, 0, 0], [0, rhoI * s**2, -1, 0]])
    T = mpmath.expm(A * mpf(link.length))
    m_s2, Ic_s2 = arm.payload.mass * s**2, arm.payload.inertia * s**2
    hub = (mpf(arm.hub.inertia) * s**2 + K1 * s) / (1 - mpf(K2))  # M(0) = hub * theta
    start = ([0, 1, 0, hub], [0, 0, 1, 0])  # w, psi, Q, M at the root, by theta and by Q(0)
    columns = [T * mpmath.matrix(each) for each in start]
    tip = [(c[2] + m_s2 * c[0], c[3] + Ic_s2 * c[1]) for c in columns]
    return (tip[0][0] * tip[1][1] - tip[0][1] * tip[1][0]) * (1 - mpf(K2)) / s


def growth(K2: float, near: complex) -> Any:
    """The closed-loop root of the default arm near a point, to ROOT_DIGITS digits."""
    arm = load("sasaki2012")
    with mpmath.workdps(2 * ROOT_DIGITS):
        return mpmath.findroot(lambda s: end_determinant(arm, K2, s), mpc(near), tol=mpf(10) ** (-ROOT_DIGITS))


def matrices(arm: Arm, hub: float) -> tuple[Matrix, Matrix]:
    """Mass and stiffness of the undamped arm on polynomials: y = x p(x), phi = x q(x), and theta last."""
    link, n = arm.link, POLYNOMIALS
    nodes, weights = legendre.leggauss(2 * n)
    x, weights = (nodes + 1) / 2, weights / 2 * link.length
    values = legendre.legvander(2 * x - 1, n - 1)
    slopes = np.stack([legendre.legval(2 * x - 1, legendre.legder(row)) for row in np.eye(n)], axis=1) * 2
    f, f_x = x[:, None] * values, (values + x[:, None] * slopes) / link.length
    zero, one = np.zeros_like(f), np.ones((len(x), 1))
    w, psi = np.hstack([f, zero, x[:, None] * link.length]), np.hstack([zero, f, one])
    bending, shear = np.hstack([zero, f_x, 0 * one]), np.hstack([f_x, -f, 0 * one])
    mass = link.rhoA * (w.T * weights) @ w + link.rhoI * (psi.T * weights) @ psi
    mass[-1, -1] += hub
    return mass, link.EI * (bending.T * weights) @ bending + link.kGA * (shear.T * weights) @ shear


def propagator(arm: Arm, K2: float, duration: float) -> Matrix:
    """State transition of the loop (19) over a time of constant gains.

    With M(0) = I_h theta_tt - u the law is a hub of inertia I_h/(1 - K2) with a damper K1/(1 - K2).
    """
    mass, stiffness = matrices(arm, arm.hub.inertia / (1 - K2))
    n = len(mass)
    damper = np.zeros((n, n))
    damper[-1, -1] = K1 / (1 - K2)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damper)]])
    values, vectors = np.linalg.eig(A)
    return np.asarray((vectors * np.exp(values * duration) @ np.linalg.inv(vectors)).real)


def pumped(low: float, high: float, first: float, second: float) -> float:
    """Growth per period of the motion when K2 is switched: low for `first` seconds, high for `second`."""
    arm = load("sasaki2012")
    period = propagator(arm, high, second) @ propagator(arm, low, first)
    return float(abs(np.linalg.eigvals(period)).max())


def growth_text() -> str:
    """The sharpness of K2 < 1 in numbers."""
    within, beyond = (_rounded(growth(K2, near)) for K2, near in ((0.5, -1 + 57j), (1.1, 2 + 21j)))
    return (
        f"Default arm, K1 = {K1}: a root at s = {within} 1/s for K2 = 0.5, at {beyond} 1/s for K2 = 1.1 (mpmath, "
        "from the state-transition matrix)."
    )


def pumped_text() -> str:
    """A gain that varies between two stable values and drives the arm unstable."""
    low, high, first, second = 0.1, 0.6, 0.027, 0.025
    constant = max(pumped(low, low, first, second), pumped(high, high, first, second))
    return (
        f"Counterexample: default arm, K1 = {K1}, {POLYNOMIALS} polynomials a field, continuous time: K2 = {low} for "
        f"{1e3 * first:.0f} ms and {high} for {1e3 * second:.0f} ms grows by {pumped(low, high, first, second):.3f} a "
        f"period, either gain alone by {constant:.6f}, which is the angle at rest."
    )


def _rounded(s: Any) -> str:
    return f"{float(s.real):.4f} {'-' if s.imag < 0 else '+'} {abs(float(s.imag)):.4f}j"
