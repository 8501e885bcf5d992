"""Where along a number of the law the sampled loop changes its count of unstable poles: `tfarm.crossing` on the circle.

On z = e^{iq} the characteristic function is A + g B, g one number of the law, or a factor on all of it, and A what is
without it.  Each open-loop pole near the circle gives A and B a feature as narrow as its residue: so the grid in q is
laid around each of them, geometrically, and A, B are computed from the offset to it, which loses nothing.  At z = 1 and
z = -1 a single pole crosses (see also Ackermann, Robust Control, 1993, ch. 4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tfarm.arm import NAMES
from tfarm.arm.feedback import ON
from tfarm.arrays import Complex, Real, Whole
from tfarm.crossing import Crossing, Crossings, Window, brackets, confirmed, solved
from tfarm.dsp.sampled import Sampled
from tfarm.records import record
from tfarm.spectrum.scales import most_gain

A_DECADE = 48  # grid points a decade of the distance to a pole
NARROWEST_WIDTH = 1e-17  # rad, of a pole: closer to it no angle is told from another
WIDTH_SHARE = 1e-2  # of the distance of a pole from the circle: the grid begins so near to it
BRIGHT = 1e-2  # poles and roots nearer to z = 0 leave nothing on the circle to resolve
NO_EFFECT = 1e-12  # of what is there without a gain: what it adds, if less, is rounding of none
COARSEST = 2000  # points of the uniform grid over the half circle
STILL = 1e-8  # of the way from z = 1 to the nearest pole of an arm that something holds: nearer than that it stands
# still, its rate is rounding, and a gain on it would have to be so many times too large to move a pole
LEAST_FACTOR = 1e-9  # on a law, that is looked at: with less it is none
MOST_FACTOR = 1e9  # with more its gain is beyond any number


@dataclass(frozen=True)
@record
class CircleGrid:
    """Points z = e^{iq}, 0 < q < pi, each as a pole `base` and an angle `shift` from it."""

    loop: Sampled
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
    def terms(self) -> Complex:
        """The loop's `terms` (1 + parts, n), each times the offset of the point from its pole."""
        return self.at(self.base, self.shift)

    def at(self, base: Whole, shift: Real) -> Complex:
        """`terms` at other points."""
        pulse = self.loop.pulse
        decay = pulse.poles.real[base] * pulse.sampling.period
        offset = pulse.multipliers[base] * np.expm1(-decay + 1j * shift)
        return self.loop.terms(np.exp(1j * (self.angles[base] + shift)), base, offset)


def circle_grid(loop: Sampled) -> CircleGrid:
    """The grid that resolves every pole of the plant and every pole and zero of the law, whatever its weights."""
    grid = _plant_grid(loop)
    q, angles = [np.empty(0)], grid.q
    roots = 1 + np.r_[loop.in_z.poles, loop.in_z.zeros]
    for root in roots[(abs(roots) > BRIGHT) & (roots.imag >= 0)]:  # the upper of each pair
        width, at = max(WIDTH_SHARE * abs(1 - abs(root)), NARROWEST_WIDTH), abs(np.angle(root))
        near = geometric(math.pi, width)
        q.append(np.r_[at - near, at + near])
    more = np.concatenate(q)
    more = np.unique(more[(more > 0) & (more < math.pi)])
    nearest = np.clip(np.searchsorted(angles, more), 0, angles.size - 1)
    base = np.r_[grid.base, grid.base[nearest]]
    shift = np.r_[grid.shift, more - grid.angles[grid.base[nearest]]]
    order = np.argsort(np.r_[angles, more], kind="stable")
    return CircleGrid(loop, base[order], shift[order])


def _plant_grid(loop: Sampled) -> CircleGrid:
    """The grid that resolves every pole of the plant."""
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


