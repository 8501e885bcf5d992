"""The verdict on a loop: stable, marginal or unstable, and for how much of the infinite spectrum that is known.

Poles are computed, completely, up to a band; what lies beyond is known by

* a theorem on the sign of the law (`theorem`): for a law on the hub's own angle or rate, through a torque without lag,
  it holds for every mode of any rig; with feedback of the hub's moment for every mode of a rig without damping;
* small gain: with damping in every segment, once |L| stays below one half on the axis, and falls, and on the upper
  edge of the box, 1 + L has no zero above it.  A band of more than `MOST_BAND_MODES` modes is cut, and there is none
  where a segment of a lossy rig has C = 0;
* delay without any damping: the phase of the loop turns on from mode to mode, so that infinitely many modes are
  unstable.

Else it is not determined, and the verdict is that of the band.  A pole at 0 remains where the hub angle is free:
verdicts leave it out.
"""

import math
import warnings
from collections.abc import Iterable
from functools import cached_property
from typing import Annotated

import numpy as np

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.arm.stages import Consumer
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.continuous import (
    MOST_BAND_MODES,
    QUIET_REACH,
    ContinuousLoop,
    frequency_above_mode,
    grid,
    quiet_places,
)
from tfarm.loop.curve import LoopContour, LoopVerdict, next_limits
from tfarm.loop.loop_margins import PhaseCrossover
from tfarm.loop.poles import (
    HUB,
    Poles,
    box_of,
    count_with_mirrors,
    poles_below,
    poles_by_mode,
)
from tfarm.loop.theorem import Energy
from tfarm.records import frozen
from tfarm.response.frequency import AXIS_SHARE
from tfarm.schema import Quantity
from tfarm.spectrum import flexible_frequencies, modes, modes_below

# |L| beyond the band, with damping
QUIET = 0.5
# a real part below this share of |s| is none: poles have an error of a few eps
MARGIN_OF_ZERO = 1e-11
CONTINUOUS = Consumer(
    "continuous-time column",
    acts=("law", "hold", "hub damping", "plant"),
    named=("torque limit",),
    none=(
        "reference",
        "shaper",
        "anti-alias filter",
        "encoder",
        "hub rate",
        "amplifier steps",
        "amplifier range",
        "arithmetic",
        "DAC steps",
        "DAC range",
        "delay",
        "volts",
    ),
)
SMALL_GAIN = f"|L(iw)| < {QUIET:g} and falling: no unstable pole (small gain)"


