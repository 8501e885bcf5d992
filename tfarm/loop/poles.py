"""Closed-loop poles of the exact rig under any law: zeros of a transcendental function, complete in a printed box.

Newton's method finds zeros from many starts, and the winding number of the characteristic function around the box is
their number (`spectrum.box`).  Where it disagrees the others are searched for, and the box is cut.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated

import numpy as np
from scipy.optimize import linear_sum_assignment

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.blocks import Matrices
from tfarm.arm.checks import whole
from tfarm.arrays import Complex
from tfarm.case import Case
from tfarm.digits import DOUBLE_DIGITS
from tfarm.errors import CertificationError, ConvergenceError, require
from tfarm.loop.continuous import ContinuousLoop, frequency_above_mode, steep_places
from tfarm.loop.theorem import Energy
from tfarm.moved import FormerName
from tfarm.records import frozen
from tfarm.reduced.modal import closed_loop_matrix, in_series, pade
from tfarm.response.frequency import AXIS_SHARE
from tfarm.schema import Quantity
from tfarm.spectrum.box import (
    HEIGHTS_LEFT,
    RIGHT_OF_AXIS,
    TOWARD_SINGULAR,
    TRIED_HEIGHTS,
    Box,
    complete_zeros,
)
from tfarm.spectrum.damped import damped_starts
from tfarm.spectrum.proofs import Disc, disjoint, enclose_zero, proven_count
from tfarm.spectrum.table import first_frequency

# poles listed where no count is asked for
USUAL_POLES = 10
# of 1/delay: further left a delayed loop has ever more poles, and all of them are fast
LATE = 2.0
# the number of the pole below the first mode that no mode of the link is near
HUB = 0


def count_with_mirrors(zeros: Complex) -> int:
    """Return the number of zeros with their conjugates, from those with Im s >= 0."""
    return int(np.where(zeros.imag > 0, 2, 1).sum())


@frozen
class Poles:
    """Closed-loop poles [1/s] with Im >= 0, ascending in Im, with their multiplicity: all there are in `box`.

    The conjugates of oscillating poles are not listed.  Where `ends_at_shear_cutoff` the box ends at
    sqrt(kappa G A/(rho I)), since no more poles lie below it: those above are shear modes, damped by bending alone.
    """

    loop: Annotated[ContinuousLoop, Quantity(flat=True)]
    values: Annotated[Complex, Quantity("s", "1/s", 12, "closed-loop poles with Im s >= 0", key="poles")]
    box: Annotated[Box, Quantity("box: Re s from, to, Im s from, to", help="searched, and complete")]
    ends_at_shear_cutoff: Annotated[
        bool,
        Quantity(
            "ends at the shear cut-off, sqrt(kGA/rhoI)",
            help="no more bending modes lie below it: the list is whole",
        ),
    ] = False
    discs: Annotated[
        tuple[Disc, ...] | None, Quantity(help="enclosures of the poles apart from 0, certified")
    ] = None

    @property
    def completeness(
        self,
    ) -> Annotated[str, Quantity("completeness", help="word of certainty for the list of poles")]:
        """The word of certainty for the list of poles in the box."""
        return "converged (winding number)" if self.discs is None else "certified"

    @property
    def shear_cutoff(
        self,
    ) -> Annotated[float, Quantity(unit="rad/s", help="sqrt(kGA/rhoI): shear modes lie above")]:
        """sqrt(kGA/rhoI) [rad/s], above which lightly damped shear modes lie."""
        return self.loop.arm.shear_cutoff

    @property
    def unstable(self) -> Annotated[int, Quantity("unstable poles", help="of the box, conjugates counted")]:
        """Number of poles of the box, conjugates counted, right of the axis.

        A real part below working precision decides nothing; without damping a theorem decides.
        """
        s = self.values
        least = AXIS_SHARE * abs(s)
        right = s.real > least
        if self.loop.theorem.energy == Energy.SUPPLY:
            right |= (s.imag > 0) & (abs(s.real) <= least)
        return count_with_mirrors(s[right])

    @property
    def count(self) -> int:
        """Number of poles in the box, conjugates counted."""
        return count_with_mirrors(self.values)

    @property
    def nonzero(self) -> Complex:
        """The poles apart from those at 0, where that of a free hub angle is."""
        return self.values[self.values != 0]

    moving = FormerName("nonzero")

    @property
    def spectral_abscissa(self) -> float:
        """The largest real part [1/s] in the box, apart from poles at 0."""
        return float(self.nonzero.real.max(initial=-np.inf))

    def with_discs(self, digits: int = DOUBLE_DIGITS) -> Poles:
        """Return the same with the discs of `certify`."""
        return replace(self, discs=self.certify(digits))

    certified = FormerName("with_discs")

    def certify(self, digits: int = DOUBLE_DIGITS) -> tuple[Disc, ...]:
        """Return a disc around each pole with Im >= 0 apart from 0, proven to contain all poles of the box.

        Raises CertificationError where something cannot be proven.
        """
        k = self.loop.k
        law = self.loop.exact
        discs = tuple(enclose_zero(k, complex(pole), digits, law) for pole in self.nonzero)
        if not disjoint(discs):
            raise CertificationError("the discs of two poles touch: ask for more digits")
        proven = proven_count(k, self.box, law)
        if proven != self.count:
            raise CertificationError(f"{self.count} poles in the box are listed, but it contains {proven}")
        return discs


def closed_loop_poles(arm: Arm, law: AnyLaw, count: int | None = None) -> Poles:
    """Return the first `count` closed-loop poles with Im >= 0, ascending in Im s, complete in the box of the record.

    Without a count these are the first ten (more, where more are real), or all below the shear cut-off where these are
    fewer: then the box ends there.  With a count shear modes are included.
    Raises ParameterError where there is no loop, ConvergenceError where the box cannot be completed.
    """
    # that may be asked for
    most_poles = 1000
    # flexible, below the highest box that is searched for as many poles as are asked for
    most_box_modes = 4000
    if count is not None:
        count = whole("count", count, 1, most_poles, f"a whole number from 1 to {most_poles}")
    loop = ContinuousLoop(Case(arm, law))
    wanted = count or USUAL_POLES
    limit = math.inf if count else loop.arm.shear_cutoff
    number = wanted + 2
    while True:
        height = frequency_above_mode(loop.arm, number)
        if height >= limit:
            # no box reaches above the shear cut-off
            poles = poles_below(loop, limit, factors=tuple(1 / factor for factor in TRIED_HEIGHTS))
            if poles.values.size <= wanted:
                return replace(poles, ends_at_shear_cutoff=True)
        else:
            poles = poles_below(loop, height)
        if poles.values.size >= wanted:
            return first_poles(poles, count)
        if number > most_box_modes:
            left, _, _, top = poles.box
            text = f"only {poles.values.size} poles right of {left:.4g} 1/s lie below {top:.4g} rad/s, not {wanted}"
            raise ConvergenceError(text, poles.values, wanted)
        number *= 2


def poles_below(
    loop: ContinuousLoop, height: float, late: float = LATE, factors: tuple[float, ...] = TRIED_HEIGHTS
) -> Poles:
    """Return all closed-loop poles with |Im s| <= height [rad/s] in a box that reaches right of every unstable one.

    Left it reaches to about -1.5 heights, -0.8/C or -late/delay.  Where a zero lies on the edge of the box the next of
    the `factors` on the height is tried.
    """
    # of a box's height: poles nearer to 0 are known beforehand
    slow_share = 1e-6
    # Starts of Newton's method affect the time alone: the winding number counts the zeros that they missed.
    # heights of the box: modes of the arm up to there, as a law may draw their poles down into it
    starts_reach = 1.3
    starts = starting_points(loop, starts_reach * height)
    known = slow_poles(loop, slow_share * height)
    found, box = complete_zeros(
        loop.function, lambda top: box_of(loop, top, late), height, starts, known, factors
    )
    # without losses a simple zero is its own mirror image, and its real part is rounding
    is_even = loop.is_lossless or (loop.arm.is_undamped and loop.theorem.energy == Energy.CONSTANT)
    on_axis = is_even & (abs(found.real) <= AXIS_SHARE * abs(found))
    found = np.where(on_axis, 1j * found.imag, found)
    upper = found[found.imag >= 0]
    upper = upper[np.lexsort((upper.real, upper.imag))]
    return Poles(loop, np.r_[np.zeros(loop.zeros_at_origin, complex), upper], box)


def box_of(loop: ContinuousLoop, height: float, late: float = LATE) -> Box:
    """Return a box of that height, right to where |L| is small, past the law's poles; left to -1/C and -late/delay."""
    # times the rightmost pole of a law, where L is infinite: the nearest right edge that is tried
    beyond_own = 1.1
    own = loop.law.poles
    C = loop.arm.damping
    # the phase of waves turns too often along a wider box
    farthest = 1e8 * first_frequency(loop.arm)
    if own.real.max(initial=0.0) > farthest:
        fastest = complex(own[own.real.argmax()])
        why = f"law: its pole at {fastest:.3g} 1/s is farther right than any box, as its den begins next to 0"
        text = f"{why}; begin it with 0, which is another law, or a larger number"
        raise ConvergenceError(text, fastest, height)
    right = RIGHT_OF_AXIS * height
    if own.size:
        right = beyond_own * max(right, float(own.real.max()))
    right = quiet_edge(loop, right, height)
    left = HEIGHTS_LEFT * height
    if C:
        left = min(left, TOWARD_SINGULAR / C)
    if loop.law.delay:
        left = min(left, late / loop.law.delay)
    return Box(-float(left), right, -height, height)


