"""Discretisation of a law in s: Tustin's rule (with prewarping), zero-order hold, or matched poles and zeros.

    tustin   s = c (z - 1)/(z + 1),  c = 2/T, or w0/tan(w0 T/2) with the exact values at w0
    zoh      the response of the law to signals that are held between the samples
    matched  every pole and zero s becomes e^{sT}, with the same value at rest

A law in z is not changed, nor is a delay.  (Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998,
ch. 6.)

For the characteristic function a law is kept as factors in delta = z - 1, from the numbers that were given:

    p_i = g prod(delta - zeros),  q = prod(delta - poles)

The coefficients of a law of high order are products of roots next to z = 1, and rounding loses those.  So the roots are
those of the given numbers (`tfarm.exact.rationals`), and an integrator has the root 0.  The filtered difference of the
encoder, where a chain estimates the hub rate, is (1 - a)/T (z - 1)/(z - a) times the angle, a part of the law.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, AnyLaw, Arm, as_law, full_law, must_not_be_algebraic
from tfarm.arm.blocks import LawBlock, Matrices, Rational, StateSpace
from tfarm.arm.law import Law, Part, is_measured
from tfarm.arrays import Complex, Real
from tfarm.dsp.chain import MOST_DELAY, Chain
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.schema import Quantity
from tfarm.spectrum.table import check_gains

SAME_PERIOD = 1e-9  # relative: 1/100 s in two files may differ in its last digits
VANISHED = 1e-12  # of its terms: a sum over several signals that cancel
RULE = Quantity("discretisation", help="rule by which the continuous-time controller is made discrete")
NONE = np.empty(0, complex)


def discretised(law: Law, period: float) -> Law:
    """Return the law in z with this period [s].

    Raises ParameterError for a law in z with another period, and for a law that its rule is not defined for.
    """
    if law.period is not None:
        if abs(law.period - period) > SAME_PERIOD * period:
            remedy = f"the period of the law is {law.period:g} s, that of the chain {period:g} s; make them equal"
            raise ParameterError(key="period", value=law.period, remedy=remedy)
        return law
    if law.prewarp and (law.rule != "tustin" or law.prewarp * period >= math.pi):
        remedy = f"tustin keeps the values at a frequency below half the sample rate, {math.pi / period:.4g} rad/s"
        raise ParameterError(key="prewarp", value=law.prewarp, remedy=remedy)
    parts = tuple(Part(part.signals, _in_z(part, law, period)) for part in law.parts)
    return replace(law, parts=parts, period=period, prewarp=0.0)


def rule_in_words(law: Law) -> str:
    """Discretisation of a law, in words."""
    if law.is_discrete:
        return "in z, as given"
    names = {"tustin": "Tustin's rule", "zoh": "zero-order hold", "matched": "matched poles and zeros"}
    return f"discretised by {names[law.rule]}{f', exact at {law.prewarp:g} rad/s' if law.prewarp else ''}"


def _in_z(part: Part, law: Law, period: float) -> LawBlock:
    """A block of the law in z."""
    block, key = part.block, f"law.{part.signals[0]}.num"
    if block.excess > 0 and law.rule != "tustin":
        remedy = f"the rule {law.rule} is not for a law that differentiates: add a pole to den, or take tustin"
        raise ParameterError(key=key, value=law.name, remedy=remedy)
    if not block.order and block.excess <= 0:
        return block
    if law.rule == "matched":
        if isinstance(block, StateSpace):
            remedy = "matched is for zeros and poles of one signal; take tustin or zoh for matrices"
            raise ParameterError(key="rule", value=law.rule, remedy=remedy)
        return matched(block, period)
    if law.rule == "zoh":
        return by_scipy(block, period, "zoh")
    return tustin(block, period, law.prewarp)


def tustin(block: LawBlock, period: float, prewarp: float = 0.0) -> LawBlock:
    """Return the block with s = c (z - 1)/(z + 1).  Raises ParameterError where it has a pole at s = c."""
    c = prewarped(period, prewarp)
    if isinstance(block, Rational) and block.excess > 0:
        return substituted(block, c)
    A = block.matrices()[0]
    if np.linalg.cond(np.eye(len(A)) - A / c) > 1 / np.finfo(float).eps:
        remedy = f"the law has a pole at {c:g} 1/s, which this rule maps to infinity; take another rule or period"
        raise ParameterError(key="rule", value="tustin", remedy=remedy)
    return by_scipy(block, 2 / c, "bilinear")


def prewarped(period: float, prewarp: float) -> float:
    """c [1/s] of s = c (z - 1)/(z + 1)."""
    return prewarp / math.tan(prewarp * period / 2) if prewarp else 2 / period


def by_scipy(block: LawBlock, period: float, rule: Literal["zoh", "bilinear"]) -> StateSpace:
    """The block in z by a rule of `scipy.signal.cont2discrete`."""
    from scipy.signal import cont2discrete  # here, because it takes a while to load

    return StateSpace(*cont2discrete(block.matrices(), period, rule)[:4])


def matched(block: Rational, period: float) -> Rational:
    """The ratio with poles and zeros at e^{sT}; at rest both have the same power of s and of (z - 1)/T."""
    num, zeros, at_zero = _roots(block.num, period)
    den, poles, integrators = _roots(block.den, period)
    gain = num / den * np.prod(1 - poles).real / np.prod(1 - zeros).real * period ** (integrators - at_zero)
    ones = np.ones(at_zero), np.ones(integrators)
    return Rational.of_roots([*zeros, *ones[0]], [*poles, *ones[1]], float(gain))


def _roots(polynomial: tuple[float, ...], period: float) -> tuple[float, NDArray[np.complex128], int]:
    """The lowest coefficient that is not 0, e^{sT} of the roots other than 0, and the number of roots 0."""
    coefficients = np.trim_zeros(np.array(polynomial), "b")
    if not coefficients.size:
        return 0.0, NONE, 0
    roots = np.exp(np.roots(coefficients).astype(complex) * period)
    return float(coefficients[-1]), roots, len(polynomial) - coefficients.size


def substituted(block: Rational, c: float) -> Rational:
    """The ratio of polynomials with s = c (z - 1)/(z + 1), without loss of small coefficients."""
    n = max(len(block.num), len(block.den)) - 1

    def of(polynomial: tuple[float, ...]) -> Real:
        total = np.zeros(n + 1)
        for k, each in enumerate(reversed(polynomial)):
            factor = np.ones(1)
            for root in [1.0] * k + [-1.0] * (n - k):
                factor = np.convolve(factor, [1.0, -root])
            total += each * c**k * factor
        return total

    return Rational(tuple(of(block.num)), tuple(of(block.den)))


# ------------------------------------------------------------ the law in the computer


def with_all_gains(arm: Arm, law: AnyLaw) -> Law:
    """Return the law; gains at the hub that follow all their references with a part for each gain, also for 0.

    Raises ParameterError for the algebraic loop, I_h = 0 and K2 != 0, and for a gain that is too large.
    """
    law = as_law(law)
    gains = law.gains if set(law.signals) <= set(law.references) else None
    if gains is None:
        return law
    if gains.K2:
        must_not_be_algebraic(arm, MOMENT_GAIN, gains.K2)
    check_gains(arm, gains)
    return full_law(law)


def acting_law(arm: Arm, law: Law, chain: Chain) -> tuple[Law, Chain]:
    """Return the law in z, and the chain with its delay.

    Raises ParameterError for a delay that is too long, for a massless hub whose moment is fed back (an algebraic loop),
    and as `discretised` does.
    """
    T = chain.sampling.period
    samples = chain.sampling.delay_samples + law.delay / T
    if samples > MOST_DELAY:
        remedy = f"with the delay of the chain it is {samples:.4g} samples; at most {MOST_DELAY:g}"
        raise ParameterError(key="delay", value=law.delay, remedy=remedy)
    if "root_moment" in law.signals and law.part_gains.get("root_moment", (0, 1.0))[1]:
        must_not_be_algebraic(arm, "signals", "root_moment")
    late = replace(chain, sampling=replace(chain.sampling, delay_samples=samples))
    return discretised(law, T), late


def with_estimate(law: Law, chain: Chain) -> Law:
    """The law in z, with the filtered difference of the encoder where the chain estimates the hub rate by it."""
    if chain.converters.hub_rate != "difference" or "hub_rate" not in law.signals:
        return law
    T = chain.sampling.period
    a = float(np.exp(-chain.converters.rate_filter * T))
    return replace(law, parts=tuple(_differenced(part, a, T) for part in law.parts), references=())


def _differenced(part: Part, a: float, T: float) -> Part:
    """A part of a law with its columns of the hub rate replaced by columns of the hub angle."""
    if "hub_rate" not in part.signals:
        return part
    signals = tuple("hub_angle" if name == "hub_rate" else name for name in part.signals)
    if isinstance(part.block, Rational):
        num = np.convolve(part.block.num, [(1 - a) / T, -(1 - a) / T])
        return Part(signals, Rational(tuple(num), tuple(np.convolve(part.block.den, [1.0, -a]))))
    A, B, C, D = part.block.matrices()
    rate = np.array([name == "hub_rate" for name in part.signals], dtype=float)
    through, kept = (1 - a) / T, 1.0 - rate
    Br, Dr = (B @ rate)[:, None], (D @ rate)[:, None]
    slope = through * (a - 1)
    block = StateSpace(
        np.block([[A, slope * Br], [np.zeros((1, len(A))), np.array([[a]])]]),
        np.vstack([B * kept + through * Br * rate, rate[None]]),
        np.hstack([C, slope * Dr]),
        D * kept + through * Dr * rate,
    )
    return Part(signals, block)


# ------------------------------------------------------------ factors


@dataclass(frozen=True)
@record
class Column:
    """g prod(delta - zeros): the entry of a part of a law for a signal, times the part's denominator."""

    signal: str
    gain: float
    zeros: Complex


