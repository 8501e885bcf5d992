"""The continuous-time loop, exact: its loop function, and the analytic function whose zeros are its poles.

    L(s) = e^{-s tau} sum of C_i(s) G_i(s),    D(s) = drive q(s) + e^{-s tau} sum of p_i(s) numerator_i(s)

q is the common denominator of the law and p_i/q its entries: D has no poles but a damped link's -1/C, so its zeros can
be counted.  Where the law and the rig share a zero and a pole, D keeps both: no cancellation is hidden.  Gains at the
hub are a law of order 0 on hub angle, hub rate and root moment.

Along s = i w the loop function is steep at the arm's natural frequencies, at those with the hub locked (zeros of the
hub angle) and with the hub free of inertia (zeros of the root moment).  At small C these features are as narrow as
C w^2, so a grid has points at geometric distances from each.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import (
    Arm,
    HubFeedback,
    Law,
    must_have_free_hub,
    must_not_be_algebraic,
)
from tfarm.arrays import Complex
from tfarm.case import Case
from tfarm.errors import require
from tfarm.exact.characteristic import Analytic, Feedback, LoopParts, deflate, difference_steps, feedback
from tfarm.exact.system import System
from tfarm.loop.loop import Loop
from tfarm.loop.theorem import Theorem, theorem_of
from tfarm.records import frozen
from tfarm.response.signals import ControllerSignals, Signals, controller
from tfarm.schema import Quantity
from tfarm.spectrum import flexible_frequencies, modes, modes_below
from tfarm.spectrum.frequencies import ARMS_KEPT
from tfarm.spectrum.gains import LEAST_UNITS, check_gains
from tfarm.spectrum.table import first_frequency

# of w1: far right, where L of an improper law must fall, and poles come from infinity
FAR_RIGHT = (1e5, 1e6, 1e7)
# of w1: where a function, its zeros at 0 divided out, is taken for its value at 0
NEAREST_TO_ORIGIN = 1e-12
# of w1: where the order of a zero at s = 0 is read off
ORDER_READ_AT = (2e-5, 1e-5)
# of the first steep place: where a grid begins, as nothing bends there
SLOWEST = 1e-6
# times a band: the end of the range beyond it in which |L| is evaluated, two decades of its fall
QUIET_REACH = 100.0
# flexible: in a band; beyond, poles are not determined without a theorem or small gain
MOST_BAND_MODES = 150


@frozen
class ContinuousLoop(Loop):
    """The loop of a case with a law in s, gains at the hub among them; `signals` are those fed back.

    Raises ParameterError for a locked hub, a law in z, an algebraic loop, and gains that are far too small or
    too large for the arm.
    """

    case: Case
    signals: Signals = field(default=cast("Signals", None), repr=False, compare=False)

    def __post_init__(self) -> None:
        must_have_free_hub(self.arm)
        remedy = "a law in z has a sampled loop: ask for that, or leave the period out of a law in s"
        require(not self.law.is_discrete, "period", self.law.period, remedy)
        known: Signals | None = self.signals
        if known is None or known.names != self.law.signals or known.arm != self.arm:
            object.__setattr__(self, "signals", self.case.signals)
        if self.gains is not None:
            # searches under other laws may come to values next to 0
            _must_be_possible(self.arm, self.gains, LEAST_UNITS if known is None else 0.0)
        _must_not_be_algebraic(self)

    @property
    def arm(self) -> Arm:
        """The arm, with the input of the law."""
        return self.case.arm

    @property
    def law(self) -> Law:
        """The law; of gains at the hub a part for each, also for 0."""
        return self.case.feedback

    @property
    def controller(
        self,
    ) -> Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]:
        """Names of the arm and the controller, without gains of 0."""
        return controller(self.case.law, self.arm)

    def under(self, law: Law) -> ContinuousLoop:
        """Return the same rig under another law; its signals at rest are kept."""
        return ContinuousLoop(self.case.under(law), self.signals)

    @cached_property
    def gains(self) -> HubFeedback | None:
        """The law as gains at the hub; None of any other law."""
        return self.case.gains

    @cached_property
    def theorem(self) -> Theorem:
        """The theorem that decides the stability of every mode."""
        return theorem_of(self)

    @property
    def is_moved_at_hub_alone(self) -> bool:
        """Whether all energy comes and goes at the hub: gains there, on a rig that loses at its hub alone."""
        return self.is_of_gains and self.arm.loses_at_hub_alone

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of the law in which D is linear, by name: the gains at the hub, or `Law.numbers`."""
        return self.gains.by_name if self.gains else self.law.numbers

    @cached_property
    def feeds_back(self) -> bool:
        """Whether the law feeds anything back."""
        return bool(self._sample_numerators.any())

    @property
    def _sample_numerators(self) -> Complex:
        """Numerators of the signals (signals,) at a place where no law has its zero: 0 of one that is not fed back."""
        numerators, _ = self.law.polynomials(np.array([(0.31 + 0.71j) * first_frequency(self.arm)]))
        return numerators[:, 0]

    @cached_property
    def is_lossless(self) -> bool:
        """Whether D is real on the imaginary axis, and its zeros come in pairs +-s: energy is conserved."""
        if not self.feeds_back:
            return self.arm.is_undamped
        if not (self.arm.is_reactive and self.law.is_static):
            return False
        odd = np.array([each.power % 2 for each in self.signals.outputs])
        numerators, _ = self.law.polynomials(np.ones(1, complex))
        return not (odd @ abs(numerators)).any()

    @property
    def k(self) -> System:
        """The exact system."""
        return self.signals.system

    @cached_property
    def exact(self) -> Feedback:
        """The fed-back terms, exact, for proofs in ball arithmetic."""
        return feedback(self.k, self.law, self.signals.outputs, self.signals.places)

    def parts(self, s: NDArray[Any]) -> tuple[Complex, Complex]:
        """Return denominator and numerator of L at s, up to one factor: finite at poles too."""
        s = np.asarray(s, dtype=complex)
        return self._parts(s, self.signals.recall_parts(s))

    def _parts(self, s: Complex, of_rig: LoopParts) -> tuple[Complex, Complex]:
        """Return the same from those of the signals."""
        entries, whole = self.law.polynomials(s)
        return of_rig.drive * whole, np.exp(-s * self.law.delay) * (entries * of_rig.numerators).sum(axis=0)

    @cached_property
    def zeros_at_origin(self) -> int:
        """Order of the zero of D at s = 0: the least order of its terms, and more where these cancel."""
        integrators = int((self.law.poles == 0).sum())
        terms = [self.k.at_rest + integrators]
        rows = zip(self.law.signals, self.signals.orders, self._sample_numerators, strict=True)
        for name, order, numerator in rows:
            for part in self.law.parts if numerator else ():
                if name not in part.signals:
                    continue
                own = part.block.zeros_at_origin(part.signals.index(name))
                # and the integrators of the other parts
                if own is not None:
                    terms.append(order + own + integrators - int((part.block.poles == 0).sum()))
        return min(terms) + self.resting_zeros

    @cached_property
    def resting_zeros(self) -> int:
        """Number of poles at s = 0 because the law cancels the stiffness of the rig exactly: L(0) = -1.

        The orders of the terms of D do not show that they cancel there, but their values do.  The mean on both sides
        of 0 has no terms odd in s.
        """
        # of the terms of D: less is left by their rounding where they cancel at s = 0
        rounding_at_rest = 1e-13
        s = first_frequency(self.arm) * np.array([NEAREST_TO_ORIGIN, -NEAREST_TO_ORIGIN, *ORDER_READ_AT]) + 0j
        # L is infinite at a pole of the rig or of the law: then nothing cancels
        with np.errstate(all="ignore"):
            right, left, farther, nearer = 1 + self.loop_function(s)
            # else odd terms dominate
            cancels = abs(right + left) <= 2 * rounding_at_rest and abs(right) < 1
        return round(float(np.log2(abs(farther / nearer)))) if cancels else 0

    def characteristic(self, s: Complex) -> tuple[Complex, Complex]:
        """Return D e^{-scale} and scale at s."""
        of_rig = rig_parts(self.signals, s)
        drive, fed_back = self._parts(s, of_rig)
        return drive + fed_back, of_rig.scale

    def function(self, s: Complex) -> Analytic:
        """Return D/s^n, n = `zeros_at_origin`, with slopes from differences."""
        s = np.where(s == 0, NEAREST_TO_ORIGIN * first_frequency(self.arm), np.asarray(s, dtype=complex))
        return by_differences(self.k, self.characteristic, s, self.zeros_at_origin)


