"""The loop of another model of the arm: a Legendre-Ritz model, its feedback closed through the hub's own equation.

Nothing is shared with tfarm but the equations.  With q the coordinates, b those of the hub's rotation and m the gauge,

    M q'' + C B q' + K q = b u,    m + C m' = I_h theta'' - u,    u = -Kp theta - K1 theta' - K2 m,    theta = b q

since the whole root moment (1 + C d/dt) m is what turns the hub apart from u.  No bending moment is evaluated, so that
everything converges as fast as the frequencies do.
"""

import numpy as np
from scipy.linalg import solve

from tests.models import Ritz


class RitzLoop:
    """The arm's matrices; for each law a state matrix and its eigenvalues."""

    def __init__(self, arm, terms=24):
        self.ritz = ritz = Ritz(arm, terms)
        Z = ritz.free
        self.arm, self.damping, self.inertia = arm, arm.link.damping, arm.hub.inertia
        self.M, self.K, self.B = (Z.T @ m @ Z for m in (ritz.mass, np.diag(ritz.stiffness), np.diag(ritz.bending)))
        self.b = Z.T @ ritz.hub_psi
        self.n = self.b.size

    def state_matrix(self, law):
        """A of z' = A z, z = (q, q', m), without m at C = 0, where m = I_h theta'' - u at once."""
        n, b, C = self.n, self.b, self.damping
        bb = np.outer(b, b)
        if C == 0:
            share = 1 / (1 - law.K2)
            mass = self.M + self.inertia * law.K2 * share * bb
            return np.block([
                [np.zeros((n, n)), np.eye(n)],
                [-solve(mass, self.K + law.Kp * share * bb), -law.K1 * share * solve(mass, bb)],
            ])  # fmt: skip
        column, zero = b[:, None], np.zeros((n, 1))
        forces = -np.hstack([self.K + law.Kp * bb, C * self.B + law.K1 * bb, law.K2 * column])
        motion = solve(self.M, forces, assume_a="pos")
        torque = -np.hstack([law.Kp * b, law.K1 * b, [law.K2]])
        gauge = (self.inertia * b @ motion - torque - np.r_[np.zeros(2 * n), 1.0]) / C
        return np.vstack([np.hstack([np.zeros((n, n)), np.eye(n), zero]), motion, gauge])

    def eigenvalues(self, law):
        """All eigenvalues but those at 0 [1/s], which the free hub angle leaves."""
        s = np.linalg.eigvals(self.state_matrix(law))
        at_zero = 0 if law.Kp or not self.arm.has_rigid_mode else 1 if law.K1 else 2
        return s[np.argsort(abs(s))][at_zero:]

    def rightmost(self, law):
        """The largest real part [1/s]; at C = 0, where it tends to 0 with the frequency, of a few modes if not > 0."""
        s = self.eigenvalues(law)
        largest = float(s.real.max())
        if self.damping or largest > 1e-9 * abs(s).max():
            return largest
        return float(s.real[abs(s) < 8 * self.ritz.natural_frequencies(1)[0]].max())
