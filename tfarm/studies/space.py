"""Values over which a study varies an arm and its loop: distributions, grids, lists of rows, the posterior of a fit.

Row n depends on the seed and on n alone: its uniform numbers are those of the counter-based generator Philox (Salmon et
al., Parallel random numbers: as easy as 1, 2, 3, 2011) at counter n, and each distribution is applied by its inverse.
So a row is the same for any number of workers and in any order.
"""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import islice, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy  # whose statistics load when they are used: half a second

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.errors import ParameterError, must_be_known, naming, require
from tfarm.fitting.posterior import Posterior
from tfarm.records import record
from tfarm.tuner import Plan as TunerPlan

from .extras import parquet_rows

LAW, TUNER = "law.", "tuner."  # prefixes of the numbers of the controller and of the tuner
MOST_ROWS = 10_000_000  # of one study
MOST_SEED = 2**63
BATCH = 10_000  # rows of a list that are read at a time
FORMS: dict[str, tuple[str, Callable[..., Any]]] = {  # kind of a distribution: its numbers in words, and SciPy's
    "uniform": ("LOW, HIGH", lambda low, high: scipy.stats.uniform(low, high - low)),
    "loguniform": ("LOW, HIGH", lambda low, high: scipy.stats.loguniform(low, high)),
    "normal": ("MEAN, DEVIATION", lambda mean, deviation: scipy.stats.norm(mean, deviation)),
    "lognormal": ("MEDIAN, DEVIATION of the natural logarithm", lambda median, s: scipy.stats.lognorm(s, scale=median)),
}
GRIDS: dict[str, tuple[str, Callable[..., Sequence[float]]]] = {
    "grid": ("LOW, HIGH, COUNT", lambda low, high, count: np.linspace(low, high, int(count)).tolist()),
    "values": ("at least one number", lambda *values: values),
}


class Distribution(NamedTuple):
    """A distribution of one number by its kind and its parameters."""

    kind: str
    numbers: tuple[float, ...]

    @property
    def frozen(self) -> Any:
        """The distribution of SciPy."""
        return FORMS[self.kind][1](*self.numbers)


class Subject(NamedTuple):
    """One arm of a study with its controller, its sampled chain, and plan and numbers of the tuner."""

    arm: Arm
    law: AnyLaw
    chain: Chain
    plan: TunerPlan | None
    tuner: dict[str, float]


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

    def rows(self, first: int, last: int, listed: Real | None) -> Real:
        """Return rows first to last - 1 (rows, keys); `listed` are those of the list behind them."""
        draw, point = np.divmod(np.arange(first, last), self.points)
        uniform = np.array([self.uniform(n) for n in range(draw[0], draw[-1] + 1)])[draw - draw[0]]
        grid = np.array(list(product(*self.grids.values())))[point]
        own = np.empty((last - first, 0)) if listed is None else listed[draw - draw[0]]
        return np.hstack([own, self.values(uniform), grid])

    def values(self, uniform: Real) -> Real:
        """Return the drawn values (rows, drawn) of uniform numbers (rows, drawn)."""
        own = len(self.distributions)
        frozen = [each.frozen for each in self.distributions.values()]
        columns = [each.ppf(uniform[:, n]) for n, each in enumerate(frozen)]
        found = np.array(columns).T.reshape(len(uniform), own)
        if self.posterior is None:
            return found
        fixed = dict(zip(self.distributions, found.T, strict=True))
        rest = self.posterior.draws(fixed, scipy.stats.norm.ppf(uniform[:, own:]))
        return np.hstack([found, rest])

    def uniform(self, n: int) -> Real:
        """Return the uniform numbers (drawn,) of draw n."""
        generator = np.random.Generator(np.random.Philox(key=self.seed, counter=n << 64))
        return 1.0 - generator.random(len(self.drawn))  # above 0, where a normal distribution has its end


