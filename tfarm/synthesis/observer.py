"""State feedback from an observer (LQG) with integral action, for many laws at once, as ratios of polynomials.

    xi' = theta,   v = -K x_hat - k xi,   x_hat' = A x_hat + B v + L (y - C x_hat - D v)

K and k minimise the integral of a quadratic form of x and xi, and v^2; L is the gain of the steady Kalman filter.  With
A_o = A - L C - (B - L D) K, and adj the adjugate, the law from y to -v is

    K adj(s - A_o) L/det(s - A_o),   and of the angle also  k det(s - A + L C)/(s det(s - A_o)).

The model is that of the samples under a held input, in w = 2/T (z - 1)/(z + 1): the law in w, discretised by Tustin's
rule, is the one that was designed.  At frequencies far below 1/T, w is s.  (Franklin, Powell and Workman, Digital
Control of Dynamic Systems, 1998, ch. 9; Laub, A Schur method for solving algebraic Riccati equations, 1979.)
"""

from __future__ import annotations

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices
from tfarm.arrays import Real
from tfarm.reduced.modal import sensed_model


def held_model(arm: Arm, signals: tuple[str, ...], modes: int, period: float) -> Matrices:
    """Return A, B, C, D in w of an arm of few modes under an input held over a period [s].

    The static gains of higher modes are left out.
    """
    # here, because it takes a while to load
    from scipy.signal import cont2discrete

    A, B, C, D = sensed_model(arm, signals, modes)
    held, pushed, *_ = cont2discrete((A, B, C, 0.0 * D), period)
    unit = np.eye(len(A))
    within = np.linalg.inv(held + unit)
    speed = 2 / period
    return speed * within @ (held - unit), speed * within @ pushed, 2 * C @ within, -C @ within @ pushed


def riccati(A: Real, G: Real, Q: Real) -> Real:
    """Return the stabilising X (laws, n, n) of A' X + X A - X G X + Q = 0, A (n, n), G and Q (laws, n, n).

    It is that of the stable eigenvectors of the Hamiltonian matrix.
    """
    n = len(A)
    hamiltonian = np.empty((len(Q), 2 * n, 2 * n))
    hamiltonian[:, :n, :n] = A
    hamiltonian[:, :n, n:] = -G
    hamiltonian[:, n:, :n] = -Q
    hamiltonian[:, n:, n:] = -A.T
    values, vectors = np.linalg.eig(hamiltonian)
    stable = np.argsort(values.real, axis=1)[:, None, :n]
    # X U = W of the vectors [U; W]
    U, W = np.split(np.take_along_axis(vectors, stable, 2).transpose(0, 2, 1), 2, axis=2)
    X = np.linalg.solve(U, W).real
    return np.asarray(X + X.transpose(0, 2, 1)) / 2


def characteristic(A: Real) -> Real:
    """Return det(s - A) of matrices (laws, n, n) as polynomials (n + 1, laws), descending."""
    found = np.ones((1, len(A)), complex)
    for root in np.linalg.eigvals(A).T:
        found = np.pad(found, ((0, 1), (0, 0)))
        found[1:] -= root * found[:-1]
    return found.real


def weighted(row: Real, weights: Real) -> Real:
    """Return the forms (laws, n, n) of (weight row x)^2 with weights (laws,)."""
    return weights[:, None, None] ** 2 * np.outer(row, row)


def integral_feedback(plant: Matrices, weights: Real, integral: Real) -> tuple[Real, Real]:
    """Return K (laws, 1, n) and k (laws,) that minimise the integral of the outputs, xi and v, squared and weighted.

    `weights` (outputs, laws) are those of the rows of C, the first that of the angle, and `integral` (laws,) is that of
    xi; v has the weight 1.
    """
    A, B, C, _ = plant
    n = len(A)
    rows = np.pad(C, ((0, 0), (0, 1)))
    # xi' is the angle
    whole = np.pad(A, ((0, 1), (0, 1)))
    whole[n] = rows[0]
    push = np.pad(B, ((0, 1), (0, 0)))
    form = weighted(np.eye(n + 1)[n], integral)
    for row, weight in zip(rows, weights, strict=True):
        form = form + weighted(row, weight)
    gains = push.T @ riccati(whole, np.broadcast_to(push @ push.T, form.shape), form)
    return gains[:, :, :n], gains[:, 0, n]


def filter_gain(plant: Matrices, noise: Real) -> Real:
    """Return L (laws, n, outputs) for white noise of size 1 at the input, of sizes (outputs, laws) at the outputs."""
    A, B, C, _ = plant
    form = np.zeros((noise.shape[1], *A.shape))
    for row, size in zip(C, noise, strict=True):
        form += weighted(row, 1 / size)
    covariance = riccati(A.T, form, np.broadcast_to(B @ B.T, form.shape))
    return np.asarray(covariance @ C.T / noise.T[:, None, :] ** 2)


def observer_law(plant: Matrices, K: Real, k: Real, L: Real) -> list[tuple[Real, Real]]:
    """Return numerator and denominator of the law from each output to -v, the first of which has the integral."""
    A, B, C, D = plant
    own = A - L @ C - (B - L @ D) @ K
    den = characteristic(own)
    found = []
    for column in range(len(C)):
        # of det(s - A_o + L_j K), less that of A_o
        num = characteristic(own - L[:, :, column : column + 1] @ K) - den
        found.append((num[1:], den))
    # that of the angle: s num + k det(s - A + L C), over s den
    num, _ = found[0]
    together = k * characteristic(A - L @ C)
    together[:-1] += num
    found[0] = (together, np.pad(den, ((0, 1), (0, 0))))
    return found
