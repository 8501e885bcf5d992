"""Where branches of a locus cross the imaginary axis: solved for gain and frequency together, not interpolated."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import quick_characteristic

from .variation import Complex, Evaluator, Real, Variation

ON_AXIS = 1e-12  # a real part below this share of a zero's size is none, to working precision
NEAR_ZERO = 1e-7  # of the lowest frequency: where D is taken for its value at s = 0
STEPS = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchCrossing:
    """One crossing of the imaginary axis, or one departure from it: what varies is `gain` there, s = +-i `omega`.

    `branch` is its number in the locus; `direction` is "unstable" where the real part becomes positive as the locus
    runs, and "stable" where it becomes negative.
    """

    gain: float
    omega: float
    branch: int
    direction: str

    @property
    def frequency_hz(self) -> float:
        """omega in Hz."""
        return self.omega / (2 * math.pi)


def crossings(variation: Variation, gain: Real, branches: Complex, lowest: float) -> tuple[BranchCrossing, ...]:
    """All changes of sign of Re s between neighbours of the sampled branches, in the order in which they come.

    Raises ConvergenceError where one cannot be solved for.
    """
    side = np.where(abs(branches.real) <= ON_AXIS * abs(branches), 0, np.sign(branches.real)).astype(int)
    found = []
    for number, (sides, zeros) in enumerate(zip(side, branches, strict=True)):
        for low, high in _changes(sides, zeros):
            if zeros[high].imag < 0:
                continue  # the mirror image of a branch that is listed
            at, omega = _solved(variation, gain[[low, high]], zeros[[low, high]], lowest)
            direction = "unstable" if sides[high] > 0 else "stable"
            found.append(BranchCrossing(gain=at, omega=omega, branch=number, direction=direction))
    way = np.sign(gain[-1] - gain[0])
    return tuple(sorted(found, key=lambda each: (way * each.gain, each.omega)))


def _changes(sides: np.ndarray, zeros: Complex) -> list[tuple[int, int]]:  # type: ignore[type-arg]
    """Neighbours on both sides of the axis, points on it between them left out; or on it at i w, then real and off it."""
    off = np.nonzero(sides)[0]
    pairs = [(int(a), int(b)) for a, b in itertools.pairwise(off) if sides[a] != sides[b]]
    for n in range(1, sides.size):
        a, b = zeros[n - 1], zeros[n]
        if (sides[n - 1] == 0 != sides[n]) and a.imag > 0 == b.imag:
            pairs.append((n - 1, n))
    return pairs


def _solved(variation: Variation, gains: Real, zeros: Complex, lowest: float) -> tuple[float, float]:
    """The gain and the frequency at which a branch between two of its points is on the axis."""
    if (zeros.imag == 0).all() or (zeros.imag[1] == 0 and zeros.real[0] == 0):
        return _through_origin(variation, gains, lowest), 0.0
    share = zeros.real[0] / (zeros.real[0] - zeros.real[1])
    g, w = float(gains[0] + share * (gains[1] - gains[0])), float((zeros[0] + share * (zeros[1] - zeros[0])).imag)
    width = abs(gains[1] - gains[0])
    step = math.inf
    for _ in range(STEPS):
        dg, dw = _newton_step(variation, g, w, width)
        g, w = g - dg, w - dw
        last, step = step, max(abs(dg) / width, abs(dw) / abs(w))
        if step == 0 or (step < 1e-11 and step >= last / 2):
            break
    if not (gains.min() - 1e-9 * width <= g <= gains.max() + 1e-9 * width and step < 1e-9 and w > 0):
        raise ConvergenceError(f"a crossing of the imaginary axis near {gains.mean():.6g} could not be solved", g, w)
    return g, w


def _newton_step(variation: Variation, g: float, w: float, width: float) -> tuple[float, float]:
    """Newton's step for D(i w; g) = 0, a complex equation in two real unknowns."""
    h = 1e-5 * width
    at = Evaluator(variation, np.array([g, g + h, g - h]))
    value, slope, scale = at(np.full(3, 1j * w), np.arange(3), variation.zeros_at_origin)
    value = value * np.exp(scale - scale[0])
    by_gain, by_omega = (value[1] - value[2]) / (2 * h), 1j * slope[0]
    matrix = np.array([[by_gain.real, by_omega.real], [by_gain.imag, by_omega.imag]])
    try:
        dg, dw = np.linalg.solve(matrix, [value[0].real, value[0].imag])
    except np.linalg.LinAlgError:
        raise ConvergenceError(f"a branch touches the imaginary axis near {g:.6g}, {w:.6g} rad/s", g, w) from None
    return float(dg), float(dw)


def _through_origin(variation: Variation, gains: Real, lowest: float) -> float:
    """The gain at which D/s^n vanishes at s = 0, n zeros being there always."""
    from scipy.optimize import brentq

    n, s = variation.zeros_at_origin, NEAR_ZERO * lowest * np.array([1.0, -1.0], complex)

    def at_origin(gain: float) -> float:
        loop = variation.at(gain)
        value, _, scale = quick_characteristic(loop.k, s, loop.gains, n)
        return float((value * np.exp(1j * scale.imag)).real.mean())

    return float(brentq(at_origin, *sorted(gains), xtol=1e-300, rtol=4 * np.finfo(float).eps))
