"""The rig and the law in z of a sampled loop, whatever the weights on the parts of that law.

    F(z) = q(z) + sum over parts of weight sum over signals of p_i(z) H_i(z)

is affine in the weights; `SampledRig.terms` has its terms.  On the upper half of the unit circle z = e^{iq} each
open-loop pole near the circle gives them a feature as narrow as its residue.  So the grid in q has points at geometric
distances around each, and the terms are computed without loss from the offset to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm.chain import Chain
from tfarm.arrays import Complex, Real, Whole
from tfarm.crossing import Steps
from tfarm.dsp.discretise import LawInZ, lowest_power, root_product, root_product_error
from tfarm.dsp.plant import Plant, is_analog
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import SensedPlant
from tfarm.records import frozen

# poles and roots nearer to z = 0 have no narrow feature on the circle
BRIGHT = 1e-2


@frozen
class SampledRig:
    """A rig at the samples of a chain, which has the law's delay too, and the parts of a law in z.

    `sensed` are the signals of the law, `in_z` its parts, with 1 for each plain gain.
    """

    sensed: SensedPlant
    chain: Chain
    in_z: LawInZ

    @cached_property
    def plant(self) -> Plant:
        """From the input to the signals of the law, through their filters."""
        return self.sensed.together

    @cached_property
    def pulse(self) -> PulseTransfer:
        """The pulse transfer functions to the signals of the law."""
        return PulseTransfer(self.plant, self.chain.sampling).without_fast_poles()

    @property
    def exact(self) -> Callable[[Complex], Complex]:
        """The exact transfer functions of the signals, at s (n,), without the filters."""
        return self.sensed.read.values

    @property
    def analog(self) -> tuple[bool, ...]:
        """Whether each signal passes the anti-alias filter."""
        return tuple(is_analog(each, self.chain) for each in self.sensed.read.outputs)

    @property
    def is_damped(self) -> bool:
        """Whether friction makes the turning hub a single integral of the input."""
        return bool(self.plant.model.arm.rate_loss)

    @cached_property
    def open_loop(self) -> Complex:
        """z - 1 of each pole of the plant, in the order of `PulseTransfer.poles`, and then of each of the law."""
        return np.r_[self.pulse.shifts, self.in_z.poles]

    @cached_property
    def grid(self) -> CircleGrid:
        """Points of the circle that resolve the terms."""
        return circle_grid(self)

    def terms(self, z: Complex, base: Whole | None, offset: Any) -> Complex:
        """Return rows (1 + parts, n): offset q, and of each part offset times its sum of p_i H_i.

        At z = e^{pT} + offset (n,), p the pole number `base`; of the law's poles, which are numbered after those of the
        plant, not times the offset.
        """
        z = np.asarray(z)
        more = 0.0
        at = base
        delta = None
        start = z - 1
        if base is not None:
            start = self.open_loop[base]
            more = offset
            is_of_law = base >= self.pulse.poles.size
            delta = start + offset
            at = np.where(is_of_law, -1, base)
            offset = np.where(is_of_law, 1.0, offset)
        measured = self.pulse.scaled_values(z, at, offset, delta)
        rows = np.zeros((1 + len(self.in_z.part_poles), z.size), complex)
        rows[0] = offset * root_product(start, self.in_z.poles, more)
        for part, row, gain, zeros in self.in_z.terms:
            rows[1 + part] += gain * root_product(start, zeros, more) * measured[row]
        return rows

    def rounding(self, weights: Real, base: Whole, offset: Complex) -> Real:
        """Return the bound (n,) on the rounding error of weights @ terms at such points: of the sizes of all terms."""
        start = self.open_loop[base]
        is_of_law = base >= self.pulse.poles.size
        scale = np.where(is_of_law, 1.0, offset)
        sizes = self.pulse.sizes(np.where(is_of_law, -1, base), scale, start + offset)
        error = abs(scale) * root_product_error(start, self.in_z.poles, offset)
        for part, row, gain, zeros in self.in_z.terms:
            error += abs(weights[1 + part] * gain) * root_product_error(start, zeros, offset) * sizes[row]
        return error

    def near_one(self, weights: Real) -> list[tuple[int, float]]:
        """Return the rows of `terms` times weights (1 + parts,), as (n, c) of c x^n at small x = 1 - 1/z, without 0."""
        found = [lowest_power(self.in_z.poles)] if weights[0] else []
        for part, row, gain, zeros in self.in_z.terms:
            weight = float(weights[1 + part] * gain)
            if not weight:
                continue
            n, value = lowest_power(zeros)
            power, own = self._signal_near_one(row)
            found.append((n + power, float(own * value * weight)))
        return found

    def _signal_near_one(self, row: int) -> tuple[int, float]:
        """Return (n, c) of c x^n, the pulse transfer function to a signal at small x."""
        plant = self.plant
        T = self.chain.sampling.period
        twice, once = plant.rigid[row]
        if twice:
            return -2, twice * T * T
        if once:
            return -1, once * T
        rest = plant.at_rest[row]
        size = abs(plant.static[row]) + abs(plant.residues[row] / plant.poles).sum()
        # 1e-11 of its terms: a static gain that is 0, summed over 400 modes
        if abs(rest) <= 1e-11 * size:
            return 1, self.pulse.slopes_at_one[row]
        return 0, rest

    @cached_property
    def frame(self) -> tuple[Real, Real]:
        """The matrix without feedback, and the column of the input."""
        A, B, C = self.pulse.matrices()
        own, Bk, _, _ = self.in_z.matrices
        return np.block([[A, np.zeros((len(A), len(own)))], [Bk @ C, own]]), np.r_[B, np.zeros(len(own))]


@frozen
class CircleGrid:
    """Points z = e^{iq}, 0 < q < pi, each as a pole `base` and an angle `shift` from it."""

    rig: SampledRig
    base: Whole
    shift: Real

    @cached_property
    def angles(self) -> Real:
        """The angle of each open-loop pole on the circle."""
        return np.angle(self.rig.pulse.multipliers).astype(np.float64)

    @cached_property
    def q(self) -> Real:
        """The angle of each point."""
        return self.angles[self.base] + self.shift

    @cached_property
    def terms(self) -> Complex:
        """The rig's `terms` (1 + parts, n), each times the offset of the point from its pole."""
        return self.at(self.base, self.shift)

    def steps(self, number: Whole) -> Steps:
        """Return the steps from the points of these numbers to the next, as angles from the pole of each."""
        # where the next point has another pole, both are as far away
        base = self.base[number]
        angles = self.angles[base]
        is_own = base == self.base[number + 1]
        high = np.where(is_own, self.shift[number + 1], self.q[number + 1] - angles)

        def terms_at(shift: Real, which: Whole) -> Complex:
            return self.at(base[which], shift)

        return Steps(self.shift[number], high, terms_at, angles)

    def at(self, base: Whole, shift: Real) -> Complex:
        """Return the rig's `terms` at other points."""
        pulse = self.rig.pulse
        decay = pulse.poles.real[base] * pulse.sampling.period
        offset = pulse.multipliers[base] * np.expm1(-decay + 1j * shift)
        return self.rig.terms(np.exp(1j * (self.angles[base] + shift)), base, offset)


