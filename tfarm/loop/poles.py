"""Closed-loop poles of the exact arm: zeros of a transcendental function, complete in a printed box.

No reduced model takes part.  Newton's method finds zeros from many starts, and the winding number of the characteristic
function around the box says how many there are (`spectrum.box`); where it disagrees the box is cut and searched again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np
from typing_extensions import TypeVar

from tfarm.arm import Arm, HubFeedback
from tfarm.arm.checks import whole
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.digits import DOUBLE_DIGITS
from tfarm.errors import CertificationError, ConvergenceError, ParameterError
from tfarm.exact.characteristic import Analytic, deflated, off_rest, zeros_at_origin
from tfarm.records import record
from tfarm.response.frequency import AXIS_SHARE
from tfarm.spectrum.box import TRIED_HEIGHTS, Box, complete
from tfarm.spectrum.complete_box import HEIGHTS_LEFT, RIGHT_OF_AXIS, TOWARD_SINGULAR
from tfarm.spectrum.enclose import Disc, disjoint, enclosed, proven_count

from .frequencies import band_of, steep_places
from .loop import Loop
from .lossless import driven_modes
from .plant import HubLoop, effective_inertia

MOST_POLES = 1000  # that may be asked for
USUAL_POLES = 10  # poles listed where no count is asked for
MOST_BOX_MODES = 4000  # flexible, below the highest box that is searched for as many poles as are asked for
SLOW_SHARE = 1e-6  # of a box's height: poles nearer to 0 are the rigid arm's, and known beforehand
SLOW_STEPS = 4  # of Newton's method from there
NEAR_RIGID = 0.01  # of its size: how far it may be from the rigid arm's
LEAST_SQUARABLE = 1e-140  # 1/s: whose square is still a full double
AnyLoop = TypeVar("AnyLoop", bound=HubLoop | Loop, default=HubLoop)  # hub gains, unless another law is said
LEAST_REAL_PART = -0.5  # of L, so that 1 + L has no zero
RIGHT_OF_EDGE = (2.0, 5.0, 20.0)  # times the right edge of a box, where L is looked at again
FAR_RIGHT, BEYOND_CORNER = 1e5, 10.0  # times that edge, and a law's fastest corner: so far a real pole is looked for
FAR_POINTS = 41  # of the real axis up to there, on which 1 + L is smooth
RIGHT_GROWS = 1.7  # times, from one right edge that is tried to the next: of effect on the time alone
RIGHT_POINTS = 40  # of half a right edge under gains, where Re L is looked at: far from any pole of L, it is smooth
GAINS_RIGHT = 1e3  # heights that a box reaches right under gains, at most: there the search for its edge ends
# Starts of Newton's method: the winding number says what they missed, so that they bear on the time alone.
STARTS_REACH = 1.3  # heights of the box: modes of the arm up to there, as a law may draw their poles down into it
DAMPED_BY_LAW = (0.0, 0.02, 0.3)  # of its frequency: how far left of a mode's own pole a law may have moved it
REAL_STARTS, REAL_SPAN, REAL_REACH = 25, 300, 1.4  # on the real axis: so many, from height/300 to 1.4 heights
SOME_INERTIA = 1e-12  # kg m^2, of a hub that has none: the rigid arm's polynomial keeps its degree
SHRUNK_HEIGHTS = tuple(1 / factor for factor in TRIED_HEIGHTS)  # of a box that may not reach above the shear cut-off


def count_with_mirrors(zeros: Complex) -> int:
    """How many zeros these with Im s >= 0 stand for, conjugates counted."""
    return int(np.where(zeros.imag > 0, 2, 1).sum())


@dataclass(frozen=True)
@record
class Poles(Generic[AnyLoop]):
    """Closed-loop poles [1/s] with Im >= 0, ascending in Im, those at 0 as often as they are: all there are in `box`.

    A real pole is listed as often as its order, an oscillating one stands for its conjugate too.
    `ends_at_shear_cutoff` says that the box ends at sqrt(kappa G A/(rho I)), since no more poles lie below it: those
    above are of shear, and undamped but for the little that bending takes.
    """

    loop: AnyLoop
    values: Complex
    box: Box
    ends_at_shear_cutoff: bool = False

    @property
    def unstable(self) -> int:
        """How many poles of the box, conjugates counted, lie to the right of the axis.

        A real part below working precision decides nothing, but at C = 0 a theorem does (`HubLoop.takes_energy`,
        `driven_modes`).
        """
        right = self.values.real > AXIS_SHARE * abs(self.values)
        if isinstance(self.loop, Loop):  # of which no theorem on gains at the hub tells anything
            return count_with_mirrors(self.values[right])
        loop = self.loop.freed
        if loop.arm.is_undamped and loop.is_told_by_theorem and loop.takes_energy < 0:
            right |= (self.values.imag > 0) & (abs(self.values.real) <= AXIS_SHARE * abs(self.values))
        on_rate, on_moment = loop.law.point
        if loop.is_reactive and not loop.is_told_by_theorem and on_rate > 0:
            driven = driven_modes(loop.arm, on_moment)
            return max(count_with_mirrors(self.values[right]), 2 * int((driven.at < self.box.im_max).sum()))
        return count_with_mirrors(self.values[right])

    @property
    def count(self) -> int:
        """How many poles the box holds, conjugates counted."""
        return count_with_mirrors(self.values)

    @property
    def moving(self) -> Complex:
        """The poles apart from those at 0, which the hub angle leaves there where nothing holds it."""
        return self.values[self.values != 0]

    @property
    def spectral_abscissa(self) -> float:
        """The largest real part [1/s] in the box, apart from poles at 0."""
        return float(self.moving.real.max(initial=-np.inf))

    def certify(self, digits: int = DOUBLE_DIGITS) -> tuple[Disc, ...]:
        """A disc around each pole with Im >= 0 apart from 0, and a proof that the box has no other.

        Raises CertificationError where something cannot be proven.
        """
        if isinstance(self.loop, Loop):
            raise CertificationError("discs are proven for gains at the hub; of a law the poles are counted in the box")
        k, gains = self.loop.k, self.loop.gains
        discs = tuple(enclosed(k, complex(pole), digits, gains) for pole in self.moving)
        if not disjoint(discs):
            raise CertificationError("the discs of two poles touch: ask for more digits")
        proven = proven_count(k, self.box, gains)
        if proven != self.count:
            raise CertificationError(f"{self.count} poles in the box are listed, but {proven} are there")
        return discs


def poles_of_gains(arm: Arm, law: HubFeedback, count: int | None = None) -> Poles:
    """The first `count` closed-loop poles with Im >= 0, ascending in Im s, complete in the box of the record.

    Without a count the first ten (more, where more are real), or as many as lie below the shear cut-off where these are
    fewer: the box then ends there.  A count that is given goes on into shear.
    Raises ParameterError where there is no loop, ConvergenceError where the box cannot be completed.
    """
    if count is not None:
        count = whole("count", count, 1, MOST_POLES, f"a whole number from 1 to {MOST_POLES}")
    loop, cut_off = HubLoop(arm, law), arm.shear_cutoff
    wanted, limit = (USUAL_POLES, cut_off) if count is None else (count, math.inf)
    number = wanted + 2
    while True:
        height = band_of(arm, number)
        if height >= limit:
            poles = poles_below(loop, limit, SHRUNK_HEIGHTS)
            if poles.values.size <= wanted:
                return replace(poles, ends_at_shear_cutoff=True)
        else:
            poles = poles_below(loop, height)
        if poles.values.size >= wanted:
            return first_poles(poles, count)
        if number > MOST_BOX_MODES:
            text = f"only {poles.values.size} poles right of -1/C lie below {height:.4g} rad/s, not {count}"
            raise ConvergenceError(text, poles.values, count)
        number *= 2


def poles_below(loop: HubLoop, height: float, factors: tuple[float, ...] = TRIED_HEIGHTS) -> Poles:
    """All closed-loop poles with |Im s| <= height, and more than about -1.5 heights or -0.8/C in Re s.

    Where a zero lies on the edge of the box the next of the `factors` on the height is tried.
    """
    if loop.freed is not loop and loop.freed.is_lossless:  # with its poles at 0 and on the axis where they belong
        return replace(poles_below(loop.freed, height, factors), loop=loop)
    resting = loop.resting_zeros
    at_zero = zeros_at_origin(loop.k, loop.gains) + resting
    starts, known = starting_points(loop, STARTS_REACH * height), slow_poles(loop, SLOW_SHARE * height)
    whole = loop.member.function

    def function(s: Complex) -> Analytic:
        s = off_rest(s) if resting else s
        return deflated(*whole(s), s, resting)

    found, box = complete(function, lambda height: box_of(loop, height), height, starts, known, factors)
    # without losses the function is even in s: a simple zero is its own mirror image, its real part is rounding
    on_axis = loop.is_lossless & (abs(found.real) <= AXIS_SHARE * abs(found))
    found = np.where(on_axis, 1j * found.imag, found)
    upper = found[found.imag >= 0]
    upper = upper[np.lexsort((upper.real, upper.imag))]
    return Poles(loop, np.r_[np.zeros(at_zero, complex), upper], box)


def box_of(loop: HubLoop, height: float) -> Box:
    """A box of that height which reaches far enough right for any unstable pole, and left short of -1/C."""
    right = quiet_edge(loop, RIGHT_OF_AXIS * height, height, RIGHT_POINTS, GAINS_RIGHT)
    left, C = HEIGHTS_LEFT * height, loop.arm.damping
    return Box(-min(left, TOWARD_SINGULAR / C) if C else -left, right, -height, height)


def quiet_edge(
    loop: HubLoop | Loop, right: float, height: float, points: int, heights: float, corner: float = 0.0
) -> float:
    """The right edge [1/s] of a box of that height, from `right` on: where 1 + L has no zero, or after so many heights.

    That is where Re L > -1/2, on the edge and at a few places beyond; L > 0 may be large, as on a hub without inertia,
    and 1 + L keeps its sign on the real axis for five decades more, and beyond the `corner` [1/s] of a law: a hub of
    little inertia meets it only there.
    """
    edge = 1j * np.linspace(0.0, height, points)
    while right < heights * height:
        L = loop.loop_function(np.r_[right + edge, right * np.array(RIGHT_OF_EDGE)])
        if L.real.min() > LEAST_REAL_PART:
            break
        right *= RIGHT_GROWS
    far = np.geomspace(right, max(FAR_RIGHT * right, BEYOND_CORNER * corner), FAR_POINTS)
    with np.errstate(all="ignore"):  # so far right powers of s may be no doubles: there nothing is told
        real_part = loop.loop_function(far.astype(complex)).real
    far, held = far[np.isfinite(real_part)], real_part[np.isfinite(real_part)] > -1
    (turns,) = np.nonzero(held[1:] != held[:-1])
    return float(far[turns[-1] + 1] if turns.size else right)


def slow_poles(loop: HubLoop, below: float) -> Complex:
    """Poles [1/s] but 0 of the turning arm under small gains, of size up to `below`: zeros of J s^2 + b s + c.

    J is the effective inertia, b and c are `HubLoop.at_rest`.  They are corrected on the characteristic function if
    their squares are full doubles; smaller ones are right as they are, flexibility and damping adding terms of the
    order |s|/w1 and C |s|.
    """
    b, c = loop.at_rest
    if not loop.arm.has_rigid_mode:
        return np.empty(0, complex)
    J = effective_inertia(loop.arm, loop.law)
    unit = max(abs(b), math.sqrt(abs(c)) * math.sqrt(abs(J)), LEAST_SIZE)  # b and sqrt(c J) alike
    with np.errstate(over="ignore"):
        roots = unit * np.roots([J, b / unit, c / unit / unit]).astype(complex)
    slow = roots[(roots != 0) & (abs(roots) <= below)]
    exact = slow.copy()
    for _ in range(SLOW_STEPS):
        at = loop.member.function(np.where(abs(exact) > LEAST_SQUARABLE, exact, 1.0))
        exact = exact - np.where(abs(exact) > LEAST_SQUARABLE, at.value / at.slope, 0.0)
    return exact[abs(exact - slow) <= NEAR_RIGID * abs(slow)]


def starting_points(loop: HubLoop, up_to: float) -> Complex:
    """Where Newton's method starts: the arm's own frequencies, those with the hub locked, and the rigid arm's poles."""
    arm, C = loop.arm, loop.arm.damping
    near = near_modes(np.asarray(steep_places(arm, up_to)), C)
    J = arm.turned_inertia if arm.has_rigid_mode else arm.hub_side_inertia + SOME_INERTIA
    slow = np.roots([J, *loop.at_rest]).astype(complex)
    slow = slow[abs(slow) > LEAST_SQUARABLE]  # zeros at 0 are divided out
    real = real_starts(up_to)
    return np.concatenate([near, near.conj(), slow, -real, real])


