"""The exact loop of a rig and any linear law: its loop function, and the analytic function whose zeros are its poles.

    L(s) = e^{-s tau} sum of C_i(s) G_i(s),    D(s) = drive q(s) + e^{-s tau} sum of p_i(s) numerator_i(s)

q being the common denominator of the law and p_i/q its entries: D has no poles but those of a damped link's -1/C, so
its zeros can be counted.  Where the law and the rig share a zero and a pole D keeps both: what is cancelled is seen.
Gains at the hub are a law of order 0 on hub angle, hub rate and root moment.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback, Law, as_law, cancelled, full_law, must_be_arm, must_not_be_algebraic
from tfarm.arm.law import Part
from tfarm.arrays import LEAST_SIZE, Complex
from tfarm.errors import ParameterError
from tfarm.exact.characteristic import Analytic, LoopParts, deflated, difference_steps
from tfarm.exact.system import System
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum.table import check_gains, first_frequency

FAR_RIGHT = (1e5, 1e6, 1e7)  # of w1: how far right an improper law is looked at
UNDISPERSED = 1e11  # of w1: where waves are no longer dispersed
FALL_FACTOR = 0.5  # L must fall by this there, from one to the next
SOMEWHERE = 0.31 + 0.71j  # of w1: where it is seen whether a signal is fed back at all; no law has its zero there
NO_ORDER = 99  # of a zero at s = 0, of what is not fed back: above that of any part
SMALLEST_NORMAL = float(np.finfo(float).tiny)  # a smaller double has not all its digits
NEAREST_TO_ORIGIN = 1e-12  # of w1: where a function, its zeros at 0 divided out, is taken for its value at 0
ROUNDING_AT_REST = 1e-13  # of the terms of D: less is left by their rounding where they cancel at s = 0
ORDER_READ_AT = (2e-5, 1e-5)  # of w1: where the order of a zero at s = 0 is read off


@dataclass(frozen=True)
@record
class Loop:
    """A rig under a law in s, gains at the hub among them.

    Raises ParameterError for a locked hub, a law in z, an algebraic loop, and gains that are denormal numbers or far
    too large for the arm.  `signals` are what is fed back: made unless given, as `under` gives those of another law.
    """

    arm: Arm
    law: Law
    signals: Signals = field(default=cast("Signals", None), repr=False, compare=False)

    def __post_init__(self) -> None:
        must_be_arm(self.arm)
        law = as_law(self.law)
        if law.input is not None and law.input != self.arm.input:
            object.__setattr__(self, "arm", replace(self.arm, input=law.input))  # type: ignore[arg-type]
        if self.arm.is_locked:
            remedy = "a locked hub (inertia = inf) takes no torque: there is no loop; give the hub a finite inertia"
            raise ParameterError(key="hub.inertia", value=self.arm.hub_inertia, remedy=remedy)
        if law.is_discrete:
            remedy = "a law in z acts at samples: ask for the sampled loop, or leave the period out of a law in s"
            raise ParameterError(key="period", value=law.period, remedy=remedy)
        object.__setattr__(self, "law", full_law(law))
        given: Signals | None = self.signals
        if given is None or given.names != self.law.signals or given.arm != self.arm:
            object.__setattr__(self, "signals", Signals(self.arm, self.law.signals))
        if self.gains is not None:
            _must_be_possible(self.arm, self.gains)
        self._must_fall()

    def under(self, law: Law) -> Loop:
        """The same rig under another law: what its signals are at rest is not worked out again."""
        return Loop(self.arm, law, self.signals)

    def having(self, name: str, value: float) -> Loop:
        """The same loop with another value of one number of its law."""
        return self.under(self.law.having(name, value))

    @cached_property
    def gains(self) -> HubFeedback | None:
        """The gains at the hub of a law that is no more than those."""
        return self.law.gains

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of the law in which D is linear, by name: the gains at the hub, or `Law.numbers`."""
        return self.law.numbers if self.gains is None else self.gains.by_name

    @cached_property
    def feeds_back(self) -> bool:
        """Whether the law feeds anything back."""
        return bool(self.law.polynomials(np.array([SOMEWHERE * first_frequency(self.arm)]))[0].any())

    @cached_property
    def is_lossless(self) -> bool:
        """Whether D is real on the imaginary axis, and its zeros come in pairs +-s: nothing takes or gives energy."""
        if not self.feeds_back:
            return self.arm.is_undamped
        odd = [each.power % 2 for each in self.signals.outputs]
        return self.arm.is_reactive and self.law.is_static and not (np.array(odd) @ abs(self._static)).any()

    @property
    def _static(self) -> Complex:
        """What a static law multiplies each signal by (signals, 1)."""
        return self.law.polynomials(np.ones(1, complex))[0]

    @cached_property
    def at_rest(self) -> tuple[float, float, float] | None:
        """c, b and J of  D/theta = c + b s + J s^2 + ...  of gains at the hub of an arm that turns; None of others."""
        if self.gains is None or not self.arm.has_rigid_mode:
            return None
        arm, gains = self.arm, self.gains
        J = arm.turned_inertia - gains.K2 * arm.gauged_inertia
        if arm.is_uniform:  # to the last digit: I_h and (1 - K2) (J - I_h) may cancel
            J = arm.hub_inertia + (1.0 - gains.K2) * arm.carried_inertia
        return gains.Kp, gains.K1 + arm.rate_loss, J

    @property
    def k(self) -> System:
        """The exact system."""
        return self.signals.system

    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Denominator and numerator of L at s, up to one factor: finite at poles too."""
        s = np.asarray(s, dtype=complex)
        drive, fed_back, _ = self._parts(s, self.signals.kept(s))
        return drive, fed_back

    def loop_function(self, s: NDArray[Any]) -> Complex:
        """L(s): closed-loop poles are at L = -1.  Infinite at poles of the rig or of the law."""
        drive, fed_back = self.parts(s)
        return np.asarray(np.divide(fed_back, drive, out=np.full(drive.shape, np.inf + 0j), where=drive != 0))

    @cached_property
    def zeros_at_origin(self) -> int:
        """How often D vanishes at s = 0: as the least of its terms does, and more often where these cancel."""
        integrators = int((self.law.poles == 0).sum())
        terms = [self.k.at_rest + integrators]
        numerators, _ = self.law.polynomials(np.array([SOMEWHERE * first_frequency(self.arm)]))
        for row, order in enumerate(self.signals.orders):
            if abs(numerators[row, 0]) > 0:
                terms.append(order + self._order_of(row))
        return min(terms) + self.resting_zeros

    @cached_property
    def resting_zeros(self) -> int:
        """How many poles are at s = 0 because the law takes off exactly what holds the rig at rest: L(0) = -1.

        Which terms of D vanish at s = 0 is known from their orders; that they cancel there is seen in their values
        alone.  What is odd in s next to 0 is taken off by the mean on both sides.
        """
        s = first_frequency(self.arm) * np.array([NEAREST_TO_ORIGIN, -NEAREST_TO_ORIGIN, *ORDER_READ_AT]) + 0j
        with np.errstate(all="ignore"):  # L is infinite at a pole of the rig or of the law: then nothing cancels
            right, left, farther, nearer = 1 + self.loop_function(s)
            cancels = abs(right + left) <= 2 * ROUNDING_AT_REST and abs(right) < 1  # else what is odd hides the rest
        return round(float(np.log2(abs(farther / nearer)))) if cancels else 0

    def _order_of(self, row: int) -> int:
        """How often p_i vanishes at s = 0: those zeros of its parts, and integrators of the others."""
        name, orders = self.law.signals[row], []
        for n, part in enumerate(self.law.parts):
            if name in part.signals:
                others = sum(int((each.block.poles == 0).sum()) for m, each in enumerate(self.law.parts) if m != n)
                own = part.block.zeros_at_origin(part.signals.index(name))
                orders.append(NO_ORDER if own is None else others + own)
        return min(orders)

    def function(self, s: Complex) -> Analytic:
        """D/s^n, n = `zeros_at_origin`, with slopes from differences."""
        s = np.where(s == 0, NEAREST_TO_ORIGIN * first_frequency(self.arm), np.asarray(s, dtype=complex))
        h = difference_steps(self.k, s)
        at = np.array([s, s + h, s - h])
        drive, fed_back, scale = self._parts(at, self.signals.parts(at))
        scale = scale - self.delay_of_waves * at
        with np.errstate(over="ignore", invalid="ignore"):  # far from where it is large: no number, and no start
            up, down = (drive + fed_back)[1:] * np.exp(scale[1:] - scale[0])
            return deflated((drive + fed_back)[0], (up - down) / (2 * h), scale[0], s, self.zeros_at_origin)

    @cached_property
    def delay_of_waves(self) -> float:
        """T [s] with D ~ e^{s T} far right: D e^{-s T}, with the same zeros, does not turn along a wide box."""
        far = UNDISPERSED * first_frequency(self.arm)
        scale = self.signals.parts(np.array([far, 2 * far], complex)).scale.real
        return float(max(0.0, scale[1] - scale[0]) / far)

    def characteristic(self, s: Complex, of_rig: LoopParts) -> Complex:
        """D(s) up to a factor that no law changes, so that two laws may be added; `of_rig` are the signals' parts."""
        entries, whole = self.law.polynomials(s)
        late = np.exp(-s * self.law.delay)
        return np.asarray(of_rig.drive * whole + late * (entries * of_rig.numerators).sum(axis=0))

    def _parts(self, s: Complex, of_rig: LoopParts) -> tuple[Complex, Complex, Complex]:
        """drive q, the fed back sum, both times e^{-scale}, and scale."""
        drive, numerators, scale = of_rig
        entries, whole = self.law.polynomials(s)
        fed_back = (entries * numerators).sum(axis=0)
        late = s * self.law.delay
        shift = np.maximum(0.0, -late.real)  # left of the axis the delayed part is the larger one
        drive, fed_back = drive * whole * np.exp(-shift), fed_back * np.exp(-late - shift)
        size = np.maximum(np.maximum(abs(drive), abs(fed_back)), LEAST_SIZE)
        return drive / size, fed_back / size, scale + shift + np.log(size)

    def _must_fall(self) -> None:
        """Refuse a law that asks for more than the rig gives at once: then its loop is algebraic."""
        if self.arm.has_massless_hub and any(map(_passes_moment_on, self.law.parts)):
            key, value = ("law.root_moment", self.law.name) if self.gains is None else ("K2", self.gains.K2)
            must_not_be_algebraic(self.arm, key, value)
        if not self.law.is_improper:
            return
        far = first_frequency(self.arm) * np.array(FAR_RIGHT) + 0j
        drive, numerators, _ = self.signals.parts(far)
        entries, whole = self.law.polynomials(far)
        with np.errstate(all="ignore"):
            size = abs((entries * numerators).sum(axis=0) / (drive * whole))  # L without its delay
        if not (np.isfinite(size).all() and (size[1:] < FALL_FACTOR * size[:-1]).all()):
            worst = next(p for p in self.law.parts if p.block.excess > 0)
            remedy = (
                "its numerator has too high a degree for this signal, so that the loop is algebraic; add a pole to den"
            )
            raise ParameterError(key=f"law.{worst.signals[0]}.num", value=worst.block.excess, remedy=remedy)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What a person should know of the law: poles right of the axis that its own zeros cancel."""
        return cancelled(self.law)


def _passes_moment_on(part: Part) -> bool:
    """Whether a part of a law takes the root moment and gives some of it at once."""
    if "root_moment" not in part.signals or part.block.excess != 0:
        return False
    return bool(part.block.matrices()[3][0, part.signals.index("root_moment")])


def _must_be_possible(arm: Arm, gains: HubFeedback) -> None:
    """Raise ParameterError for gains with which there is no loop, or which no double or machine can tell."""
    if gains.K2 and arm.is_undamped and not (arm.hub_side_inertia or arm.reads_hub_moment):
        remedy = "with hub.inertia = 0 and no damping K2 moves poles through infinity; use K2 = 0 or some inertia"
        raise ParameterError(key="K2", value=gains.K2, remedy=remedy)
    least = SMALLEST_NORMAL * max(1.0, arm.total_inertia if arm.has_rigid_mode else 1.0)
    for name, value in gains.by_name.items():
        if 0 < abs(value) < least:
            remedy = f"0, or at least {least:.1e} in size: of less the double has not all its digits"
            raise ParameterError(key=name, value=value, remedy=remedy)
    check_gains(arm, gains)
