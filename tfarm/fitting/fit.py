"""The fit of an arm to what was measured of it: its numbers, their intervals, and what the data do not determine.

Arms that the data leave possible are drawn from the posterior, along what the data do not determine with a deviation of
a factor of e, and kept where the true sum of squares agrees with the data.

Curves over frequency and gains have the arms that the data leave possible as a band, or a share of them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import gammaincinv

from tfarm.arm import Arm, must_be_arm
from tfarm.arm.chain import Chain, file_text
from tfarm.arm.writing import to_toml
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, require
from tfarm.files import is_standard_output, write_file
from tfarm.fitting.assumptions import assumptions_of
from tfarm.fitting.data import CONFIDENCE, Measured, must_be_measured, noise_of, rms
from tfarm.fitting.intervals import BetterError, Fitted, confidence_intervals
from tfarm.fitting.misses import Miss, Remedy, misses_of, remedies_of
from tfarm.fitting.model import (
    SENSOR_DELAY,
    SENSOR_GAIN,
    FitResponse,
    Problem,
    RingMode,
    free_parameters,
    is_of_chain,
)
from tfarm.fitting.overlay import ResonanceShift, resonance_shifts
from tfarm.fitting.posterior import SUFFIX, Posterior, Repeats, posterior_of, repeats
from tfarm.fitting.ratio import ratio_of
from tfarm.fitting.result_rows import FittedResponse, RunResults
from tfarm.fitting.run_model import fit_run
from tfarm.fitting.run_numbers import with_run_numbers
from tfarm.fitting.runs import DRIVE_GAIN, GAIN_KEY, RigRun, commanded
from tfarm.fitting.solve import (
    FIT_SEED,
    best_solution,
    is_explained,
    nearest_minimum,
    sum_of_squares,
)
from tfarm.loop.plane import gain_map
from tfarm.records import frozen
from tfarm.response import transfer
from tfarm.schema import Quantity
from tfarm.stopping import Progress


@frozen(kw_only=True)
class Fit(RunResults):
    """The best point of the search with intervals: an arm fitted to measured responses.

    `parameters` are the free numbers with their intervals, `not_determined` the combinations that the data leave open;
    `chi_squared` over `freedom` is about 1 where the arm and the noise explain all.
    """

    arm: Arm
    before: Arm
    parameters: Annotated[
        tuple[Fitted, ...], Quantity("fitted numbers", help="free numbers with their confidence intervals")
    ]
    not_determined: Annotated[
        tuple[str, ...],
        Quantity("not identifiable", help="numbers, or combinations of them, that the data leave open"),
    ]
    interval_by: Annotated[
        str, Quantity("intervals by", help="profile likelihood, or covariance of the linearised residuals")
    ]
    level: Annotated[float, Quantity(help="probability that an interval holds the true value")] = CONFIDENCE

    @property
    def arm_name(self) -> Annotated[str, Quantity("arm", help="arm at which the fit starts")]:
        """The arm that the fit began with."""
        return self.before.name

    def assumptions(self, number: int = 0) -> tuple[str, ...]:
        """Return the assumptions of one of its arms."""
        family = (self.problem.family, *self.problem.others)[number]
        runs = [each.run for each in self.problem.runs if each.arm == number]
        return assumptions_of(
            family, self.parameters, self.in_words, self.responses, runs, self.not_determined
        )

    @cached_property
    def arms(self) -> tuple[Arm, ...]:
        """All arms of the fit at the fitted numbers, the first as `arm`."""
        found = [self.arm]
        for number, arm in enumerate(self.problem.arms(self.point)[1:], start=1):
            words = self.assumptions(number)
            found.append(replace(arm, name=f"{arm.name}-fitted", assumptions=words))
        return tuple(found)

    @property
    def arm_table(
        self,
    ) -> Annotated[dict[str, Any], Quantity(key="arm", help="fitted arm as its TOML file has it")]:
        """The fitted arm as its file has it."""
        return tomllib.loads(to_toml(self.arm))

    @property
    def finding(self) -> str:
        """The numbers, and chi-squared."""
        numbers = ", ".join(f"{each.label} = {each.value:.6g}" for each in self.parameters)
        return f"{numbers}; chi-squared {self.chi_squared:.4g} of {self.freedom}"

    @property
    def responses(self) -> tuple[Measured, ...]:
        """The measured responses."""
        return tuple(each.data for each in self.problem.responses)

    @property
    def curves(self) -> Iterator[tuple[Real, Complex, Complex]]:
        """Frequencies [rad/s] of each measured response, with its values at the start and at the fitted numbers."""
        for number, one in enumerate(self.responses):
            omega = np.unique(np.r_[np.geomspace(*one.band, 1200), one.omega])
            problem = self.problem.at(number, omega)
            yield omega, problem.compute(0 * self.point)[0], problem.compute(self.point)[0]

    @property
    def response_list(
        self,
    ) -> Annotated[
        list[FittedResponse],
        Quantity("responses", key="responses", help="measured responses with their noise and residuals"),
    ]:
        """A row a response."""
        rows = []
        for one, residuals in zip(self.problem.responses, self.parts, strict=False):
            of = one.data
            names = (of.name, of.label, of.unit, of.source, of.digest)
            chi_squared = float(residuals @ residuals)
            rows.append(FittedResponse(*names, of.points, *of.range_hz, one.noise.source, chi_squared))
        return rows

    @cached_property
    def resonances(
        self,
    ) -> Annotated[
        list[ResonanceShift],
        Quantity("resonances", help="measured peaks with the poles of the arm before and after the fit"),
    ]:
        """A row a measured peak."""
        return resonance_shifts(self.before, self.arm, self.problem.responses)

    @property
    def unexplained(
        self,
    ) -> Annotated[
        list[float],
        Quantity(
            "peaks far from every pole of the arm [Hz]",
            key="unexplained_peaks_hz",
            help="measured peaks that the fitted arm does not have",
        ),
    ]:
        """Measured peaks that the fitted arm does not have."""
        return [row.measured for row in self.resonances if row.after is None]

    @cached_property
    def posterior(self) -> Posterior:
        """The normal distribution of the arm's fitted numbers."""
        return posterior_of(self, self.parameters, self.not_determined, self.arm.name)

    @cached_property
    def records(
        self,
    ) -> Annotated[
        Repeats | None,
        Quantity("scatter between records", help="numbers fitted to each record of one response alone"),
    ]:
        """The scatter between the records of one response."""
        return repeats(self, self.parameters)

    @cached_property
    def rms_log_error(
        self,
    ) -> Annotated[
        float | None,
        Quantity("rms of ln(computed/measured)", digits=4, help="root mean square over all complex values"),
    ]:
        """The root mean square of ln(computed/measured), complex, over all values; None where there are none."""
        if not self.responses:
            return None
        pairs = zip(self.problem.compute(self.point), self.responses, strict=True)
        return rms(np.concatenate([np.log(H / each.values)[each.values != 0] for H, each in pairs]))

    @property
    def is_explained(
        self,
    ) -> Annotated[
        bool | None,
        Quantity(
            key="explained",
            help="whether noise alone often gives such a chi-squared; none where its size came from the residuals",
        ),
    ]:
        """Whether noise alone is often so large; None where its size was taken from the residuals."""
        return is_explained(self)

    @cached_property
    def misses(
        self,
    ) -> Annotated[
        tuple[Miss, ...], Quantity("misses", help="responses that the fitted curve misses by a factor")
    ]:
        """The responses that the curve misses."""
        return misses_of(self)

    @cached_property
    def remedies(
        self,
    ) -> Annotated[
        tuple[Remedy, ...],
        Quantity(
            "remedies", help="single changes that were tried on a curve that misses, the most helpful first"
        ),
    ]:
        """The changes tried on a curve that misses; none of one that does not."""
        return remedies_of(self) if self.misses else ()

    @property
    def verdict(
        self,
    ) -> Annotated[
        str,
        Quantity(
            "verdict",
            help="fitted, not converged, misses the data, or fitted although the arm does not explain the data",
        ),
    ]:
        """Whether it converged, whether the curve misses the data, and whether the model is rejected."""
        if not self.converged:
            return "not converged"
        if self.misses:
            return "misses the data"
        if self.is_explained is False:
            return "fitted, but the arm does not explain the data"
        return "fitted"

    @property
    def in_words(
        self,
    ) -> Annotated[
        str,
        Quantity("fit", key="in_words", help="convergence, identified numbers, reduced chi-squared, misses"),
    ]:
        """Convergence, identified numbers, whether the model is rejected, and what is missed."""
        known = sum(each.identified for each in self.parameters)
        share = f"reduced chi-squared = {self.chi_squared / max(self.freedom, 1):.3g}"
        if self.problem.runs and (self.is_explained or not self.has_known_noise):
            white = "white and independent of the input"
            if not self.is_explained:
                white = "no white noise that is independent of the input"
            share = f"residuals are {white} (chance {self.chance_of_noise:.2g})"
        tests = {
            None: "noise estimated from the residuals: the model cannot be tested",
            True: f"model not rejected: {share}",
            False: f"model rejected: {share}; the intervals, which rest on the noise alone, are too narrow",
        }
        start = "" if self.converged else "not converged: these are the best numbers so far; "
        words = f"{start}{known} of {len(self.parameters)} numbers identified; {tests[self.is_explained]}"
        return "; ".join([words, *(each.in_words for each in self.misses)])

    @property
    def advice(
        self,
    ) -> Annotated[
        str | None,
        Quantity("remedy", key="remedy", help="change of the search that helps most where the curve misses"),
    ]:
        """The remedy that helps most, or that none of those tried is enough; None where the curve does not miss."""
        if not self.misses:
            return None
        words = "no gain, delay, sign or bound is enough: free other numbers of the arm, or add a part that it lacks"
        for best in self.remedies[:1]:
            if best.is_enough:
                return best.in_words
            return f"{words}; most helps {best.change}"
        return words