def quiet_edge(loop: ContinuousLoop, right: float, height: float) -> float:
    """Return the right edge [1/s] of a box of that height, from `right` on: where 1 + L has no zero, or 1e8 heights.

    There Re L > -1/2, on the edge and at a few places beyond; L > 0 may be large, as on a hub without inertia.  On the
    real axis 1 + L keeps its sign for five decades more, and beyond the fastest corner of a law, where the inertia of a
    light hub begins to matter.
    """
    # that a box reaches at most: an improper law may have poles so far right
    most_heights = 1e8
    # of L, so that 1 + L has no zero
    least_real_part = -0.5
    # times the right edge of a box, where L is evaluated again
    right_of_edge = (2.0, 5.0, 20.0)
    # times the right edge, and a law's fastest corner: the end of the search of real poles
    beyond_edge = 1e5
    beyond_corner = 10.0
    # of the real axis up to there, on which 1 + L is smooth
    far_points = 41
    # times, from one right edge that is tried to the next: of effect on the time alone
    right_grows = 1.7
    # of half a right edge, where Re L is evaluated: far from any pole of L, it is smooth
    right_points = 60
    edge = 1j * np.linspace(0.0, height, right_points)
    corner = float(abs(loop.law.poles).max(initial=0.0))
    while right < most_heights * height:
        L = loop.loop_function(np.r_[right + edge, right * np.array(right_of_edge)])
        if L.real.min() > least_real_part:
            break
        right *= right_grows
    far = np.geomspace(right, max(beyond_edge * right, beyond_corner * corner), far_points)
    # powers of s may overflow so far right: these points are left out
    with np.errstate(all="ignore"):
        real_part = loop.loop_function(far.astype(complex)).real
    is_finite = np.isfinite(real_part)
    far = far[is_finite]
    is_above = real_part[is_finite] > -1
    turns = np.flatnonzero(is_above[1:] != is_above[:-1])
    return float(far[turns[-1] + 1] if turns.size else right)


