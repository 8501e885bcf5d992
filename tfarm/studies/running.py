"""Chunks of a study: rows in, a table out, written as parts that a later run completes.

A chunk is a range of rows and one function; processes of this machine or the workers of a Dask cluster return its table
and the parent writes it.  Which rows a chunk has is settled before the first run, from the measured cost of a few arms,
and kept in `study.json`: an interrupted study goes on with the parts that are missing.
"""

import csv
import hashlib
import importlib.util
import io
import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from functools import cached_property, partial
from itertools import islice, takewhile
from logging import getLogger
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm.schema import StrictTable, validated_file
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.errors import ConvergenceError, ParameterError, TfarmError, one_line, require
from tfarm.files import write_file
from tfarm.records import frozen
from tfarm.stopping import Progress
from tfarm.studies.quantities import FAILED, Values, prepare, quantity_of, sources_of, values_of
from tfarm.studies.space import Space, Subject, Subjects, extra, parquet

# columns of a range of rows
Chunk = dict[str, list[Any]]
# the columns of one
Row = dict[str, Any]
# number of a part, and the call that returns its table
ChunkTask = tuple[int, Callable[[], Chunk]]
# yields each task with its table as it comes
Engine = Callable[[Iterator[ChunkTask]], Iterator[tuple[int, Chunk]]]