def circle_grid(rig: SampledRig) -> CircleGrid:
    """Return the grid that resolves every pole of the plant and every pole and zero of the law, for any weights."""
    pulse = rig.pulse
    angles = np.angle(pulse.multipliers)
    bases = np.nonzero((angles >= 0) & (abs(pulse.multipliers) > BRIGHT))[0]
    bases = bases[np.argsort(angles[bases], kind="stable")]
    seams = np.r_[0.0, (angles[bases][1:] + angles[bases][:-1]) / 2, np.pi]
    base = []
    shift = []
    for pole, low, high in zip(bases, seams[:-1], seams[1:], strict=True):
        away = abs(pulse.poles.real[pole]) * pulse.sampling.period
        for edge in (low - angles[pole], high - angles[pole]):
            shift.append(geometric(abs(edge), away) * np.sign(edge))
            base.append(np.full(shift[-1].size, pole))
    roots = np.concatenate([rig.in_z.poles, *(zeros for *_, zeros in rig.in_z.columns)])
    extra = np.unique(np.concatenate([np.empty(0), *_angles_near(1 + roots)]))
    base.append(bases[np.searchsorted(seams[1:-1], extra)])
    shift.append(extra - angles[base[-1]])
    whole = CircleGrid(rig, np.concatenate(base), np.concatenate(shift))
    order = np.lexsort((whole.shift, np.searchsorted(seams, whole.q, side="left"), whole.q))
    # 0 of the last, the pole of an arm that drifts
    away = abs(1 - pulse.multipliers[bases])
    # nearer to z = 1 the rate of a held arm is rounding, and a gain on it would have to be 1e8 times too large
    still = 1e-8
    lowest = 0.0 if rig.plant.rigid.any() else still * away[away > 0].min(initial=1.0)
    inside = order[(whole.q[order] >= lowest) & (whole.q[order] < np.pi)]
    return CircleGrid(rig, whole.base[inside], whole.shift[inside])


def _angles_near(roots: Complex) -> Iterator[Real]:
    """Yield angles on the upper half of the circle at geometric distances from some roots."""
    # the upper of each pair
    for root in roots[(abs(roots) > BRIGHT) & (roots.imag >= 0)]:
        near = geometric(math.pi, abs(1 - abs(root)))
        q = abs(np.angle(root)) + np.r_[-near, near]
        yield q[(q > 0) & (q < math.pi)]


def geometric(edge: float, away: float) -> Real:
    """Return angles from a pole, from a hundredth of its distance from the circle to the seam with its neighbour.

    There are 48 points a decade, and those of a uniform grid of 2000 points over the half circle.
    """
    # 1e-17 rad: closer to a pole angles are not distinct
    nearest = max(1e-2 * away, 1e-17)
    if edge <= nearest:
        return np.array([edge / 2])[: int(edge > 0)]
    decades = np.log10(edge / nearest)
    near = np.geomspace(nearest, edge, max(2, int(48 * decades)), endpoint=False)
    even = np.arange(1, int(edge * 2000 / np.pi) + 1) * (np.pi / 2000)
    return np.union1d(near, even[even < edge])
