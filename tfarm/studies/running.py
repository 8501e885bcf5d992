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

from tfarm.arm import AnyLaw, Arm, as_law
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.dsp.chain import file_text
from tfarm.errors import ConvergenceError, ParameterError, TfarmError, one_line, require
from tfarm.files import locked, read_file, write_file
from tfarm.processes import shared
from tfarm.tuner import Plan as TunerPlan

from .extras import has_parquet, on_cluster, parquet_bytes, parquet_columns, versions
from .quantities import COLUMNS, values_of
from .space import Listing, Space, Subjects

Progress = Callable[[int, int, str], object]
ROW, FAILED = "row", "failed"  # columns of every part: number of the row, and the reason of a missing result
FILE, PREFIX = "study.json", "part-"
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

    def inputs(self, listing: Listing | None) -> dict[str, Any]:
        """Return all that the results depend on, as JSON has it."""
        space = self.space
        return {
            "arm": file_text(self.arm, self.chain), "law": repr(as_law(self.law)), "names": list(self.names),
            "distributions": {key: [each.kind, *each.numbers] for key, each in space.distributions.items()},
            "grids": {key: list(values) for key, values in space.grids.items()},
            "posterior": space.posterior and hashlib.sha256(space.posterior.model_dump_json().encode()).hexdigest(),
            "list": None if listing is None else listing.sha256, "draws": space.draws, "seed": space.seed,
            "versions": versions(),
        }  # fmt: skip


def chunk(plan: Plan, first: int, last: int, listed: Real | None = None) -> dict[str, list[Any]]:
    """Return the table of rows first to last - 1: column by column, with the reason where a row has no result."""
    return table_of(plan, first, plan.space.rows(first, last, listed))


def table_of(plan: Plan, first: int, rows: Real) -> dict[str, list[Any]]:
    """Return the table of rows of values (rows, keys), numbered from `first`."""
    table: dict[str, list[Any]] = {name: [] for name in plan.columns}
    for number, row in enumerate(rows.tolist(), start=first):
        found: dict[str, Any] = {ROW: number, **dict(zip(plan.space.keys, row, strict=True))}
        try:
            found |= values_of(plan.subjects.at(row), plan.names)
        except TfarmError as error:
            found[FAILED] = one_line(str(error), LONGEST_REASON)
        except Exception as error:  # one arm never ends a study: its reason is kept, and counted
            found[FAILED] = one_line(f"{type(error).__name__}: {error}", LONGEST_REASON)
        for name, column in table.items():
            column.append(found.get(name))
    return table


def results(plan: Plan, first: int, last: int) -> dict[str, list[Any]]:
    """Return the table of rows first to last - 1.  Raises ConvergenceError for the first row without a result."""
    table = chunk(plan, first, last)
    for reason in filter(None, table[FAILED]):
        raise ConvergenceError(reason, None, None)
    return table


def check_rows(plan: Plan, listing: Listing | None) -> None:
    """Raise ParameterError where a number of the first rows is illegal, with their number and the first reason."""
    count = min(CHECKED, plan.space.count)
    rows = plan.space.rows(0, count, None if listing is None else np.array(list(islice(listing.rows(), count))))
    errors: dict[int, ParameterError] = {}
    for number, row in enumerate(rows.tolist()):
        try:
            plan.subjects.at(row)
        except ParameterError as error:
            errors[number] = error
    for number, first in errors.items():
        remedy = f"{len(errors)} of {count} arms are illegal, the first in row {number}: {first.remedy}"
        raise ParameterError(key=first.key, value=first.value, remedy=remedy)


def rows_a_chunk(plan: Plan, workers: int, listing: Listing | None) -> int:
    """Return the rows of a chunk of 5 to 30 s by the median cost of a few arms."""
    times, count = [], min(PILOT, plan.space.count)
    ends = [(n, n + 1) for n in range(count)]
    for (first, last), listed in zip(ends, [None] * count if listing is None else listing.blocks(ends), strict=True):
        began = time.perf_counter()
        chunk(plan, first, last, listed)
        times.append(time.perf_counter() - began)
    cost = float(np.median(times[1:] or times))  # the first one compiles
    whole = cost * plan.space.count / (CHUNKS_A_WORKER * workers)
    seconds = min(max(whole, LEAST_SECONDS), MOST_SECONDS)
    return max(1, min(round(seconds / cost), MOST_ROWS, math.ceil(plan.space.count / workers)))


