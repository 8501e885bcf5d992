"""Eigenvalues of damped arms by methods that share nothing with tfarm's characteristic function.

`ritz_eigenvalues`: a Galerkin model's quadratic eigenvalue problem.  `sine_waves`: the pinned-pinned arm's closed form.
`delta`: the paper's 4x4 determinant, its hub row changed by feedback.
"""

import math

import mpmath
import numpy as np

from tests.models import Ritz
from tfarm import Arm, Hub, Payload
from tfarm.exact.appendix import Appendix, _determinant


def pinned(link):
    """The arm between two pins, whose modes are sine waves at any damping."""
    return Arm(link=link, hub=Hub(inertia=0.0), payload=Payload(mass=math.inf))


def ritz_eigenvalues(arm, terms=40):
    """All eigenvalues of a Galerkin model but the rigid body's, those of small modulus first.

    With unit stiffness and flexibilities F = 1/w^2 in modal coordinates:  (mu^2 + mu C B + F) q = 0,  mu = 1/s,  where
    B is the bending part of the stiffness: damping multiplies it alone.
    """
    model = Ritz(arm, terms)
    flexibility, shapes = model.flexibilities()
    bending = (shapes.T * model.bending) @ shapes
    root = np.diag(np.sqrt(flexibility))
    none = np.zeros_like(root)
    inverse = np.linalg.eigvals(np.block([[none, root], [-root, -arm.link.damping * bending]]))
    return 1 / inverse[np.argsort(-abs(inverse))]


def sine_waves(arm, number, theory="timoshenko"):
    """Eigenvalues (number, 2..4) of the waves n = 1..number between two pins, and the cut-off's pair if there is one.

    W sin kx and P cos kx in the equations of motion leave a polynomial in s:
    (rhoA s^2 + kGA k^2)(rhoI s^2 + EI k^2 (1 + C s) + kGA) = (kGA k)^2,  and for kGA = inf
    rhoA s^2 + k^2 (rhoI s^2 + EI k^2 (1 + C s)) = 0.
    """
    link = arm.link
    rhoI = link.rhoI if theory in ("timoshenko", "rayleigh") else 0.0
    waves = []
    for n in range(1, number + 1):
        k2 = (n * math.pi / link.length) ** 2
        bend = np.array([rhoI, link.EI * k2 * link.damping, link.EI * k2])
        if theory in ("timoshenko", "shear"):
            force = np.array([link.rhoA / link.kGA, 0.0, k2])
            polynomial = np.polymul(force, bend)
            polynomial[-3:] += [link.rhoA, 0.0, 0.0]
        else:
            polynomial = k2 * bend + [link.rhoA, 0.0, 0.0]
        waves.append(np.roots(np.trim_zeros(polynomial, "f")).astype(complex))
    cut_off = np.empty(0, complex) if theory != "timoshenko" else np.sqrt(link.kGA / link.rhoI) * np.array([1j, -1j])
    return np.array(waves), cut_off


def delta(arm, s, Kp=0.0, K1=0.0, K2=0.0):
    """The paper's Delta at the working precision of mpmath, with u = -Kp theta - K1 theta_t - K2 E I phi'(0)."""
    at = Appendix(arm, mpmath.mpc(s))
    rows, (Kp, K1, K2) = [list(row) for row in at.a], map(mpmath.mpmathify, (Kp, K1, K2))
    for j, (l, gamma) in enumerate(at.waves):
        rows[3][j] += (Kp + K1 * at.s) * gamma + K2 * at.EI * l * gamma
    return _determinant(rows)


def _newton(arm, s, digits, **gains):
    """A step of Newton's method on the paper's Delta, over s; its slope by a difference of so many digits."""
    step = abs(s) * mpmath.mpf(10) ** -digits
    here, up, down = (delta(arm, at, **gains) for at in (s, s + step, s - step))
    return here / ((up - down) / (2 * step)) / s


def newton_step(arm, s, digits=50, **gains):
    """How far Newton's method on the paper's Delta moves s, relative to it."""
    with mpmath.workdps(digits + 30 + _guard(arm, s)):
        return float(abs(_newton(arm, mpmath.mpc(s), digits // 2, **gains)))


def newton_root(arm, s, digits):
    """The zero of the paper's Delta next to s, to `digits` digits."""
    with mpmath.workdps(2 * digits + 30 + _guard(arm, s)):
        s = mpmath.mpc(s)
        for _ in range(12):
            move = _newton(arm, s, digits)
            s *= 1 - move
            if abs(move) < mpmath.mpf(10) ** (-digits - 10):
                return s
    raise AssertionError("Newton's method on Delta did not settle")


def _guard(arm, s):
    with mpmath.workdps(30):
        return int(sum(abs(mpmath.re(l)) for l in Appendix(arm, mpmath.mpc(s)).lambdas) * arm.link.length) + 10
