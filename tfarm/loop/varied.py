"""The loops of a rig and a law as one number varies: the family of functions whose roots a locus follows.

    D(s; t) = drive(s) q(s; t) + e^{-s tau(t)} sum of p_i(s; t) numerator_i(s)

q and p_i are linear in a factor on the law and in any coefficient of it.  A parameter of the arm gives a system of its
own at each value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from tfarm.arm import LISTED, NAMES, RATE_GAIN, Law, unit_of
from tfarm.arrays import Complex, Real, Whole
from tfarm.case import Case
from tfarm.crossing import Line
from tfarm.errors import ConvergenceError, require
from tfarm.exact.characteristic import Analytic
from tfarm.exact.outputs import OUTPUTS
from tfarm.loop.continuous import (
    NEAREST_TO_ORIGIN,
    ORDER_READ_AT,
    ContinuousLoop,
    by_differences,
    frequency_above_mode,
)
from tfarm.loop.lines import LawTerms
from tfarm.loop.poles import box_of, poles_below, slow_poles
from tfarm.records import frozen
from tfarm.spectrum.box import Box, winding_number
from tfarm.spectrum.following import polish_roots
from tfarm.spectrum.table import first_frequency

# units, as of the arm's below
OF_THE_LAW = {gain.name: gain.unit for gain in LISTED} | {"all": "1"}
ARM_PARAMETERS = {
    "payload_mass": "kg",
    "payload_inertia": "kg m^2",
    "hub_inertia": "kg m^2",
    "length": "m",
    "damping": "s",
}

EMPTY = Box(0.0, 0.0, 0.0, 0.0)
# label and unit
Title = tuple[str, str]


@frozen
class Varied:
    """The loops of a case, with the number `vary` from `start` to `stop`.

    `vary` is a number of the law as `Law.with_number` names it, "all" (a factor on it), or of the arm.  Raises
    ParameterError for another name, and where there is no loop.
    """

    case: Case
    vary: str
    start: float
    stop: float
    box: Box = EMPTY

    least_step = 1e-10
    most_halvings = 600
    alone = 0.0
    blur = 0.0

    def __post_init__(self) -> None:
        require(self.start != self.stop, "to", self.stop, "the range is empty: a locus runs to another value")
        for key, value in (("from", self.start), ("to", self.stop)):
            require(math.isfinite(value), key, value, "a finite number")
            loop = self.at(value)
            arm = loop.arm
            K1 = loop.gains[RATE_GAIN] if loop.gains else 0.0
            passes = arm.rate_loss and arm.lossless_hub.has_massless_hub and -arm.rate_loss >= K1
            remedy = (
                f"with hub.inertia = 0 a pole passes through infinity at {RATE_GAIN} = {-arm.rate_loss:.6g}"
            )
            require(not passes, key, value, f"{remedy}: stay above it, or give the hub an inertia")

    # ------------------------------------------------------------ loops and functions

    @property
    def is_of_arm(self) -> bool:
        """Whether the number is one of the arm."""
        return self.vary in ARM_PARAMETERS

    @property
    def unit(self) -> str:
        """The SI unit of the number, "1" of a pure one."""
        if self.vary in NAMES:
            return unit_of(self.vary, self.case.arm)
        if self.vary == "delay":
            return "s"
        return ARM_PARAMETERS.get(self.vary, "1")

    @property
    def title(self) -> Title:
        """Label and unit of the number, for a heading; a pure one has no unit."""
        name = self.vary.removesuffix(".gain")
        if name == "all":
            label = "factor on all gains"
        elif name == "gain":
            label = "factor on the controller"
        elif self.is_of_arm:
            label = name.replace("_", " ")
        elif name.partition("@")[0] in OUTPUTS:
            label = f"factor on {name}"
        else:
            label = name
        return label, "" if self.unit == "1" else self.unit

    @property
    def is_reactive(self) -> bool:
        """Whether the law alone dissipates, and is static: then modes may stay on the axis at all values."""
        return self.first.k.is_real_on_axis and self.full.is_static and not self.full.delay

    @property
    def full(self) -> Law:
        """The law; of gains at the hub a part for each."""
        return self.case.feedback

    def law_at(self, value: float) -> Law:
        """Return the law where the number has that value."""
        if self.is_of_arm:
            return self.full
        return self.full.with_number("gain" if self.vary == "all" else self.vary, value)

    def at(self, value: float) -> ContinuousLoop:
        """Return the loop where the number has that value."""
        if self.is_of_arm:
            return self._loop_of_arm(value)
        return self.first.under(self.law_at(value))

    @cached_property
    def _loop_of_arm(self) -> Callable[[float], ContinuousLoop]:
        """The loop where a number of the arm has a value: of the last values it is kept."""

        @lru_cache(200)
        def loop_of_arm(value: float) -> ContinuousLoop:
            return ContinuousLoop(self.case.on(self.case.arm.with_numbers(**{self.vary: value})))

        return loop_of_arm

    @cached_property
    def first(self) -> ContinuousLoop:
        """The loop at the first value."""
        if self.is_of_arm:
            return self.at(self.start)
        return ContinuousLoop(self.case.under(self.law_at(self.start)))

    @cached_property
    def pinned(self) -> int:
        """Number of poles at s = 0 for every value."""
        return min(self.at(value).zeros_at_origin for value in self.few)

    @property
    def few(self) -> tuple[float, float, float]:
        """Both ends of the range, and a value between that is not on a grid."""
        return self.start, self.start + (self.stop - self.start) / math.e, self.stop

    @cached_property
    def terms(self) -> tuple[LawTerms, Line]:
        """The terms of D, and their weights along the number of the law."""
        name = "gain" if self.vary in ("all", "delay") else self.vary
        terms = LawTerms(self.first.signals, self.full, [name])
        return terms, terms.line(name)

    def function(self, s: Complex, values: Real) -> Analytic:
        """Return D/s^n at s (n,), each at a value of its own (n,), n = `pinned`, with slopes from differences."""
        s = np.where(s == 0, NEAREST_TO_ORIGIN * self.frequency, s)
        return by_differences(self.first.k, lambda at: self._characteristic(at, values), s, self.pinned)

    def _characteristic(self, s: Complex, values: Real) -> tuple[Complex, Complex]:
        """Return D e^{-scale} and scale at s (k, n), each column at a value of its own (n,)."""
        if self.is_of_arm:
            found = np.empty((2, *s.shape), complex)
            for value in np.unique(values):
                here = values == value
                found[:, :, here] = self.at(float(value)).characteristic(s[:, here])
            return found[0], found[1]
        terms, line = self.terms
        rig = self.first.signals.parts(s)
        rows = terms.of(s, rig)
        share = np.exp(-s * (values - self.full.delay)) if self.vary == "delay" else values
        return np.tensordot(line.others, rows, 1) + share * np.tensordot(line.alone, rows, 1), rig.scale

    @cached_property
    def frequency(self) -> float:
        """The rig's first flexible frequency [rad/s] at the first value."""
        return first_frequency(self.first.arm)

    def resting(self, values: Real) -> Whole:
        """Return the number of poles beyond `pinned` at s = 0 at each of the values (n,).

        D has a zero of higher order there, or a pole of the loop is slower than the two frequencies: the loop decides.
        """
        s = self.frequency * np.multiply.outer(ORDER_READ_AT, np.ones(values.size)) + 0j
        farther, nearer = self._characteristic(s, values)[0]
        found = np.zeros(values.size, np.int64)
        most = (ORDER_READ_AT[0] / ORDER_READ_AT[1]) ** (self.pinned + 0.5)
        for n in np.flatnonzero(abs(farther) > most * abs(nearer)):
            found[n] = self.at(float(values[n])).zeros_at_origin - self.pinned
        return found

    def at_rest(self, value: float) -> float:
        """Return D/s^n at s = 0, real, up to a positive factor: at its change of sign a real pole passes through 0."""
        s = NEAREST_TO_ORIGIN * self.frequency * np.array([1.0, -1.0]) + 0j
        found = self.function(s, np.full(2, value))
        return float((found.value * np.exp(1j * found.scale.imag)).real.mean())

    # ------------------------------------------------------------ interface of `spectrum.following`

    def near(self, values: Real, guess: Complex) -> Complex:
        """Return the poles (m, b) next to the guesses at m values, by Newton's method; NaN where it does not settle."""
        found = guess.copy()
        resting = self.resting(values)
        rests = np.zeros(guess.shape, bool)
        for n in np.flatnonzero(resting):
            nearest = np.argsort(abs(np.where(np.isnan(guess[n]), np.inf, guess[n])))
            # of a pair that rests
            both = np.where(guess[n, nearest].imag > 0, 2, 1).cumsum()
            rests[n, nearest[both <= resting[n]]] = True
        wanted = ~np.isnan(guess) & ~rests
        for n in np.flatnonzero((wanted & (guess == 0)).any(axis=1)):
            leaving = wanted[n] & (guess[n] == 0)
            found[n, leaving] = self.slow(float(values[n]), int(leaving.sum()))
        each = np.broadcast_to(values[:, None], guess.shape)
        found[wanted] = polish_roots(self.function, found[wanted], each[wanted])
        found[rests] = 0.0
        return found

    def slow(self, value: float, count: int) -> Complex:
        """Return the `count` poles next to 0 at a value, the upper, or larger, first; NaN for missing ones."""
        found = slow_poles(self.at(value), self.frequency)
        nearest = found[np.argsort(abs(found))[:count]]
        nearest = nearest[np.lexsort((-nearest.real, -nearest.imag))]
        return np.r_[nearest, np.full(count - nearest.size, np.nan)]

    def complete(self, value: float, guess: Complex) -> Complex:
        """Return all poles in the box at one value, both of each pair, and those next to guesses outside it."""
        near = self.near(np.array([value]), np.where(guess.imag < 0, np.nan, guess)[None])[0]
        near = near[~np.isnan(near) & (near != 0) & ~self.box.holds(near)]
        # of a pole on its way through infinity
        with np.errstate(over="ignore"):
            inside = poles_below(self.at(value), self.box.im_max).values[self.pinned :]
        upper = np.r_[inside, near]
        return np.r_[upper, upper[upper.imag > 0].conj()]

    def singular(self, values: Real) -> Real:
        """Return -1/C of the damped segments, at m values (m, p); NaN where there are fewer of them."""
        if not self.is_of_arm:
            return np.tile(np.array(self.first.k.singular), (values.size, 1))
        points = [self.at(float(value)).k.singular for value in values]
        found = np.full((values.size, max(map(len, points))), np.nan)
        for row, each in zip(found, points, strict=True):
            row[: len(each)] = each
        return found

    # ------------------------------------------------------------ complete in a box

    def with_box(self, modes: int) -> Varied:
        """Return the loops with one box, as high as `modes` modes, no pole on its edge at the first value."""
        loops = [self.at(value) for value in self.few]
        # heights of the box, until no pole is on its edge at the first value
        for factor in (1.0, 1.013, 1.031, 1.057, 0.985, 1.09):
            height = factor * max(frequency_above_mode(loop.arm, modes) for loop in loops)
            left, right, _, _ = np.max([box_of(loop, height) for loop in loops], axis=0).tolist()
            found = replace(self, box=Box(left, right, -height, height))
            with suppress(ConvergenceError):
                found.count(self.start)
                return found
        raise ConvergenceError(
            f"a pole is on the edge of every box at {self.vary} = {self.start:.6g}", self, 0.0
        )

    def count(self, value: float) -> int:
        """Return the number of poles in the box at one value, without those at 0, by the winding number."""
        return winding_number(self.at(value).function, self.box)
