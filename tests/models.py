"""Another solution of the arm's equations, which shares nothing with tfarm but the equations themselves.

`Ritz`: shear strain and curvature as Legendre series, Psi and W by integration.  The strain energy is then diagonal, so
that low frequencies keep their digits at any slenderness, and natural end conditions need nothing.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh, null_space


class Ritz:
    """A Galerkin model of an arm, SI, with `terms` Legendre polynomials for each of the two strains.

    Coordinates: psi(0) and the series of curvature, in units of unit energy, then that of the shear strain.
    """

    def __init__(self, arm, terms=40):
        link, payload = arm.link, arm.payload
        self.arm, self.terms, L = arm, terms, link.length
        self._bend, self._slip = math.sqrt(L / link.EI), math.sqrt(L / link.kGA)
        self._slopes = np.zeros(2 * terms)
        if arm.hub.inertia < payload.mass * L**2 < math.inf:  # the chord's angle for psi(0): a heavy tip stays on it
            tip_w = self.motion(np.ones(1))[0][0]
            self._slopes = tip_w[1:] / tip_w[0]
        points, weight = _gauss(terms + 8)
        self.x = L * points
        self.w, self.psi = self.motion(points)
        (self.tip_w,), (self.tip_psi,) = self.motion(np.ones(1))
        self.hub_psi = self.motion(np.zeros(1))[1][0]
        self.mass = L * (link.rhoA * (self.w.T * weight) @ self.w + link.rhoI * (self.psi.T * weight) @ self.psi)
        held = []
        ends = ((arm.hub.inertia, self.hub_psi), (payload.mass, self.tip_w), (payload.inertia, self.tip_psi))
        for inertia, motion in ends:
            if math.isinf(inertia):
                held.append(motion / np.linalg.norm(motion))
            else:
                self.mass = self.mass + inertia * np.outer(motion, motion)
        self.stiffness = np.r_[0.0, np.ones(2 * terms)]  # the whole stiffness matrix, for these coordinates
        self.bending = np.r_[0.0, np.ones(terms), np.zeros(terms)]
        self.free = null_space(np.array(held)) if held else np.eye(2 * terms + 1)

    def motion(self, share):
        """w and psi of each coordinate at shares of the length: two arrays (points, coordinates)."""
        once, twice = _integrals(self.terms, tuple(share.tolist()))
        one, L = np.ones((share.size, 1)), self.arm.link.length
        w = L * np.hstack([self._bend * share[:, None], self._bend * twice, self._slip / L * once])
        psi = self._bend * np.hstack([one, once, 0 * once])
        return tuple(field - np.hstack([0 * one, field[:, :1] * self._slopes]) for field in (w, psi))

    def natural_frequencies(self, count):
        """The first frequencies [rad/s] but the rigid-body one: roots of the largest eigenvalues of K^-1 M."""
        return np.sqrt(1.0 / self.flexibilities()[0][:count])

    def flexibilities(self):
        """1/w^2 in descending order and their modes; a rigid rotation is condensed out of the mass."""
        K, M = self.free.T @ np.diag(self.stiffness) @ self.free, self.free.T @ self.mass @ self.free
        values, vectors = np.linalg.eigh(K)
        rigid, strained = vectors[:, values < 1e-9], vectors[:, values >= 1e-9] / np.sqrt(values[values >= 1e-9])
        mixed = rigid.T @ M @ strained
        carried = -np.linalg.solve(rigid.T @ M @ rigid, mixed) if rigid.size else mixed
        modes = strained + rigid @ carried
        flexibility, coordinates = eigh(strained.T @ M @ strained + mixed.T @ carried)
        return flexibility[::-1], self.free @ modes @ coordinates[:, ::-1]

    def response(self, s, load):
        """Coordinates under the generalised load (hub torque: `hub_psi`, tip force: `tip_w`) at s."""
        K = np.diag(self.stiffness + self.arm.link.damping * s * self.bending)
        A = self.free.T @ (K + s**2 * self.mass) @ self.free
        return self.free @ np.linalg.solve(A, self.free.T @ load)


def _gauss(points):
    nodes, weights = legendre.leggauss(points)
    return (nodes + 1) / 2, weights / 2


@lru_cache(maxsize=64)
def _integrals(terms, share):
    """First and second integral from 0 of the Legendre polynomials that are orthonormal on 0..1, at these points."""
    at = 2 * np.array(share) - 1
    series = [np.eye(terms)[j] * math.sqrt(2 * j + 1) for j in range(terms)]

    def integral(order):
        integrals = (legendre.legint(p, order, lbnd=-1, scl=0.5) for p in series)
        return np.stack([legendre.legval(at, p) for p in integrals], axis=-1)

    return integral(1), integral(2)