@dataclass(frozen=True)
@record
class PartFactors:
    """A part of a law: its `poles`, as delta, and a column for each signal that it feeds back."""

    poles: Complex
    columns: tuple[Column, ...]


@dataclass(frozen=True)
@record
class LawInZ:
    """The parts of a law in z, with the sign of u = -sum, over `signals`: factors, and states.

    `matrices`: A, B of x_{k+1} = A x_k + B y_k, and a row of C and of D for each part.
    """

    signals: tuple[str, ...]
    parts: tuple[PartFactors, ...]
    matrices: Matrices

    @cached_property
    def poles(self) -> Complex:
        """Its poles, as delta."""
        return np.concatenate([each.poles for each in self.parts])

    @property
    def zeros(self) -> Complex:
        """The zeros of all columns, as delta."""
        return np.concatenate([NONE, *(column.zeros for part in self.parts for column in part.columns)])

    @cached_property
    def terms(self) -> list[tuple[int, int, float, Complex]]:
        """Part, row of the signal, gain and zeros of p_i for each column; the poles of other parts are zeros too."""
        poles = [each.poles for each in self.parts]
        return [
            (n, self.signals.index(each.signal), each.gain, np.concatenate([each.zeros, *poles[:n], *poles[n + 1 :]]))
            for n, part in enumerate(self.parts)
            for each in part.columns
        ]

    def under(self, weights: Sequence[float]) -> Matrices:
        """States of the law with a factor on each part."""
        A, B, C, D = self.matrices
        row = np.array([weights])
        return A, B, row @ C, row @ D

    def ignores(self, turned: Mapping[str, float], weights: Sequence[float]) -> bool:
        """Whether its output tends to 0 where its signals stay at these values."""
        out = []
        for part, weight in zip(self.parts, weights, strict=True):
            held, below = lowest_power(part.poles)
            terms = [(*lowest_power(each.zeros), weight * each.gain * turned[each.signal]) for each in part.columns]
            by_order = [[value * factor for n, value, factor in terms if n == order] for order in range(held + 1)]
            is_reached = held and len(terms) == 1 and terms[0][2]  # an integrator of the only signal, cancelled or not
            if is_reached or not all(map(_cancel, by_order[:held])):
                return False
            out += [each / below for each in by_order[held]]
        return _cancel(out)