class Resources(NamedTuple):
    """Engine of a run and its number of workers, the time [s] after which no part is begun, and its progress."""

    engine: Engine
    workers: int
    deadline: float
    progress: Progress

    @property
    def is_over(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() >= self.deadline


# keys of errors
OUT = "--out"
# column of the number of the row, from 0
ROW = "row"
PARQUET = ".parquet"
STUDY_FILE = "study.toml"
# rows whose arms are built before the first run
CHECKED = 1000


@frozen
class StudyPlan:
    """A study: a case, its varied numbers and the columns that are asked for."""

    case: Case
    space: Space
    names: tuple[str, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (ROW, *self.space.keys, *self.names, FAILED)

    @property
    def texts(self) -> set[str]:
        """Names of the columns of texts."""
        return {FAILED, *(name for name in self.names if not quantity_of(name).is_number)}

    @cached_property
    def sources(self) -> list[tuple[Set[str], Values]]:
        """The functions of the columns that are asked for."""
        return sources_of(self.names)

    @cached_property
    def subjects(self) -> Subjects:
        """The arms and loops of the rows."""
        fitted = self.space.posterior.keys if self.space.posterior else ()
        return Subjects(self.case, self.space.keys, fitted)


def chunk(plan: StudyPlan, first: int, last: int, listed: Real | None = None) -> Chunk:
    """Return the table of rows first to last - 1: column by column, with the reason where a row has no result."""
    return table_of(plan, first, plan.space.rows(first, last, listed))


def table_of(plan: StudyPlan, first: int, rows: Real) -> Chunk:
    """Return the table of rows of values (rows, keys), numbered from `first`."""
    table: Chunk = {name: [] for name in plan.columns}
    # arms whose frequencies are found together; the exact numbers of twice as many are kept
    together = 32
    for start in range(0, len(rows), together):
        batch = rows[start : start + together].tolist()
        subjects = [_attempt(plan.subjects.at, row) for row in batch]
        _attempt(prepare, [each for each in subjects if isinstance(each, Subject)], plan.names)
        for number, (row, own) in enumerate(zip(batch, subjects, strict=True), start=first + start):
            found: dict[str, Any] = {ROW: number, **dict(zip(plan.space.keys, row, strict=True))}
            if isinstance(own, Subject):
                own = _attempt(values_of, own, plan.sources)
            found |= {FAILED: own} if isinstance(own, str) else own
            reason = found[FAILED]
            found[FAILED] = reason and one_line(reason, 200)
            for name, column in table.items():
                column.append(found.get(name))
    return table


def rows_of(table: Mapping[str, Sequence[Any]]) -> list[Row]:
    """Return the rows of a table."""
    return [dict(zip(table, values, strict=True)) for values in zip(*table.values(), strict=True)]


def _attempt(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a function, or the reason for none: one arm never ends a study."""
    try:
        return function(*arguments)
    except Exception as error:
        if isinstance(error, TfarmError):
            return str(error)
        return f"{type(error).__name__}: {error}"


# ------------------------------------------------------------------------------------------------------------ parts


def seconds_an_arm(plan: StudyPlan, rows: Real) -> float:
    """Return the mean time of the last three of some rows of values (rows, keys) [s]."""
    # which compiles
    table_of(plan, 0, rows[:1])
    pilot = rows[-3:]
    began = time.perf_counter()
    table_of(plan, 0, pilot)
    return (time.perf_counter() - began) / len(pilot)


def rows_a_chunk(cost: float, count: int, workers: int) -> int:
    """Return the rows of a chunk of 5 to 30 s for arms of that cost [s], so that all workers end together."""
    whole = cost * count / workers
    # ten chunks a worker, where they last that long
    seconds = min(max(whole / 10, 5.0), 30.0)
    return min(math.ceil(count / (workers * max(1, round(whole / seconds)))), 50_000)


@frozen
class StudyFolder:
    """The folder of a study, with the parts that are written."""

    folder: Path
    plan: StudyPlan
    digest: str
    # of a part
    rows: int
    suffix: str
    # rows of all parts
    size: int
    prefix: str = "part-"

    @property
    def count(self) -> int:
        """Number of all parts."""
        return math.ceil(self.size / self.rows)

    def others(self, prefix: str, size: int, rows: int, names: Sequence[str]) -> "StudyFolder":
        """Return parts of that many other rows with these columns, in the same folder; at most `rows` in one."""
        return replace(
            self,
            plan=replace(self.plan, names=tuple(names)),
            prefix=prefix,
            size=size,
            rows=min(self.rows, rows),
        )

    @property
    def is_complete(self) -> bool:
        """Whether every part is written."""
        return len(self.part_numbers()) == self.count

    def path(self, number: int) -> Path:
        """Return the file of a part."""
        return self.folder / f"{self.prefix}{self.digest[:8]}-{number:06}{self.suffix}"

    def part_numbers(self) -> list[int]:
        """Return the numbers of the parts that are there.  Raises ParameterError for a part of another study."""
        names = {each.name for each in self.folder.glob(f"{self.prefix}*")}
        found = [number for number in range(self.count) if self.path(number).name in names]
        strange = sorted(names - {self.path(number).name for number in found})
        require(
            not strange,
            OUT,
            str(self.folder),
            f"{strange[:1]} is a part of another study: choose another folder",
        )
        return found

    def write(self, number: int, table: Mapping[str, Sequence[Any]]) -> None:
        """Write the table of a part under a temporary name, then rename it."""
        if self.suffix == PARQUET:
            module = parquet("out", "Parquet")
            arrow = importlib.import_module("pyarrow")
            texts = self.plan.texts
            columns = {}
            for name, of in table.items():
                columns[name] = arrow.array(of, arrow.string() if name in texts else arrow.float64())
            binary = io.BytesIO()
            module.write_table(arrow.table(columns), binary)
            content = binary.getvalue()
        else:
            stream = io.StringIO()
            csv.writer(stream, lineterminator="\n").writerows(
                [tuple(table), *zip(*table.values(), strict=True)]
            )
            content = stream.getvalue().encode()
        write_file(self.path(number), content, key=OUT)

    def column(self, *names: str) -> dict[str, Any]:
        """Return columns of all written rows in order: arrays of numbers, NaN where there is none, and of texts."""
        tables = [self._read_part(self.path(number), names) for number in self.part_numbers()]
        found = {}
        for name in names:
            columns = [table[name] for table in tables]
            found[name] = np.concatenate([np.empty(0), *columns])
        return found

    def _read_part(self, path: Path, names: Sequence[str]) -> dict[str, Any]:
        if self.suffix == PARQUET:
            table = parquet("out", str(path)).read_table(path, columns=list(names)).to_pydict()
        else:
            with path.open(newline="", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            table = {name: [row[name] for row in rows] for name in names}
        found = {}
        for name in names:
            is_text = name in self.plan.texts
            empty = "" if is_text else math.nan
            cells = [empty if each in ("", None) else each for each in table[name]]
            found[name] = np.array(cells, object if is_text else float)
        return found


class StudyRecord(StrictTable):
    """The file of a folder: inputs of the study with their hashes and versions, and the rows of a part."""

    inputs: dict[str, Any]
    rows_a_part: int


def open_study(
    folder: Path, plan: StudyPlan, files: Mapping[str, bytes], workers: int, size: int | None, rows: Real
) -> StudyFolder:
    """Return the parts of a study in a folder, a new one or that of an interrupted run, with the files that declare it.

    `rows` are the values of the first rows.  Raises ParameterError for a folder that has another study.
    """
    space = plan.space
    name = "study.json"
    file = folder / name
    suffix = PARQUET if importlib.util.find_spec("pyarrow") else ".csv"
    hashes = {
        each: hashlib.sha256(content).hexdigest() for each, content in files.items() if each != STUDY_FILE
    }
    inputs = json.loads(
        json.dumps(
            {
                "over": list(space.over.items()),
                "columns": plan.names,
                "draws": space.draws,
                "seed": space.seed,
                "list": space.listing and _sha256(space.listing.path),
                "parts": suffix,
                "versions": versions(),
                "posterior": space.posterior and space.posterior.model_dump(),
                **hashes,
            }
        )
    )
    if file.exists():
        known = validated_file(
            StudyRecord, file, 1 << 20, key=OUT, what=f"a {name} of tfarm study; choose another folder"
        )
        other = sorted(key for key in {*inputs, *known.inputs} if known.inputs.get(key) != inputs.get(key))
        require(
            not other,
            OUT,
            str(folder),
            f"has a study with other {', '.join(other)}: choose another folder (--worst adds its columns)",
        )
        count = known.rows_a_part
    else:
        count = size or rows_a_chunk(seconds_an_arm(plan, rows[:3]), space.count, workers)
    digest = hashlib.sha256(json.dumps([inputs, count]).encode()).hexdigest()
    parts = StudyFolder(folder, plan, digest, count, suffix, space.count)
    # is refused before a file is written
    parts.part_numbers()
    if not file.exists():
        text = StudyRecord(inputs=inputs, rows_a_part=count).model_dump_json(indent=1)
        for each, content in {**files, name: f"{text}\n".encode()}.items():
            write_file(folder / each, content, key=OUT)
    return parts


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of the packages on which numbers depend."""
    # versions that all workers have in common
    packages = ("tfarm", "numpy", "scipy", "numba")
    return {name: importlib.import_module(name).__version__ for name in packages}


# ------------------------------------------------------------------------------------------------------------ runs


def run_parts(
    folder: Path,
    plan: StudyPlan,
    files: Mapping[str, bytes],
    resources: Resources,
    size: int | None,
) -> StudyFolder:
    """Write the missing parts of a study to its folder."""
    count = min(CHECKED, plan.space.count)
    listing = plan.space.listing
    rows = plan.space.rows(0, count, None if listing is None else next(listing.blocks([(0, count)])))
    check_rows(plan, rows)
    parts = open_study(folder, plan, files, resources.workers, size, rows)

    def calls(ends: Sequence[tuple[int, int]]) -> Iterator[Callable[[], Chunk]]:
        blocks = [None] * len(ends) if listing is None else listing.blocks(ends)
        for (first, last), listed in zip(ends, blocks, strict=True):
            yield partial(chunk, plan, first, last, listed)

    write_missing_parts(parts, calls, resources, "parts of the study")
    return parts


def write_missing_parts(
    parts: StudyFolder,
    calls: Callable[[Sequence[tuple[int, int]]], Iterable[Callable[[], Chunk]]],
    resources: Resources,
    text: str,
) -> None:
    """Write the missing parts by the calls for their ranges of rows; after the deadline none is begun any more."""
    done = parts.part_numbers()
    count = parts.count
    began = time.monotonic()
    missing = sorted({*range(count)} - {*done})
    resources.progress(len(done), count, text)
    ends = [(number * parts.rows, min((number + 1) * parts.rows, parts.size)) for number in missing]
    tasks = takewhile(lambda _: not resources.is_over, zip(missing, calls(ends), strict=True))
    for ready, (number, table) in enumerate(resources.engine(tasks), start=1):
        parts.write(number, table)
        left = (time.monotonic() - began) / ready * (len(missing) - ready)
        resources.progress(len(done) + ready, count, f"{text}, {left:.0f} s left")


def search_rows(
    parts: StudyFolder, search: Callable[[Callable[[Real], Row]], object], resources: Resources
) -> list[Row] | None:
    """Return the rows of a search, which asks for the results of one row of values (1, keys) after another.

    Each is written as a part and computed once: an interrupted search goes on where it was.  None where it has no end
    before the deadline.
    """
    known = rows_of(parts.column(*parts.plan.columns))
    seen = list[Row]()

    def result(values: Real) -> Row:
        n = len(seen)
        if n == len(known):
            if resources.is_over:
                raise TimeoutError
            table = table_of(parts.plan, n, values)
            parts.write(n, table)
            known.extend(rows_of(table))
        seen.append(known[n])
        return known[n]

    try:
        search(result)
    except TimeoutError:
        return None
    return seen


def check_rows(plan: StudyPlan, rows: Real) -> None:
    """Raise ParameterError where some of the first rows are illegal, with their number and the first reason."""
    # which refuse an unknown key, before any row
    subjects = plan.subjects
    errors = dict[int, ParameterError]()
    for number, row in enumerate(rows.tolist()):
        try:
            subjects.at(row)
        except ParameterError as error:
            errors[number] = error
    for number, first in errors.items():
        remedy = f"{len(errors)} of {len(rows)} arms are illegal, the first in row {number}: {first.remedy}"
        raise ParameterError(key=first.key, value=first.value, remedy=remedy)


# ------------------------------------------------------------------------------------------------------------ cluster


def cluster(scheduler: str, patience: float = 20) -> Any:
    """Return a client of a Dask scheduler, such as tcp://host:8786.  Raises ParameterError where none answers.

    It has `patience` [s] to answer, and as long for its first worker.  Certificates of a tls:// address are those of
    Dask's own configuration (distributed.comm.tls).
    """
    key = "--scheduler"
    distributed = extra("distributed", "cluster", key, scheduler)
    # whose errors come as one line of ours
    for name in ("distributed", "distributed.client"):
        getLogger(name).setLevel("CRITICAL")
    try:
        client = distributed.Client(scheduler, timeout=patience, set_as_default=False)
        client.wait_for_workers(1, timeout=patience)
    except (OSError, ValueError, TypeError) as error:
        raise ParameterError(
            key=key,
            value=scheduler,
            remedy=f"no scheduler with a worker answers within {patience:g} s ({str(error)[:120]}); give tcp://HOST:PORT",
        ) from None
    return client


def on_cluster(tasks: Iterator[ChunkTask], client: Any) -> Iterator[tuple[int, Chunk]]:
    """Yield each task with its table as it comes from the workers of a Dask client, at most one a worker unread.

    A task of a lost worker goes to another one.  Raises ConvergenceError where the scheduler is gone, or the workers of
    one task again and again, and for a worker with other versions than here.
    """
    queue = extra("distributed", "cluster", "client", client).as_completed(loop=client.loop)
    running = dict[str, int]()
    try:
        while True:
            for number, call in islice(tasks, max(not running, len(client.nthreads()) - len(running))):
                future = client.submit(_with_versions, call, pure=False)
                running[future.key] = number
                queue.add(future)
            if not running:
                return
            future = next(queue)
            theirs, table = future.result()
            require(
                theirs == versions(),
                "versions of a worker",
                theirs,
                f"install those of this machine: {versions()}",
            )
            yield running.pop(future.key), table
    except Exception as error:
        # a chunk itself raises none
        raise ConvergenceError(
            f"the cluster failed ({type(error).__name__}: {one_line(str(error), 200)}); run the study again",
            None,
            None,
        ) from None


def _with_versions(call: Callable[[], Chunk]) -> tuple[dict[str, str], Chunk]:
    return versions(), call()
