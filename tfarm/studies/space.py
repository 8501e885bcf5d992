"""Values over which a study varies an arm and its loop: distributions, grids, lists of rows, the posterior of a fit.

Row n depends on the seed and on n alone: its uniform numbers are those of the counter-based generator Philox (Salmon et
al., Parallel random numbers: as easy as 1, 2, 3, 2011) at counter n, and each distribution is applied by its inverse.
So a row is the same for any number of workers and in any order.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
import scipy  # whose statistics take half a second to load, and do so where they are used

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.checks import number
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arm.writing import KeyedArms, numbers_of
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, must_be_known, naming, require
from tfarm.fitting.posterior import Posterior
from tfarm.records import record
from tfarm.tuner.tuning import NUMBERS, NUMBERS_OF_LEARNING
from tfarm.tuner.tuning import Plan as TunerPlan

from .extras import parquet_rows

LAW, TUNER = "law.", "tuner."  # prefixes of the numbers of the controller and of the tuner
MOST_ROWS = 10_000_000  # of one study
MOST_SEED = 2**63
TUNER_NUMBERS = (*NUMBERS, *NUMBERS_OF_LEARNING)
LEAST_UNIFORM = 2.0**-54  # in the place of 0, where the inverse of a normal distribution is infinite
ENDS = LEAST_UNIFORM, 1 - 2.0**-53  # least and largest uniform number
PLAIN_NUMBER = re.compile(r" *[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)? *", re.ASCII)
FORMS: dict[str, tuple[str, Callable[..., Any]]] = {  # kind of a distribution: its numbers in words, and SciPy's
    "uniform": ("LOW, HIGH", lambda low, high: low < high and scipy.stats.uniform(low, high - low)),
    "loguniform": ("LOW, HIGH, above 0", lambda low, high: 0 < low < high and scipy.stats.loguniform(low, high)),
    "normal": ("MEAN, DEVIATION", lambda mean, deviation: deviation > 0 and scipy.stats.norm(mean, deviation)),
    "lognormal": (
        "MEDIAN, DEVIATION of ln",
        lambda median, s: min(median, s) > 0 and scipy.stats.lognorm(s, scale=median),
    ),
}
GRIDS: dict[str, tuple[str, Callable[..., Any]]] = {
    "grid": ("LOW, HIGH, COUNT", lambda low, high, count:
             low < high and count % 1 == 0 < count <= MOST_ROWS and np.linspace(low, high, int(count)).tolist()),
    "values": ("at least one number", lambda *values: values),
}  # fmt: skip
KINDS = {**FORMS, **GRIDS}


class Distribution(NamedTuple):
    """A distribution, or a grid, of one number by its kind and its parameters."""

    kind: str
    numbers: tuple[float, ...]

    @property
    def frozen(self) -> Any:
        """The distribution of SciPy, or the points of a grid."""
        return KINDS[self.kind][1](*self.numbers)


class Subject(NamedTuple):
    """One arm of a study with its controller, its sampled chain, and numbers and plan of the tuner."""

    arm: Arm
    law: AnyLaw
    chain: Chain
    tuner: dict[str, float]
    plan: TunerPlan | None = None


@dataclass(frozen=True, kw_only=True)
@record
class Space:
    """Numbers that a study varies; `draws` of the distributions, each with every point of the grid.

    `listed` are columns and number of the rows of a list, in whose place no draws are counted.
    """

    distributions: dict[str, Distribution]
    grids: dict[str, tuple[float, ...]]
    posterior: Posterior | None = None
    listed: tuple[tuple[str, ...], int] = ((), 0)
    draws: int = 1
    seed: int = 0

    @property
    def drawn(self) -> tuple[str, ...]:
        """Keys of distributions, then those of the posterior."""
        own = tuple(self.distributions)
        return own if self.posterior is None else (*own, *(key for key in self.posterior.keys if key not in own))

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the varied numbers, in the order of the columns."""
        return (*self.listed[0], *self.drawn, *self.grids)

    @property
    def points(self) -> int:
        """Number of points of the grid."""
        return math.prod(map(len, self.grids.values()))

    @property
    def count(self) -> int:
        """Number of rows."""
        return (self.listed[1] or self.draws) * self.points

    @property
    def is_independent(self) -> bool:
        """Whether the rows are independent draws: confidence needs that."""
        return bool(self.drawn) and not (self.grids or self.listed[0])

    @property
    def is_searchable(self) -> bool:
        """Whether every number has a distribution of its own."""
        return self.is_independent and self.posterior is None

    def rows(self, first: int, last: int, listed: Real | None) -> Real:
        """Return rows first to last - 1 (rows, keys); `listed` are those of the list behind them."""
        draw, point = np.divmod(np.arange(first, last), self.points)
        uniform = np.array([self.uniform(n) for n in range(draw[0], draw[-1] + 1)])
        own = np.empty((len(uniform), 0)) if listed is None else listed
        drawn, columns = np.hstack([own, self.values(uniform)])[draw - draw[0]], list[Real]()
        for values in reversed(self.grids.values()):  # the last one varies fastest
            point, place = np.divmod(point, len(values))
            columns.insert(0, np.array(values)[place])
        return np.column_stack([drawn, *columns])

    def values(self, uniform: Real) -> Real:
        """Return the drawn values (rows, drawn) of uniform numbers (rows, drawn)."""
        fixed = {key: each.frozen.ppf(uniform[:, n]) for n, (key, each) in enumerate(self.distributions.items())}
        found = np.array([*fixed.values()]).reshape(len(fixed), len(uniform)).T
        if self.posterior is None:
            return found
        return np.hstack([found, self.posterior.draws(fixed, scipy.stats.norm.ppf(uniform[:, len(fixed) :]))])

    def uniform(self, n: int) -> Real:
        """Return the uniform numbers (drawn,) of draw n, in (0, 1)."""
        generator = np.random.Generator(np.random.Philox(key=self.seed, counter=n << 64))
        return np.maximum(generator.random(len(self.drawn)), LEAST_UNIFORM)


