"""The fit of an arm to what was measured of it: which numbers explain it, how sure, and which are left open.

The arms that the data leave possible: drawn about the best one, and what a loop is on each of them.

Drawn from the normal distribution that the residuals have about their least sum, kept where the true sum of squares
agrees with it; along what the data do not determine, within a factor of e of the start: no knowledge of theirs.

Several records of one response: what they say one by one, and a bootstrap over them.

The noise within a record is not all that differs from one sweep to the next: amplitudes, temperatures, the hand that
clamped the link.  What the numbers scatter by from record to record says so, and drawing whole records anew (Efron
1979) gives intervals that know of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import gammaincinv

from tfarm.arm import Arm, must_be_arm
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.plane import gain_map
from tfarm.records import record
from tfarm.response import transfer

from .data import Measured, must_be_measured, noise_of
from .model import Parameter, Problem, Response, RingMode, parameters
from .overlay import ratio_of
from .solve import (
    FIT_SEED,
    OPEN_DEVIATION,
    BetterError,
    Fitted,
    Solution,
    ToldInterval,
    best_solution,
    is_explained,
    nearest_minimum,
    principal_axes,
    sureness,
)

SENSOR_GAIN, SENSOR_DELAY = "gain", "delay"  # of a sensor, as `Response` has them: free beside the arm's numbers
MENDED = 4  # times that a profile may find a lower sum of squares than the search did


@dataclass(frozen=True, kw_only=True)
@record
class Fit:
    """An arm fitted to measured responses.

    `parameters` are the free numbers with their intervals, `not_determined` the combinations that the data leave open;
    `chi_squared` over `freedom` is about 1 where the arm and the noise explain all.
    """

    arm: Arm
    before: Arm
    converged: bool
    parameters: tuple[Fitted, ...]
    not_determined: tuple[str, ...]
    chi_squared: float
    freedom: int
    solution: Solution
    profiled: bool

    @property
    def finding(self) -> str:
        """The numbers, and how well they explain the data, in words."""
        numbers = ", ".join(f"{each.key} = {each.value:.6g}" for each in self.parameters)
        return f"{numbers}; chi-squared {self.chi_squared:.4g} of {self.freedom}"

    @property
    def responses(self) -> tuple[Measured, ...]:
        """What was measured."""
        return tuple(each.data for each in self.solution.problem.responses)

    @cached_property
    def rms_log_error(self) -> float | None:
        """The root mean square of ln(computed/measured), complex, over all values; None where there are none."""
        if not self.responses:
            return None
        computed = self.solution.problem.computed(self.solution.point)
        pairs = zip(computed, self.responses, strict=True)
        away = np.concatenate([np.log(H / each.values)[each.values != 0] for H, each in pairs])
        return float(np.sqrt((abs(away) ** 2).mean()))

    @property
    def is_explained(self) -> bool | None:
        """Whether noise alone is often so large; None where its size was taken from the residuals."""
        return is_explained(self.solution)

    @property
    def verdict(self) -> str:
        """In a word or three."""
        if not self.converged:
            return "not converged"
        return "fitted, but the arm does not explain the data" if self.is_explained is False else "fitted"


def fit(
    arm: Arm,
    data: Sequence[Measured],
    free: Sequence[str],
    *,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    rings: Sequence[RingMode] = (),
    profile: bool = True,
    progress: ToldInterval | None = None,
) -> Fit:
    """The arm whose free numbers explain the measured responses best.

    `free` are keys of the arm's TOML file, and "gain" and "delay" of each response's sensor; `start`, `bounds` and
    `priors` (mean, deviation) are by key, in SI units; `rings` are decays of single modes.  With `profile` each
    interval is that of the profile likelihood, otherwise of the covariance; `progress` is told (done, total, what).
    Raises ParameterError for a key that is none, and for more numbers than data.
    """
    subject = _problem(arm, data, free, start, bounds, priors, rings)
    found = best_solution(subject)
    for _ in range(MENDED):
        try:
            fitted, unknown = sureness(found, profile=profile, progress=progress)
            break
        except BetterError as better:
            found = replace(nearest_minimum(better.found.problem, better.found.point), starts=found.starts)
    else:  # one valley after another: no end of it
        found = replace(found, converged=False)
        fitted, unknown = sureness(found, profile=False)
    return Fit(
        arm=replace(found.problem.arm(found.point), name=f"{arm.name}-fitted"),
        before=replace(subject.arm(np.zeros(len(subject.parameters))), name=arm.name),
        converged=found.converged,
        parameters=fitted,
        not_determined=unknown,
        chi_squared=found.chi_squared,
        freedom=found.freedom,
        solution=found,
        profiled=profile,
    )


def _problem(arm: Arm, data: Any, free: Any, start: Any, bounds: Any, priors: Any, rings: Any) -> Problem:
    """What is searched for: the arm's numbers, then the sensors' own, one of a kind for each response."""
    must_be_arm(arm)
    data = tuple(data) if isinstance(data, Iterable) and not isinstance(data, str) else (data,)
    for each in data:
        must_be_measured(each)
    if not data and not rings:
        raise ParameterError(key="data", value=0, remedy="give at least one measured response, or a decay (--mode)")
    keys = [str(key) for key in free if key not in (SENSOR_GAIN, SENSOR_DELAY)]
    family, numbers = parameters(arm, keys, start=start or {}, bounds=bounds or {}, priors=priors or {})
    for each in data:
        ratio_of(arm, each)
    own, responses = [*numbers], []
    for n, each in enumerate(data, start=1):
        places = {}
        for kind in (kind for kind in (SENSOR_GAIN, SENSOR_DELAY) if kind in free):
            places[kind] = len(own)
            own.append(_of_sensor(kind, kind if len(data) == 1 else f"{kind}:{n}", each))
        responses.append(Response(each, noise_of(each), **places))
    subject = Problem(family, tuple(own), tuple(responses), tuple(rings))
    if not subject.parameters:
        raise ParameterError(key="free", value="nothing", remedy="name what is free, such as link.youngs_modulus")
    size = subject.residuals(np.zeros(len(own))).size
    if size < len(own):
        remedy = f"{size} numbers were measured; leave some out"
        raise ParameterError(key="free", value=len(own), remedy=remedy)
    return subject


def _of_sensor(kind: str, key: str, data: Measured) -> Parameter:
    """The gain of a response's sensor, by its logarithm, or its delay, in the time that the highest frequency takes."""
    is_gain = kind == SENSOR_GAIN
    size = 1.0 if is_gain else 1.0 / float(data.omega[-1])
    return Parameter(key=key, start=float(is_gain), low=-np.inf, high=np.inf, by_logarithm=is_gain, size=size)


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


def share_stable(those: Possible, across: Real, up: Real) -> Real:
    """The share of the arms on which both gains hold (up, across), without a clock."""
    return np.asarray(np.mean([gain_map(arm, across, up).unstable == 0 for arm in those.arms], axis=0))


def response_band(those: Possible, output: str, omega: Real) -> tuple[Real, Real, Real]:
    """The lowest and highest magnitude of the possible arms, and the best one's, at frequencies [rad/s]."""
    sizes = [abs(transfer(arm, output)(1j * omega)) for arm in those.arms]
    return np.min(sizes, axis=0), np.max(sizes, axis=0), np.asarray(abs(transfer(those.fit.arm, output)(1j * omega)))


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
