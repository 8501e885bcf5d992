"""Reduced models as a MATLAB file, and as state spaces from the input to the signals of a controller."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices, Rational
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.files import is_standard_output, write_file, write_mat
from tfarm.reduced.modal import modal_model
from tfarm.response import transfer
from tfarm.response.signals import Signals

from .partial_fractions import CLEAR_OF_POLES, distance, frequencies_around
from .reduction import ReducedModel

ALGEBRAIC = 1e-9  # distance from -1 of a feedthrough of the loop that leaves its input undetermined


def sensed_model(arm: Arm, signals: Sequence[str], count: int) -> Matrices:
    """Return A, B, C, D from the input to the named signals, with `count` flexible modes and a static remainder.

    Raises ParameterError for an unknown or improper signal and a count out of range.
    """
    read = Signals(arm, tuple(signals))
    extra = [] if arm.is_locked else ["hub_angle"]  # so that every model has the states of the rigid body
    rows: dict[int, Real] = {}
    through: dict[int, Real] = {}
    A, B = np.empty((0, 0)), np.empty((0, 1))
    for share in dict.fromkeys(read.places):
        mine = [n for n, place in enumerate(read.places) if place == share]
        wanted = [read.outputs[n] for n in mine]
        along = any(each.place == "x" for each in wanted)
        A, B, C, D = modal_model(arm, [*extra, *wanted], count, share * arm.length if along else None).matrices()
        rows |= zip(mine, C[len(extra) :], strict=True)
        through |= zip(mine, D[len(extra) :], strict=True)
    order = range(len(read.names))
    return A, B, np.array([rows[n] for n in order]), np.array([through[n] for n in order])


def closed(plant: Matrices, law: Matrices) -> Real:
    """Return the matrix of the loop v = -(law of y), the plant's states first.

    Raises ParameterError for an algebraic loop.
    """
    A, B, C, D = plant
    Ak, Bk, Ck, Dk = law
    whole = 1.0 + (Dk @ D)[0, 0]
    if abs(whole) < ALGEBRAIC:
        raise ParameterError(
            key="law",
            value=float((Dk @ D)[0, 0]),
            remedy="the feedthroughs of the law and the model have the product -1: an algebraic loop",
        )
    v = np.hstack([-Dk @ C, -Ck]) / whole  # of plant and law states
    y = np.hstack([C, np.zeros((len(C), len(Ak)))]) + D @ v
    top = np.hstack([A, np.zeros((len(A), len(Ak)))]) + B @ v
    bottom = np.hstack([np.zeros((len(Ak), len(A))), Ak]) + Bk @ y
    return np.vstack([top, bottom])


def pade(delay: float, order: int) -> Rational:
    """Return the Pade approximation of e^{-s delay}, numerator and denominator of that order."""
    powers = np.arange(order, -1, -1)
    sizes = [math.comb(order, k) * math.factorial(2 * order - k) / math.factorial(2 * order) for k in powers]
    terms = np.array(sizes) * delay**powers
    return Rational(tuple(terms * (-1.0) ** powers), tuple(terms))


def in_series(first: Matrices, second: Matrices) -> Matrices:
    """Return the series connection of two state spaces, the second of one signal."""
    A, B, C, D = first
    a, b, c, d = second
    whole = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
    return whole, np.vstack([B, b @ D]), np.hstack([d @ C, c]), d @ D


WRITTEN_BY = ": written by tfarm."  # ends the first line of every script
MAT_POINTS = 1000  # of the exact response in the file, even in ln w


def save_mat(reduced: ReducedModel, path: Path, *, key: str = "path") -> tuple[Path, Path]:
    """Write a MATLAB file and in its folder a script that builds `sys` (ss) and `exact` (frd); return both paths.

    The file has A, B, C, D, all names, the exact response over the frequency range, and the worst error.
    Raises ParameterError, naming `key`, where they cannot be written, or a script of that name is another file's.
    """
    path = Path(path)
    if is_standard_output(path) or (os.path.exists(path) and not os.path.isfile(path)):
        raise ParameterError(key=key, value=str(path), remedy="is no regular file, and its script needs a folder")
    path = path if path.suffix == ".mat" else path.with_name(path.name + ".mat")
    script = path.with_name(f"load_{re.sub(r'[^A-Za-z0-9_]', '_', path.stem)}.m")
    _must_be_ours(script, path, key)
    write_file(script, _script(reduced, path).encode(), key=key)
    write_mat(path, _contents(reduced), key=key, oned_as="row")
    return path, script


def _must_be_ours(script: Path, path: Path, key: str) -> None:
    """Raise ParameterError for a script that `save_mat` has not written for the same MATLAB file."""
    if not os.path.exists(script):
        return
    try:
        text = script.read_text(encoding="utf-8") if os.path.isfile(script) else ""
    except (OSError, UnicodeDecodeError):
        text = ""
    first, _, rest = text.partition("\n")
    if not (first.endswith(WRITTEN_BY) and _loads(path) in rest):
        raise ParameterError(
            key=key,
            value=str(path),
            remedy=f"{script.name} in that folder is not its script and would be replaced; choose another name",
        )


def _loads(path: Path) -> str:
    """Return the line of the script that loads its file."""
    file = path.name.replace("'", "''")
    return f"data = load(fullfile(here, '{file}'));"


def _contents(reduced: ReducedModel) -> dict[str, Any]:
    """Return the variables of the MATLAB file."""
    A, B, C, D = reduced.matrices()
    model = reduced.model
    omega = np.geomspace(*reduced.band, MAT_POINTS)
    omega = omega[distance(omega, frequencies_around(model.arm, reduced.band[1])) > CLEAR_OF_POLES * omega]
    response = transfer(model.arm, model.rows, x=model.x)(1j * omega)
    return {
        "A": A,
        "B": B,
        "C": C,
        "D": D,
        "omega": omega,
        "response": response[:, None, :],
        "input_name": np.array([model.input], dtype=object),
        "output_names": np.array(model.outputs, dtype=object),
        "state_names": np.array(model.states, dtype=object),
        "name": reduced.name,
        "worst_error": reduced.worst_error,
        "band": np.array(reduced.band),
    }


def _script(reduced: ReducedModel, path: Path) -> str:
    """Return the MATLAB script."""
    name = reduced.name.replace("'", "''")
    low, high = reduced.band
    return f"""% {reduced.name}{WRITTEN_BY}
% sys:   the reduced model (ss), worst |dG| / (|G| + |w dG/dw|) {reduced.worst_error:.3g} over {low:g} to {high:g} rad/s
% exact: the exact frequency response (frd) over that band
here = fileparts(mfilename('fullpath'));
{_loads(path)}
sys = ss(data.A, data.B, data.C, data.D, ...
    'InputName', data.input_name, 'OutputName', data.output_names, 'StateName', data.state_names);
exact = frd(data.response, data.omega, ...
    'InputName', data.input_name, 'OutputName', data.output_names);
sys.Name = '{name}';
exact.Name = '{name}, exact';
clear here data
"""
