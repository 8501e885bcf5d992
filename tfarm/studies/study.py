"""A study: many arms and loops, each by the exact solution, and the findings over all of them."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import scipy  # whose statistics take half a second to load
from scipy.optimize import minimize

from tfarm.arm import AnyLaw, Arm, as_law
from tfarm.arm.checks import whole
from tfarm.arm.writing import law_toml
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.dsp.chain import chain_or_usual, file_text
from tfarm.errors import ParameterError, require
from tfarm.files import write_file
from tfarm.fitting.posterior import load_posterior
from tfarm.records import record
from tfarm.schema import Column, Quantity, Table
from tfarm.spectrum.table import default_gains

from .extras import cluster_size
from .findings import (
    CONFIDENCE,
    STABLE,
    Failure,
    Spread,
    StableShare,
    failures_of,
    shares_of,
    spreads_of,
)
from .quantities import CARD, COLUMNS, LOOPS, asked_columns, column_of
from .running import ROW, Parts, Plan, Progress, computed, run, seconds_an_arm, table_of, usual_workers
from .space import ENDS, MOST_ROWS, MOST_SEED, Listing, space_of

SHARES = "stable arms (confidence one-sided, Clopper-Pearson)"
WORST_FILE = "worst.toml"
STEPS_A_NUMBER, LEAST_STEPS = 20, 20  # evaluations of the search of the worst arm
FIRST_STEP = 0.05  # of that search, in the probability of each number
BEYOND, NOWHERE = 1e9, -math.inf  # in the order of worse arms: above each value of a stable loop; of no value
LARGER_IS_WORSE = (
    "peak", "settling_time_s", "overshoot", "time_constant_s", "residual_rms", "steady_state_error", "cost", "unstable",
    "minimum_damping_s", "rise_time_s", "re_1_s",
)  # fmt: skip
SIGNED = "peak", "steady_state_error"  # of these by their size
MOST_WORKERS = 1024
SOBOL_BLOCK = 64  # rows of the sample of Sobol' indices that are computed at a time


@dataclass(frozen=True, kw_only=True)
@record
class WorstArm:
    """The worst arm of a study in one quantity: that drawn, and that of a search from there within the ranges."""

    quantity: Annotated[str, Quantity("quantity", help="column of the table")]
    row: Annotated[int, Quantity("worst drawn, row", help="number of its row")]
    drawn: Annotated[float | None, Quantity("value there", "", 6, "none where its loop is not stable")]
    found: Annotated[float | None, Quantity("value of the search", "", 6, "none where its loop is not stable")]
    evaluations: Annotated[
        int, Quantity("evaluations of the search", help="arms computed; 0 without independent ranges")
    ]
    numbers: Annotated[dict[str, float], Quantity(help="varied numbers of that arm")]
    file: Annotated[str, Quantity("arm file", help="file of that arm, with its chain")]


@dataclass(frozen=True, kw_only=True)
class SobolIndex:
    """Shares of the variance of a quantity by one varied number (Sobol', 1993; Saltelli et al., 2010)."""

    quantity: Annotated[str, Quantity("quantity", help="column of the table")]
    key: Annotated[str, Quantity("number", help="varied number; none where the indices are not determined")] = ""
    first: Annotated[float | None, Quantity("first order", "", 3, "share by this number alone")] = None
    first_low: Annotated[float | None, Quantity("from", "", 3, "lower end of the 95 % bootstrap interval")] = None
    first_high: Annotated[float | None, Quantity("to", "", 3, "upper end; none without any influence")] = None
    total: Annotated[float | None, Quantity("total", "", 3, "share by this number and its interactions")] = None
    total_low: Annotated[float | None, Quantity("total from", "", 3, "lower end of the 95 % bootstrap interval")] = None
    total_high: Annotated[float | None, Quantity("total to", "", 3, "upper end; none without any influence")] = None
    note: Annotated[str, Quantity("note", help="reason where the indices are not determined")] = ""


@dataclass(frozen=True, kw_only=True)
@record
class Study:
    """Results of a study, as far as it has been run, with its findings."""

    parts: Parts
    arm: Annotated[str, Quantity("arm", help="arm whose numbers are varied")]
    rows: Annotated[int, Quantity("arms", help="rows of the whole study")]
    rows_a_part: Annotated[int, Quantity(help="rows of one file of the results")]
    worst: Annotated[WorstArm | None, Quantity("worst arm", help="in one quantity")] = None
    sobol: Annotated[tuple[SobolIndex, ...], Quantity("Sobol' indices", help="of a sample of their own")] = ()

    @cached_property
    def _table(self) -> dict[str, Any]:
        return self.parts.column(*self.parts.plan.columns)

    def table(self) -> StudyTable:
        """Return the results as arrays by the name of their column, rows in order; NaN or "" where there is none."""
        return StudyTable(self._table)

    @property
    def done(self) -> Annotated[int, Quantity("arms computed", help="rows in the parts that are written")]:
        """Number of computed rows."""
        return len(self._table[ROW])

    @property
    def is_complete(self) -> Annotated[bool, Quantity(help="whether every row is computed")]:
        """Whether every row is computed."""
        return self.done == self.rows

    @cached_property
    def shares(self) -> Annotated[tuple[StableShare, ...], Quantity(SHARES, help="by loop", first=True)]:
        """Stable arms of each loop; a confidence of a complete study alone."""
        plan = self.parts.plan
        return shares_of(self._table, plan.names, plan.space.is_independent and self.is_complete)

    @cached_property
    def spreads(self) -> Annotated[tuple[Spread, ...], Quantity("distributions", help="of each quantity")]:
        """Distribution of each quantity with its driver."""
        return spreads_of(self._table, self.parts.plan.names, self.parts.plan.space.keys)

    @cached_property
    def failures(self) -> Annotated[tuple[Failure, ...], Quantity("without a result", help="arms by reason")]:
        """Arms without a result by reason."""
        return failures_of(self._table)

    @property
    def finding(self) -> Annotated[str, Quantity(help="stable arms of each loop, with their confidence")]:
        """Stable arms of each loop."""
        words = [f"{each.loop}: {each.finding}" for each in self.shares]
        return "; ".join(words) or f"{self.done:,} of {self.rows:,} arms computed"

    @property
    def csv_table(self) -> Table:
        """Every row of the study."""
        return Table(columns=tuple(
            Column(name, unit=COLUMNS[name].of.unit if name in COLUMNS else "",
                   of=["" if each != each else each for each in values.tolist()])
            for name, values in self._table.items()
        ))  # fmt: skip


class StudyTable(dict[str, Any]):
    """Columns of a study as arrays by their names."""

    def to_pandas(self) -> Any:
        """Return a pandas data frame.  Raises ImportError without pandas."""
        return import_module("pandas").DataFrame(self)


def study(
    arm: Arm,
    over: Mapping[str, Mapping[str, Any]] | None = None,
    ask: Sequence[str] = (CARD,),
    law: AnyLaw | None = None,
    chain: Chain | None = None,
    *,
    out: str | Path,
    draws: int = 1000,
    seed: int = 0,
    rows: str | Path | None = None,
    posterior: str | Path | None = None,
    worst: str = "",
    sobol: int = 0,
    workers: int | None = None,
    client: Any = None,
    stop_after: float | None = None,
    part: int | None = None,
    progress: Progress | None = None,
) -> Study:
    """Return the results of many arms and loops, and write them to a folder, from which an interrupted study goes on.

    Parameters
    ----------
    arm, law, chain
        The arm, its controller (default gains) and its sampling (10 ms, ideal converters).
    over
        Varied numbers by key, such as {"payload.mass": {"uniform": [0.0, 0.2]}}; "loguniform", "normal" [mean,
        deviation], "lognormal" [median, deviation of ln], "grid" [low, high, count] and "values" too.  Keys are those
        of the arm's file and of its chain, "law.K1" and other numbers of the controller, "tuner.seed" and others.
    ask
        Quantities: "card", "modes", "damped_modes", "poles", "step", "tuner", or names of theirs.
    out
        Folder of the results.
    draws, seed
        Number of independent draws, and the seed on which they depend.
    rows
        CSV or Parquet file with a column a key, in the place of draws.
    posterior
        File of a fit's posterior (`tfarm fit --save`).
    worst
        Quantity of which the worst arm is searched.
    sobol
        Size N, a power of 2, of a sample of N (numbers + 2) arms of its own, for Sobol' indices of the quantities.
    workers, client
        Processes of this machine (default: one a processor), or a client of Dask.
    stop_after
        Seconds after which no part is begun any more.
    part
        Rows of a part; by default as many as take 5 to 30 s.
    progress
        Called with parts done, parts of the study, and a text; before the sample of Sobol' indices with 0, 0 and a
        text that has the time that they take.

    Raises
    ------
    ParameterError
        For an unknown key or quantity, illegal numbers, and a folder with another study.
    ConvergenceError
        Where a worker process or the scheduler was killed; another run goes on.
    """
    progress = progress or (lambda *_: None)
    chain, law = chain_or_usual(chain), default_gains(arm) if law is None else law
    whole("draws", draws, 1, MOST_ROWS, f"a whole number from 1 to {MOST_ROWS:,}")
    whole("seed", seed, 0, MOST_SEED, "a whole number that is not negative")
    listing = None if rows is None else Listing(Path(rows))
    space = space_of(
        over or {}, draws=draws, seed=seed, posterior=None if posterior is None else load_posterior(posterior),
        listed=((), 0) if listing is None else (listing.columns, listing.size),
    )  # fmt: skip
    order = order_of(worst) if worst else None
    plan = Plan(arm, law, chain, space, asked_columns([*ask, *(order.names if order else ())]))
    plan.subjects  # noqa: B018  unknown keys are refused before a folder is made
    is_power = sobol >= 0 and sobol & (sobol - 1) == 0
    require(is_power, "sobol", sobol, "a power of 2, such as 256; 0 for no Sobol' indices")
    remedy = "needs two or more independent distributions"
    require(not sobol or (space.is_searchable and len(space.keys) > 1), "sobol", sobol, remedy)
    require(client is None or workers is None, "workers", workers, "those of the client are used: leave it out")
    if workers is None:
        workers = usual_workers() if client is None else cluster_size(client)
    whole("workers", workers, 1, MOST_WORKERS, "processes, at least 1")
    whole("part", 1 if part is None else part, 1, MOST_ROWS, "rows of a part, at least 1")
    declared = {"over": over or {}, "ask": ask, "draws": draws, "seed": seed, "rows": rows, "posterior": posterior,
                "worst": worst, "sobol": sobol}  # fmt: skip
    parts = run(Path(out), plan, listing, declared, workers, client, stop_after, part, progress)
    found = Study(parts=parts, arm=arm.name, rows=space.count, rows_a_part=parts.rows)
    if found.is_complete:
        indices = sobol_indices(plan, sobol, workers, client, progress) if sobol else ()
        found = replace(found, sobol=indices, worst=None if order is None else worst_arm(found, order))
    return found


# ------------------------------------------------------------------------------------------------------------ worst


class Order(NamedTuple):
    """Columns by which arms are in order, worse ones last: an unstable loop is worse than any other, by its damping."""

    quantity: str
    stability: str
    damping: str

    @property
    def names(self) -> tuple[str, ...]:
        """The columns that there are: a quantity of no loop has no stability."""
        return tuple(name for name in dict.fromkeys(self) if name in COLUMNS)

    def place(self, values: Mapping[str, Any]) -> float:
        """Return the place of an arm in the order; `NOWHERE` without a value."""
        value, word, damping = map(values.get, self)
        if word not in (None, "", STABLE):
            return BEYOND - (0.0 if damping is None or math.isnan(damping) else damping)
        if value is None or math.isnan(value):
            return NOWHERE
        size = abs(value) if any(name in self.quantity for name in SIGNED) else value
        sign = 1.0 if any(name in self.quantity for name in LARGER_IS_WORSE) else -1.0
        return min(max(sign * size, -BEYOND), BEYOND / 2)


def order_of(word: str) -> Order:
    """Return the order by a quantity.  Raises ParameterError for none or several."""
    quantity = column_of(word, "worst")
    loop = re.match(rf".*?\b({'|'.join(LOOPS)})\b", quantity)
    place = loop.group() if loop else ""
    return Order(quantity, f"{place}.stability", f"{place}.least_damping")


def worst_arm(study: Study, order: Order) -> WorstArm:
    """Return the worst arm in a quantity, by Nelder and Mead's simplex from the worst drawn, and write its file.

    The search stays within the range of a bounded distribution of n draws, else within its quantiles 1/(2 n) and
    1 - 1/(2 n).
    """
    plan, space, table = study.parts.plan, study.parts.plan.space, study.table()
    own, columns = replace(plan, names=order.names), zip(*(table[name].tolist() for name in order.names), strict=True)
    ranks = [order.place(dict(zip(order.names, row, strict=True))) for row in columns]
    first = int(np.argmax(ranks))
    require(ranks[first] > NOWHERE, "worst", order.quantity, "no arm has a value of it")
    row, count, drawn = [float(table[key][first]) for key in space.keys], 0, float(table[order.quantity][first])
    found: float | None = drawn

    def values(uniform: Real) -> dict[str, Any]:
        return {name: of[0] for name, of in table_of(own, 0, space.values(uniform[None])).items()}

    if space.is_searchable:
        start, edge = space.uniform(first), 0.5 / space.draws
        bounds = [(0.0, 1.0) if np.isfinite(each.frozen.ppf([0, 1])).all() else (min(edge, u), max(1 - edge, u))
                  for each, u in zip(space.distributions.values(), start.tolist(), strict=True)]  # fmt: skip
        steps = np.diag(np.where(start < 0.5, FIRST_STEP, -FIRST_STEP))
        searched: Any = minimize(  # type: ignore[call-overload]  # bounds of plain floats
            lambda u: -order.place(values(u)), start, method="Nelder-Mead", bounds=bounds,
            options={"maxfev": LEAST_STEPS + STEPS_A_NUMBER * len(start), "initial_simplex": [start, *(start + steps)]},
        )  # fmt: skip
        worst = values(searched.x)
        found, row, count = worst[order.quantity], [worst[key] for key in space.keys], int(searched.nfev)
    file, subject = study.parts.folder / WORST_FILE, plan.subjects.at(row)
    text = file_text(replace(subject.arm, name=f"{plan.arm.name}-worst"), subject.chain)
    with suppress(ParameterError):  # of a state space, which has no table
        text = f"{text}\n{law_toml(as_law(subject.law))}"
    write_file(file, text.encode(), key="--out")
    return WorstArm(
        quantity=order.quantity, row=first, drawn=None if math.isnan(drawn) else drawn, found=found, evaluations=count,
        numbers=dict(zip(space.keys, row, strict=True)), file=str(file),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------------ Sobol'


def sobol_indices(plan: Plan, size: int, workers: int, client: Any, progress: Progress) -> tuple[SobolIndex, ...]:
    """Return Sobol' indices of every quantity, of a sample of its own of N (numbers + 2) arms.

    The first progress has their number and time.  A quantity without a finite value on each arm has no indices.
    """
    keys, names = plan.space.keys, [name for name in plan.names if COLUMNS[name].of.label and not COLUMNS[name].is_text]
    A, B = np.hsplit(scipy.stats.qmc.Sobol(2 * len(keys), rng=np.random.default_rng(plan.space.seed)).random(size), 2)
    pages = [np.where(np.arange(len(keys)) == n, B, A) for n in range(len(keys))]  # A with one column of B
    rows = plan.space.values(np.clip(np.vstack([A, B, *pages]), *ENDS))
    seconds = seconds_an_arm(plan, rows) * len(rows) / workers
    progress(0, 0, f"Sobol' indices of {len(rows):,} further arms, about {seconds:.0f} s")
    tasks = ((n, partial(table_of, plan, n, rows[n : n + SOBOL_BLOCK])) for n in range(0, len(rows), SOBOL_BLOCK))
    found = np.empty((len(rows), len(names)))
    for n, table in computed(tasks, workers, client):
        found[n : n + SOBOL_BLOCK] = np.array([table[name] for name in names], dtype=float).T
        progress(min(n + SOBOL_BLOCK, len(rows)), len(rows), "arms of Sobol' indices")
    missing, varies = np.sum(~np.isfinite(found), axis=0), np.ptp(np.nan_to_num(found), axis=0) > 0
    known = varies & (missing == 0)
    return (
        *_indices([name for name, is_known in zip(names, known, strict=True) if is_known], keys, found[:, known]),
        *(SobolIndex(quantity=name, note=f"no finite value on {count:,} arms" if count else "no variance")
          for name, count, is_known in zip(names, missing.tolist(), known, strict=True) if not is_known),
    )  # fmt: skip


def _indices(names: Sequence[str], keys: Sequence[str], values: Real) -> Iterator[SobolIndex]:
    """Yield the indices of values (A, B and a page a number, each with N arms; quantities)."""
    if not names:
        return
    f_A, f_B, *f_AB = np.moveaxis(values.reshape(len(keys) + 2, -1, len(names)), 2, 1)
    found: Any = scipy.stats.sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": np.array(f_AB)}, n=f_A.shape[1])
    with warnings.catch_warnings(), np.errstate(all="ignore"):  # an index that does not vary has no interval
        warnings.simplefilter("ignore", scipy.stats.DegenerateDataWarning)
        ends = found.bootstrap(confidence_level=CONFIDENCE)
    columns = dict[str, Any]()
    for name in ("first", "total"):
        interval = getattr(ends, f"{name}_order").confidence_interval
        columns |= {name: getattr(found, f"{name}_order"), f"{name}_low": interval.low, f"{name}_high": interval.high}
    for n, name in enumerate(names):
        for k, key in enumerate(keys):
            own = {part: float(np.reshape(of, (len(names), -1))[n, k]) for part, of in columns.items()}
            shown: Any = {part: value for part, value in own.items() if math.isfinite(value)}
            yield SobolIndex(quantity=name, key=key, **shown)
