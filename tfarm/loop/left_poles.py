"""Poles of a band to the left of a line, which decay within a sample or accumulate at -1/C: bound and response.

With the letters of `loop.circle` their part of a pulse transfer function is, by Cauchy,

    x sum of (r/p) a/(z - b) = x/(2 pi i) times the integral over the edge of  g(s)/(z - e^{sT}) ds,
    g(s) = G(s)/s e^{s (1-f) T}

1/(z - e^{sT}) is the sum of e^{skT} z^-(k+1), so that it is x times the sum of m_k z^-(k+1), the moments

    m_k = 1/(2 pi i) times the integral over the edge of  g(s) e^{skT} ds = sum of (r/p) a b^k

The edge has the line Re s = -c, on which e^{sT} is largest, so that the moments fall as e^{-ckT}.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tfarm.arrays import Complex, Real
from tfarm.loop.sampled import Sampled


class LeftResponse(NamedTuple):
    """Moments m_k (outputs, k) of the poles left of a line, and a bound (outputs,) on x times what these leave out."""

    moments: Real
    error: Real


def bound_left_of(loop: Sampled, line: float, top: float) -> Real | None:
    """Return the bound on all poles of the band left of the line; None where the integral does not converge."""
    sampling = loop.chain.sampling

    def sizes(s: Complex) -> Real:
        decay = np.exp(s.real * sampling.remaining) / -np.expm1(s.real * sampling.period)
        return abs(_filtered(loop, s) / s) * decay

    line_ends, top_ends = _panels(loop, line, top)
    up = _bound_integral(lambda w: sizes(-line + 1j * w), line_ends)
    away = _bound_integral(lambda c: sizes(-c + 1j * top), top_ends)
    if up is None or away is None:
        return None
    return (up + away) * (2 / np.pi)


def left_response(loop: Sampled, line: float, top: float) -> LeftResponse:
    """Return the moments of the poles of the band left of the line, with twice the change by the last halving.

    Quadratures by midpoints are halved until they change by 1e-5 of the bound, nine times at most.
    """
    most_halvings = 9
    tolerance = 1e-5
    # e^-30 = 1e-13 is left
    most_moments = 400
    T = loop.chain.sampling.period
    k = np.arange(min(most_moments, math.ceil(30.0 / (line * T))))
    bound = bound_left_of(loop, line, top)
    assert bound is not None
    line_ends, top_ends = _panels(loop, line, top)

    def integral(s: Complex, widths: Real) -> Complex:
        g = _filtered(loop, s) / s * np.exp(s * loop.chain.sampling.remaining)
        return np.asarray((g * widths) @ np.exp(np.multiply.outer(s, k * T)))

    moments = np.zeros((bound.size, k.size))
    change = bound
    for _ in range(most_halvings):
        line_middles, top_middles = ((ends[1:] + ends[:-1]) / 2 for ends in (line_ends, top_ends))
        up = integral(-line + 1j * line_middles, np.diff(line_ends))
        away = integral(-top_middles + 1j * top, np.diff(top_ends))
        # both halves of the edge, which are conjugate
        before = moments
        moments = (up.real - away.imag) / np.pi
        change = abs(moments - before).sum(axis=1)
        if (change <= tolerance * bound).all():
            break
        line_ends = np.sort(np.r_[line_ends, line_middles])
        top_ends = np.sort(np.r_[top_ends, top_middles])
    # of x, at most
    longest = 2.0
    return LeftResponse(moments, longest * 2 * change + bound * math.exp(-line * T * k.size))


def _filtered(loop: Sampled, s: Complex) -> Complex:
    """Return the exact transfer functions (outputs, n) to the signals behind the anti-alias filter."""
    analog = np.array(loop.rig.analog)[:, None]
    antialias = np.where(analog, 1 / (1 + s / loop.chain.sampling.antialias_corner), 1.0)
    return np.asarray(loop.rig.exact(s) * antialias)


def _panels(loop: Sampled, line: float, top: float) -> tuple[Real, Real]:
    """Return the ends of panels up the line, by Im s, and along the top, by -Re s."""
    remaining = loop.chain.sampling.remaining
    # the first panel up the line is ten times finer than its distance from the axis
    up = _panel_ends(line / 10, top)
    # along the top from 0.01 of 1/remaining on, until e^-45 = 3e-20 is left
    return up, line + _panel_ends(0.01 / remaining, 45.0 / remaining)


def _panel_ends(first: float, last: float) -> Real:
    """Return the ends of panels from 0 to `last`, geometric from `first` on."""
    # panels are halved where quadratures differ: their number is time alone
    return np.r_[0.0, np.geomspace(min(first, last / 2), last, 40)]


def _bound_integral(size: Callable[[Real], Real], ends: Real) -> Real | None:
    """Return the bound (outputs,) on the integral of an absolute value; None where it does not converge.

    It is the larger of two quadratures by midpoints, halved until they differ by a tenth of it at most, and a fifth
    on top.
    """
    difference = 0.1
    before: Real | None = None
    # a quadrature for which that is not enough has not converged
    while ends.size < 200_000:
        middles = (ends[1:] + ends[:-1]) / 2
        values = size(middles) @ np.diff(ends)
        if before is not None:
            larger = np.maximum(values, before)
            if (abs(values - before) <= difference * larger).all():
                return larger * (1 + 2 * difference)
        before = values
        ends = np.sort(np.r_[ends, middles])
    return None


def filter_bound(loop: Sampled, line: float) -> Real:
    """Return the bound on the error of the filter's own pole: its residue is the model's at -wc, not the arm's."""
    sampling = loop.chain.sampling
    plant = loop.plant
    corner = sampling.antialias_corner
    # then none of the kept poles is it, and the integral has it right
    if corner >= line or not any(loop.rig.analog):
        return np.zeros(len(loop.rig.analog))
    residues = plant.residues[:, plant.mode.size - 1]
    arm = loop.rig.exact(np.array([-corner + 0j]))[:, 0]
    wrong = np.where(residues == 0, 0.0, abs(residues / corner - arm))
    left = sampling.period * corner
    return wrong * np.exp(-left * (1 - sampling.fraction)) * 2 / (1 + np.exp(-left))
