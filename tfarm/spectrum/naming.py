"""The modes of eigenvalues: each undamped eigenvalue is followed as all damping grows from zero to its value.

The eigenvalues themselves are found by a search (`damped`).  Where a step is uncertain, a branch may be lost or change
to a neighbour.  A damped Timoshenko beam has a third, real zero for each bending wave, from s = -inf at C = 0.  It
meets the fast zero of the overdamped mode, and the two oscillate again, in shear.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import DIFFERENCE_STEP, has_slope, quick_characteristics
from tfarm.exact.compiled import compiled
from tfarm.exact.layout import OF_ELEMENT, ROW, OutputFormula, readings
from tfarm.exact.sweep import AXIS, fill_free
from tfarm.exact.system import Segment, System
from tfarm.records import read_only
from tfarm.spectrum.box import REAL_SHARE, Function, newton
from tfarm.spectrum.following import LOST, NEWTON_STEPS, SETTLED, follow, polish_roots
from tfarm.spectrum.table import Modes, modes

# the table of a layout
NO_OUTPUT = np.empty((0, len(OutputFormula._fields)))


def function_of(k: System) -> Function:
    """Return the characteristic function without its zeros at the origin."""
    at_rest = k.at_rest
    return lambda s: quick_characteristics(k, s, at_rest)


@compiled
def _newton(s: Any, rows: Any, ends: Any, at_rest: int, singular: Any) -> None:
    """Replace guesses s (n,) by the zeros of D/s^at_rest next to them, or NaN, as `following.polish_roots` does."""
    moving = np.flatnonzero(~np.isnan(s))
    for _ in range(NEWTON_STEPS):
        here = s[moving]
        many = moving.size
        if many == 0:
            break
        near = np.ones(many)
        left = np.empty(many)
        for each in singular:
            near = np.minimum(near, np.abs(1.0 - here / each))
        h = DIFFERENCE_STEP * np.maximum(np.abs(here) * near, 1e-300)
        at = np.concatenate((here, here + h, here - h))
        found = np.empty((2, at.size), np.complex128)
        lost = np.empty(at.size, np.bool_)
        fill_free(at, rows, ends, AXIS, NO_OUTPUT, found, lost, False)
        for i in range(many):
            up = i + many
            down = i + 2 * many
            move = LOST
            # complex division by zero is an error in compiled code
            if here[i] != 0.0:
                value = found[0, i] / at[i] ** at_rest
                above = found[0, up] * np.exp(found[1, up] - found[1, i]) / at[up] ** at_rest
                below = found[0, down] * np.exp(found[1, down] - found[1, i]) / at[down] ** at_rest
                if above != below:
                    move = 2.0 * h[i] * value / (above - below)
            if here[i].imag == 0.0:
                s[moving[i]] -= move.real
            else:
                s[moving[i]] -= move
            left[i] = abs(move) - SETTLED * abs(s[moving[i]])
        moving = moving[left > 0.0]
    s[moving] = LOST


@dataclass
class Damping:
    """The eigenvalues of a system with a share of all its damping, s times that share of `level` [s].

    In these units one next to -1/C hardly changes with the share, and all are 0 at a share of 0.
    """

    k: System
    level: float
    most_halvings: int
    steps_left: float

    least_step = 1e-7
    blur = 0.0
    alone = 0.15

    def __post_init__(self) -> None:
        """Lay the system out without its damping, and the difference that the whole of it makes."""
        still, layout = (readings(k) for k in (self.k.with_damping(0.0), self.k))
        rows, whole = (each.rows.view((float, len(OF_ELEMENT.split()) + 4)) for each in (still, layout))
        self.rows = rows, whole - rows
        self.ends = still.ends, layout.ends - still.ends
        self.at_rest = self.k.at_rest
        self.points = np.array(self.k.singular)

    def near(self, values: Real, guess: Complex) -> Complex:
        """Return the roots next to the guesses (see `Family`)."""
        self.steps_left -= 1
        if self.steps_left < 0:
            # after the steps that there are in all roots that are stray are soon lost
            self.most_halvings = min(self.most_halvings, 8)
        units = (values * self.level)[:, None]
        found = guess / units
        rows, of_rows = self.rows
        ends, of_ends = self.ends
        # as those of a layout are
        rows = read_only((rows + values[:, None, None] * of_rows).view(ROW)[..., 0])
        ends = read_only(ends + values[:, None] * of_ends)
        for n, here in enumerate(found):
            _newton(here, rows[n], ends[n], self.at_rest, self.points / values[n])
        return found * units

    def complete(self, value: float, guess: Complex) -> Complex:
        """Return the roots next to the guesses, with mirror images for guesses below the real axis."""
        # starts next to a guess, of it
        shares = np.array([1, 1.02, 0.98, 1 + 0.02j, 1 - 0.02j, 1.2, 0.8, 1 + 0.2j, 1 - 0.2j])
        unit = value * self.level
        wanted = guess[~np.isnan(guess)]
        starts = np.outer(wanted[wanted.imag >= 0] / unit, shares).ravel()
        with np.errstate(all="ignore"):
            found = newton(function_of(self.k.with_damping(value)), starts) * unit
        # the imaginary part of a double zero is rounding
        found = np.where(abs(found.imag) < 1e-7 * abs(found), found.real, found)
        upper = found[found.imag > 0]
        lower = wanted[wanted.imag < 0].conj()
        away = abs(upper[:, None] - lower).min(axis=1, initial=np.inf)
        mirrors = upper[away < abs(shares[-1] - 1) * abs(upper)].conj()
        return np.r_[found[found.imag >= 0], mirrors]

    def singular(self, values: Real) -> Real:
        """Return -1/C of the damped segments in these units."""
        return np.ones((values.size, 1)) * self.points * self.level


def single_zeros(undamped: Modes, share: float = 1.0) -> list[float]:
    """Return the real eigenvalues [1/s] of no flexible mode, with a share of the damping: -b/J, and -R/L_a."""
    k = undamped.system
    found = []
    if k.at_rest == 1:
        friction = float((k.drive.friction + k.drive.back_emf) * k.EI / k.length)
        found.append(-share * friction / undamped.arm.total_inertia)
    if k.drive.lag:
        found.append(-1.0 / float(k.drive.lag))
    return found


def name_eigenvalues(undamped: Modes, count: int, steps: float) -> tuple[Complex, Complex]:
    """Return the eigenvalues of `single_zeros` (m,) and of the first `count` flexible modes (count, 2), NaN if lost.

    A mode has a conjugate pair, Im > 0 first, or two real ones, the slower first.  After `steps` steps those that are
    not plain are lost.
    """
    k = undamped.system
    omega = modes(undamped.arm, count, theory=undamped.theory).flexible
    alone = single_zeros(undamped)
    if k.is_undamped:
        return np.array(alone, complex), 1j * np.outer(omega, [1, -1])
    # of steps, after which stray branches are lost and the others followed
    halvings = (250, *[80] * 8)
    family = Damping(k, k.damping or 1.0, halvings[0], steps)
    joints = tuple(each for each in k.elements if not isinstance(each, Segment))
    is_damped = not replace(k, elements=joints).is_undamped
    sizes = [omega[-1] * k.damping, *(abs(each) / omega[0] for each in alone), float(is_damped)]
    # so small that an eigenvalue is close to its undamped value
    share = min(1.0, 1e-3 / max(sizes))
    guess = share * family.level * np.r_[single_zeros(undamped, share), 1j * omega]
    single, upper = np.split(family.near(np.array([share]), guess[None])[0], [len(alone)])
    start = np.r_[single, np.stack([upper, upper.conj()], axis=1).ravel()]
    # three decades at a time, which scale the shortest step
    ends = np.geomspace(share, 1.0, 1 + math.ceil(-math.log10(share) / 3))[1:].tolist()
    for family.most_halvings in halvings:
        try:
            while ends:
                start = follow(family, np.array([share, ends[0]]), start)[1]
                share = ends.pop(0)
            break
        except ConvergenceError as lost:
            share, start = lost.best
            start = np.where(lost.residual, LOST, start)
    if ends:
        found = np.full(start.size, LOST)
    else:
        found = polish_roots(function_of(k), start / family.level)
    # of lost ones
    with np.errstate(invalid="ignore"):
        # so far out that Newton's method converges anywhere
        found[~has_slope(k, found)] = LOST
    is_same = abs(found[:, None] - found) <= REAL_SHARE * abs(found)
    found[np.triu(is_same, 1).any(axis=0)] = LOST
    return in_pairs(found[: len(alone)], found[len(alone) :].reshape(-1, 2))


def in_pairs(single: Complex, pairs: Complex) -> tuple[Complex, Complex]:
    """Return whole pairs: where real zeros of two modes, or of a mode and none, have met, they oscillate as one.

    Of two modes the higher one has the pair, and the lower one the other two zeros; a single zero is left to none.
    """
    single = single.copy()
    pairs = pairs.copy()
    # twice, as one of two may have half of another pair
    for n in (*range(len(pairs)), *range(len(pairs))):
        rings = np.flatnonzero(np.isfinite(pairs[n]) & (pairs[n].imag != 0))
        if rings.size == 1:
            one = pairs[n, rings[0]]
            rest = pairs[n, 1 - rings[0]]
            mirror = one.conj()
            alone, other = (abs(each - mirror) <= REAL_SHARE * abs(one) for each in (single, pairs))
            pairs[n] = one, mirror
            if other.any():
                m, place = np.argwhere(other)[0]
                pairs[m] = rest, pairs[m, 1 - place]
                order = sorted((n, m))
                pairs[order] = pairs[[m, n]]
            elif alone.any():
                single[alone] = rest
    first, second = pairs.T
    is_slower = ~(abs(first) > abs(second)) & ~np.isnan(first)
    is_upper = pairs.imag > 0
    is_first = np.where(is_upper.any(axis=1), is_upper[:, 0], is_slower)
    return single, np.where(is_first[:, None], pairs, pairs[:, ::-1])
