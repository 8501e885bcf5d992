"""A fit's search and its intervals: numerator and denominator of a response agree with the data, then their ratio.

The squares of H - D, of a response H = N/P and its measured values D, have a minimum for every pole of H that lies
between two other lines than the true one.  The equation error of Levy (1959)

    e = (N - D P)/W,    W = |N(s + share w)| + (|D| + sigma) |P(s + share w)|    at s = i w

has no poles: N and P are entire in s and smooth in the arm's numbers, and so is W, their size right of the axis, where
neither has zeros.  So its squares have few minima, and a pole comes to where N and P have it, between lines too.  It is
biased by noise (Sanathanan and Koerner 1963), and only where a search begins.  With a larger `share` W is smoother.
Tuned on the survey `tests.fitting.planted`: the constants below.

The end of a fit is least squares of complex residuals over their deviations, from one start after another.  A robust
loss is no likelihood and the logarithm of a noisy value is biased at an antiresonance, so every result and every
interval rests on Gaussian residuals alone.

Intervals are by the covariance or by the profile of the likelihood; some numbers the data do not determine.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Annotated

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.special import chdtrc, ndtri, stdtrit

from tfarm.arm.schema import file_key
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.fitting.data import CONFIDENCE, in_parts
from tfarm.fitting.model import Problem, penalize
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.stopping import Progress

# of a response, at most
LINES = 400
# of all that a fit draws: the number of the paper's article, any would do
FIT_SEED = 852780


def start_by(problem: Problem, draws: int, shares: Sequence[float]) -> tuple[Problem, Real]:
    """The problem, its sensors' gains by the sign that they have, and the least equation errors next to the start.

    Of a number of draws about these, as wide as they are uncertain, that of the least squares: the true side of a line.
    """
    point = problem.start
    for share in shares:
        whole, first = with_gains(problem, point)
        thin = thin_problem(whole, LINES)

        def errors(x: Real, thin: Problem = thin, first: Real = first, share: float = share) -> Real:
            # of ln p, over that of an equation error: what the data do not know stays where it is
            return np.concatenate([equation_errors(thin, x, share), (x - first) / 50.0])

        # equation errors beyond 0.1 count less and less
        found = least_squares(
            penalize(errors, first),
            first,
            bounds=thin.bounds,
            loss="soft_l1",
            f_scale=0.1,
            max_nfev=40,
            xtol=1e-4,
            ftol=1e-4,
        )
        point = found.x
    _, sizes, axes = np.linalg.svd(np.asarray(found.jac), full_matrices=False)
    deviation = math.sqrt(2 * found.cost / found.fun.size) / sizes
    drawn = np.random.default_rng(FIT_SEED).standard_normal((draws, point.size)) * 2.0 * deviation
    return whole, min((point, *map(thin.inside, point + drawn @ axes)), key=partial(sum_of_squares, thin))


def sum_of_squares(problem: Problem, point: Real) -> float:
    """Of the complex residuals over their deviations; inf where there is no arm."""
    try:
        residuals = problem.residuals(point)
    except ParameterError:
        return math.inf
    return float(residuals @ residuals)


def equation_errors(problem: Problem, point: Real, share: float) -> Real:
    """Real and imaginary parts of e at each frequency, and ln of each decay's frequency over the measured one."""
    errors = []
    pairs = zip(problem.fractions(point), problem.fractions(point, share), problem.responses, strict=True)
    for (N, P, here), (smooth_N, smooth_P, there), each in pairs:
        D = each.data.values
        W = (abs(smooth_N) + (abs(D) + each.noise.sigma) * abs(smooth_P)) * np.exp(there - here)
        errors.append(in_parts((N - D * P) / W))
    frequencies = [each._replace(frequency_deviation=each.frequency, ratio=None) for each in problem.rings]
    return np.concatenate([*errors, problem.decays(point, frequencies)])


def with_gains(problem: Problem, point: Real) -> tuple[Problem, Real]:
    """The problem with the sign of each sensor's gain as the data have it at a point; the point with its size."""
    parameters = list(problem.parameters)
    point = point.copy()
    for H, each in zip(problem.computed(point), problem.responses, strict=True):
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
    count = math.ceil(16 * min(omega[-1] / omega[0], LINES))
    delays = np.linspace(-period, period, 2 * count + 1)
    phases = np.sign(ratio)
    aligned = abs(np.exp(1j * np.outer(delays, omega)) @ phases)
    if aligned.max() > 1.5 * aligned[count]:
        return float(delays[aligned.argmax()])
    return 0.0


