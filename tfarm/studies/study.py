"""A study: many arms and loops, each by the exact solution, and the findings over all of them.

It may be declared by a small TOML file, which can be kept and run again:

arm = "sasaki2012-lab"                # preset or file, with its chain and its [law]
ask = ["card", "modes"]
draws = 2000
[over]
"payload.mass" = { uniform = [0.0, 0.2] }
"hub.inertia" = { normal = [0.1, 0.005] }
"""

import math
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

# whose statistics take half a second to load
import scipy

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.chain import Chain, file_text, load_chain
from tfarm.arm.checks import whole
from tfarm.arm.law_tables import load_law
from tfarm.arm.reading import AnyFile, load, load_tables, presets
from tfarm.arm.schema import StrictTable, validate_table
from tfarm.arm.writing import law_head, law_toml, toml_tables, toml_text
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.errors import ParameterError, name_file, one_line, require
from tfarm.files import locked_folder, mat_content, write_file
from tfarm.fitting.posterior import load_posterior
from tfarm.processes import share_tasks
from tfarm.records import frozen
from tfarm.schema import Column, Quantity, Table, text
from tfarm.spectrum.gains import default_gains
from tfarm.stopping import Progress
from tfarm.studies.quantities import (
    CARD,
    CONFIDENCE,
    STABLE,
    Failure,
    Spread,
    StableShare,
    StudyBand,
    column_names,
    failures_of,
    order_of,
    quantity_of,
    response_quantiles,
    shares_of,
    spreads_of,
)
from tfarm.studies.running import (
    OUT,
    ROW,
    STUDY_FILE,
    Engine,
    Row,
    StudyFolder,
    StudyPlan,
    on_cluster,
    rows_of,
    run_parts,
    search_rows,
    seconds_an_arm,
    table_of,
    write_missing_parts,
)
from tfarm.studies.space import ENDS, MOST_SEED, listing_of, space_of

SHARES = "stable arms (confidence one-sided, Clopper-Pearson)"
PATHS = "rows", "posterior"
BOOTSTRAP = "95 % bootstrap interval; none without any influence"


class WorstArm(NamedTuple):
    """The worst arm of a study in one quantity: that drawn, and that of a search from there within the ranges."""

    quantity: Annotated[str, Quantity("quantity", help="column of the table")]
    row: Annotated[int, Quantity("worst drawn, row", help="number of its row")]
    drawn: Annotated[float | None, Quantity("value there", "", 6, "none where its loop is not stable")]
    found: Annotated[
        float | None, Quantity("value of the search", "", 6, "none where its loop is not stable")
    ]
    evaluations: Annotated[
        int, Quantity("evaluations of the search", help="arms computed; 0 without independent ranges")
    ]
    numbers: Annotated[dict[str, float], Quantity(help="varied numbers of that arm")]
    file: Annotated[str, Quantity("arm file", help="file of that arm, with its chain")]


class SobolIndex(NamedTuple):
    """Shares of the variance of a quantity by one varied number (Sobol', 1993; Saltelli et al., 2010)."""

    quantity: Annotated[str, Quantity("quantity", help="column of the table")]
    key: Annotated[
        str, Quantity("number", help="varied number; none where the indices are not determined")
    ] = ""
    first: Annotated[float | None, Quantity("first order", "", 3, "share by this number alone")] = None
    first_interval: Annotated[tuple[float, float] | None, Quantity("interval", "", 3, BOOTSTRAP)] = None
    total: Annotated[float | None, Quantity("total", "", 3, "share by this number and its interactions")] = (
        None
    )
    total_interval: Annotated[tuple[float, float] | None, Quantity("interval of total", "", 3, BOOTSTRAP)] = (
        None
    )
    note: Annotated[str, Quantity("note", help="reason where the indices are not determined")] = ""


class StudyTable(dict[str, Any]):
    """Columns of a study as arrays by their names."""

    def to_pandas(self) -> Any:
        """Return a pandas data frame.  Raises ImportError without pandas."""
        return import_module("pandas").DataFrame(self)


