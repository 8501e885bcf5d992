"""The loop of another model of the arm: a Legendre-Ritz model, its feedback closed through the hub's own equation.

Nothing is shared with tfarm but the equations.  With q the coordinates, b those of the hub's rotation and m the gauge,

    M q'' + C B q' + K q = b u,    m + C m' = I_h theta'' - u,    u = -Kp theta - K1 theta' - K2 m,    theta = b q

since the whole root moment (1 + C d/dt) m is what turns the hub apart from u.  No bending moment is evaluated, so that
everything converges as fast as the frequencies do.
"""

import numpy as np
from scipy.linalg import expm, solve

from tests.models import Ritz


class RitzLoop:
    """The arm's matrices; for each law a state matrix, its eigenvalues, and the growth of its energy."""

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

    def energy_growth(self, law, rate, rng, time_constants=20):
        """ln of the energy after `time_constants` times 1/|rate|, over that at half the time: simulated.

        One step's matrix exponential, squared until the end: the state every 2^k steps, exactly.
        """
        A, root = self.state_matrix(law), self._root_of_energy()
        A = root @ A @ np.linalg.inv(root)
        end = time_constants / abs(rate)
        doublings = max(1, int(np.ceil(np.log2(end * np.linalg.norm(A, 2)))))
        P = expm(A * end / 2**doublings)
        for _ in range(doublings - 1):
            P = P @ P
        z = [P @ rng.standard_normal(A.shape[0])]
        z.append(P @ z[0])
        early, late = (self._energy(np.linalg.solve(root, each), law) for each in z)
        return float(np.log(late / early))

    def _energy(self, z, law):
        q, rate = z[: self.n], z[self.n : 2 * self.n]
        return q @ self.K @ q + rate @ self.M @ rate + abs(law.Kp) * (self.b @ q) ** 2

    def _root_of_energy(self):
        """A root of the energy's matrix, with a small part of theta^2 and m^2: coordinates in which nothing is huge."""
        K = self.K + 1e-6 * np.trace(self.M) * self.ritz.natural_frequencies(1)[0] ** 2 * np.outer(self.b, self.b)
        n, size = self.n, 2 * self.n + (self.damping > 0)
        root = np.zeros((size, size))
        root[:n, :n], root[n : 2 * n, n : 2 * n] = np.linalg.cholesky(K).T, np.linalg.cholesky(self.M).T
        if self.damping:
            root[-1, -1] = np.sqrt(self.arm.link.length / self.arm.link.EI)
        return root