@dataclass(frozen=True)
class Parts:
    """The folder of a study, with the parts that are written."""

    folder: Path
    plan: Plan
    digest: str
    rows: int  # of a part
    suffix: str

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
        require(
            not strange, "out", str(self.folder), f"{strange[:1]} is a part of another study: choose another folder"
        )
        return found

    def write(self, number: int, table: Mapping[str, Sequence[Any]]) -> None:
        """Write the table of a part under a temporary name, then rename it."""
        if self.suffix == ".parquet":
            content = parquet_bytes(table, self.plan.texts)
        else:
            stream = io.StringIO()
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerows([tuple(table), *zip(*table.values(), strict=True)])
            content = stream.getvalue().encode()
        write_file(self.path(number), content, key="--out")

    def column(self, *names: str) -> dict[str, Any]:
        """Return columns of all written rows in order: arrays of numbers, NaN where there is none, and of texts."""
        found: dict[str, list[Any]] = {name: [] for name in names}
        for number in self.written:
            table = self._read(self.path(number), names)
            for name in names:
                values = [("" if each is None else each) if name in self.plan.texts else _number(each)
                          for each in table[name]]  # fmt: skip
                found[name].append(np.array(values, dtype=object if name in self.plan.texts else float))
        return {name: np.concatenate(arrays or [np.empty(0)]) for name, arrays in found.items()}

    def _read(self, path: Path, names: Sequence[str]) -> Mapping[str, Sequence[Any]]:
        if self.suffix == ".parquet":
            return parquet_columns(path, names)
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        columns = dict(zip(head, zip(*rows, strict=True), strict=True))
        return {name: columns[name] for name in names}


def _number(value: Any) -> float:
    return math.nan if value in ("", None) else float(value)


def opened(folder: Path, plan: Plan, listing: Listing | None, workers: int, size: int | None) -> Parts:
    """Return the parts of a study in a folder, a new one or that of an interrupted run.

    Raises ParameterError for a folder that has another study.
    """
    inputs = plan.inputs(listing)
    text = json.dumps(inputs, sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()
    file = folder / FILE
    if file.exists():
        try:
            known = json.loads(read_file(file, MOST_BYTES, key="out", what=f"a {FILE}"))
            other = sorted(key for key in inputs if known["inputs"].get(key) != inputs[key])
            rows, suffix = int(known["rows_a_part"]), str(known["suffix"])
        except (ValueError, KeyError, TypeError, AttributeError):
            raise ParameterError(
                key="out", value=str(file), remedy="is no file of a study: choose another folder"
            ) from None
        words = f"has a study with another {', '.join(other)}: choose another folder, or run that study"
        require(not other, "out", str(folder), words)
        require(suffix == ".csv" or has_parquet(), "out", str(folder), "has Parquet parts: pip install 'tfarm[study]'")
        return Parts(folder, plan, digest, rows, suffix)
    check_rows(plan, listing)
    rows = size or rows_a_chunk(plan, workers, listing)
    parts = Parts(folder, plan, digest, rows, ".parquet" if has_parquet() else ".csv")
    folder.mkdir(parents=True, exist_ok=True)
    assert parts.written == []
    columns = [{"name": name, "label": of.label, "unit": of.unit, "meaning": of.help}
               for name in plan.names for of in [COLUMNS[name].of]]  # fmt: skip
    known = {
        "inputs": inputs,
        "rows": plan.space.count,
        "rows_a_part": rows,
        "suffix": parts.suffix,
        "columns": columns,
    }
    write_file(file, (json.dumps(known, indent=1) + "\n").encode(), key="--out")
    return parts


def run(
    parts: Parts,
    listing: Listing | None,
    workers: int,
    client: Any,
    stop_after: float | None,
    progress: Progress | None,
) -> None:
    """Write the missing parts; after `stop_after` seconds none is begun any more."""
    began, done = time.monotonic(), set(parts.written)
    missing = [number for number in range(parts.count) if number not in done]
    with locked(parts.folder / FILE, "--out"):
        tasks = _tasks(parts, listing, missing, began + (math.inf if stop_after is None else stop_after))
        results = on_cluster(tasks, client) if client is not None else shared(tasks, workers)
        for ready, (number, table) in enumerate(results, start=1):
            parts.write(number, table)
            if progress is not None:
                left = (time.monotonic() - began) / ready * (len(missing) - ready)
                progress(parts.count - len(missing) + ready, parts.count, f"parts of the study, {left:.0f} s left")


def _tasks(
    parts: Parts, listing: Listing | None, missing: Sequence[int], deadline: float
) -> Iterator[tuple[int, Callable[[], dict[str, list[Any]]]]]:
    """Yield the number of each missing part with the call that returns its table."""
    ends = [parts.ends(number) for number in missing]
    points = parts.plan.space.points
    blocks = (listing.blocks([(first // points, (last - 1) // points + 1) for first, last in ends])
              if listing is not None else (None for _ in ends))  # fmt: skip
    for number, (first, last), listed in zip(missing, ends, blocks, strict=True):
        if time.monotonic() >= deadline:
            return
        yield number, partial(chunk, parts.plan, first, last, listed)


def usual_workers() -> int:
    """Return the number of processors of this machine that may be used."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