def space_of(
    over: Mapping[str, Mapping[str, Any]], *, draws: int, seed: int, posterior: Posterior | None, listed: Any
) -> Space:
    """Return the space of a declared study.  Raises ParameterError, naming the key."""
    made = {key: _distribution(f"over.{key}", entry) for key, entry in over.items()}
    distributions = {key: each for key, each in made.items() if each.kind in FORMS}
    grids = {key: tuple(each.frozen) for key, each in made.items() if each.kind in GRIDS}
    found = Space(distributions=distributions, grids=grids, posterior=posterior, listed=listed, draws=draws, seed=seed)
    remedy = "nothing is varied: give --over KEY=uniform:LOW,HIGH, a list or a posterior"
    require(found.keys, "over", dict(over), remedy)
    require(not (grids and found.listed[0]), "over", dict(over), "a list has every value itself: no grid with it")
    for key in found.keys:
        require(found.keys.count(key) == 1, "over", key, "is varied twice; once is enough")
    if posterior is not None:
        posterior.must_be_determined(tuple(distributions))
    found = found if found.drawn else replace(found, draws=1)
    remedy = f"at most {MOST_ROWS:,} rows: fewer draws, or a coarser grid"
    require(0 < found.count <= MOST_ROWS, "rows", found.count, remedy)
    return found


def _distribution(place: str, entry: Any) -> Distribution:
    """Return the checked distribution or grid of an entry such as {"uniform": [0.0, 1.0]}."""
    remedy = f'give one of {", ".join([*FORMS, *GRIDS])} with its numbers, such as {{"uniform": [0.0, 1.0]}}'
    require(isinstance(entry, Mapping) and len(entry) == 1, place, entry, remedy)
    ((kind, numbers),) = entry.items()
    must_be_known(place, kind, [*FORMS, *GRIDS])
    words, make = KINDS[kind]
    remedy = f"{kind} needs finite numbers in order: {words}"
    require(isinstance(numbers, Sequence | np.ndarray), place, numbers, remedy)
    found = Distribution(kind, tuple(number(place, each, remedy) for each in numbers))
    try:
        with np.errstate(all="ignore"):
            made = all(map(math.isfinite, found.numbers)) and make(*found.numbers)
            is_finite = made and np.isfinite(made.ppf(ENDS) if kind in FORMS else made).all()
    except TypeError:  # another count of numbers
        is_finite = False
    require(is_finite, place, numbers, remedy)
    return found


