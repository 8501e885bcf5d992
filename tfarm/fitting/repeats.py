"""Several records of one response: what they say one by one, and a bootstrap over them.

The noise within a record is not all that differs from one sweep to the next: amplitudes, temperatures, the hand that
clamped the link.  What the numbers scatter by from record to record says so, and drawing whole records anew (Efron
1979) gives intervals that know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tfarm.arrays import Real
from tfarm.records import record

from .fit import Fit
from .solve import nearest_minimum
from .start import FIT_SEED

FEWEST_RECORDS = 3  # records of one response, for a scatter
DRAWS = 40  # of records
INTERVAL_PERCENTS = (2.5, 97.5)  # per cent of the draws: a 95 % interval
WIDER = 1.5  # times what the noise says: a scatter beyond is told


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
