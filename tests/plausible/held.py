"""The model of the sampled loop: modes of the Galerkin model under a zero-order hold, exact for any delay.

The undamped modes of the model, coupled by its damping matrix, have the eigenvalues p and, in theta per torque, the
residues r.  The gauge follows from the hub's equation, m = (I_h s^2 theta - u)/(1 + C s), with residues
I_h p^2 r/(1 + C p); what these leave of its static value -(J - I_h)/J answers as 1/(1 + C s).  At C = 0 the first n
modes are taken, as many as an answer says that it holds for, and the rest is static.  A pole with a' = p a + u steps
exactly under a torque that switches once between two samples.  Nothing of u_k is seen at t_k.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eig

EPS, ROUNDING = np.finfo(float).eps, 16  # of the eigenvalues of a matrix, times its norm and their condition
FADED = 40.0  # e^-40: what loses this much between two samples is gone
ALIKE = 1e-4  # of a real pole


@dataclass(frozen=True)
class Held:
    """The open loop sampled: multipliers z (m,), early and late steps (m,), rows (outputs, m) of angle, rate, moment.

    The last two amplitudes are the integral of the torque and its double integral, which is stepped by a ramp; `static`
    is what the torque of the preceding interval adds.
    """

    poles: np.ndarray
    rows: np.ndarray
    static: np.ndarray
    inertia: float
    period: float
    delay: float
    tip: np.ndarray  # residues of the tip's displacement

    @cached_property
    def matrices(self):
        """A, B, C of x' = A x + B u, y = C x: amplitudes, integral and double integral of torque, then past torques."""
        T, d = self.period, int(self.delay)
        f, p, m = self.delay - d, self.poles, self.poles.size
        n = m + 2 + d + 1
        A, B, C = np.zeros((n, n), complex), np.zeros(n, complex), np.zeros((3, n), complex)
        A[range(m), range(m)] = np.exp(p * T)
        A[m, m] = A[m + 1, m + 1] = 1.0
        A[m + 1, m] = T
        early = np.r_[phi(p, (1 - f) * T), (1 - f) * T, ((1 - f) * T) ** 2 / 2]
        late = np.r_[np.exp(p * (1 - f) * T) * phi(p, f * T), f * T, f * T * T * (1 - f / 2)]
        A[: m + 2, n - 1] += late
        if d:
            A[: m + 2, n - 2] += early
            A[range(m + 3, n), range(m + 2, n - 1)] = 1.0
        else:
            B[: m + 2] = early
        B[m + 2] = 1.0
        C[:, :m] = self.rows
        C[0, m + 1] = C[1, m] = 1 / self.inertia
        C[:, n - 1] = self.static
        return A, B, C

    def closed(self, law):
        """The closed-loop matrix."""
        A, B, C = self.matrices
        return A - np.outer(B, law.Kp * C[0] + law.K1 * C[1] + law.K2 * C[2])

    def log_radius(self, law):
        """The largest ln|z|, the z = 1 of a hub angle that nothing regulates apart, and what rounding makes of it."""
        A = self.moving(law)
        z, left, right = eig(A, left=True)
        i = int(np.argmax(abs(z)))
        condition = 1 / max(abs(left[:, i].conj() @ right[:, i]), 1e-300)
        rounding = ROUNDING * EPS * condition * np.linalg.norm(A, 2)
        return float(np.log(abs(z[i]))), float(rounding / abs(z[i]))

    def moving(self, law):
        """The closed-loop matrix without the free angle's z = 1."""
        A = self.closed(law)
        if law.Kp == 0:  # nothing feeds on the double integral: its row and column hold the z = 1
            keep = np.arange(len(A)) != self.poles.size + 1
            A = A[np.ix_(keep, keep)]
        return A


def phi(p, t):
    """(e^{p t} - 1)/p, by a series where p t is small."""
    x = p * t
    with np.errstate(all="ignore"):
        return np.where(abs(x) < 1e-5, t * (1 + x / 2 + x * x / 6), (np.exp(x) - 1) / p)


