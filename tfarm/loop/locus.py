"""Root loci of the exact arm: branches that keep their identity, and where they cross the imaginary axis.

The branches are followed from the modes of the open arm (`branches`), with few steps; between these they are guessed by
cubics, and every zero at every value asked for is polished at once by Newton's method on the transcendental
characteristic function.  A guess that moves too far, or lands on a neighbour, is followed again from the last node.

Pairs of poles are followed because that is cheaper than to find all poles of a box at each value, and as sure: of 314
random loci (`python -m tests.loop.loci 60 11` and `250 5`) none was refused, and no point was wrong.  Under any other
law there are poles that continue from no mode, infinitely many with a delay; so its loci complete a box (`law_locus`).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import NAMES, Arm, HubFeedback
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.crossing.turning import loose
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.spectrum.continuation import Member, corrected, follow

from .branches import MAY_PASS_ORIGIN, NOBODY, Stretch, followed, ordered
from .crossings import BranchCrossing, branch_crossings, in_words
from .ended import with_others
from .lines import static_crossings
from .variation import Evaluator, Variation, free_of_loss, member_of, must_be_way, must_keep_losing

MOST_LOCUS_POINTS = 100_000  # values, those between that make it round among them
MOST_BRANCHES = 200  # as many modes are followed
LEAST_WIDTH, LEAST_HEIGHT = 1e-12, 1e-9  # of a picture, of the size of its poles: less is rounding of one that stands
FARTHEST_POLISH = 0.25  # how far a zero may be polished from its guess, in distances to the next branch
POLISHED_TO = 1e-10  # of its size: one step more is taken where Newton's method still moves a zero by this
POLISH_STEPS = 6  # of Newton's method from a guess right to some digits: what has not settled then is followed again
FALLEN_TOGETHER = 1e-3  # of the distance of two guesses: zeros polished to less are one, found twice
STEPS_ANEW = 8  # of what is followed again from a node, to begin with: the steps are adapted, so time alone
HALVING_ROUNDS = 24  # of halving at most: where two branches meet their distance goes with the root of that of the gain
BESIDE_STATIC = 1e-9  # of the range: so far before such a gain zeros are followed, as one that is 0 has no digits
SAME_STATIC_GAIN = 1e-12  # relative: a gain so near to that at which a pole passes through 0 has the pole there


@dataclass(frozen=True)
@record
class Locus:
    """The closed-loop poles of an arm under a law, as one number varies.

    `gain` (n,) are the values of what `vary` names; `branches` (b, n) [1/s] are zeros followed: those at s = 0, then
    one a mode with Im s > 0, in the order of the modes they continue from (`mode` (b,), 0 for the rigid body and for a
    motor's circuit).  The mirror image of a branch is left out, unless the two meet on the real axis and part there:
    then it is a branch of its own, with Im s < 0 where they are a pair.  A branch that comes to -1/C, or meets a zero
    that nobody follows, ends there (`ends`), and is NaN beyond.  `crossings` are those of the imaginary axis, ascending
    along the way: along a gain of a damped arm all there are below the highest branch, else those of the branches.
    """

    arm: Arm
    law: HubFeedback
    vary: str
    gain: Real
    branches: Complex
    mode: NDArray[np.int64]
    crossings: tuple[BranchCrossing, ...]

    @property
    def finding(self) -> str:
        """Where the imaginary axis is crossed, in words."""
        return in_words(self.vary, self.crossings)

    @property
    def variation(self) -> Variation:
        """The family of loops."""
        return Variation(self.arm, self.law, self.vary)

    @property
    def spectral_abscissa(self) -> Real:
        """The largest real part [1/s] of these branches at each gain, apart from zeros at s = 0."""
        moving = np.where(self.branches == 0, -math.inf, self.branches.real)
        return np.asarray(np.fmax.reduce(moving, axis=0))

    @property
    def ends(self) -> tuple[tuple[int, float], ...]:
        """The number of each branch that ends on the way, and the last of the values at which it lives."""
        lives = ~np.isnan(self.branches)
        rows = np.nonzero(~lives[:, -1])[0]
        return tuple((int(row), float(self.gain[np.nonzero(lives[row])[0][-1]])) for row in rows if lives[row].any())


def locus(arm: Arm, law: HubFeedback, vary: str, start: float, stop: float, points: int, branches: int) -> Locus:
    """The exact locus at `points` equally spaced values from `start` to `stop`, of the first `branches` branches.

    `vary` is a gain, "all" (a scale on the law) or a parameter of the arm: payload_mass, payload_inertia,
    hub_inertia, length, damping; what it names in `arm` or `law` is replaced.  Raises ParameterError for what is no
    loop or no range, ConvergenceError where branches cannot be told apart, and where one has ended and an unstable pole
    is on none (along a gain that is no error: its crossing is listed).
    """
    points = whole("points", points, 2, MOST_LOCUS_POINTS, f"a whole number from 2 to {MOST_LOCUS_POINTS}")
    branches = whole("branches", branches, 1, MOST_BRANCHES, f"a whole number from 1 to {MOST_BRANCHES}")
    variation = Variation(arm, law, vary)
    must_be_way(start, stop)
    for value in (start, stop):
        variation.at(value)
    must_keep_losing(variation, start, stop)
    if vary == "all" and law == HubFeedback():
        one_of = f"{', '.join(NAMES[:-1])} or {NAMES[-1]}"
        raise ParameterError(key="vary", value="all", remedy=f"every gain is 0: give {one_of} to be scaled")
    return _traced(variation, np.linspace(start, stop, points), branches, rounds=0)


def rounded(found: Locus) -> Locus:
    """The same locus with more values between its own, until no branch turns by more than 5 degrees as it is drawn.

    Each is seen in a picture of its own and in one of all, down to pieces of a pixel.
    """
    return _traced(found.variation, found.gain, len(found.branches), HALVING_ROUNDS)


def _traced(wanted: Variation, gain: Real, branches: int, rounds: int) -> Locus:
    """The locus at these values, and at those between that so many rounds find to be needed: from either end.

    What cannot be followed one way, as a pole that passes through 0 in the wake of another, often can the other way.
    """
    try:
        return _traced_along(wanted, gain, branches, rounds)
    except ConvergenceError:
        with suppress(ConvergenceError):
            back = _traced_along(wanted, gain[::-1], branches, rounds)
            if not np.isnan(back.branches).any():  # a branch that ended would begin on the way
                return _turned(back)
        raise


def _turned(found: Locus) -> Locus:
    """The same locus the other way."""
    other = {"stable": "unstable", "unstable": "stable"}
    crossings = tuple(replace(each, direction=other[each.direction]) for each in reversed(found.crossings))
    return replace(found, gain=found.gain[::-1], branches=found.branches[:, ::-1], crossings=crossings)


def _traced_along(wanted: Variation, gain: Real, branches: int, rounds: int) -> Locus:
    """The locus followed from the first of the values to the last."""
    freed, loss = free_of_loss(wanted.arm)
    variation = Variation(freed, wanted.law, wanted.vary, loss)
    cut, lowest = followed(variation, float(gain[0]), float(gain[-1]), branches + 1)
    way = float(np.sign(gain[-1] - gain[0]))

    def curves(values: Real) -> Complex:
        return _Polish(variation, Evaluator(variation, values), MAY_PASS_ORIGIN * lowest, way).curves(cut)

    every = curves(gain)
    kept, mode = _listed(every, variation, branches)
    for _ in range(rounds):
        more = _between(gain, _rows(every, kept))
        if not more.size or more.size + gain.size > MOST_LOCUS_POINTS:
            break
        try:
            added = curves(more)
        except ConvergenceError:  # next to where two meet: what is known so far is exact, and less round
            break
        order = np.argsort(way * np.r_[gain, more], kind="stable")
        gain, every = np.r_[gain, more][order], np.concatenate([every, added], axis=1)[:, order]
    rows = _rows(every, kept)
    found = branch_crossings(variation, gain, rows, lowest)
    is_solved = variation.is_of_gains and not variation.arm.is_reactive  # there and back between two values is seen too
    if is_solved or np.isnan(every[: 2 * branches]).any():
        found = with_others(variation, gain, rows, found)
    return Locus(wanted.arm, wanted.law, wanted.vary, gain, rows, mode, found)


def _between(gain: Real, rows: Complex) -> Real:
    """Half way between values where a branch is to be known more closely, in a frame of its own or of all."""
    frames = np.array([[*map(frame, rows)], [frame(rows)] * len(rows)])  # (2, b, 4)
    width, height = frames[..., 1] - frames[..., 0], frames[..., 3] - frames[..., 2]
    own, every = (loose(rows, width[n, :, None], height[n, :, None]) for n in (0, 1))
    return np.asarray((gain[:-1] + gain[1:])[own | every] / 2)


def frame(branches: Complex) -> tuple[float, float, float, float]:
    """Left, right, low and high of the picture of these branches [1/s]: all of them, with the imaginary axis."""
    points = branches[~np.isnan(branches)]
    if not points.size:
        return 0.0, 1.0, 0.0, 1.0
    left, right = min(float(points.real.min()), 0.0), max(float(points.real.max()), 0.0)
    low, high = float(points.imag.min()), float(points.imag.max())
    wide = max(right - left, LEAST_WIDTH * float(abs(points).max())) or 1.0  # where no pole moves from 0
    tall = max(high - low, LEAST_HEIGHT * high) or wide  # where none of them swings
    return left, left + wide, low, low + tall


def _listed(curves: Complex, variation: Variation, number: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which curves are the first branches that are no mirror images, and the modes that these continue from.

    Zeros at 0 that nobody follows come first, with negative numbers.
    """
    at_zero = variation.zeros_at_origin
    follows_rigid = at_zero < 2 and variation.arm.has_rigid_mode
    mode = np.arange(len(curves)) // 2
    mode = np.where(mode < follows_rigid, 0, np.maximum(0, mode + (not follows_rigid) - variation.arm.input_lags))
    idle = at_zero - (at_zero == 1 and not curves[0].any())
    curves = np.concatenate([np.zeros((idle, curves.shape[1]), complex), curves])
    mode = np.r_[np.zeros(idle, int), mode]
    lives = ~np.isnan(curves)
    real = (lives & (curves.imag == 0)).any(axis=1)
    is_mirrored = (curves.imag < 0).any(axis=1) & ~(curves.imag > 0).any(axis=1)  # but for one that went through real
    kept = np.nonzero(lives.any(axis=1) & (real | ~is_mirrored))[0][:number]
    if kept.size < number:
        raise ConvergenceError(f"only {kept.size} branches could be followed: ask for fewer", kept.size, number)
    return kept - idle, mode[kept]


def _rows(curves: Complex, kept: NDArray[np.int64]) -> Complex:
    """The branches; NaN beyond the end of one that was not followed all the way."""
    rows = np.where(kept[:, None] < 0, 0.0, curves[kept])
    return np.where(rows == 0, 0.0, rows)  # no -0


class _Polish:
    """From the nodes of the tracker to every zero at every value."""

    def __init__(self, variation: Variation, evaluator: Evaluator, free: float, way: float) -> None:
        self.variation, self.evaluator, self.free, self.way = variation, evaluator, free, way
        self.gain = evaluator.values
        self.at_zero = variation.zeros_at_origin
        self.static = np.zeros(self.gain.size, np.int64)  # 1 where a pole of an arm held at its tip passes through 0
        if variation.vary in NAMES and not variation.arm.has_rigid_mode:
            for each in static_crossings(variation.arm, variation.line):
                self.static += math.isfinite(each.t) & (abs(self.gain - each.t) <= SAME_STATIC_GAIN * abs(each.t))

    def curves(self, cut: list[Stretch]) -> Complex:
        """The branches (slots, n); those which do not live all the way are left out."""
        number = max(int(each.slots.max()) for each in cut) + 1
        curves = np.full((number, self.gain.size), np.nan, complex)
        ends = np.array([each.nodes[-1].at for each in cut[:-1]])
        owner = np.searchsorted(self.way * ends, self.way * self.gain, side="left")
        for n, segment in enumerate(cut):
            (which,) = np.nonzero(owner == n)
            if which.size:
                pairs, slots = self.pairs(segment, which).reshape(which.size, -1), segment.slots.ravel()
                lives = slots != NOBODY
                curves[slots[lives, None], which] = pairs[:, lives].T
        if self.at_zero == 1 and cut[0].pinned:
            curves[0] = 0.0
        return curves

    def pairs(self, segment: Stretch, which: NDArray[np.int64]) -> Complex:
        """The pairs (values, n, 2) of a segment at the values of those numbers, polished."""
        guess = segment.guess(self.gain[which])
        origin = self._at_origin(guess, which, segment.pinned)
        zeros, settled = self._newton(np.where(origin, 0.0, guess), which, origin)
        moved = abs(zeros - guess) > FARTHEST_POLISH * _gaps(zeros)
        parted = abs(zeros[..., 0] - zeros[..., 1]) <= FALLEN_TOGETHER * abs(guess[..., 0] - guess[..., 1])
        changed = (zeros.imag > 0) != (guess.imag > 0)
        wrong = (((moved | changed) & ~origin).any(axis=2) | (parted & ~origin.all(axis=2))).any(axis=1)
        for n in np.nonzero(wrong | ~settled.all(axis=(1, 2)))[0]:
            zeros[n] = self._stepped(segment, int(which[n]), guess[n])
        return zeros

    def _at_origin(self, guess: Complex, which: NDArray[np.int64], pinned: bool) -> NDArray[np.bool_]:
        """Which of the zeros followed are exactly 0: the smallest, as many as the law leaves there."""
        left = self.variation.left_at_origin(self.gain[which]) * (self.at_zero < 2) + self.static[which]
        if self.at_zero == 1 and not pinned:  # the zero at 0 has lost its partner, and is followed no more
            left = left - 1
        flat = abs(guess).reshape(len(guess), -1)
        rank = flat.argsort(axis=1).argsort(axis=1)
        return (rank < left[:, None]).reshape(guess.shape)

    def _newton(
        self, zeros: Complex, which: NDArray[np.int64], known: NDArray[np.bool_]
    ) -> tuple[Complex, NDArray[np.bool_]]:
        """Newton's method for every zero that is not known and no mirror image, and which of them have settled."""
        mirrored = zeros[..., 0].imag > 0
        wanted = ~known & ~np.isnan(zeros)
        wanted[..., 1] &= ~mirrored
        owner = np.broadcast_to(which[:, None, None], zeros.shape)[wanted]
        s, still = zeros[wanted], np.ones(int(wanted.sum()), bool)
        for _ in range(POLISH_STEPS):
            value, slope, _ = self.evaluator(s[still], owner[still], self.at_zero)
            with np.errstate(all="ignore"):
                move = value / slope
            move = np.where(s[still].imag == 0, move.real, move)
            s[still] -= move
            still[still] = np.isfinite(s[still]) & ~(abs(move) <= POLISHED_TO * abs(s[still]))
            if not still.any():
                break
        found, settled = zeros.copy(), np.ones(zeros.shape, bool)
        found[wanted], settled[wanted] = s, ~still & np.isfinite(s)
        found[..., 1] = np.where(mirrored, found[..., 0].conj(), found[..., 1])
        return found, settled

    def _stepped(self, segment: Stretch, number: int, guess: Complex) -> Complex:
        """The pairs at one value, all corrected together, or followed there from the last node before it."""
        value = float(self.gain[number])
        found, stray = corrected(self._member(value), guess)
        if stray.any():
            stop = value - self.static[number] * BESIDE_STATIC * float(self.gain[-1] - self.gain[0])
            nodes = [node for node in segment.nodes if (stop - node.at) * self.way >= 0]
            last = nodes[-1] if nodes else segment.nodes[0]
            step = (stop - last.at) / STEPS_ANEW
            found = follow(self._member, last, stop, step, len(last.zeros))[-1].zeros[: len(guess)]
            found = found if stop == value else self._at_rest(found, number)
        return ordered(found, segment.pinned)

    def _at_rest(self, beside: Complex, number: int) -> Complex:
        """The pairs at a value at which the smallest zero is 0, from those just before it."""
        least = abs(beside) == np.nanmin(abs(beside))
        zeros, settled = self._newton(np.where(least, 0.0, beside)[None], np.array([number]), least[None])
        if not settled.all():
            value = float(self.gain[number])
            raise ConvergenceError(
                f"at {value:.6g}, where a pole passes through 0, the others are lost", zeros[0], value
            )
        return zeros[0]

    def _member(self, value: float) -> Member:
        return member_of(self.variation, value, self.at_zero, self.free)


def _gaps(zeros: Complex) -> Real:
    """Of each zero (values, n, 2) the distance to the nearest zero of another pair; of conjugates the upper one's."""
    real = (zeros.imag == 0).all(axis=2)
    ever = np.nonzero(real.any(axis=0))[0]
    second = np.where(real[:, ever], zeros[:, ever, 1], np.inf)
    points, owner = np.concatenate([zeros[..., 0], second], axis=1), np.r_[np.arange(zeros.shape[1]), ever]
    with np.errstate(invalid="ignore"):  # inf - inf: mirror images, which are not asked for
        apart = abs(points[:, :, None] - points[:, None, :])
    apart[:, owner[:, None] == owner] = np.inf
    nearest = np.fmin.reduce(apart, axis=2)
    gaps = np.repeat(nearest[:, : zeros.shape[1], None], 2, axis=2)
    gaps[:, ever, 1] = np.where(real[:, ever], nearest[:, zeros.shape[1] :], gaps[:, ever, 1])
    return gaps
