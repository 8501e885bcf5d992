"""Values over which an ensemble varies an arm and its loop: distributions, grids, lists of rows, a posterior of a fit.

Row n depends on the seed and on n alone: its uniform numbers are those of the counter-based generator Philox (Salmon et
al., Parallel random numbers: as easy as 1, 2, 3, 2011) at counter n, and each distribution is applied by its inverse.
So a row is the same for any number of workers and in any order.
"""

import csv
import io
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import fields, replace
from functools import cached_property, partial
from importlib import import_module
from itertools import islice, repeat
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

# whose statistics take half a second to load, and do so where they are used
import scipy

from tfarm.arm.chain import CHAIN_TABLES
from tfarm.arm.checks import number
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arm.writing import KeyedArms, numbers_of
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.errors import ParameterError, must_be_known, name_file, require
from tfarm.files import open_file
from tfarm.fitting.posterior import Posterior
from tfarm.foreign import read_by_child
from tfarm.records import frozen
from tfarm.tuner import tuning

# of one study
MOST_ROWS = 10_000_000
# of uniform numbers: at 0 and 1 the inverse of a normal distribution is infinite
ENDS = 2.0**-54, 1 - 2.0**-53
# kind of a distribution: its numbers in words, and SciPy's, whose quantiles are NaN for others
FORMS: dict[str, tuple[str, Callable[..., Any]]] = {
    "uniform": ("LOW, HIGH", lambda low, high: scipy.stats.uniform(low, high - low)),
    "loguniform": ("LOW, HIGH, above 0", lambda low, high: scipy.stats.loguniform(low, high)),
    "normal": ("MEAN, DEVIATION", lambda mean, deviation: scipy.stats.norm(mean, deviation)),
    "lognormal": ("MEDIAN, DEVIATION of ln", lambda median, s: scipy.stats.lognorm(s, scale=median)),
}


def grid_points(low: float, high: float, count: float) -> list[float]:
    """Return the points of a grid; none where its ends or their number are none of one."""
    is_grid = low < high and count % 1 == 0 < count <= MOST_ROWS
    return np.linspace(low, high, int(count)).tolist() if is_grid else []


GRIDS: dict[str, tuple[str, Callable[..., Any]]] = {
    "grid": ("LOW, HIGH, COUNT", grid_points),
    "values": ("at least one number", lambda *values: values),
}
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
    """One case of an ensemble, with numbers of the tuner."""

    case: Case
    tuner: dict[str, float]


class Listing(NamedTuple):
    """A CSV or Parquet file with a column a key, whose rows are read as they are needed."""

    path: Path
    columns: tuple[str, ...]
    size: int

    def blocks(self, ends: Sequence[tuple[int, int]]) -> Iterator[Real]:
        """Yield the rows of each range (first, last), which ascend."""
        lines = islice(lines_of(self.path), 1, None)
        at = 0
        for first, last in ends:
            yield np.array(list(islice(lines, first - at, last - at)))
            at = last


