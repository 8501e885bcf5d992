"""Columns of a record's file: text is read here, every other format by a process of its own (`tfarm.foreign`)."""

import hashlib
import os
from collections.abc import Container
from importlib.util import find_spec
from pathlib import Path

from tfarm.arrays import Real
from tfarm.errors import require
from tfarm.files import read_file, read_mat
from tfarm.fitting.data import MOST_RECORD_BYTES, Sheet, name_and_unit, read_sheet
from tfarm.foreign import read_arrays

# by the end of a file's name: kind of its reader in `tfarm.foreign`, its package and the extra that has it
READERS = {
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), ("hdf5", "h5py", "hdf5")),
    **dict.fromkeys((".uff", ".unv", ".uf"), ("uff-time", "pyuff", "uff")),
    ".parquet": ("columns", "pyarrow", "study"),
}


def read_columns(path: str | os.PathLike[str], wanted: Container[str] | None = None) -> Sheet:
    """Return the columns of a CSV, .mat, HDF5, Parquet or UFF file with their units, the `wanted` ones of a CSV file.

    An array (n, m) of a binary file with a row a sample is one column a signal: "X.1", "X.2", ...
    Raises ParameterError where the file cannot be read, and for two columns of the same name.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".mat":
        found, data = read_mat(path, MOST_RECORD_BYTES, key="record")
    elif suffix in READERS:
        kind, package, extra = READERS[suffix]
        data = read_file(path, MOST_RECORD_BYTES, key="record", what=f"a {suffix} file")
        remedy = f"is not installed: pip install 'tfarm[{extra}]', or export the record as CSV"
        require(find_spec(package), "package", package, remedy)
        found = read_arrays(kind, path, key="record", remedy=f"no {suffix} file of a record that can be read")
    else:
        return read_sheet(path, "record", wanted)
    columns: dict[str, Real] = {}
    units: dict[str, str] = {}
    for text, value in found.items():
        name, unit = name_and_unit(text)
        each: dict[str, Real] = {}
        if value.ndim in (1, 2) and value.dtype.kind in "biuf":
            if max(value.shape) == value.size:
                each = {name: value.ravel()}
            elif value.shape[0] >= value.shape[1]:
                each = {f"{name}.{number}": column for number, column in enumerate(value.T, start=1)}
        for own, column in each.items():
            require(own not in columns, "column", own, "each column has a name of its own", os.fspath(path))
            columns[own] = column.astype(float)
            units[own] = unit
    return Sheet(columns, units, (), hashlib.sha256(data).hexdigest())
