"""Pairs of zeros of one function, corrected all together.

The corrector is Newton's method with the repulsion of Ehrlich (1967) and Aberth (1973) between all zeros, so that two
branches cannot fall onto one zero; two zeros close to each other are corrected together, by the cubic through both.
What has ended is NaN, and does not move.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import LEAST_SIZE, Complex, Real

from .box import Function

NEIGHBOURS = 8  # zeros that repel each other: those further away move too little to matter
ENDED_PLACE = 1e150  # where the tree has what has ended
FEW_ZEROS = 64  # of so many all distances are found sooner than a tree is built
BELIEVED_SHARE = 0.2  # how far a zero may land from its prediction, in distances to the next one
SETTLED_CORRECTION = 1e-6  # a correction smaller than this share of that distance ends a step
CORRECTING_STEPS = 12  # at most: what has not settled by then is followed in shorter steps
SINGLY = 0.1  # of their distance: two zeros of a pair that move by less are corrected each by itself, else together
NO_NEARER = 4 * float(np.finfo(float).eps)  # of its size: how well a zero is known at all


class Member(NamedTuple):
    """One function of a family, and the real point where it is singular (-1/C; -inf if it is entire).

    Zeros nearer to the origin than `free` may pass it; others may not come near it in one step.  A real zero that comes
    from the right to within the share `ends` of the singular point ends there.
    """

    function: Function
    singular: float = -np.inf
    free: float = 0.0
    ends: float = 0.0


def corrected(member: Member, guess: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """The pairs of zeros next to the guess, and which of them did not settle there."""
    zeros, beside = guess, neighbours_of(guess)
    for _ in range(CORRECTING_STEPS):
        zeros, moved = improved(member, zeros, beside)
        if not (np.isfinite(zeros) | np.isnan(guess)).all():
            break
        if (moved < SETTLED_CORRECTION).all():
            gap, _ = _gaps(zeros, member, neighbours_of(zeros))
            met = (guess[:, 0].imag > 0) != (zeros[:, 0].imag > 0)  # around a meeting on the axis the mean is compared
            away = np.where(met[:, None], abs((guess - zeros).mean(1))[:, None], abs(guess - zeros))
            return zeros, np.asarray(np.any(~(away < BELIEVED_SHARE * gap) & ~np.isnan(guess), axis=1))
    return guess, ~(moved < SETTLED_CORRECTION)


class Neighbours(NamedTuple):
    """The numbers (2 n, m) of the m zeros next to each of the pairs' zeros, and which of them are others."""

    which: NDArray[np.int64]
    itself: NDArray[np.bool_]
    own_pair: NDArray[np.bool_]


