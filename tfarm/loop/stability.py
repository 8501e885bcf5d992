"""The verdict on a loop: stable, marginal or unstable, and for how much of the infinite spectrum that is known.

Poles are computed, completely, up to a band; what lies beyond is

* at C = 0 a theorem: with K1 > 0 every flexible mode is damped if K2 < 1 and driven if K2 > 1, and K2 = 1 leaves the
  modes of the locked hub alone (`lyapunov`), so a few modes tell the rest; where the gauge does not read the moment on
  the hub it tells nothing, and the edges of many modes are looked at (`lossless`);
* at C > 0 bounded: from the band on |L(i w)| stays below one half, and falls (the hub's inertia against ever more
  heavily damped bending), so that 1 + L has no zero there, nor further right.  Where the band of that would hold more
  modes than `MOST_BAND_MODES` it is cut, and where a segment of a lossy rig has C = 0 there is none: the verdict says
  so.

A pole at 0 remains where Kp = 0, whatever K1 and K2: verdicts are apart from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Generic, NamedTuple

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum import modes, modes_below

from .frequencies import MOST_BAND_MODES, QUIET_REACH, band_of, quiet_places
from .lossless import driven_modes, locked_edges
from .plant import HubLoop, slow_terms
from .poles import AnyLoop, Poles, poles_below

LEAST_BAND_MODES = 12  # flexible modes in the band at C = 0, and at least
QUIET = 0.5  # |L| beyond the band, at C > 0
QUIET_POINTS = 1200  # in them, 600 a decade
WIDENED = 1.6  # times, from one band that is tried to the next
MARGIN_OF_ZERO = 1e-11  # a real part below this share of |s| is none: the poles are right to a few eps
NOT_BOUNDED = (  # beyond the band: of a rig with a segment without damping, and of others
    "beyond the band not bounded: with C = 0 in the link resonances are too narrow to be looked at",
    "beyond the band not bounded: the small-gain condition would need more modes than are looked at",
)
NO_THEOREM = "beyond the band no theorem tells the modes where the gauge does not read the moment on the hub"
MIRRORED = "C = 0 and {rate} < 0: the poles are those of {opposite} mirrored, infinitely many of them unstable"
RATES = ("K1", "-K1"), ("K1 + b, with what the hub loses,", "-(K1 + b)")  # of a hub without losses, and with them
DRIVEN = "C = 0: every flexible mode beyond the band is unstable too, with a growth rate that tends to 0"
UNFELT = 1e-9  # a hub participation below this share of an ordinary one is none


@dataclass(frozen=True)
@record
class Stability(Generic[AnyLoop]):
    """`verdict` "stable", "marginal" or "unstable"; poles in the band; what is known beyond it, in words.

    Where `is_known_beyond` is false the verdict is that of the band alone.
    """

    loop: AnyLoop
    verdict: str
    unstable_roots: int
    unstable_roots_infinite: bool
    band: float
    tail: str
    poles: Poles[AnyLoop]
    is_known_beyond: bool = True

    @property
    def is_stable(self) -> bool:
        """Whether every pole but that of the free hub angle lies left of the axis."""
        return self.verdict == "stable"


def stability(arm: Arm, law: HubFeedback, band: float | None = None) -> Stability:
    """The verdict on the loop.  `band` [rad/s] is chosen if it is not given.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, and where at C > 0 one
    is on the axis to working precision.
    """
    loop = HubLoop(arm, law)
    height, quiet = (band, False) if band is not None else loop_band(loop)
    poles = poles_below(loop, height)
    beyond = _beyond(loop, quiet)
    verdict = _verdict(poles, beyond.is_unstable, loop)
    return Stability(
        loop, verdict, poles.unstable, beyond.is_infinite, poles.box.im_max, beyond.words, poles, beyond.is_known
    )


class Beyond(NamedTuple):
    """What is known beyond the band, in words: whether infinitely many poles are unstable, or at least one."""

    words: str
    is_infinite: bool = False
    is_unstable: bool = False
    is_known: bool = True


def _verdict(poles: Poles, is_unstable: bool, loop: HubLoop) -> str:
    moving, law, free = poles.moving, loop.law, loop.freed
    if is_unstable or bool((moving.real > MARGIN_OF_ZERO * abs(moving)).any()):
        return "unstable"
    at_zero = poles.values.size - moving.size
    if at_zero > 1 or (at_zero == 1 and not slow_terms(free.arm, law)[1]):
        return "marginal"
    if free.is_lossless:
        return "marginal"
    if free.is_reactive:
        told = free.is_told_by_theorem
        return "marginal" if told and not is_felt(free.arm, poles.box.im_max) else "stable"
    if free.arm.is_reactive and (moving.real > -MARGIN_OF_ZERO * abs(moving)).any():
        return "marginal"  # on the axis to working precision, and no theorem that tells on which side
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


def _beyond(loop: HubLoop, quiet: bool) -> Beyond:
    """What is known beyond the band."""
    arm, law, told = loop.arm, loop.law, loop.is_told_by_theorem
    if told and loop.takes_energy > 0:
        return Beyond("C = 0: every mode beyond the band is damped (Lyapunov), with a decay rate that tends to 0")
    if told and loop.takes_energy < 0 and arm.loses_at_hub_alone:
        return Beyond(DRIVEN, is_infinite=True, is_unstable=True)
    if arm.is_undamped and told:
        if law.K1 == 0:
            return Beyond("C = 0 and K1 = 0: nothing takes or gives energy, modes beyond the band lie on the axis")
        return Beyond("C = 0 and K2 = 1: modes with the hub at rest stay undamped, in every band")
    if loop.freed.is_reactive:
        return _beyond_lossless(loop)
    if quiet:
        return Beyond(f"beyond the band |L(iw)| < {QUIET:g} and falling: no unstable pole there (small gain)")
    return Beyond(NOT_BOUNDED[bool(arm.least_damping)], is_known=False)


def _beyond_lossless(loop: HubLoop) -> Beyond:
    """Without losses, where the gauge does not read the moment on the hub: by the modes of the locked hub."""
    arm, law = loop.freed.arm, loop.freed.law
    rate, opposite = RATES[arm is not loop.arm]
    if not law.K1:
        return Beyond(f"C = 0 and {rate} = 0: nothing takes or gives energy; {NO_THEOREM}", is_known=False)
    edges, driven = locked_edges(arm), driven_modes(arm, law.K2)
    if law.K1 < 0:
        return Beyond(MIRRORED.format(rate=rate, opposite=opposite), is_infinite=True, is_unstable=True)
    which = f"the first {len(edges)} modes of the locked hub, up to {edges.at.max():.4g} rad/s"
    if len(driven):
        words = f"C = 0: K2 is beyond the edge of {len(driven)} among {which}: two poles of each grow, ever more slowly"
        return Beyond(f"{words}; the lowest is that at {driven.at.min():.4g} rad/s", is_unstable=True)
    return Beyond(f"C = 0: {NO_THEOREM}; K2 is beyond the edge of none among {which}", is_known=False)


def loop_band(loop: HubLoop) -> tuple[float, bool]:
    """The band [rad/s] in which poles are computed, and whether the loop is quiet beyond it (always False at C = 0)."""
    few = band_of(loop.arm, LEAST_BAND_MODES)
    if loop.freed.arm.is_reactive or (loop.is_told_by_theorem and (loop.arm.is_undamped or loop.takes_energy > 0)):
        return few, False
    band = few
    while modes_below(loop.arm, band) <= MOST_BAND_MODES:
        if _has_fallen(loop, band):
            return band, is_quiet(loop, band)
        band *= WIDENED
    return max(few, band / WIDENED), False


def band_of_gains(arm: Arm, ranges: Mapping[str, tuple[float, float]]) -> tuple[float, bool]:
    """A band [rad/s] for all gains in these ranges, and whether all their loops are quiet beyond it.

    |L| is convex in the gains, so that it is largest at a corner of their box.
    """
    corners = [HubFeedback(**dict(zip(ranges, each, strict=True))) for each in product(*ranges.values())]
    bands, quiet = zip(*(loop_band(HubLoop(arm, law)) for law in corners), strict=True)
    return max(bands), all(quiet)


def is_quiet(loop: HubLoop, band: float) -> bool:
    """Whether |L(i w)| stays below `QUIET` over two decades from the band on, and falls there.

    Of a rig with an elastic segment it is not known: with what the hub or another segment loses, the resonances of that
    one become ever narrower, and pass between any points that are looked at.
    """
    return loop.arm.least_damping > 0 and _has_fallen(loop, band)


def _has_fallen(loop: HubLoop, band: float) -> bool:
    """Whether |L| is so at `QUIET_POINTS` points of these two decades, and at the resonances between them."""
    omega, half = np.asarray(quiet_places(loop.arm, band, QUIET_POINTS)), math.sqrt(QUIET_REACH) * band
    size = abs(loop.loop_function(1j * omega))
    return bool(size.max() < QUIET and size[omega > half].max() <= size[omega <= half].max())
