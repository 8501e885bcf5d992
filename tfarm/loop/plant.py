"""The loop of an arm and a law: what is refused, the loop function, and the characteristic function to follow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, RATE_GAIN, Arm, HubFeedback, must_be_arm, must_not_be_algebraic
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.exact.characteristic import Gains, gains_of, loop_parts, loop_system, torque
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.series import expansions_at_zero
from tfarm.exact.system import System
from tfarm.records import record
from tfarm.spectrum.correction import Member
from tfarm.spectrum.damped import member
from tfarm.spectrum.scales import check_gains, first_frequency, most_gain
from tfarm.spectrum.search import ARMS_KEPT

from .resting import resting_zeros

SMALLEST_NORMAL = float(np.finfo(float).tiny)  # a smaller double has not all its digits


@dataclass(frozen=True)
@record
class Loop:
    """An arm under a law at its hub.

    Raises ParameterError where there is no loop: a locked hub cannot turn; a pin without inertia has M(0) = -u at every
    instant, so that feeding the moment back is an algebraic loop; a gain may be 0, but neither a denormal number nor
    absurdly large for the arm.
    """

    arm: Arm
    law: HubFeedback

    def __post_init__(self) -> None:
        must_be_arm(self.arm)
        if self.arm.is_locked:
            remedy = "a locked hub (inertia = inf) takes no torque: there is no loop; give the hub a finite inertia"
            raise ParameterError(key="hub.inertia", value=self.arm.hub_inertia, remedy=remedy)
        if self.law.K2:
            must_not_be_algebraic(self.arm, "K2", self.law.K2)
        if self.law.K2 and self.arm.is_undamped and not (self.arm.hub_side_inertia or self.arm.reads_hub_moment):
            remedy = "with hub.inertia = 0 and no damping K2 moves poles through infinity; use K2 = 0 or some inertia"
            raise ParameterError(key="K2", value=self.law.K2, remedy=remedy)
        least = SMALLEST_NORMAL * max(1.0, self.arm.total_inertia if self.arm.has_rigid_mode else 1.0)
        for gain in GAINS:
            if 0 < abs(self.law[gain.name]) < least:
                remedy = f"0, or at least {least:.1e} in size: of less the double has not all its digits"
                raise ParameterError(key=gain.name, value=self.law[gain.name], remedy=remedy)
        check_gains(self.arm, self.law)

    @cached_property
    def k(self) -> System:
        """The arm's dimensionless coefficients."""
        return loop_system(self.arm)

    @cached_property
    def gains(self) -> Gains:
        """The law's dimensionless gains."""
        return gains_of(self.k, self.law)

    @property
    def takes_energy(self) -> int:
        """At C = 0: 1 where the law damps every oscillating mode that the hub feels, -1 where it drives them all.

        0 where it does neither: K1 = 0 leaves no loss, K2 = 1 leaves the modes of the locked hub.  By Lyapunov's
        argument it is the sign of K1 (1 - K2), whatever Kp, with K1 plus the hub's friction for K1 of a rig.  It knows
        nothing of a gain on any other output.
        """
        if not self.law.is_at_hub:
            return 0
        return int(np.sign(self.law.K1 + self.arm.rate_loss)) * int(np.sign(1.0 - self.moment_share))

    @property
    def at_rest(self) -> tuple[float, float]:
        """b and c of  D/theta = J s^2 + b s + c + ...  of a turning arm: K1 with what the hub loses, and Kp."""
        c, b, *_ = slow_terms(self.arm, self.law)
        return b + self.arm.rate_loss, c

    @property
    def moment_share(self) -> float:
        """How much of the moment on the hub the law takes off it: K2, over the input that a torque of 1 N m takes."""
        return self.law.K2 / self.arm.input_per_torque

    @cached_property
    def freed(self) -> Loop:
        """A loop with the same poles whose hub loses nothing, if only that hides a reactive arm: the law's K1 takes it.

        Friction and back-EMF act as a rate gain does where the input acts at once.  Otherwise the loop itself.
        """
        arm, whole = self.arm.lossless_hub, self.law[RATE_GAIN] + self.arm.rate_loss
        is_loop = arm.hub_side_inertia > 0 and abs(whole) <= most_gain(arm, RATE_GAIN)
        if not (self.arm.rate_loss and arm.is_reactive and is_loop):
            return self
        return Loop(arm, self.law.having(RATE_GAIN, whole))

    @property
    def is_reactive(self) -> bool:
        """Whether on the axis all of D but the rate gain's part is real: without losses, by gains at the hub."""
        return self.arm.is_reactive and self.law.is_at_hub

    @property
    def is_told_by_theorem(self) -> bool:
        """Whether `takes_energy` tells every mode: elastic links, and a gauge that reads the hub's moment, if used.

        What hub, clamp and joint lose only adds to K1 > 0.
        """
        acts_well = not self.arm.input_lags and (self.arm.reads_hub_moment or not self.law.K2)
        return self.arm.has_elastic_link and self.law.is_at_hub and (acts_well or not any(self.law.row))

    @property
    def is_lossless(self) -> bool:
        """Whether nothing takes or gives energy, so that zeros of D come in pairs +-s: K1 = 0 without any loss, or
        K2 = 1 where a theorem tells."""
        if not self.arm.is_undamped:
            return False
        is_even = not any(self.law.row) or (self.is_reactive and not self.law.K1)
        return is_even or (self.is_told_by_theorem and not self.takes_energy)

    @cached_property
    def resting_zeros(self) -> int:
        """How many poles are at s = 0 because the law takes off exactly what holds the rig at rest."""
        return 0 if self.arm.has_rigid_mode else resting_zeros(self.loop_function, first_frequency(self.arm))

    @property
    def member(self) -> Member:
        """The closed loop's characteristic function, its zeros at the origin divided out."""
        return member(self.k, self.gains)

    def loop_function(self, s: NDArray[Any]) -> Complex:
        """L(s), the law's gains times the transfer functions to what they multiply: closed-loop poles are at L = -1.

        Infinite at the arm's own poles.
        """
        drive, fed_back = self.parts(s)
        return np.asarray(np.divide(fed_back, drive, out=np.full(drive.shape, np.inf + 0j), where=drive != 0))

    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Denominator and numerator of L at s, up to one factor: finite at poles too."""
        drive, numerators, _ = loop_parts(self.k, np.asarray(s, dtype=complex))
        return drive, np.asarray(torque(map(float, self.gains), numerators))


def effective_inertia(arm: Arm, law: HubFeedback) -> float:
    """I_h + (1 - K2)(J - I_h) [kg m^2]: what slow torque turns once the moment is fed back.

    In units of the input, and with what the root's gauge reads of the turning rig in the place of J - I_h.
    """
    if arm.is_uniform and law.is_at_hub:
        return arm.hub_inertia + (1.0 - law.K2) * arm.carried_inertia
    return float(arm.turned_inertia + slow_terms(arm, law)[2])


def slow_terms(arm: Arm, law: HubFeedback) -> Real:
    """What a law adds to the coefficients of 1, s, s^2 and s^3 in D/theta of a turning arm (4,), in units of the input.

    Of the hub's own outputs Kp, K1, -K2 (J - I_h) and K2 (J - I_h) C, of any other what its expansion at s = 0 says.
    """
    by_moment = law.K2 * arm.gauged_inertia
    terms = np.array([law.Kp, law.K1, -by_moment, by_moment * arm.damping])
    for gain in law.elsewhere:
        terms += law[gain.name] * _beside_angle(arm, gain.output)
    return terms


@lru_cache(maxsize=ARMS_KEPT)
def _beside_angle(arm: Arm, output: str) -> Real:
    """Coefficients of 1, s, s^2 and s^3 in an output over the hub's angle, those known; 0 of an arm that is held."""
    if not arm.has_rigid_mode:
        return np.zeros(4)
    below, above = expansions_at_zero(loop_system(arm), [OUTPUTS["hub_angle"], OUTPUTS[output]])
    first = 0 if below[0] else 1  # a hub that loses something turns with s^-1
    found, rest = np.zeros(4), np.array(above[first:])
    for power in range(rest.size):
        found[power] = rest[0] / below[first]
        rest = rest[1:] - found[power] * np.array(below[first + 1 : first + rest.size])
    return found
