"""The residual of a slew in a sampled loop whose numbers are intervals: a bound on every response at every sample.

    x_{k+1} = P x_k + b u_k - read ref_k,   u_k = s_k + through ref_k - k x_k,   M_k = m x_k

The states are the amplitudes of every pole of a band (`spectrum.enclosed`), integrals and late values of the torque,
and the states of the law.  x^c is the response with the middles of all numbers, V has the eigenvectors of its matrix
A = P - b k, and d_k the largest sizes of V^-1 (x_k - x^c_k).  With E the radii of A, entry by entry,

    d_{k+1} <= Q d_k + |V^-1| (what the radii and the poles left out add at x^c_k),   Q = |V^-1 A V| + |V^-1| E |V|

The poles left out add to each signal at most their summed response times the largest |u|.  So |M_k| is at most
|m x^c_k| + |m V| d_k + ... at each sample, and a vector h > 0 with Q h <= h - 1/2 bounds all samples after the last.
Radii cover the rounding of products.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np

from tfarm.arm.chain import Sampling
from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.dsp.discretise import LawInZ
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.shaping import MOMENT
from tfarm.errors import CertificationError
from tfarm.records import frozen
from tfarm.spectrum.enclosed import EnclosedPlant

# of a product of numbers, with room for complex ones
ROUNDING = 8 * MACHINE_EPS


class Majorant(NamedTuple):
    """V, a matrix above |V^-1|, Q, and h of a loop."""

    V: Complex
    inverse: Real
    Q: Real
    h: Real


@frozen
class UncertainLoop:
    """Middles P, b, k, m of a loop, and the radii dP, db, dk, dm around them."""

    P: Complex
    b: Complex
    k: Complex
    m: Complex
    dP: Real
    db: Real
    dk: Real
    dm: Real
    read: Real
    through: Real

    @property
    def rounding(self) -> float:
        """Largest relative error of a product of vectors."""
        return ROUNDING * (self.b.size + 8)

    def rounded(self) -> Self:
        """Return the loop with radii that cover the rounding of products with its numbers too."""
        own: Any = {
            f"d{name}": getattr(self, f"d{name}") + self.rounding * abs(getattr(self, name))
            for name in "Pbkm"
        }
        return replace(self, **own)

    def without(self, at: int) -> Self:
        """Return the loop without a state."""
        own: Any = {name: np.delete(getattr(self, name), at, axis=0) for name in ("P", "dP", "read")}
        own |= {name: np.delete(own[name], at, axis=1) for name in ("P", "dP")}
        vectors = ("b", "k", "m", "db", "dk", "dm")
        return replace(self, **own, **{name: np.delete(getattr(self, name), at) for name in vectors})

    def majorant(self) -> Majorant:
        """Return the bounds in the eigenvectors.  Raises CertificationError where none holds for all later samples."""
        A = self.P - np.outer(self.b, self.k)
        n = len(A)
        _, V = np.linalg.eig(A)
        W = np.linalg.inv(V)
        size = abs(V)
        off = abs(np.eye(n) - W @ V) + self.rounding * (abs(W) @ size)
        error = float(off.sum(axis=1).max())
        if not error < 0.5:
            raise CertificationError("eigenvectors of the loop are nearly parallel")
        # V^-1 = (1 + a matrix of rows up to this) W
        more = error / (1 - error)
        inverse = abs(W) + more * abs(W).max(axis=0)
        own = abs(W @ A @ V) + self.rounding * (abs(W) @ abs(A) @ size)
        E = self.dP + np.outer(abs(self.b), self.dk) + np.outer(self.db, abs(self.k) + self.dk)
        Q = own + more * own.max(axis=0) + inverse @ E @ size
        h = np.linalg.solve(np.eye(n) - Q, np.ones(n))
        if not ((h > 0).all() and (Q @ h <= h - 0.5).all()):
            raise CertificationError("the loop is not certified stable")
        return Majorant(V, inverse, Q, h)

    def added(self, x: Complex, u: Complex, s: Complex) -> Real:
        """Return the sizes (samples, n) of what the radii add to the next states at states x (samples, n)."""
        of_u = abs(x) @ self.dk + self.rounding * (abs(s) + abs(u))
        by_u = abs(self.b) + self.db
        return np.asarray(abs(x) @ self.dP.T + np.outer(abs(u), self.db) + np.outer(of_u, by_u))


def turning_unit(middle: Real, radius: Real) -> tuple[tuple[float, float], tuple[Real, Real]]:
    """Return the first part other than 0 of signals (signals, 2) that turn with the arm, and all parts over it.

    Each is a middle and a radius; without such a signal the unit is 1.
    """
    turning = np.argwhere(middle.T)
    if not turning.size:
        return (1.0, 0.0), (0 * middle, 0 * radius)
    order, signal = turning[0]
    unit = middle[signal, order]
    unit_radius = radius[signal, order]
    ratio = middle / unit
    ratio_radius = (radius + abs(ratio) * unit_radius) / (abs(unit) - unit_radius)
    ratio_radius[signal, order] = 0.0
    return (unit, unit_radius), (ratio, ratio_radius)


def uncertain_loop(plant: EnclosedPlant, sampling: Sampling, in_z: LawInZ) -> UncertainLoop:
    """Return the loop of a plant and a law; outputs are the signals of the law, and the root moment.

    The states are those of `PulseTransfer.matrices`, of all poles complex.  The integrals are in units of a signal that
    turns with the arm: at rest they are the same for every arm.
    """
    T = sampling.period
    late = sampling.late
    n = plant.multipliers.middle.size
    newest = n + 2
    oldest = newest + sampling.whole_delay
    own, read, row, through = in_z.matrices
    law = slice(oldest + 1, oldest + 1 + len(own))
    middle, radius = plant.at_rest
    (unit, unit_radius), (ratio, ratio_radius) = turning_unit(middle[:, :2], radius[:, :2])
    ramps = np.array([(T - late) ** 2 / 2, T - late])
    before = np.array([late * (T - late / 2), late])

    P = np.zeros((law.stop, law.stop), complex)
    dP = np.zeros(P.shape)
    np.fill_diagonal(P[:newest, :newest], [*plant.multipliers.middle, 1.0, 1.0])
    np.fill_diagonal(dP[:n, :n], plant.multipliers.radius)
    P[n, n + 1] = T
    P[newest + 1 : oldest + 1, newest:oldest] = np.eye(sampling.whole_delay)
    b = np.eye(law.stop, dtype=complex)[newest]
    db = np.zeros(law.stop)
    P[:newest, oldest] = np.r_[plant.late.middle, unit * before]
    dP[:newest, oldest] = np.r_[plant.late.radius, unit_radius * before]
    # of u_{k-d}: the input itself without a delay
    pushed, radii = (P[:, oldest - 1], dP[:, oldest - 1]) if sampling.whole_delay else (b, db)
    pushed[:newest] = np.r_[plant.early.middle, unit * ramps]
    radii[:newest] = np.r_[plant.early.radius, unit_radius * ramps]

    C = np.zeros((len(middle), law.stop), complex)
    dC = np.zeros(C.shape)
    C[:, :newest] = np.c_[plant.residues.middle, ratio]
    dC[:, :newest] = np.c_[plant.residues.radius, ratio_radius]
    C[:, oldest] = middle[:, 2] + plant.shares.middle.sum(axis=1)
    dC[:, oldest] = radius[:, 2] + plant.shares.radius.sum(axis=1)
    signals = len(in_z.signals)
    P[law] += read @ C[:signals]
    dP[law] += abs(read) @ dC[:signals]
    P[law, law] += own
    D = through.sum(axis=0)
    k = D @ C[:signals]
    k[law] += row.sum(axis=0)
    of_moment = in_z.signals.index(MOMENT) if MOMENT in in_z.signals else signals
    loop = UncertainLoop(
        P=P,
        b=b,
        k=k,
        m=C[of_moment],
        dP=dP,
        db=db,
        dk=abs(D) @ dC[:signals],
        dm=dC[of_moment],
        read=np.r_[np.zeros((law.start, signals)), read],
        through=D,
    )
    for at in (n, n):
        # an integral that nothing depends on, first the double one
        if not (np.delete(loop.P[:, at], at).any() or loop.k[at] or loop.m[at]):
            loop = loop.without(at)
    return loop.rounded()


def most_residual(
    loop: UncertainLoop, majorant: Majorant, task: Scenario, signals: Sequence[str], tails: tuple[Real, float]
) -> tuple[float, float]:
    """Return the bound on the residual root moment after a task, and its largest middle value.

    `tails` are those of the signals and of the moment.  Raises CertificationError.
    """
    V, inverse, Q, h = majorant
    references = np.array(
        [task.references[name] if name in task.references else 0 * task.t for name in signals]
    )
    direct = task.feedforward + loop.through @ references
    forcing = -references.T @ loop.read.T
    end = int(task.is_after.argmax())
    of_u = abs(loop.k @ V) + loop.dk @ abs(V)
    of_moment = abs(loop.m @ V) + loop.dm @ abs(V)
    by_tail = (abs(loop.b) + loop.db) * (abs(loop.through) @ tails[0]) + abs(loop.read) @ tails[0]
    A = loop.P - np.outer(loop.b, loop.k)
    rest = np.linalg.lstsq(np.eye(len(A)) - A, forcing[-1] + loop.b * direct[-1], rcond=None)[0]
    u_rest = direct[-1] - loop.k @ rest
    off_rest = loop.P @ rest + loop.b * u_rest + forcing[-1] - rest
    x = 0 * rest
    states: list[Complex] = []
    inputs: list[complex] = []
    # samples after the end, twice as many each time
    for count in end + 256 * 2 ** np.arange(7):
        for k in range(len(states), count):
            at = min(k, task.t.size - 1)
            u = direct[at] - loop.k @ x
            states.append(x)
            inputs.append(u)
            x = loop.P @ x + loop.b * u + forcing[at]
        X = np.array(states)
        U = np.array(inputs)
        direct_at = direct[np.minimum(np.arange(count), task.t.size - 1)]
        rigid = task.rigid_moment[np.minimum(np.arange(count), task.t.size - 1)]
        added = loop.added(X, U, direct_at)
        at_rest = abs(off_rest) + loop.added(rest[None], u_rest[None], direct[-1:])[0]
        # largest |u| of any arm: twice that of the middle one, to begin with
        most_u = 2 * float(abs(U).max())
        for _ in range(4):
            steps = (added + most_u * by_tail) @ inverse.T
            d = np.zeros((count + 1, len(h)))
            for k in range(count):
                d[k + 1] = Q @ d[k] + steps[k]
            # of the last sample from the state of rest, and of what comes later
            away = inverse @ abs(x - rest) + d[-1]
            later = max(float((away / h).max()), 2 * float((inverse @ (at_rest + most_u * by_tail)).max()))
            sizes = abs(U) + abs(X) @ loop.dk + d[:-1] @ of_u
            late_u = abs(u_rest) + abs(rest) @ loop.dk + later * (of_u @ h)
            by_poles = float(abs(loop.through) @ tails[0]) * most_u
            found = max(float(sizes.max()), float(late_u)) + by_poles
            if found <= most_u:
                break
            most_u = 2 * found
        else:
            raise CertificationError("the poles left out are not small")
        middle = abs(X @ loop.m - rigid)
        tail = tails[1] * most_u
        bounds = middle + abs(X) @ loop.dm + d[:-1] @ of_moment + tail
        late = float(abs(rest @ loop.m - rigid[-1]) + abs(rest) @ loop.dm + later * (of_moment @ h) + tail)
        most = float(bounds[end:].max())
        if late <= most:
            return most, float(middle[end:].max())
    return late, float(middle[end:].max())
