"""A reduced model as partial fractions: poles, residues, rigid body, static remainder; its values and its worst error.

The error is the largest |dG| / (|G| + |w G'|) over a frequency range.  The norm is finite at zeros and poles of G.  The
error varies on the scale of the exact poles, of the zeros of G and G', and of the poles of the model.  The samples are
dense there, and each high local maximum is refined.  The printed error has a margin of 2 %, tuned on random arms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices
from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.errors import require
from tfarm.exact.outputs import Output
from tfarm.records import frozen
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.spectrum import modes, modes_below

if TYPE_CHECKING:
    import control


@frozen(kw_only=True)
class PartialFractions:
    """G_o(s) ~ rigid[o,0]/s^2 + rigid[o,1]/s + static[o] + sum of residues[o,k,i]/(s - eigenvalues[k,i]).

    `eigenvalues` (n, 2) [1/s] are conjugate pairs (Im > 0 first), or two reals of an overdamped mode; `residues`
    (outputs, n, 2) belong to them.  `index` (n,) numbers the arm's own flexible modes from 1, and is 0 for a pole in
    place of omitted modes; `natural_frequency` (n,) is undamped [rad/s].  `rigid` (outputs, 2) and `static` (outputs,)
    make the model exact at s -> 0.  `participation` (n,) is that of the input in each pair: |b| at C = 0, for a locked
    hub the root moment of the mode.  `single` (m,) [1/s] are real poles that belong to no flexible mode, with
    `single_residues` (outputs, m): about -b/J of a hub with friction (then rigid[:,0] is 0), -R/L_a of a motor's
    circuit, and last, where the model `relaxes`, -1/C in place of the omitted bending modes (see `relaxed_model`).
    """

    arm: Arm
    rows: tuple[Output, ...]
    x: float | None = None
    index: NDArray[np.int64]
    natural_frequency: Real
    eigenvalues: Complex
    residues: Complex
    rigid: Real
    static: Real
    participation: Real
    single: Real
    single_residues: Real
    relaxes: bool = False

    @property
    def outputs(self) -> tuple[str, ...]:
        """The name of each output."""
        return tuple(wanted.name for wanted in self.rows)

    @property
    def rigid_states(self) -> int:
        """The number of states of the rigid body: angle and rate where an output has it, with friction one of them."""
        if not self.rigid.any():
            return 0
        return 1 if self.arm.rate_loss else 2

    @property
    def order(self) -> int:
        """The number of states: two a mode, those of the rigid body, and one a single pole."""
        return 2 * self.index.size + self.rigid_states + self.single.size

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, in the order of `matrices`."""
        names = ["rigid_angle", "rigid_rate"][2 - self.rigid_states :]
        tails = np.cumsum(self.index == 0)
        for k, n in zip(self.index, tails, strict=True):
            pair = f"mode{k}" if k else f"tail{n}"
            names += [f"{pair}_position", f"{pair}_rate"]
        alone = self.single.size - self.relaxes
        names += [f"single{i + 1}" for i in range(alone)]
        if self.relaxes:
            names.append("relaxation")
        return tuple(names)

    @property
    def input(self) -> str:
        """The input of the arm, "hub_angle" [rad] where the hub is locked."""
        if self.arm.is_locked:
            return "hub_angle"
        return self.arm.input

    @property
    def numerators(self) -> tuple[Real, Real]:
        """n1, n0 (outputs, n) of each mode's share (n1 s + n0)/((s - p1)(s - p2))."""
        r1 = self.residues[..., 0]
        r2 = self.residues[..., 1]
        p1, p2 = self.eigenvalues.T
        return (r1 + r2).real, -(r1 * p2 + r2 * p1).real

    def __call__(self, s: ArrayLike) -> Complex:
        """Return values (outputs, *s.shape) at complex s [1/s].  Raises ParameterError at a pole of the model."""
        points = np.asarray(s, dtype=complex)
        # 2^18 entries of (poles, s) in memory at once
        parts = np.array_split(points.ravel(), 1 + (points.size * self.index.size >> 18))
        values = np.concatenate([self._sum(part, np.asarray) for part in parts], axis=1)
        return values.reshape(len(self.outputs), *points.shape)

    def magnitude(self, s: Complex) -> Real:
        """Return the sum of the magnitudes of all terms (outputs, s) at s (1-D), the scale of rounding."""
        return self._sum(s, abs)

    def _sum(self, s: Complex, part: Callable[[Any], Any]) -> Any:
        """Return the sum of all terms (outputs, s) at s (1-D), or with `part` abs that of their magnitudes."""
        p1, p2 = self.eigenvalues.T[:, :, None]
        product = (s - p1) * (s - p2)
        is_pole = (product == 0).any(axis=0) | ((self.rigid_states > 0) & (s == 0))
        for pole in s[is_pole][:1].tolist():
            require(False, "s", pole, "a pole of the reduced model; move s")
        (n1, n0) = map(part, self.numerators)
        share = part(1 / product)
        total = part(s) * (n1 @ share) + n0 @ share + part(self.static)[:, None]
        if self.rigid_states:
            total = total + part(self.rigid[:, :1] / (s * s)) + part(self.rigid[:, 1:] / s)
        return total + part(self.single_residues) @ part(1 / (s - self.single[:, None]))

    def matrices(self) -> Matrices:
        """Return A, B, C, D of x' = A x + B u, y = C x + D u: arrays (n, n), (n, 1), (outputs, n), (outputs, 1).

        Rigid body: angle and rate of an inertia J.  Each mode: (w q, q') with q'' + a q' + w^2 q = b u, that is the
        block [[0, w], [-w, -a]]; at C = 0 half the sum of their squares is the mode's energy [J].
        """
        first = self.rigid_states
        w = np.sqrt(self.eigenvalues.prod(axis=1).real)
        b = np.where(self.participation > 0, self.participation, 1.0)
        n1, n0 = self.numerators
        pairs = np.array([[0 * w, w], [-w, self.eigenvalues.sum(axis=1).real]]).transpose(2, 0, 1)
        alone = np.ones(self.single.size)
        if self.relaxes:
            alone[-1] = -self.single[-1]
        J = self.arm.total_inertia
        A = block_diag(np.eye(first, k=1), *pairs, np.diag(self.single))
        torque = np.array([0.0, 1 / J])[2 - first :]
        B = np.r_[torque, np.c_[0 * b, b].ravel(), alone]
        of_pairs = np.stack([n0 / (w * b), n1 / b], axis=-1).reshape(len(n0), -1)
        C = np.hstack([self.rigid[:, 2 - first :] * J, of_pairs, self.single_residues / alone])
        return A, B[:, None], C, self.static[:, None].copy()

    def first(self, count: int) -> PartialFractions:
        """Return the model with the first `count` of the arm's modes, the static gains of the others in `static`."""
        beyond = self.index > count
        first_omitted = self.natural_frequency[beyond].min(initial=np.inf)
        beyond |= (self.index == 0) & (self.natural_frequency > first_omitted)
        kept = ~beyond
        return replace(
            self,
            index=self.index[kept],
            natural_frequency=self.natural_frequency[kept],
            eigenvalues=self.eigenvalues[kept],
            residues=self.residues[:, kept],
            static=self.static - sum_at_rest(self.residues[:, beyond], self.eigenvalues[beyond]),
            participation=self.participation[kept],
        )

    def with_pairs(
        self, p: Real | Complex, residues: Real | Complex, static: Real, share: Real
    ) -> PartialFractions:
        """Return the model with more pairs of poles (n, 2), the tails, and their share of the input (n,)."""
        return replace(
            self,
            index=np.r_[self.index, np.zeros(len(p), np.int64)],
            natural_frequency=np.r_[self.natural_frequency, np.sqrt(abs(p.prod(axis=1)))],
            eigenvalues=np.r_[self.eigenvalues, p],
            residues=np.concatenate([self.residues, residues], axis=1),
            static=static,
            participation=np.r_[self.participation, share],
        )

    def closed(self, gains: ArrayLike) -> Matrices:
        """Return A, B, C, D under the law  u = r - gains . y, r the new input; gains are (outputs,)."""
        A, B, C, D = self.matrices()
        row = np.atleast_2d(np.asarray(gains, dtype=float))
        share = 1 / (1 + row @ D)
        fed = share * row @ C
        return A - B @ fed, B * share, C - D @ fed, D * share

    def state_space(self, name: str | None = None) -> control.StateSpace:
        """Return the model as a `control.StateSpace` with named inputs, outputs and states."""
        import control

        return control.StateSpace(
            *self.matrices(),
            inputs=[self.input],
            outputs=list(self.outputs),
            states=list(self.states),
            name=name or f"{self.arm.name}, order {self.order}",
        )


