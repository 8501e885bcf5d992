"""A fit's search: numerator and denominator of a response agree with the data, then their ratio.

The squares of H - D, of a response H = N/P and its measured values D, have a minimum for every pole of H that lies
between two other lines than the true one.  The equation error of Levy (1959)

    e = (N - D P)/W,    W = |N(s + share w)| + (|D| + sigma) |P(s + share w)|    at s = i w

has no poles: N and P are entire in s and smooth in the arm's numbers, and so is W, their size right of the axis, where
neither has zeros.  So its squares have few minima, and a pole comes to where N and P have it, between lines too.  It is
biased by noise (Sanathanan and Koerner 1963), and only where a search begins.  With a larger `share` W is smoother.
Its numbers are tuned on the survey `tests.fitting.planted`.

The end of a fit is least squares of complex residuals over their deviations, from one start after another.  A robust
loss is no likelihood and the logarithm of a noisy value is biased at an antiresonance, so every result and every
interval rests on Gaussian residuals alone.
"""

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Annotated, Any

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtrc, ndtri, stdtrit

from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.fitting.data import CONFIDENCE, in_parts
from tfarm.fitting.model import Problem, penalize
from tfarm.fitting.run_model import FitRun
from tfarm.fitting.run_numbers import with_disturbance
from tfarm.fitting.whiteness import chance_of_independent, chance_of_white, least_of
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.table import first_frequency

# of all that a fit draws: the number of the paper's article, any would do
FIT_SEED = 852780


def start_by(problem: Problem, draws: int, shares: Sequence[float]) -> tuple[Problem, Real]:
    """Return the problem, its sensors' gains by the sign that they have, and the least equation errors near its start.

    Of a number of draws about these, as wide as they are uncertain, that of the least squares: the true side of a line.
    """
    point = problem.start
    for share in shares:
        whole, first = with_gains(problem, point)
        thin = thin_problem(whole)
        found = least_equation_errors(thin, first, share)
        point = found.x
    _, sizes, axes = np.linalg.svd(found.jac, full_matrices=False)
    deviation = math.sqrt(2 * found.cost / found.fun.size) / sizes
    drawn = np.random.default_rng(FIT_SEED).standard_normal((draws, point.size)) * 2.0 * deviation
    tried = (point, *map(thin.inside, point + drawn @ axes))
    return whole, min(tried, key=partial(sum_of_squares, thin))


def least_equation_errors(problem: Problem, first: Real, share: float) -> Any:
    """Return the search for the least equation errors next to a point; those beyond 0.1 count less and less."""

    def errors(x: Real) -> Real:
        # of ln p, over that of an equation error: what the data do not know stays where it is
        return np.concatenate([equation_errors(problem, x, share), (x - first) / 50.0])

    return least_squares(
        penalize(errors, first),
        first,
        bounds=problem.bounds,
        loss="soft_l1",
        f_scale=0.1,
        max_nfev=40,
        xtol=1e-4,
        ftol=1e-4,
    )


def sum_of_squares(problem: Problem, point: Real) -> float:
    """Return the sum of squares of the complex residuals over their deviations; inf where there is no arm."""
    try:
        residuals = problem.residuals(point)
    except ParameterError:
        return math.inf
    return float(residuals @ residuals)


def equation_errors(problem: Problem, point: Real, share: float) -> Real:
    """Return both parts of e at each frequency, and ln of each decay's frequency over the measured one."""
    errors = []
    pairs = zip(problem.fractions(point), problem.fractions(point, share), problem.responses, strict=True)
    for (N, P, here), (smooth_N, smooth_P, there), each in pairs:
        D = each.data.values
        W = (abs(smooth_N) + (abs(D) + each.noise.sigma) * abs(smooth_P)) * np.exp(there - here)
        errors.append(in_parts((N - D * P) / W))
    frequencies = [each._replace(frequency_deviation=each.frequency, ratio=None) for each in problem.rings]
    return np.concatenate([*errors, problem.decays(point, frequencies)])