def thin_problem(problem: Problem, most: int) -> Problem:
    """The problem at a number of each response's frequencies at most."""
    responses = []
    for each in problem.responses:
        data = each.data
        kept = np.unique(np.linspace(0, data.points - 1, min(data.points, most)).astype(int))
        kept = kept[np.isfinite(each.noise.sigma[kept]) & (data.values[kept] != 0)]
        responses.append(each.at(data.omega[kept], data.values[kept], each.noise.sigma[kept]))
    return replace(problem, responses=tuple(responses))


# evaluations from one start
MOST_EVALUATIONS = 60
# of ln p: a combination with a larger deviation (a factor of e) is not determined by the data
OPEN_DEVIATION = 1.0
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
        """The residuals of each response, over their deviations."""
        ends = np.cumsum([each.size for each in self.problem.responses], dtype=int)
        return tuple(np.split(self.residuals, ends)[:-1])

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
        """Residuals less parameters."""
        return self.residuals.size - self.point.size

    @property
    def has_known_noise(self) -> bool:
        """Whether the size of no noise was taken from the residuals."""
        return all(each.noise.is_known for each in self.problem.responses)

    @property
    def misfit(self) -> float:
        """Minus ln of the likelihood, but for a constant: with the noise, where that is from the residuals."""
        sigma = np.concatenate([np.empty(0), *(each.noise.sigma for each in self.problem.responses)])
        return self.chi_squared / 2 + 2 * float(np.log(sigma[np.isfinite(sigma)]).sum())

    @property
    def quantile(self) -> float:
        """Deviations that an interval reaches to each side: of the normal distribution, or Student's."""
        share = 0.5 + CONFIDENCE / 2
        return float(ndtri(share) if self.has_known_noise else stdtrit(max(self.freedom, 1), share))


def best_solution(problem: Problem, is_enough: Callable[[Solution], bool | None] | None = None) -> Solution:
    """The least sum of squares over the starts; one that `is_enough` (by default of noise alone) ends the search early.

    Where something is left open the valleys are wide, and the equation errors may lead into the wrong one: a pole that
    is there only between two lines.  Then the fit's own start is tried too.
    """
    found: list[Solution] = []
    # draws about the point that the equation errors lead to, and their shares of w one after another
    for draws, shares in ((0, [0.1]), (300, [0.1]), (300, [1.0, 0.3, 0.1])):
        found.append(_rescaled(nearest_minimum(*start_by(problem, draws, shares))))
        best = min(found, key=lambda each: each.misfit)
        if best.converged and (is_enough or is_explained)(best):
            break
    if open_axes(best.jacobian).size:
        at_start = _rescaled(nearest_minimum(*with_gains(problem, problem.start)))
        found.append(at_start)
        best = at_start if at_start.misfit < best.misfit - SAME_SUM else best
    # as many more evaluations from the best of the starts: along a narrow valley
    for _ in range(8):
        best = best if best.converged else nearest_minimum(best.problem, best.point)
    return replace(_nearest(best), starts=len(found))


def _nearest(found: Solution) -> Solution:
    """The solution with those directions open that the data do not exclude to be so, at the point nearest to the start.

    A valley may be open where the search began and closed where it ended, where noise exceeds an effect too small to be
    measured (the rotary inertia of E I).  The point moves only where the sum of squares stays what it is.
    """
    least = found.chi_squared
    problem = found.problem
    for limit, most in ((OPEN_DEVIATION, SAME_SUM), (0.1, EXCLUDED)):
        some = open_axes(found.jacobian, limit)
        if not some.size:
            continue
        start = found.point - some.T @ (some @ found.point)
        back = nearest_minimum(problem, start, {int(n): float(start[n]) for n in abs(some).argmax(axis=1)})
        # a logarithm may have ended where it changes nothing
        again = nearest_minimum(problem, back.point)
        if again.converged and again.chi_squared < least - SAME_SUM:
            return _nearest(again)
        back = replace(back, jacobian=problem.jacobian(back.point), converged=found.converged)
        fewest = max(1, len(open_axes(found.jacobian)))
        if back.chi_squared < least + most and len(open_axes(back.jacobian)) >= fewest:
            if back.chi_squared < least + SAME_SUM:
                return back
            return replace(found, jacobian=back.jacobian)
    return found


def principal_axes(jacobian: Real) -> tuple[Real, Real]:
    """The change of the residuals by a unit step along each axis (parameters,), largest first, and the axes (rows)."""
    padded = np.vstack([jacobian, np.zeros((jacobian.shape[1],) * 2)])
    return np.linalg.svd(padded, full_matrices=False)[1:]


