"""Branches of a root locus: from the open arm's modes to the gains at the start, and along what varies.

The pairs of zeros are those of `spectrum.continuation`; where a real zero leaves its pair for another's, the branches
stay with the zeros: a branch is a zero followed, not a pair.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import RATE_GAIN, Arm, HubFeedback
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum import damped_modes, modes
from tfarm.spectrum.continuation import Node, corrected, follow, through_nodes
from tfarm.spectrum.damped import COMPANY, single_zeros
from tfarm.spectrum.scales import rate_unit

from .loop import Loop
from .variation import Variation, member_of

MAY_PASS_ORIGIN = 1e-6  # of the lowest flexible frequency: zeros closer to the origin may pass it
FIRST_STEP_SHARE = 0.01  # the first step along a parameter, as a share of the way
STEP_SHRINKS = 10  # times, where at its end the rigid body's zeros are not yet told from the others: time alone
SOFT = 1e-6  # where the rigid body's zeros meet at s = 0, this share of the way is left out
LEAST_STEP_SHARE = 1e-15  # share of the way at which they are no longer looked for on the other side
SAME_ZERO = 1e-9  # of its size: a zero paired anew is known again so closely
NOBODY = -1  # the number of the branch of a zero that has ended
ASIDE = 1e-3  # of J w1: a rate gain that keeps modes from meeting on the axis
GUESSING_NODES = 4  # nodes through which a guess between two of them goes
FARTHEST_RIGID = 0.02  # of the lowest flexible frequency: how far the rigid body's zeros may be there
CANCELLED_INERTIA = 1e-9  # of the arm's: stands for an effective inertia cancelled by moment feedback, to start from


@dataclass(frozen=True)
@record
class Stretch:
    """Nodes between which the pairs stay what they are, and the number of the branch of each zero, (n, 2)."""

    nodes: list[Node]
    slots: NDArray[np.int64]
    pinned: bool = False  # whether the first of the zeros is 0 all the way

    def guess(self, values: Real) -> Complex:
        """The pairs (values, n, 2), by polynomials through the nodes around each value, in the order of `ordered`."""
        at = np.array([node.at for node in self.nodes])
        way = np.sign(at[-1] - at[0]) or 1.0
        which = np.clip(np.searchsorted(way * at, way * values) - 1, 0, max(0, at.size - 2))
        guess = np.empty((values.size, *self.slots.shape), complex)
        for n in np.unique(which):
            low = max(0, min(int(n) + 1 - GUESSING_NODES // 2, at.size - GUESSING_NODES))
            guess[which == n] = through_nodes(self.nodes[low : low + GUESSING_NODES], values[which == n])
        return ordered(guess, self.pinned)


@dataclass(frozen=True)
@record
class Stage:
    """One way of what varies from `start` to `stop`."""

    variation: Variation
    start: float
    stop: float
    lowest: float  # flexible frequency [rad/s]

    def turns(self, value: float) -> bool:
        """Whether the law moves the rigid body's double zero at s = 0."""
        return bool(self.variation.left_at_origin(np.array([value]))[0] < 2)

    @cached_property
    def moves(self) -> bool:
        """Whether the rigid body's zeros are followed."""
        ends = (self.start, (self.start + self.stop) / 2, self.stop)
        return self.variation.arm.has_rigid_mode and any(self.turns(value) for value in ends)

    def follow(self, zeros: Complex, wanted: int, first: float = FIRST_STEP_SHARE) -> list[Node]:
        """All nodes; `zeros` (n, 2) at `start` hold the rigid body's pair first where it moves and already has.

        `first` is the first step, as a share of the way.
        """
        way, before = self.stop - self.start, Node(self.start, zeros)
        if self.moves and not self.turns(self.start):
            before = Node(self.start, np.concatenate([np.zeros((1, 2), complex), zeros]))
            rest = self._followed(self._leaving(before, rigid_pair), wanted, FIRST_STEP_SHARE * way, (before,))
        elif self.moves and self.at_zero == 0 and zeros[0, 0] == 0:
            rest = self._followed(self._leaving(before, _slow_zero), wanted, FIRST_STEP_SHARE * way, (before,))
        else:
            return self._followed(before, wanted, first * way, ())
        return [before, *rest]

    def _followed(self, start: Node, wanted: int, first: float, before: tuple[Node, ...]) -> list[Node]:
        family, stop, soft = self._member, self.stop, self.moves and not self.turns(self.stop)
        if soft:
            stop = stop - SOFT * (self.stop - self.start)
        nodes = follow(family, start, stop, first, wanted, before)
        return [*nodes, self._met(nodes[-1])] if soft else nodes

    @cached_property
    def at_zero(self) -> int:
        """How many zeros are at s = 0 all the way: of one zero, followed, the partner, of two none is followed."""
        if not self.variation.arm.has_rigid_mode:
            return 0
        ends = (self.start, (self.start + self.stop) / 2, self.stop)
        return 2 if not self.moves else 0 if not self.variation.left_at_origin(np.array(ends)).all() else 1

    def _member(self, value: float) -> Any:
        return member_of(self.variation, value, self.at_zero, MAY_PASS_ORIGIN * self.lowest)

    def _leaving(self, before: Node, rigid: Callable[[Loop, Complex], Complex]) -> Node:
        """The first node after the start, where the rigid body's zeros leave s = 0 as `rigid` says."""
        share = FIRST_STEP_SHARE
        while share > LEAST_STEP_SHARE:
            value = self.start + share * (self.stop - self.start)
            guess = before.zeros.copy()
            guess[0] = rigid(self.variation.at(value), guess[0])
            if abs(guess[0] - before.zeros[0]).max() < FARTHEST_RIGID * self.lowest:
                found, stray = corrected(self._member(value), guess)
                if not stray.any():
                    return Node(value, found)
            share /= STEP_SHRINKS
        raise ConvergenceError("the rigid body's zeros cannot be told from the others at small gains", before, share)

    def _met(self, last: Node) -> Node:
        """The node at the end, where the rigid body's zeros meet again at s = 0."""
        member = member_of(self.variation, self.stop, 2, MAY_PASS_ORIGIN * self.lowest)
        found, stray = corrected(member, last.zeros[1:])
        if stray.any():
            raise ConvergenceError("branches cannot be told apart at the end of the range", last.zeros, found)
        return Node(self.stop, np.concatenate([np.zeros((1, 2), complex), found]))


