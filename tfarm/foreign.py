"""Binary files of other programs (.mat, HDF5, UFF, Parquet), read by a process with limits of time and memory.

Their readers are not ours: on a file from outside one may end its process, loop or fill the memory.  Arrays come back
through a pipe as .npy without pickle, rows of a Parquet file as CSV.
"""

import csv
import io
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import IO, Any, cast

import numpy as np

from tfarm.errors import ParameterError
from tfarm.stopping import undone_if_stopped

# seconds, of a file or a batch of rows: the largest file takes 8 s of a processor, which others may share
LONGEST = 120
# the system's, where it has one
alarm: Callable[[int], object] = getattr(signal, "alarm", lambda _: None)


@contextmanager
def read_by_child(kind: str, path: str | os.PathLike[str], *, key: str, remedy: str) -> Iterator[IO[bytes]]:
    """Yield the output of a process that reads a file of that kind: see `main`.

    Raises ParameterError, naming `key`, where it ends with an error, by a signal or at a limit.
    """
    command = [sys.executable, "-P", "-W", "ignore", "-m", "tfarm.foreign", kind, os.fspath(path)]
    paths = os.pathsep.join(each or os.getcwd() for each in sys.path)
    own = os.environ | {"PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "PYTHONIOENCODING": "utf-8"}
    with (
        subprocess.Popen(
            command, env=own, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process,
        undone_if_stopped(process.kill),
    ):
        yield cast("Any", process.stdout)
        errors = process.communicate()[1].decode("utf-8", "replace").splitlines()
    if code := process.returncode:
        ends = {-getattr(signal, "SIGALRM", 0): f"its reader takes more than {LONGEST} s"}
        last = [f"its reader was ended by {code}", *errors][-1][:200]
        reason = last if code > 0 else ends.get(code, f"its reader was ended by signal {-code}")
        raise ParameterError(key=key, value=os.fspath(path), remedy=f"{remedy}: {reason}")


def read_arrays(kind: str, path: str | os.PathLike[str], *, key: str, remedy: str) -> dict[str, Any]:
    """Return the arrays of a binary file by their names.  Raises ParameterError as `read_by_child` does."""
    with read_by_child(kind, path, key=key, remedy=remedy) as output:
        load = partial(np.load, io.BytesIO(output.read()), allow_pickle=False)
    return {str(name): load() for name in load()}


# ------------------------------------------------------------------------------------------------------------ child


def of_mat(path: str) -> Iterator[memoryview]:
    """Return the numbers of a .mat file (up to version 7.2); those of a structure as "structure.name"."""
    from scipy.io import loadmat

    found: dict[str, Any] = {}
    for name, value in loadmat(path, appendmat=False, squeeze_me=False, struct_as_record=True).items():
        if not name.startswith("__"):
            found |= _numbers(name, value)
    return pack_arrays(found)


def _numbers(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the dense arrays of a variable; none of a cell or an object."""
    # of a sparse matrix
    value = value.toarray() if hasattr(value, "toarray") else np.asarray(value)
    if value.size == 1:
        for each in value.dtype.names or ():
            yield from _numbers(f"{name}.{each}", value[each].item())
    if value.dtype.kind in "biufcU":
        yield name, value


def of_hdf5(path: str) -> Iterator[memoryview]:
    """Return the numbers of an HDF5 file by their paths, "log/enc [deg]" by the attribute `unit` or `units`.

    A field of a compound type is "log/table.enc".  What lies in other files is left out.
    """
    import h5py

    found: dict[str, Any] = {}

    def visit(name: str, each: Any) -> None:
        if not isinstance(each, h5py.Dataset) or each.ndim not in (1, 2) or each.external or each.is_virtual:
            return
        if each.dtype.names:
            found.update({f"{name}.{field}": each[field] for field in each.dtype.names})
        else:
            found[name + _unit_suffix(each.attrs.get("unit", each.attrs.get("units")))] = each[()]

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return pack_arrays({name: value for name, value in found.items() if value.dtype.kind in "biuf"})


def _unit_suffix(unit: Any) -> str:
    """Return " [deg]" for a unit as text or bytes; nothing for anything else."""
    if isinstance(unit, bytes):
        unit = unit.decode("utf-8", "replace")
    return f" [{unit}]" if isinstance(unit, str) and unit else ""


def of_uff(path: str) -> Iterator[memoryview]:
    """Return frequencies and values of each frequency response function (data set 58, function 4) of a UFF file."""
    found: dict[str, Any] = {}
    # 18: the kind of an abscissa that is a frequency
    for each in _uff_functions(path, function=4, abscissa=18):
        found |= {f"x{len(found) // 2}": each["x"], f"data{len(found) // 2}": each["data"]}
    return pack_arrays(found)


def _uff_functions(path: str, *, function: int, abscissa: int) -> Iterator[Any]:
    """Yield the data sets 58 of a UFF file of that function over that abscissa."""
    import pyuff

    file = pyuff.UFF(path)
    for n, kind in enumerate(file.get_set_types()):
        each = file.read_sets(n) if int(kind) == 58 else {}
        if each.get("func_type") == function and each.get("abscissa_spec_data_type", abscissa) == abscissa:
            yield each


def of_uff_time(path: str) -> Iterator[memoryview]:
    """Return times and values of each time response (data set 58, function 1) of a UFF file.

    Its name is its first line of identification, else signal1, signal2, ... in the order of the file.
    """
    found: dict[str, Any] = {}
    # 17: the kind of an abscissa that is a time
    for each in _uff_functions(path, function=1, abscissa=17):
        times = found.setdefault("t", each["x"])
        if not np.array_equal(times, each["x"]):
            raise ValueError(f"the times of its record {len(found)} are others than those of the first")
        unit = each.get("ordinate_axis_units_lab", "").strip()
        words = _unit_suffix("" if unit == "NONE" else unit)
        name = each["id1"].strip()
        if name in ("", "NONE") or f"{name}{words}" in found:
            name = f"signal{len(found)}"
        found[f"{name}{words}"] = each["data"]
    return pack_arrays(found)


def pack_arrays(found: dict[str, Any]) -> Iterator[memoryview]:
    """Yield the names of arrays, then each of them."""
    for each in (np.array([*found], dtype=str), *found.values()):
        stream = io.BytesIO()
        np.save(stream, each, allow_pickle=False)
        yield stream.getbuffer()


def of_parquet(path: str) -> Iterator[bytes]:
    """Yield names and rows of a Parquet file as CSV, a batch at a time."""
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        yield _csv_lines([file.schema_arrow.names])
        for batch in file.iter_batches():
            columns = (column.to_pylist() for column in batch.columns)
            yield _csv_lines(zip(*columns, strict=True))


def of_parquet_columns(path: str) -> Iterator[memoryview]:
    """Return the columns of numbers of a Parquet file, nan where one is missing, by names and units of its fields."""
    import pyarrow
    from pyarrow.parquet import ParquetFile

    # older ones unpickle what they read (CVE-2023-47248)
    if tuple(map(int, pyarrow.__version__.split(".")[:3])) < (14, 0, 1):
        raise ImportError("pyarrow 14.0.1 or newer is needed")
    found: dict[str, Any] = {}
    with ParquetFile(path) as file:
        table = file.read()
    for field, column in zip(table.schema, table.columns, strict=True):
        if pyarrow.types.is_integer(field.type) or pyarrow.types.is_floating(field.type):
            unit = (field.metadata or {}).get(b"unit")
            found[field.name + _unit_suffix(unit)] = column.to_numpy()
    return pack_arrays(found)


def _csv_lines(rows: Iterable[Any]) -> bytes:
    """Return rows as lines of CSV."""
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()


def main(kind: str, path: str) -> None:
    """Write the content of a file to standard output; the last line of an error is its reason."""
    readers: dict[str, Callable[[str], Iterator[Any]]] = {
        "mat": of_mat,
        "hdf5": of_hdf5,
        "uff": of_uff,
        "uff-time": of_uff_time,
        "parquet": of_parquet,
        "columns": of_parquet_columns,
    }
    # of a system without limits, or with a tighter one
    with suppress(ImportError, ValueError, OSError):
        import resource

        # no file with the memory of a reader that crashed
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # bytes: a UFF file of 256 MiB, the largest that is read, takes 3.4e9
        most = 4 << 30
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    with open(os.dup(1), "wb") as output:
        # a reader may print
        os.dup2(2, 1)
        alarm(LONGEST)
        for each in readers[kind](path):
            # while it waits to be taken
            alarm(0)
            output.write(each)
            alarm(LONGEST)


if __name__ == "__main__":
    main(*sys.argv[1:])