def fit(
    arm: Arm,
    data: Sequence[Measured],
    free: Sequence[str],
    *,
    runs: Sequence[RigRun] = (),
    chain: Chain | None = None,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    rings: Sequence[RingMode] = (),
    profile: bool = True,
    progress: Progress | None = None,
) -> Fit:
    """Return the arm whose free numbers explain the measured responses and runs best.

    `free` are keys of the arm's TOML file, and "gain" and "delay" of each response's sensor.  Of `runs`, sampled
    through `chain` (by default 10 ms, ideal), there are "drive.gain" (torque over a command in any unit), "drive.delay"
    (dead time [s]) and a sensor's "gain:root_moment"; biases, offsets and the motion at the start are free anyway.
    `start`, `bounds` and `priors` (mean, deviation) are by key, in SI units; `rings` are decays of single modes.  With
    `profile` each interval is that of the profile likelihood, otherwise of the covariance; `progress` gets (done,
    total, what).
    Raises ParameterError for a key that is none, and for more numbers than data.
    """
    subject = problem_of(
        arm, data, free, runs=runs, chain=chain, start=start, bounds=bounds, priors=priors, rings=rings
    )
    return fit_of(subject, profile, progress)


def fit_of(subject: Problem, profile: bool, progress: Progress | None) -> Fit:
    """Return the best solution of a problem, with intervals and the arm of it."""
    name = subject.family.arm.name
    found = best_solution(subject)
    # a profile may find a lower sum of squares than the search did, a few times
    for _ in range(4):
        try:
            fitted, unknown = confidence_intervals(found, profile=profile, progress=progress)
            break
        except BetterError as better:
            (there,) = better.args
            pairs = zip(found.problem.parameters, there.problem.parameters, there.point.tolist(), strict=True)
            point = np.array([own.coordinate(each.value(x)) for own, each, x in pairs])
            found = replace(nearest_minimum(found.problem, point), starts=found.starts)
    else:
        # one valley after another: no end of it
        found = replace(found, converged=False)
        fitted, unknown = confidence_intervals(found, profile=False)
    fit = Fit(
        **{each.name: getattr(found, each.name) for each in fields(found)},
        arm=replace(found.problem.arm(found.point), name=f"{name}-fitted"),
        before=subject.arm(np.zeros(found.point.size)),
        parameters=fitted,
        not_determined=unknown,
        interval_by="profile likelihood" if profile else "covariance",
    )
    return replace(fit, arm=replace(fit.arm, assumptions=fit.assumptions()))