def open_axes(jacobian: Real, deviation: float = OPEN_DEVIATION) -> Real:
    """The axes (rows) along which the data leave more than that deviation of ln p."""
    sizes, axes = principal_axes(jacobian)
    return axes[sizes < 1.0 / deviation]


def is_explained(one: Solution) -> bool | None:
    """Whether noise alone gives such a sum often enough; None where its size was taken from the residuals."""
    if not one.has_known_noise:
        return None
    # the probability of a sum of squares by noise alone
    return bool(chdtrc(max(one.freedom, 1), one.chi_squared) > 1e-6)


def nearest_minimum(problem: Problem, start: Real, held: dict[int, float] | None = None) -> Solution:
    """The nearest minimum from a start, some coordinates held at a value."""
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
        ftol=1e-9,
        gtol=None,
        max_nfev=MOST_EVALUATIONS,
    )
    slopes = np.zeros((found.fun.size, start.size))
    slopes[:, free] = np.asarray(found.jac)
    return Solution(problem, at(found.x), found.fun, slopes, bool(found.status > 0), 1)


def _rescaled(found: Solution) -> Solution:
    """The solution with each noise that is known up to a factor multiplied by what its residuals say."""
    if found.has_known_noise:
        return found
    for _ in range(3):
        responses = []
        share = found.residuals.size / max(found.freedom, 1)
        for each, own in zip(found.problem.responses, found.parts, strict=True):
            factor = 1.0 if each.noise.is_known else math.sqrt((own @ own) / own.size * share)
            responses.append(
                replace(each, noise=replace(each.noise, sigma=each.noise.sigma * max(factor, 1e-12)))
            )
        found = nearest_minimum(replace(found.problem, responses=tuple(responses)), found.point)
    return found


# of a unit vector: a smaller component has no part in it
TAKES_PART = 0.1


@frozen(kw_only=True)
class Fitted:
    """A fitted number: `value` in SI units, the ends of its 95 % interval, its standard deviation by the covariance.

    A number that the data do not determine has no interval.
    """

    label: Annotated[str, Quantity("number", help="name and symbol of the fitted number")]
    key: Annotated[
        str, Quantity("key", help="key of the number in the arm's file, or the sensor's gain or delay")
    ]
    unit: Annotated[str, Quantity("unit", help="SI unit of the number")]
    value: Annotated[float, Quantity("value", help="best value")]
    low: Annotated[
        float | None,
        Quantity(
            "95 % interval from", help="lower end of the interval; none where the data set no lower bound"
        ),
    ]
    high: Annotated[
        float | None, Quantity("to", help="upper end of the interval; none where the data set no upper bound")
    ]
    deviation: Annotated[
        float | None,
        Quantity(
            "standard deviation", digits=3, key="std", help="by the covariance of the linearised residuals"
        ),
    ]
    identified: Annotated[
        bool, Quantity("identified", help="whether the data bound the number on both sides")
    ]
    start: Annotated[float, Quantity(help="value at which the search began")]


class BetterError(Exception):
    """A profile has come to a lower sum of squares than the best: its argument is the solution there."""


def confidence_intervals(
    found: Solution, *, profile: bool, progress: Progress | None = None
) -> tuple[tuple[Fitted, ...], tuple[str, ...]]:
    """A solution's numbers with their intervals, and what is not determined, in words.

    The intervals are by profiles, or by the covariance where these are not asked for.
    Along an open axis nothing changes, so one number of it is held while the others are profiled.  `progress` gets
    (done, total, key) before each.  Raises BetterError where a profile comes to a lower sum than the solution's.
    """
    parameters = found.problem.parameters
    quantile = found.quantile
    sizes, axes = principal_axes(found.jacobian)
    is_known = sizes >= 1.0 / OPEN_DEVIATION
    deviations = np.linalg.norm(axes[is_known] / sizes[is_known, None], axis=0).tolist()
    unknown = axes[~is_known]
    part = abs(unknown) > TAKES_PART
    largest = abs(unknown).argmax(axis=1).tolist()
    held = {n: float(found.point[n]) for n in largest}
    words = [_undetermined(axis, [each.key for each in parameters]) for axis in unknown]
    alone = {n: k for k, n in enumerate(largest) if part[k].sum() == 1}
    fitted = []
    for n, each in enumerate(parameters):
        if progress is not None:
            progress(n, len(parameters), f"interval of {each.key}")
        low = high = deviation = None
        point = float(found.point[n])
        value = each.value(point)
        own = deviations[n]
        if not part[:, n].any():
            ends = [point - quantile * own, point + quantile * own]
            if profile:
                ends = [_end(found, n, end, quantile, held) for end in ends]
            low, high = each.ends(ends)
            deviation = own * each.per_coordinate(value)
        elif n in alone:
            low, high = _one_sided(found, n, quantile)
            words[alone[n]] = words[alone[n]] if low is None else ""
        of = file_key(each.key)
        fitted.append(
            Fitted(
                label=of.label,
                key=each.key,
                unit=of.unit or "1",
                value=value,
                low=low,
                high=high,
                deviation=deviation,
                identified=None not in (low, high),
                start=each.start,
            )
        )
        if (low is None) != (high is None):
            end = f"at most {high:.4g}" if low is None else f"at least {low:.4g}"
            words.append(f"{each.key} is {end}: one-sided bound")
    return tuple(fitted), tuple(word for word in words if word)


