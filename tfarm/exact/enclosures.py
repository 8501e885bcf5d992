"""Outputs enclosed: as many proven digits as are asked for, by a precision that grows until they are there."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from tfarm.errors import CertificationError

from .balls import Ball, State, point, precision, rational
from .chain import ElementChain
from .chain_values import ChainState
from .outputs import Output
from .system import System

MOST_ENCLOSURE_BITS = 1 << 18  # of working precision: at a pole no number of them is enough


def state_of(k: System, s: Ball) -> State | ChainState:
    """The free response at s, to read outputs of."""
    return ChainState(k, s) if isinstance(k, ElementChain) else State(k, s)


def enclose(k: System, wanted: Output, s: complex, *, bits: int, x: float = 0.0) -> Ball:
    """A ball around the output at s whose relative radius is below 2^-bits.

    Raises CertificationError where no precision up to `MOST_ENCLOSURE_BITS` gives one: at a pole, or at an exact zero.
    """
    for working in precisions(bits):
        with precision(working):
            state = state_of(k, point(s))
            if state.determines(wanted, x):
                value = state.value(wanted, x)
                if value.rel_accuracy_bits() >= bits or value.is_zero():
                    return value
    raise CertificationError(f"no {bits} bits at s = {s:g} 1/s: it is a pole or a zero, or too close to one")


def slope(k: System, wanted: Output, s: complex, *, bits: int = 60, x: float = 0.0) -> Ball:
    """dG/ds at s, by a difference so short that its error is below 2^-bits of the larger of G/s and dG/ds."""
    step = rational(Fraction(1, 1 << (2 * bits)))
    for working in precisions(4 * bits):
        with precision(working):
            here, there = state_of(k, point(s)), state_of(k, point(s) * (1 + step))
            if here.determines(wanted, x) and there.determines(wanted, x):
                value = here.value(wanted, x)
                difference = (there.value(wanted, x) - value) / (step * point(s))
                if (difference + value / point(s)).rel_accuracy_bits() >= bits or value.is_zero():
                    return difference
    raise CertificationError(f"no derivative at s = {s:g} 1/s: it is a pole, or too close to one")


def decimals(k: System, wanted: Output, s: complex, digits: int, x: float = 0.0) -> tuple[str, str]:
    """Real and imaginary part to `digits` significant right digits each ("0" where it vanishes identically).

    By symmetry G is real for real s, and without losses a function of s^2: then one of the two parts is exactly zero.
    """
    vanish = False, s.imag == 0  # of the real and of the imaginary part
    if s.real == 0 != s.imag and k.is_real_on_axis:
        vanish = wanted.power % 2 == 1, wanted.power % 2 == 0
    for working in precisions(4 * digits):
        with precision(working):
            state = state_of(k, point(s))
            if not state.determines(wanted, x):
                continue
            value = state.value(wanted, x)
            parts = zip(vanish, (value.real, value.imag), strict=True)
            texts = ["0.0" if is_zero else _decimal(part, digits) for is_zero, part in parts]
            if None not in texts:
                return str(texts[0]), str(texts[1])
    raise CertificationError(f"no {digits} digits at s = {s:g} 1/s: it is a pole or a zero, or too close to one")


def _decimal(part: Ball, digits: int) -> str | None:
    """A ball rounded to so many digits, None if it does not determine them."""
    if part.is_zero():
        return "0.0"
    if part.rel_accuracy_bits() < 3.33 * digits + 8:
        return None
    return str(part.mid().str(digits, radius=False))


def precisions(bits: int) -> Iterator[int]:
    """Working precisions worth trying for so many right bits, each twice the one before."""
    working = 2 * bits + 64
    while working < MOST_ENCLOSURE_BITS:
        yield working
        working *= 2