def slow_poles(loop: ContinuousLoop, below: float) -> Complex:
    """Return poles [1/s] but 0 of size up to `below`, from the power series of D at 0, corrected on D.

    D is evaluated on a circle that is small compared with w1, 1/C and 1/delay: there the series converges.
    """
    radius = 0.2 / (1 / first_frequency(loop.arm) + loop.arm.damping + loop.law.delay)
    points = 32
    circle = loop.function(radius * np.exp(2j * np.pi * np.arange(points) / points))
    series = np.fft.fft(circle.value * np.exp(circle.scale - circle.scale[0])).real[: points // 4]
    slow = radius * np.roots(series[::-1]).astype(complex)
    slow = slow[(abs(slow) <= min(below, radius / 2)) & (slow != 0)]
    step = slow
    for _ in range(6 if slow.size else 0):
        # a start whose slope is rounding diverges, and is left out
        with np.errstate(all="ignore"):
            at = loop.function(slow)
            step = at.value / at.slope
            slow = slow - step
    return slow[(abs(step) <= 1e-9 * abs(slow)) & (abs(slow) <= below)]


def starting_points(loop: ContinuousLoop, up_to: float) -> Complex:
    """Return starts of Newton's method: poles of the damped arm, of the law and of its delay, and real ones.

    A delay alone would have the poles  s = (ln(-L e^{s delay}) + 2 pi i n)/delay,  where L e^{s delay} changes little.
    """
    near = damped_starts(loop.arm, np.asarray(steep_places(loop.arm, up_to)))
    real = -np.geomspace(1e-4 * up_to, up_to, 10)
    real = real[real * loop.arm.damping > -TOWARD_SINGULAR]
    delay = loop.law.delay
    turns = 2j * math.pi * np.arange(1.0, up_to * delay / (2 * math.pi))
    late = turns / (delay or 1.0)
    for _ in range(3 if late.size else 0):
        # at a pole or a zero of L
        with np.errstate(all="ignore"):
            late = (np.log(-loop.loop_function(late) * np.exp(late * delay)) + turns) / delay
    starts = np.concatenate([near, real, late, late.conj(), loop.law.poles])
    return starts[np.isfinite(starts) & (starts != 0)]


def poles_by_mode(poles: Complex, open_loop: Mapping[int, complex]) -> dict[int, complex]:
    """Return the poles s, Im s > 0, by the mode whose open-loop pole p is theirs; a single one below these is `HUB`.

    One a mode, by the least sum of |ln s - ln p|.  By more than 1, a factor e of its frequency or 57 deg, no controller
    moves a mode here: such a pole belongs to none.
    """
    farthest = 1.0
    modes = np.array(list(open_loop))
    own = np.array(list(open_loop.values()))
    apart = np.minimum(abs(np.log(poles)[:, None] - np.log(own)), farthest)
    rows, columns = linear_sum_assignment(apart)
    near = apart[rows, columns] < farthest
    rows = rows[near]
    found = dict(zip(modes[columns[near]].tolist(), poles[rows].tolist(), strict=True))
    others = np.delete(poles, rows)
    below = others[abs(others) < min(map(abs, found.values()), default=0.0)]
    if below.size == 1:
        found[HUB] = complex(below[0])
    return dict(sorted(found.items()))


def poles_of_model(loop: ContinuousLoop, plant: Matrices) -> Complex:
    """Return poles of a model of the rig, from its input to the law's signals, under the law.

    A delay is a Pade fraction of order 8.
    """
    law = loop.law.matrices()
    if loop.law.delay:
        law = in_series(law, pade(loop.law.delay, 8).matrices())
    return np.linalg.eigvals(closed_loop_matrix(plant, law)).astype(complex)


def first_poles(poles: Poles, count: int | None) -> Poles:
    """Return the first `count` poles, or the usual ones and all real ones, in a lower box of just these.

    Raises ParameterError where a count separates real poles.
    """
    values = poles.values
    real = int((values.imag == 0).sum())
    count = count or max(USUAL_POLES, real)
    left, right, _, top = poles.box
    if count < values.size:
        last, following = values[count - 1 : count + 1].imag.tolist()
        require(last or following, "count", count, f"more: {real} poles are real")
        top = (last + following) / 2
    return Poles(poles.loop, values[:count], Box(left, right, -top, top))