def _one_sided(found: Solution, n: int, quantile: float) -> tuple[float | None, float | None]:
    """The interval of a number that has no effect where it is, but would if it were larger, or smaller.

    A payload of next to nothing has an upper bound, a clamp that is all but rigid a lower one; None, None where there
    is neither.  The others are held: with them free the bound is farther by no more than a factor.
    """
    each = found.problem.parameters[n]
    if each.size:
        return None, None
    low, high = (each[n] for each in found.problem.bounds)
    own = found.point[n]
    along = np.eye(found.point.size)[n]

    def excess(at: float) -> float:
        return (
            sum_of_squares(found.problem, found.point + (at - own) * along) - found.chi_squared - quantile**2
        )

    def end(way: int) -> float | None:
        # of ln p: where a number that does not matter is tried
        steps = (own + way * reach for reach in (0.5, 1.0, 2.0, 4.0, 6.0, 9.0))
        beyond = next((at for at in steps if low <= at <= high and excess(at) > 0), None)
        if beyond is None:
            return None
        return each.value(float(brentq(excess, own, beyond, xtol=1e-4)))

    lower = end(-1)
    upper = end(1)
    if lower is None and upper is None:
        return (None, None)
    return (lower or 0.0, upper)


def _end(found: Solution, n: int, at: float, quantile: float, held: dict[int, float]) -> float:
    """Where the least sum of squares with coordinate n held has grown by quantile^2, on the side of the best of `at`.

    The root of that growth is nearly linear in the coordinate, so a secant finds it in two or three steps.
    """
    low, high = (each[n] for each in found.problem.bounds)
    rest = [m for m in range(found.point.size) if m != n and m not in held]
    # of the others where n is held elsewhere
    slope = np.eye(found.point.size)[n]
    slope[rest] = -np.linalg.lstsq(found.jacobian[:, rest], found.jacobian[:, n], rcond=None)[0]
    own = near = found.point[n]
    root_near = 0.0
    # three steps do but in a crooked valley
    for _ in range(12):
        at = np.clip(at, low, high)
        start = found.point + slope * (at - own)
        there = nearest_minimum(found.problem, start, held | {n: at})
        growth = there.chi_squared - found.chi_squared
        # of a sum of squares: a profile that falls by more has left the valley of the best
        if growth < -0.05:
            raise BetterError(there)
        root = math.sqrt(max(growth, 0.0))
        # of a deviation: there the profile has reached its level
        if abs(root - quantile) < 0.01 or (at in (low, high) and root < quantile):
            return float(at)
        last = at - near
        # of the last step: no farther than three of it
        times = np.clip((quantile - root) / (root - root_near), -3, 3) if root != root_near else 2
        near = at
        root_near = root
        at = at + times * last
    return float(at)


def _undetermined(axis: Real, keys: Sequence[str]) -> str:
    """A direction along which nothing changes, in words; of two numbers, the combination that is known instead."""
    part = [n for n in np.argsort(-abs(axis)) if abs(axis[n]) > TAKES_PART]
    names = [keys[n] for n in part]
    shares = axis[part] / abs(axis[part[0]])
    if len(part) == 1:
        return f"{names[0]} is not determined by these data"
    if len(part) == 2:
        # first * second^power does not change along the axis
        power = -shares[0] / shares[1]
        # one so near to 1 is written as 1
        exponent = "" if abs(abs(power) - 1) < 0.02 else f"^{abs(power):.3g}"
        known = f"{names[0]} {'*' if power > 0 else '/'} {names[1]}{exponent}"
        return f"{' and '.join(names)} are not determined by these data: only {known} is"
    words = ", ".join(f"{name} {share:+.3g} %" for name, share in zip(names, shares, strict=True))
    return f"not determined by these data: {words} together change nothing"
