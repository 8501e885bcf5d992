"""Where along one gain the sampled loop changes its count of unstable poles: `tfarm.crossing` on the unit circle.

On z = e^{iq} the characteristic function is A + K B, K one gain, the others in A.  Each open-loop pole near the circle
gives A and B a feature as narrow as its residue: so the grid in q is laid around each of them, geometrically, and A, B
are computed from the offset to it, which loses nothing.  At z = 1 and z = -1 a single pole crosses (see also Ackermann,
Robust Control, 1993, ch. 4).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import GAINS, HubFeedback
from tfarm.arrays import Complex, Real, Whole
from tfarm.crossing import Crossing, Crossings, brackets, solved
from tfarm.dsp.law_loop import SampledLaw
from tfarm.dsp.loop import ANGLE_ROW, SampledLoop, turning
from tfarm.exact.characteristic import torque
from tfarm.records import record
from tfarm.spectrum.scales import most_gain

Split = Callable[[tuple[Any, Complex]], tuple[Complex, Complex]]  # of a grid's terms into A and B of A + g B

A_DECADE = 48  # grid points a decade of the distance to a pole
NARROWEST_WIDTH = 1e-17  # rad, of a pole: closer to it no angle is told from another
WIDTH_SHARE = 1e-2  # of the distance of a pole from the circle: the grid begins so near to it
BRIGHT = 1e-2  # poles and roots nearer to z = 0 leave nothing on the circle to resolve
NO_EFFECT = 1e-12  # of what is there without a gain: what it adds, if less, is rounding of none
COARSEST = 2000  # points of the uniform grid over the half circle
STILL = 1e-8  # of the way from z = 1 to the nearest pole of an arm that something holds: nearer than that it stands
# still, its rate is rounding, and a gain on it would have to be so many times too large to move a pole


@dataclass(frozen=True)
@record
class CircleGrid:
    """Points z = e^{iq}, 0 < q < pi, each as a pole `base` and an angle `shift` from it."""

    loop: SampledLoop | SampledLaw
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
    def terms(self) -> tuple[Complex, Complex]:
        """The offset from its pole (n,) of each point, and the loop's `signals` (gains, n) times it."""
        return self.at(self.base, self.shift)

    def at(self, base: Whole, shift: Real) -> tuple[Complex, Complex]:
        """`terms` at other points."""
        pulse = self.loop.pulse
        decay = pulse.poles.real[base] * pulse.sampling.period
        offset = pulse.multipliers[base] * np.expm1(-decay + 1j * shift)
        return offset, self.loop.signals(np.exp(1j * (self.angles[base] + shift)), base, offset)

    def above(self, angle: float) -> CircleGrid:
        """The points at greater angles alone."""
        beyond = self.q > angle
        return CircleGrid(self.loop, self.base[beyond], self.shift[beyond])


def circle_grid(loop: SampledLoop | SampledLaw) -> CircleGrid:
    """The grid that resolves every pole of the loop (its gains do not matter)."""
    pulse = loop.pulse
    angles = np.angle(pulse.multipliers)
    width = np.maximum(abs(pulse.poles.real) * pulse.sampling.period * WIDTH_SHARE, NARROWEST_WIDTH)
    felt = pulse.residues.any(axis=0) | (np.arange(angles.size) == angles.size - 1)
    bases = np.nonzero((angles >= 0) & (abs(pulse.multipliers) > BRIGHT) & felt)[0]
    bases = bases[np.argsort(angles[bases], kind="stable")]
    seams = np.r_[0.0, (angles[bases][1:] + angles[bases][:-1]) / 2, np.pi]
    base, shift = [], []
    for i, pole in enumerate(bases):
        for edge in (seams[i] - angles[pole], seams[i + 1] - angles[pole]):
            s = geometric(abs(edge), width[pole]) * np.sign(edge)
            base.append(np.full(s.size, pole))
            shift.append(s)
    grid = CircleGrid(loop, np.concatenate(base), np.concatenate(shift))
    order = np.lexsort((grid.shift, np.searchsorted(seams, grid.q, side="left"), grid.q))
    away = abs(1 - pulse.multipliers[bases])  # 0 of the last, the pole of an arm that drifts
    lowest = 0.0 if loop.plant.rigid.any() else STILL * away[away > 0].min(initial=1.0)
    inside = order[(grid.q[order] >= lowest) & (grid.q[order] < np.pi)]
    return CircleGrid(loop, grid.base[inside], grid.shift[inside])