def rig_parts(signals: Signals, s: Complex) -> LoopParts:
    """Return the terms of the rig at s; those on a long path are kept."""
    # points, and three at each: a contour that the loops of other laws have too
    long_path = 1000
    return signals.recall_parts(s) if s.size >= long_path else signals.parts(s)


def by_differences(
    k: System, characteristic: Callable[[Complex], tuple[Complex, Complex]], s: Complex, at_zero: int
) -> Analytic:
    """Return D/s^at_zero at s (n,), not 0, with slopes from differences.

    `characteristic` gives D e^{-scale} and scale.
    """
    h = difference_steps(k, s)
    # far from where it is large: no number, and no start
    with np.errstate(over="ignore", invalid="ignore"):
        D, scale = characteristic(np.array([s, s + h, s - h]))
        up, down = D[1:] * np.exp(scale[1:] - scale[0])
        return deflate(D[0], (up - down) / (2 * h), scale[0], s, at_zero)


def _must_not_be_algebraic(loop: ContinuousLoop) -> None:
    """Raise ParameterError for a law whose loop function does not fall far right: the loop would be algebraic."""
    # L must fall by this there, from one to the next
    fall_factor = 0.5
    arm = loop.arm
    law = loop.law
    moment = [part for part in law.parts if "root_moment" in part.signals and part.block.excess == 0]
    if arm.has_massless_hub and any(p.block.matrices()[3][0, p.signals.index("root_moment")] for p in moment):
        key, value = ("law.root_moment", law.name) if loop.gains is None else ("K2", loop.gains.K2)
        must_not_be_algebraic(arm, key, value)
    if not law.is_improper:
        return
    far = first_frequency(arm) * np.array(FAR_RIGHT) + 0j
    drive, numerators, _ = loop.signals.parts(far)
    entries, whole = law.polynomials(far)
    with np.errstate(all="ignore"):
        # L without its delay
        size = abs((entries * numerators).sum(axis=0) / (drive * whole))
    falls = np.isfinite(size).all() and (size[1:] < fall_factor * size[:-1]).all()
    worst = next(p for p in law.parts if p.block.excess > 0)
    remedy = (
        "the degree of its numerator is too high for this signal, so the loop is algebraic; add a pole to den"
    )
    require(falls, f"law.{worst.signals[0]}.num", worst.block.excess, remedy)


