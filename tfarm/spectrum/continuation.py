"""Pairs of zeros followed along a parameter: from the undamped modes to the damped ones, and along a gain.

A mode is a pair of zeros of a real-analytic function, conjugate or both real.  Their mean, and the square of half their
distance or (where they are far apart) their product, stay smooth where a pair meets on the real axis and parts there,
and for Kelvin-Voigt damping of a bending mode they are polynomials in C: so they, not the zeros, are what is predicted.

At each value all zeros are corrected together (`correction`), so that two branches cannot fall onto one zero.  A step
is believed if no zero moved further from its prediction than a share of its distance to the next one, and is
shortened otherwise.  Where a real zero runs into one of another pair, or into one that no pair holds, no step is short
enough: then the two become one pair.  (A damped Timoshenko beam has a third, real zero for each bending wave, coming
from s = -inf as C grows from 0.  It meets the fast zero of the overdamped mode; together they ring again, in shear.)

Where real zeros accumulate, at -1/C, a real zero that comes to that point from the right can be followed no further:
its place in the pair is then NaN, and the other zero of the pair goes on alone.

None of this is a proof: a winding number is, and `damped` asks for it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError

from .box import Function
from .correction import Member, as_pairs, corrected

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