@frozen(kw_only=True)
class Space:
    """Numbers that vary in an ensemble; `draws` of the distributions, each with every point of the grid.

    The rows of a list are counted in the place of draws.
    """

    over: dict[str, Distribution]
    posterior: Posterior | None = None
    listing: Listing | None = None
    draws: int = 1
    seed: int = 0

    @property
    def grids(self) -> dict[str, Sequence[float]]:
        """Points of the grid by key."""
        return {key: each.frozen for key, each in self.over.items() if each.kind in GRIDS}

    @property
    def drawn_keys(self) -> tuple[str, ...]:
        """Keys of distributions, then those of the posterior."""
        own = [key for key, each in self.over.items() if each.kind in FORMS]
        fitted = self.posterior.keys if self.posterior else ()
        return tuple(dict.fromkeys([*own, *fitted]))

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the varied numbers, in the order of the columns."""
        return (*(self.listing.columns if self.listing else ()), *self.drawn_keys, *self.grids)

    @cached_property
    def points(self) -> int:
        """Number of points of the grid."""
        return math.prod(map(len, self.grids.values()))

    @cached_property
    def count(self) -> int:
        """Number of rows."""
        rows = 1
        if self.listing:
            rows = self.listing.size
        elif self.drawn_keys:
            rows = self.draws
        return rows * self.points

    @property
    def is_independent(self) -> bool:
        """Whether the rows are independent draws: confidence needs that."""
        return bool(self.drawn_keys) and not (self.grids or self.listing)

    def some_rows(self, numbers: Sequence[int]) -> Real:
        """Return the rows (numbers, keys) of these numbers, which ascend; of independent draws any."""
        ends = [(n, n + 1) for n in numbers]
        blocks = repeat(None) if self.listing is None else self.listing.blocks(ends)
        return np.vstack([self.rows(*end, block) for end, block in zip(ends, blocks, strict=False)])

    def rows(self, first: int, last: int, listed: Real | None) -> Real:
        """Return rows first to last - 1 (rows, keys); `listed` are those of the list behind them."""
        draw, point = np.divmod(np.arange(first, last), self.points)
        uniform = np.array([self.uniform(n) for n in range(draw[0], draw[-1] + 1)])
        own = np.empty((len(uniform), 0)) if listed is None else listed
        grids = [np.array(values) for values in self.grids.values()]
        places = np.unravel_index(point, [each.size for each in grids]) if grids else ()
        columns = [each[place] for each, place in zip(grids, places, strict=True)]
        return np.column_stack([np.hstack([own, self.values(uniform)])[draw - draw[0]], *columns])

    def values(self, uniform: Real) -> Real:
        """Return the drawn values (rows, drawn) of uniform numbers (rows, drawn)."""
        fixed = {
            key: self.over[key].frozen.ppf(uniform[:, n])
            for n, key in enumerate(self.drawn_keys)
            if key in self.over
        }
        found = np.array([*fixed.values()]).reshape(len(fixed), len(uniform)).T
        if self.posterior is None:
            return found
        return np.hstack([found, self.posterior.draws(fixed, scipy.stats.norm.ppf(uniform[:, len(fixed) :]))])

    def uniform(self, n: int) -> Real:
        """Return the uniform numbers (drawn,) of draw n, in (0, 1)."""
        generator = np.random.Generator(np.random.Philox(key=self.seed, counter=n << 64))
        return np.maximum(generator.random(len(self.drawn_keys)), ENDS[0])


def space_of(
    over: Mapping[str, Mapping[str, Any]],
    *,
    draws: int,
    seed: int,
    posterior: Posterior | None = None,
    listing: Listing | None = None,
) -> Space:
    """Return the space of a declared study.  Raises ParameterError, naming the key."""
    known = {key: _distribution(f"over.{key}", entry) for key, entry in over.items()}
    found = Space(over=known, posterior=posterior, listing=listing, draws=draws, seed=seed)
    require(
        found.keys,
        "over",
        dict(over),
        "nothing is varied: give --over KEY=uniform:LOW,HIGH, a list or a posterior",
    )
    require(
        not (found.grids and listing),
        "over",
        [*found.grids],
        "a list has every value itself: no grid with it",
    )
    for key in found.keys:
        require(found.keys.count(key) == 1, "over", key, "is varied twice; once is enough")
    if posterior is not None:
        posterior.must_be_determined(tuple(over))
    require(
        found.count <= MOST_ROWS,
        "rows",
        found.count,
        f"at most {MOST_ROWS:,} rows: fewer draws, or a coarser grid",
    )
    return found


def _distribution(place: str, entry: Any) -> Distribution:
    """Return the checked distribution or grid of an entry such as {"uniform": [0.0, 1.0]}."""
    remedy = f'give one of {", ".join(KINDS)} with its numbers, such as {{"uniform": [0.0, 1.0]}}'
    require(isinstance(entry, Mapping) and len(entry) == 1, place, entry, remedy)
    ((kind, numbers),) = entry.items()
    must_be_known(place, kind, KINDS)
    remedy = f"{kind} needs finite numbers in order: {KINDS[kind][0]}"
    is_finite = False
    # TypeError: no list, or another count of numbers
    with suppress(TypeError), np.errstate(all="ignore"):
        found = Distribution(kind, tuple(number(place, each, remedy) for each in numbers))
        points = found.frozen.ppf(ENDS) if kind in FORMS else found.frozen
        is_finite = len(points) > 0 and bool(np.isfinite(points).all())
    require(is_finite, place, numbers, remedy)
    return found


def _names_after(prefix: str, keys: Sequence[str]) -> dict[str, str]:
    """Return the keys with a prefix, and their names without it."""
    return {key: key.removeprefix(prefix) for key in keys if key.startswith(prefix)}


class Subjects:
    """Arms and loops with other values of some numbers, by their keys.

    Keys are those of an arm's file, "sampling.delay_samples" and others of its chain, "law.K1" and other numbers of the
    controller (`Law.with_number`), and "tuner.seed" and others of the tuner.  A stated shear modulus stays as it is,
    but for a Young's modulus that is `fitted`: a fit has changed both.  Raises ParameterError for an unknown one.
    """

    def __init__(self, case: Case, keys: Sequence[str], fitted: Collection[str] = ()) -> None:
        self.case = case
        self.keys = keys
        numbers: dict[str, tuple[str, str]] = {}
        for table in CHAIN_TABLES:
            for each in fields(getattr(case.chain, table)):
                if float in (each.type, *get_args(each.type)):
                    numbers[f"{table}.{each.name}"] = (table, each.name)
        self._of_chain = {key: numbers[key] for key in keys if key in numbers}
        self._of_law = _names_after("law.", keys)
        signals = []
        for name in self._of_law.values():
            case.feedback.with_number(name, 1.0)
            signals.append(OUTPUT_OF.get(name, name).removesuffix(".gain"))
        remedy = "two keys are one number of the controller"
        require(len(set(signals)) == len(signals), "over", [*self._of_law], remedy)
        self._of_tuner = _names_after("tuner.", keys)
        for name in self._of_tuner.values():
            must_be_known("tuner", name, (*tuning.NUMBERS, *tuning.NUMBERS_OF_LEARNING))
        elsewhere = {*self._of_chain, *self._of_law, *self._of_tuner}
        own = [key for key in keys if key not in elsewhere]
        for key in own:
            must_be_known("over", key, [*numbers_of(case.arm), *numbers, "law.NUMBER", "tuner.NUMBER"])
        self._arms = KeyedArms(case.arm, own, "over", alone={*own} - {*fitted})

    @property
    def notes(self) -> list[str]:
        """The shear moduli of links whose Young's modulus is varied."""
        found = []
        for key in self._arms.keys:
            if "youngs" in key:
                word = "G as it is stated or varied itself"
                if self._arms.is_shear_scaled(key):
                    word = "G changes with it, at a constant Poisson's ratio"
                found.append(f"{key}: {word}")
        return found

    def at(self, row: Sequence[float]) -> Subject:
        """Return the case of a row.  Raises ParameterError for an illegal value."""
        values = dict(zip(self.keys, row, strict=True))
        arm = self._arms.arm
        if self._arms.keys:
            arm = self._arms.at({key: values[key] for key in self._arms.keys})
        law = self.case.feedback
        for key, name in self._of_law.items():
            law = law.with_number(name, values[key])
        chain = self.case.chain
        for key, (table, name) in self._of_chain.items():
            chain = replace(chain, **{table: replace(getattr(chain, table), **{name: values[key]})})
        tuner = {name: values[key] for key, name in self._of_tuner.items()}
        return Subject(Case(arm, law, chain), tuner)

    def all_of(self, rows: Real, numbers: Sequence[int]) -> list[Subject]:
        """Return the cases of rows of these numbers.

        Raises ParameterError with the count of illegal ones, and the number and reason of the first.
        """
        found = []
        errors = dict[int, ParameterError]()
        for n, row in zip(numbers, rows.tolist(), strict=True):
            try:
                found.append(self.at(row))
            except ParameterError as error:
                errors[n] = error
        for n, first in errors.items():
            remedy = f"{len(errors)} of {len(rows)} arms are illegal, the first in row {n}: {first.remedy}"
            raise ParameterError(key=first.key, value=first.value, remedy=remedy)
        return found


