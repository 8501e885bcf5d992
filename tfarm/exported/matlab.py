"""A MATLAB file and the script that builds its systems, for MATLAB and for Octave.

The variables of a file are the entries of its first system, a structure for each other one, and the exact frequency
response of the arm.  A script compares every system with a value of its transfer functions that is in the file.
"""

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.errors import require
from tfarm.exported.result import Export, ExportTask
from tfarm.exported.systems import Linear, NamedSystem, linear, reduced_system, response_data
from tfarm.exported.texts import comment, matlab_text, render
from tfarm.files import is_standard_output, mat_content, write_file
from tfarm.reduced import ReducedModel
from tfarm.response import transfer

WRITTEN_BY = "written by tfarm"  # in the first line of every script, load.m
CHECKED_AT = {True: 1.2j, False: 10.0 + 10.0j}  # z, and s [1/s], at which a script compares values: no pole is there


def mat(task: ExportTask) -> Export:
    """Return the MATLAB file of a task and its script."""
    found, file = linear(task), f"{task.what}.mat"
    contents = {file: mat_file(found), f"load_{task.what}.m": script(file, found)}
    return Export(
        what=task.what, form=task.form, contents=contents, names=[], verdict=found.verdict, sha256=task.sha256
    )


def mat_file(of: Linear) -> bytes:
    """Return the bytes of a MATLAB file."""
    first, *others = ((name, entries_of(system)) for name, system in of.systems.items())
    return mat_content({**first[1], **dict(others), **of.response}, "row")


def script(file: str, of: Linear) -> bytes:
    """Return the script that builds the systems of a file of that name."""
    return render("load.m", file=matlab_text(file), of=of)


def entries_of(system: NamedSystem) -> dict[str, Any]:
    """Return the variables of one system, with its transfer functions at `CHECKED_AT`."""
    at = CHECKED_AT[system.period > 0]
    return {
        **dict(zip("ABCD", system.matrices, strict=True)),
        "period": system.period,
        "input_name": np.array(system.inputs, dtype=object),
        "output_names": np.array(system.outputs, dtype=object),
        "state_names": np.array(system.states, dtype=object),
        "name": comment(system.name),
        "checked_at": at,
        "checked_value": system(at),
        **system.facts,
    }


def save_mat(reduced: ReducedModel, path: Path, *, key: str = "path") -> tuple[Path, ...]:
    """Write a MATLAB file of a reduced model and in its folder a script of `sys` and `exact`; return the paths.

    The file has A, B, C, D, all names, the exact response over the frequency range, and the worst error.  To standard
    output it is written alone.  Raises ParameterError, naming `key`, where they cannot be written, or a script of that
    name is another file's.
    """
    path, model = Path(path), reduced.model
    G = transfer(model.arm, model.rows, x=model.x)
    exact = response_data(model.arm, reduced.input, reduced.outputs, reduced.band, G)
    of = Linear({"sys": reduced_system(reduced, reduced.outputs)}, [], exact)
    if is_standard_output(path):
        write_file(path, mat_file(of), key=key)
        return (path,)
    is_file = os.path.isfile(path) or not os.path.exists(path)
    require(is_file, key, str(path), "is no regular file, and its script needs a folder")
    path = path if path.suffix == ".mat" else path.with_name(path.name + ".mat")
    require(comment(path.name) == path.name, key, path.name, "a name of printable ASCII, as its script contains it")
    other = path.with_name(f"load_{re.sub(r'[^A-Za-z0-9_]', '_', path.stem)}.m")
    text = ""
    with suppress(OSError):  # a file that cannot be read is not ours
        text = other.read_text("utf-8", errors="replace") if other.is_file() else ""
    is_ours = not os.path.exists(other) or (WRITTEN_BY in text and matlab_text(path.name) in text)
    remedy = f"{other.name} in that folder is not its script and would be replaced; choose another name"
    require(is_ours, key, str(path), remedy)
    write_file(other, script(path.name, of), key=key)
    write_file(path, mat_file(of), key=key)
    return path, other
