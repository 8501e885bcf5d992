"""The verdict on a rig under any linear law: poles counted up to a band, and what is known of those beyond it.

Beyond the band there is

* a law with a sign: on the hub's own angle or rate, through a torque that acts at once, passivity and negative
  imaginary systems tell every mode of any rig (`passivity`);
* small gain: with damping in every segment, once |L| stays below one half on the axis and on the upper edge of the
  box, 1 + L has no zero above it;
* without any damping and with a delay: the phase of what is fed back turns ever on from mode to mode, so that of
  infinitely many modes infinitely many are driven.

Else it is not known, and the verdict is that of the band.
"""

from __future__ import annotations

import math

import numpy as np

from tfarm.arm import Arm, Law
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.spectrum import modes_below

from .frequencies import MOST_BAND_MODES, QUIET_REACH, band_of, grid, quiet_places
from .law_poles import law_box, law_poles_below
from .loop import Loop
from .passivity import Signs, signs_of
from .poles import Poles
from .stability import (
    LEAST_BAND_MODES,
    MARGIN_OF_ZERO,
    QUIET,
    WIDENED,
    Stability,
    is_felt,
    must_be_off_axis,
)

UNKNOWN_ABOVE = "not known beyond {band:.4g} rad/s: neither small gain nor a theorem tells the modes there"
DELAYED = "without any damping a delayed law drives infinitely many modes beyond the band"
LISTED_LEFT = 0.5  # of 1/delay: poles are listed so far left, of ever more as |L| falls, to tell the unstable ones
LAW_QUIET_POINTS = 1600  # in the bands of QUIET_REACH, 800 a decade; a quarter of so many on the upper edge of the box
BEYOND_LAW_POLES = 1.3  # of the fastest pole of the law that rings: a band reaches so far, if it can
DULL = 0.7  # damping ratio from which on a pole of the law makes no peak
SLOWEST_BAND = 3.0  # heights: as far above it are resonances looked at one by one
NEAREST_TO_AXIS = 1e-4  # of a band: the upper edge of the box is looked at on the axis and from so near to it on


def law_stability(arm: Arm, law: Law, band: float | None = None) -> Stability[Loop]:
    """The verdict on the loop under a law.  `band` [rad/s] is chosen if it is not given.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted or one is on the axis.
    """
    loop = Loop(arm, law)
    signs = signs_of_loop(loop)
    height, quiet = (band, False) if band is not None else _band(loop, signs)
    poles = law_poles_below(loop, height, LISTED_LEFT)
    infinite, known, first = False, True, np.array([1j * band_of(loop.arm, 1)])
    if _holds(loop, signs):
        more = " and holds it statically" if signs.kind == "negative imaginary" else ""
        tail = f"{signs.reason}{more}: no mode, however high, is driven"
    elif loop.arm.is_undamped and loop.law.delay and loop.law.polynomials(first)[0].any():
        infinite, tail = True, DELAYED
    elif quiet:
        tail = f"beyond the band |L(iw)| < {QUIET:g} and falling: no unstable pole there (small gain)"
    else:
        known, tail = False, UNKNOWN_ABOVE.format(band=height)
    strict = signs.kind in ("strictly passive", "negative imaginary") and _holds(loop, signs)
    verdict = _verdict(poles, infinite, loop, strict)
    return Stability(loop, verdict, poles.unstable, infinite, poles.box.im_max, tail, poles, known)


def signs_of_loop(loop: Loop) -> Signs:
    """What the law's sign tells of this rig: nothing behind an inductance, or through anything but the hub."""
    if loop.arm.input_lags:
        return Signs("", "behind an inductance the torque comes late")
    return signs_of(loop.law, loop.arm.rate_loss)


def _holds(loop: Loop, signs: Signs) -> bool:
    """Whether the theorem leaves no pole right of the axis on this rig."""
    if signs.kind in ("strictly passive", "passive"):
        return True
    if signs.kind != "negative imaginary":
        return False
    spring = 0.0 if loop.arm.has_rigid_mode else loop.arm.hub.stiffness * loop.arm.input_per_torque
    return spring + signs.at_rest > 0


def _verdict(poles: Poles[Loop], infinite: bool, loop: Loop, strict: bool) -> str:
    """`strict`: a theorem puts every mode that the hub feels left of the axis, however little."""
    moving = poles.moving
    if infinite or bool((moving.real > MARGIN_OF_ZERO * abs(moving)).any()):
        return "unstable"
    at_zero = poles.values.size - moving.size
    if at_zero > 1 or (at_zero == 1 and not loop.arm.has_rigid_mode):
        return "marginal"
    if loop.arm.is_undamped:
        known = strict or not (moving.real > -MARGIN_OF_ZERO * abs(moving)).any()
        return "stable" if known and is_felt(loop.arm, poles.box.im_max) else "marginal"
    must_be_off_axis(moving)
    return "stable"


def _band(loop: Loop, signs: Signs) -> tuple[float, bool]:
    """The band [rad/s] in which poles are computed, and whether the loop is quiet beyond it."""
    own = loop.law.poles
    ringing = own[own.real > -DULL * abs(own)]
    fastest, highest = BEYOND_LAW_POLES * float(abs(ringing).max(initial=0.0)), band_of(loop.arm, MOST_BAND_MODES)
    least = max(band_of(loop.arm, LEAST_BAND_MODES), min(fastest, highest))
    if loop.arm.is_undamped or _holds(loop, signs) or not loop.arm.least_damping or fastest > highest:
        return least, False
    band = least
    while modes_below(loop.arm, band) <= MOST_BAND_MODES:
        if is_quiet_above(loop, band):
            return band, True
        band *= WIDENED
    return least, False


def band_for(loop: Loop) -> float:
    """The band [rad/s] in which the poles of a loop are counted."""
    return _band(loop, signs_of_loop(loop))[0]


def is_told_without(loop: Loop, name: str) -> bool:
    """Whether poles beyond some band are told, of this law or any nearer to it, once a leading coefficient is 0.

    Else high modes are driven on the way there, and their poles come to a band from above: counts in it cannot be
    carried from one side of 0 to the other.
    """
    try:
        without = loop.under(loop.law.having(name, 0.0))
        signs = signs_of_loop(without)
        return _holds(without, signs) or _band(without, signs)[1]
    except (ParameterError, ConvergenceError):
        return False


def is_quiet_above(loop: Loop, band: float) -> bool:
    """Whether 1 + L has no zero with Im s > band right of the axis, by |L| < 1/2 on the edges of that region.

    On the axis two decades are looked at, where |L| falls, with every natural frequency; on the upper edge of the box
    as far right as that reaches, and beyond |L| is smaller still.
    """
    near = np.asarray(grid(loop.arm, SLOWEST_BAND * band))
    omega = np.unique(np.r_[near[near >= band], quiet_places(loop.arm, band, LAW_QUIET_POINTS)])
    size = abs(loop.loop_function(1j * omega))
    half = math.sqrt(QUIET_REACH)
    if not size.max() < QUIET or size[omega > half * band].max() > size[omega <= half * band].max():
        return False
    right = law_box(loop, band).re_max
    edge = np.r_[0.0, np.geomspace(NEAREST_TO_AXIS * band, right, LAW_QUIET_POINTS // 4)] + 1j * band
    return bool(abs(loop.loop_function(edge)).max() < QUIET)