# error of the exact values in the same norm
EXACT_ROUNDING = 1e-14


def sum_at_rest(residues: Complex, p: Complex) -> Real:
    """Return the sums of residues/p (outputs,) of pairs of poles p (n, 2), those at s = 0 with the other sign."""
    return np.asarray((residues / p).real.sum(axis=(1, 2)))


class Ruler:
    """The exact outputs over a frequency range [rad/s], sampled once, and the errors of models."""

    def __init__(self, arm: Arm, outputs: Wanted, band: tuple[float, float], x: float | None = None) -> None:
        self.G = transfer(arm, transfer(arm, outputs, x=x).rows, x=x)
        self.band = band
        self._poles = frequencies_around(arm, band[1])
        w = _samples(*band, self._poles)
        w = w[is_clear_of(w, self._poles)]
        for _ in range(2):
            w = np.union1d(w, self._dips(w))
            w = w[is_clear_of(w, self._poles)]
        self.w = w
        self._exact = values_and_norm(self.G, w)

    def rough(self, model: PartialFractions) -> float:
        """Return the largest error at the samples, a little below the worst one."""
        return float(_errors(model, self.w, *self._exact).max())

    def measure(self, model: PartialFractions) -> tuple[Real, Real]:
        """Return the largest error of each output, with a margin, and its frequency [rad/s]; high peaks are refined."""
        # of a peak of the error: a refinement is to an eighth of its width
        refined_points = 17
        # times the largest error found: tuned on random arms
        margin = 1.02
        errors = _errors(model, self.w, *self._exact)
        worst = errors.max(axis=1)
        at = self.w[errors.argmax(axis=1)]
        for row, error in enumerate(errors):
            low, high = self._brackets(error)
            for _ in range(3):
                inner = np.linspace(low, high, refined_points)
                found = np.zeros(inner.shape)
                clear = is_clear_of(inner, self._poles)
                points = inner[clear]
                found[clear] = _errors(model, points, *values_and_norm(self.G, points))[row]
                best = np.unravel_index(found.argmax(), found.shape)
                if found[best] > worst[row]:
                    worst[row] = found[best]
                    at[row] = inner[best]
                around = _neighbours(found.argmax(axis=0), refined_points)
                low, high = np.take_along_axis(inner, around, axis=0)
        return worst * margin + EXACT_ROUNDING, at

    def _brackets(self, error: Real) -> tuple[Real, Real]:
        """Return the samples on either side of each high local maximum."""
        padded = np.r_[-1.0, error, -1.0]
        is_peak = (error >= padded[:-2]) & (error >= padded[2:])
        # 0.2 of the highest: lower ones are not refined
        peaks = np.flatnonzero(is_peak & (error >= 0.2 * error.max()))
        # 12: local maxima of the error that are refined, the highest first
        peaks = peaks[np.argsort(-error[peaks])][:12]
        low, high = self.w[_neighbours(peaks, self.w.size)]
        return low, high

    def _dips(self, w: Real) -> Real:
        """Return points around the dips of |G| and |G'|, where the norm is small."""
        s = 1j * w
        sizes = abs(np.concatenate([self.G(s), self.G.derivative(s)]))
        inner = sizes[:, 1:-1]
        is_dip = (inner < sizes[:, :-2]) & (inner < sizes[:, 2:])
        where = np.flatnonzero(is_dip.any(axis=0)) + 1
        # 8: around each dip of |G| or |G'|
        return np.linspace(w[where - 1], w[where + 1], 8).ravel()


