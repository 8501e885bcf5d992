"""Posterior of a fit: the normal distribution of the fitted numbers about the best ones, as a file for studies.

The coordinates are those of the search: ln p of a number that cannot be negative, else p over its size.  With J the
residuals over their deviations differentiated by the coordinates, the information is J'J, and the covariance is its
inverse in the directions that the data determine.  Gains and delays of sensors are marginalised.  The intervals are
those of the fit, by profiles where these were asked for: they show where the distribution is no normal one.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from tfarm.arm.schema import StrictTable
from tfarm.arrays import Real
from tfarm.errors import ParameterError, require
from tfarm.files import read_file, write_file
from tfarm.records import record

from .solve import OPEN_DEVIATION, Fitted, Solution, open_axes

FORMAT = "tfarm posterior 1"
MOST_BYTES = 1024 * 1024
SUFFIX = ".posterior.json"


class PosteriorNumber(StrictTable):
    """A fitted number in its file: best value, interval, and size of a unit of its coordinate (0: ln of the number)."""

    key: str
    value: float
    low: float | None
    high: float | None
    size: float


class PosteriorFile(StrictTable):
    """The file of a posterior."""

    format: str
    arm: str
    numbers: list[PosteriorNumber]
    covariance: list[list[float]]
    not_determined: list[str]


@dataclass(frozen=True)
@record
class Posterior:
    """Normal distribution of fitted numbers: their `keys`, best values, sizes of coordinates, covariance of these."""

    keys: tuple[str, ...]
    value: Real
    size: Real
    covariance: Real
    intervals: tuple[tuple[float | None, float | None], ...]
    not_determined: tuple[str, ...]

    @property
    def information(self) -> Real:
        """Inverse of the covariance in the determined directions, 0 in the others."""
        return np.asarray(np.linalg.pinv(self.covariance, hermitian=True))

    @property
    def with_all_determined(self) -> Posterior:
        """The posterior with a deviation of `OPEN_DEVIATION` where the data say nothing."""
        weak = np.eye(len(self.keys)) / OPEN_DEVIATION**2
        return replace(
            self, covariance=np.asarray(np.linalg.inv(self.information + weak), dtype=float), not_determined=()
        )

    def must_be_determined(self, ranged: Sequence[str]) -> None:
        """Raise ParameterError, naming a number, unless the data determine all numbers once those are given."""
        rest = [n for n, key in enumerate(self.keys) if key not in ranged]
        sizes, axes = np.linalg.eigh(self.information[np.ix_(rest, rest)]) if rest else (np.ones(1), np.eye(1))
        if sizes[0] < 1.0 / OPEN_DEVIATION**2:
            key = self.keys[rest[int(abs(axes[:, 0]).argmax())]]
            remedy = f"the data do not determine it: give a range of its own, --over {key}=uniform:LOW,HIGH"
            raise ParameterError(key="posterior", value=key, remedy=remedy)

    def draws(self, ranged: Mapping[str, Real], normal: Real) -> Real:
        """Return values (rows, others) of the numbers that are not ranged, given the values (rows,) of those.

        `normal` (rows, others) are independent standard normal numbers.  The conditional distribution of a normal one
        has the information P_oo and the mean -P_oo^-1 P_or x_r.
        """
        known = [n for n, key in enumerate(self.keys) if key in ranged]
        rest = [n for n, key in enumerate(self.keys) if key not in ranged]
        P, x = self.information, np.empty((len(normal), len(known)))
        for column, n in enumerate(known):
            value = np.asarray(ranged[self.keys[n]])
            x[:, column] = (value - self.value[n]) / self.size[n] if self.size[n] else np.log(value / self.value[n])
        root = np.linalg.cholesky(P[np.ix_(rest, rest)])  # unique: independent of the processor
        mean = np.linalg.solve(root, -P[np.ix_(rest, known)] @ x.T)
        away = np.linalg.solve(root.T, mean + normal.T).T
        value, size = self.value[rest], self.size[rest]
        return np.where(size > 0, value + size * away, value * np.exp(np.where(size > 0, 0.0, away)))


def posterior_of(found: Solution, fitted: Sequence[Fitted], not_determined: Sequence[str]) -> Posterior:
    """Return the posterior of a solution, of the arm's own numbers among the fitted ones."""
    own = [n for n, each in enumerate(fitted) if "." in each.key]
    sensors = [n for n in range(len(fitted)) if n not in own]
    J = found.jacobian
    if sensors:  # residuals that no sensor explains
        J = J - J[:, sensors] @ np.linalg.pinv(J[:, sensors]) @ J
    J = J[:, own]
    some = open_axes(J)
    determined = np.eye(len(own)) - some.T @ some
    parameters = found.problem.parameters
    return Posterior(
        keys=tuple(fitted[n].key for n in own),
        value=np.array([fitted[n].value for n in own]),
        size=np.array([0.0 if parameters[n].by_logarithm else parameters[n].size for n in own]),
        covariance=determined @ np.linalg.pinv(J.T @ J, hermitian=True) @ determined,
        intervals=tuple((fitted[n].low, fitted[n].high) for n in own),
        not_determined=tuple(not_determined),
    )


def posterior_path(arm_file: Path) -> Path:
    """Return the file of the posterior that belongs to that of a fitted arm."""
    return arm_file.with_name(f"{arm_file.stem}{SUFFIX}")


def save_posterior(found: Posterior, arm: str, path: Path) -> None:
    """Write a posterior of an arm of that name as JSON.  Raises ParameterError where it cannot be written."""
    rows = zip(found.keys, found.value.tolist(), found.size.tolist(), found.intervals, strict=True)
    numbers = [PosteriorNumber(key=key, value=value, low=ends[0], high=ends[1], size=size)
               for key, value, size, ends in rows]  # fmt: skip
    whole = PosteriorFile(format=FORMAT, arm=arm, numbers=numbers, covariance=found.covariance.tolist(),
                          not_determined=list(found.not_determined))  # fmt: skip
    write_file(path, (json.dumps(whole.model_dump(), indent=1) + "\n").encode(), key="--save")


def load_posterior(path: str | os.PathLike[str]) -> Posterior:
    """Return the posterior of a file.  Raises ParameterError, naming the file, for anything else."""
    data, file = read_file(path, MOST_BYTES, key="posterior", what="a .posterior.json file"), os.fspath(path)
    try:
        found = PosteriorFile.model_validate_json(data)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key = ".".join(map(str, problem["loc"])) or "JSON"
        raise ParameterError(key=key, value=problem["input"], remedy=f"{problem['msg']}; `tfarm fit --save` writes it",
                             file=file) from None  # fmt: skip
    n, covariance = len(found.numbers), np.array(found.covariance, dtype=float, ndmin=2)
    value, size = (np.array([getattr(each, name) for each in found.numbers]) for name in ("value", "size"))
    is_legal = covariance.shape == (n, n) and n > 0 and bool(np.isfinite(covariance).all())
    is_legal = is_legal and np.allclose(covariance, covariance.T) and np.linalg.eigvalsh(covariance)[0] > -1e-9
    require(is_legal, "covariance", covariance.shape, f"a symmetric, non-negative matrix of {n} rows and columns", file)
    is_legal = all(map(math.isfinite, (*value, *size))) and bool((size >= 0).all())
    require(is_legal and found.format == FORMAT, "numbers", found.format, f"finite numbers of a {FORMAT!r}", file)
    ends = tuple((each.low, each.high) for each in found.numbers)
    return Posterior(tuple(each.key for each in found.numbers), value, size, covariance, ends,
                     tuple(found.not_determined))  # fmt: skip