@frozen
class Stability(LoopVerdict):
    """Verdict on a loop, "stable", "marginal" or "unstable", its poles in the band, and its stability beyond (`tail`).

    Where `is_known_beyond` is false the verdict is that of the band alone.
    """

    loop: Annotated[ContinuousLoop, Quantity(flat=True)]
    word: Annotated[
        str,
        Quantity(
            "stability", key="verdict", help="stable, marginal or unstable; the pole of a free hub left out"
        ),
    ]
    unstable_roots: Annotated[int, Quantity("unstable poles", help="in the frequency range")]
    unstable_roots_infinite: Annotated[
        bool, Quantity(help="infinitely many poles beyond the range are unstable")
    ]
    band: Annotated[
        float,
        Quantity(
            "frequency range, up to", "rad/s", key="up_to_rad_s", help="poles below it are counted completely"
        ),
    ]
    tail: Annotated[
        str, Quantity("beyond the range", key="beyond", help="what decides the poles of higher frequency")
    ]
    poles: Poles
    is_known_beyond: Annotated[
        bool,
        Quantity(
            "stability known beyond the range",
            key="known_beyond",
            help="no: the verdict is that of the frequency range alone",
        ),
    ] = True

    consumer = CONTINUOUS

    @property
    def spectral_abscissa(
        self,
    ) -> Annotated[float, Quantity("spectral abscissa", "1/s", 6, "largest Re s in range")]:
        """The largest real part [1/s] of the poles in range, apart from those at 0."""
        return self.poles.spectral_abscissa

    @property
    def free_pole(
        self,
    ) -> Annotated[str | None, Quantity("free hub angle", help="pole at 0 that verdicts leave out")]:
        """The pole at 0 that the verdict leaves out."""
        if self.poles.nonzero.size < self.poles.values.size:
            return "its pole at s = 0 is left out"
        return None

    @property
    def is_stable(self) -> Annotated[bool, Quantity(key="stable", help="whether the verdict is stable")]:
        """Whether every pole but that of the free hub angle lies left of the axis."""
        return self.word == "stable"

    @property
    def full(self) -> ContinuousLoop:
        """The loop, which has every mode."""
        return self.loop

    @property
    def verdict(self) -> str:
        """The word, by its name of version 1.0."""
        warnings.warn("Stability.verdict has moved: it is Stability.word", DeprecationWarning, stacklevel=2)
        return self.word

    @property
    def range_words(self) -> str:
        """The range in which poles are counted, and certainty beyond."""
        if self.tail == SMALL_GAIN:
            known = ", small gain beyond"
        elif self.is_known_beyond:
            known = ", theorem beyond"
        else:
            known = ""
        return f"converged to {self.band:.4g} rad/s{known}"

    @property
    def time_constant(self) -> float | None:
        """Time constant [s] of the rightmost pole in range."""
        return -1 / self.spectral_abscissa if self.spectral_abscissa else None

    @property
    def oscillating_poles(self) -> list[tuple[int, complex]]:
        """The oscillating poles by mode."""
        moving = self.poles.nonzero
        oscillating = moving[moving.imag > 0]
        table = modes(self.loop.arm, up_to=self.band)
        own = zip(table.index.tolist(), (1j * table.natural_frequency).tolist(), strict=True)
        by_mode = poles_by_mode(oscillating, {n: s for n, s in own if n})
        others = oscillating[~np.isin(oscillating, list(by_mode.values()))]
        return [*by_mode.items(), *((HUB, s) for s in others.tolist())]

    @property
    def margins_end(self) -> float:
        """The end of the verdict's range."""
        return self.band

    @cached_property
    def frequencies(self) -> Real:
        """The grid of the arm, and points about every pole of the loop and of its law at its distance from the axis.

        |1 + L| dips there, and not where the arm's own functions are steep; the less damping, the narrower the dip.
        """
        omega = np.asarray(grid(self.loop.arm, self.band))
        poles = np.r_[self.poles.values, self.loop.law.poles]
        near = np.geomspace(0.05, 20.0, 12)
        close = poles.imag[:, None] + abs(poles.real[:, None]) * np.r_[-near, 0.0, near]
        # |L| may cross 1 down to a twentieth of the slowest pole
        slowest = abs(self.poles.nonzero).min(initial=omega[0])
        slow = np.geomspace(0.05 * slowest, omega[0], 400) if slowest < omega[0] else omega[:0]
        return np.unique(np.r_[omega, close[(close > 0) & (close < omega[-1])], slow])

    @cached_property
    def contour(self) -> LoopContour:
        """Up the axis to the band, and around the right part of the box in which the poles were counted."""
        loop = self.loop
        band = self.band
        moving = self.poles.nonzero
        own = loop.law.poles
        omega = np.asarray(grid(loop.arm, band))
        ringing = own[own.imag > 0]
        # points around a pole of the law, in its distances from the axis
        near = (ringing.imag[:, None] + abs(ringing.real)[:, None] * np.linspace(-4.0, 4.0, 41)).ravel()
        corner = complex(self.poles.box.re_max, band)
        top = np.linspace(1j * band, corner, 750)
        right = np.linspace(corner, corner.real, 750)
        is_right = own.real > AXIS_SHARE * abs(own)
        is_in_band = abs(own.imag) < band
        least = AXIS_SHARE * abs(moving)
        return LoopContour(
            grid=np.r_[omega, near[near > omega[0]]],
            on_curve=poles_on_axis(loop, band),
            closed=moving,
            closing=np.r_[top[1:], right[1:]],
            unstable_open=int((is_right & is_in_band).sum()),
            unstable=self.unstable_roots,
            clear=count_with_mirrors(moving[moving.real > least]),
            near_axis=count_with_mirrors(moving[abs(moving.real) <= least]),
        )

    def gain_limits(self, by_phase: tuple[PhaseCrossover, ...]) -> tuple[float, float]:
        """Return the factors on all of the law at which a pole reaches the axis, from where L < 0.

        Without damping all modes may reach it at one factor, where rounding alone decides whether L < 0.  There the
        factor follows from a theorem.
        """
        loop = self.loop
        if not loop.is_moved_at_hub_alone or loop.theorem.energy is None:
            return next_limits(t for _, t in by_phase)
        limits = [t for w, t in by_phase if w == 0]
        ends = {MOMENT_GAIN: loop.arm.input_per_torque, RATE_GAIN: -loop.arm.rate_loss}
        for name, end in ends.items():
            gain = loop.numbers[name]
            if end and gain:
                limits.append(end / gain)
        return next_limits(limits)


