"""A sampled loop that shares no code with tfarm: the Ritz model of `tests.models`, matrix exponential, eigenvalues."""

import numpy as np
from scipy.linalg import block_diag, expm

from tests.models import Ritz


class HoldModel:
    """A damped arm with the lowest quarter of the modes that `terms` polynomials for each strain give.

    `terms`/2 modes, that is: those are right to 1e-13, the last of them to 1e-9; higher ones are the polynomials' own.

    States: w q and q_t of each mode, the angle and rate of the rigid arm, and the gauge's moment g, from the hub's
    balance  g + C g_t = I_h theta_tt - u,  which also has what the modes left out would bear at once.
    """

    def __init__(self, arm, terms=80):
        ritz, C = Ritz(arm, terms), arm.link.damping
        flexibility, shapes = (part[..., : terms // 2] for part in ritz.flexibilities())
        shapes = shapes / np.sqrt(flexibility)
        w, b = 1 / np.sqrt(flexibility), ritz.hub_psi @ shapes
        damping = C * (shapes.T * ritz.bending) @ shapes
        rigid = 1 / np.sqrt(arm.total_inertia)
        n, inertia, W = w.size, arm.hub.inertia, np.diag(w)
        A = block_diag(np.block([[np.zeros((n, n)), W], [-W, -damping]]), [[0.0, 1.0], [0.0, 0.0]], [[-1 / C]])
        B = np.r_[np.zeros(n), b, 0.0, rigid, 0.0]
        self.angle, self.rate = np.r_[b / w, np.zeros(n), rigid, 0.0, 0.0], np.r_[np.zeros(n), b, 0.0, rigid, 0.0]
        A[-1] += inertia / C * (self.rate @ A)
        B[-1] = (inertia * (b @ b + rigid**2) - 1) / C
        self.A, self.B = A, B

    def log_radius(self, gains, chain):
        """The largest ln|z|, the hub angle's own pole at z = 1 apart (Kp = 0)."""
        T, delay = chain.sampling.period, chain.sampling.delay_samples
        d, n = int(np.floor(delay)), self.B.size
        (before, late), (after, early) = self._held((delay - d) * T), self._held((1 - delay + d) * T)
        step, newest = np.zeros((n + d + 1, n + d + 1)), np.zeros(n + d + 1)  # then u_{k-1} ... u_{k-d-1}
        step[:n, :n], step[:n, -1] = after @ before, after @ late
        if d:
            step[:n, -2], newest[n] = early, 1.0
            step[np.arange(n + 1, n + d + 1), np.arange(n, n + d)] = 1.0
        else:
            newest[:n], newest[n] = early, 1.0
        step[:, :n] -= np.outer(newest, gains.K1 * self.rate + gains.K2 * np.eye(n)[-1])
        z = np.linalg.eigvals(step)
        return float(np.log(abs(np.delete(z, abs(z - 1).argmin())).max()))

    def _held(self, time):
        """What a time [s] makes of the states, and what a unit torque held so long adds."""
        n = self.B.size
        whole = expm(np.block([[self.A, self.B[:, None]], [np.zeros((1, n + 1))]]) * time)
        return whole[:n, :n], whole[:n, n]
