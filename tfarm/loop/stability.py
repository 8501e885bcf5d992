"""The verdict on a loop: stable, marginal or unstable, and for how much of the infinite spectrum that is known.

Poles are computed, completely, up to a band; what lies beyond is known by

* a theorem on the sign of the law (`theorem`): on the hub's own angle or rate, through a torque that acts at once, it
  tells every mode of any rig; with feedback of the hub's moment every mode of a rig without damping, so that a few
  modes tell the rest;
* small gain: with damping in every segment, once |L| stays below one half on the axis, and falls, and on the upper
  edge of the box, 1 + L has no zero above it.  Where the band of that would hold more modes than `MOST_BAND_MODES` it
  is cut, and where a segment of a lossy rig has C = 0 there is none;
* delay without any damping: the phase of what is fed back turns ever on from mode to mode, so that of infinitely many
  modes infinitely many are driven.

Else it is not known, and the verdict is that of the band.  A pole at 0 remains where nothing holds the hub's angle:
verdicts are apart from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from tfarm.arm import AnyLaw, Arm, as_law
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.schema import Quantity
from tfarm.spectrum import modes, modes_below

from .loop import MOST_BAND_MODES, QUIET_REACH, Loop, band_of, quiet_places
from .poles import Poles, box_of, poles_below
from .theorem import GIVES, TAKES, Theorem, theorem_of

LEAST_BAND_MODES = 12  # flexible modes in the band at C = 0, and at least
QUIET = 0.5  # |L| beyond the band, with damping
QUIET_POINTS = 1200  # in the bands of QUIET_REACH, 600 a decade; a quarter of so many on the upper edge of the box
WIDENED = 1.6  # times, from one band that is tried to the next
MARGIN_OF_ZERO = 1e-11  # a real part below this share of |s| is none: the poles are right to a few eps
LISTED_LEFT = 0.5  # of 1/delay: poles are listed so far left, of ever more as |L| falls, to tell the unstable ones
BEYOND_LAW_POLES = 1.3  # of the fastest pole of the law that rings: a band reaches so far, if it can
DULL = 0.7  # damping ratio from which on a pole of the law makes no peak
NEAREST_TO_AXIS = 1e-4  # of a band: the upper edge of the box is looked at on the axis and from so near to it on
UNFELT = 1e-9  # a hub participation below this share of an ordinary one is none
DELAYED = "without any damping a delayed law drives infinitely many modes beyond the band"
SMALL_GAIN = f"beyond the band |L(iw)| < {QUIET:g} and falling: no unstable pole there (small gain)"
UNKNOWN_ABOVE = "converged up to {band:.4g} rad/s, not determined beyond, neither by small gain nor by a theorem"


@dataclass(frozen=True)
@record
class Stability:
    """`verdict` "stable", "marginal" or "unstable"; poles in the band; what is known beyond it, in words.

    Where `is_known_beyond` is false the verdict is that of the band alone.
    """

    loop: Annotated[Loop, Quantity(flat=True)]
    verdict: Annotated[str, Quantity("stability")]
    unstable_roots: Annotated[int, Quantity("unstable poles", help="in the frequency range")]
    unstable_roots_infinite: Annotated[bool, Quantity(help="infinitely many poles beyond the range are unstable")]
    band: Annotated[float, Quantity("frequency range, up to", "rad/s", key="up_to_rad_s")]
    tail: Annotated[str, Quantity("beyond that", key="beyond")]
    poles: Poles
    is_known_beyond: Annotated[bool, Quantity("stability known beyond that", key="known_beyond")] = True

    @property
    def spectral_abscissa(self) -> Annotated[float, Quantity("spectral abscissa", "1/s", 6, "largest Re s in range")]:
        """The largest real part [1/s] of the poles in range, apart from those at 0."""
        return self.poles.spectral_abscissa

    @property
    def free_pole(self) -> Annotated[str | None, Quantity("free hub angle")]:
        """The pole at 0 from which the verdict is apart."""
        return "its pole at s = 0 is left out" if self.poles.moving.size < self.poles.values.size else None

    @property
    def is_stable(self) -> Annotated[bool, Quantity(key="stable")]:
        """Whether every pole but that of the free hub angle lies left of the axis."""
        return self.verdict == "stable"


def stability(arm: Arm, law: AnyLaw, band: float | None = None) -> Stability:
    """The verdict on the loop of an arm and a law.  `band` [rad/s] is chosen if it is not given.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, and where with damping
    one is on the axis to working precision.
    """
    return verdict_on(Loop(arm, as_law(law)), band)


def verdict_on(loop: Loop, band: float | None = None) -> Stability:
    """`stability` of a loop."""
    theorem = theorem_of(loop)
    height, quiet = (band, False) if band is not None else band_of_loop(loop, theorem)
    poles = poles_below(loop, height, LISTED_LEFT)
    words, is_infinite, is_known = _beyond(loop, theorem, quiet, height)
    verdict = _verdict(poles, theorem, is_infinite)
    return Stability(loop, verdict, poles.unstable, is_infinite, poles.box.im_max, words, poles, is_known)


def _beyond(loop: Loop, theorem: Theorem, quiet: bool, band: float) -> tuple[str, bool, bool]:
    """Words on what lies beyond the band; whether infinitely many poles there are unstable; whether it is known."""
    if theorem.energy is not None:
        return theorem.reason, theorem.energy == GIVES, True
    if quiet:
        return SMALL_GAIN, False, True
    if loop.arm.is_undamped and loop.law.delay and loop.feeds_back:
        return DELAYED, True, True
    return UNKNOWN_ABOVE.format(band=band), False, False


def _verdict(poles: Poles, theorem: Theorem, is_infinite: bool) -> str:
    """The verdict from the poles of the band and the theorem, which may know a side that rounding hides."""
    moving, arm = poles.moving, poles.loop.arm
    if is_infinite or bool((moving.real > MARGIN_OF_ZERO * abs(moving)).any()):
        return "unstable"
    at_zero = poles.values.size - moving.size
    if at_zero > 1 or (at_zero == 1 and not arm.has_rigid_mode):
        return "marginal"
    if arm.loses_at_hub_alone:
        known = theorem.energy == TAKES or not (moving.real > -MARGIN_OF_ZERO * abs(moving)).any()
        return "stable" if known and is_felt(arm.lossless_hub, poles.box.im_max) else "marginal"
    must_be_off_axis(moving)
    return "stable"


def must_be_off_axis(stable: Complex) -> None:
    """Refuse poles [1/s], none of which is right of the axis, where one may be on it, by ConvergenceError."""
    on_axis = stable[stable.real > -MARGIN_OF_ZERO * abs(stable)]
    if on_axis.size:
        text = f"the pole at {on_axis[0]:.6g} 1/s is on the imaginary axis to working precision: neither stable nor not"
        raise ConvergenceError(text, complex(on_axis[0]), float(on_axis[0].real))


def is_felt(arm: Arm, up_to: float) -> bool:
    """Whether the hub takes part in every flexible mode below `up_to` [rad/s], by rotation or by root moment.

    At C = 0 a mode that it does not feel stays undamped under any law: so it is for exceptional arms only.
    """
    return modes_below(arm, up_to) == 0 or bool((felt(arm, up_to).max(axis=0) > UNFELT).all())


def felt(arm: Arm, up_to: float) -> Real:
    """Rotation and root moment at the hub (2, modes) of the flexible modes below `up_to` [rad/s], as shares.

    Of sqrt(1/m) k and sqrt(1/m) E I k^2, those of a slender beam of mass m with waves of the same frequency: high modes
    tend to sqrt 2 and 0 on a free pin, to 0 and 2 where the hub is heavy.
    """
    table, EI = modes(arm, up_to=up_to), arm.bending_scale * arm.length
    flexible = table.index > 0
    omega, b = table.natural_frequency[flexible], abs(table.hub_participation[flexible])
    k, scale = np.sqrt(omega) * (arm.own_mass / arm.length / EI) ** 0.25, np.sqrt(arm.own_mass)
    return np.array([b * scale / k, b * arm.hub_side_inertia * omega**2 * scale / (EI * k**2)])


def band_of_loop(loop: Loop, theorem: Theorem | None = None) -> tuple[float, bool]:
    """The band [rad/s] in which poles are computed, and whether the loop is quiet beyond it (never without damping)."""
    theorem, arm, own = theorem or theorem_of(loop), loop.arm, loop.law.poles
    ringing = own[own.real > -DULL * abs(own)]
    fastest, highest = BEYOND_LAW_POLES * float(abs(ringing).max(initial=0.0)), band_of(arm, MOST_BAND_MODES)
    least = max(band_of(arm, LEAST_BAND_MODES), min(fastest, highest))
    is_told = theorem.energy is not None and (arm.has_elastic_link or not loop.law.is_static)
    if arm.loses_at_hub_alone or is_told or fastest > highest:
        return least, False
    band = least
    while modes_below(arm, band) <= MOST_BAND_MODES:
        if has_fallen(loop, band):
            return band, arm.least_damping > 0
        band *= WIDENED
    return max(least, band / WIDENED) if loop.law.is_static else least, False


def band_of_family(loops: Iterable[Loop]) -> tuple[float, bool]:
    """A band [rad/s] for all these loops, and whether they are all quiet beyond it."""
    bands, quiet = zip(*map(band_of_loop, loops), strict=True)
    return max(bands), all(quiet)


def is_quiet(loop: Loop, band: float) -> bool:
    """Whether small gain tells every pole beyond a band.

    Of a rig with an elastic segment it is not known: with what the hub or another segment loses, the resonances of that
    one become ever narrower, and pass between any points that are looked at.
    """
    return loop.arm.least_damping > 0 and has_fallen(loop, band)


def has_fallen(loop: Loop, band: float) -> bool:
    """Whether 1 + L has no zero with Im s > band right of the axis, by |L| < 1/2 on the edges of that region.

    On the axis two decades are looked at, where |L| falls, with the natural frequencies between; on the upper edge of
    the box as far right as that reaches, and beyond |L| is smaller still.
    """
    omega, half = np.asarray(quiet_places(loop.arm, band, QUIET_POINTS)), math.sqrt(QUIET_REACH) * band
    size = abs(loop.loop_function(1j * omega))
    if not (size.max() < QUIET and size[omega > half].max() <= size[omega <= half].max()):
        return False
    right = box_of(loop, band).re_max
    edge = np.r_[0.0, np.geomspace(NEAREST_TO_AXIS * band, right, QUIET_POINTS // 4)] + 1j * band
    return bool(abs(loop.loop_function(edge)).max() < QUIET)


def is_known_without(loop: Loop, name: str) -> bool:
    """Whether poles beyond some band are known, of this law or any nearer to it, once a leading coefficient is 0.

    Else high modes are driven on the way there, and their poles come to a band from above: counts in it cannot be
    carried from one side of 0 to the other.
    """
    try:
        without = loop.having(name, 0.0)
        return theorem_of(without).energy in (TAKES, 0) or band_of_loop(without)[1]
    except (ParameterError, ConvergenceError):
        return False