def poles_on_axis(loop: ContinuousLoop, band: float) -> Real:
    """Return poles of L on the imaginary axis [rad/s], ascending: of rigid body, law, and at C = 0 all modes."""
    arm = loop.arm
    flexible = np.asarray(flexible_frequencies(arm, band)) if arm.is_undamped else np.empty(0)
    own = loop.law.poles
    # of a product of resonators roots are off it by rounding
    on_axis = abs(own.real) <= AXIS_SHARE * abs(own)
    ringing = own.imag[on_axis & (own.imag > 0) & (own.imag < band)]
    integrators = loop.k.at_rest + int((own == 0).sum())
    return np.unique(np.r_[[0.0] * (integrators > loop.zeros_at_origin), flexible, ringing])


def stability(case: Case, band: float | None = None) -> Stability:
    """Return the verdict on the loop of a case.  `band` [rad/s] is chosen if it is not given.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, and where with damping
    one is on the axis to working precision.
    """
    return verdict_on(ContinuousLoop(case), band)


def verdict_on(loop: ContinuousLoop, band: float | None = None) -> Stability:
    """Return the verdict on a loop, as `stability`."""
    # of 1/delay: poles are listed up to there on the left; further left are more and more, all stable
    listed_left = 0.5
    theorem = loop.theorem
    height = band
    is_small = False
    if height is None:
        height, is_small = band_of_loop(loop)
    poles = poles_below(loop, height, listed_left)
    is_known = True
    is_infinite = theorem.energy == Energy.SUPPLY
    if theorem.energy is not None:
        tail = theorem.reason
    elif is_small:
        tail = SMALL_GAIN
    elif loop.arm.is_undamped and loop.law.delay and loop.feeds_back:
        tail = "a delay without any damping destabilises infinitely many modes"
        is_infinite = True
    else:
        tail = f"converged up to {height:.4g} rad/s, not determined beyond, neither by small gain nor by a theorem"
        is_known = False
    word = _word_of(poles, is_infinite)
    return Stability(loop, word, poles.unstable, is_infinite, poles.box.im_max, tail, poles, is_known)


def _word_of(poles: Poles, is_infinite: bool) -> str:
    """Return the verdict from the poles of the band, and from the theorem where rounding hides the side of the axis.

    Raises ConvergenceError where one of a damped loop may be on the axis, and none is right of it.
    """
    moving = poles.nonzero
    arm = poles.loop.arm
    share = moving.real / abs(moving)
    if is_infinite or (share > MARGIN_OF_ZERO).any():
        return "unstable"
    if poles.values.size - moving.size > arm.has_rigid_mode:
        return "marginal"
    on_axis = moving[share > -MARGIN_OF_ZERO]
    if arm.loses_at_hub_alone:
        known = poles.loop.theorem.energy == Energy.LOSS or not on_axis.size
        if known and is_controllable(arm.lossless_hub, poles.box.im_max):
            return "stable"
        return "marginal"
    if on_axis.size:
        pole = complex(on_axis[0])
        text = f"the pole at {pole:.6g} 1/s is on the imaginary axis to working precision: not determined"
        raise ConvergenceError(text, pole, pole.real)
    return "stable"


def is_controllable(arm: Arm, up_to: float) -> bool:
    """Return whether the hub takes part in every flexible mode below `up_to` [rad/s], by rotation or by root moment.

    At C = 0 a mode without the hub stays undamped under any law: exceptional arms have one.
    """
    # a hub participation below this share of an ordinary one is none
    uncontrollable = 1e-9
    return modes_below(arm, up_to) == 0 or bool((hub_shares(arm, up_to).max(axis=0) > uncontrollable).all())


