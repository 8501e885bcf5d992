"""Where a fit begins: peaks and dips matched first, then curves by their logarithms.

The squares of complex residuals have a minimum for every peak that lies on a wrong one, so a search from parameters
30 % off ends in one of them.  Peaks and dips of a measured response are poles and zeros near the imaginary axis;
matched in their order with those of the arm, their logarithms are nearly linear in those of the parameters.  From there
the logarithms of the curves, under a loss that lets wrong pieces be, lead to where the squares have one minimum.
Tuned on the survey `tests.fitting.planted`: the counts and shares below.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from tfarm.arrays import Real
from tfarm.errors import ParameterError

from .data import in_parts
from .features import features_of, match, near_zeros
from .model import Problem
from .ringing import ring_residuals

START_DEVIATION = 0.5  # of ln p: the deviation that a start is held with, where peaks do not decide
MATCH_ROUNDS = 8  # of Newton's method on the frequencies
SHIFTS = (0.0, -0.15, 0.15, -0.3, 0.3)  # of ln w: of all the arm's peaks, before the first match
STEP_SHARES = (1.0, 0.5, 0.2, 0.05)  # of a step: where a whole one leads to no arm
CURVE = 150  # points of a response that its curve is followed at
LOSS = 0.3  # of ln H: residuals beyond count less and less


class Starts:
    """Points of the search that the complex residuals may be minimised from, the likeliest first."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._free = len(problem.of_the_arm)
        self._features = [features_of(each.data, each.noise.sigma) for each in problem.responses]

    def __iter__(self) -> Iterator[tuple[Problem, Real]]:
        zero = np.zeros(len(self.problem.parameters))
        tried: list[Real] = []
        for shift in SHIFTS if self._free else ():
            matched = self._matched(zero, shift)
            if any(abs(matched - other).max() < 1e-3 for other in tried):
                continue
            tried.append(matched)
            try:
                found = self._along_curves(matched)
            except ParameterError:  # no arm there
                continue
            yield found
        yield self._along_curves(zero)

    # ------------------------------------------------------------ peaks

    def _matched(self, point: Real, shift: float) -> Real:
        """The point where the arm's peaks and dips are those measured, matched anew in each round."""
        for turn in range(MATCH_ROUNDS):
            rows, misfit = self._frequency_rows(point, shift * max(0.0, 1.0 - turn / 3))
            held = np.eye(self._free) / START_DEVIATION
            away = -point[: self._free] / START_DEVIATION
            matrix, right = np.vstack([rows, held / 10]), np.concatenate([misfit, away / 10])
            step = np.linalg.lstsq(matrix * 10, right * 10, rcond=None)[0]
            step *= min(1.0, 0.3 / max(abs(step).max(), 1e-12))
            point = self._stepped(point, step)
            if abs(step).max() < 1e-4:
                break
        return point

    def _stepped(self, point: Real, step: Real) -> Real:
        """The point a step further on, or as much of it as there are arms."""
        for share in STEP_SHARES:
            beyond = point.copy()
            beyond[: self._free] += share * step
            beyond = self.problem.inside(beyond)
            with suppress(ParameterError):
                self.problem.arm(beyond)
                return beyond
        return point

    def _frequency_rows(self, point: Real, shift: float) -> tuple[Real, Real]:
        """d ln w of the arm's matched peaks along the parameters (matched, free), and ln w measured less theirs."""
        rows, misfit = [np.empty((0, self._free))], [np.empty(0)]
        here = self.problem.around(point)
        for each, features in zip(self.problem.responses, self._features, strict=True):
            for measured, (w, slopes) in zip(features, near_zeros(here, each.data), strict=True):
                pairs = match(np.log(measured), np.log(w) + shift)
                rows.append(np.array([slopes[:, j] for _, j in pairs]).reshape(-1, self._free))
                misfit.append(np.array([np.log(measured[i] / w[j]) for i, j in pairs]))
        if self.problem.rings:
            decays, slopes = ring_residuals(here, self.problem.rings, point.size)
            shares = np.array([each.frequency_deviation / each.frequency for each in self.problem.rings])
            first = np.cumsum([0, *(1 + (each.ratio is not None) for each in self.problem.rings)])[:-1]
            rows.append(slopes[first, : self._free] * shares[:, None])
            misfit.append(-decays[first] * shares)
        return np.vstack(rows), np.concatenate(misfit)

    # ------------------------------------------------------------ curves

    def _along_curves(self, point: Real) -> tuple[Problem, Real]:
        """The point where the logarithms of the curves agree best, from there, under a loss for outliers.

        The problem with it has its sensors' gains by the sign that they have.
        """
        whole = with_signs(self.problem, point)
        thin = thinned(whole, CURVE)
        low, high = thin.bounds
        point = thin.inside(self._with_gains(thin, point))

        if not thin.responses:
            return whole, point

        def residuals(x: Real) -> Real:
            pairs = zip(thin.computed(x), thin.responses, strict=True)
            return np.concatenate([in_parts(np.log(H / each.data.values)) for H, each in pairs])

        def jacobian(x: Real) -> Real:
            return np.concatenate([in_parts(dH / H).T for H, dH in thin.slopes(x)])

        found = least_squares(
            residuals,
            point,
            jac=jacobian,
            bounds=(low, high),
            loss="soft_l1",
            f_scale=LOSS,
            max_nfev=25,
            xtol=1e-3,
            ftol=1e-3,
        )
        return whole, np.asarray(found.x)

    def _with_gains(self, problem: Problem, point: Real) -> Real:
        """The point with each sensor's gain as the levels have it in the median."""
        point = point.copy()
        for H, each in zip(problem.computed(point), problem.responses, strict=True):
            if each.gain is not None:
                point[each.gain] += float(np.median(np.log(abs(each.data.values / H))))
        return point


def with_signs(problem: Problem, point: Real) -> Problem:
    """The problem with the sign of each sensor's gain as the data have it at a point: the start's is turned."""
    parameters = list(problem.parameters)
    for H, each in zip(problem.computed(point), problem.responses, strict=True):
        if each.gain is not None:
            weight = (each.data.values * np.conj(H)).real / abs(each.data.values * H)
            if np.median(weight) < 0:
                own = parameters[each.gain]
                parameters[each.gain] = replace(own, start=-own.start)
    return replace(problem, parameters=tuple(parameters))


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