def _neighbours(index: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Return the indices (2, n) on either side of each (n,), within an array of that size."""
    return np.clip([index - 1, index + 1], 0, size - 1)


def values_and_norm(G: TransferFunction, w: Real) -> tuple[Complex, Real]:
    """Return G(i w) and |G| + |w dG/dw| (outputs, w)."""
    s = 1j * w
    values = G(s)
    return values, abs(values) + abs(w * np.atleast_2d(G.derivative(s)))


def is_clear_of(w: Real, poles: Real, share: float = 1e-12) -> NDArray[np.bool_]:
    """Return where a frequency is farther than that share of itself from the nearest of the poles (ascending)."""
    edged = np.r_[-np.inf, poles, np.inf]
    above = np.searchsorted(poles, w)
    distance = np.minimum(w - edged[above], edged[above + 1] - w)
    return np.asarray(distance > share * w)


def frequencies_around(arm: Arm, high: float) -> Real:
    """Return the flexible natural frequencies [rad/s] below 1.5 times `high`, and the next one."""
    return modes(arm, modes_below(arm, 1.5 * high) + 1).flexible


def _samples(low: float, high: float, poles: Real) -> Real:
    """Return frequencies in even and in geometric steps, more between neighbouring poles and around each."""
    # 60 more a decade; peaks between are refined
    count = 200 + int(60 * np.log10(high / low))
    # of samples from a pole, as shares of its frequency
    distances = 10.0 ** -np.arange(1, 8)
    crowd = np.outer(poles, 1 + np.r_[-distances, distances]).ravel()
    # 24 between two poles
    knots = np.r_[low, poles[(poles > low) & (poles < high)], high]
    share = (1 - np.cos(np.linspace(0, np.pi, 26)[1:-1])) / 2
    between = (knots[:-1, None] + np.outer(np.diff(knots), share)).ravel()
    w = np.r_[np.geomspace(low, high, count), np.linspace(low, high, 400), crowd, between]
    return np.unique(np.clip(w, low, high))


def _errors(model: PartialFractions, w: Real, exact: Complex, size: Real) -> Real:
    """Return |dG| and the rounding of a state space, over the norm; 0 for an output that is zero throughout."""
    # the terms of a model cancel where G is small: four roundings in their sum
    s = 1j * w
    gap = abs(model(s) - exact) + 4 * MACHINE_EPS * model.magnitude(s)
    return np.divide(gap, size, out=np.where(gap > 0, np.inf, 0.0), where=size > 0)
