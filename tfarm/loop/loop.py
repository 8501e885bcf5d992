"""The exact loop of a rig and any linear law: its loop function, and the analytic function whose zeros are its poles.

    L(s) = e^{-s tau} sum of C_i(s) G_i(s),    D(s) = drive q(s) + e^{-s tau} sum of p_i(s) numerator_i(s)

q being the common denominator of the law and p_i/q its entries: D has no poles but those of a damped link's -1/C, so
its zeros can be counted.  Where the law and the rig share a zero and a pole D keeps both: what is cancelled is seen.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Law, cancelled, full_law, must_be_arm
from tfarm.arrays import LEAST_SIZE, Complex
from tfarm.errors import ParameterError
from tfarm.exact.characteristic import Analytic, LoopParts, deflated, difference_steps
from tfarm.exact.system import System
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum.scales import first_frequency

from .resting import NEAREST_TO_ORIGIN, resting_zeros

FAR_RIGHT = (1e5, 1e6, 1e7)  # of w1: how far right an improper law is looked at
UNDISPERSED = 1e11  # of w1: where waves are no longer dispersed
FALL_FACTOR = 0.5  # L must fall by this there, from one to the next
SOMEWHERE = 0.31 + 0.71j  # of w1: where it is seen whether a signal is fed back at all; no law has its zero there
NO_ORDER = 99  # of a zero at s = 0, of what is not fed back: above that of any part


@dataclass(frozen=True)
@record
class Loop:
    """A rig under a law in s.  Raises ParameterError for a locked hub, a law in z, and an algebraic loop.

    `signals` are what is fed back: made unless they are given, as `under` gives those of another law.
    """

    arm: Arm
    law: Law
    signals: Signals = field(default=cast("Signals", None), repr=False, compare=False)

    def __post_init__(self) -> None:
        must_be_arm(self.arm)
        if self.law.input is not None and self.law.input != self.arm.input:
            object.__setattr__(self, "arm", replace(self.arm, input=self.law.input))  # type: ignore[arg-type]
        if self.arm.is_locked:
            remedy = "a locked hub (inertia = inf) takes no input: there is no loop; give the hub a finite inertia"
            raise ParameterError(key="hub.inertia", value=self.arm.hub_inertia, remedy=remedy)
        if self.law.is_discrete:
            remedy = "a law in z acts at samples: ask for the sampled loop, or leave the period out of a law in s"
            raise ParameterError(key="period", value=self.law.period, remedy=remedy)
        object.__setattr__(self, "law", full_law(self.law))
        given: Signals | None = self.signals
        if given is None or given.names != self.law.signals or given.arm != self.arm:
            object.__setattr__(self, "signals", Signals(self.arm, self.law.signals))
        self._must_fall()

    def under(self, law: Law) -> Loop:
        """The same rig under another law: what its signals are at rest is not worked out again."""
        return Loop(self.arm, law, self.signals)

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
        """How many poles are at s = 0 because the law takes off exactly what holds the rig at rest."""
        return resting_zeros(self.loop_function, first_frequency(self.arm))

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