def number_crossings(grid: CircleGrid, name: str, weights: Real) -> Crossings:
    """Where poles cross the circle, at angles `at`, as one number of the law runs over all its values; to rounding.

    The others are those of `weights` (1 + parts,), as `Sampled.row`.  A gain at the hub runs as far as `most_gain`.
    """
    place = 1 + grid.loop.place(name)
    others, alone = np.array(weights), np.zeros(weights.size)
    others[place], alone[place] = 0.0, 1.0
    gain = ON.get(name, name)
    most = most_gain(grid.loop.plant.arm, gain) if gain in NAMES else MOST_FACTOR * (abs(weights[place]) or 1.0)
    return Crossings.of(each for each in _crossed(grid, others, alone) if abs(each.t) <= most)


def crossing_factors(loop: Sampled) -> Crossings:
    """The positive factors on the law at which poles are on the circle, `at` which angle [rad a sample]."""
    whole, fed_back = loop.row.copy(), loop.row.copy()
    whole[1:], fed_back[0] = 0.0, 0.0
    found = _crossed(circle_grid(loop), whole, fed_back)
    return Crossings.of(each for each in found if LEAST_FACTOR < each.t < MOST_FACTOR)


def _crossed(grid: CircleGrid, others: Real, alone: Real) -> list[Crossing]:
    """The crossings of A + g B as g grows, A and B the `terms` under two rows of weights.

    Each is solved for by its angle from a pole next to it, down to its last bit.  At z = 1 and z = -1, where a single
    pole crosses, h = Im(A conj B) vanishes: so it falls towards the end where it is positive just before.
    """
    both = np.array([others, alone])
    A, B = both @ grid.terms
    h = (A * B.conj()).imag
    (step,), change = brackets(h)
    base, low = grid.base[step], grid.shift[step]  # where the next point has another pole, both are as far away
    high = np.where(base == grid.base[step + 1], grid.shift[step + 1], grid.q[step + 1] - grid.angles[base])
    shift, gain = solved(lambda shift: tuple(both @ grid.at(base, shift)), low, high)
    found = [Crossing(*each) for each in zip(gain, grid.angles[base] + shift, change, strict=True)]
    A, B = both @ grid.loop.terms(np.array([-1.0 + 0j]), None, np.ones(1))
    found.append(Crossing(_real_gain(A[0], B[0]), math.pi, 1 if h[-1] >= 0 else -1))
    lowest, at_one = _lowest(grid.loop.near_one(others))
    least, moving = _lowest(grid.loop.near_one(alone))
    if least <= lowest:  # A and B go there as the same power of x = 1 - 1/z, or A as a higher one: it is there at 0
        first = -1 if h[0] >= 0 else 1
        found.append(Crossing(_real_gain(at_one, moving) if least == lowest else 0.0, 0.0, first))
    return found


def _lowest(terms: Sequence[tuple[int, float]]) -> tuple[float, float]:
    """The lowest power of x in a sum of c x^n, and its coefficient."""
    lowest = min((order for order, _ in terms), default=math.inf)
    return lowest, sum(value for order, value in terms if order == lowest)


def _real_gain(A: complex, B: complex) -> float:
    """The real gain g of A + g B = 0 where A and B are real; inf where there is none."""
    return float(-A.real / B.real) if abs(B.real) > NO_EFFECT * abs(A.real) else math.inf


# ------------------------------------------------------------ windows


def stable_windows(loop: Sampled, name: str) -> list[Window]:
    """Every open interval of one number of the law in which the loop is stable, the others as they are, as its poles
    confirm."""
    found = number_crossings(circle_grid(loop), name, loop.row)
    return confirmed(found, -math.inf, math.inf, lambda value: loop.having(**{name: value}).poles.is_stable)


def stable_factors(loop: Sampled) -> list[Window]:
    """Every open interval of positive factors on the law in which the loop is stable, as its poles confirm."""
    return confirmed(crossing_factors(loop), 0.0, math.inf, lambda factor: loop.times(factor).poles.is_stable)


def around(windows: list[Window], gain: float) -> Window | None:
    """The window that a gain lies in."""
    return next((window for window in windows if window[0] < gain < window[1]), None)