def geometric(edge: float, width: float) -> Real:
    """Distances from a pole, from a hundredth of its width to the seam with its neighbour."""
    if edge <= width:
        return np.array([edge / 2])[: int(edge > 0)]
    decades = np.log10(edge / width)
    near = np.geomspace(width, edge, max(2, int(A_DECADE * decades)), endpoint=False)
    even = np.arange(1, int(edge * COARSEST / np.pi) + 1) * (np.pi / COARSEST)
    return np.union1d(near, even[even < edge])


def circle_crossings(grid: CircleGrid, name: str, law: HubFeedback) -> Crossings:
    """Where poles cross the circle, at angles `at`, as one gain runs from minus to plus the largest of `most_gain`.

    The others are those of the law; exact to rounding.
    """
    line = _Line([gain.name for gain in GAINS].index(name), law.having(name, 0.0).row)
    found, first = crossed_on(grid, line.split)
    most = most_gain(grid.loop.plant.arm, name)
    return Crossings.of(each for each in [*found, *_at_one(grid, line, first)] if abs(each.t) <= most)


class _Line(NamedTuple):
    """A gain by its place in the law, the loop's gains with 0 in that place."""

    place: int
    others: tuple[float, ...]

    def split(self, terms: tuple[Any, Complex]) -> tuple[Complex, Complex]:
        """A and B of A + K B, K that gain."""
        offset, signals = terms
        return offset + torque(self.others, signals), signals[self.place]


def crossed_on(grid: CircleGrid, split: Split) -> tuple[list[Crossing], int]:
    """The crossings at angles 0 < q <= pi, and by how much one at z = 1 changes the count.

    Each is solved for by its angle from a pole next to it, down to its last bit.  At z = 1 and z = -1, where a single
    pole crosses, h = Im(A conj B) vanishes: so it falls towards the end where it is positive just before.
    """
    A, B = split(grid.terms)
    h = (A * B.conj()).imag
    (step,), change = brackets(h)
    base, low = grid.base[step], grid.shift[step]  # where the next point has another pole, both are as far away
    high = np.where(base == grid.base[step + 1], grid.shift[step + 1], grid.q[step + 1] - grid.angles[base])
    shift, gain = solved(lambda shift: split(grid.at(base, shift)), low, high)
    found = [Crossing(*each) for each in zip(gain, grid.angles[base] + shift, change, strict=True)]
    one = np.ones(1)
    A, B = split((one, grid.loop.signals(np.array([-1.0 + 0j]), None, one)))
    found.append(Crossing(real_gain(A[0], B[0]), math.pi, 1 if h[-1] >= 0 else -1))
    return found, -1 if h[0] >= 0 else 1


def _at_one(grid: CircleGrid, line: _Line, change: int) -> list[Crossing]:
    """The crossing at z = 1: where nothing holds the angle, at no gain on the rate of an arm that can drift, else by a
    static balance."""
    plant = grid.loop.plant
    rigid, turned = plant.rigid[ANGLE_ROW], turning(plant)
    held = float(np.array(line.others) @ turned)
    if turned[line.place]:
        return [Crossing(-held / float(turned[line.place]) + 0.0, 0.0, change)]
    if held:
        return []
    if rigid[0] != 0.0:
        return [Crossing(0.0, 0.0, change)] if plant.rigid[line.place].any() else []
    A, B = line.split((np.ones(1), plant.at_rest[:, None] + 0j))
    return [Crossing(real_gain(A[0], B[0]), 0.0, change)]


def real_gain(A: complex, B: complex) -> float:
    """The real gain g of A + g B = 0 where A and B are real; inf where there is none."""
    return float(-A.real / B.real) if abs(B.real) > NO_EFFECT * abs(A.real) else math.inf
