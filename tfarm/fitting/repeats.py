"""Several records of one response: what they say one by one, and a bootstrap over them.

The noise within a record is not all that differs from one sweep to the next: amplitudes, temperatures, the hand that
clamped the link.  What the numbers scatter by from record to record says so, and drawing whole records anew (Efron
1979) gives intervals that know of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tfarm.records import record

from .fit import Fit
from .model import Problem
from .solve import settled

Real = NDArray[np.float64]

LEAST = 3  # records of one response, for a scatter
DRAWS, SEED = 40, 852780
ENDS = (2.5, 97.5)  # per cent of the draws: a 95 % interval
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
        return np.asarray(np.percentile(self.drawn, ENDS, axis=0).T)

    @property
    def times_wider(self) -> Real:
        """(numbers,): the standard deviation of the draws over that which the noise says."""
        return np.asarray(self.drawn.std(axis=0, ddof=1) / self.by_noise)


def repeats(fit: Fit, draws: int = DRAWS, seed: int = SEED) -> Repeats | None:
    """The scatter between the records of the response that there are most of; None where there are fewer than three."""
    own = fit.solution.problem
    names = [each.data.name for each in own.responses]
    if not names or names.count(most := max(names, key=names.count)) < LEAST:
        return None
    records = [n for n, name in enumerate(names) if name == most]
    others = [n for n, name in enumerate(names) if name != most]
    known = [
        n for n, each in enumerate(fit.parameters) if each.identified and each.deviation and not _is_of_one(each.key)
    ]
    keys = tuple(fit.parameters[n].key for n in known)
    rng = np.random.default_rng(seed)

    def numbers(chosen: Sequence[int]) -> Real:
        point = _fitted_to(fit, own, [*chosen, *others])
        return np.array([own.parameters[n].value(float(point[n])) for n in known])

    alone = np.array([numbers([n]) for n in records])
    drawn = np.array([numbers(rng.choice(records, size=len(records)).tolist()) for _ in range(draws)])
    return Repeats(most, keys, alone, drawn, np.array([fit.parameters[n].deviation for n in known]))


def _is_of_one(key: str) -> bool:
    """Whether a number is the sensor's of one record, which the others do not know."""
    return ":" in key


def _fitted_to(fit: Fit, own: Problem, chosen: Sequence[int]) -> Real:
    """The least sum over some of the responses, from the least over all; sensors of the others are held."""
    some = replace(own, responses=tuple(own.responses[n] for n in chosen))
    used = {place for each in some.responses for place in (each.gain, each.delay) if place is not None}
    first = len(own.of_the_arm)
    held = {n: float(fit.solution.point[n]) for n in range(first, len(own.parameters)) if n not in used}
    held |= {n: float(fit.solution.point[n]) for n, each in enumerate(fit.parameters) if not each.identified}
    return settled(some, fit.solution.point, held).point
