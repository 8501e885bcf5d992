"""Nyquist's criterion on the loop function: encirclements of -1 counted and compared with the poles found.

The contour runs up the imaginary axis, passes each pole of L on it by a small semicircle on the right, and closes along
the edges of the box in which the verdict's poles were counted.  L is evaluated on all of it, so the encirclements of -1
are counted.  Clockwise ones are closed-loop poles inside the contour, as no pole of L is in there.

Around the unit circle s = ln(z)/T runs up the axis to half the sampling rate, and passes poles outside the circle.
There the contour is closed: L is real from z = -1 to infinity and back to z = 1.
"""

import math
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.loop.continuous import frequency_above_mode
from tfarm.loop.curve import LoopContour, LoopVerdict
from tfarm.loop.loop import Loop
from tfarm.loop.stability import Stability, stability
from tfarm.records import frozen
from tfarm.response.frequency import AXIS_SHARE
from tfarm.schema import At, Quantity
from tfarm.spectrum.box import argument_change


@frozen
class Nyquist:
    """L on the contour for Im s >= 0: `s` (n,), `L` (n,), `is_arc` where the contour passes a pole on the axis.

    `poles` [rad/s] are those of L on the axis, `encirclements` of -1 by the whole contour, counter-clockwise positive,
    `verdict` that by the poles, counted in a box without this contour.  `unstable_open` poles of L lie inside the
    contour: those of a law that is not stable by itself.
    """

    s: Annotated[Complex, Quantity("s", "1/s", curve=True, help="points of the contour with Im s >= 0")]
    L: Annotated[Complex, Quantity("L", curve=True, help="loop function at these points")]
    is_arc: NDArray[np.bool_]
    poles: Real
    encirclements: Annotated[int, Quantity("encirclements of -1", help="counter-clockwise positive")]
    # any `LoopVerdict`
    verdict: Annotated[Stability | Any, Quantity(flat=True)]
    unstable_open: Annotated[
        int, Quantity("unstable poles of L", help="controller's poles inside the contour")
    ] = 0

    @property
    def on_axis(
        self,
    ) -> Annotated[
        int,
        Quantity(
            "poles on the axis to working precision",
            help="closed-loop poles with |Re s| < 1e-12 |s|, not at 0",
        ),
    ]:
        """Number of poles on the axis to working precision, apart from that at 0."""
        return self.verdict.contour.near_axis

    @property
    def unstable_by_nyquist(
        self,
    ) -> Annotated[
        int,
        Quantity(
            "unstable poles by Nyquist's criterion",
            help="unstable poles of L less the encirclements of -1",
        ),
    ]:
        """Unstable closed-loop poles by Nyquist's criterion."""
        return self.unstable_open - self.encirclements

    @cached_property
    def sensitivity_peak(self) -> At | None:
        """The loop's own Ms with its frequency; None of an unstable loop."""
        band = self.verdict.in_band
        return None if band is None else band.sensitivity_peak


def nyquist(arm: Arm, law: AnyLaw) -> Nyquist:
    """Return the loop function of a law on Nyquist's contour, its encirclements of -1 counted up to the verdict's band.

    Raises as `stability` does, and ConvergenceError where the curve passes too near to -1 for them to be counted, or
    where the two counts differ.
    """
    return nyquist_of(stability(Case(arm, law)))


def nyquist_of(verdict: LoopVerdict) -> Nyquist:
    """Return the same for a verdict on either curve: both counts have one region."""
    loop = verdict.full
    contour = verdict.contour
    s, is_arc = smooth(loop, *upper_contour(loop, contour, verdict.margins_end))
    path = np.r_[s, contour.closing]
    angle = argument_change(lambda at: _difference(loop, at), path, float(abs(path).max()))
    encirclements = round(angle / math.pi)
    open_poles = contour.unstable_open
    plot = Nyquist(s, loop.loop_function(s), is_arc, contour.on_curve, encirclements, verdict, open_poles)
    counted = plot.unstable_by_nyquist
    least = min(contour.clear, contour.unstable)
    if not least <= counted <= least + contour.near_axis:
        text = (
            f"{counted} unstable poles by the encirclements of -1, {contour.unstable} by finding all in a box"
        )
        raise ConvergenceError(text, plot, counted - contour.unstable)
    return plot


