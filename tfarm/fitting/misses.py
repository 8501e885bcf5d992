"""Responses that the curve of a fit misses, and the single change of the search that would help most.

With ln(computed/measured) at each line, a curve misses the data where its root mean square is above ln 1.2 and above
three times its median step from one line to the next, and where neighbouring lines miss alike: most of them with a step
below half of what they miss by.  Lines of a deep antiresonance, below the noise, are a factor of ten off and meet the
first two alone; their steps are larger than that, six times out of seven.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arrays import Complex
from tfarm.digits import join_words
from tfarm.fitting.data import rms
from tfarm.fitting.model import SENSOR_DELAY, SENSOR_GAIN, FitResponse, Problem, free_parameters
from tfarm.fitting.solve import EXCLUDED, Solution, best_solution, is_explained
from tfarm.response.frequency import HERTZ
from tfarm.schema import Quantity


class Miss(NamedTuple):
    """A response that the curve misses: by what factor and angle (root mean squares), and in which range."""

    response: Annotated[
        str, Quantity("response missed", help="output/input of a response that the curve misses")
    ]
    factor: Annotated[
        float, Quantity("factor", digits=3, help="exp of the rms of ln abs(computed/measured) there")
    ]
    degrees: Annotated[
        float, Quantity("angle", "deg", 3, "rms of the phase of computed/measured there", "degrees")
    ]
    low: Annotated[float, Quantity("from", "Hz", 4, "first frequency at which the curve misses", "from_hz")]
    high: Annotated[float, Quantity("to", "Hz", 4, "last frequency at which the curve misses", "to_hz")]

    @property
    def in_words(self) -> str:
        """Factor, angle and range, as a sentence has them."""
        by = f"a factor of {self.factor:.3g} and {self.degrees:.3g} deg"
        return f"{self.response} misses the data by {by} between {self.low:.4g} and {self.high:.4g} Hz"


class Remedy(NamedTuple):
    """A single change of the search that was tried on a curve that misses."""

    change: Annotated[str, Quantity("remedy tried", help="change of the search that was tried alone")]
    log_likelihood: Annotated[
        float, Quantity("gain of ln likelihood", digits=4, help="by that change of the search")
    ]
    is_enough: Annotated[
        bool, Quantity("removes the miss", key="removes", help="whether no response is missed then")
    ]
    is_explained: Annotated[
        bool | None,
        Quantity("noise explains the rest", key="explained", help="none where its size is not known"),
    ]

    @property
    def in_words(self) -> str:
        """The change, and whether more than noise is left."""
        rest = "; the arm does not explain the data even then" if self.is_explained is False else ""
        return f"{self.change}{rest}"


def misses_of(found: Solution) -> tuple[Miss, ...]:
    """Return the responses that a solution misses; none where noise of known size explains it."""
    if is_explained(found):
        return ()
    pairs = zip(found.problem.responses, found.problem.compute(found.point), strict=True)
    return tuple(miss for one, H in pairs if (miss := _miss(one, H)) is not None)


def _miss(one: FitResponse, computed: Complex) -> Miss | None:
    """Return how one response is missed, None where it is not."""
    data = one.data
    kept = one.noise.is_finite & (data.values != 0)
    omega = data.omega[kept]
    ratio = computed[kept] / data.values[kept]
    if omega.size < 2:
        return None
    away = np.log(ratio)
    step = np.log(ratio[1:] / ratio[:-1])
    # a difference of less than a fifth is no miss
    limit = max(math.log(1.2), 3 * np.median(abs(step)))
    # pairs of lines that both miss, the second on the branch of the first: a sign alone is +180 or -180 degrees
    both = np.flatnonzero((abs(away[:-1]) > limit) & (abs(away[:-1] + step) > limit))
    alike = both[abs(step[both]) < abs(away[both]) / 2]
    is_chance = 2 * alike.size - both.size <= 2 * math.sqrt(both.size)
    if is_chance or rms(away) <= limit:
        return None
    off = away[abs(away) > limit]
    return Miss(
        response=data.name,
        factor=math.exp(rms(off.real)),
        degrees=math.degrees(rms(off.imag)),
        low=float(omega[alike[0]]) / HERTZ,
        high=float(omega[alike[-1] + 1]) / HERTZ,
    )


def remedies_of(found: Solution) -> tuple[Remedy, ...]:
    """Return the changes that were tried on a solution that misses, the one that helps most first.

    A number more is worth `EXCLUDED` of a sum of squares, so that a sign goes before the gain that has it.
    """
    tried = []
    for change, there in _tries(found):
        misses = misses_of(there)
        rank = bool(misses), there.misfit + EXCLUDED / 2 * there.point.size
        tried.append((rank, Remedy(change, found.misfit - there.misfit, not misses, is_explained(there))))
    return tuple(remedy for _, remedy in sorted(tried, key=lambda each: each[0]))


def search_without_miss(problem: Problem) -> Solution:
    """Return the solution of a changed search, which ends where none is missed and noise may explain the rest."""
    return best_solution(problem, lambda there: is_explained(there) is not False and not misses_of(there))


def _tries(found: Solution) -> Iterator[tuple[str, Solution]]:
    """Yield each change in words with its solution: gains, signs, delays, and numbers at their bounds."""
    problem = found.problem
    for key, unit in ((SENSOR_GAIN, ""), (SENSOR_DELAY, " s")):
        if problem.with_sensors((key,)) == problem:
            continue
        there = search_without_miss(problem.with_sensors((key,)))
        values = [there.problem.value(there.point, getattr(each, key)) for each in there.problem.responses]
        yield f"a free {key} (--free {key}): {join_words([f'{each:.4g}{unit}' for each in values])}", there
        if min(values) < 0 and key == SENSOR_GAIN:
            pairs = list(zip(problem.responses, values, strict=True))
            names = [each.data.name for each, value in pairs if value < 0]
            turned = []
            for each, x in pairs:
                data = replace(each.data, values=np.sign(x) * each.data.values)
                turned.append(replace(each, data=data))
            there = search_without_miss(replace(problem, responses=tuple(turned)))
            yield f"the other sign of {join_words(names)}", there
    yield from _beyond_bounds(found)


def _beyond_bounds(found: Solution) -> Iterator[tuple[str, Solution]]:
    """Yield the solution without the bounds of those of the arm's numbers that were given some or ended at one."""
    problem = found.problem
    low, high = problem.bounds
    # of a coordinate: a search that ends so near to a bound has ended there
    is_at_end = np.minimum(found.point - low, high - found.point) < 0.01
    _, unbound = free_parameters(
        problem.arm(found.point), problem.family.keys, start={}, bounds={}, priors={}
    )
    numbers = [
        replace(free, prior=each.prior) if at_end or (each.low, each.high) != (free.low, free.high) else each
        for each, free, at_end in zip(problem.of_the_arm, unbound, is_at_end, strict=False)
    ]
    if tuple(numbers) != problem.of_the_arm:
        there = search_without_miss(
            replace(problem, parameters=(*numbers, *problem.parameters[len(numbers) :]))
        )
        rows = zip(numbers, problem.of_the_arm, there.point.tolist(), strict=False)
        values = [f"{each.key} = {each.value(x):.6g}" for each, before, x in rows if each != before]
        yield f"no bound of {join_words(values)}", there
