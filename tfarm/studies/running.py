"""Chunks of a study: rows in, a table out, written as parts that a later run completes.

A chunk is a range of rows and one function; processes of this machine or the workers of a Dask cluster return its table
and the parent writes it.  Which rows a chunk has is settled before the first run, from the measured cost of a few arms,
and kept in `study.json`: an interrupted study goes on with the parts that are missing.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError, ParameterError, TfarmError, one_line, require
from tfarm.files import locked, make_folder, read_file, write_file
from tfarm.processes import shared
from tfarm.tuner import Plan as TunerPlan

from .declared import STUDY_FILE, files_of
from .extras import has_parquet, on_cluster, parquet_bytes, parquet_columns, versions
from .quantities import COLUMNS, FAILED, values_of
from .space import Listing, Space, Subjects

Progress = Callable[[int, int, str], object]
Chunk = dict[str, list[Any]]  # columns of a range of rows
OUT = "--out"  # the key of errors of the folder
Task = tuple[int, Callable[[], Chunk]]  # number of a part, and the call that returns its table
ROW = "row"  # column of the number of the row, from 0
FILE, PREFIX, PARQUET = "study.json", "part-", ".parquet"
MOST_BYTES = 1 << 20  # of that file
PILOT = 4  # rows whose cost is measured
LEAST_SECONDS, MOST_SECONDS = 5.0, 30.0  # of a chunk
CHUNKS_A_WORKER = 10  # where that leaves them within these
MOST_ROWS = 50_000  # of a chunk
CHECKED = 1000  # rows whose arms are built before the first run
LONGEST_REASON = 200  # characters


@dataclass(frozen=True)
class Plan:
    """A study: arm, controller and chain, their varied numbers and the columns that are asked for."""

    arm: Arm
    law: AnyLaw
    chain: Chain
    space: Space
    names: tuple[str, ...]
    tuner: TunerPlan | None = None  # the usual one of each arm by default

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (ROW, *self.space.keys, *self.names, FAILED)

    @property
    def texts(self) -> set[str]:
        """Names of the columns of texts."""
        return {FAILED, *(name for name in self.names if COLUMNS[name].is_text)}

    @cached_property
    def subjects(self) -> Subjects:
        """The arms and loops of the rows."""
        return Subjects(self.arm, self.law, self.chain, self.space.keys, self.tuner)


def chunk(plan: Plan, first: int, last: int, listed: Real | None = None) -> Chunk:
    """Return the table of rows first to last - 1: column by column, with the reason where a row has no result."""
    return table_of(plan, first, plan.space.rows(first, last, listed))


def table_of(plan: Plan, first: int, rows: Real) -> Chunk:
    """Return the table of rows of values (rows, keys), numbered from `first`."""
    table: Chunk = {name: [] for name in plan.columns}
    for number, row in enumerate(rows.tolist(), start=first):
        found: dict[str, Any] = {ROW: number, **dict(zip(plan.space.keys, row, strict=True))}
        try:
            found |= values_of(plan.subjects.at(row), plan.names)
        except Exception as error:  # one arm never ends a study: its reason is kept, and counted
            found[FAILED] = str(error) if isinstance(error, TfarmError) else f"{type(error).__name__}: {error}"
        found[FAILED] = found[FAILED] and one_line(found[FAILED], LONGEST_REASON)
        for name, column in table.items():
            column.append(found.get(name))
    return table


def results(plan: Plan, first: int, last: int) -> Chunk:
    """Return the table of rows first to last - 1.  Raises ConvergenceError for the first row without a result."""
    table = chunk(plan, first, last)
    for reason in filter(None, table[FAILED]):
        raise ConvergenceError(reason, None, None)
    return table


def first_rows(plan: Plan, count: int, listing: Listing | None) -> Real:
    """Return the values of the first rows (rows, keys), at most that number."""
    count = min(count, plan.space.count)
    return plan.space.rows(0, count, None if listing is None else np.array(list(islice(listing.rows(), count))))


def check_rows(plan: Plan, listing: Listing | None) -> None:
    """Raise ParameterError where a number of the first rows is illegal, with their number and the first reason."""
    rows, errors = first_rows(plan, CHECKED, listing), dict[int, ParameterError]()
    for number, row in enumerate(rows.tolist()):
        try:
            plan.subjects.at(row)
        except ParameterError as error:
            errors[number] = error
    for number, first in errors.items():
        remedy = f"{len(errors)} of {len(rows)} arms are illegal, the first in row {number}: {first.remedy}"
        raise ParameterError(key=first.key, value=first.value, remedy=remedy)


def seconds_an_arm(plan: Plan, rows: Real) -> float:
    """Return the median time of the first rows of values (rows, keys) [s]."""
    times = []
    for row in rows[:PILOT]:
        began = time.perf_counter()
        table_of(plan, 0, row[None])
        times.append(time.perf_counter() - began)
    return float(np.median(times[1:] or times))  # the first one compiles


def rows_a_chunk(cost: float, count: int, workers: int) -> int:
    """Return the rows of a chunk of 5 to 30 s for arms of that cost [s], so that all workers end together."""
    whole = cost * count / workers
    seconds = min(max(whole / CHUNKS_A_WORKER, LEAST_SECONDS), MOST_SECONDS)
    return min(math.ceil(count / (workers * max(1, round(whole / seconds)))), MOST_ROWS)


@dataclass(frozen=True)
class Parts:
    """The folder of a study, with the parts that are written."""

    folder: Path
    plan: Plan
    digest: str
    rows: int  # of a part
    suffix: str
    cost: float  # seconds an arm, as measured before the first run

    @property
    def count(self) -> int:
        """Number of parts of the whole study."""
        return math.ceil(self.plan.space.count / self.rows)

    def path(self, number: int) -> Path:
        """Return the file of a part."""
        return self.folder / f"{PREFIX}{self.digest[:8]}-{number:06}{self.suffix}"

    def ends(self, number: int) -> tuple[int, int]:
        """Return the first row of a part and the one after its last."""
        return number * self.rows, min((number + 1) * self.rows, self.plan.space.count)

    @property
    def written(self) -> list[int]:
        """Numbers of the parts that are there.  Raises ParameterError for a part of another study."""
        names = {each.name for each in self.folder.glob(f"{PREFIX}*")}
        found = [number for number in range(self.count) if self.path(number).name in names]
        strange = sorted(names - {self.path(number).name for number in found})
        _require(not strange, self.folder, f"{strange[:1]} is a part of another study: choose another folder")
        return found

    def write(self, number: int, table: Mapping[str, Sequence[Any]]) -> None:
        """Write the table of a part under a temporary name, then rename it."""
        if self.suffix == PARQUET:
            content = parquet_bytes(table, self.plan.texts)
        else:
            stream = io.StringIO()
            csv.writer(stream, lineterminator="\n").writerows([tuple(table), *zip(*table.values(), strict=True)])
            content = stream.getvalue().encode()
        write_file(self.path(number), content, key=OUT)

    def column(self, *names: str) -> dict[str, Any]:
        """Return columns of all written rows in order: arrays of numbers, NaN where there is none, and of texts."""
        found: dict[str, list[Any]] = {name: [np.empty(0)] for name in names}
        for number in self.written:
            table = self._read(self.path(number), names)
            for name in names:
                is_text = name in self.plan.texts
                values = [each or "" if is_text else math.nan if each in ("", None) else float(each)
                          for each in table[name]]  # fmt: skip
                found[name].append(np.array(values, dtype=object if is_text else float))
        return {name: np.concatenate(arrays[len(arrays) > 1 :]) for name, arrays in found.items()}

    def _read(self, path: Path, names: Sequence[str]) -> Mapping[str, Sequence[Any]]:
        if self.suffix == PARQUET:
            return parquet_columns(path, names)
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        return {name: [row[head.index(name)] for row in rows] for name in names}


def opened(
    folder: Path, plan: Plan, listing: Listing | None, declared: Mapping[str, Any], workers: int, size: int | None
) -> Parts:
    """Return the parts of a study in a folder, a new one or that of an interrupted run, with the files that declare it.

    Raises ParameterError for a folder that has another study.
    """
    space, file, files = plan.space, folder / FILE, files_of(plan.arm, plan.law, plan.chain, declared)
    hashes = {name: _sha256(content) for name, content in files.items() if name != STUDY_FILE}
    over = [[key, *map(list, entry.items())] for key, entry in declared["over"].items()]
    inputs = {"over": over, "columns": plan.names, "draws": space.draws, "seed": space.seed,
              "list": listing and listing.sha256, "versions": versions(), **hashes}  # fmt: skip
    text = json.dumps(inputs)
    digest, inputs = _sha256(text.encode()), json.loads(text)
    if file.exists():
        try:
            known = json.loads(read_file(file, MOST_BYTES, key=OUT, what=f"a {FILE}"))
            other = sorted(key for key in {*inputs, *known["inputs"]} if known["inputs"].get(key) != inputs.get(key))
            parts = Parts(folder, plan, digest, int(known["rows_a_part"]), str(known["suffix"]), float(known["cost_s"]))
        except (ValueError, KeyError, TypeError, AttributeError):
            remedy = "is no file of a study: choose another folder"
            raise ParameterError(key=OUT, value=str(file), remedy=remedy) from None
        _require(not other, folder, f"has a study with other {', '.join(other)}: choose another folder")
        _require(parts.suffix != PARQUET or has_parquet(), folder, "has Parquet parts: pip install 'tfarm[study]'")
        return parts
    cost = seconds_an_arm(plan, first_rows(plan, PILOT, listing))
    rows = size or rows_a_chunk(cost, space.count, workers)
    parts = Parts(folder, plan, digest, rows, PARQUET if has_parquet() else ".csv", cost)
    _require(not parts.written, folder, f"has parts, and no {FILE}: choose another folder")
    columns = [{"name": name, "label": of.label, "unit": of.unit, "meaning": of.help}
               for name in plan.names for of in [COLUMNS[name].of]]  # fmt: skip
    known = {"inputs": inputs, "rows": space.count, "rows_a_part": rows, "suffix": parts.suffix, "cost_s": cost,
             "columns": columns}  # fmt: skip
    for name, content in {**files, FILE: (json.dumps(known, indent=1) + "\n").encode()}.items():
        write_file(folder / name, content, key=OUT)
    return parts


def _require(is_met: object, folder: Path, remedy: str) -> None:
    require(is_met, OUT, str(folder), remedy)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def run(
    folder: Path,
    plan: Plan,
    listing: Listing | None,
    declared: Mapping[str, Any],
    workers: int,
    client: Any,
    stop_after: float | None,
    size: int | None,
    progress: Progress,
) -> Parts:
    """Write the missing parts of a study to its folder; after `stop_after` seconds none is begun any more."""
    deadline = time.monotonic() + (math.inf if stop_after is None else stop_after)
    check_rows(plan, listing)
    make_folder(folder, key=OUT)
    with locked(folder, OUT):
        parts = opened(folder, plan, listing, declared, workers, size)
        done, began = set(parts.written), time.monotonic()
        missing = [number for number in range(parts.count) if number not in done]
        tasks = _tasks(parts, listing, missing, deadline)

        def advance(ready: int, left: float) -> None:
            progress(len(done) + ready, parts.count, f"parts of the study, {left:.0f} s left")

        advance(0, parts.cost * parts.rows * len(missing) / workers)
        try:
            for ready, (number, table) in enumerate(computed(tasks, workers, client), start=1):
                parts.write(number, table)
                advance(ready, (time.monotonic() - began) / ready * (len(missing) - ready))
        except ConvergenceError as error:
            words = f"{error}; the same command again completes the study"
            raise ConvergenceError(words, None, None) from None
    return parts


def _tasks(parts: Parts, listing: Listing | None, missing: Sequence[int], deadline: float) -> Iterator[Task]:
    """Yield the number of each missing part with the call that returns its table."""
    ends = [parts.ends(number) for number in missing]
    blocks = [None] * len(ends) if listing is None else listing.blocks(ends)
    for number, (first, last), listed in zip(missing, ends, blocks, strict=True):
        if time.monotonic() >= deadline:
            return
        yield number, partial(chunk, parts.plan, first, last, listed)


def computed(
    tasks: Iterator[tuple[int, Callable[[], Chunk]]], workers: int, client: Any
) -> Iterator[tuple[int, Chunk]]:
    """Yield each task with its table as it comes, from processes of this machine or from those of a Dask client."""
    return shared(tasks, workers) if client is None else on_cluster(tasks, client)


def usual_workers() -> int:
    """Return the number of processors of this machine that may be used."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
