"""Where poles cross the imaginary axis along a line of laws, for all windows at once (`tfarm.crossing` on s = i w).

Along laws g0 + t g1 the characteristic function is N(s) + t P(s), linear in t.  A real pole crosses at s = 0, where
t(s) = -N/P for real s has a finite limit, and goes right if t(s) grows with s.

At C = 0 h vanishes identically along K2 where the gauge reads the hub's moment: there is no curve, only the line
K2 = 1; `windows` knows that case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.arrays import Complex, Real
from tfarm.crossing import Crossing, Crossings, crossed
from tfarm.exact.characteristic import gains_of, loop_parts, torque
from tfarm.exact.system import System, system_of
from tfarm.spectrum import flexible_frequencies, modes

from .frequencies import grid

NO_FEEDBACK = HubFeedback()  # every gain 0
SAME_FREQUENCY = 1e-12  # of a frequency: nearer than this are two numbers for one
FINITE_LIMIT = 1.5  # times the gain at the farther of two small s: more at the nearer one is a gain without a limit
JUST_BEYOND = 1.01  # of a band: natural frequencies up to there, as one may be at its end
NEARLY_AT_REST = 1e-7  # of the lowest frequency: values there are those at s = 0 to as many digits


@dataclass(frozen=True, slots=True)
class Line:
    """Laws base + t direction, t real."""

    base: HubFeedback
    direction: HubFeedback

    def at(self, t: float) -> HubFeedback:
        """The law at t."""
        return self.base.plus(self.direction, t)

    @property
    def length(self) -> float:
        """The largest gain of the direction."""
        return max(map(abs, self.direction.row))


def along(name: str, law: HubFeedback) -> Line:
    """The line on which one gain takes every value, t being that value, and the others keep theirs."""
    return Line(law.having(name, 0.0), NO_FEEDBACK.having(name, 1.0))


def line_crossings(arm: Arm, line: Line, band: float) -> Crossings:
    """All crossings of the imaginary axis at frequencies `at` up to `band` [rad/s], ascending in t."""
    k, unit, found = system_of(arm), line.length, static_crossings(arm, line)
    if unit:
        unified = Line(line.base, NO_FEEDBACK.plus(line.direction, 1 / unit))
        t, at, change = crossed(np.asarray(grid(arm, band)), lambda w: line_parts(k, unified, 1j * w))
        if arm.is_undamped and line.base == NO_FEEDBACK:  # at t = 0 poles are at the arm's own frequencies
            own = np.r_[np.inf, flexible_frequencies(arm, JUST_BEYOND * band)]
            t = np.where(abs(at[:, None] - own).min(axis=1) < SAME_FREQUENCY * at, 0.0, t)
        found += [Crossing(*each) for each in zip(t / unit, at, change, strict=True)]
    return Crossings.of(found)


def line_parts(k: System, line: Line, s: NDArray[Any]) -> tuple[Complex, Complex]:
    """N and P at s, up to one common positive factor."""
    drive, numerators, _ = loop_parts(k, s)
    base, way = (torque(map(float, gains_of(k, law)), numerators) for law in (line.base, line.direction))
    return drive + base, way


def static_crossings(arm: Arm, line: Line) -> list[Crossing]:
    """That of `crossing_at_zero`, if there is one."""
    found = crossing_at_zero(arm, line)
    return [] if found is None else [found]


def crossing_at_zero(arm: Arm, line: Line) -> Crossing | None:
    """A real pole through s = 0, if there is a t at which one passes.

    Of an arm that turns freely  D/theta = Kp + K1 s + J s^2 + c s^3 + ...,  with J the effective inertia, the hub's
    friction in K1, and what other gains add to each (`slow_terms`): the lowest coefficient that does not vanish all
    along the line decides, and the pole passes where it is 0.  Of an arm whose tip is held it passes where the static
    stiffness vanishes.
    """
    if not arm.has_rigid_mode:
        small = NEARLY_AT_REST * float(modes(arm, 1).natural_frequency[-1])
        return through_origin(*line_parts(system_of(arm), line, small * np.array([1 + 0j, 0.5])))
    base, way = (slow_terms(arm, law).tolist() for law in (line.base, line.direction))
    if way[0]:
        t = -base[0] / way[0] + 0.0
        return Crossing(t, 0.0, _sign(way[0]) * _change_with_stiffness(arm, line.at(t)))
    if base[0]:
        return None
    if way[1]:
        t = -(base[1] + arm.rate_loss) / way[1] + 0.0
        return Crossing(t, 0.0, -_sign(way[1] * effective_inertia(arm, line.at(t))))
    if base[1] + arm.rate_loss or not way[2]:  # where 0, below the rounding of the hub's own: no gain reaches so far
        return None
    return Crossing(-(arm.turned_inertia + base[2]) / way[2], 0.0, -_sign(way[2]))


def _change_with_stiffness(arm: Arm, law: HubFeedback) -> int:
    """How many more poles are unstable above Kp = 0 than below: by K1 if not 0, else by J s^2 + c s^3, c ~ K2 C."""
    _, b, _, c = slow_terms(arm, law).tolist()
    if b + arm.rate_loss:
        return -_sign(b + arm.rate_loss)
    J = effective_inertia(arm, law)
    oscillating = 2 if c * J > 0 else 0  # against one real pole on the other side
    return _sign(J) * (oscillating - 1)


def through_origin(N: Complex, P: Complex) -> Crossing | None:
    """A real pole through s = 0, from N and P at two small real s, the second half the first; None without a limit."""
    if not P.all():
        return None
    far, near = -(N / P).real
    if not abs(near) < FINITE_LIMIT * abs(far):
        return None
    return Crossing(float(2 * near - far), 0.0, 1 if far > near else -1)


def effective_inertia(arm: Arm, law: HubFeedback) -> float:
    """I_h + (1 - K2)(J - I_h) [kg m^2]: what slow torque turns once the moment is fed back.

    In units of the input, and with what the root's gauge reads of the turning rig in the place of J - I_h.
    """
    if arm.is_uniform:
        return arm.hub_inertia + (1.0 - law.K2) * arm.carried_inertia
    return float(arm.turned_inertia + slow_terms(arm, law)[2])


def slow_terms(arm: Arm, law: HubFeedback) -> Real:
    """What a law adds to the coefficients of 1, s, s^2 and s^3 in D/theta (4,) of a turning arm."""
    by_moment = law.K2 * arm.gauged_inertia
    return np.array([law.Kp, law.K1, -by_moment, by_moment * arm.damping])


def _sign(value: float) -> int:
    return int(np.sign(value))
