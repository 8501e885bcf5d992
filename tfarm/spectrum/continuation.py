"""Pairs of zeros followed along a parameter: from the undamped modes to the damped ones, and along a gain.

A mode is a pair of zeros of a real-analytic function, conjugate or both real.  Their mean, and the square of half their
distance or (where they are far apart) their product, stay smooth where a pair meets on the real axis and parts there,
and for Kelvin-Voigt damping of a bending mode they are polynomials in C: so they, not the zeros, are what is predicted.

At each value all zeros are corrected together (`improved`), so that two branches cannot fall onto one zero.  A step
is believed if no zero moved further from its prediction than a share of its distance to the next one, and is
shortened otherwise.  Where a real zero runs into one of another pair, or into one that no pair holds, no step is short
enough: then the two become one pair.  (A damped Timoshenko beam has a third, real zero for each bending wave, coming
from s = -inf as C grows from 0.  It meets the fast zero of the overdamped mode; together they ring again, in shear.)

Where real zeros accumulate, at -1/C, a real zero that comes to that point from the right can be followed no further:
its place in the pair is then NaN, and the other zero of the pair goes on alone.

None of this is a proof: a winding number is, and `damped` asks for it.

The corrector is Newton's method with the repulsion of Ehrlich (1967) and Aberth (1973) between all zeros, so that two
branches cannot fall onto one zero; two zeros close to each other are corrected together, by the cubic through both.
What has ended is NaN, and does not move.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.errors import ConvergenceError

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


Family = Callable[[float], Member]

CLOSING_SHARE = 0.2  # two real zeros whose distance would shrink by more than this share in a step refused are a pair
SMALLEST_STEP = 1e-10  # no step is smaller beside the way from the start
STUCK = 1e-4  # a step this small beside the way so far ends a mode
MOST_REFUSALS = 300  # steps; lists that arrive take up to 120 (tuned: survey tests.spectrum.damped)
NODES_BACK = 3  # through which zeros are predicted: by parabolas, of what is smooth
LONGER, SHORTER = 1.6, 2.5  # times: the step after one that went well, and instead of one that did not; time alone
LAST_REST = 1e-9  # of the way that is left: a step that leaves less goes to the end
SMALL_STEP = 1e-3  # of the way since a step was last measured anew: from there on zeros may have to be paired anew
FAR_APART = 0.1  # of the square of their mean: half the distance of two real zeros, squared, that go each by itself
NEXT_ZERO_AT = np.geomspace(1e-5, 0.3, 60)  # of a real zero: distances between which the next one is looked for
NEXT_ZERO_KNOWN = 1e-14  # relative
SAME_NEIGHBOUR = 1e-6  # of its distance: a zero of another pair so near to the next one is that one


class Node(NamedTuple):
    """The pairs at one value of the parameter: zeros (n, 2), with Im > 0 first, or the slower of two real ones.

    NaN stands second, or twice, for what has ended.
    """

    at: float
    zeros: Complex


def follow(
    family: Family, start: Node, stop: float, first: float, wanted: int, before: tuple[Node, ...] = ()
) -> list[Node]:
    """The nodes passed from `start` to the parameter `stop`, with steps chosen on the way, the first being `first`.

    `before` are earlier nodes, if there are any, to predict with.  Where zeros were paired anew, or one ended, two
    nodes follow each other at one value, before and after it.  Of the pairs only the first `wanted` are sure to arrive;
    the others keep them company, and are dropped where they meet a zero that nobody follows.  Raises ConvergenceError,
    with the last node, where branches cannot be told apart.
    """
    nodes, recent, step, refusals, anchor = [start], [*before, start][-NODES_BACK:], first, 0, start.at
    here = family(start.at)
    while nodes[-1].at != stop:
        at = nodes[-1].at + step
        if (stop - at) * np.sign(stop - start.at) <= LAST_REST * abs(stop - nodes[-1].at):
            at = stop
        there = family(at)
        zeros, stray = corrected(there, predicted(recent, at))
        stray |= _jumped(here, there, nodes[-1].zeros, zeros)
        if not stray.any():
            step, here = LONGER * (at - nodes[-1].at), there
            nodes.append(Node(at, zeros))
            recent = [*recent, nodes[-1]][-NODES_BACK:]
            if (left := _left(there, zeros)) is not None:
                recent = [Node(node.at, left(node.zeros)) for node in recent]
                nodes.append(recent[-1])
            continue
        refusals += 1
        if refusals > MOST_REFUSALS:
            raise ConvergenceError(f"branches cannot be told apart beyond {nodes[-1].at:.6g}", nodes[-1], step)
        step = (at - nodes[-1].at) / SHORTER
        close = abs(step) < SMALL_STEP * abs(at - anchor) or abs(step) < SMALLEST_STEP * abs(at - start.at)
        if close and _exchange(family, recent, stray, at):
            nodes.append(recent[-1])
        elif stray[:wanted].any() and SMALLEST_STEP * abs(at - start.at) < abs(step) < STUCK * abs(at - anchor):
            anchor = nodes[-1].at  # what counts as a small step is measured anew from here
        elif close and abs(step) < STUCK * abs(at - anchor):
            recent = [_shortened(nodes[-1], stray, wanted)]
            nodes.append(recent[-1])
    return nodes


def _jumped(here: Member, there: Member, before: Complex, after: Complex) -> NDArray[np.bool_]:
    """Which pairs of real zeros have stepped over the singular point, and so over infinitely many others."""
    real = (before.imag == 0).all(1) & (after.imag == 0).all(1) & (there.ends > 0)
    return real & ((before.real > here.singular).sum(1) != (after.real > there.singular).sum(1))


def _left(member: Member, zeros: Complex) -> Callable[[Complex], Complex] | None:
    """What takes the real zeros that have come to the singular point out of any node; None where there are none."""
    if not member.ends:
        return None
    beyond = zeros.real - member.singular
    ended = (zeros.imag == 0) & (beyond > 0) & (beyond < member.ends * abs(member.singular))
    if not ended.any():
        return None
    swapped = ended[:, :1] & ~ended[:, 1:]  # the one that stays stands first

    def without(pairs: Complex) -> Complex:
        real = np.where(ended.any(1, keepdims=True) & (pairs.imag != 0), np.nan, pairs)
        kept = np.where(ended, np.nan, real)
        return np.where(swapped, kept[:, ::-1], kept)

    return without


def predicted(nodes: list[Node], at: float) -> Complex:
    """The pairs by polynomials through the last nodes, `NODES_BACK` at most, of what stays smooth."""
    guess = np.full_like(nodes[-1].zeros, np.nan)
    for number in range(min(NODES_BACK, len(nodes)), 0, -1):  # a shorter one where the longer says nothing
        shorter = through_nodes(nodes[-number:], at) if number > 1 else nodes[-1].zeros
        guess = np.where(np.isnan(guess), shorter, guess)
        if not np.isnan(guess).any():
            break
    return guess


def through_nodes(nodes: list[Node], at: float | Real) -> Complex:
    """The pairs (*at.shape, n, 2) at other values of the parameter, by polynomials through all these nodes.

    Of mean and square of half the distance; of two real zeros far apart of each itself, of the slower the inverse.
    (That of an overdamped mode is nearly -1/C, with neighbours closer by than C times a step.)  A zero that is exactly
    0 in all nodes stays there.
    """
    value = np.asarray(at)
    ratios = ([(value - b.at) / (a.at - b.at) for b in nodes if b is not a] for a in nodes)
    weights = np.stack([np.prod(np.array(each), axis=0) for each in ratios], axis=-1)
    zeros = np.stack([node.zeros for node in nodes])
    mean, half = zeros.mean(2).real, (zeros[..., 0] - zeros[..., 1]) / 2
    square = (half * half).real
    found = as_pairs(weights @ mean, weights @ square)
    slow = zeros[..., 0].real
    far = ((square > FAR_APART * mean**2) & (slow * slow[0] > 0)).all(0)
    pinned: NDArray[np.bool_] = np.all(zeros[..., 0] == 0, axis=0)
    alone: NDArray[np.bool_] = np.all(np.isnan(zeros[..., 1]), axis=0)
    if far.any():
        inverse = weights @ np.where(far, 1 / np.where(far, slow, 1), 1)
        apart = np.stack([1 / np.where(inverse == 0, 1, inverse), weights @ zeros[..., 1].real], -1)
        found = np.where(far[:, None], apart, found)
    if pinned.any():
        beside = 2 * (weights @ mean)
        found = np.where(pinned[:, None], np.stack([0 * beside, beside], -1), found)
    if alone.any():
        single = weights @ zeros[..., 0].real
        found = np.where(alone[:, None], np.stack([single, np.full_like(single, np.nan)], -1), found)
    return found


def _exchange(family: Family, nodes: list[Node], stray: NDArray[np.bool_], at: float) -> bool:
    """Pair a real zero of a stray mode with the one that it would run into before `at`; whether there was one.

    The last node is changed, and the pairs concerned lose their history.
    """
    here, there, zeros = family(nodes[-1].at).function, family(at).function, nodes[-1].zeros.copy()
    for i, j in product(np.nonzero(stray & (zeros[:, 0].imag == 0))[0], (0, 1)):
        zero = zeros[i, j]
        if zero == 0 or np.isnan(zero):
            continue
        near = _next_zero(here, zero.real)
        if near in (np.inf, zeros[i, 1 - j].real):
            continue
        both = np.array([zero, near])
        with np.errstate(all="ignore"):  # a double zero has no slope, next to -1/C D may grow beyond any number
            move = -(there(both).value / here(both).slope * np.exp(there(both).scale - here(both).scale)).real
            closing = (move[0] - move[1]) / (near - zero.real)
        if not closing >= CLOSING_SHARE:
            continue
        m, n = np.unravel_index(np.nanargmin(abs(zeros - near)), zeros.shape)
        meeting = sorted(both, key=abs)
        if m == i or abs(zeros[m, n] - near) > SAME_NEIGHBOUR * abs(near - zero):
            lone, zeros[i], changed = zeros[i, 1 - j], meeting, [i]
            if family(at).ends and lone != 0 and not np.isnan(lone):  # the one that is left goes on alone
                zeros = np.concatenate([zeros, [[lone, np.nan]]])
                unknown = np.full((1, 2), np.nan, complex)
                nodes[:-1] = [Node(node.at, np.concatenate([node.zeros, unknown])) for node in nodes[:-1]]
        else:
            left = sorted([zeros[i, 1 - j], zeros[m, 1 - n]], key=lambda zero: (np.isnan(zero), abs(zero)))
            zeros[min(i, m)], zeros[max(i, m)], changed = left, meeting, [i, m]
        for back in range(2, min(NODES_BACK, len(nodes)) + 1):
            past = nodes[-back].zeros.copy()
            past[changed] = np.nan
            nodes[-back] = Node(nodes[-back].at, past)
        nodes[-1] = Node(nodes[-1].at, zeros)
        return True
    return False


def _shortened(node: Node, stray: NDArray[np.bool_], wanted: int) -> Node:
    """The node without the modes from the first stray one on, if none of them is wanted."""
    first = int(np.nonzero(stray)[0][0])
    if first < wanted:
        text = f"the damped mode {first + 1} cannot be told from its neighbours: ask for fewer modes than that"
        raise ConvergenceError(text, node, stray)
    return Node(node.at, node.zeros[:first])


def _next_zero(function: Function, zero: float) -> float:
    """The real zero nearest to a given one, within 0.3 of its size; inf if there is none."""
    from scipy.optimize import brentq  # takes half a second to load, and few arms come here

    def deflated(s: Real) -> Real:
        value, _, scale = function(s.astype(complex))
        return np.asarray((value * np.exp(1j * scale.imag)).real / (s - zero))

    away = abs(zero) * NEXT_ZERO_AT
    found = []
    for side in (-1, 1):
        sign = np.sign(deflated(zero + side * away))
        for n in np.nonzero(sign[1:] != sign[:-1])[0][:1]:
            ends = zero + side * away[n], zero + side * away[n + 1]
            known = NEXT_ZERO_KNOWN * abs(zero)  # SciPy's own is 2e-12 1/s, too much beside a slow rig's zeros
            found.append(brentq(lambda s: float(deflated(np.array([s]))[0]), *ends, xtol=known, rtol=NEXT_ZERO_KNOWN))
    return min(found, key=lambda s: abs(s - zero), default=np.inf)