def hub_shares(arm: Arm, up_to: float) -> Real:
    """Return rotation and root moment at the hub (2, modes) of the flexible modes below `up_to` [rad/s], as shares.

    Of sqrt(1/m) k and sqrt(1/m) E I k^2, those of a slender beam of mass m with waves of the same frequency: high modes
    tend to sqrt 2 and 0 on a free pin, to 0 and 2 where the hub is heavy.
    """
    table = modes(arm, up_to=up_to)
    EI = arm.bending_scale * arm.length
    flexible = table.index > 0
    omega = table.natural_frequency[flexible]
    b = abs(table.hub_participation[flexible])
    k = np.sqrt(omega) * (arm.own_mass / arm.length / EI) ** 0.25
    scale = np.sqrt(arm.own_mass)
    return np.array([b * scale / k, b * arm.hub_side_inertia * omega**2 * scale / (EI * k**2)])


def band_of_loop(loop: ContinuousLoop) -> tuple[float, bool]:
    """Return the band [rad/s] of computed poles, and whether small gain holds beyond it (never without damping)."""
    # flexible modes in the band at C = 0, and at least
    least_band_modes = 12
    # times, from one band that is tried to the next
    widened = 1.6
    # of the fastest pole of the law that rings: a band reaches so far, if it can
    beyond_law_poles = 1.3
    # damping ratio from which on a pole of the law makes no peak
    dull = 0.7
    theorem = loop.theorem
    arm = loop.arm
    own = loop.law.poles
    ringing = own[own.real > -dull * abs(own)]
    fastest = beyond_law_poles * float(abs(ringing).max(initial=0.0))
    highest = frequency_above_mode(arm, MOST_BAND_MODES)
    least = max(frequency_above_mode(arm, least_band_modes), min(fastest, highest))
    is_decided = theorem.energy is not None and (arm.has_elastic_link or not loop.law.is_static)
    if arm.loses_at_hub_alone or is_decided or fastest > highest:
        return least, False
    band = least
    while band <= highest or modes_below(arm, band) <= MOST_BAND_MODES:
        if has_fallen(loop, band):
            return band, arm.least_damping > 0
        band *= widened
    return max(least, band / widened) if loop.law.is_static else least, False


def band_of_family(loops: Iterable[ContinuousLoop]) -> tuple[float, bool]:
    """Return a band [rad/s] for all these loops, and whether small gain holds beyond it for all."""
    bands, are_small = zip(*map(band_of_loop, loops), strict=True)
    return max(bands), all(are_small)


def is_quiet(loop: ContinuousLoop, band: float) -> bool:
    """Return whether small gain decides every pole beyond a band.

    Not determined for a rig with an elastic segment: its resonances become ever narrower, and pass between any points
    at which L is evaluated.
    """
    return loop.arm.least_damping > 0 and has_fallen(loop, band)


def has_fallen(loop: ContinuousLoop, band: float) -> bool:
    """Return whether 1 + L has no zero with Im s > band right of the axis, by |L| < 1/2 on the edges of that region.

    L is evaluated on two decades of the axis, where |L| falls, with the natural frequencies between, and on the upper
    edge of the box; farther right |L| is smaller still.
    """
    # up to QUIET_REACH, 600 a decade; a quarter of that number on the upper edge of the box
    quiet_points = 1200
    # of a band: first distance from the axis at which L is evaluated on the upper edge of the box
    nearest_to_axis = 1e-4
    omega = np.asarray(quiet_places(loop.arm, band, quiet_points))
    half = math.sqrt(QUIET_REACH) * band
    size = abs(loop.loop_function(1j * omega))
    is_falling = size[omega > half].max() <= size[omega <= half].max()
    if size.max() >= QUIET or not is_falling:
        return False
    right = box_of(loop, band).re_max
    edge = np.r_[0.0, np.geomspace(nearest_to_axis * band, right, quiet_points // 4)] + 1j * band
    return bool(abs(loop.loop_function(edge)).max() < QUIET)


def is_known_without(loop: ContinuousLoop, name: str) -> bool:
    """Return whether poles beyond some band are known of this law, and of any nearer, once a leading coefficient is 0.

    Else high modes become unstable as it goes to 0, and their poles come to a band from above: the counts on one side
    of 0 do not follow from those on the other.
    """
    try:
        without = loop.with_number(name, 0.0)
        return without.theorem.energy in (Energy.LOSS, Energy.CONSTANT) or band_of_loop(without)[1]
    except (ParameterError, ConvergenceError):
        return False
