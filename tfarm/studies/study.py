"""A study: many arms and loops, each by the exact solution, and the findings over all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from scipy import stats
from scipy.optimize import minimize

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.checks import whole
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.dsp.chain import chain_or_usual, file_text
from tfarm.errors import require
from tfarm.files import write_file
from tfarm.fitting.posterior import load_posterior
from tfarm.processes import shared
from tfarm.records import record
from tfarm.schema import Column, Quantity, Table
from tfarm.spectrum.table import default_gains

from .extras import cluster_size
from .findings import (
    CONFIDENCE,
    LARGER_IS_WORSE,
    STABLE,
    Failure,
    Spread,
    StableShare,
    failures_of,
    quantity_named,
    shares_of,
    spreads_of,
)
from .quantities import CARD, COLUMNS, asked_columns
from .running import ROW, Parts, Plan, Progress, run, table_of, usual_workers
from .space import MOST_ROWS, MOST_SEED, Listing, Subjects, space_of

INTERVAL = "(Clopper-Pearson, one-sided)"
WORST_FILE = "worst.toml"
STEPS_A_NUMBER, LEAST_STEPS = 20, 20  # evaluations of the search of the worst arm
BEYOND = 1e9  # a value that any unstable loop exceeds in the order of worse arms
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
    key: Annotated[str, Quantity("number", help="varied number")]
    first: Annotated[float, Quantity("first order", "", 3, "share by this number alone")]
    first_low: Annotated[float, Quantity("from", "", 3, "lower end of the 95 % bootstrap interval")]
    first_high: Annotated[float, Quantity("to", "", 3, "upper end")]
    total: Annotated[float, Quantity("total", "", 3, "share by this number and its interactions")]
    total_low: Annotated[float, Quantity("total from", "", 3, "lower end of the 95 % bootstrap interval")]
    total_high: Annotated[float, Quantity("total to", "", 3, "upper end")]


@dataclass(frozen=True, kw_only=True)
@record
class Study:
    """Results of a study, as far as it has been run, with its findings."""

    parts: Parts
    arm: Annotated[str, Quantity("arm", help="arm whose numbers are varied")]
    rows: Annotated[int, Quantity("arms", help="rows of the whole study")]
    rows_a_part: Annotated[int, Quantity("arms a part", help="rows of one file of the results")]
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
    def shares(self) -> Annotated[tuple[StableShare, ...], Quantity("stable arms", help="by loop")]:
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
    def finding(self) -> Annotated[str, Quantity("finding", help="stable arms of each loop, with their confidence")]:
        """Stable arms of each loop."""
        texts = []
        for each in self.shares:
            word = f"{each.certainty} stable" if each.stable and each.certainty else "stable"
            text = f"{each.loop}: {word} on {each.stable:,} of {self.done:,} arms"
            if each.at_least is not None:
                percent = math.floor(1e4 * each.at_least) / 100  # never more than was shown
                text += f" drawn, at least {percent:g} % of them with {CONFIDENCE:.0%} confidence {INTERVAL}"
            texts.append(text)
        return "; ".join(texts) or f"{self.done:,} of {self.rows:,} arms computed"

    @property
    def csv_table(self) -> Table:
        """Every row of the study."""
        names = self.parts.plan.columns
        units = {name: COLUMNS[name].of.unit for name in self.parts.plan.names}
        return Table(
            columns=tuple(Column(name, unit=units.get(name, ""), of=_cells(self._table[name])) for name in names)
        )


class StudyTable(dict[str, Any]):
    """Columns of a study as arrays by their names."""

    def to_pandas(self) -> Any:
        """Return a pandas data frame.  Raises ImportError without pandas."""
        return import_module("pandas").DataFrame(self)


def _cells(values: Any) -> list[Any]:
    return ["" if each != each else each for each in values.tolist()]


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
        Size N, a power of 2, of a sample of N (numbers + 2) arms of its own, for Sobol' indices.
    workers, client
        Processes of this machine (default: one a processor), or a client of Dask.
    stop_after
        Seconds after which no part is begun any more.
    part
        Rows of a part; by default as many as take 5 to 30 s.
    progress
        Called with parts done, parts of the study, and a text.

    Raises
    ------
    ParameterError
        For an unknown key or quantity, illegal numbers, and a folder with another study.
    ConvergenceError
        Where a worker process or the scheduler was killed; another run goes on.
    """
    chain, law = chain_or_usual(chain), default_gains(arm) if law is None else law
    whole("draws", draws, 1, MOST_ROWS, f"a whole number from 1 to {MOST_ROWS:,}")
    whole("seed", seed, 0, MOST_SEED, "a whole number that is not negative")
    listing = None if rows is None else Listing(Path(rows))
    space = space_of(
        over or {}, draws=draws, seed=seed, posterior=None if posterior is None else load_posterior(posterior),
        listed=((), 0) if listing is None else (listing.columns, listing.size),
    )  # fmt: skip
    plan = Plan(arm, law, chain, space, asked_columns(ask))
    plan.subjects  # noqa: B018  unknown keys are refused before a folder is made
    searched = quantity_named(worst, "worst") if worst else ""
    is_power = sobol >= 0 and sobol & (sobol - 1) == 0
    require(is_power, "sobol", sobol, "a power of 2, such as 256; 0 for no Sobol' indices")
    require(
        not sobol or (space.is_independent and space.posterior is None),
        "sobol",
        sobol,
        "needs independent distributions",
    )
    require(client is None or workers is None, "workers", workers, "those of the client are used: leave it out")
    if workers is None:
        workers = usual_workers() if client is None else cluster_size(client)
    whole("workers", workers, 1, MOST_WORKERS, "processes, at least 1")
    whole("part", 1 if part is None else part, 1, MOST_ROWS, "rows of a part, at least 1")
    declared = {"over": over or {}, "ask": ask, "draws": draws, "seed": seed, "rows": rows, "posterior": posterior,
                "worst": worst, "sobol": sobol}  # fmt: skip
    parts = run(Path(out), plan, listing, declared, workers, client, stop_after, part, progress or (lambda *_: None))
    found = Study(parts=parts, arm=arm.name, rows=space.count, rows_a_part=parts.rows)
    if sobol and found.is_complete:
        found = replace(found, sobol=sobol_indices(plan, sobol, workers, progress))
    if searched and found.is_complete:
        found = replace(found, worst=worst_arm(found, searched))
    return found


