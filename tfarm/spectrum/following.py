"""Roots of a family of functions followed as one number varies: each keeps its column.

Predictor: polynomials through the last values.  For two roots that are each other's nearest, such as a pair next to the
real axis, they are polynomials of the mean and of the square of half the distance.  Both are smooth where the two meet
and separate at a right angle.  Corrector: that of the family (`Family.near`), for many values and all roots at once.  A
step is halved where a root is further from its prediction than a share of its distance to the next root.  Where no step
is short enough the complete set of the family is assigned to the predictions.

The functions are real on the real axis: both of a conjugate pair have a column, the lower being the mirror image.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.exact.compiled import compiled, inlined

# from a close guess: others are followed in shorter steps
NEWTON_STEPS = 8
# of its size: the largest last step of a converged zero
SETTLED = 1e-10
LOST = complex(np.nan, np.nan)
# values of the predicting polynomials
PAST = 4


def polish_roots(function: Callable[..., Analytic], guess: Complex, *values: Real) -> Complex:
    """Return the zero next to each guess (n,) by Newton's method, a real one for a real guess, or NaN.

    The function is of s and, where these are given, of `values` (n,).
    """
    s = guess.copy()
    still = ~np.isnan(guess)
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
    # kernels are compiled anew for read-only arrays
    start = start.copy()
    rows = np.full((values.size, start.size), np.nan, complex)
    rows[0] = start
    # known values and roots, and the values to come, the next one last, each with its row in the result or 0
    past = [(float(values[0]), start)]
    ahead = [(float(value), n) for n, value in enumerate(values)][:0:-1]
    # the distance of the value that determines the first slopes is a small share of the first step
    ahead.append((float(values[0] + 1e-4 * (values[1] - values[0])), 0))
    many = 1
    halvings = 0
    # of values predicted at once: 64, with 4 million distances between roots
    most = max(1, min(64, 4_000_000 // start.size**2))
    while ahead:
        block = ahead[-many:][::-1]
        before, last = past[-1]
        at = np.array([value for value, _ in block])
        known, roots = map(np.array, zip(*past, strict=True))
        guess = predict_roots(known, roots, at, last)
        found = correct_roots(family, at, guess, last)
        are_plain = which_plain(guess, found, last, family.singular(at), family.blur)
        good = int(np.argmin(np.r_[are_plain.all(axis=1), False]))
        if not good and len(block) == 1:
            stray = ~are_plain[0]
            if stray.mean() <= family.alone:
                good = int(are_alone(family, before, float(at[0]), last, found[0], stray))
            if not good and abs(at[0] - before) > family.least_step * abs(values[-1] - values[0]):
                ahead.append(((before + float(at[0])) / 2, 0))
                halvings += 1
                if halvings > family.most_halvings:
                    raise ConvergenceError(
                        f"branches are not separable beyond {before:.10g}", past[-1], stray
                    )
            elif not good:
                good = 1
                near = assign_roots(family, float(at[0]), guess[0])
                # no root jumps by half its size
                is_jump = (abs(near - last) > 0.5 * abs(last)) & (last != 0)
                found = np.where(is_jump, np.nan, near)[None]
        if good == len(block):
            many = min(2 * many, most)
        else:
            many = max(1, good)
        del ahead[len(ahead) - good :]
        for (value, n), row in zip(block[:good], found[:good], strict=True):
            if n:
                rows[n] = row
            going = np.where(is_over(family, value, row), np.nan, row)
            past = [*past, (value, going)][-PAST:]
    return rows


def are_alone(
    family: Family, before: float, value: float, last: Complex, found: Complex, stray: NDArray[np.bool_]
) -> bool:
    """Whether stray roots and their partners, followed alone from `before` to a value into `found`, differ from others.

    Raises ConvergenceError as `follow` where one of them is lost.
    """
    partner = couples(last)
    stray = stray | (last[:, None] == last[stray].conj()).any(axis=1)
    stray[partner[stray & (partner >= 0)]] = True
    try:
        found[stray] = follow(family, np.array([before, value]), last[stray])[1]
    except ConvergenceError as lost:
        raise ConvergenceError(str(lost), (before, last), stray) from None
    return not (nearest(found)[1] <= 1e-9 * abs(found)).any()


def interpolate_roots(family: Family, values: Real, rows: Complex, wanted: Real) -> Complex:
    """Return the roots (m, b) at wanted values (m,) between the known ones (n,), ascending.

    By interpolation, or where that is uncertain by following them from the known value below.
    """
    # as in `follow`
    values = values.copy()
    rows = rows.copy()
    found = np.empty((wanted.size, rows.shape[1]), complex)
    right = np.clip(np.searchsorted(values, wanted), 1, values.size - 1)
    for n in np.unique(right):
        low = int(np.clip(n - PAST // 2, 0, max(0, values.size - PAST)))
        here = np.flatnonzero(right == n)
        near = slice(low, low + PAST)
        guess = predict_roots(values[near], rows[near], wanted[here], rows[n - 1])
        found[here] = correct_roots(family, wanted[here], guess, rows[n - 1])
        singular = family.singular(wanted[here])
        are_plain = which_plain(guess, found[here], rows[n - 1], singular, family.blur)
        for each in here[~are_plain.all(axis=1)]:
            found[each] = follow(family, np.array([values[n - 1], wanted[each]]), rows[n - 1])[1]
    return found


def is_over(family: Family, value: float, row: Complex) -> NDArray[np.bool_]:
    """Return which of the roots (b,) are at a singular point, right of it by less than 5 % of its size."""
    points = family.singular(np.array([value]))[0]
    share = (row.real[:, None] - points) / abs(points)
    is_near: NDArray[np.bool_] = (share > 0) & (share < 0.05)
    return (row.imag == 0) & is_near.any(axis=1)


def assign_roots(family: Family, value: float, guess: Complex) -> Complex:
    """Return the complete set at a value in the order of the guesses (b,); NaN where there are fewer."""
    # half a second to import, and rarely needed
    from scipy.optimize import linear_sum_assignment

    every = family.complete(value, guess)
    alive = np.flatnonzero(~np.isnan(guess))
    rows, columns = linear_sum_assignment(abs(guess[alive, None] - every))
    found = np.full(guess.shape, np.nan, complex)
    found[alive[rows]] = every[columns]
    return found


@compiled
def nearest(row: Any) -> Any:
    """Return the index of the nearest other root of each of the roots (b,), and its distance, inf for none."""
    index = np.zeros(row.size, np.int64)
    away = np.full(row.size, np.inf)
    for i in range(row.size):
        for j in range(row.size):
            distance = abs(row[i] - row[j])
            if j != i and distance < away[i]:
                index[i] = j
                away[i] = distance
    return index, away


@compiled
def couples(row: Any) -> Any:
    """Return the partner of each root (b,) or -1: two nearest to each other, conjugates or of one half-plane."""
    index, away = nearest(row)
    partner = np.full(row.size, -1)
    for i in range(row.size):
        j = index[i]
        alike = row[i] == row[j].conjugate() or np.sign(row[i].imag) == np.sign(row[j].imag)
        if np.isfinite(away[i]) and index[j] == i and alike:
            partner[i] = j
    return partner


@compiled
def predict_roots(at: Any, rows: Any, wanted: Any, base: Any) -> Any:
    """Return guesses (m, b) by polynomials through known roots (k, b) at k values; `base` (b,) has the couples.

    Roots from before two of them met are left out.
    """
    partner = couples(base)
    guess = np.full((wanted.size, base.size), LOST)
    for m in range(wanted.size):
        for low in range(at.size):
            weights = np.ones(at.size)
            for k in range(low, at.size):
                for n in range(low, at.size):
                    if n != k:
                        weights[k] *= (wanted[m] - at[n]) / (at[k] - at[n])
            for i in range(base.size):
                j = partner[i]
                if j >= i and np.isnan(guess[m, i]):
                    guess[m, i], guess[m, j] = _of_couple(
                        weights[low:], rows[low:, i], rows[low:, j], base[i], base[j]
                    )
                elif j < 0 and np.isnan(guess[m, i]):
                    guess[m, i] = _of_one(weights[low:], rows[low:, i], rows[low:, i], base[i])
    return guess


@inlined
def _of_one(weights: Any, first: Any, second: Any, base: Any) -> Any:
    """Return the value of the polynomial through means of two roots' past values (k,), NaN where some are on the axis.

    For one root both are the same.
    """
    total = 0j
    for k in range(weights.size):
        past = (first[k] + second[k]) * 0.5
        if (past.imag == 0.0) == (base.imag == 0.0):
            total += weights[k] * past
        else:
            total += LOST
    return total


@inlined
def _of_couple(weights: Any, first: Any, second: Any, base: Any, other: Any) -> Any:
    """Return both of a couple by polynomials of their mean and of the square of half their distance."""
    square = 0j
    apart = (base - other) / 2.0
    for k in range(weights.size):
        half = (first[k] - second[k]) / 2.0
        square += weights[k] * (half * half)
    root = np.sqrt(square)
    way = (root * apart.conjugate()).real
    # they have met: the first is the upper one, or the larger real one
    if abs(way) < 0.5 * abs(root) * abs(apart):
        way = (root.real + root.imag) * (apart.real + apart.imag)
    middle = _of_one(weights, first, second, (base + other) / 2.0)
    if way < 0.0:
        return (middle - root, middle + root)
    return (middle + root, middle - root)


def correct_roots(family: Family, values: Real, guess: Complex, base: Complex) -> Complex:
    """Return the roots (m, b) next to the guesses, those below the real axis as mirror images."""
    own = np.arange(base.size)
    partner = couples(np.where(base.imag == 0, base, np.nan))
    partner = np.where(partner < 0, own, partner)
    are_mirrors = base[:, None] == base.conj()
    lower, upper = np.nonzero(are_mirrors & (base.imag < 0)[:, None])
    partner[lower] = upper
    is_lower = (guess.imag < 0) & (partner != own)
    found = family.near(values, np.where(is_lower, np.nan, guess))
    return np.where(is_lower, found[:, partner].conj(), found)


@compiled
def which_plain(guess: Any, found: Any, base: Any, singular: Any, blur: float) -> Any:
    """Return which roots (m, b) are close to their prediction, compared with the distance to any other.

    Others include `singular` points (m, p) and the mirror image of a root without one in the base (b,).
    """
    # of the distance to the next root: largest distance from the prediction
    plain_move = 0.1
    is_plain = np.isnan(guess)
    for m in range(len(found)):
        index, away = nearest(found[m])
        for i in range(base.size):
            here = found[m, i]
            is_couple = index[index[i]] == i
            others = np.append(np.abs(np.append(found[m], singular[m]) - here), np.inf)
            others[i] = np.inf
            # of a couple the roots meet or separate
            if is_couple:
                others[index[i]] = np.inf
            room = np.nanmin(others)
            moved = abs(here - guess[m, i])
            if base[i].imag != 0.0 and np.all(base != base[i].conjugate()):
                room = min(room, 2.0 * min(abs(here.imag), abs(base[i].imag)))
            same_side = np.sign(here.imag) == np.sign(guess[m, i].imag)
            share = 2.0 * plain_move if is_couple else plain_move
            near = same_side and moved <= share * away[i]
            at_zero = guess[m, i] == 0.0 or here == 0.0
            is_plain[m, i] |= moved <= blur or ((near or at_zero) and moved <= plain_move * room)
    return is_plain
