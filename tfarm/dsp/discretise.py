"""A law in s made one in z, by a rule that is named: Tustin's (with prewarping), zero-order hold, or matched roots.

    tustin   s = c (z - 1)/(z + 1),  c = 2/T, or w0/tan(w0 T/2) where the values at w0 are to be kept
    zoh      what the law makes of signals that are held between the samples
    matched  every pole and zero s becomes e^{sT}, with the same value at rest

A law in z is taken as it is.  All the delay of a law stays a delay.  (Franklin, Powell and Workman, Digital Control of
Dynamic Systems, 1998, ch. 6.)
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.blocks import LawBlock, Rational, StateSpace
from tfarm.arm.feedback import input_words
from tfarm.arm.law import Law, Part
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.response.signals import Signals

SAME_PERIOD = 1e-9  # relative: 1/100 s in two files may differ in its last digits


def discretised(law: Law, period: float) -> Law:
    """The law in z with this period [s].

    Raises ParameterError for a law in z with another period, and for what its rule cannot take.
    """
    if law.period is not None:
        if abs(law.period - period) > SAME_PERIOD * period:
            remedy = f"the law's period is {law.period:g} s and the chain samples every {period:g} s; make them one"
            raise ParameterError(key="period", value=law.period, remedy=remedy)
        return law
    if law.prewarp and (law.rule != "tustin" or law.prewarp * period >= math.pi):
        remedy = f"tustin keeps the values at a frequency below half the sample rate, {math.pi / period:.4g} rad/s"
        raise ParameterError(key="prewarp", value=law.prewarp, remedy=remedy)
    parts = tuple(Part(part.signals, _in_z(part, law, period)) for part in law.parts)
    return replace(law, parts=parts, period=period, prewarp=0.0)


def rule_in_words(law: Law) -> str:
    """How a law comes to be one in z."""
    if law.is_discrete:
        return "in z, taken as it is"
    if law.rule == "tustin" and law.prewarp:
        return f"made discrete by Tustin's rule, exact at {law.prewarp:g} rad/s"
    words = {"tustin": "Tustin's rule", "zoh": "zero-order hold", "matched": "matched poles and zeros"}
    return f"made discrete by {words[law.rule]}"


def described_law(law: Law, arm: Arm) -> dict[str, Any]:
    """The law as it was given, how it is sampled, and what it reads and drives."""
    units = Signals(arm, law.signals).units
    sign, late = "-" if law.sign < 0 else "+", f", {law.delay:g} s late" if law.delay else ""
    words = f"v = {sign}sum of C_i(z) y_i{late}; v is {input_words(arm)}, y = ({', '.join(law.signals)})"
    return {
        "law": law.name,
        "signals": dict(zip(law.signals, units, strict=True)),
        "law_order": law.order,
        "delay_s": law.delay,
        "rule": "none" if law.is_discrete else law.rule,
        "rule_in_words": rule_in_words(law),
        "sign_convention": words,
        "input": arm.input,
    }


def _in_z(part: Part, law: Law, period: float) -> LawBlock:
    """A block of the law in z."""
    block, key = part.block, f"law.{part.signals[0]}.num"
    if block.excess > 0 and law.rule != "tustin":
        remedy = f"the rule {law.rule} makes nothing of a law that differentiates: add a pole to den, or take tustin"
        raise ParameterError(key=key, value=law.name, remedy=remedy)
    if not block.order and block.excess <= 0:
        return block
    if law.rule == "matched":
        if isinstance(block, StateSpace):
            remedy = "matched is for zeros and poles of one signal; take tustin or zoh for matrices"
            raise ParameterError(key="rule", value=law.rule, remedy=remedy)
        return matched(block, period)
    if law.rule == "zoh":
        return zero_order_hold(block, period)
    return tustin(block, period, law.prewarp)


def tustin(block: LawBlock, period: float, prewarp: float = 0.0) -> LawBlock:
    """The block with s = c (z - 1)/(z + 1).  Raises ParameterError where it has a pole at s = c."""
    c = prewarped(period, prewarp)
    if isinstance(block, Rational) and block.excess > 0:
        return substituted(block, c)
    A, B, C, D = block.matrices()
    unit = np.eye(len(A))
    whole = unit - A / c
    if np.linalg.cond(whole) > 1 / np.finfo(float).eps:
        remedy = f"the law has a pole at {c:g} 1/s, which this rule sends to infinity; take another rule or period"
        raise ParameterError(key="rule", value="tustin", remedy=remedy)
    within = np.linalg.inv(whole).astype(np.float64)
    return StateSpace(within @ (unit + A / c), within @ B * (2 / c), C @ within, D + C @ within @ B / c)


def prewarped(period: float, prewarp: float) -> float:
    """c [1/s] of s = c (z - 1)/(z + 1)."""
    return prewarp / math.tan(prewarp * period / 2) if prewarp else 2 / period


def zero_order_hold(block: LawBlock, period: float) -> StateSpace:
    """What the block makes at the samples of signals that are held between them."""
    from scipy.linalg import expm

    A, B, C, D = block.matrices()
    n, m = B.shape
    both = expm(period * np.vstack([np.hstack([A, B]), np.zeros((m, n + m))]))
    return StateSpace(both[:n, :n], both[:n, n:], C, D)


def matched(block: Rational, period: float) -> Rational:
    """Poles and zeros at e^{sT}; at rest both go the same way, as the same power of s and of (z - 1)/T."""
    num, zeros, at_zero = _roots(block.num, period)
    den, poles, integrators = _roots(block.den, period)
    gain = num / den * np.prod(1 - poles).real / np.prod(1 - zeros).real * period ** (integrators - at_zero)
    ones = np.ones(at_zero), np.ones(integrators)
    return Rational.of_roots([*zeros, *ones[0]], [*poles, *ones[1]], float(gain))


def _roots(polynomial: tuple[float, ...], period: float) -> tuple[float, NDArray[np.complex128], int]:
    """The lowest coefficient that is not 0, e^{sT} of the roots other than 0, and how many are 0."""
    coefficients = np.trim_zeros(np.array(polynomial), "b")
    if not coefficients.size:
        return 0.0, np.empty(0, complex), 0
    roots = np.exp(np.roots(coefficients).astype(complex) * period)
    return float(coefficients[-1]), roots, len(polynomial) - coefficients.size


def substituted(block: Rational, c: float) -> Rational:
    """The ratio of polynomials with s = c (z - 1)/(z + 1), small coefficients kept as they are."""
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
