"""Poles and zeros: by a count where the spectrum is real, by a winding number where it is not."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Complex
from tfarm.exact.characteristic import Analytic, characteristic, deflated, off_rest
from tfarm.exact.layout import constant_of
from tfarm.exact.outputs import Output
from tfarm.exact.series import order_at_zero
from tfarm.exact.system import System, system_of
from tfarm.exact.values import free_slopes
from tfarm.records import record
from tfarm.spectrum import flexible_frequencies
from tfarm.spectrum.box import REAL_SHARE, Box, Function, complete
from tfarm.spectrum.complete_box import TOWARD_SINGULAR


@dataclass(frozen=True, slots=True)
@record
class Roots:
    """Poles or zeros `values` [1/s], with multiplicity, ascending in |Im s|: all there are in `box`.

    `box` is (re_min, re_max, im_min, im_max); `proof` says how completeness is known: "count", "winding number" or
    "constant" (an end condition holds the output: none but at 0).
    """

    values: Complex
    box: tuple[float, float, float, float]
    proof: str


def poles_of(arm: Arm, up_to: float) -> Roots:
    """The poles of every transfer function of the arm with |Im s| <= up_to."""
    k = system_of(arm)
    if arm.is_undamped:
        return _on_axis(flexible_frequencies(arm, up_to), k.at_rest, up_to)
    return _in_box(k, lambda s: characteristic(k, s, at_zero=k.at_rest), k.at_rest, up_to, _damped_starts(arm, up_to))


def zeros_of(arm: Arm, wanted: Output, up_to: float, x: float) -> Roots:
    """The zeros of one output with |Im s| <= up_to; x is a share of the length, for outputs along the arm.

    One that its end condition holds constant has none but those of its power of s (at the tip: 0 throughout has none).
    """
    share = wanted.share(x)
    k = system_of(arm)
    constant = constant_of(k, wanted, share)
    if constant is not None:
        at_zero = wanted.power if constant else 0
        return Roots(np.zeros(at_zero, complex), (-math.inf, math.inf, -up_to, up_to), "constant")
    order, numerator = _numerator(k, wanted, x)
    at_zero = max(0, order + wanted.power - k.at_rest)
    neighbours = {("theta", "root"): math.inf, ("M", "root"): 0.0 if arm.is_uniform else None}
    neighbour = neighbours.get((wanted.quantity, wanted.place))
    other = arm if neighbour is None else arm.having(hub_inertia=neighbour)
    if neighbour is not None and arm.is_undamped:
        return _on_axis(flexible_frequencies(other, up_to), at_zero, up_to)
    starts = _starts_by_sampling(numerator, up_to) if neighbour is None else _damped_starts(other, up_to)
    return _in_box(k, numerator, at_zero, up_to, starts)


def _on_axis(frequencies: NDArray[np.float64], at_zero: int, up_to: float) -> Roots:
    pairs = np.repeat(1j * frequencies, 2)
    pairs[1::2] *= -1
    return Roots(np.r_[np.zeros(at_zero, complex), pairs], (-math.inf, math.inf, -up_to, up_to), "count")


def _damped_starts(arm: Arm, up_to: float) -> Complex:
    """First-order estimates s = -C w^2/2 +- i w sqrt(1 - (C w/2)^2) from the undamped frequencies."""
    omega, C = flexible_frequencies(arm, 1.5 * up_to), arm.damping
    root = np.sqrt((1 - (C * omega / 2) ** 2).astype(complex))
    starts = np.r_[omega * (-C * omega / 2 + 1j * root), omega * (-C * omega / 2 - 1j * root)]
    return np.r_[starts, np.linspace(-up_to, -up_to / 50, 40)]


def _starts_by_sampling(numerator: Function, up_to: float) -> Complex:
    """Dips of the numerator along the imaginary and the real axis."""
    line = np.r_[np.geomspace(1e-4 * up_to, up_to, 400), np.linspace(0.01 * up_to, up_to, 1600)]
    line.sort()
    starts = []
    for direction in (1j, 1.0, -1.0):
        at = numerator(direction * line)
        size = abs(at.value)
        dips = np.nonzero((size[1:-1] < size[:-2]) & (size[1:-1] < size[2:]))[0] + 1
        starts.append(direction * line[dips])
    found = np.concatenate(starts)
    return np.r_[found, found.conj(), -found, -found.conj()]


def _numerator(k: System, wanted: Output, x: float) -> tuple[int, Function]:
    """How often an output over its power of s vanishes at s = 0, and the function without these zeros."""
    base = replace(wanted.base, gauge=False)
    order = order_at_zero(k, base, x)

    def function(s: Complex) -> Analytic:
        s = off_rest(s)
        here, slopes = free_slopes(k, [base], s, x)
        return deflated(here.outputs[0], slopes.outputs[0], here.scale, s, order)

    return order, function


def _in_box(k: System, function: Function, at_zero: int, up_to: float, starts: Complex) -> Roots:
    """Zeros of the quantity in a box of that height; the box grows a little where a zero lies on its edge."""

    def box_of(height: float) -> Box:
        return Box(-min(TOWARD_SINGULAR / k.damping, height) if k.damping else -height, height, -height, height)

    found, box = complete(function, box_of, up_to, starts)
    if k.is_undamped:  # zeros come in +- pairs too
        found = np.where(abs(found.real) < REAL_SHARE * abs(found), 1j * found.imag, found)
    found = found[np.lexsort((-found.imag, found.real.round(9), abs(found.imag).round(9)))]
    return Roots(np.r_[np.zeros(at_zero, complex), found], (*box,), "winding number")
