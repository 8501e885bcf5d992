"""The independent model: a Legendre-Ritz-Galerkin model of the turning arm, its loop, its responses.

With q the coordinates of `tests.models.Ritz`, b those of the hub's rotation, B the part of the stiffness K = diag(...)
that bends, and the whole root moment (1 + C s) m what turns the hub apart from the torque u,

    (s^2 M + s C B + K) q = b u,    theta = b q,    (1 + C s) m = I_h s^2 theta - u

so that a loop u = -(Kp + K1 s) theta - K2 m adds g(s) b b^T to the matrix,

    g = ((Kp + K1 s)(1 + C s) + K2 I_h s^2) / (1 + C s - K2)

and its poles are where that matrix is singular.  They are found as eigenvalues of its linear form and then polished on
the matrix itself, which leaves the rounding of one solution.  Moments and shear forces are sums of inertia forces from
the tip: no derivative is taken, so all converges as fast as the frequencies do.
"""

import math
from functools import cached_property

import numpy as np

from tests.models import Ritz

EPS = np.finfo(float).eps
STEPS = 12  # of the inverse iteration, which converges quadratically


class Model:
    """An arm with so many Legendre polynomials for each strain."""

    def __init__(self, beam, terms):
        self.beam, self.ritz = beam, Ritz(beam, terms)
        self.M, self.K, self.B = self.ritz.mass, self.ritz.stiffness, self.ritz.bending
        self.b, self.C, self.hub = self.ritz.hub_psi, beam.link.damping, beam.hub.inertia

    @cached_property
    def modes(self):
        """Undamped frequencies [rad/s] (n,), ascending, and their shapes (coordinates, n) of unit modal mass."""
        flexibility, shapes = self.ritz.flexibilities()
        omega = 1 / np.sqrt(flexibility[flexibility > 0])
        return omega, shapes[:, : omega.size] * omega

    # ------------------------------------------------------------ responses

    def matrix(self, s, law=None):
        """s^2 M + s C B + K and the loop's part."""
        A = s * s * self.M + np.diag(self.K + s * self.C * self.B)
        return A if law is None else A + self._feedback(s, law)[0] * np.outer(self.b, self.b)

    def _feedback(self, s, law):
        """g and dg/ds."""
        C, up = self.C, law.Kp + law.K1 * s
        top, below = up * (1 + C * s) + law.K2 * self.hub * s * s, 1 + C * s - law.K2
        slope = law.K1 * (1 + C * s) + C * up + 2 * law.K2 * self.hub * s
        return top / below, slope / below - top * C / below**2

    def coordinates(self, s, law=None):
        """q per torque at each s: (points, coordinates)."""
        return np.array([self._solved(complex(p), law) for p in np.atleast_1d(s)])

    def _solved(self, s, law):
        try:
            return np.linalg.solve(self.matrix(s, law), self.b.astype(complex))
        except np.linalg.LinAlgError:  # on a pole to the last bit
            return np.linalg.solve(self.matrix(s * (1 + 4 * EPS), law), self.b.astype(complex))

    def response(self, name, s, x=None):
        """An output per torque at points s: (points,)."""
        q, s = self.coordinates(s), np.atleast_1d(np.asarray(s, complex))
        theta, L, ritz = q @ self.b, self.beam.link.length, self.ritz
        tip = q @ ritz.tip_w
        if name in ("hub_angle", "hub_rate"):
            return theta * (s if name == "hub_rate" else 1)
        if name in ("tip_displacement", "tip_acceleration", "tip_deflection"):
            return {"tip_displacement": tip, "tip_acceleration": s * s * tip, "tip_deflection": tip - L * theta}[name]
        if name in ("deflection", "rotation"):
            w, psi = (q @ field[0] for field in ritz.motion(np.array([x / L])))
            return w - x * theta if name == "deflection" else psi - theta
        moment, shear = self.inertia_forces(q, s, 0.0 if x is None else x)
        return shear if name in ("root_shear", "shear") else moment / (1 + self.C * s)

    def inertia_forces(self, q, s, x):
        """Whole moment and shear force at x [m], from the inertia of all beyond it: (points,) each."""
        L, link, tip, ritz = self.beam.link.length, self.beam.link, self.beam.payload, self.ritz
        nodes, weights = np.polynomial.legendre.leggauss(self.ritz.terms + 12)
        at, weights = x + (L - x) * (nodes + 1) / 2, (L - x) * weights / 2
        w, psi = (q @ field.T for field in ritz.motion(at / L))
        tip_w, tip_psi = q @ ritz.tip_w, q @ ritz.tip_psi
        shear = -s * s * (tip.mass * tip_w + link.rhoA * (w @ weights))
        lever = tip.mass * (L - x) * tip_w + link.rhoA * (w @ (weights * (at - x)))
        return -s * s * (lever + tip.inertia * tip_psi + link.rhoI * (psi @ weights)), shear

    # ------------------------------------------------------------ poles

    def eigenvalues(self, law=None):
        """Those of the linear form [1/s], for starts and for counts; in undamped modes, so that little is rounded."""
        omega, shapes = self._with_rigid
        b, n, C = self.b @ shapes, omega.size, self.C
        D, K = C * (shapes.T * self.B) @ shapes, np.diag(omega**2)
        zero, one, bb = np.zeros((n, n)), np.eye(n), np.outer(b, b)
        if law is None:
            return np.linalg.eigvals(np.block([[zero, one], [-K, -D]]))
        if C == 0:
            share = 1 / (1 - law.K2)
            mass = one + self.hub * law.K2 * share * bb
            force = np.linalg.solve(mass, np.hstack([K + law.Kp * share * bb, law.K1 * share * bb]))
            return np.linalg.eigvals(np.block([[zero, one], [-force[:, :n], -force[:, n:]]]))
        motion = -np.hstack([K + law.Kp * bb, D + law.K1 * bb, law.K2 * b[:, None]])
        torque = -np.hstack([law.Kp * b, law.K1 * b, [law.K2]])
        gauge = (self.hub * b @ motion - torque - np.r_[np.zeros(2 * n), 1.0]) / C
        return np.linalg.eigvals(np.vstack([np.hstack([zero, one, np.zeros((n, 1))]), motion, gauge]))

    @cached_property
    def _with_rigid(self):
        """The modes with the rigid one before them."""
        omega, shapes = self.modes
        rigid = np.zeros(shapes.shape[0])
        rigid[0] = 1 / math.sqrt(self.M[0, 0])
        return np.r_[0.0, omega], np.column_stack([rigid, shapes])

    def polished(self, s, law=None):
        """The pole next to s [1/s] and the size of the last step."""
        if law is not None and self.C == 0 and law.K2 != 1:
            return self._polished_undamped(s, law)
        x, fixed = np.exp(1j * np.arange(self.b.size)), np.cos(np.arange(self.b.size))
        x = np.linalg.solve(self.matrix(s * (1 + 1e-9), law), x)  # of the pole at s, not of its mirror image
        for _ in range(STEPS):
            slope = 2 * s * self.M + np.diag(self.C * self.B).astype(complex)
            A = self.matrix(s)
            if law is not None:
                g, dg = self._feedback(s, law)
                A, slope = A + g * np.outer(self.b, self.b), slope + dg * np.outer(self.b, self.b)
            try:
                u = np.linalg.solve(A, slope @ x)
            except np.linalg.LinAlgError:  # on the pole to the last bit
                return s, 0.0
            step = (fixed @ x) / (fixed @ u)
            s, x = s - step, u / np.linalg.norm(u)
            if abs(step) <= 4 * EPS * abs(s):
                break
        return s, abs(step)

    def _polished_undamped(self, s, law):
        """The same at C = 0, where the modes are uncoupled: zeros of (s^2 + w_k^2) (1 + g sum of b^2/(s^2 + w^2)).

        k is the mode next to s, so that a pole beside the arm's own one is a zero like any other.
        """
        omega, shapes = self._with_rigid
        b2 = (self.b @ shapes) ** 2
        k = int(np.argmin(abs(s * s + omega**2)))
        others = np.arange(omega.size) != k
        for _ in range(4 * STEPS):
            g, dg = self._feedback(s, law)
            below = s * s + omega[others] ** 2
            H, dH = (b2[others] / below).sum(), -2 * s * (b2[others] / below**2).sum()
            own = s * s + omega[k] ** 2
            value = own * (1 + g * H) + g * b2[k]
            step = value / (2 * s * (1 + g * H) + own * (dg * H + g * dH) + dg * b2[k])
            s = s - step
            if abs(step) <= 4 * EPS * abs(s):
                break
        return s, abs(step)
