"""Where a fit begins: numerator and denominator of a response agree with the data first, then their ratio.

The squares of H - D, of a response H = N/P and its measured values D, have a minimum for every pole of H that lies
between two other lines than the true one.  The equation error of Levy (1959)

    e = (N - D P)/W,    W = |N(s + share w)| + (|D| + sigma) |P(s + share w)|    at s = i w

has no poles: N and P are entire in s and smooth in the arm's numbers, and so is W, their size right of the axis, where
neither has zeros.  So its squares have few minima, and a pole comes to where N and P have it, between lines too.  It is
biased by noise (Sanathanan and Koerner 1963), and only where a search begins.  With a larger `share` W is smoother.
Tuned on the survey `tests.fitting.planted`: the constants below.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from tfarm.arrays import Real
from tfarm.errors import ParameterError

from .data import in_parts
from .model import Problem, walled
from .parameters import Around
from .ringing import ring_residuals

LADDERS = ((0.1,), (1.0, 0.3, 0.1))  # shares of w, one after another, of the first starts
DRAWS = 300  # points about one that the equation errors lead to
DRAWN = 2.0  # times the deviation that they know it with
STRAYED = 6  # starts beyond these, strayed from the first point by
SPREAD = 0.3  # of ln p
START_DEVIATION = 50.0  # of ln p, over that of an equation error: what the data do not know stays where it is
LINES = 400  # of a response, at most
LOSS = 0.1  # of an equation error: those beyond count less and less
STEPS = 40  # evaluations, of each share
FIT_SEED = 852780  # of all that a fit draws: the number of the paper's article, any would do


class Starts:
    """Points of the search that the complex residuals may be minimised from, the likeliest first."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def __iter__(self) -> Iterator[tuple[Problem, Real]]:
        zero = np.zeros(len(self.problem.parameters))
        yield self._near(zero, LADDERS[0], 0)
        for shares in LADDERS:
            yield self._near(zero, shares, DRAWS)
        rng = np.random.default_rng(FIT_SEED)
        for _ in range(STRAYED):
            with suppress(ParameterError):  # no arm there
                yield self._near(SPREAD * rng.standard_normal(zero.size), LADDERS[-1], DRAWS)

    def _near(self, point: Real, shares: tuple[float, ...], draws: int) -> tuple[Problem, Real]:
        """The problem, its sensors' gains by the sign that they have, and where the equation errors lead from a point.

        Of the `draws` as far from there as these know it, that of the least squares: the true side of a line.
        """
        point = self.problem.inside(point)
        for share in shares:
            whole, first = with_gains(self.problem, point)
            thin = thinned(whole, LINES)
            found = least_errors(thin, first, share)
            point = np.asarray(found.x)
        _, sizes, axes = np.linalg.svd(found.jac, full_matrices=False)
        deviation = math.sqrt(2 * found.cost / found.fun.size) / sizes
        drawn = np.random.default_rng(FIT_SEED).standard_normal((draws, point.size)) * DRAWN * deviation
        return whole, min((point, *map(thin.inside, point + drawn @ axes)), key=partial(sum_of_squares, thin))


def least_errors(problem: Problem, first: Real, share: float) -> OptimizeResult:
    """Where the equation errors are least, next to a point, under a loss for outliers."""

    def errors(x: Real) -> Real:
        return np.concatenate([equation_errors(problem, x, share), (x - first) / START_DEVIATION])

    return least_squares(
        walled(errors), first, bounds=problem.bounds, loss="soft_l1", f_scale=LOSS, max_nfev=STEPS, xtol=1e-4, ftol=1e-4
    )


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
    if problem.rings:
        decays = ring_residuals(Around(problem.arm(point), ()), problem.rings, point.size)[0]
        shares = [(each.frequency_deviation / each.frequency, each.ratio is None) for each in problem.rings]
        weights = np.concatenate([[size] if is_alone else [size, 0.0] for size, is_alone in shares])
        errors.append(decays * weights)
    return np.concatenate(errors)


def with_gains(problem: Problem, point: Real) -> tuple[Problem, Real]:
    """The problem with the sign of each sensor's gain as the data have it at a point; the point with its size."""
    parameters, point = list(problem.parameters), point.copy()
    for H, each in zip(problem.computed(point), problem.responses, strict=True):
        if each.gain is not None:
            ratio = each.data.values / H
            own = parameters[each.gain]
            if np.median(ratio.real / abs(ratio)) < 0:
                parameters[each.gain] = replace(own, start=-own.start)
            point[each.gain] += float(np.median(np.log(abs(ratio))))
    return replace(problem, parameters=tuple(parameters)), point


def thinned(problem: Problem, most: int) -> Problem:
    """The problem at so many of each response's frequencies at most."""
    responses = []
    for each in problem.responses:
        size = each.data.omega.size
        kept = np.unique(np.linspace(0, size - 1, min(size, most)).astype(int))
        kept = kept[np.isfinite(each.noise.sigma[kept]) & (each.data.values[kept] != 0)]
        data = replace(
            each.data, omega=each.data.omega[kept], values=each.data.values[kept], sigma=None, coherence=None
        )
        responses.append(replace(each, data=data, noise=replace(each.noise, sigma=each.noise.sigma[kept])))
    return replace(problem, responses=tuple(responses))