def followed(variation: Variation, start: float, stop: float, wanted: int) -> tuple[list[Stretch], float]:
    """The segments of the locus from `start` to `stop` with its first `wanted` pairs, and the lowest frequency [rad/s].

    Raises ConvergenceError where branches cannot be told apart.
    """
    lost: ConvergenceError | None = None
    for company in COMPANY:
        try:
            return _followed(variation, start, stop, wanted, wanted + company)
        except ConvergenceError as error:
            lost = lost or error
    assert lost is not None
    text = "branches cannot be told apart: ask for fewer, or another range"
    if isinstance(lost.best, Node) and min(start, stop) <= lost.best.at <= max(start, stop):
        text = text.replace("apart", f"apart beyond {variation.vary} = {lost.best.at:.10g}")
    raise ConvergenceError(text, lost.best, lost.residual)


def _followed(variation: Variation, start: float, stop: float, wanted: int, number: int) -> tuple[list[Stretch], float]:
    """The locus with so many modes in all: first from the open arm to the law at the start, all gains growing together.

    Without losses two modes may meet on that way and leave the imaginary axis as a quadruple: then around that, with a
    little feedback of the hub's rate that is taken back at the end.
    """
    first = variation.at(start)
    arm, law = first.arm, first.gains or HubFeedback()
    zeros, lowest = open_pairs(arm, number, wanted)
    wanted += len(single_zeros(modes(arm, 1)))  # which stand before the flexible modes
    if any(law.row):
        try:
            zeros = Stage(Variation(arm, law, "all"), 0.0, 1.0, lowest).follow(zeros, wanted)[-1].zeros
        except ConvergenceError:
            aside = law[RATE_GAIN] + ASIDE * rate_unit(arm)
            around = Variation(arm, law.having(RATE_GAIN, aside), "all")
            zeros = Stage(around, 0.0, 1.0, lowest).follow(zeros, wanted)[-1].zeros
            back = Stage(Variation(arm, law, RATE_GAIN), aside, law[RATE_GAIN], lowest)
            zeros = back.follow(zeros, wanted)[-1].zeros
    stage = Stage(variation, start, stop, lowest)
    return stretches(stage.follow(zeros, wanted), stage.at_zero == 1), lowest


