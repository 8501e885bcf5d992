"""A law in z as factors in delta = z - 1, from the numbers that were given.

    p_i = g prod(delta - zeros),  q = prod(delta - poles)

The coefficients of a law of high order are products of roots next to z = 1, and rounding loses those.  So the roots are
those of the given numbers (`tfarm.exact.block_factors`), and an integrator is one that is 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import Law
from tfarm.arm.law import Part, is_measured
from tfarm.arrays import Complex, Whole
from tfarm.dsp.chain import Chain
from tfarm.dsp.discretise import prewarped
from tfarm.records import record

VANISHED = 1e-12  # of its terms: what several signals give together where they cancel


@dataclass(frozen=True)
@record
class Column:
    """g prod(delta - zeros): what a part of a law multiplies a signal by, times the part's denominator."""

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
class LawFactors:
    """A law in z that feeds back `signals`, with the sign of u = -sum, its parts in order."""

    signals: tuple[str, ...]
    parts: tuple[PartFactors, ...]

    @cached_property
    def poles(self) -> Complex:
        """Its poles, as delta."""
        return np.concatenate([each.poles for each in self.parts])

    @property
    def zeros(self) -> Complex:
        """The zeros of all columns, as delta."""
        return np.concatenate([column.zeros for part in self.parts for column in part.columns])

    def weighted(self, factors: Iterable[float]) -> LawFactors:
        """Each part times a number of its own."""
        parts = [
            replace(part, columns=tuple(replace(each, gain=factor * each.gain) for each in part.columns))
            for part, factor in zip(self.parts, factors, strict=True)
        ]
        return replace(self, parts=tuple(parts))

    def shares(self, delta: Complex, base: Whole | None = None, offset: Any = 0.0) -> tuple[Complex, Complex]:
        """Of each part the p_i (parts, signals, n), and q (n,), at z = 1 + delta.

        Where `base` (n,) is no less than 0, that is `offset` (n,) from the law's pole of this number.
        """
        own = np.zeros(delta.size, np.bool_) if base is None else base >= 0
        start = delta if base is None or not own.any() else np.where(own, self.poles[np.where(own, base, 0)], delta)
        more = np.where(own, offset, 0.0)[:, None]

        def product(roots: Complex) -> Complex:
            return np.asarray(((start[:, None] - roots) + more).prod(axis=1))

        shares = np.zeros((len(self.parts), len(self.signals), delta.size), complex)
        dens = [product(part.poles) for part in self.parts]
        for n, part in enumerate(self.parts):
            others = np.prod([den for m, den in enumerate(dens) if m != n], axis=0)
            for each in part.columns:
                shares[n, self.signals.index(each.signal)] += each.gain * product(each.zeros) * others
        return shares, np.asarray(np.prod(dens, axis=0))

    def ignores(self, turned: Mapping[str, float]) -> bool:
        """Whether it comes to rest, and does nothing, where its signals stay at such values."""
        out = []
        for part in self.parts:
            held, below = _lowest(part.poles)
            terms = [(*_lowest(each.zeros), each.gain * turned[each.signal]) for each in part.columns]
            by_order = [[value * factor for n, value, factor in terms if n == order] for order in range(held + 1)]
            is_reached = held and len(terms) == 1 and terms[0][2]  # an integrator of the only signal, cancelled or not
            if is_reached or not all(map(_cancel, by_order[:held])):
                return False
            out += [each / below for each in by_order[held]]
        return _cancel(out)

    def at_one(self) -> tuple[tuple[int, float], list[tuple[int, int, int, float]]]:
        """Where delta is small: q as (n, c) of c delta^n, and of each column its part, its row, and p_i so."""
        dens = [_lowest(part.poles) for part in self.parts]
        found = []
        for n, part in enumerate(self.parts):
            for each in part.columns:
                if each.gain:
                    order, value = _product([_lowest(each.zeros), *(den for m, den in enumerate(dens) if m != n)])
                    found.append((n, self.signals.index(each.signal), order, each.gain * value))
        return _product(dens), found


def _cancel(terms: Sequence[float]) -> bool:
    return abs(sum(terms)) <= VANISHED * sum(map(abs, terms))


def _lowest(roots: Complex) -> tuple[int, float]:
    """n and c of prod(delta - roots) = c delta^n + ..."""
    left = roots[roots != 0]
    return roots.size - left.size, float(np.prod(-left).real)


def _product(terms: Iterable[tuple[int, float]]) -> tuple[int, float]:
    orders, values = zip(*terms, strict=True)
    return sum(orders), math.prod(values)


def law_factors(law: Law, chain: Chain) -> LawFactors:
    """The factors of a law as it is given, at the period of a chain, which may estimate the hub's rate of its angle.

    `tfarm.dsp.discretise.discretised` refuses what has none.
    """
    parts = [_part(part, law, chain) for part in law.parts]
    return LawFactors(tuple(dict.fromkeys(each.signal for part in parts for each in part.columns)), tuple(parts))


def _part(part: Part, law: Law, chain: Chain) -> PartFactors:
    """The factors of one part, in z."""
    from tfarm.exact.block_factors import block_factors  # FLINT, which few commands need

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
