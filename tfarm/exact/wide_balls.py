"""The characteristic function D over a whole piece of a contour: balls as wide as a step, and still narrow values.

Evaluated on a wide ball an expression forgets that its parts move together.  By Taylor's theorem

    D(s) = D(m) + D'(m) (s - m) + ... + D^(n)(.) (s - m)^n / n!

where only the last term is taken over the wide ball, so that a step may be long.

The two waves are kept apart and scaled by e^{-t}: in the form of `balls.State` a wide s would lose what products of a
wave with itself lose by cancelling, at any precision.  Where a wave is long or both may be one, that form is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple, cast

import flint

from .balls import Ball, State, point, rational
from .chain import ElementChain
from .chain_values import ChainState
from .chain_wide import swept
from .characteristic import FED, NO_GAINS, NUMERATORS, Gains, at_hub, unit_gains
from .closed_form import from_waves
from .coefficients import Coefficients, EndCondition
from .compiled import python_of
from .elements import Segment
from .system import System

Series = Any  # flint.acb_series, which comes without types

_separated = python_of(from_waves)

LONG_WAVE = 0.3  # |z| below which a wave is not separated from the others
TAYLOR_TERMS = 4  # of D over a piece of a contour, the last of them over the wide ball


def characteristic_ball(k: System, s: Ball, gains: Gains = NO_GAINS) -> Ball:
    """D(s) enclosed, at the working precision: for points, at any s."""
    if isinstance(k, ElementChain):
        chain = ChainState(k, s)
        return _law(k, gains, chain.input, [chain.numerator(each) for each in FED])
    state = State(k, s)
    return _closed(k, s, state.theta, state.M0, gains)


def characteristic_over(k: System, s: Ball, gains: Gains = NO_GAINS) -> Ball:
    """D enclosed over the wide ball s, but for a factor that depends on its middle alone and is positive."""
    middle, is_point = s.mid(), s.real.is_exact() and s.imag.is_exact()
    here = _by_waves(k, middle, gains, None, LONG_WAVE, 1 if is_point else TAYLOR_TERMS - 1)
    if here is not None and is_point:
        return here[0][0] * flint.acb(0, here[1].imag).exp()
    there = None if here is None else _by_waves(k, s, gains, here[1], LONG_WAVE, TAYLOR_TERMS)
    if here is None or there is None:
        return characteristic_ball(k, s, gains)
    away, value = s - middle, flint.acb(0)
    for order in range(TAYLOR_TERMS - 1, -1, -1):
        value = value * away + (there if order == TAYLOR_TERMS - 1 else here)[0][order]
    return value * flint.acb(0, here[1].imag).exp()


def tangent(k: System, m: Ball, r: Ball, gains: Gains = NO_GAINS) -> tuple[Ball, Ball, Ball] | None:
    """D(m), D'(m) and D''/2 over the disc of radius r around m, apart from one factor; None where waves may be one."""
    here = _by_waves(k, m, gains, None, 0.0, 2)
    disc = flint.acb(flint.arb(m.real.mid(), r), flint.arb(m.imag.mid(), r))
    there = None if here is None else _by_waves(k, disc, gains, here[1], 0.0, 3)
    return None if here is None or there is None else (here[0][0], here[0][1], there[0][2])


class End(NamedTuple):
    """An end condition (see `EndCondition`) in balls."""

    rest: Ball
    inertia: Ball
    force: Ball


class Numbers(NamedTuple):
    """The numbers of a uniform arm in balls of one working precision."""

    a: Ball
    b: Ball
    g: Ball
    C: Ball
    mass: End
    inertia: End
    hub: End


def _numbers(k: Coefficients) -> Numbers:
    """Those at the working precision, made once: a contour asks for them some thousand times."""
    key = "balls", flint.ctx.prec
    if key not in k.kept:
        ends = [EndCondition.of(inertia) for inertia in (k.tip_mass, k.tip_inertia, k.hub_inertia)]
        balls = [End(*(rational(number) for number in (each.rest, each.inertia, each.force))) for each in ends]
        k.kept[key] = Numbers(*(rational(number) for number in (k.a, k.b, k.g, k.damping)), *balls)
    return cast("Numbers", k.kept[key])