class Subjects:
    """Arms and loops with other values of some numbers, by their keys.

    Keys are those of an arm's file, "sampling.delay_samples" and others of its chain, "law.K1" and other numbers of the
    controller (`Law.having`), and "tuner.seed" and others of the tuner.  Raises ParameterError for an unknown one.
    """

    def __init__(self, arm: Arm, law: AnyLaw, chain: Chain, keys: Sequence[str], plan: TunerPlan | None = None) -> None:
        self.law, self.chain, self.keys, self.plan = law, chain, keys, plan
        numbers = {
            f"{table.name}.{each.name}": (table.name, each.name)
            for table in fields(chain) if table.name != "period_from"
            for each in fields(getattr(chain, table.name)) if float in (each.type, *get_args(each.type))
        }  # fmt: skip
        self._of_chain = {key: numbers[key] for key in keys if key in numbers}
        of_law, of_tuner = ([key.removeprefix(name) for key in keys if key.startswith(name)] for name in (LAW, TUNER))
        for name in of_law:
            law.having(name, 1.0)
        signals = [OUTPUT_OF.get(name, name).removesuffix(".gain") for name in of_law]
        require(len(set(signals)) == len(signals), "over", of_law, "two keys are one number of the controller")
        for name in of_tuner:
            must_be_known("tuner", name, TUNER_NUMBERS)
        own = [key for key in keys if not key.startswith((LAW, TUNER)) and key not in numbers]
        for key in own:
            must_be_known("over", key, [*numbers_of(arm), *numbers, f"{LAW}NUMBER", f"{TUNER}NUMBER"])
        self._arms = KeyedArms(arm, own, "over")

    def at(self, row: Sequence[float]) -> Subject:
        """Return the arm and loop of a row.  Raises ParameterError for an illegal value."""
        values, chain, law = dict(zip(self.keys, row, strict=True)), self.chain, self.law
        for key, (table, name) in self._of_chain.items():
            chain = replace(chain, **{table: replace(getattr(chain, table), **{name: values[key]})})
        for key in self.keys:
            law = law.having(key.removeprefix(LAW), values[key]) if key.startswith(LAW) else law
        own = {key: values[key] for key in self._arms.keys}
        tuner = {key.removeprefix(TUNER): value for key, value in values.items() if key.startswith(TUNER)}
        return Subject(self._arms.at(own) if own else self._arms.arm, law, chain, tuner, self.plan)


# ------------------------------------------------------------------------------------------------------------ lists


@dataclass(frozen=True)
class Listing:
    """Rows of a CSV or Parquet file, read as they are needed."""

    path: Path

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns.  Raises ParameterError for a doubled one, and for one without a name."""
        names = tuple(next(iter(self._lines()), ()))
        for name in names:
            remedy = "each column has a key of its own as its name"
            require(name and names.count(name) == 1, "column", name, remedy, str(self.path))
        return names

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file."""
        with self.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    @cached_property
    def size(self) -> int:
        """Number of rows, each of which was checked.  Raises ParameterError, naming row and column."""
        found = sum(1 for _ in self.rows())
        require(found, "list", 0, "has no rows", str(self.path))
        return found

    def rows(self) -> Iterator[list[float]]:
        """Yield the rows; a value other than a finite number raises ParameterError."""
        names = self.columns
        for n, row in enumerate(islice(self._lines(), 1, None)):  # from 0, as in the results
            with naming(self.path):
                require(len(row) == len(names), f"row {n}", len(row), f"{len(names)} values, one a column")
                yield [_cell(value, n, name) for name, value in zip(names, row, strict=True)]

    def blocks(self, ends: Sequence[tuple[int, int]]) -> Iterator[Real]:
        """Yield the rows of each range (first, last), which ascend."""
        lines, at = self.rows(), 0
        for first, last in ends:
            yield np.array(list(islice(lines, first - at, last - at)))
            at = last

    def _lines(self) -> Iterator[Sequence[Any]]:
        """Yield the names, then the cells of each row."""
        if self.path.suffix == ".parquet":
            yield from parquet_rows(self.path)
            return
        try:
            with self.path.open(newline="", encoding="utf-8-sig") as file:
                yield from csv.reader(file, strict=True)
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            remedy = f"cannot be read ({error}); give a CSV or Parquet file with a column a key"
            raise ParameterError(key="list", value=str(self.path), remedy=remedy) from None


def _cell(value: Any, row: int, column: str) -> float:
    """Return a finite number of a cell.  Raises ParameterError, naming row and column."""
    is_finite = PLAIN_NUMBER.fullmatch(str(value)) and math.isfinite(float(value))
    require(is_finite, f"row {row}, column {column}", value, "every cell is a finite number")
    return float(value)