def space_of(
    over: Mapping[str, Mapping[str, Any]], *, draws: int, seed: int, posterior: Posterior | None, listed: Any
) -> Space:
    """Return the space of a declared study.  Raises ParameterError, naming the key."""
    distributions, grids = {}, {}
    for key, entry in over.items():
        known = [*FORMS, *GRIDS]
        remedy = f'give one of {", ".join(known)} with its numbers, such as {{"uniform": [0.0, 1.0]}}'
        require(isinstance(entry, Mapping) and len(entry) == 1, f"over.{key}", entry, remedy)
        ((kind, numbers),) = entry.items()
        must_be_known(f"over.{key}", kind, known)
        words, make = {**FORMS, **GRIDS}[kind]
        remedy = f"{kind} needs finite numbers in order: {words}"
        plain = [float(each) for each in numbers if type(each) in (int, float) and math.isfinite(each)]
        require(len(plain) == len(numbers), f"over.{key}", numbers, remedy)
        try:
            made = make(*plain)
            is_legal = len(made) if kind in GRIDS else bool(np.all(np.isfinite(made.ppf([1e-9, 1 - 1e-9]))))
        except (TypeError, ValueError):
            is_legal = False
        is_ordered = kind not in ("uniform", "loguniform", "grid") or plain[0] < plain[1]
        require(is_legal and is_ordered, f"over.{key}", numbers, remedy)
        if kind in GRIDS:
            grids[key] = tuple(map(float, made))
        else:
            distributions[key] = Distribution(kind, tuple(plain))
    found = Space(distributions=distributions, grids=grids, posterior=posterior, listed=listed, draws=draws, seed=seed)
    require(
        found.keys, "over", dict(over), "nothing is varied: give --over KEY=uniform:LOW,HIGH, a list or a posterior"
    )
    require(not (grids and found.listed[0]), "over", dict(over), "a list has every value itself: no grid with it")
    if not found.drawn:
        found = replace(found, draws=1)
    for key in found.keys:
        require(found.keys.count(key) == 1, "over", key, "is varied twice; once is enough")
    if posterior is not None:
        posterior.must_be_determined(tuple(distributions))
    remedy = f"at most {MOST_ROWS:,} rows: fewer draws, or a coarser grid"
    require(0 < found.count <= MOST_ROWS, "rows", found.count, remedy)
    return found


class Subjects:
    """Arms and loops with other values of some numbers, by their keys.

    Keys are those of an arm's file, "sampling.delay_samples" and others of its chain, "law.K1" and other numbers of the
    controller (`Law.having`), and "tuner.seed" and others of the tuner.  Raises ParameterError for an unknown one.
    """

    def __init__(
        self, arm: Arm, law: AnyLaw, chain: Chain, keys: Sequence[str], tuner: TunerPlan | None = None
    ) -> None:
        self.law, self.chain, self.keys, self.tuner = law, chain, keys, tuner
        numbers = {
            f"{table.name}.{each.name}": (table.name, each.name)
            for table in fields(chain) if table.name != "period_from"
            for each in fields(getattr(chain, table.name)) if "float" in str(each.type)
        }  # fmt: skip
        self._of_chain = {key: numbers[key] for key in keys if key in numbers}
        own = [key for key in keys if not key.startswith((LAW, TUNER)) and key not in numbers]
        try:
            self._arms = KeyedArms(arm, own, "over")
        except ParameterError as error:
            remedy = f"{error.remedy}; of the sampled loop: {', '.join(numbers)}; of the controller: {LAW}NUMBER"
            raise ParameterError(key=error.key, value=error.value, remedy=remedy) from None

    def at(self, row: Sequence[float]) -> Subject:
        """Return the arm and loop of a row.  Raises ParameterError for an illegal value."""
        values = dict(zip(self.keys, row, strict=True))
        chain, law = self.chain, self.law
        for key, (table, name) in self._of_chain.items():
            chain = replace(chain, **{table: replace(getattr(chain, table), **{name: values[key]})})
        for key in self.keys:
            law = law.having(key.removeprefix(LAW), values[key]) if key.startswith(LAW) else law
        own = {key: values[key] for key in self._arms.keys}
        tuner = {key.removeprefix(TUNER): value for key, value in values.items() if key.startswith(TUNER)}
        return Subject(self._arms.at(own) if own else self._arms.arm, law, chain, self.tuner, tuner)


# ------------------------------------------------------------------------------------------------------------ lists


@dataclass(frozen=True)
class Listing:
    """Rows of a CSV or Parquet file, read as they are needed."""

    path: Path

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns.  Raises ParameterError for a doubled one."""
        names = next(iter(self._lines()), ())
        for name in names:
            require(name, "column", name, "a column without a name", str(self.path))
            require(names.count(name) == 1, "column", name, "the list has this column twice", str(self.path))
        return tuple(names)

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
        for n, row in enumerate(islice(self._lines(), 1, None), start=1):
            with naming(self.path):
                require(len(row) == len(names), f"row {n}", len(row), f"{len(names)} values, one a column")
                yield [_number(value, n, name) for name, value in zip(names, row, strict=True)]

    def blocks(self, ends: Sequence[tuple[int, int]]) -> Iterator[Real]:
        """Yield the rows of each range (first, last), which ascend without a gap."""
        lines, at = self.rows(), 0
        for first, last in ends:
            block = list(islice(lines, first - at, last - at))
            yield np.array(block)
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


def _number(value: Any, row: int, column: str) -> float:
    """Return a finite number of a cell.  Raises ParameterError, naming row and column."""
    try:
        found = float(value) if isinstance(value, str | int | float) and "_" not in str(value) else math.nan
    except ValueError:
        found = math.nan
    require(math.isfinite(found), f"row {row}, column {column}", value, "every cell is a finite number")
    return found
