"""Posterior of a fit: the normal distribution of the fitted numbers about the best ones, as a file for studies.

The coordinates x are those of the search: ln(p/best) of a number p that cannot be negative, else (p - best)/size.  With
J the residuals over their deviations differentiated by x, the information is J'J, and the covariance is its inverse in
the directions that the data determine.  Gains and delays of sensors are marginalised.  The intervals are those of the
fit, by profiles where these were computed: they show where the distribution is not normal.

Of several records of one response there are the numbers by each record, and a bootstrap over them.  The noise within a
record is not all that differs from one sweep to the next: amplitudes, temperatures, the hand that clamped the link.
Drawing whole records anew (Efron 1979) gives intervals that include it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from tfarm.arm.schema import StrictTable, validated_file
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.digits import join_words
from tfarm.errors import require
from tfarm.fitting.data import CONFIDENCE
from tfarm.fitting.intervals import Fitted
from tfarm.fitting.solve import FIT_SEED, OPEN_DEVIATION, Solution, nearest_minimum, principal_axes
from tfarm.records import frozen
from tfarm.schema import Quantity

SUFFIX = ".posterior.json"
# of the largest variance: a smaller one is rounding
NO_VARIANCE = 1e-13


class PosteriorNumber(StrictTable):
    """A fitted number [SI]: best value, 95 % interval, and size of its coordinate (0: that is a logarithm)."""

    model_config = ConfigDict(allow_inf_nan=False)
    key: str
    value: float
    low: float | None
    high: float | None
    size: Annotated[float, Field(ge=0)]


class Posterior(StrictTable):
    """Normal distribution of fitted numbers of an arm, by the covariance (numbers, numbers) of their coordinates."""

    model_config = ConfigDict(allow_inf_nan=False)
    format: Literal["tfarm posterior 1"]
    arm: str
    numbers: list[PosteriorNumber]
    covariance: list[list[float]]
    not_determined: list[str]

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the numbers in the arm's file."""
        return tuple(each.key for each in self.numbers)

    @property
    def matrix(self) -> Real:
        """Covariance as an array (numbers, numbers)."""
        return np.reshape(self.covariance, (len(self.numbers),) * 2)

    @property
    def information(self) -> Real:
        """Inverse of the covariance in the determined directions, 0 in the others."""
        return np.asarray(np.linalg.pinv(self.matrix, NO_VARIANCE, hermitian=True))

    @property
    def with_all_determined(self) -> Posterior:
        """The posterior with a deviation of `OPEN_DEVIATION` where the data say nothing."""
        # by its axes: the identity less information times covariance is rounded by more than the least variance
        sizes, axes = np.linalg.eigh(self.matrix)
        is_open = sizes <= NO_VARIANCE * abs(sizes).max(initial=0.0)
        unknown = axes[:, is_open]
        whole = self.matrix + OPEN_DEVIATION**2 * unknown @ unknown.T
        return self.model_copy(update={"covariance": whole.tolist(), "not_determined": []})

    def of_arm(self, before: str, name: str) -> Posterior:
        """Return the distribution of the numbers of one of several arms, under the keys of its file.

        `before` is the name that the arm had in the fit, `name` that of the fitted one.
        """
        rows = [n for n, key in enumerate(self.keys) if key.partition(":")[2] in ("", before)]
        numbers = [self.numbers[n].model_copy(update={"key": self.keys[n].partition(":")[0]}) for n in rows]
        covariance = self.matrix[np.ix_(rows, rows)].tolist()
        return self.model_copy(update={"arm": name, "numbers": numbers, "covariance": covariance})

    def must_be_determined(self, ranged: Sequence[str]) -> None:
        """Raise ParameterError, naming a number, unless the data determine all numbers once those are given."""
        rest = [n for n, key in enumerate(self.keys) if key not in ranged]
        sizes, axes = np.linalg.eigh(self.information[np.ix_(rest, rest)])
        # 0 or at least 1/OPEN_DEVIATION^2
        for axis in axes.T[sizes < 0.5 / OPEN_DEVIATION**2]:
            key = self.keys[rest[abs(axis).argmax()]]
            require(
                False,
                "posterior",
                key,
                f"the data do not determine it: give a study a range of it, --over {key}=uniform:LOW,HIGH",
            )

    def draws(self, ranged: Mapping[str, Real], normal: Real) -> Real:
        """Return values (rows, others) of the numbers that are not ranged, given the values (rows,) of those.

        `normal` (rows, others) are independent standard normal numbers.  With the information P = L L' of the others o,
        given the coordinates x_r of those ranged, x_o = L'^-1 (normal - L^-1 P_or x_r).
        """
        known = [n for n, key in enumerate(self.keys) if key in ranged]
        rest = [n for n, key in enumerate(self.keys) if key not in ranged]
        P = self.information
        x_r = np.empty((len(known), len(normal)))
        for row, n in zip(x_r, known, strict=True):
            of = self.numbers[n]
            p = ranged[of.key]
            if of.size:
                row[:] = (p - of.value) / of.size
            else:
                row[:] = np.log(np.maximum(p / of.value, LEAST_SIZE))
        # unique: independent of the processor
        L = np.linalg.cholesky(P[np.ix_(rest, rest)])
        x_o = np.linalg.solve(L.T, normal.T - np.linalg.solve(L, P[np.ix_(rest, known)] @ x_r)).T
        value = np.array([self.numbers[n].value for n in rest])
        size = np.array([self.numbers[n].size for n in rest])
        return np.where(size > 0, value + size * x_o, value * np.exp(x_o))