def held(model, count, period, delay, C=None, top=np.inf):
    """The sampled model of an arm, of its own damping or another: at C = 0 of its first `count` modes, else of all, or
    of those below `top` [rad/s].
    """
    C = model.C if C is None else C
    J, static = model.beam.total_inertia, np.zeros(3)
    poles, rows = spectrum(model, count, C)
    static[2] = -(J - model.hub) / J + (rows[2] / poles).sum().real
    if C == 0:  # the angle of the modes left out
        omega, shapes = model.modes
        static[0] = (((model.b @ shapes) / omega)[count:] ** 2).sum()
    if C:
        poles, rows = np.r_[poles, -1 / C], np.column_stack([rows, [0, 0, static[2] / C, 0]])
        poles, rows, gone = lumped(poles, rows, period * (1 - delay % 1), top)
        static = gone[:3]
    return Held(poles, rows[:3], static, J, period, delay, rows[3])


def spectrum(model, count, C):
    """p, and the residues of angle, rate, gauge and tip, of modes coupled by their damping."""
    omega, shapes = (part[..., : count if C == 0 else None] for part in model.modes)
    b, w = model.b @ shapes, model.ritz.tip_w @ shapes
    if C == 0:
        poles = np.r_[1j * omega, -1j * omega]
        angle, tip = (np.r_[b * v, -b * v] / (2j * np.r_[omega, omega]) for v in (b, w))
    else:
        D, scaled = C * (shapes.T * model.B) @ shapes, np.diag(omega)
        A = np.block([[np.zeros_like(D), scaled], [-scaled, -D]])  # of (w q, q'): nearly skew
        poles, right = np.linalg.eig(A)
        left = np.linalg.solve(right, np.r_[0 * b, b].astype(complex))
        angle, tip = ((np.r_[v / omega, 0 * v] @ right) * left for v in (b, w))
        poles = np.array([sharper(model, p, C) if abs(p) < omega[count] else p for p in poles])
    moment = model.hub * poles**2 * angle / (1 + C * poles)
    return poles, np.vstack([angle, poles * angle, moment, tip])


def sharper(model, p, C):
    """A pole polished on the model's own matrix, if it is of this damping and rings."""
    if C != model.C or p.imag == 0:
        return p
    s = model.polished(complex(p.real, abs(p.imag)))[0]
    return complex(s.real, np.copysign(s.imag, p.imag)) if abs(s - p.real - 1j * abs(p.imag)) < 1e-3 * abs(p) else p


def lumped(poles, rows, hold, top):
    """Fewer poles: those that a sample leaves nothing of, or above `top`, are static, the third that is returned; slow
    real ones near -1/C that are within ALIKE of each other are one.
    """
    gone = (poles.real * hold < -FADED) | (abs(poles.imag) > top)
    static = -(rows[:, gone] / poles[gone]).real.sum(axis=1)
    poles, rows = poles[~gone], rows[:, ~gone]
    real = poles.imag == 0
    groups = np.round(np.log(abs(poles[real].real)) / ALIKE)
    kept, columns = [*poles[~real]], [*rows[:, ~real].T]
    for group in np.unique(groups):
        own = np.nonzero(real)[0][groups == group]
        first = poles[own[np.argmax(abs(rows[2, own]))]]
        kept.append(first)
        columns.append(first * (rows[:, own] / poles[own]).sum(axis=1))
    return np.array(kept), np.array(columns).T, static


def simulated(sampled, model_rows, law, references, n, start, struck):
    """Records (n, outputs) of the loop at the samples, and its torques (n,).

    `references` are feedforward, angle, rate and rigid moment; `model_rows` (outputs, states) are read beside; `start`
    is the state at t = 0, `struck` what an impulse just after that sample adds to it.
    """
    A, B, C = sampled.matrices
    x, records, torques = start.astype(complex), [], np.zeros(n)
    for k in range(n):
        angle, rate, moment = (C @ x).real
        forward, angle_wanted, rate_wanted, rigid = (r[k] for r in references)
        torques[k] = (
            forward + law.Kp * (angle_wanted - angle) + law.K1 * (rate_wanted - rate) - law.K2 * (moment - rigid)
        )
        records.append((model_rows @ x).real)
        x = A @ (x + struck if k == 0 else x) + B * torques[k]
    return np.array(records), torques