def renamed(given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return numbers by key, that of the drive's gain under the key which the arm has it by, alone or before a name."""
    found = {}
    for key, value in (given or {}).items():
        plain, colon, name = key.partition(":")
        found[GAIN_KEY + colon + name if plain == DRIVE_GAIN else key] = value
    return found


def problem_of(
    arm: Arm,
    data: Any,
    free: Any,
    *,
    runs: Sequence[RigRun] = (),
    chain: Chain | None = None,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    rings: Sequence[RingMode] = (),
) -> Problem:
    """Return the search of a fit: the arm's numbers, then the sensors' own, one of a kind for each response.

    Raises ParameterError as `fit` does.
    """
    must_be_arm(arm)
    free = [str(key) for key in free]
    for key in free:
        require(free.count(key) == 1, "free", key, "is named twice; once is enough")
    if DRIVE_GAIN in free:
        arm, runs = commanded(arm, runs)
    wanted, start, bounds, priors = (renamed(each) for each in (dict.fromkeys(free), start, bounds, priors))
    free = [*wanted]
    data = tuple(data) if isinstance(data, Iterable) and not isinstance(data, str) else (data,)
    for each in data:
        must_be_measured(each)
    remedy = "give at least one measured response, a run, or a decay (--mode)"
    require(data or rings or runs, "data", 0, remedy)
    keys = [key for key in free if not is_of_chain(key)]
    given = [
        {key: value for key, value in each.items() if not is_of_chain(key)}
        for each in (start, bounds, priors)
    ]
    family, numbers = free_parameters(arm, keys, start=given[0], bounds=given[1], priors=given[2])
    for each in data:
        ratio_of(arm, each)
    responses = tuple(FitResponse(each, noise_of(each)) for each in data)
    for key in (SENSOR_GAIN, SENSOR_DELAY):
        remedy = "is of the sensor of a response (--data); of a run there are gain:SIGNAL and drive.delay"
        require(responses or key not in free, "free", key, remedy)
    of_runs = tuple(fit_run(arm, each, chain or Chain()) for each in runs)
    subject = Problem(family, numbers, responses, tuple(rings), of_runs).with_sensors(free)
    subject = with_run_numbers(subject, free, start, bounds, priors)
    count = len(subject.parameters)
    require(count, "free", "nothing", "name what is free, such as link.youngs_modulus")
    size = subject.residuals(np.zeros(count)).size
    require(size >= count, "free", count, f"{size} numbers were measured; leave some out")
    return subject


# that a report draws
ARMS = 40


def arms_drawn(fit: Fit, count: int) -> tuple[Arm, ...]:
    """Return arms drawn from the posterior that explain the data as well as the best one does, but for the noise.

    Numbers of sensors follow by the linearised residuals.  Raises ConvergenceError where the curve misses the
    data, or the sum of squares is so far from a parabola that draws of one are none of it.
    """
    own = fit.problem.of_the_arm
    if fit.misses:
        raise ConvergenceError("the fitted curve misses the data", [], 0)
    J, of_the_sensors = np.split(fit.jacobian, [len(own)], axis=1)
    of_sensors = -np.linalg.pinv(of_the_sensors) @ J
    # ten draws for each arm wanted, at most
    normal = np.random.default_rng(FIT_SEED).standard_normal((10 * count, len(own)))
    # of draws of a normal distribution: one whose sum of squares is larger is none of them
    # the quantile of chi squared
    most = fit.chi_squared + 2.0 * gammaincinv(len(own) / 2, 0.999)
    kept: list[Arm] = []
    for values in fit.posterior.with_all_determined.draws({}, normal).tolist():
        x = (
            np.array([each.coordinate(value) for each, value in zip(own, values, strict=True)])
            - fit.point[: len(own)]
        )
        point = fit.problem.inside(fit.point + np.r_[x, of_sensors @ x])
        if sum_of_squares(fit.problem, point) <= most:
            kept.append(fit.problem.arm(point))
        if len(kept) == count:
            return tuple(kept)
    words = f"only {len(kept)} of {len(normal)} arms drawn explain the data: their likelihood is not normal"
    raise ConvergenceError(words, kept, len(kept))


class ResponseBand(NamedTuple):
    """Magnitudes of a response at `omega` [rad/s]: of the arm that fits best, least and largest of possible ones."""

    omega: Real
    best: Real
    low: Real
    high: Real


def response_band(fit: Fit, arms: Sequence[Arm], output: str) -> ResponseBand:
    """Return the band of a response over these arms, in the range of all measurements."""
    bands = np.array([each.band for each in fit.responses])
    # about one frequency to a pixel
    omega = np.geomspace(bands.min(), bands.max(), 800)
    best, *others = (abs(transfer(each, output)(1j * omega)) for each in (fit.arm, *arms))
    return ResponseBand(omega, best, np.min(others, axis=0), np.max(others, axis=0))


class ShareOfArms(NamedTuple):
    """The share (up, across) of arms that each pair of gains stabilises in continuous time."""

    across: Real
    up: Real
    share: Real


def stable_share(arms: Sequence[Arm], ranges: Sequence[tuple[float, float]]) -> ShareOfArms:
    """Return the share of these arms over the `ranges` of both gains."""
    across, up = (np.linspace(*ends, 60) for ends in ranges)
    return ShareOfArms(across, up, np.mean([gain_map(arm, across, up).unstable == 0 for arm in arms], axis=0))


def save_fit(fit: Fit, path: Path) -> None:
    """Write the fitted arm with the chain of its runs, and its posterior to a file of the same name.

    Only the arm where that is a stream.  Other arms of the fit have files of their names in its folder.
    """
    files = [path, *(path.with_name(f"{each.name}{path.suffix}") for each in fit.arms[1:])]
    families = (fit.problem.family, *fit.problem.others)
    for file, family, arm in zip(files, families, fit.arms, strict=True):
        posterior = fit.posterior.of_arm(family.arm.name, arm.name)
        write_file(file, file_text(arm, fit.chain).encode(), key="--save")
        if file.is_file() and not is_standard_output(file) and posterior.numbers:
            content = f"{posterior.model_dump_json(indent=1)}\n".encode()
            write_file(file.with_name(f"{file.stem}{SUFFIX}"), content, key="--save")