def open_pairs(arm: Arm, number: int, wanted: int) -> tuple[Complex, float]:
    """Pairs of the first flexible modes of the arm without feedback, (n, 2), and the lowest frequency [rad/s].

    Before them 0 and about -b/J of a hub with friction, and the real pole of a motor's circuit beside NaN.
    Of the `number` of modes followed from C = 0 to the arm's own C the first `wanted` are sure to arrive.
    """
    undamped, C = arm.elastic, arm.damping
    table = modes(undamped, number)
    omega = table.natural_frequency[table.index > 0]
    zeros, lowest = np.stack([1j * omega, -1j * omega], axis=1), float(omega[0])
    if arm.is_undamped:
        return np.concatenate([_alone(single_zeros(table)), zeros]), lowest
    if not arm.is_uniform:
        found = damped_modes(modes(arm, number))
        turning = found.eigenvalues[(found.index == 0) & (found.eigenvalues[:, 1] != 0)]
        flexible = found.eigenvalues[(found.index > 0) & found.is_assigned]
        return np.concatenate([turning, _alone(found.others), found.unassigned_pairs, flexible]), lowest
    stage = Stage(Variation(arm, HubFeedback(), "damping"), 0.0, C, lowest)
    return stage.follow(zeros, wanted, min(1.0, FIRST_STEP_SHARE / (omega[-1] * C)))[-1].zeros, lowest


def _alone(zeros: Sequence[float]) -> Complex:
    """Real zeros that are no pair, each beside NaN."""
    return np.array([[zero, np.nan] for zero in zeros], complex).reshape(-1, 2)


def rigid_pair(loop: Loop, _: Complex) -> Complex:
    """The zeros of J_eff s^2 + b s + c (`Loop.at_rest`): what the rigid body's become under small gains."""
    assert loop.at_rest is not None
    c, b, J = loop.at_rest
    J = J or CANCELLED_INERTIA * loop.arm.total_inertia
    b, c = b / J, c / J
    root = np.sqrt(complex(b * b / 4 - c))
    far = -b / 2 - np.copysign(root.real, b) if root.real else -b / 2 + 1j * root.imag
    near = c / far if root.real else np.conj(far)
    return np.array([near, far] if root.real else [far, near], complex)


def _slow_zero(loop: Loop, pair: Complex) -> Complex:
    """The pair with its zero at 0 moved to -c/b: where it goes while little holds the hub's angle."""
    assert loop.at_rest is not None
    c, b, _ = loop.at_rest
    return np.array([-c / b, pair[1]], complex)


def stretches(nodes: list[Node], pinned: bool) -> list[Stretch]:
    """The nodes cut where zeros were paired anew, with the branches handed on from zero to zero."""
    slots = np.arange(nodes[0].zeros.size).reshape(-1, 2)
    fresh = slots.size
    cut: list[Stretch] = []
    kept, pinned = [nodes[0]], pinned and nodes[0].zeros[0, 0] == 0
    for before, after in pairwise(nodes):
        if after.at == before.at:
            cut.append(Stretch(kept, slots, pinned))
            still = pinned and after.zeros[0, 0] == 0
            slots = _handed_on(ordered(before.zeros, pinned), ordered(after.zeros, still), slots, fresh)
            fresh, kept, pinned = max(fresh, int(slots.max()) + 1), [], still
        kept.append(after)
    return [*cut, Stretch(kept, slots, pinned)]


def _handed_on(old: Complex, new: Complex, slots: NDArray[np.int64], fresh: int) -> NDArray[np.int64]:
    """The branch of each zero after a new pairing: that of the same zero before it, a new number, or NOBODY's."""
    handed = np.full(new.shape, NOBODY)
    for i, j in zip(*np.nonzero(~np.isnan(new)), strict=True):
        apart = abs(old - new[i, j])
        same = np.nanmin(apart) <= SAME_ZERO * abs(new[i, j])
        handed[i, j] = slots.ravel()[int(np.nanargmin(apart))] if same else fresh
        fresh += not same
    return handed


def ordered(zeros: Complex, pinned: bool) -> Complex:
    """The pairs with Im > 0 first, or the larger of two real ones: an order that holds while a pair stays one.

    `pinned`: the first pair keeps its order.
    """
    first, second = zeros[..., 0], zeros[..., 1]
    swap = np.where((first.imag != 0) | (second.imag != 0), first.imag < second.imag, first.real < second.real)
    if pinned:
        swap[..., 0] = False
    return np.where(swap[..., None], zeros[..., ::-1], zeros)
