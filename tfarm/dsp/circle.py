"""How many poles of a sampled loop lie outside the unit circle, proven between the points of the circle too.

With x = 1 - 1/z, a_j = e^{p_j (1-f) T}, b_j = e^{p_j T} and g0 the finite part of G at s = 0, the pulse transfer
function of the plant is

    H(z) = z^-d [ g0/z + x sum over poles of (r_j/p_j) a_j/(z - b_j) + the rigid body's terms in 1/x ]

so a pole that has settled before the sample weighs nothing.  Of a slow one, as friction at the hub makes it, the share
in g0 nearly cancels that in the sum: both are taken as one, (r_j/p_j) (a_j - 1 + (b_j - a_j)/z)/(z - b_j).  So are
that pole p and the integral of the rate of a braked hub, R/s - R/(s - p) of the angle with R = 1/b large:

    x H(z) = -R p (c0 + c1/z + c2/z^2)/(z - e^{pT}),  c0 = t^2 phi(p t), t = (1 - f) T,
    c2 = (f T)^2 e^{pT} phi(-p f T),  c0 + c1 + c2 = T (e^{pT} - 1)/p,  phi(u) = (e^u - 1 - u)/u^2

x^k F(z) = x^k (1 + gains . H), k the order of the pole at z = 1, is analytic on the circle and outside.  On an arc it
stays in a disc about its value in the middle, for 1/(z - b) changes by h/(|z - b| (|z - b| - h)) at most over h.  Where
no disc holds 0, the phase between neighbouring middles is known without doubt, and half the circle gives the count (the
argument principle).  Arcs whose disc holds 0 are cut.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Generic

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import HubFeedback
from tfarm.arrays import Complex, Real
from tfarm.dsp.law_loop import SampledKind
from tfarm.dsp.loop import ANGLE_ROW, RATE_ROW, SampledLoop
from tfarm.dsp.sampling import SLOW, phi
from tfarm.records import record

MACHINE_EPS = float(np.finfo(float).eps)  # of a float64, times the counts of operations beside it
ARCS = 64  # of half the circle to begin with
SHORTEST_ARC = 1e-13  # rad: no arc is cut further, as its ends are known to a few last bits
PIECES_OF_ARC = 4  # into which one is cut that is too long
MOST_ARCS = 60_000  # a loop that takes more is not shown
ON_IT = 1e-100  # stands for the distance from the circle of a pole on it: its disc is wide, and holds 0
TERMS_AT_A_TIME = 1 << 19  # terms 1/(z - b) at a time, lest they leave the cache


@dataclass(frozen=True)
@record
class Discs:
    """Discs in the complex plane, `middle` and `radius` arrays of one shape; what is computed with them holds for every
    point."""

    middle: Complex
    radius: Real

    def __add__(self, other: Discs) -> Discs:
        return Discs(self.middle + other.middle, self.radius + other.radius)

    def __mul__(self, other: Discs) -> Discs:
        mine, theirs = abs(self.middle) + self.radius, abs(other.middle)
        return Discs(self.middle * other.middle, mine * other.radius + theirs * self.radius)

    def times(self, factor: complex) -> Discs:
        """Every disc times a number."""
        return Discs(self.middle * factor, self.radius * abs(factor))

    def __getitem__(self, row: int) -> Discs:
        """The discs of one row."""
        return Discs(self.middle[row], self.radius[row])

    def inverse(self) -> Discs:
        """1/z for discs that do not hold 0; of infinite radius for those that do."""
        size = abs(self.middle)
        room = np.maximum(size - self.radius, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            return Discs(1 / self.middle, np.where(room > 0, self.radius / (size * room), np.inf))


@dataclass(frozen=True)
class _Arcs:
    """Arcs of the circle between the angles `low` and `high` [rad]."""

    low: Real
    high: Real

    @property
    def x(self) -> Discs:
        """1 - 1/z."""
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return Discs(-np.expm1(-1j * middle), half + MACHINE_EPS)

    def turned(self, n: int) -> Discs:
        """z^-n."""
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return Discs(np.exp(-1j * n * middle), n * (half + 4 * MACHINE_EPS))


@dataclass
class Circle(Generic[SampledKind]):
    """The upper half of the unit circle in arcs, and on each what a loop's plant is there; its gains do not matter.

    `missing` (outputs,) bounds |x sum over poles left out|.  `low` and `high` [rad] are the ends of the arcs, `parts`
    the discs (1 + gains, arcs) of x and of what the gains multiply in F times x^n, n = `orders` (gains,) at z = 1;
    arcs are cut as counts need it.
    """

    loop: SampledKind
    kept: NDArray[np.bool_]
    missing: Real
    low: Real = field(init=False)
    high: Real = field(init=False)
    parts: Discs = field(init=False)

    def __post_init__(self) -> None:
        ends = np.linspace(0.0, np.pi, ARCS + 1)
        self.low, self.high = ends[:-1], ends[1:]
        self.parts = self._parts(self.low, self.high)

    def count(self, gains: HubFeedback) -> int | None:
        """Poles of the loop with these gains outside the circle, z = 1 of a free angle apart; None if not shown."""
        return self.counted(lambda: self.characteristic(gains))

    def counted(self, characteristic: Callable[[], Discs]) -> int | None:
        """How many zeros a function has outside the circle, which `characteristic` gives on every arc as they are."""
        while True:
            F = characteristic()
            rough = ~(abs(F.middle) > F.radius)
            if not rough.any():
                steps = np.angle(F.middle[1:] / F.middle[:-1])
                start, end = np.angle(F.middle[0]), np.angle(F.middle[-1])
                return -round(float(steps.sum() + _to_the_axis(start) - _to_the_axis(end)) / np.pi)
            width = self.high[rough] - self.low[rough]
            if width.min() < SHORTEST_ARC or (PIECES_OF_ARC - 1) * rough.sum() + rough.size > MOST_ARCS:
                return None
            self._cut(rough)

    # ------------------------------------------------------------ the characteristic function

    def characteristic(self, gains: HubFeedback) -> Discs:
        """x^k F on every arc, k the order of its pole at z = 1."""
        used = [(K, order, row) for row, (K, order) in enumerate(zip(gains.row, self.orders, strict=True)) if K]
        k = max((order for _, order, _ in used), default=0)
        x = self.parts[0]
        total = power(x, k)
        for K, order, row in used:
            part = self.parts[1 + row]
            total = total + (part if order == k else power(x, k - order) * part).times(K)
        return total

    @property
    def orders(self) -> list[int]:
        """The order at z = 1 of what each gain multiplies."""
        orders = [2 if twice else int(once != 0.0) for twice, once in self.loop.plant.rigid]
        if isinstance(self.loop, SampledLoop) and self.loop.differences:
            orders[RATE_ROW] = max(0, orders[ANGLE_ROW] - 1)
        return orders

    def _parts(self, low: Real, high: Real) -> Discs:
        """x, and what each gain multiplies in F times x^n, on arcs: discs (1 + gains, arcs)."""
        arcs = _Arcs(low, high)
        sums, slow = self._sums(arcs), self._slow_sums(arcs)
        found = [arcs.x, *(self._output(row, arcs, sums[row], slow[row]) for row in range(len(self.orders)))]
        if isinstance(self.loop, SampledLoop) and self.loop.differences:
            a, T = self.loop.smoothing, self.loop.chain.sampling.period
            rate = found[1 + ANGLE_ROW] * (arcs.turned(0) + arcs.turned(1).times(-a)).inverse().times((1 - a) / T)
            found[1 + RATE_ROW] = rate if self.orders[ANGLE_ROW] else rate * arcs.x
        return Discs(np.array([each.middle for each in found]), np.array([each.radius for each in found]))

    def _output(self, row: int, arcs: _Arcs, poles: Discs, slow: Discs) -> Discs:
        """x^n times an output's pulse transfer function, n its order at z = 1; `poles`, `slow`: sums over its poles."""
        plant, pulse = self.loop.plant, self.loop.pulse
        T, f = pulse.sampling.period, pulse.sampling.fraction
        twice, once = plant.rigid[row]
        order = 2 if twice else int(once != 0.0)
        x, late = arcs.x, arcs.turned(1)
        at_rest = float(plant.static[row] - (plant.residues[row] / plant.poles)[~self.is_slow].real.sum())
        sums = poles * x
        held = Discs(sums.middle, sums.radius + self.missing[row]) + late.times(at_rest) + slow
        total = power(x, order) * held
        push = arcs.turned(0).times((1 - f) * T) + late.times(f * T)
        if twice:  # then there is no 1/s beside it: of an arm that turns freely nothing at the hub is lost
            ramp = arcs.turned(0).times(pulse.ramps[0]) + late.times(pulse.ramps[1])
            total = total + ((push * late).times(T) + x * ramp).times(twice) * late
        elif once:
            total = total + (push * late if self.braked is None else self._braked_pair(arcs)).times(once)
        return total * arcs.turned(pulse.sampling.whole_delay)

    # ------------------------------------------------------------ arcs

    def _cut(self, rough: NDArray[np.bool_]) -> None:
        """Cut some arcs into shorter ones."""
        ends = np.linspace(self.low[rough], self.high[rough], PIECES_OF_ARC + 1)
        new_low, new_high = ends[:-1].ravel(), ends[1:].ravel()
        new = self._parts(new_low, new_high)
        all_low = np.r_[self.low[~rough], new_low]
        order = np.argsort(all_low)
        self.low, self.high = all_low[order], np.r_[self.high[~rough], new_high][order]
        old = self.parts
        self.parts = Discs(
            np.c_[old.middle[:, ~rough], new.middle][:, order], np.c_[old.radius[:, ~rough], new.radius][:, order]
        )

    @cached_property
    def is_slow(self) -> NDArray[np.bool_]:
        """Which poles hardly decay in a sample, as that of friction at the hub."""
        return np.asarray(self.kept & (abs(self.loop.plant.poles) * self.loop.chain.sampling.period < SLOW))

    def _sums(self, arcs: _Arcs) -> Discs:
        """sum over all poles but slow ones of (r/p) a/(z - b) on arcs: discs (outputs, arcs)."""
        plant, sampling, which = self.loop.plant, self.loop.chain.sampling, self.kept & ~self.is_slow
        p = plant.poles[which]
        remaining = (1 - sampling.fraction) * sampling.period
        return self._summed(arcs, p, plant.residues[:, which] / p * np.exp(p * remaining))

    def _slow_sums(self, arcs: _Arcs) -> Discs:
        """sum over slow poles of (r/p) (a - 1 + (b - a)/z)/(z - b), all that they give: discs (outputs, arcs)."""
        plant, sampling = self.loop.plant, self.loop.chain.sampling
        p, T, f = plant.poles[self.is_slow], sampling.period, sampling.fraction
        residues = plant.residues.copy()
        if self.braked is not None:
            residues[:, self.braked] += np.array([once for _, once in plant.rigid])  # the rest is in `_braked_pair`
        at_rest = residues[:, self.is_slow] / p
        now, late = at_rest * np.expm1(p * ((1 - f) * T)), at_rest * np.exp(p * ((1 - f) * T)) * np.expm1(p * (f * T))
        return self._summed(arcs, p, now) + self._summed(arcs, p, late) * arcs.turned(1)

    @cached_property
    def braked(self) -> int | None:
        """Which pole is that of a hub that friction brings to rest, if it is slow and kept; None if there is none."""
        found = self.loop.plant.braked(SLOW / self.loop.chain.sampling.period)
        return found if found is not None and self.is_slow[found] else None

    def _braked_pair(self, arcs: _Arcs) -> Discs:
        """x times the pulse transfer function of 1/s - 1/(s - p), p the braked hub's pole."""
        T, late = self.loop.chain.sampling.period, self.loop.chain.sampling.fraction * self.loop.chain.sampling.period
        p = float(self.loop.plant.poles[self.braked].real)
        first, last = (T - late) ** 2 * phi(p * (T - late)), late**2 * np.exp(p * T) * phi(-p * late)
        whole = T * np.expm1(p * T) / p
        over = self._summed(arcs, np.array([p + 0j]), np.array([[-p + 0j]]))[0]
        sums = arcs.turned(0).times(first) + arcs.turned(1).times(whole - first - last) + arcs.turned(2).times(last)
        return over * sums

    def _summed(self, arcs: _Arcs, p: Complex, weights: Complex) -> Discs:
        """sum over poles p of weight/(z - b) on arcs: discs (outputs, arcs)."""
        low, high, T = arcs.low, arcs.high, self.loop.chain.sampling.period
        b, room = np.exp(p * T), np.maximum(-np.expm1(p.real * T), ON_IT)
        blur = MACHINE_EPS * (4 + abs(p * T))
        middles, radii = [], []
        for some in np.array_split(np.arange(low.size), 1 + low.size * p.size // TERMS_AT_A_TIME):
            q, h = (low[some] + high[some]) / 2, (high[some] - low[some])[:, None] / 2
            away = np.exp(1j * q)[:, None] - b
            away = np.where(away == 0, ON_IT, away)
            near = 1 / abs(away)
            least = 1 / np.maximum(1 / near - h, room)
            change = np.minimum(h * near * least, near + least) + blur * near**2
            middles.append(weights @ (1 / away).T)
            radii.append(abs(weights) @ change.T)
        return Discs(np.concatenate(middles, axis=1), np.concatenate(radii, axis=1))


def power(x: Discs, n: int) -> Discs:
    """x^n."""
    total = Discs(np.ones_like(x.middle), np.zeros_like(x.radius))
    for _ in range(n):
        total = total * x
    return total


def _to_the_axis(angle: float) -> float:
    """The angle of a value from the real axis, on whichever side of 0 it lies."""
    return angle - np.pi * round(angle / np.pi)