# ------------------------------------------------------------------------------------------------------------ worst


def worst_arm(study: Study, quantity: str) -> WorstArm:
    """Return the worst arm in a quantity, by Nelder and Mead's simplex from the worst drawn, and write its file.

    The search stays within the quantiles 1/(2 n) and 1 - 1/(2 n) of each distribution of n draws.  An unstable loop is
    worse than any stable one, by the least damping ratio.
    """
    plan, loop = study.parts.plan, quantity.split(".")[-2]
    sign = 1.0 if any(name in quantity for name in LARGER_IS_WORSE) else -1.0
    stability, ratio = f"{loop}.stability", f"{loop}.least_damping"
    names = (quantity, *(name for name in (stability, ratio) if name in COLUMNS and name != quantity))
    own = replace(plan, names=names)

    def worse(values: Mapping[str, Any]) -> float:
        value, word, damping = (values.get(name) for name in (quantity, stability, ratio))
        if word not in (None, "", STABLE):
            return BEYOND - (damping if damping is not None and damping == damping else 0.0)
        return -math.inf if value is None or value != value else sign * value

    def at(uniform: Real) -> tuple[dict[str, Any], list[float]]:
        row = plan.space.values(uniform[None])[0].tolist()
        return {name: of[0] for name, of in table_of(own, 0, np.array([row])).items()}, row

    table = study.table()
    known = [name for name in names if name in table]
    require(quantity in known, "worst", quantity, "is not asked for: name it in --ask too")
    ranks = [
        worse(dict(zip(known, row, strict=True))) for row in zip(*(table[name].tolist() for name in known), strict=True)
    ]
    first = int(np.argmax(ranks))
    require(ranks[first] > -math.inf, "worst", quantity, "no arm has a value of it")
    row, count = [float(table[key][first]) for key in plan.space.keys], 0
    drawn = float(table[quantity][first])
    found: float | None = drawn
    if plan.space.is_independent and plan.space.posterior is None:
        edge, start = 0.5 / plan.space.draws, plan.space.uniform(first)
        searched: Any = minimize(  # type: ignore[call-overload]  # of bounded floats
            lambda u: -worse(at(u)[0]), start, method="Nelder-Mead", bounds=[(edge, 1 - edge)] * len(start),
            options={"maxfev": LEAST_STEPS + STEPS_A_NUMBER * len(start)},
        )  # fmt: skip
        values, row = at(searched.x)
        found, count = values[quantity], int(searched.nfev)
    file = study.parts.folder / WORST_FILE
    subject = Subjects(plan.arm, plan.law, plan.chain, plan.space.keys).at(row)
    write_file(
        file, file_text(replace(subject.arm, name=f"{plan.arm.name}-worst"), subject.chain).encode(), key="--out"
    )
    return WorstArm(
        quantity=quantity, row=first, drawn=None if drawn != drawn else drawn, found=found, evaluations=count,
        numbers=dict(zip(plan.space.keys, row, strict=True)), file=str(file),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------------ Sobol'


def sobol_indices(plan: Plan, size: int, workers: int, progress: Progress | None) -> tuple[SobolIndex, ...]:
    """Return Sobol' indices of every quantity that has a value on each arm of a sample of N (numbers + 2) arms."""
    keys, numbers = plan.space.keys, [name for name in plan.names if not COLUMNS[name].is_text]

    def values(x: Real) -> Real:
        blocks = np.array_split(x.T, max(1, x.shape[1] // SOBOL_BLOCK))
        tasks = ((n, partial(table_of, plan, 0, block)) for n, block in enumerate(blocks))
        tables = dict[int, Any]()
        for number, table in shared(tasks, workers):
            tables[number] = table
            if progress is not None:
                progress(len(tables), len(blocks), "Sobol' indices")
        columns = [[value for n in range(len(blocks)) for value in tables[n][name]] for name in numbers]
        return np.array(columns, dtype=float)

    dists = [each.frozen for each in plan.space.distributions.values()]
    sampled: list[Real] = []

    def known(x: Real) -> Real:
        found = values(x)
        sampled.append(found)
        return np.nan_to_num(found, posinf=0.0, neginf=0.0)

    indices: Any = stats.sobol_indices(func=known, n=size, dists=dists, rng=np.random.default_rng(plan.space.seed))
    ends = indices.bootstrap(confidence_level=CONFIDENCE)
    has_all = np.all([np.isfinite(each).reshape(len(numbers), -1).all(axis=1) for each in sampled], axis=0)
    varies = np.max([np.ptp(each.reshape(len(numbers), -1), axis=1) for each in sampled], axis=0) > 0
    return tuple(
        SobolIndex(
            quantity=name, key=key, first=indices.first_order[n, k], total=indices.total_order[n, k],
            first_low=ends.first_order.confidence_interval.low[n, k],
            first_high=ends.first_order.confidence_interval.high[n, k],
            total_low=ends.total_order.confidence_interval.low[n, k],
            total_high=ends.total_order.confidence_interval.high[n, k],
        )
        for n, name in enumerate(numbers) if has_all[n] and varies[n]
        for k, key in enumerate(keys)
    )  # fmt: skip