# ------------------------------------------------------------------------------------------------------------ lists


def listing_of(path: Path) -> Listing:
    """Return the columns and the number of rows of a list, all of which are checked.  Raises ParameterError."""
    lines = lines_of(path)
    found = Listing(path, next(lines), sum(1 for _ in lines))
    require(found.size, "list", 0, "has no rows", str(path))
    return found


def lines_of(path: Path) -> Iterator[Any]:
    """Yield the names of the columns of a list, then its rows of finite numbers.

    Raises ParameterError, naming row and column, for a name that is doubled or missing, and for any other value.
    """
    lines = _cells(path)
    names = tuple(next(lines, ()))
    with name_file(path):
        for name in names:
            require(
                name and names.count(name) == 1,
                "column",
                name,
                "each column has a key of its own as its name",
            )
        yield names
        # from 0, as in the results
        for n, row in enumerate(lines):
            require(len(row) == len(names), f"row {n}", len(row), f"{len(names)} values, one a column")
            for name, cell in zip(names, row, strict=True):
                is_number = re.fullmatch(r" *[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)? *", cell, re.ASCII)
                is_finite = is_number and math.isfinite(float(cell))
                require(is_finite, f"row {n}, column {name}", cell, "every cell is a finite number")
            yield list(map(float, row))


