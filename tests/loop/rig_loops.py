"""The closed loop of a rig made of finite elements (`tests.chain_elements`), for the tests only.

    s^2 M y + s D y + K y = b i,    (L_a s + R) i + N Ke s theta = v,    input = -(Kp theta + K1 s theta + K2 m)

with i the current where a voltage drives (without inductance it is left out), else the input itself; m = E I psi'(x) on
the outer side of where the gauge sits, read from the elements.
"""

import numpy as np
from scipy.linalg import cholesky, eigh, eigvals, expm, solve_triangular

from tests.chain_elements import HUB, System, _gain, _slowest, assemble

LEAST = 1e-13  # 1/(w^2 + a^2) of the highest modes that are kept, of the largest: of these rounding leaves digits


class RigLoop:
    """K, D, M of a damped rig on elements good for |s| < up_to, and of its loop under any law."""

    def __init__(self, arm, up_to):
        self.arm, self.up_to, self.a = arm, up_to, _slowest(arm)
        self.system = System(assemble(arm, up_to, held=False), self.a)
        self.K, self.D, self.M = self.system.with_current()
        free = self.system.K.shape[0]
        self.hub, self.gauge, self.works = (np.zeros(len(self.K)) for _ in range(3))
        self.hub[:free] = self.system.full[HUB]
        self.gauge[:free] = self.system.model.output(("gauge", arm.gauge.x), 0.0) @ self.system.full
        if free < len(self.K):
            self.works[-1] = 1.0  # the voltage's own equation
        else:
            self.works[:free] = self.system.full[HUB] * self._per_input()

    def _per_input(self):
        """Torque per unit of the input, of one that acts at once."""
        motor = self.arm.motor
        if self.arm.input == "hub_torque":
            return 1.0
        return _gain(motor) / (motor.resistance if self.arm.input == "motor_voltage" else 1.0)

    def closed(self, law):
        """K, D, M of the loop."""
        K = self.K + np.outer(self.works, law.Kp * self.hub + law.K2 * self.gauge)
        return K, self.D + law.K1 * np.outer(self.works, self.hub), self.M

    def eigenvalues(self, law):
        """The loop's eigenvalues [1/s] with |s| < up_to; by z = 1/(s - a), of which those are the large ones."""
        K, D, M = self.closed(law)
        a, n = self.a, len(K)
        upper = -np.linalg.solve(a * a * M + a * D + K, np.hstack([2 * a * M + D, M]))
        z = eigvals(np.vstack([upper, np.eye(n, 2 * n)]))
        s = a + 1 / z[abs(z) > 0.5 / (self.up_to + a)]
        return s[abs(s) < self.up_to]

    def unstable(self, law):
        """How many of these lie to the right of the axis, but for rounding of the turning rig's 0."""
        s = self.eigenvalues(law)
        return int((s.real > 1e-9 * abs(s) + 1e-7 * self.a).sum())

    def state_space(self):
        """A, B of x' = A x + B input, of one that acts at once, and rows (2, x) of a motion and its rate from its row.

        Modes of K + a^2 M and M, of which 1/(w^2 + a^2) has the digits; states sqrt(w^2 + a^2) q and q_t of each.
        """
        root = cholesky(self.K + self.a**2 * self.M)
        over = solve_triangular(root, self.M, trans=1)
        size, shapes = eigh(solve_triangular(root, over.T, trans=1))
        kept = size > LEAST * size.max()
        unit = np.sqrt(size[kept])
        shapes = solve_triangular(root, shapes[:, kept]) / unit
        n = unit.size
        A = np.zeros((2 * n, 2 * n))
        A[:n, n:] = np.diag(1 / unit)
        A[n:, :n] = np.diag(self.a**2 * unit - 1 / unit)
        A[n:, n:] = -shapes.T @ self.D @ shapes

        def rows(row):
            modal = row @ shapes
            return np.array([np.r_[modal * unit, 0 * modal], np.r_[0 * modal, modal]])

        return A, np.r_[np.zeros(n), shapes.T @ self.works], rows

    def sampled(self, law, period):
        """Eigenvalues z of the loop sampled every period [s], its input held in between, of one that acts at once."""
        A, B, rows = self.state_space()
        whole = np.block([[A, B[:, None]], [np.zeros((1, len(A) + 1))]])
        held = expm(whole * period)[:-1]
        angle, rate = rows(self.hub)
        fed_back = law.Kp * angle + law.K1 * rate + law.K2 * rows(self.gauge)[0]
        return eigvals(held[:, :-1] - np.outer(held[:, -1], fed_back))