def real_starts(up_to: float) -> Real:
    """Starts [1/s] on the real axis right of 0, for poles whose place nothing tells; mirrored, those left of it."""
    return np.geomspace(up_to / REAL_SPAN, REAL_REACH * up_to, REAL_STARTS)


def near_modes(omega: Real, C: float) -> Complex:
    """Starts [1/s] at and left of the poles of modes of those frequencies [rad/s] that bending alone damps."""
    shift = np.array(DAMPED_BY_LAW)[:, None]
    decay = C * omega**2 / 2
    return (-decay - shift * omega + 1j * omega * np.sqrt(np.maximum(1 - (C * omega / 2) ** 2, 0.0))).ravel()


def first_poles(poles: Poles[AnyLoop], count: int | None) -> Poles[AnyLoop]:
    """The first so many poles, the usual ones and all real ones if no number is given, and a lower box of just these.

    Raises ParameterError where a number that is given parts real poles.
    """
    values, real = poles.values, int((poles.values.imag == 0).sum())
    count = max(USUAL_POLES, real) if count is None else count
    kept = values[:count]
    if count < values.size and values[count].imag == kept[-1].imag == 0:
        raise ParameterError(key="count", value=count, remedy=f"more: {real} poles are real")
    top = poles.box.im_max if count == values.size else float((kept[-1].imag + values[count].imag) / 2)
    left, right, _, _ = poles.box
    return Poles(poles.loop, kept, Box(left, right, -top, top))
