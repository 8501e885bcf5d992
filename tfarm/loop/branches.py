"""Branches of a root locus: from the open arm's modes to the gains at the start, and along what varies.

The pairs of zeros are those of `spectrum.continuation`; where a real zero leaves its pair for another's, the branches
stay with the zeros: a branch is a zero followed, not a pair.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.errors import ConvergenceError
from tfarm.spectrum import modes
from tfarm.spectrum.continuation import Node, corrected, follow, through
from tfarm.spectrum.damped import COMPANY

from .plant import Loop, effective_inertia
from .variation import Complex, Real, Variation, member_of

FREE = 0.05  # of the lowest flexible frequency: zeros closer to the origin may pass it
FIRST = 0.01  # the first step along a parameter, as a share of the way
SOFT = 1e-6  # where the rigid body's double zero parts, this share of the way is left out, or less
APART = 0.02  # of the lowest flexible frequency: how far the rigid body's zeros may be there


@dataclass(frozen=True)
class Segment:
    """Nodes between which the pairs stay what they are, and the number of the branch of each zero, (n, 2)."""

    nodes: list[Node]
    slots: NDArray[np.int64]
    pinned: bool = False  # whether the first of the zeros is 0 all the way

    def guess(self, values: Real) -> Complex:
        """The pairs (values, n, 2), by cubics through the four nodes around each value, in the order of `ordered`."""
        at = np.array([node.at for node in self.nodes])
        way = np.sign(at[-1] - at[0]) or 1.0
        which = np.clip(np.searchsorted(way * at, way * values) - 1, 0, max(0, at.size - 2))
        guess = np.empty((values.size, *self.slots.shape), complex)
        for n in np.unique(which):
            low = max(0, min(int(n) - 1, at.size - 4))
            guess[which == n] = through(self.nodes[low : low + 4], values[which == n])
        return ordered(guess, self.pinned)


@dataclass(frozen=True)
class Stage:
    """One way of a parameter from `start` to `stop`, with the loop at each value."""

    at: Callable[[float], Loop]
    start: float
    stop: float
    free: float

    def turns(self, value: float) -> bool:
        """Whether the law moves the rigid body's double zero at s = 0."""
        law = self.at(value).law
        return bool(law.K1 or law.Kp)

    @property
    def moves(self) -> bool:
        """Whether the rigid body's zeros are followed."""
        ends = (self.start, (self.start + self.stop) / 2, self.stop)
        return self.at(self.start).arm.has_rigid_mode and any(self.turns(value) for value in ends)

    def follow(self, zeros: Complex, wanted: int, first: float = FIRST) -> list[Node]:
        """All nodes; `zeros` (n, 2) at `start` hold the rigid body's pair first where it moves and already has.

        `first` is the first step, as a share of the way.
        """
        family, start, stop, way = self._member, Node(self.start, zeros), self.stop, self.stop - self.start
        if self.moves and not self.turns(self.start):
            start = self._parted(zeros)
        soft = self.moves and not self.turns(stop)
        if soft:
            stop = stop - SOFT * way
        nodes = follow(family, start, stop, first * way, wanted)
        return [*nodes, self._met(nodes[-1])] if soft else nodes

    @property
    def at_zero(self) -> int:
        """How many zeros are at s = 0 all the way: of one zero, followed, the partner, of two none is followed."""
        if not self.at(self.start).arm.has_rigid_mode:
            return 0
        ends = (self.start, (self.start + self.stop) / 2, self.stop)
        return 2 if not self.moves else 0 if any(self.at(value).law.Kp for value in ends) else 1

    def _member(self, value: float) -> Any:
        return member_of(self.at(value), self.at_zero, self.free)

    def _parted(self, zeros: Complex) -> Node:
        """The first node after the start, where the rigid body's zeros are those of J_eff s^2 + K1 s + Kp."""
        share = SOFT
        while True:
            value = self.start + share * (self.stop - self.start)
            rigid = rigid_pair(self.at(value))
            if abs(rigid).max() < APART * self.free / FREE:
                break
            share /= 100
        guess = np.concatenate([rigid[None], zeros])
        found, stray = corrected(self._member(value), guess)
        if stray.any():
            raise ConvergenceError("the rigid body's zeros cannot be told from the others at small gains", guess, found)
        return Node(value, found)

    def _met(self, last: Node) -> Node:
        """The node at the end, where the rigid body's zeros meet again at s = 0."""
        member = member_of(self.at(self.stop), 2, self.free)
        found, stray = corrected(member, last.zeros[1:])
        if stray.any():
            raise ConvergenceError("branches cannot be told apart at the end of the range", last.zeros, found)
        return Node(self.stop, np.concatenate([np.zeros((1, 2), complex), found]))