def neighbours_of(zeros: Complex) -> Neighbours:
    """The zeros next to each of the pairs' zeros (n, 2), itself among them."""
    flat = zeros.ravel()
    number, each = min(NEIGHBOURS, flat.size), np.arange(flat.size)[:, None]
    if flat.size <= FEW_ZEROS:
        away = abs(flat[:, None] - flat)
        which = np.argsort(away, axis=1)[:, :number]
    else:
        from scipy.spatial import cKDTree  # takes a third of a second to load, and most tables are short

        plane = np.nan_to_num(np.column_stack([flat.real, flat.imag]), nan=ENDED_PLACE)
        which = np.reshape(cKDTree(plane).query(plane, k=number)[1], (flat.size, number))
    return Neighbours(which, which == each, which // 2 == each // 2)


def _gaps(zeros: Complex, member: Member, beside: Neighbours) -> tuple[Real, Complex]:
    """Of each zero its distance to the nearest zero of another pair or to the singular point, and the way to each."""
    flat = zeros.ravel()
    way = flat[:, None] - flat[beside.which]
    apart, from_origin = abs(way), np.maximum(2 * abs(flat), member.free + LEAST_SIZE)
    apart[beside.own_pair | np.isnan(apart)] = np.inf
    gap = np.minimum(apart.min(1), np.minimum(from_origin, abs(flat - member.singular)))
    gap[np.isnan(gap)] = np.inf
    return gap.reshape(zeros.shape), way


def improved(member: Member, zeros: Complex, beside: Neighbours | None = None) -> tuple[Complex, Real]:
    """One correction of every pair, and how far each moved, as a share of its distance to the next zero.

    `beside` are the `neighbours_of` zeros, where they are known from before the first of a few corrections.
    """
    beside = beside or neighbours_of(zeros)
    gap, way = _gaps(zeros, member, beside)
    is_real = zeros.imag[:, 0] == 0
    value, slope, scale = _of_pairs(member.function, zeros, is_real)
    ended = np.isnan(zeros)
    way[beside.itself | (way == 0)] = np.inf  # two that have become one do not part by repulsion
    if ended.any():
        way[np.isnan(way)] = np.inf
    with np.errstate(all="ignore"):
        step = value / slope
        repulsion = (1 / way).sum(1).reshape(zeros.shape)
        new = zeros - step / (1 - step * repulsion)
        new[:, 1] = np.where(is_real, new[:, 1].real, new[:, 0].conj())
        new[is_real, 0] = new[is_real, 0].real
        apart = abs(zeros[:, 0] - zeros[:, 1])
        close = (apart < gap.min(1)) & (zeros[:, 0] != 0)
        if close.any():
            for i in np.nonzero(close & ~(abs(new - zeros).max(1) < SINGLY * apart))[0]:
                twist = np.exp(scale[i, 1] - scale[i, 0])  # both values on the scale of the first
                new[i] = _together(zeros[i], value[i] * [1, twist], slope[i] * [1, twist])
        away = abs(new - zeros)
        away[ended] = 0.0
        floor = NO_NEARER * abs(zeros)  # nearer no zero is known
        moved = np.where(away <= floor, 0.0, away / gap).max(1)  # no gap is left between two that have become one
    return new, moved


def _of_pairs(function: Function, zeros: Complex, is_real: NDArray[np.bool_]) -> list[Complex]:
    """Value, slope and scale at pairs (n, 2); of a conjugate pair the function is asked at the upper zero alone."""
    count = len(zeros)
    asked = np.concatenate([zeros[:, 0], zeros[is_real, 1]])
    ended, found = np.isnan(asked), []
    value, slope, scale = function(np.where(ended, 1.0, asked) if ended.any() else asked)
    if ended.any():
        value, slope = np.where(ended, 0.0, value), np.where(ended, 1.0, slope)
    for part in (value, slope, scale):
        both = np.empty(zeros.shape, complex)
        both[:, 0] = part[:count]
        both[:, 1] = both[:, 0].conj()
        both[is_real, 1] = part[count:]
        found.append(both)
    return found


def _together(zeros: Complex, value: Complex, slope: Complex) -> Complex:
    """Two zeros, conjugate or real, near two given ones, from the cubic with the values and slopes there."""
    middle, half = zeros.mean(), (zeros[0] - zeros[1]) / 2
    g = slope * half
    a2 = (g[0] - g[1]) / 4
    a0 = (value[0] + value[1]) / 2 - a2
    a3 = ((g[0] + g[1]) - (value[0] - value[1])) / 4
    a1 = (value[0] - value[1]) / 2 - a3
    if not np.isfinite([a0, a1, a2, a3]).all() or a2 == 0 == a3:
        return zeros * np.nan
    roots = combinations(np.roots([a3, a2, a1, a0]), 2)
    one, two = min(
        roots, key=lambda x: abs(x[0] + x[1]) + abs(x[0] * x[1] + 1), default=(np.nan, np.nan)
    )  # most like +-1
    mean = (middle + half * (one + two) / 2).real
    square = ((half * (one - two) / 2) ** 2).real
    return as_pairs(np.array([mean]), np.array([square]))[0]


def as_pairs(mean: Real, square: Real) -> Complex:
    """mean +- sqrt(square), with Im > 0 or the slower first."""
    root = np.sqrt(abs(square))
    upper, away = mean + 1j * root, np.copysign(root, mean)
    real = np.stack([mean - away, mean + away], -1).astype(complex)
    return np.where((square < 0)[..., None], np.stack([upper, upper.conj()], -1), real)
