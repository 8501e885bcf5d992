"""The band of an arm in which a modal model holds every pole that outlives a sample, and what it leaves out.

To the right of a line Re s = -c and below Im s = top, the argument principle for the exact arm counts as many poles as
the model has there.  All others of the band lie left of the line, slow real ones near -1/C and all: by Cauchy they add

    x sum of (r/p) a/(z - b) = x/(2 pi i) times the integral over the edge of  G(s)/s e^{s (1-f) T}/(z - e^{sT}) ds

to a pulse transfer function (letters as in `circle`), the edge being that line and the two that lead from its ends to
Re s = -inf.  So its absolute values bound them on the whole unit circle.  Beyond the band nothing is known: there the
undamped shear of this model has poles as near to the imaginary axis as one likes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.dsp.circle import Circle
from tfarm.dsp.sampled import Sampled, resized
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum import modes
from tfarm.spectrum.box import Box, winding_number
from tfarm.spectrum.complete_box import TOWARD_SINGULAR
from tfarm.spectrum.damped import member

DECAYED_EXPONENT = 30.0  # e^-30 = 1e-13 is left over a sample of the poles on the line
HIGHER = (2.0, 8.0, 32.0, 128.0, 512.0)  # times the last pole of the model: how far up no other is looked for
ABOVE_MODEL = 1.02  # times the last pole of the model: the least height at which all of them are in the box
FINER = 10  # times finer than the distance of the line from the axis: the first panel up that line
NEAREST_LEFT, FARTHEST_LEFT = 0.01, 45.0  # of 1/remaining: panels along the top, until e^-45 = 3e-20 is left
PANEL_ENDS = 40  # of panels, that are halved where quadratures differ: time alone
SURE = 0.1  # by which two quadratures of an absolute value may differ; the larger counts, with as much again
MOST_MIDPOINTS = 200_000  # of a quadrature: one that does not settle by then is not had


@dataclass(frozen=True)
@record
class Band:
    """The poles of a loop's plant in a band up to `top` [rad/s], `kept` (poles,), and the bound `missing` (outputs,) on
    what the others of that band add to the pulse transfer functions, on the whole unit circle."""

    loop: Sampled
    top: float
    kept: NDArray[np.bool_]
    missing: Real

    @property
    def modes(self) -> int:
        """How many flexible modes lie in it, the first ones."""
        outside = self.loop.plant.mode[~self.kept & (abs(self.loop.plant.poles.imag) >= self.top)]
        return int(outside.min(initial=self.loop.plant.count + 1)) - 1

    @cached_property
    def full(self) -> Sampled:
        """The loop with all of them, or with one where there is none."""
        return resized(self.loop, max(1, self.modes))

    def circle(self) -> Circle:
        """The unit circle, on which poles outside are counted."""
        return Circle(self.loop, self.kept, self.missing)


def complete_band(loop: Sampled) -> Band | None:
    """The highest band in which the loop's plant is complete; None where it cannot be shown to be.

    Not without damping, nor with analog hub damping, whose poles the model has to its own accuracy alone.
    """
    plant, sampling = loop.plant, loop.chain.sampling
    C, remaining = plant.arm.damping, sampling.period * (1 - sampling.fraction)
    if C == 0.0 or loop.chain.actuator.hub_damping > 0.0:
        return None
    line = min(TOWARD_SINGULAR / C, DECAYED_EXPONENT / remaining)
    top = _highest(loop, line)
    missing = None if top is None else _left_of(loop, line, top)
    if top is None or missing is None:
        return None
    kept = (plant.poles.real > -line) & (abs(plant.poles.imag) < top)
    return Band(loop, top, kept, missing + _of_the_filter(loop, line))


def _highest(loop: Sampled, line: float) -> float | None:
    """The top of the highest box right of the line in which the exact arm has the plant's poles and no other."""
    plant, function = loop.plant, member(modes(loop.plant.arm, 1).system).function
    poles = np.r_[plant.poles[plant.mode > 0], plant.model.single]
    poles = poles[poles.real > -line]

    def is_complete(top: float) -> bool:
        box = Box(-line, line, -top, top)
        try:
            return winding_number(function, box) == int(box.holds(poles).sum())
        except ConvergenceError:
            return False

    heights = np.r_[0.0, np.sort(poles.imag[poles.imag > 0])]
    tops = np.r_[(heights[1:] + heights[:-1]) / 2, ABOVE_MODEL * heights[-1] or line]
    if is_complete(top := float(tops[-1])):
        for factor in HIGHER:
            if not is_complete(factor * tops[-1]):
                break
            top = float(factor * tops[-1])
        return top
    low, high = 0, tops.size - 1  # tops[low] may be complete, tops[high] is not
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_complete(float(tops[middle])) else (low, middle)
    return float(tops[low]) if is_complete(float(tops[low])) else None


def _left_of(loop: Sampled, line: float, top: float) -> Real | None:
    """The bound on all poles of the band left of the line; None where the integral cannot be had."""
    sampling, exact = loop.chain.sampling, loop.exact
    T, remaining = sampling.period, sampling.period * (1 - sampling.fraction)

    def sizes(s: Complex) -> Real:
        damped = np.exp(s.real * remaining) / -np.expm1(s.real * T)
        return abs(exact(s) * _filter_factors(loop, s) / s) * damped

    up = _integral(lambda w: sizes(-line + 1j * w), np.r_[0.0, _graded(line / FINER, top)])
    away = _integral(
        lambda c: sizes(-c + 1j * top), line + np.r_[0.0, _graded(NEAREST_LEFT / remaining, FARTHEST_LEFT / remaining)]
    )
    return None if up is None or away is None else (up + away) * (2 / np.pi) * (1 + 2 * SURE)


def _graded(first: float, last: float) -> Real:
    """Ends of panels from `first` to `last`, geometric."""
    return np.geomspace(min(first, last / 2), last, PANEL_ENDS)


def _integral(size: Callable[[Real], Real], ends: Real) -> Real | None:
    """The integral (outputs,) of an absolute value by midpoints, halved until it stays; None if it never does."""
    before: Real | None = None
    while ends.size < MOST_MIDPOINTS:
        values = size((ends[1:] + ends[:-1]) / 2) @ np.diff(ends)
        if before is not None and (abs(values - before) <= SURE * np.maximum(values, before)).all():
            return np.maximum(values, before)
        before, ends = values, np.sort(np.r_[ends, (ends[1:] + ends[:-1]) / 2])
    return None


def _filter_factors(loop: Sampled, s: Complex) -> Complex:
    """What the analog filter makes of each output: wc/(s + wc) or 1."""
    corner = loop.chain.sampling.antialias_corner
    if np.isinf(corner):
        return np.ones((len(loop.analog), 1), complex)
    return np.array([corner / (s + corner) if analog else np.ones(s.size) for analog in loop.analog])


def _of_the_filter(loop: Sampled, line: float) -> Real:
    """The bound on the error of the filter's own pole, whose residue has the model's value at -wc, not the arm's."""
    sampling, plant = loop.chain.sampling, loop.plant
    corner = sampling.antialias_corner
    if corner >= line or not any(loop.analog):  # then none of the kept poles is it, and the integral has it right
        return np.zeros(len(loop.analog))
    own = plant.mode.size - 1
    arm = loop.exact(np.array([-corner + 0j]))[:, 0]
    wrong = np.where(plant.residues[:, own] == 0, 0.0, abs(plant.residues[:, own] / corner - arm))
    left = sampling.period * corner
    return wrong * np.exp(-left * (1 - sampling.fraction)) * 2 / (1 + np.exp(-left))