def followed(variation: Variation, start: float, stop: float, wanted: int) -> tuple[list[Segment], float]:
    """The segments of the locus from `start` to `stop` with its first `wanted` pairs, and the lowest frequency [rad/s].

    Raises ConvergenceError if a branch is lost.
    """
    lost: ConvergenceError | None = None
    for company in COMPANY:
        try:
            return _followed(variation, start, stop, wanted, wanted + company)
        except ConvergenceError as error:
            lost = error
    assert lost is not None
    raise lost


def _followed(variation: Variation, start: float, stop: float, wanted: int, number: int) -> tuple[list[Segment], float]:
    first = variation.at(start)
    zeros, lowest = open_pairs(first.arm, number, wanted)
    free = FREE * lowest
    law = first.law
    if law.K1 or law.K2 or law.Kp:
        scaled = Stage(lambda scale: Loop(first.arm, _scaled(law, scale)), 0.0, 1.0, free)
        zeros = scaled.follow(zeros, wanted)[-1].zeros
    stage = Stage(variation.at, start, stop, free)
    return segments(stage.follow(zeros, wanted), stage.at_zero == 1), lowest


def open_pairs(arm: Arm, number: int, wanted: int) -> tuple[Complex, float]:
    """Pairs of the first flexible modes of the arm without feedback, (n, 2), and the lowest frequency [rad/s].

    Of the `number` of modes followed from C = 0 to the arm's own C the first `wanted` are sure to arrive.
    """
    undamped, C = replace(arm, link=replace(arm.link, damping=0.0)), arm.link.damping
    table = modes(undamped, number)
    omega = table.natural_frequency[table.index > 0]
    zeros, lowest = np.stack([1j * omega, -1j * omega], axis=1), float(omega[0])
    if C == 0:
        return zeros, lowest
    stage = Stage(Variation(arm, HubFeedback(), "damping").at, 0.0, C, FREE * lowest)
    return stage.follow(zeros, wanted, min(1.0, FIRST / (omega[-1] * C)))[-1].zeros, lowest


def rigid_pair(loop: Loop) -> Complex:
    """The zeros of J_eff s^2 + K1 s + Kp: what the rigid body's become under small gains."""
    J = effective_inertia(loop.arm, loop.law.K2) or 1e-9 * loop.arm.total_inertia
    b, c = loop.law.K1 / J, loop.law.Kp / J
    root = np.sqrt(complex(b * b / 4 - c))
    far = -b / 2 - np.copysign(root.real, b) if root.real else -b / 2 + 1j * root.imag
    near = c / far if root.real else np.conj(far)
    return np.array([near, far] if root.real else [far, near], complex)


def segments(nodes: list[Node], pinned: bool = False) -> list[Segment]:
    """The nodes cut where zeros were paired anew, with the branches handed on from zero to zero."""
    slots = np.arange(nodes[0].zeros.size).reshape(-1, 2)
    cut: list[Segment] = []
    kept = [nodes[0]]
    for before, after in pairwise(nodes):
        if after.at == before.at:
            cut.append(Segment(kept, slots, pinned))
            slots, kept = _handed_on(ordered(before.zeros, pinned), ordered(after.zeros, pinned), slots), []
        kept.append(after)
    return [*cut, Segment(kept, slots, pinned)]


def _handed_on(old: Complex, new: Complex, slots: NDArray[np.int64]) -> NDArray[np.int64]:
    """The branch of each zero after a new pairing: that of the same zero before it, or a new number."""
    handed = slots[: len(new)].copy()
    fresh = int(slots.max()) + 1
    for i in np.nonzero((old[: len(new)] != new).any(axis=1))[0]:
        for j in (0, 1):
            same = np.argwhere(old == new[i, j])
            handed[i, j] = slots[tuple(same[0])] if same.size else fresh
            fresh += not same.size
    return handed


def ordered(zeros: Complex, pinned: bool = False) -> Complex:
    """The pairs with Im > 0 first, or the larger of two real ones: an order that holds while a pair stays one.

    `pinned`: the first pair keeps its order.
    """
    first, second = zeros[..., 0], zeros[..., 1]
    swap = np.where((first.imag != 0) | (second.imag != 0), first.imag < second.imag, first.real < second.real)
    if pinned:
        swap[..., 0] = False
    return np.where(swap[..., None], zeros[..., ::-1], zeros)


def _scaled(law: HubFeedback, scale: float) -> HubFeedback:
    return HubFeedback(K1=scale * law.K1, K2=scale * law.K2, Kp=scale * law.Kp)
