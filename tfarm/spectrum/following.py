"""Roots of a family of functions followed as one number varies: each keeps its column.

Predictor: polynomials through the last values.  For two roots that are each other's nearest, such as a pair next to the
real axis, they are polynomials of the mean and of the square of half the distance.  Both are smooth where the two meet
and separate at a right angle.  Corrector: that of the family (`Family.near`), for many values and all roots at once.  A
step is halved where a root is further from its prediction than a share of its distance to the next root.  Where no step
is short enough the complete set of the family is assigned to the predictions.

The functions are real on the real axis: both of a conjugate pair have a column, the lower being the mirror image.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real, Whole
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic

NEWTON_STEPS = 8  # from a close guess: others are followed in shorter steps
SETTLED = 1e-10  # of its size: the largest last step of a converged zero
LOST = complex(np.nan, np.nan)
PAST = 4  # values of the predicting polynomials
MOST_AHEAD = 64  # values predicted at once, at most: memory and time alone
MOST_DISTANCES = 4_000_000  # between roots at these values: memory alone
FIRST_STEP = 1e-4  # of the first step: the distance of the value that determines the first slopes
PLAIN_MOVE = 0.1  # of the distance to the next root: largest distance from the prediction
PLAIN_IN_COUPLE = 0.2  # the same, for two roots that meet or separate
ENDS_BEFORE = 0.05  # of its size: distance of a singular point at which a real root right of it ends
JUMP = 0.5  # of its size: a root found no nearer with the shortest step is lost
SAME_ROOT = 1e-9  # of its size: distance of two copies of one root
TURNED = 0.5  # cosine below which the two of a couple have met between two values


def settled(function: Callable[..., Analytic], guess: Complex, *values: Real) -> Complex:
    """Return the zero next to each guess (n,) by Newton's method, a real one for a real guess, or NaN.

    The function is of s and, where these are given, of `values` (n,).
    """
    s, still = guess.copy(), ~np.isnan(guess)
    with np.errstate(all="ignore"):
        for _ in range(NEWTON_STEPS):
            if not still.any():
                break
            there = function(s[still], *(each[still] for each in values))
            move = there.value / there.slope
            s[still] -= np.where(s[still].imag == 0, move.real, move)
            still[still] = ~(abs(move) <= SETTLED * abs(s[still]))
    return np.where(still | ~np.isfinite(s), LOST, s)


class Family(Protocol):
    """A family of functions: `least_step` is the shortest step, as a share of the way, `blur` a negligible distance.

    There are at most `most_halvings` of steps; a branch that meets the axis needs some 40.  Stray roots, up to the
    share `alone` of all, are followed alone in shorter steps.
    """

    least_step: float
    most_halvings: int
    alone: float
    blur: float

    def near(self, values: Real, guess: Complex) -> Complex:
        """Return the roots (m, b) next to the guesses at m values, or NaN; real ones for real guesses.

        For the guess 0 those next to 0, the upper one or the larger real one first.
        """
        ...

    def complete(self, value: float, guess: Complex) -> Complex:
        """Return all known roots at a value, in any order, with those next to the guesses (b,)."""
        ...

    def singular(self, values: Real) -> Real:
        """Return points (m, p) that no root passes, at m values: a real root right of one ends there."""
        ...


def follow(family: Family, values: Real, start: Complex) -> Complex:
    """Return the roots (n, b) at each of the values (n,), from those at the first; NaN from where one is lost.

    A root is lost at a singular point, and where it is next to no root of the complete set.
    Raises ConvergenceError after too many halvings, with the last value, its roots, and which of them are stray.
    """
    rows = np.full((values.size, start.size), np.nan, complex)
    rows[0], past, span = start, [(float(values[0]), start)], abs(values[-1] - values[0])
    ahead = [(float(value), n) for n, value in enumerate(values)][:0:-1]
    ahead.append((past[0][0] + FIRST_STEP * (ahead[-1][0] - past[0][0]), 0))
    many, halvings, most = 1, 0, max(1, min(MOST_AHEAD, MOST_DISTANCES // start.size**2))
    while ahead:
        block, (before, last) = ahead[-many:][::-1], past[-1]
        at = np.array([value for value, _ in block])
        guess = predicted(np.array([value for value, _ in past]), np.array([row for _, row in past]), at, last)
        found = corrected(family, at, guess, last)
        are_plain = which_plain(family, at, guess, found, last)
        good = int(np.argmin(np.r_[are_plain.all(axis=1), False]))
        if not good and len(block) == 1:
            stray = ~are_plain[0]
            if stray.mean() <= family.alone:
                good = int(are_alone(family, before, float(at[0]), last, found[0], stray))
            if not good and abs(at[0] - before) > family.least_step * span:
                ahead.append(((before + float(at[0])) / 2, 0))
                halvings += 1
                if halvings > family.most_halvings:
                    raise ConvergenceError(f"branches are not separable beyond {before:.10g}", past[-1], stray)
            elif not good:
                near, good = assigned(family, float(at[0]), guess[0]), 1
                found = np.where((abs(near - last) > JUMP * abs(last)) & (last != 0), np.nan, near)[None]
        many = min(2 * many, most) if good == len(block) else max(1, good)
        del ahead[len(ahead) - good :]
        for (value, n), row in zip(block[:good], found[:good], strict=True):
            if n:
                rows[n] = row
            past = [*past, (value, np.where(is_over(family, value, row), np.nan, row))][-PAST:]
    return rows


def are_alone(
    family: Family, before: float, value: float, last: Complex, found: Complex, stray: NDArray[np.bool_]
) -> bool:
    """Whether stray roots and their partners, followed alone from `before` to a value into `found`, differ from others.

    Raises ConvergenceError as `follow` where one of them is lost.
    """
    stray = with_partners(stray, last)
    try:
        found[stray] = follow(family, np.array([before, value]), last[stray])[1]
    except ConvergenceError as lost:
        raise ConvergenceError(str(lost), (before, last), stray) from None
    return not (distances(found).min(axis=1) <= SAME_ROOT * abs(found)).any()


def with_partners(stray: NDArray[np.bool_], last: Complex) -> NDArray[np.bool_]:
    """Return these roots and the partners of each in a couple or conjugate pair."""
    both, (first, second) = stray.copy(), couples(last)
    both[first] |= stray[second]
    both[second] |= stray[first]
    mirrored = (last[:, None] == last[stray].conj()).any(axis=1)
    return both | mirrored


def between(family: Family, values: Real, rows: Complex, wanted: Real) -> Complex:
    """Return the roots (m, b) at wanted values (m,) between the known ones (n,), ascending.

    By interpolation, or where that is uncertain by following them from the known value below.
    """
    found = np.empty((wanted.size, rows.shape[1]), complex)
    right = np.clip(np.searchsorted(values, wanted), 1, values.size - 1)
    for n in np.unique(right):
        low = int(np.clip(n - PAST // 2, 0, max(0, values.size - PAST)))
        here, near = np.flatnonzero(right == n), slice(low, low + PAST)
        guess = predicted(values[near], rows[near], wanted[here], rows[n - 1])
        found[here] = corrected(family, wanted[here], guess, rows[n - 1])
        for each in here[~which_plain(family, wanted[here], guess, found[here], rows[n - 1]).all(axis=1)]:
            found[each] = follow(family, np.array([values[n - 1], wanted[each]]), rows[n - 1])[1]
    return found


def is_over(family: Family, value: float, row: Complex) -> NDArray[np.bool_]:
    """Return which of the roots (b,) are at a singular point, right of it."""
    points = family.singular(np.array([value]))[0]
    away = row.real[:, None] - points
    return np.asarray((row.imag == 0) & ((away > 0) & (away < ENDS_BEFORE * abs(points))).any(axis=1))


def assigned(family: Family, value: float, guess: Complex) -> Complex:
    """Return the complete set at a value in the order of the guesses (b,); NaN where there are fewer."""
    from scipy.optimize import linear_sum_assignment  # half a second to import, and rarely needed

    every = family.complete(value, guess)
    alive = np.flatnonzero(~np.isnan(guess))
    rows, columns = linear_sum_assignment(abs(guess[alive, None] - every))
    found = np.full(guess.shape, np.nan, complex)
    found[alive[rows]] = every[columns]
    return found


def predicted(at: Real, rows: Complex, wanted: Real, base: Complex) -> Complex:
    """Return guesses (m, b) by polynomials through known roots (k, b) at k values; `base` (b,) has the couples."""
    own = np.eye(at.size, dtype=bool)
    ratios = (wanted[:, None, None] - at) / np.where(own, 1.0, at[:, None] - at)
    weights = np.where(own, 1.0, ratios).prod(axis=2)
    guess = weights @ np.where((rows.imag == 0) == (base.imag == 0), rows, np.nan)  # without values from before two met
    first, second = couples(base)
    mean, half = (rows[:, first] + rows[:, second]) / 2, (rows[:, first] - rows[:, second]) / 2
    mean = np.where((mean.imag == 0) == ((base[first] + base[second]).imag == 0), mean, np.nan)
    apart = (base[first] - base[second]) / 2
    root = np.sqrt(weights @ (half * half))
    way = (root * apart.conj()).real
    turned = abs(way) < TURNED * abs(root) * abs(apart)  # then the first is the upper one, or the larger real one
    root = np.where(np.where(turned, (root.real + root.imag) * (apart.real + apart.imag), way) < 0, -root, root)
    middle = weights @ mean
    guess[:, first], guess[:, second] = middle + root, middle - root
    lost = np.isnan(guess) & ~np.isnan(base)
    if lost.any() and at.size > 1:  # known at the last of the values alone
        return np.where(lost, predicted(at[1:], rows[1:], wanted, base), guess)
    return guess


def couples(row: Complex) -> tuple[Whole, Whole]:
    """Return first and second of each two roots (b,) nearest to each other: conjugates, or of one half-plane."""
    away = distances(row)
    nearest, every = away.argmin(axis=1), np.arange(row.size)
    alike = (row == row[nearest].conj()) | (np.sign(row.imag) == np.sign(row[nearest].imag))
    first = np.flatnonzero((nearest[nearest] == every) & (every < nearest) & alike & np.isfinite(away.min(axis=1)))
    return first, nearest[first]


def corrected(family: Family, values: Real, guess: Complex, base: Complex) -> Complex:
    """Return the roots (m, b) next to the guesses, those below the real axis as mirror images."""
    partner = np.arange(base.size)
    first, second = couples(np.where(base.imag == 0, base, np.nan))
    partner[first], partner[second] = second, first
    mirrors = (base[:, None] == base.conj()) & (base.imag < 0)[:, None]
    lower, upper = np.nonzero(mirrors)
    partner[lower] = upper
    is_lower = (guess.imag < 0) & (partner != np.arange(base.size))
    found = family.near(values, np.where(is_lower, np.nan, guess))
    return np.where(is_lower, found[:, partner].conj(), found)


def distances(row: Complex) -> Real:
    """Return the distances (..., b, b) of the roots (..., b); inf from themselves and from NaN."""
    away = abs(row[..., :, None] - row[..., None, :])
    away[..., np.arange(row.shape[-1]), np.arange(row.shape[-1])] = np.inf
    away[np.isnan(away)] = np.inf
    return np.asarray(away)


def which_plain(family: Family, values: Real, guess: Complex, found: Complex, base: Complex) -> NDArray[np.bool_]:
    """Return which roots (m, b) are close to their prediction, compared with the distance to any other.

    Others include the mirror image of a root without one in the base (b,).
    """
    away, moved = distances(found), abs(found - guess)
    nearest = away.argmin(axis=2)[..., None]
    own = np.take_along_axis(away, nearest, 2)[..., 0]
    is_couple = np.take_along_axis(nearest[..., 0], nearest[..., 0], 1) == np.arange(found.shape[1])
    np.put_along_axis(away, nearest, np.where(is_couple, np.inf, own)[..., None], 2)
    room = away.min(axis=2, initial=np.inf)
    for point in family.singular(values).T:
        room = np.minimum(room, abs(found - point[:, None]))
    has_mirror = (base[:, None] == base.conj()).any(axis=1) | (base.imag == 0)
    room = np.where(has_mirror, room, np.minimum(room, 2 * np.minimum(abs(found.imag), abs(base.imag))))
    near = (moved <= np.where(is_couple, PLAIN_IN_COUPLE, PLAIN_MOVE) * own) & (
        np.sign(found.imag) == np.sign(guess.imag)
    )
    same = (near | (guess == 0) | (found == 0)) & (moved <= PLAIN_MOVE * room)
    return np.asarray(np.isnan(guess) | same | (moved <= family.blur))