def _cancel(terms: Sequence[float]) -> bool:
    return abs(sum(terms)) <= VANISHED * sum(map(abs, terms))


def lowest_power(roots: Complex) -> tuple[int, float]:
    """n and c of prod(delta - roots) = c delta^n + ..."""
    left = roots[roots != 0]
    return roots.size - left.size, float(np.prod(-left).real)


def law_in_z(law: Law, acting: Law, chain: Chain) -> LawInZ:
    """The parts of a law, and of the same in z (`acting`), at the period of a chain that may estimate the hub rate."""
    acting = with_estimate(acting, chain)
    alone = [acting.weighted(row).matrices() for row in np.eye(len(acting.parts)).tolist()]
    (A, B, _, _), C, D = alone[0], *(np.vstack([each[n] for each in alone]) for n in (2, 3))
    return LawInZ(acting.signals, tuple(_factors(part, law, chain) for part in law.parts), (A, B, C, D))


def _factors(part: Part, law: Law, chain: Chain) -> PartFactors:
    """The factors of one part, in z."""
    from tfarm.exact.rationals import block_factors  # FLINT, which few commands need

    T = chain.sampling.period
    rule = "none" if law.is_discrete else law.rule
    poles, found = block_factors(part.block, rule, T, prewarped(T, law.prewarp))
    is_difference = chain.converters.hub_rate == "difference" and "hub_rate" in part.signals
    lag = float(np.expm1(-chain.converters.rate_filter * T))
    columns = []
    for name, (gain, zeros) in zip(part.signals, found, strict=True):
        if is_measured(name) and is_difference and name == "hub_rate":  # -lag/T delta/(delta - lag) times the angle
            columns.append(Column("hub_angle", law.sign * gain * lag / T, np.r_[zeros, 0.0]))
        elif is_measured(name):
            columns.append(Column(name, -law.sign * gain, np.r_[zeros, lag] if is_difference else zeros))
    return PartFactors(np.r_[poles, lag] if is_difference else poles, tuple(columns))