def with_gains(problem: Problem, point: Real) -> tuple[Problem, Real]:
    """Return the problem with the sign of each sensor's gain as the data have it, and the point with its size."""
    parameters = list(problem.parameters)
    point = point.copy()
    for H, each in zip(problem.compute(point), problem.responses, strict=True):
        omega = each.data.omega
        ratio = each.data.values / H
        if each.delay is not None:
            delay = aligning_delay(omega, ratio)
            point[each.delay] += delay / parameters[each.delay].size
            ratio = ratio * np.exp(1j * delay * omega)
        if each.gain is not None:
            own = parameters[each.gain]
            if np.median(ratio.real / abs(ratio)) < 0:
                parameters[each.gain] = replace(own, start=-own.start)
            point[each.gain] += np.median(np.log(abs(ratio)))
    return replace(problem, parameters=tuple(parameters)), point


def aligning_delay(omega: Real, ratio: Complex) -> float:
    """Return the delay [s] within a period of the first line that aligns the phases of ratios, 0 where 0 is as good.

    Phases wrap between far lines, so that no search comes there from 0.  It maximises abs(sum e^{i (phase + w tau)}).
    """
    period = 2 * math.pi / omega[0]
    # sixteen a period of the last line, up to 400 times the first
    count = math.ceil(16 * min(omega[-1] / omega[0], 400))
    delays = np.linspace(-period, period, 2 * count + 1)
    phases = np.sign(ratio)
    aligned = abs(np.exp(1j * np.outer(delays, omega)) @ phases)
    if aligned.max() > 1.5 * aligned[count]:
        return float(delays[aligned.argmax()])
    return 0.0


def thin_problem(problem: Problem, most: int = 400) -> Problem:
    """Return the problem at a number of each response's frequencies at most."""
    responses = []
    for each in problem.responses:
        data = each.data
        kept = np.unique(np.linspace(0, data.points - 1, min(data.points, most)).astype(int))
        kept = kept[each.noise.is_finite[kept] & (data.values[kept] != 0)]
        responses.append(each.at(data.omega[kept], data.values[kept], each.noise.sigma[kept]))
    return replace(problem, responses=tuple(responses))


# of ln p: a combination with a larger deviation (a factor of e) is not determined by the data
OPEN_DEVIATION = 1.0
# of white residuals in a right model: a lesser one rejects it
LEAST_CHANCE = 0.01
# of a sum of squares: a smaller difference is none
SAME_SUM = 0.1
# of a sum of squares: noise alone makes up an effect of four deviations once in 15,000 fits
EXCLUDED = 16.0


