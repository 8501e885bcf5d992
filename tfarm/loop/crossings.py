"""Where branches of a locus cross the imaginary axis: solved for gain and frequency together, not interpolated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tfarm.arm import GAINS
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import loop_parts, quick_characteristics, torque
from tfarm.exact.outputs import OUTPUTS
from tfarm.response.frequency import AXIS_SHARE

from .variation import Evaluator, Variation

AT_ORIGIN = 1e-9  # of the largest of its branch: a pole so near to 0 is there but for the last step of its correction
NEAR_ZERO = 1e-50  # of the lowest frequency: where D is taken for its value at s = 0
CROSSING_SETTLED = 1e-6  # of the distance of two points: a crossing must be known so well at least
CROSSING_STEP = 1e-5  # of a frequency, or of the distance of two gains, for differences
CROSSING_STEPS = 30  # of Newton's method, at most: linear convergence at a double root leaves 1e-9
ODD = np.array([OUTPUTS[gain.output].power % 2 == 1 for gain in GAINS])  # powers of s: imaginary on the axis
CROSSING_HALVINGS = (0, 4, 12)  # of the distance of two points, before Newton's method is tried
GAIN_KNOWN = 1e-17  # of the larger end of a bracket: a gain at which a pole is at 0 is known so closely, next to 0 too
CROSSINGS_TOLD = 3  # of a locus in words
LEAST_RTOL = 4 * float(np.finfo(float).eps)  # that SciPy's brentq takes


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchCrossing:
    """One branch of a locus crosses the imaginary axis at s = i `omega` [rad/s], where what varies is `gain`.

    `omega` is 0 or infinite where a real pole goes through the origin or through infinity.  `branch` is its number in
    the locus, None for a pole on none of them, or between two points; `direction` is "unstable" where the real part
    becomes positive as the locus runs, and "stable" where it becomes negative.
    """

    gain: float
    omega: float
    branch: int | None
    direction: str

    @property
    def frequency_hz(self) -> float:
        """omega in Hz."""
        return self.omega / (2 * math.pi)


def in_words(vary: str, crossings: Sequence[BranchCrossing]) -> str:
    """Where poles cross the imaginary axis as one number varies, the first `CROSSINGS_TOLD` of them."""
    if not crossings:
        return "no branch crosses the imaginary axis"
    told = ", ".join(f"{each.direction} at {vary} = {each.gain:.6g}" for each in crossings[:CROSSINGS_TOLD])
    more = len(crossings) - CROSSINGS_TOLD
    return f"a pole becomes {told}{f' and {more} more' if more > 0 else ''}"


def crossing_answers(found: Iterable[BranchCrossing]) -> list[dict[str, Any]]:
    """The crossings as plain dictionaries."""
    return [
        {
            "gain": each.gain,
            "omega_rad_s": each.omega,
            "frequency_hz": each.frequency_hz,
            "branch": each.branch,
            "direction": each.direction,
        }
        for each in found
    ]


def branch_crossings(variation: Variation, gain: Real, branches: Complex, lowest: float) -> tuple[BranchCrossing, ...]:
    """All changes of sign of Re s between neighbours of the sampled branches, in the order in which they come.

    Neighbours are on both sides of the axis, points on it left out; or one is on it at i w, and one real and off it.
    The mirror image of a branch that is listed, with Im s < 0, is left out.  Raises ConvergenceError where a crossing
    cannot be solved for.
    """
    size = abs(branches)
    on_axis = (abs(branches.real) <= AXIS_SHARE * size) | (size <= AT_ORIGIN * np.fmax.reduce(size, axis=1)[:, None])
    side = np.where(on_axis | np.isnan(branches), 0, np.sign(branches.real)).astype(int)
    found = []
    for number, (sides, zeros) in enumerate(zip(side, branches, strict=True)):
        across = [(a, b) for a, b in pairwise(np.flatnonzero(sides)) if sides[a] != sides[b]]
        left = np.flatnonzero((sides[:-1] == 0) & (sides[1:] != 0))
        away = [(n, n + 1) for n in left if zeros[n].imag > 0 == zeros[n + 1].imag]
        listed = ((a, b) for a, b in sorted({*across, *away}) if zeros[a].imag >= 0 <= zeros[b].imag)
        for low, high in listed:
            at, omega = _solved(variation, gain[[low, high]], zeros[[low, high]], lowest)
            direction = "unstable" if sides[high] > 0 else "stable"
            found.append(BranchCrossing(gain=at, omega=omega, branch=number, direction=direction))
    way = np.sign(gain[-1] - gain[0])
    return tuple(sorted(found, key=lambda each: (way * each.gain, each.omega)))


def _solved(variation: Variation, gains: Real, zeros: Complex, lowest: float) -> tuple[float, float]:
    """The gain and the frequency at which a branch between two of its points is on the axis."""
    if (zeros.imag == 0).any():
        at = _through_origin(variation, gains, lowest)
        if at is not None:
            return at, 0.0
    for halvings in CROSSING_HALVINGS:
        ends, points = _halved(variation, gains, zeros, halvings)
        share = points.real[0] / (points.real[0] - points.real[1])
        g, w = float(ends[0] + share * (ends[1] - ends[0])), float((points[0] + share * (points[1] - points[0])).imag)
        try:
            g, w, step = _newton(variation, g, w, gains)
        except np.linalg.LinAlgError:
            continue
        if step < CROSSING_SETTLED and w > 0:
            return g, w
    raise ConvergenceError(f"a crossing of the imaginary axis near {gains.mean():.6g} could not be solved", g, w)


def _newton(variation: Variation, g: float, w: float, gains: Real) -> tuple[float, float, float]:
    """Gain and frequency by Newton's method between two gains, and its last step as a share of their distance or w.

    D(i w; g) = 0 is one complex equation in two real unknowns, its slopes from differences; LinAlgError if that has no
    solution.
    """
    low, high = float(gains.min()), float(gains.max())
    step, width = math.inf, high - low
    for _ in range(CROSSING_STEPS if w > 0 else 0):
        dg, dw = CROSSING_STEP * width, CROSSING_STEP * w
        up, down = min(g + dg, high), max(g - dg, low)
        values = _on_axis(variation, np.array([g, g, g, up, down]), np.array([w, w + dw, w - dw, w, w]))
        by_omega, by_gain = (values[1] - values[2]) / (2 * dw), (values[3] - values[4]) / (up - down)
        matrix = np.array([[by_gain.real, by_omega.real], [by_gain.imag, by_omega.imag]])
        dg, dw = np.linalg.solve(matrix, [values[0].real, values[0].imag]).tolist()
        g, w = min(max(g - dg, low), high), w - dw
        last, step = step, max(abs(dg) / width, abs(dw) / abs(w))
        if step == 0 or (step < CROSSING_SETTLED and step >= last / 2):
            break
    return g, w, step


def _halved(variation: Variation, gains: Real, zeros: Complex, times: int) -> tuple[Real, Complex]:
    """The two points brought nearer to each other, on both sides of the axis, by following the branch between them."""
    ends, points = gains.copy(), zeros.copy()
    for _ in range(times):
        middle, s = ends.mean(), points.mean(keepdims=True)
        here = Evaluator(variation, np.array([middle]))
        for _ in range(CROSSING_STEPS):
            value, slope, _ = here(s, np.zeros(1, int), variation.zeros_at_origin)
            s = s - value / slope
        side = int(np.sign(s.real[0]) == np.sign(points.real[1]))
        ends[side], points[side] = middle, s[0]
    return ends, points


def _on_axis(variation: Variation, gains: Real, omega: Real) -> Complex:
    """D(i w; g) for each gain and frequency, all on the scale of the first.

    Without losses drive and numerators are real there, or imaginary with an odd power of s, and what rounding adds is
    taken off: then Im D is that of the rate gain alone, and the crossings that theorems put at 0 and 1 come out to the
    last digit.
    """
    values, base = np.empty(omega.size, complex), 0.0
    for n, (gain, w) in enumerate(zip(gains, omega, strict=True)):
        k, law = variation.system(float(gain))
        drive, numerators, scale = (part[..., 0] for part in loop_parts(k, np.array([1j * w])))
        turn = np.exp(1j * scale.imag)
        drive, numerators = drive * turn, numerators * turn
        if k.is_real_on_axis:
            drive, numerators = drive.real, np.where(ODD, 1j * numerators.imag, numerators.real)
        base = base if n else float(scale.real)
        values[n] = (drive + torque(law[:, 0], numerators)) * np.exp(scale.real - base)
    return values


def _through_origin(variation: Variation, gains: Real, lowest: float) -> float | None:
    """The gain at which D/s^n vanishes at s = 0, n zeros being there always; None if it keeps its sign."""
    from scipy.optimize import brentq

    n, s = variation.zeros_at_origin, np.array([NEAR_ZERO * lowest, -NEAR_ZERO * lowest], complex)

    def at_origin(gain: float) -> float:
        k, law = variation.system(gain)
        value, _, scale = quick_characteristics(k, s, law, n)
        return float((value * np.exp(1j * scale.imag)).real.mean())

    ends = [at_origin(float(gain)) for gain in gains]
    if ends[0] * ends[1] > 0:
        return None
    if 0 in ends:
        return float(gains[ends.index(0)])
    low, high = float(gains.min()), float(gains.max())
    return float(brentq(at_origin, low, high, xtol=GAIN_KNOWN * max(-low, high), rtol=LEAST_RTOL))
