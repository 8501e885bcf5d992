"""The end of a fit: complex residuals over their deviations, least squares, from one start after another.

A robust loss is no likelihood and the logarithm of a noisy value is biased at an antiresonance, so what is reported,
and every interval, rests on Gaussian residuals alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtrc, ndtri, stdtrit

from tfarm.arrays import Real
from tfarm.records import record

from .data import CONFIDENCE
from .model import Problem, walled
from .start import LADDERS, Starts

NOISE_ALONE = 1e-6  # a sum of squares that noise alone exceeds so rarely is no noise: another start may do better
MUCH_MISFIT = 4.0  # times its degrees of freedom: a best sum beyond is tried from strayed starts too
MOST_EVALUATIONS = 60  # evaluations from one start
FIRM_POINT = 1e-7  # of the coordinates: a step that changes less ends a search
FIRM_SUM = 1e-9  # of the sum, likewise
OPEN_DEVIATION = 1.0  # of ln p: a combination with a larger deviation (a factor of e) is not determined by the data
WEAK = 0.1  # of ln p: what is known so badly is looked at again
SAME_SUM = 0.1  # of a sum of squares: less is no difference to speak of
EXCLUDED = 16.0  # of a sum of squares: noise alone makes up an effect of four deviations once in 15,000 fits
RESCALED = 3  # times that a noise known up to a factor takes its factor from the residuals


@dataclass(frozen=True)
@record
class Solution:
    """The best point found, with residuals, their Jacobian, and whether the search ended there in good order."""

    problem: Problem
    point: Real
    residuals: Real
    jacobian: Real
    converged: bool
    starts: int

    @property
    def chi_squared(self) -> float:
        """The sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @cached_property
    def parts(self) -> tuple[Real, ...]:
        """The residuals of each response, over their deviations."""
        sizes = [each.size for each in self.problem.responses]
        return tuple(np.split(self.residuals, np.cumsum(sizes))[: len(sizes)])

    @property
    def freedom(self) -> int:
        """Residuals less parameters."""
        return self.residuals.size - self.point.size

    @property
    def has_known_noise(self) -> bool:
        """Whether the size of no noise was taken from the residuals."""
        return all(each.noise.is_known for each in self.problem.responses)

    @property
    def misfit(self) -> float:
        """Minus ln of the likelihood, but for a constant: with the noise, where that is from the residuals."""
        sigmas = (each.noise.sigma for each in self.problem.responses)
        return self.chi_squared / 2 + sum(2 * float(np.log(sigma[np.isfinite(sigma)]).sum()) for sigma in sigmas)

    @property
    def quantile(self) -> float:
        """Deviations that an interval reaches to each side: of the normal distribution, or Student's."""
        share = 0.5 + CONFIDENCE / 2
        return float(ndtri(share) if self.has_known_noise else stdtrit(max(self.freedom, 1), share))


def best_solution(problem: Problem) -> Solution:
    """The least sum of squares over all starts; those of noise alone end the search early."""
    found: list[Solution] = []
    for subject, start in Starts(problem):
        found.append(_rescaled(nearest_minimum(subject, start)))
        best = min(found, key=lambda each: each.misfit)
        is_near = len(found) > len(LADDERS) and best.chi_squared < MUCH_MISFIT * best.freedom
        if best.converged and (is_near or is_explained(best)):
            break
    return replace(_nearest(best), starts=len(found))


def _nearest(found: Solution) -> Solution:
    """The solution with those directions open that the data do not exclude to be so, at the point nearest to the start.

    A valley may be open where the search began and closed where it ended, by what noise makes of an effect too small
    to be measured (the rotary inertia of E I).  The point moves only where the sum of squares stays what it is.
    """
    sizes, axes = principal_axes(found.jacobian)
    for limit, most in ((OPEN_DEVIATION, SAME_SUM), (WEAK, EXCLUDED)):
        some = axes[sizes < 1.0 / limit]
        if not some.size:
            continue
        start = found.point - some.T @ (some @ found.point)
        back = nearest_minimum(found.problem, start, {int(n): float(start[n]) for n in abs(some).argmax(axis=1)})
        again = nearest_minimum(found.problem, back.point)  # a logarithm may have ended where it changes nothing
        if again.converged and again.chi_squared < found.chi_squared - SAME_SUM:
            return _nearest(again)
        back = replace(back, jacobian=found.problem.jacobian(back.point), converged=found.converged)
        more = int((principal_axes(back.jacobian)[0] < 1.0 / OPEN_DEVIATION).sum())
        if back.chi_squared < found.chi_squared + most and more >= max(1, int((sizes < 1.0 / OPEN_DEVIATION).sum())):
            is_same = back.chi_squared < found.chi_squared + SAME_SUM
            return back if is_same else replace(found, jacobian=back.jacobian)
    return found


def principal_axes(jacobian: Real) -> tuple[Real, Real]:
    """What a unit step along each axis changes the residuals by (parameters,), largest first, and the axes (rows)."""
    count = jacobian.shape[1]
    _, sizes, axes = np.linalg.svd(np.vstack([jacobian, np.zeros((count, count))]), full_matrices=False)
    return sizes, axes


def is_explained(one: Solution) -> bool | None:
    """Whether noise alone gives such a sum often enough; None where its size was taken from the residuals."""
    if not one.has_known_noise:
        return None
    return bool(chdtrc(max(one.freedom, 1), one.chi_squared) > NOISE_ALONE)


def nearest_minimum(problem: Problem, start: Real, held: dict[int, float] | None = None) -> Solution:
    """The nearest minimum from a start, some coordinates held at a value."""
    held = held or {}
    free = [n for n in range(start.size) if n not in held]
    point = start.copy()
    point[list(held)] = list(held.values())
    if not free:
        return Solution(problem, point, problem.residuals(point), np.zeros((problem.size, start.size)), True, 1)
    low, high = (each[free] for each in problem.bounds)

    def whole(x: Real) -> Real:
        full = point.copy()
        full[free] = x
        return full

    def residuals(x: Real) -> Real:
        return problem.residuals(whole(x))

    def jacobian(x: Real) -> Real:
        return np.asarray(problem.jacobian(whole(x))[:, free])

    inside = problem.inside(point)[free]
    found = least_squares(
        walled(residuals), inside, jac=jacobian, bounds=(low, high), x_scale="jac",
        xtol=FIRM_POINT, ftol=FIRM_SUM, gtol=None, max_nfev=MOST_EVALUATIONS,
    )  # fmt: skip
    full, slopes = whole(found.x), np.zeros((found.fun.size, start.size))
    slopes[:, free] = np.asarray(found.jac)
    return Solution(problem, full, found.fun, slopes, bool(found.status > 0), 1)


def _rescaled(found: Solution) -> Solution:
    """The solution with each noise that is known up to a factor multiplied by what its residuals say."""
    if found.has_known_noise:
        return found
    for _ in range(RESCALED):
        responses, share = [], found.residuals.size / max(found.freedom, 1)
        for each, own in zip(found.problem.responses, found.parts, strict=True):
            factor = 1.0 if each.noise.is_known else math.sqrt(float(own @ own) / own.size * share)
            responses.append(replace(each, noise=replace(each.noise, sigma=each.noise.sigma * max(factor, 1e-12))))
        found = nearest_minimum(replace(found.problem, responses=tuple(responses)), found.point)
    return found
