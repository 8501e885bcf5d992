"""A Galerkin model of an arm under a torque that is held from sample to sample: no modes, no residues, one expm."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm
from scipy.signal import cont2discrete

from tests.loop.ritz_loop import RitzLoop
from tfarm import Arm, HubFeedback
from tfarm.case import Case

ROWS = ("hub_angle", "hub_rate", "root_moment")


def blocks(law, T):
    """(row, numerator, denominator in z) of each signal of a law, by SciPy's bilinear rule, with time in periods."""
    for part in law.parts:
        system = [
            np.array(each) * T ** -np.arange(len(each) - 1.0, -1.0, -1.0) for each in (part.block.num, part.block.den)
        ]
        num, den, _ = cont2discrete(system, 1.0, "bilinear") if part.block.order else (*system, T)
        yield ROWS.index(part.signals[0]), np.atleast_1d(np.squeeze(num)), np.atleast_1d(den)


@dataclass(frozen=True)
class HeldLoop:
    """x' = A x + B u over a sample of length `period` [s], of a Ritz model with `terms`."""

    arm: Arm
    period: float
    terms: int = 12

    @cached_property
    def parts(self):
        """A (n, n) and B (n,) of one sample, and the rows (3, n) of hub angle, hub rate and root moment."""
        model = RitzLoop(self.arm, self.terms)
        continuous, n = model.state_matrix(HubFeedback()), model.n
        torque, sense = np.zeros(2 * n + 1), np.zeros((3, 2 * n + 1))
        torque[n : 2 * n] = np.linalg.solve(model.M, model.b)
        torque[-1] = (model.inertia * model.b @ torque[n : 2 * n] - 1) / model.damping
        sense[0, :n] = sense[1, n : 2 * n] = model.b
        sense[2, -1] = 1.0
        whole = np.pad(np.c_[continuous, torque], ((0, 1), (0, 0)))
        step = expm(whole * self.period)
        return step[:-1, :-1], step[:-1, -1], sense

    def poles(self, law):
        """Closed-loop poles under any law: eigenvalues of the loop's whole state matrix, block after block."""
        A, B, sense = self.parts
        for row, num, den in blocks(Case(self.arm, law).law, self.period):
            order, num = len(den) - 1, np.r_[np.zeros(len(den) - len(num)), num] / den[0]
            den = den / den[0]
            through, rest = num[0], num[1:] - num[0] * den[1:]
            own = np.vstack([-den[1:], np.eye(order)[:-1]]) if order else np.zeros((0, 0))
            enter = np.eye(order)[:, :1] if order else np.zeros((0, 1))
            seen = np.r_[sense[row], np.zeros(len(A) - len(sense[row]))][None]
            A = np.block([[A - np.outer(B, through * seen), -np.outer(B, rest)], [enter @ seen, own]])
            B = np.r_[B, np.zeros(order)]
        return np.linalg.eigvals(A)

    def radius(self, law):
        """The spectral radius, z = 1 of a free hub angle that the law does not read left out."""
        z = self.poles(law)
        return float(abs(z if "hub_angle" in Case(self.arm, law).law.signals else z[abs(z - 1) > 1e-7]).max())

    def loop(self, law, q):
        """L at e^{iq}."""
        A, B, sense = self.parts
        z, eye = np.exp(1j * q), np.eye(len(A))
        H = np.array([sense @ np.linalg.solve(each * eye - A, B) for each in z]).T
        found = blocks(Case(self.arm, law).law, self.period)
        return sum(np.polyval(num, z) / np.polyval(den, z) * H[row] for row, num, den in found)

    def damping(self, law, modes, steps=300):
        """Least damping ratio of the first modes' poles and the hub's, followed from the open loop as the law grows."""
        own = RitzLoop(self.arm, self.terms).eigenvalues(HubFeedback())
        own = own[own.imag > 0]
        own = own[np.argsort(own.imag)][:modes]
        z = np.r_[np.exp(own * self.period), 1.0, 1.0]
        for share in np.linspace(0, 1, steps + 1)[1:]:
            now = self.poles(HubFeedback(K1=share * law.K1, K2=share * law.K2, Kp=share * law.Kp))
            gap = abs(z[:, None] - now)
            for _ in z:  # the closest pair first
                i, j = np.unravel_index(gap.argmin(), gap.shape)
                z[i], gap[i], gap[:, j] = now[j], np.inf, np.inf
        s = np.log(z[(abs(z) > 1e-12) & (abs(np.angle(z)) > 1e-9)])
        return float((-s.real / abs(s)).min(initial=1.0))
