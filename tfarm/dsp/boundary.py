"""Where in the plane of gains the sampled loop changes its count of unstable poles: D-decomposition on the unit circle.

On z = e^{iq} the characteristic function A + K B (K one gain, the other in A) vanishes for a real K where f = Im(A conj
B) = 0, and then K = -Re(A conj B)/|B|^2.  As K grows through that value a pair of poles leaves the circle where f falls
with q, and enters where it rises; at z = 1 and z = -1 a single pole does.  Each open-loop pole near the circle gives A
and B a feature as narrow as its residue: so the grid in q is laid around each of them, geometrically, and A, B are
computed from the offset to it, which loses nothing (Neimark 1948; see also Ackermann, Robust Control, 1993, ch. 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tfarm.dsp.loop import ANGLE, SampledLoop
from tfarm.records import record
from tfarm.spectrum.scales import most_gain

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Whole = NDArray[np.int64]
GainName = Literal["K1", "K2"]

A_DECADE = 48  # grid points a decade of the distance to a pole
NARROWEST = 1e-17
COARSEST = 2000  # points of the uniform grid over the half circle
NEAR_ONE = 1e-7  # where the values at z = 1 are read: they are even in q, so wrong by 1e-14


@dataclass(frozen=True)
@record
class Crossings:
    """At each `gain` (n,), ascending, `count` (n,) poles leave the unit circle (negative: enter it), at angle `q`."""

    gain: Real
    count: Whole
    q: Real


@dataclass(frozen=True)
@record
class CircleGrid:
    """Points z = e^{iq}, 0 < q < pi, each as a pole `base` and an angle `shift` from it, with what the loop's terms are
    there.

    `rest` = offset (1 + Kp Theta), `rate` = offset R, `moment` = offset M.
    """

    loop: SampledLoop
    base: Whole
    shift: Real

    @cached_property
    def angles(self) -> Real:
        """The angle of each open-loop pole on the circle."""
        return np.angle(self.loop.pulse.multipliers).astype(np.float64)

    @cached_property
    def q(self) -> Real:
        """The angle of each point."""
        return self.angles[self.base] + self.shift

    @cached_property
    def terms(self) -> tuple[Complex, Complex, Complex]:
        """rest, rate and moment at each point."""
        return self.at(self.base, self.shift)

    def at(self, base: Whole, shift: Real) -> tuple[Complex, Complex, Complex]:
        """rest, rate and moment at other points."""
        pulse = self.loop.pulse
        decay = pulse.poles.real[base] * pulse.sampling.period
        offset = pulse.multipliers[base] * np.expm1(-decay + 1j * shift)
        return self.loop.signals(np.exp(1j * (self.angles[base] + shift)), base, offset)


def circle_grid(loop: SampledLoop) -> CircleGrid:
    """The grid that resolves every pole of the loop (its gains do not matter)."""
    pulse = loop.pulse
    angles = np.angle(pulse.multipliers)
    width = np.maximum(abs(pulse.poles.real) * pulse.sampling.period * 1e-2, NARROWEST)
    felt = pulse.residues.any(axis=0) | (np.arange(angles.size) == angles.size - 1)
    bases = np.nonzero((angles >= 0) & (abs(pulse.multipliers) > 1e-2) & felt)[0]
    bases = bases[np.argsort(angles[bases], kind="stable")]
    seams = np.r_[0.0, (angles[bases][1:] + angles[bases][:-1]) / 2, np.pi]
    base, shift = [], []
    for i, pole in enumerate(bases):
        for edge in (seams[i] - angles[pole], seams[i + 1] - angles[pole]):
            s = _geometric(abs(edge), width[pole]) * np.sign(edge)
            base.append(np.full(s.size, pole))
            shift.append(s)
    grid = CircleGrid(loop, np.concatenate(base), np.concatenate(shift))
    order = np.lexsort((grid.shift, np.searchsorted(seams, grid.q, side="left"), grid.q))
    inside = order[(grid.q[order] >= 0) & (grid.q[order] < np.pi)]
    return CircleGrid(loop, grid.base[inside], grid.shift[inside])


def _geometric(edge: float, width: float) -> Real:
    """Distances from a pole, from a hundredth of its width to the seam with its neighbour."""
    if edge <= width:
        return np.array([edge / 2])[: int(edge > 0)]
    decades = np.log10(edge / width)
    near = np.geomspace(width, edge, max(2, int(A_DECADE * decades)), endpoint=False)
    even = np.arange(1, int(edge * COARSEST / np.pi) + 1) * (np.pi / COARSEST)
    return np.union1d(near, even[even < edge])


def crossings(grid: CircleGrid, gain: GainName, other: float) -> Crossings:
    """Where poles cross the circle as one gain runs from minus to plus the largest that `most_gain` allows.

    The `other` is held; exact to rounding.
    """
    A, B = _split(grid.terms, gain, other)
    rises = (A * B.conj()).imag >= 0
    step = np.nonzero(rises[1:] != rises[:-1])[0]
    count = np.where(rises[step], 2, -2)
    values, q = _polished(grid, gain, other, step)
    ends = [_at_minus_one(grid, gain, other, bool(rises[-1])), *_at_one(grid, gain, other, bool(rises[0]))]
    values = np.r_[values, [end[0] for end in ends]]
    count = np.r_[count, [end[1] for end in ends]]
    q = np.r_[q, [end[2] for end in ends]]
    order = np.argsort(values, kind="stable")
    kept = order[abs(values[order]) <= most_gain(grid.loop.plant.arm, gain)]
    return Crossings(values[kept], count[kept], q[kept])


def _split(terms: tuple[Complex, Complex, Complex], gain: GainName, other: float) -> tuple[Complex, Complex]:
    rest, rate, moment = terms
    return (rest + other * moment, rate) if gain == "K1" else (rest + other * rate, moment)


def _polished(grid: CircleGrid, gain: GainName, other: float, step: Whole) -> tuple[Real, Real]:
    """Bisection in the angle from the nearer pole, down to its last bit."""
    base = np.where(abs(grid.shift[step]) < abs(grid.shift[step + 1]), grid.base[step], grid.base[step + 1])
    low = np.where(base == grid.base[step], grid.shift[step], grid.q[step] - grid.angles[base])
    high = np.where(base == grid.base[step + 1], grid.shift[step + 1], grid.q[step + 1] - grid.angles[base])

    def products(shift: Real) -> tuple[Complex, Complex]:
        A, B = _split(grid.at(base, shift), gain, other)
        return A * B.conj(), B

    at_low = products(low)[0].imag >= 0
    for _ in range(52):
        middle = (low + high) / 2
        same = (products(middle)[0].imag >= 0) == at_low
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    product, B = products((low + high) / 2)
    return -product.real / abs(B) ** 2, grid.angles[base] + (low + high) / 2


def _at_minus_one(grid: CircleGrid, gain: GainName, other: float, is_above: bool) -> tuple[float, int, float]:
    """The gain of a pole at z = -1; f vanishes there, so it falls where it is positive just before."""
    A, B = _split(grid.loop.signals(np.array([-1.0 + 0j]), None, np.ones(1)), gain, other)
    return _real_gain(A[0], B[0]), 1 if is_above else -1, float(np.pi)


def _at_one(grid: CircleGrid, gain: GainName, other: float, is_above: bool) -> list[tuple[float, int, float]]:
    """The gain of a pole at z = 1: K1 = 0 where the arm can drift, a static balance where it cannot."""
    loop = grid.loop
    rigid, count = loop.plant.rigid[ANGLE], -1 if is_above else 1
    if loop.gains.Kp != 0.0 and rigid.any():
        return []
    if rigid[0] != 0.0:
        return [(0.0, count, 0.0)] if gain == "K1" else []
    z = np.exp(np.array([1j * NEAR_ONE]))
    A, B = _split(loop.signals(z, None, np.ones(1)), gain, other)
    return [(_real_gain(A[0], B[0]), count, 0.0)]


def _real_gain(A: complex, B: complex) -> float:
    return -A.real / B.real if abs(B.real) > 1e-12 * abs(A.real) else np.inf
