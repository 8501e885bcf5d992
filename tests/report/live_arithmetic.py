"""The arithmetic of the live page in Python, from the numbers in the page alone: the second method of its tests."""

from __future__ import annotations

import base64
import itertools

import control
import numpy as np
from scipy.optimize import brentq

from tfarm import HubFeedback

POINTS = 24
X = np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
TO_SERIES = np.cos(np.outer(np.arange(POINTS), np.arccos(X))) * 2 / POINTS


class Page:
    """What live_loop.js does, with Chebyshev series where that has the barycentric formula."""

    def __init__(self, data):
        self.data = data
        self.low, self.high = np.array(data["low"]), np.array(data["high"])
        values = np.frombuffer(base64.b64decode(data["samples"]), "<f8").view(complex).reshape(-1, 3, POINTS)
        self.series = values @ TO_SERIES.T
        self.series[..., 0] /= 2
        self.grid = self._grid()

    def at(self, omega):
        """d, theta and m (3, n)."""
        omega = np.atleast_1d(omega)
        panel = np.minimum(np.searchsorted(self.high, omega), self.high.size - 1)
        x = (2 * omega - self.low[panel] - self.high[panel]) / (self.high[panel] - self.low[panel])
        basis = np.cos(np.outer(np.arange(POINTS), np.arccos(np.clip(x, -1, 1))))
        return np.einsum("npk,kn->pn", self.series[panel], basis)

    def parts(self, omega, law):
        """D and N, up to one positive factor for each panel."""
        (d, theta, m), s = self.at(omega), 1j * np.atleast_1d(omega)
        return s ** self.data["order"] * d, (law.Kp + law.K1 * s) * theta + law.K2 * s**2 * m

    def loop(self, omega, law):
        D, N = self.parts(omega, law)
        return N / D

    def _grid(self):
        places, band = np.array(self.data["places"]), self.data["band"]
        lowest, away = 1e-6 * min(band, places[0]), np.geomspace(1e-10, 0.06, 14)
        corners = np.r_[lowest, places[places < band], band]
        between = [np.linspace(a, b, 24, endpoint=False) for a, b in itertools.pairwise(corners)]
        close = np.outer(places, 1 + np.r_[-away, away]).ravel()
        omega = np.unique(np.concatenate([close, *between, np.geomspace(lowest, corners[1], 60), [band]]))
        return omega[(omega >= lowest) & (omega <= band)]

    def zeros(self, f, omega):
        """Where f changes its sign, and to which."""
        value = f(omega)
        omega, value = omega[value != 0], value[value != 0]
        before = np.nonzero(value[1:] * value[:-1] < 0)[0]
        places = [brentq(lambda w: float(f(w)[0]), omega[i], omega[i + 1], xtol=1e-300, rtol=1e-15) for i in before]
        return np.array(places), np.where(value[before] > 0, 2, -2)

    def count(self, law):
        """Unstable poles: those of the reference and what crosses on the way, Kp last."""
        data, start = self.data, law.having("Kp", 0.0)
        start = start.having("K1", data["reference"]["K1"]).having("K2", data["reference"]["K2"])
        corner, loss = law.having("Kp", 0.0), data["rate_loss"]
        found = data["reference_count"] + self._crossed(start, corner) + self._crossed(corner, law)
        way = corner.K1 - start.K1
        t = -(start.K1 + loss) / way if way else -1.0
        if 0 < t < 1:
            found -= int(np.sign(way * (data["inertia"] - (start.K2 + t * (law.K2 - start.K2)) * data["gauged"])))
        return found + (law.Kp * (law.K1 + loss) < 0)

    def _crossed(self, start, end):
        way = HubFeedback(**{name: end[name] - start[name] for name in start.by_name})

        def both(w):
            D, N = self.parts(w, start)
            return D + N, self.parts(w, way)[1]

        def h(w):
            A, B = both(w)
            return (A * B.conj()).imag

        if not any(way.row):
            return 0
        places, change = self.zeros(h, self.grid)
        A, B = both(places) if places.size else (np.empty(0), np.ones(0))
        t = -(A / B).real
        return int(change[(t > 0) & (t < 1)].sum())

    def verdict(self, law):
        data = self.data
        if data["kind"] == "reactive":
            low, high = (np.inf * sign if m is None else m for m, sign in zip(data["moments"], (-1, 1), strict=True))
            return "stable" if law.K1 > 0 and low < law.K2 < high and law.Kp >= 0 else "not"
        if self.count(law):
            return "unstable"
        takes = np.sign(law.K1 + data["rate_loss"]) * np.sign(1 - law.K2 / data["whole"]) if data["by_sign"] else 0
        return "unstable" if data["kind"] == "band" and takes < 0 and data["hub_alone"] else "stable"


def complex_rows(text, rows):
    """The complex numbers of packed doubles, in `rows` rows."""
    return np.frombuffer(base64.b64decode(text), "<f8").view(complex).reshape(rows, -1)


class Plant:
    """The modal plant in the page as a real state space, discretised by python-control: the page has closed forms.

    States: real and imaginary part of the amplitude of each pole above the axis, each real one, the integrals of the
    torque, and the torque before, which static parts and nothing else see.
    """

    def __init__(self, data, weight):
        """`weight`: what a pole above the axis counts in the residues of the page, whose conjugate is not there."""
        poles, rows = complex_rows(data["eigenvalues"], 1)[0], complex_rows(data["residues"], len(data["static"]))
        upper, real = poles.imag > 0, poles.imag == 0
        n = 2 * int(upper.sum()) + int(real.sum()) + 2
        A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((len(rows), n))
        for i, (p, r) in enumerate(zip(poles[upper], rows[:, upper].T * weight, strict=True)):
            pair = slice(2 * i, 2 * i + 2)
            A[pair, pair], B[2 * i, 0] = [[p.real, -p.imag], [p.imag, p.real]], 1.0
            C[:, pair] = np.c_[r.real, -r.imag]
        for i, (p, r) in enumerate(zip(poles[real], rows[:, real].T, strict=True), 2 * int(upper.sum())):
            A[i, i], B[i, 0], C[:, i] = p.real, 1.0, r.real
        A[n - 2, n - 1], B[n - 1, 0], C[:, n - 2 :] = 1.0, 1.0, data["rigid"]
        held = control.sample_system(control.StateSpace(A, B, C, 0), data["period"], "zoh")
        zero, static = np.zeros((1, n)), np.array(data["static"])[:, None]
        self.A = np.block([[held.A, np.zeros((n, 1))], [zero, np.zeros((1, 1))]])
        self.B = np.r_[held.B[:, 0], 1.0]
        self.C = np.c_[held.C, static]

    def poles(self, law):
        """Closed-loop poles."""
        return np.linalg.eigvals(self.A - np.outer(self.B, np.array(law.row) @ self.C[:3]))

    def slew(self, data, law):
        """Torque, and every output at the samples (outputs, n)."""
        ideal = np.frombuffer(base64.b64decode(data["ideal"]), "<f8").reshape(-1, 5)
        x, torque, outputs = np.zeros(len(self.A)), [], []
        for r, theta, rate, moment, _ in ideal:
            y = self.C @ x
            torque.append(r + law.Kp * (theta - y[0]) + law.K1 * (rate - y[1]) - law.K2 * (y[2] - moment))
            outputs.append(y)
            x = self.A @ x + self.B * torque[-1]
        return np.array(torque), np.array(outputs).T