def posterior_of(
    found: Solution, fitted: Sequence[Fitted], not_determined: Sequence[str], arm: str
) -> Posterior:
    """Return the posterior of a solution, of the arm's own numbers among the fitted ones; `arm` is its name."""
    own = found.problem.of_the_arm
    J, of_sensors = np.split(found.jacobian, [len(own)], axis=1)
    # what has no effect where it is, but would elsewhere, is marginalised, too
    some = fitted[: len(own)]
    is_bounded = np.array([each.deviation is None and each.low is not None for each in some], bool)
    of_sensors = np.c_[of_sensors, J[:, is_bounded]]
    J = np.where(is_bounded, 0.0, J)
    # residuals that no sensor explains
    sizes, axes = principal_axes(J - of_sensors @ (np.linalg.pinv(of_sensors) @ J))
    known = sizes >= 1.0 / OPEN_DEVIATION
    # of a coordinate: covariances of doubles keep no smaller deviation next to `OPEN_DEVIATION`
    spread = axes[known].T * np.maximum(1.0 / sizes[known], 1e-6)
    numbers = [
        PosteriorNumber(key=each.key, value=each.value, low=each.low, high=each.high, size=of.size)
        for each, of in zip(fitted, own, strict=False)
    ]
    return Posterior(
        format="tfarm posterior 1",
        arm=arm,
        numbers=numbers,
        covariance=(spread @ spread.T).tolist(),
        not_determined=list(not_determined),
    )


def load_posterior(path: str | os.PathLike[str]) -> Posterior:
    """Return the posterior of a file.  Raises ParameterError, naming the file, for anything else."""
    found = validated_file(
        Posterior, path, 1 << 20, key="posterior", what=f"a {SUFFIX} file of tfarm fit --save"
    )
    n = len(found.numbers)
    covariance = found.covariance
    is_legal = (
        0 < n == len(covariance)
        and all(len(row) == n for row in covariance)
        and np.allclose(covariance, np.transpose(covariance), rtol=1e-9, atol=0.0)
        and np.linalg.eigvalsh(covariance)[0] >= -NO_VARIANCE * np.trace(covariance)
    )
    remedy = f"give a symmetric, non-negative matrix of {n} rows and columns"
    file = os.fspath(path)
    require(is_legal, "covariance", covariance, remedy, file)
    for each in found.numbers:
        require(
            each.size or each.value > 0, each.key, each.value, "give a positive number, as size is 0", file
        )
    return found


@frozen
class Repeats:
    """The fitted numbers by each record of `response` alone, `each` [SI], and by draws of records.

    `intervals` hold 95 % of the draws, `times_wider` is their standard deviation over that by the noise.
    """

    response: Annotated[str, Quantity("response", help="response of which there are several records")]
    each: Annotated[list[dict[str, float]], Quantity(help="fitted numbers by each record alone")]
    intervals: Annotated[
        dict[str, list[float]],
        Quantity("intervals by records", help="95 % of bootstrap draws of whole records"),
    ]
    times_wider: Annotated[
        dict[str, float],
        Quantity(
            "times wider than by noise",
            help="standard deviation over draws of records, over that by the noise within a record",
        ),
    ]

    @property
    def count(self) -> Annotated[int, Quantity("records", help="number of records of that response")]:
        """The number of records."""
        return len(self.each)

    @property
    def in_words(
        self,
    ) -> Annotated[
        str, Quantity("finding", key="in_words", help="numbers whose scatter exceeds what the noise explains")
    ]:
        """The numbers whose scatter is larger than the noise explains."""
        # a scatter that is 1.5 times that by the noise is named
        larger = [f"{key} {times:.3g} times" for key, times in self.times_wider.items() if times > 1.5]
        if larger:
            return f"larger than the noise explains: {join_words(larger)}"
        return "as the noise explains"


def repeats(fit: Solution, fitted: Sequence[Fitted], draws: int = 40) -> Repeats | None:
    """Return the scatter between the records of the response that there are most of.

    None where there are fewer than three.

    Each least sum over some of the responses begins at that over all; sensors of the others are held, and so is what
    all together do not determine.
    """
    from scipy.stats import bootstrap

    own = fit.problem
    names = [each.data.label for each in own.responses]
    most = max(names, key=names.count, default="")
    records = [each for each in own.responses if each.data.label == most]
    if len(records) < 3:
        return None
    others = [each for each in own.responses if each.data.label != most]
    identified = {n: each for n, each in enumerate(fitted) if each.identified}
    # a key with a colon is of one record's sensor, which others do not know
    known = {n: each for n, each in identified.items() if each.deviation and ":" not in each.key}

    def numbers(chosen: Sequence[int]) -> Real:
        some = (*(records[n] for n in chosen), *others)
        gains = [each.gain for each in some]
        delays = [each.delay for each in some]
        used = identified.keys() & {*gains, *delays, *range(len(own.of_the_arm))}
        held = {n: float(x) for n, x in enumerate(fit.point) if n not in used}
        point = nearest_minimum(replace(own, responses=some), fit.point, held).point
        return np.array([own.value(point, n) for n in known])

    drawn = bootstrap(
        (range(len(records)),),
        numbers,
        n_resamples=draws,
        vectorized=False,
        method="percentile",
        confidence_level=CONFIDENCE,
        rng=FIT_SEED,
    )

    def by_key(values: Real) -> dict[str, Any]:
        return dict(zip([each.key for each in known.values()], values.tolist(), strict=True))

    return Repeats(
        response=most,
        each=[by_key(numbers([n])) for n in range(len(records))],
        intervals=by_key(np.array(drawn.confidence_interval).T),
        times_wider=by_key(drawn.standard_error / np.array([each.deviation for each in known.values()])),
    )
