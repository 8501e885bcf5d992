"""The fit of an arm to what was measured of it: which numbers explain it, how sure, and which are left open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tfarm.arm import Arm, must_be_arm
from tfarm.errors import ParameterError
from tfarm.records import record

from .data import Measured, must_be_measured, noise_of
from .model import Problem, Response, check_signals
from .parameters import Parameter, parameters
from .ringing import RingMode
from .solve import Solution, best_solution, is_explained, nearest_minimum
from .sure import BetterError, Fitted, ToldInterval, sureness

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

    def chi_squared_at(self, values: Mapping[str, float]) -> float:
        """The sum of squared residuals at other numbers, by key."""
        own = self.solution.problem
        point = np.array([each.coordinate(values[each.key]) for each in own.parameters])
        residuals = own.residuals(point)
        return float(residuals @ residuals)


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
    check_signals(arm, data)
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
    if subject.size < len(subject.parameters):
        remedy = f"{subject.size} numbers were measured; leave some out"
        raise ParameterError(key="free", value=len(subject.parameters), remedy=remedy)
    return subject


def _of_sensor(kind: str, key: str, data: Measured) -> Parameter:
    """The gain of a response's sensor, by its logarithm, or its delay, in the time that the highest frequency takes."""
    is_gain = kind == SENSOR_GAIN
    size = 1.0 if is_gain else 1.0 / float(data.omega[-1])
    return Parameter(key=key, start=float(is_gain), low=-np.inf, high=np.inf, by_logarithm=is_gain, size=size)