@frozen
class Solution:
    """The best point found, with residuals, their Jacobian, and whether the search ended there in good order."""

    problem: Problem
    point: Real
    residuals: Real
    jacobian: Real
    converged: Annotated[
        bool, Quantity("converged", help="whether the search for the least sum of squares ended in a minimum")
    ]
    starts: Annotated[int, Quantity(help="number of starting points that were tried")]

    @property
    def chi_squared(
        self,
    ) -> Annotated[
        float,
        Quantity("chi-squared", digits=4, help="sum of squared residuals over their standard deviations"),
    ]:
        """The sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @cached_property
    def parts(self) -> tuple[Real, ...]:
        """The residuals of each response and run, over their deviations."""
        ends = np.cumsum([each.size for each in self.problem.records], dtype=int)
        return tuple(np.split(self.residuals, ends)[:-1])

    @property
    def of_runs(self) -> list[tuple[FitRun, Real]]:
        """The runs, each with its residuals (outputs, n) over their deviations."""
        own = self.parts[len(self.problem.responses) :]
        pairs = zip(self.problem.runs, own, strict=True)
        return [(each, residuals.reshape(len(each.sigma), -1)) for each, residuals in pairs]

    @property
    def freedom(
        self,
    ) -> Annotated[
        int,
        Quantity(
            "degrees of freedom",
            help="residuals less free numbers; chi-squared is about as large where arm and noise explain the data",
        ),
    ]:
        """Residuals less parameters, and less the numbers of each run of its own."""
        return self.residuals.size - self.point.size - sum(each.own for each in self.problem.runs)

    @property
    def has_known_noise(self) -> bool:
        """Whether the size of no noise was taken from the residuals."""
        return all(each.has_known_noise for each in self.problem.records)

    @cached_property
    def chance_of_white(self) -> float:
        """The probability of residuals of the runs' outputs so far from white noise, of all outputs together."""
        return least_of([chance_of_white(e) for _, residuals in self.of_runs for e in residuals])

    @cached_property
    def chance_of_noise(self) -> float:
        """The probability of residuals of the runs so far from white ones that do not depend on what drove them."""
        found = [
            chance_of_independent(e, each.run.driving_changes)
            for each, residuals in self.of_runs
            for e in residuals
        ]
        return least_of([self.chance_of_white, least_of(found)])

    @property
    def misfit(self) -> float:
        """Minus ln of the likelihood, but for a constant: with the noise, where that is from the residuals."""
        return self.chi_squared / 2 + math.fsum(each.log_deviation for each in self.problem.records)

    @property
    def quantile(self) -> float:
        """Deviations that an interval reaches to each side: of the normal distribution, or Student's."""
        share = 0.5 + CONFIDENCE / 2
        return float(ndtri(share) if self.has_known_noise else stdtrit(max(self.freedom, 1), share))


def best_solution(problem: Problem, is_enough: Callable[[Solution], bool | None] | None = None) -> Solution:
    """Return the least sum of squares over the starts.

    One that `is_enough` (by default of noise alone) ends the search early.

    Where something is left open the valleys are wide, and the equation errors may lead into the wrong one: a pole that
    is there only between two lines.  Then the fit's own start is tried too.
    """
    found: list[Solution] = []
    # draws about the point that the equation errors lead to, and their shares of w one after another
    for draws, shares in ((0, [0.1]), (300, [0.1]), (300, [1.0, 0.3, 0.1])):
        if problem.runs:
            found.append(solution_of_runs(problem, draws))
        else:
            found.append(rescale_noise(nearest_minimum(*start_by(problem, draws, shares))))
        best = min(found, key=lambda each: each.misfit)
        is_done = best.converged and (is_enough or is_explained)(best)
        # a third search on runs that no noise explains takes long
        if is_done or (problem.runs and len(found) == 2):
            break
    # a search on runs has begun there already
    if open_axes(best.jacobian).size and not problem.runs:
        at_start = rescale_noise(nearest_minimum(*with_gains(problem, problem.start)))
        found.append(at_start)
        if at_start.misfit < best.misfit - SAME_SUM:
            best = at_start
    # as many more evaluations from the best of the starts: along a narrow valley
    for _ in range(8):
        if not best.converged:
            best = nearest_minimum(best.problem, best.point)
    return replace(nearest_to_start(best), starts=len(found))