def _closed(k: Coefficients, s: Any, theta: Any, M0: Any, gains: Gains) -> Any:
    """D (see `characteristic`) of a response with that hub angle and root moment, for balls and for series."""
    numbers = _numbers(k)
    hub = numbers.hub
    drive = theta * (s * s * hub.inertia + hub.rest) - M0 * hub.force
    drive = drive / hub.force if isinstance(k.hub_inertia, Fraction) else drive
    if not any(gains):
        return drive
    for gain, part in zip(at_hub(gains), NUMERATORS(s, 1 / (s * numbers.C + 1), theta, M0), strict=True):
        drive = drive + part * rational(gain) if gain else drive
    return drive


def _by_waves(
    k: System, at: Ball, gains: Gains, scale: Ball | None, shortest: float, terms: int
) -> tuple[Series, Ball] | None:
    """D e^{-scale} as a series of so many terms around `at`, and scale: t1 + t2 there if none is given.

    None where waves may be one.
    """
    s = flint.acb_series([at, 1], prec=terms)
    if isinstance(k, ElementChain):
        return _by_segments(k, s, gains, scale, shortest)
    a, b, g, C, mass, inertia, _ = _numbers(k)
    S, d = s * s, s * C + 1
    pair = _waves(a, b, g, S, d, shortest)
    if pair is None:
        return None
    one, two = pair
    ends = [S * end.inertia + end.rest for end in (mass, inertia)]
    theta, M0, _, _ = _separated(*one[:5], *two[:5], S * g, d, ends[0], mass.force, ends[1], inertia.force)
    t = one[5] + two[5]
    scale = t[0] if scale is None else scale
    gap = one[2] - two[2]
    unit = S * d * gap * gap * g
    if unit[0].contains(0):
        return None
    return _closed(k, s, theta, M0, gains) * (t - scale).exp() / unit, scale


def _by_segments(
    k: ElementChain, s: Series, gains: Gains, scale: Ball | None, shortest: float
) -> tuple[Series, Ball] | None:
    """`_by_waves` of a chain."""

    def waves(each: Segment, S: Series, d: Series) -> tuple[tuple[Series, ...], tuple[Series, ...]] | None:
        a, b, g = (rational(value) for value in each[:3])
        return _waves(a, b, g, S, d, shortest)

    used = [each for each, gain in zip(FED, gains, strict=True) if gain]
    found = swept(k, s, used, waves)
    if found is None:
        return None
    drive, outputs, t = found
    every = iter(outputs)
    value = _law(k, gains, drive, [next(every) if gain else 0 * s for gain in gains])
    scale = t[0] if scale is None else scale
    return value * (t - scale).exp(), scale


def _law(k: ElementChain, gains: Gains, drive: Any, outputs: Sequence[Any]) -> Any:
    """drive + gains . numerators, from outputs in SI."""
    for gain, unit, part in zip(gains, unit_gains(k), outputs, strict=True):
        drive = drive + part * rational(gain / unit) if gain else drive
    return drive


def _waves(
    a: Ball, b: Ball, g: Ball, S: Series, d: Series, shortest: float
) -> tuple[tuple[Series, ...], tuple[Series, ...]] | None:
    """Both waves of a uniform piece (see `_wave`); None where they may be one, or one is too long."""
    if S[0].contains(0) or d[0].contains(0):
        return None
    half = (S * b + S * a / d) / 2
    spread = _root(half * half - S * (S * (a * b) + g) / d)
    if spread is None:
        return None
    one, two = (_wave(half + sign * spread, S, d, a, b, g, shortest) for sign in (1, -1))
    return None if one is None or two is None else (one, two)


def _root(z: Series) -> Series | None:
    """A square root whose cut lies away from the ball (which of the two does not matter); None if it may vanish."""
    if z[0].contains(0):
        return None
    root = z.sqrt() if z[0].real.mid() >= 0 else (-z).sqrt() * point(1j)
    return root if root[0].real.mid() >= 0 else -root


def _wave(z: Series, S: Series, d: Series, a: Ball, b: Ball, g: Ball, shortest: float) -> tuple[Series, ...] | None:
    """c, s, z, v, e and t of one wave as `from_waves` wants them, scaled by e^{-t}."""
    t = _root(z) if abs(z[0]).mid() > shortest else None
    if t is None or t[0].contains(0):
        return None
    e = (-t).exp()
    v, inverse = z - S * b, d * z - S * a
    if not inverse[0].contains(0):
        other = -(S * g) / inverse  # the same by the dispersion relation; the narrower of the two
        v = other if other[0].rel_accuracy_bits() > v[0].rel_accuracy_bits() else v
    return (e * e + 1) / 2, (-(e * e) + 1) / (t * 2), z, v, e, t