def _must_be_possible(arm: Arm, gains: HubFeedback, least: float) -> None:
    """Raise ParameterError for gains without a loop, and for gains too small or too large for the arm."""
    is_possible = not arm.is_undamped or arm.hub_side_inertia or arm.reads_hub_moment
    remedy = "with hub.inertia = 0 and no damping K2 moves poles through infinity; use K2 = 0 or some inertia"
    require(not gains.K2 or is_possible, "K2", gains.K2, remedy)
    check_gains(arm, gains, least)


@lru_cache(maxsize=ARMS_KEPT)
def steep_places(arm: Arm, up_to: float) -> Any:
    """Return the natural frequencies [rad/s] with the arm's own hub, a locked one and none, ascending; read-only."""
    pin = replace(
        arm, hub=replace(arm.hub, inertia=0.0, friction=0.0, stiffness=0.0), motor=None, input="hub_torque"
    )
    others = (arm, arm.with_numbers(hub_inertia=math.inf), pin)
    places = np.unique(np.concatenate([flexible_frequencies(each, up_to) for each in others]))
    places.flags.writeable = False
    return places


@lru_cache(maxsize=ARMS_KEPT)
def grid(arm: Arm, up_to: float) -> Any:
    """Return frequencies [rad/s] from a millionth of the first natural one to `up_to`, dense at steep places.

    The array is read-only.
    """
    # the points of steep places up to 1.05 times the end of a grid reach below it
    places = np.asarray(steep_places(arm, 1.05 * up_to))
    lowest = SLOWEST * min([up_to, *places[:1]])
    # distances from a steep place to either side, as shares of its frequency, one and a half a decade
    away = np.geomspace(1e-10, 0.06, 14)
    close = (places[:, None] * (1 + np.r_[-away[::-1], away])).ravel()
    corners = np.r_[lowest, places[places < up_to], up_to]
    # 24 points between two of them
    pairs = itertools.pairwise(corners)
    between = np.concatenate([np.linspace(low, high, 24, endpoint=False) for low, high in pairs])
    # ten a decade up to the first of them
    slow = np.geomspace(lowest, corners[1], 60)
    omega = np.unique(np.concatenate([close, between, slow]))
    omega = np.append(omega[(omega >= lowest) & (omega < up_to)], up_to)
    omega.flags.writeable = False
    return omega


@lru_cache(maxsize=ARMS_KEPT)
def frequency_above_mode(arm: Arm, number: int) -> float:
    """Return a frequency [rad/s] half-way between two natural ones, with `number` flexible modes below."""
    omega = modes(arm, number + 1).natural_frequency
    return float((omega[-1] + omega[-2]) / 2)


@lru_cache(maxsize=ARMS_KEPT)
def quiet_places(arm: Arm, band: float, points: int) -> Any:
    """Return frequencies [rad/s] in two decades above a band, for the test of small gain of a damped loop; read-only.

    `points` of them have equal ratios.  The natural ones are added, as a resonance may be narrower than that spacing:
    the first 2000, up to where bending is overdamped, 2/C of the segment with the least C.
    """
    # evaluated in 20 ms
    most_resonances = 2000
    places = band * np.geomspace(1.0, QUIET_REACH, points)
    if arm.least_damping:
        overdamped = 2 / arm.least_damping
        first = modes_below(arm, min(band, overdamped))
        last = modes_below(arm, min(QUIET_REACH * band, overdamped))
        many = min(last - first, most_resonances)
        if many:
            places = np.unique(np.r_[places, modes(arm, first + many).natural_frequency[-many:]])
    places.flags.writeable = False
    return places