def solution_of_runs(problem: Problem, draws: int) -> Solution:
    """Return a least sum of squares over the starts of records of runs, each cut short first.

    The phase of a mode is off by its frequency's error times the time, so the first periods of a record have few
    minima: a search goes on from them over longer and longer parts.  Frequency responses give a start, too.  Where a
    controller reads what was recorded, the noise that fits better is taken (`run_model`).
    """
    # of ln p, of draws about the start
    spread = 0.15
    # of mode 1 at the start, in the shortest part
    periods = 4
    start = problem.start
    normal = np.random.default_rng(FIT_SEED + draws).standard_normal((10 + draws // 10, start.size))
    points = [start, *map(problem.inside, start + spread * normal)]
    if problem.responses:
        points.append(best_solution(replace(problem, runs=())).point)
    least = periods * 2 * math.pi / first_frequency(problem.arm(start))
    best = rescale_noise(continued_minimum(problem, points, least))
    if any(each.reads_all for each in problem.runs):
        around = tuple(replace(each, through_loop=each.reads_all) for each in best.problem.runs)
        other = rescale_noise(
            continued_minimum(replace(best.problem, runs=around), [*points, best.point], least)
        )
        best = min(best, other, key=lambda each: each.misfit)
    is_disturbed = any(each.run.is_disturbed for each in best.problem.runs)
    if is_disturbed and best.chance_of_white <= LEAST_CHANCE:
        part = replace(problem, runs=tuple(each.until(least) for each in problem.runs))
        other = solution_with_disturbance(best, [start, continued_minimum(part, points, least).point])
        # each ratio has to explain more than noise alone would
        surplus = EXCLUDED / 2 * (other.point.size - best.point.size)
        best = min(best, other, key=lambda each: each.misfit + (surplus if each is other else 0.0))
    return best


def continued_minimum(problem: Problem, points: Sequence[Real], least: float) -> Solution:
    """Return the least sum of squares that searches from points come to, over parts of the runs from `least` [s] on."""
    # of a coordinate: points so near are one
    apart = 0.02
    whole = max(each.run.count * each.run.period for each in problem.runs)
    for duration in (least, math.sqrt(least * whole), whole):
        part = replace(problem, runs=tuple(each.until(duration) for each in problem.runs))
        some: list[Real] = []
        for point in sorted(points, key=partial(sum_of_squares, part)):
            if all(abs(point - each).max() > apart for each in some):
                some.append(point)
        kept = some[: 3 if duration == least else 2]
        found = [nearest_minimum(part, each, evaluations=20, change=1e-3) for each in kept]
        points = [each.point for each in distinct(found)]
    # noise of unknown size is weighed again, so that the search goes on
    change = 1e-9 if found[0].has_known_noise else 1e-6
    ends = [nearest_minimum(problem, each, change=change) for each in points]
    return min(ends, key=lambda each: each.chi_squared)


def solution_with_disturbance(found: Solution, starts: Sequence[Real]) -> Solution:
    """Return the least prediction errors over starts, with a torque on the input of unknown size.

    The predictor follows the record, so that its errors have few minima where output errors have many.
    """
    problem = with_disturbance(found.problem)
    more = len(problem.parameters) - found.point.size
    # of the first ratio of deviations: a search finds the rest
    ratios = np.log([0.01, 0.1, 1.0, 10.0])
    points = [np.r_[each, np.full(more, ratio)] for each in (found.point, *starts) for ratio in ratios]
    first = sorted(points, key=partial(sum_of_squares, problem))[:2]
    # an arm that grows without bound has no stationary predictor
    first = [each for each in first if math.isfinite(sum_of_squares(problem, each))]
    if not first:
        return found
    ends = [nearest_minimum(problem, each, change=1e-6) for each in first]
    return rescale_noise(min(ends, key=lambda each: each.chi_squared))


def distinct(found: Sequence[Solution]) -> list[Solution]:
    """Return solutions, the least sum of squares first, without those that the data cannot tell from a lesser one."""
    kept: list[Solution] = []
    for one in sorted(found, key=lambda each: each.chi_squared):
        # of a sum of squares with a unit of reduced chi-squared: what the linearised residuals differ by
        unit = one.chi_squared / max(one.freedom, 1)
        apart = [one.jacobian @ (one.point - each.point) for each in kept]
        if all(step @ step > unit for step in apart):
            kept.append(one)
    return kept


def nearest_to_start(found: Solution) -> Solution:
    """Return the solution with all directions open that the data allow to be so, at the point nearest to the start.

    A valley may be open where the search began and closed where it ended, where noise exceeds an effect too small to be
    measured (the rotary inertia of E I).  The point moves only where the sum of squares stays what it is.
    """
    least = found.chi_squared
    problem = found.problem
    count = 0
    for limit, most in ((OPEN_DEVIATION, SAME_SUM), (0.1, EXCLUDED)):
        some = open_axes(found.jacobian, limit)
        # a wider limit with no more axes leads to the same point
        if len(some) > count:
            count = len(some)
            start = found.point - some.T @ (some @ found.point)
            held = {n: float(start[n]) for n in abs(some).argmax(axis=1).tolist()}
            back = nearest_minimum(problem, start, held)
            # a logarithm may have ended where it changes nothing
            again = nearest_minimum(problem, back.point)
        if not count:
            continue
        if again.converged and again.chi_squared < least - SAME_SUM:
            return nearest_to_start(again)
        back = replace(back, jacobian=problem.jacobian(back.point), converged=found.converged)
        fewest = max(1, len(open_axes(found.jacobian)))
        if back.chi_squared < least + most and len(open_axes(back.jacobian)) >= fewest:
            if back.chi_squared < least + SAME_SUM:
                return back
            return replace(found, jacobian=back.jacobian)
    return found


def principal_axes(jacobian: Real) -> tuple[Real, Real]:
    """Return the change of the residuals by a unit step along each axis (parameters,), and the axes (rows)."""
    padded = np.vstack([jacobian, np.zeros((jacobian.shape[1],) * 2)])
    return np.linalg.svd(padded, full_matrices=False)[1:]


def open_axes(jacobian: Real, deviation: float = OPEN_DEVIATION) -> Real:
    """Return the axes (rows) along which the data leave more than that deviation of ln p."""
    sizes, axes = principal_axes(jacobian)
    return axes[sizes < 1.0 / deviation]


def is_explained(one: Solution) -> bool | None:
    """Return whether noise alone gives such residuals often enough; None where nothing tests that.

    A sum of squares tests it where the size of all noise is known; of runs it is white, and independent of the input.
    """
    # the probability of a sum of squares by noise alone
    is_small = chdtrc(max(one.freedom, 1), one.chi_squared) > 1e-6
    if one.has_known_noise and not is_small:
        return False
    if one.problem.runs:
        return one.chance_of_noise > LEAST_CHANCE
    return True if one.has_known_noise else None


def nearest_minimum(
    problem: Problem,
    start: Real,
    held: dict[int, float] | None = None,
    evaluations: int = 60,
    change: float = 1e-9,
) -> Solution:
    """Return the nearest minimum from a start, some coordinates held at a value, by a limited number of evaluations.

    The search ends where the sum of squares falls by less than a relative `change`.
    """
    held = held or {}
    point = start.copy()
    point[list(held)] = list(held.values())
    free = np.delete(np.arange(start.size), list(held))
    if not free.size:
        residuals = problem.residuals(point)
        return Solution(problem, point, residuals, np.zeros((residuals.size, start.size)), True, 1)

    def at(x: Real) -> Real:
        whole = point.copy()
        whole[free] = x
        return whole

    def jacobian(x: Real) -> Real:
        return problem.jacobian(at(x))[:, free]

    first = problem.inside(point)[free]
    low, high = problem.bounds
    found = least_squares(
        penalize(lambda x: problem.residuals(at(x)), first),
        first,
        jac=jacobian,
        bounds=(low[free], high[free]),
        x_scale="jac",
        xtol=1e-7,
        ftol=change,
        gtol=None,
        max_nfev=evaluations,
    )
    slopes = np.zeros((found.fun.size, start.size))
    slopes[:, free] = np.asarray(found.jac)
    return Solution(problem, at(found.x), found.fun, slopes, bool(found.status > 0), 1)


def rescale_noise(found: Solution) -> Solution:
    """Return the solution with each noise that is known up to a factor multiplied by what its residuals say."""
    if found.has_known_noise:
        return found
    count = len(found.problem.responses)
    for _ in range(3):
        share = found.residuals.size / max(found.freedom, 1)
        pairs = zip(found.problem.records, found.parts, strict=True)
        records: Any = [each.rescaled(own, share) for each, own in pairs]
        if all(map(operator.is_, records, found.problem.records)):
            break
        problem = replace(found.problem, responses=tuple(records[:count]), runs=tuple(records[count:]))
        found = nearest_minimum(problem, found.point)
    return found