def _difference(loop: Loop, s: Complex) -> Analytic:
    """Return 1 + L without its slope, as the contour is dense where it is steep."""
    return Analytic(1 + loop.loop_function(s), np.zeros_like(s), np.zeros_like(s))


def upper_contour(loop: Loop, contour: LoopContour, band: float) -> tuple[Complex, NDArray[np.bool_]]:
    """Return the contour from s = 0 (or right of a pole there) up the axis to the band, past each pole on its right.

    Each arc around a pole of L is smaller than its distance to the nearest closed-loop pole.  The radius is that where
    |L| is about 20, and at most a thousandth of the pole's frequency (at 0: of the first).
    """
    # radius of a semicircle around a pole of L, in units of its residue: |L| is about 20 on it
    indent_radius = 0.05
    # of the way to the nearest closed-loop pole: no arc around a pole of L leaves an unstable one out
    nearer = 0.1
    # points between that and the arm's own grid
    slow_points = 200
    # of a pole's frequency: so near to it L is the pole's share alone
    residue_at = 1e-6
    # of the same: the radius of an arc at most, so that it reaches no neighbour
    widest_indent = 1e-3
    # radii of such an arc: points of the axis on either side, a dozen a decade
    approach = np.geomspace(1.05, 1e3, 40)
    # rad, along a semicircle around a pole of L
    turns = np.linspace(-math.pi / 2, math.pi / 2, 41)
    poles = contour.on_curve
    pole = poles[:, None]
    omega = contour.grid
    is_resting = poles == 0
    scale = np.where(is_resting, frequency_above_mode(loop.arm, 1), poles)
    step = residue_at * scale
    near_pole = loop.loop_function(np.where(is_resting, step, 1j * (poles + step)))
    of_residue = indent_radius * step * abs(near_pole)
    away = abs(contour.closed - 1j * pole)
    nearest = np.where(away > AXIS_SHARE * pole, away, math.inf).min(axis=1, initial=math.inf)
    radius = np.minimum(np.minimum(of_residue, widest_indent * scale), nearer * nearest)[:, None]
    slow = np.geomspace(radius[0, 0], omega[0], slow_points) if is_resting.any() else omega[:0]
    axis = np.unique(np.r_[omega, slow, (pole + radius * np.r_[-approach, approach]).ravel()])
    axis = axis[(axis > 0) & (axis <= band) & (abs(axis - pole) > radius).all(axis=0)]
    arcs = (1j * pole + radius * np.exp(1j * turns)).ravel()
    arcs = arcs[arcs.imag >= 0]
    s = np.r_[1j * axis, arcs]
    is_arc = np.arange(axis.size + arcs.size) >= axis.size
    order = np.argsort(s.imag, kind="stable")
    return s[order], is_arc[order]


def smooth(loop: Loop, s: Complex, is_arc: NDArray[np.bool_]) -> tuple[Complex, NDArray[np.bool_]]:
    """Return the contour with more points on the axis where the drawn curve would have corners."""
    # of the rim's radius: the longest straight piece of a drawn curve
    longest_piece = 0.02
    # of halving where they are longer
    turn_rounds = 24
    for _ in range(turn_rounds):
        length = abs(np.diff(compress_radius(loop.loop_function(s))))
        (coarse,) = np.nonzero((length > longest_piece) & ~is_arc[1:] & ~is_arc[:-1])
        if not coarse.size:
            break
        s = np.insert(s, coarse + 1, (s[coarse] + s[coarse + 1]) / 2)
        is_arc = np.insert(is_arc, coarse + 1, False)
    return s, is_arc


def compress_radius(L: Complex) -> Complex:
    """Return L with its size r mapped to r/(1 + r): 1 is half-way, infinity is the rim, at a pole its point 1."""
    is_pole = np.isinf(abs(L))
    inside = np.where(is_pole, 1.0, L)
    return np.asarray(np.where(is_pole, 1.0, inside / (1 + abs(inside))))