@frozen(kw_only=True)
class Study:
    """Results of a study, as far as it has been run, with its findings."""

    parts: StudyFolder
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

    def band(self, output: str, most: int = 100) -> StudyBand:
        """Return the responses of an output of at most that many arms, even over the rows, and their quantiles.

        Raises ParameterError for an unknown output, and where no arm has that response.
        """
        plan = self.parts.plan
        rows = np.column_stack([self._table[key] for key in plan.space.keys])
        return response_quantiles(plan.subjects, rows[:: max(1, -(-self.done // most))].tolist(), output)

    @property
    def shear(
        self,
    ) -> Annotated[str, Quantity("shear modulus", help="with a varied Young's modulus; else empty")]:
        """Shear moduli where Young's modulus is varied."""
        return "; ".join(self.parts.plan.subjects.notes)

    @property
    def finding(self) -> Annotated[str, Quantity(help="stable arms of each loop, with their confidence")]:
        """Stable arms of each loop."""
        words = [f"{each.loop}: {each.finding}" for each in self.shares]
        return "; ".join(words) or f"{self.done:,} of {self.rows:,} arms computed"

    @property
    def varied_numbers(self) -> list[Column]:
        """A row a varied number: its distribution or grid, and its value of the worst arm where that was found."""
        space = self.parts.plan.space
        kinds = {
            key: one_line(f"{each.kind} {', '.join(map(text, each.numbers))}", 60)
            for key, each in space.over.items()
        }
        columns = [
            Column("key", "number", of=space.keys),
            Column(
                "distribution", "distribution", of=[kinds.get(key, "list or posterior") for key in space.keys]
            ),
        ]
        if self.worst is not None:
            worst = list(self.worst.numbers.values())
            columns.append(Column("worst", "worst arm", of=worst, shown=list(map(text, worst))))
        return columns

    @property
    def csv_table(self) -> Table:
        """Every row of the study."""
        return Table(
            columns=tuple(
                Column(
                    name,
                    unit=quantity_of(name).unit if name in self.parts.plan.names else "",
                    of=["" if each != each else each for each in values.tolist()],
                )
                for name, values in self._table.items()
            )
        )


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
    progress: Progress = lambda *_: None,
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
    case = Case(arm, default_gains(arm) if law is None else law, chain)
    workers = usual_workers(client) if workers is None else workers
    for key, value in {
        "draws": draws,
        "seed": seed,
        "workers": workers,
        "part": 1 if part is None else part,
    }.items():
        whole(key, value, int(key != "seed"), MOST_SEED, f"a whole number from {int(key != 'seed')}")
    known = None if posterior is None else load_posterior(posterior)
    space = space_of(
        over or {},
        draws=draws,
        seed=seed,
        posterior=known,
        listing=None if rows is None else listing_of(Path(rows)),
    )
    order = order_of(worst) if worst else ()
    plan = StudyPlan(case, space, column_names([*ask, *order]))
    require(
        sobol >= 0 and sobol & (sobol - 1) == 0, "sobol", sobol, "a power of 2, such as 256; 0 for no indices"
    )
    is_possible = not sobol or (space.is_independent and posterior is None and len(space.keys) > 1)
    require(is_possible, "sobol", sobol, "needs two or more independent distributions")
    files = files_of(
        case,
        {
            "over": over or {},
            "ask": ask,
            "draws": draws,
            "seed": seed,
            "rows": rows,
            "posterior": posterior,
            "worst": worst,
            "sobol": sobol,
        },
    )
    engine = partial(share_tasks, count=workers) if client is None else partial(on_cluster, client=client)
    deadline = time.monotonic() + (math.inf if stop_after is None else stop_after)
    with locked_folder(Path(out), key=OUT):
        parts = run_parts(Path(out), plan, files, engine, workers, deadline, part, progress)
        found = Study(parts=parts, arm=arm.name, rows=space.count, rows_a_part=parts.rows)
        if found.is_complete:
            indices = sobol_indices(parts, sobol, workers, engine, deadline, progress) if sobol else ()
            found = replace(found, sobol=indices, worst=worst_arm(found, order, deadline) if order else None)
    return found


def usual_workers(client: Any) -> int:
    """Return the number of workers of a client of Dask, or of processors of this machine that may be used."""
    if client is not None:
        return max(1, len(client.nthreads()))
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# ------------------------------------------------------------------------------------------------------------ file


class StudyFile(StrictTable):
    """The file of a study: the arguments of `study` that it declares."""

    arm: str
    law: str = ""
    rows: str = ""
    posterior: str = ""
    over: dict[str, Any] | None = None
    ask: list[str] | None = None
    draws: int = 0
    seed: int = 0
    worst: str = ""
    sobol: int = 0


def load_study(name_or_path: AnyFile) -> dict[str, Any]:
    """Return the arguments of `study` that a file declares; its paths are relative to its folder.

    Raises ParameterError, naming the file.
    """
    tables, file = load_tables(name_or_path)
    folder = Path(file).parent
    with name_file(file):
        declared = validate_table(StudyFile, tables, "").model_dump(exclude_unset=True)
    arm = load_tables(declared["arm"] if declared["arm"] in presets() else str(folder / declared["arm"]))
    law = load_law(folder / declared["law"] if "law" in declared else arm)
    own = {key: folder / value if key in PATHS else value for key, value in declared.items()}
    return {**own, "arm": load(arm), "law": law, "chain": load_chain(arm)}


def files_of(case: Case, declared: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the files from which `load_study` has the study again, by their names.

    These are the study, the arm with its chain and its [law], and the matrices of a law.  A list and a posterior keep
    their places.
    """
    arm_file = "arm.toml"
    matrices = "law.mat"
    own = case.law
    files = dict[str, bytes]()
    try:
        text = law_toml(own)
    except ParameterError:
        # of a state space: it has no text
        columns = (*own.signals, *own.wanted)
        files[matrices] = mat_content(dict(zip("ABCD", own.matrices(columns), strict=True)), "column")
        table = {**law_head(own), "sign": -1, "matrices": matrices, "signals": columns}
        text = toml_text(toml_tables(table, "law"))
    places = {key: declared[key] and os.path.abspath(declared[key]) for key in PATHS}
    over = {
        key: {kind: tuple(numbers) for kind, numbers in entry.items()}
        for key, entry in declared["over"].items()
    }
    kept = {"arm": arm_file, **declared, **places, "ask": tuple(declared["ask"]), "over": over}
    study = toml_text(toml_tables({key: value for key, value in kept.items() if value or key == "seed"}))
    return {
        **files,
        arm_file: f"{file_text(case.arm, case.chain)}\n{text}".encode(),
        STUDY_FILE: study.encode(),
    }


# ------------------------------------------------------------------------------------------------------------ worst


def badness(order: Sequence[str], values: Mapping[str, Any]) -> float:
    """Return the place of an arm in the order, worse ones last: an unstable loop is worse than any stable one.

    An arm without a value is not in the order: -inf.
    """
    # in the order of worse arms: above each value of a stable loop
    beyond = 1e9
    larger_is_worse = (
        "peak",
        "settling_time_s",
        "overshoot",
        "time_constant_s",
        "residual_rms",
        "steady_state_error",
        "cost",
        "unstable",
        "minimum_damping_s",
        "rise_time_s",
        "re_1_s",
    )
    value, *words = (values[name] for name in order)
    if any(word not in (None, "", STABLE) for word in words):
        return beyond
    if value is None or math.isnan(value):
        return -math.inf
    # of these by their size
    size = abs(value) if any(name in order[0] for name in ("peak", "steady_state_error")) else value
    is_larger_worse = any(name in order[0] for name in larger_is_worse)
    return float(np.clip(size if is_larger_worse else -size, -beyond, beyond / 2))


def worst_arm(study: Study, order: Sequence[str], deadline: float) -> WorstArm | None:
    """Return the worst arm in a quantity, of those drawn and of a search from the worst of them, and write its file.

    None where the search has no end before the deadline [s].
    """
    table = study.table()
    ranks = [badness(order, row) for row in rows_of({name: table[name].tolist() for name in order})]
    first = int(np.argmax(ranks))
    require(ranks[first] > -math.inf, "worst", order[0], "no arm has a value of it")
    drawn = {name: of[first] for name, of in table.items()}
    seen = search_worst(study.parts, order, first, deadline)
    if seen is None:
        return None
    worst = max(seen or [drawn], key=partial(badness, order))
    numbers = {key: float(worst[key]) for key in study.parts.plan.space.keys}
    values = (each[order[0]] for each in (drawn, worst))
    of_drawn, of_worst = (None if each is None or math.isnan(each) else float(each) for each in values)
    return WorstArm(
        quantity=order[0],
        row=first,
        drawn=of_drawn,
        found=of_worst,
        evaluations=len(seen),
        numbers=numbers,
        file=str(write_case(study.parts, numbers)),
    )


def search_worst(parts: StudyFolder, order: Sequence[str], first: int, deadline: float) -> list[Row] | None:
    """Return the rows of a search of the worst arm, by Nelder and Mead's simplex from row `first`.

    It stays within the range of a bounded distribution of n draws, else within its quantiles 1/(2 n) and 1 - 1/(2 n).
    No rows without independent ranges; None where it has no end before the deadline [s].
    """
    space = parts.plan.space
    if not space.is_independent:
        return []
    start = space.uniform(first)
    with np.errstate(all="ignore"):
        is_bounded = np.isfinite(space.values(np.array([0 * start, 0 * start + 1]))).all(axis=0)
    edge = np.minimum(np.where(is_bounded, 0.0, 0.5 / space.draws), np.minimum(start, 1 - start))
    # of the probability of each number
    step = 0.05
    steps = np.diag(np.where(start < 0.5, step, -step))
    most = 20 + 20 * len(start)

    def search(result: Callable[[Real], Row]) -> None:
        scipy.optimize.minimize(  # type: ignore[call-overload]  # bounds as an array
            lambda u: -badness(order, result(space.values(u[None]))),
            start,
            method="Nelder-Mead",
            bounds=np.array([edge, 1 - edge]).T,
            options={"maxfev": most, "initial_simplex": [start, *(start + steps)]},
        )

    return search_rows(parts.others(f"_worst-{order[0]}-", most, 1, order), search, deadline)


def write_case(parts: StudyFolder, numbers: Mapping[str, float]) -> Path:
    """Write the arm with these numbers, its chain and its controller, and return the file."""
    plan = parts.plan
    file = parts.folder / "worst.toml"
    case = plan.subjects.at([*numbers.values()]).case
    text = file_text(replace(case.arm, name=f"{plan.case.arm.name}-worst"), case.chain)
    # of a state space, which has no table
    with suppress(ParameterError):
        text = f"{text}\n{law_toml(case.law)}"
    write_file(file, text.encode(), key=OUT)
    return file


# ------------------------------------------------------------------------------------------------------------ Sobol'


def sobol_indices(
    study: StudyFolder, size: int, workers: int, engine: Engine, deadline: float, progress: Progress
) -> tuple[SobolIndex, ...]:
    """Return Sobol' indices of every quantity, of a sample of its own of N (numbers + 2) arms, written as parts.

    The first progress has their number and time.  A quantity without a finite value on each arm has no indices.  None
    where the sample is not complete before the deadline [s].
    """
    plan = study.plan
    keys = study.plan.space.keys
    names = [name for name in plan.names if quantity_of(name).is_number and quantity_of(name).label]
    A, B = np.hsplit(
        scipy.stats.qmc.Sobol(2 * len(keys), rng=np.random.default_rng(plan.space.seed)).random(size), 2
    )
    # A with one column of B
    pages = [np.where(np.arange(len(keys)) == n, B, A) for n in range(len(keys))]
    rows = plan.space.values(np.clip(np.vstack([A, B, *pages]), *ENDS))
    # all workers have some of a small sample
    parts = study.others(f"_sobol-{size}-", len(rows), 64, plan.names)
    if not parts.is_complete:
        seconds = seconds_an_arm(plan, rows) * len(rows) / workers
        progress(0, 0, f"Sobol' indices of {len(rows):,} further arms, about {seconds:.0f} s")
    calls = partial(map, lambda ends: partial(table_of, plan, ends[0], rows[slice(*ends)]))
    write_missing_parts(parts, calls, engine, deadline, progress, "parts of Sobol' indices")
    table = parts.column(*names) if parts.is_complete else {}
    return tuple(index for name, values in table.items() for index in _indices(name, keys, values))


def _indices(name: str, keys: Sequence[str], values: Real) -> Iterator[SobolIndex]:
    """Yield the indices of the values of a quantity: of A, of B and of a page a number, N arms each."""
    missing = int(np.sum(~np.isfinite(values)))
    if missing or np.ptp(values) == 0:
        yield SobolIndex(
            quantity=name, note=f"no finite value on {missing:,} arms" if missing else "no variance"
        )
        return
    f_A, f_B, *f_AB = values.reshape(len(keys) + 2, 1, -1)
    found: Any = scipy.stats.sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": np.array(f_AB)}, n=f_A.size)
    # of an index that does not vary
    no_interval: Any = scipy.stats.DegenerateDataWarning
    with warnings.catch_warnings(action="ignore", category=no_interval), np.errstate(all="ignore"):
        ends = found.bootstrap(confidence_level=CONFIDENCE)
    first = ends.first_order.confidence_interval
    total = ends.total_order.confidence_interval
    columns = found.first_order, first.low, first.high, found.total_order, total.low, total.high
    for key, S, S_low, S_high, T, T_low, T_high in zip(
        keys, *(np.ravel(of).tolist() for of in columns), strict=True
    ):
        yield SobolIndex(
            quantity=name,
            key=key,
            first=S,
            first_interval=(S_low, S_high),
            total=T,
            total_interval=(T_low, T_high),
        )
