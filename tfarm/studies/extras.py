"""Optional packages of studies: pyarrow (extra `study`) for Parquet, Dask (extra `cluster`) for other machines."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from logging import getLogger
from pathlib import Path
from typing import Any, TypeVar

from tfarm.errors import ConvergenceError, ParameterError, require

Result = TypeVar("Result")
PATIENCE = 20  # seconds for a scheduler to answer
SCHEDULER = "--scheduler"
LEAST_PYARROW = (14, 0, 1)  # older ones unpickle what they read (CVE-2023-47248)
PACKAGES = ("tfarm", "numpy", "scipy", "numba")  # versions that all workers have in common


def has_parquet() -> bool:
    """Return whether Parquet can be read and written."""
    return find_spec("pyarrow") is not None


def extra(package: str, name: str, key: str, value: object) -> Any:
    """Return an optional package.  Raises ParameterError, naming its extra, where it is missing."""
    try:
        return import_module(package)
    except ImportError:
        remedy = f"needs {package.partition('.')[0]}: pip install 'tfarm[{name}]'"
        raise ParameterError(key=key, value=value, remedy=remedy) from None


def _parquet(key: str, value: object) -> Any:
    extra("pyarrow", "study", key, value)
    version = tuple(int(part) for part in import_module("pyarrow").__version__.split(".")[:3])
    require(version >= LEAST_PYARROW, key, value, "needs pyarrow 14.0.1 or newer: pip install 'tfarm[study]'")
    return import_module("pyarrow.parquet")


def parquet_rows(path: Path) -> Iterator[Sequence[Any]]:
    """Yield the names of the columns of a Parquet file, then its rows, a batch in memory at a time."""
    module = _parquet("list", str(path))
    try:
        with module.ParquetFile(path) as file:
            yield file.schema_arrow.names
            for batch in file.iter_batches():
                yield from zip(*(column.to_pylist() for column in batch.columns), strict=True)
    except (OSError, import_module("pyarrow").ArrowException) as error:
        remedy = f"cannot be read ({error}); give a CSV or Parquet file with a column a key"
        raise ParameterError(key="list", value=str(path), remedy=remedy) from None


def parquet_bytes(columns: Mapping[str, Sequence[Any]], texts: Iterable[str]) -> bytes:
    """Return a table as a Parquet file, of texts and of numbers."""
    module, arrow, buffer = _parquet("out", "Parquet"), import_module("pyarrow"), io.BytesIO()
    kinds = {True: arrow.string(), False: arrow.float64()}
    arrays = {name: arrow.array(values, kinds[name in texts]) for name, values in columns.items()}
    module.write_table(arrow.table(arrays), buffer)
    return buffer.getvalue()


def parquet_columns(path: Path, names: Sequence[str]) -> dict[str, list[Any]]:
    """Return some columns of a Parquet file."""
    found: dict[str, list[Any]] = _parquet("out", str(path)).read_table(path, columns=list(names)).to_pydict()
    return found


@contextmanager
def cluster(scheduler: str) -> Iterator[Any]:
    """Yield a client of a Dask scheduler, such as tcp://host:8786.  Raises ParameterError where it does not answer.

    Certificates of a tls:// address are those of Dask's own configuration (distributed.comm.tls).
    """
    distributed = extra("distributed", "cluster", SCHEDULER, scheduler)
    for name in ("distributed", "distributed.client"):  # whose errors come as one line of ours
        getLogger(name).setLevel("CRITICAL")
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        remedy = f"does not answer within {PATIENCE} s ({str(error)[:120]}); give tcp://HOST:PORT of a dask scheduler"
        raise ParameterError(key=SCHEDULER, value=scheduler, remedy=remedy) from None
    with client:
        yield client


def cluster_size(client: Any) -> int:
    """Return the number of workers of a Dask client.  Raises ParameterError for none, and for other versions there."""
    address = client.scheduler.address
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        remedy = f"has no worker within {PATIENCE} s: start some with `dask worker {address} --nthreads 1`"
        raise ParameterError(key=SCHEDULER, value=address, remedy=remedy) from None
    found = client.get_versions(packages=list(PACKAGES))
    for place, theirs in {"scheduler": found["scheduler"], **found["workers"]}.items():
        _must_agree(place, {name: theirs["packages"][name] for name in PACKAGES})
    return len(client.nthreads())


def on_cluster(tasks: Iterator[tuple[int, Callable[[], Result]]], client: Any) -> Iterator[tuple[int, Result]]:
    """Yield each task with its result as it comes from the workers of a Dask client, at most one a worker unread.

    A task of a lost worker goes to another one.  Raises ParameterError for a worker with other versions than here,
    ConvergenceError where the scheduler is gone, or the workers of one task again and again.
    """
    distributed = extra("distributed", "cluster", "client", client)
    queue, running = distributed.as_completed(loop=client.loop), dict[str, int]()
    try:
        while True:
            for number, call in islice(tasks, max(1, len(client.nthreads())) - len(running)):
                future = client.submit(_with_versions, call, pure=False)
                running[future.key] = number
                queue.add(future)
            if not running:
                return
            future = next(queue)
            theirs, result = future.result()
            _must_agree("worker", theirs)
            yield running.pop(future.key), result
    except (OSError, TimeoutError, CancelledError, distributed.KilledWorker) as error:
        raise ConvergenceError(f"the scheduler or its workers are gone ({type(error).__name__})", None, None) from None


def _with_versions(call: Callable[[], Result]) -> tuple[dict[str, str], Result]:
    return versions(), call()


def _must_agree(place: str, theirs: Mapping[str, str]) -> None:
    for name, here in versions().items():
        require(theirs[name] == here, f"{name} of {place}", theirs[name], f"the version here is {here}: install that")


def versions() -> dict[str, str]:
    """Return the versions of the packages on which numbers depend."""
    return {name: import_module(name).__version__ for name in PACKAGES}
