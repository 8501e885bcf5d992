"""The arms that the data leave possible: drawn about the best one, and what a loop is on each of them.

Drawn from the normal distribution that the residuals have about their least sum, kept where the true sum of squares
agrees with it; along what the data do not determine, within a factor of e of the start: no knowledge of theirs.

Several records of one response: what they say one by one, and a bootstrap over them.

The noise within a record is not all that differs from one sweep to the next: amplitudes, temperatures, the hand that
clamped the link.  What the numbers scatter by from record to record says so, and drawing whole records anew (Efron
1979) gives intervals that know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import gammaincinv

from tfarm.arm import MOMENT_GAIN, Arm, HubFeedback
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.errors import ConvergenceError
from tfarm.loop.margins import margins
from tfarm.loop.plane import gain_map
from tfarm.records import record
from tfarm.response import transfer

from .fit import Fit
from .solve import OPEN_DEVIATION, nearest_minimum, principal_axes
from .start import FIT_SEED

ARMS = 40  # that a report draws
DRAWS_KEPT = 0.999  # of the draws of a normal distribution: one whose sum of squares is larger is none of them
DRAWS_EACH = 10  # times so many are drawn before it is given up
FEWEST_RECORDS = 3  # records of one response, for a scatter
DRAWS = 40  # of records
INTERVAL_PERCENTS = (2.5, 97.5)  # per cent of the draws: a 95 % interval
WIDER = 1.5  # times what the noise says: a scatter beyond is told


@dataclass(frozen=True)
@record
class Possible:
    """`arms` that the data leave possible, the best one not among them, and the points (arms, numbers) they are at."""

    fit: Fit
    arms: tuple[Arm, ...]
    points: Real


def possible(fit: Fit, count: int) -> Possible:
    """So many arms that explain the data as well as the best one does, but for what noise is worth.

    Raises ConvergenceError where the sum of squares is so far from a parabola that draws of one are none of it.
    """
    found, rng = fit.solution, np.random.default_rng(FIT_SEED)
    sizes, axes = principal_axes(found.jacobian)
    spread = np.minimum(1.0 / np.maximum(sizes, LEAST_SIZE), OPEN_DEVIATION)
    apart = 2.0 * float(gammaincinv(found.point.size / 2, DRAWS_KEPT))  # the quantile of chi squared
    most = found.chi_squared + apart + 2 * int((sizes < 1 / OPEN_DEVIATION).sum())
    kept: list[Real] = []
    for _ in range(DRAWS_EACH * count):
        point = found.point + axes.T @ (spread * rng.standard_normal(spread.size))
        point = found.problem.inside(point)
        residuals = found.problem.residuals(point)
        if float(residuals @ residuals) <= most:
            kept.append(point)
        if len(kept) == count:
            return Possible(fit, tuple(found.problem.arm(each) for each in kept), np.array(kept))
    drawn = DRAWS_EACH * count
    message = f"only {len(kept)} of {drawn} arms drawn explain the data: their likelihood is far from normal"
    raise ConvergenceError(message, kept, len(kept))


@dataclass(frozen=True, kw_only=True)
@record
class LoopOnAll:
    """A law on each possible arm: how many it holds, and the margins of those (stable arms,) in SI and degrees."""

    law: HubFeedback
    stable: int
    of: int
    gain_up: Real
    phase: Real
    delay: Real
    disk: Real


def loop_on_all(those: Possible, law: HubFeedback) -> LoopOnAll:
    """The verdict on each arm, and its margins where it holds: None of an arm where a margin is not."""
    found = [margins(arm, law) for arm in those.arms]
    bands = [each.in_band for each in found if each.in_band is not None]

    def column(name: str) -> Real:
        return np.array([float(value) for each in bands if (value := getattr(each, name, None)) is not None])

    ups = [each.windows[MOMENT_GAIN].around for each in found if each.in_band is not None]
    return LoopOnAll(
        law=law,
        stable=len(bands),
        of=len(found),
        gain_up=np.array([pair[1] for pair in ups if pair is not None]),
        phase=column("phase"),
        delay=column("delay"),
        disk=column("disk"),
    )


def share_stable(those: Possible, across: Real, up: Real) -> Real:
    """The share of the arms on which both gains hold (up, across), without a clock."""
    return np.asarray(np.mean([gain_map(arm, across, up).unstable == 0 for arm in those.arms], axis=0))


def response_band(those: Possible, output: str, omega: Real) -> tuple[Real, Real, Real]:
    """The lowest and highest magnitude of the possible arms, and the best one's, at frequencies [rad/s]."""
    sizes = [abs(transfer(arm, output)(1j * omega)) for arm in those.arms]
    return np.min(sizes, axis=0), np.max(sizes, axis=0), np.asarray(abs(transfer(those.fit.arm, output)(1j * omega)))


def extremes(values: Any) -> tuple[float, float] | None:
    """Lowest and highest; None of nothing."""
    return (float(np.min(values)), float(np.max(values))) if len(values) else None


@dataclass(frozen=True)
@record
class Repeats:
    """The fitted numbers by each record of `response` alone, `each` (records, numbers), and by draws of records.

    `drawn` (draws, numbers); both in SI units, in the order of `keys`: those that all records together determine.
    """

    response: str
    keys: tuple[str, ...]
    each: Real
    drawn: Real
    by_noise: Real

    @property
    def intervals(self) -> Real:
        """(numbers, 2): what 95 % of the draws of records lie in."""
        return np.asarray(np.percentile(self.drawn, INTERVAL_PERCENTS, axis=0).T)

    @property
    def times_wider(self) -> Real:
        """(numbers,): the standard deviation of the draws over that which the noise says."""
        return np.asarray(self.drawn.std(axis=0, ddof=1) / self.by_noise)


def repeats(fit: Fit, draws: int = DRAWS) -> Repeats | None:
    """The scatter between the records of the response that there are most of; None where there are fewer than three.

    Each least sum over some of the responses begins at that over all; sensors of the others are held, and so is what
    all together do not determine.
    """
    own = fit.solution.problem
    names = [each.data.name for each in own.responses]
    if not names or names.count(most := max(names, key=names.count)) < FEWEST_RECORDS:
        return None
    records = [n for n, name in enumerate(names) if name == most]
    others = [n for n, name in enumerate(names) if name != most]
    every = list(enumerate(fit.parameters))  # a key with a colon is of one record's sensor, which others do not know
    known = [n for n, each in every if each.identified and each.deviation and ":" not in each.key]
    keys = tuple(fit.parameters[n].key for n in known)
    rng, start = np.random.default_rng(FIT_SEED), fit.solution.point

    def numbers(chosen: Sequence[int]) -> Real:
        some = replace(own, responses=tuple(own.responses[n] for n in (*chosen, *others)))
        used = {place for each in some.responses for place in (each.gain, each.delay) if place is not None}
        sensors = range(len(own.of_the_arm), len(own.parameters))
        held = [*(n for n in sensors if n not in used), *(n for n, each in every if not each.identified)]
        point = nearest_minimum(some, start, {n: float(start[n]) for n in held}).point
        return np.array([own.parameters[n].value(float(point[n])) for n in known])

    alone = np.array([numbers([n]) for n in records])
    drawn = np.array([numbers(rng.choice(records, size=len(records)).tolist()) for _ in range(draws)])
    return Repeats(most, keys, alone, drawn, np.array([fit.parameters[n].deviation for n in known]))