def _cells(path: Path) -> Iterator[Sequence[str]]:
    """Yield names and rows of a CSV file, or of a Parquet one by another process, a few in memory at a time."""
    form = "a CSV or Parquet file with a column a key"
    # characters, of some ten thousand numbers
    longest_line = 1 << 20
    # a list of the most rows, of twenty numbers
    most_bytes = 4 << 30
    with open_file(path, most_bytes, key="list", what=form) as file:
        is_parquet = path.suffix == ".parquet" and parquet("list", str(path))
        try:
            child = partial(read_by_child, "parquet", path, key="list", remedy=f"cannot be read; give {form}")
            with child() if is_parquet else nullcontext(file) as rows:
                text = io.TextIOWrapper(rows, encoding="utf-8-sig", newline="")
                # a file without an end of a line is no reason to have it in memory
                yield from csv.reader(iter(partial(text.readline, longest_line), ""), strict=True)
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise ParameterError(
                key="list", value=str(path), remedy=f"cannot be read ({error}); give {form}"
            ) from None


def parquet(key: str, value: str) -> Any:
    """Return the module of pyarrow for Parquet.  Raises ParameterError where it is missing or old."""
    module = extra("pyarrow.parquet", "study", key, value)
    version = tuple(int(part) for part in import_module("pyarrow").__version__.split(".")[:3])
    # older ones unpickle what they read (CVE-2023-47248)
    require(version >= (14, 0, 1), key, value, "needs pyarrow 14.0.1 or newer: pip install 'tfarm[study]'")
    return module


def extra(package: str, name: str, key: str, value: object) -> Any:
    """Return an optional package.  Raises ParameterError, naming its extra, where it is missing."""
    try:
        return import_module(package)
    except ImportError:
        raise ParameterError(
            key=key, value=value, remedy=f"needs {package.partition('.')[0]}: pip install 'tfarm[{name}]'"
        ) from None
