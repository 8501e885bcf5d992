"""Reduced models as state spaces: in the forms other tools take (python-control, MATLAB, pyMOR), and for controllers.

The state space is the form to keep: its numbers are the poles and residues themselves.  A sensed model is that of what
a controller reads, signals at several places together; it closes a loop with the state space of a law.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.blocks import Matrices, Rational
from tfarm.arm.checks import positive
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.files import is_standard_output, write_file, write_mat
from tfarm.reduced.modal import modal_model
from tfarm.response import transfer
from tfarm.response.signals import Signals

from .partial_fractions import CLEAR_OF_POLES, distance, frequencies_around
from .reduction import ReducedModel

ALGEBRAIC = 1e-9  # a feedthrough of the loop so near to -1 leaves its input undetermined


def sensed_model(arm: Arm, signals: Sequence[str], count: int) -> Matrices:
    """A, B, C, D from the input to the named signals, with `count` flexible modes and a static remainder.

    Raises ParameterError for an unknown signal, a count out of range, and one that grows with s without bound.
    """
    read = Signals(arm, tuple(signals))
    with_angle = not arm.is_locked  # so that the rigid body is among the states wherever a signal is read
    rows: dict[int, Real] = {}
    through: dict[int, float] = {}
    A, B = np.empty((0, 0)), np.empty((0, 1))
    for share in dict.fromkeys(read.places):
        mine = [n for n, place in enumerate(read.places) if place == share]
        wanted = [read.outputs[n] for n in mine]
        along = any(each.place == "x" for each in wanted)
        extra = ["hub_angle"] if with_angle else []
        model = modal_model(arm, [*extra, *wanted], count, share * arm.length if along else None)
        A, B, C, D = model.matrices()
        for row, n in enumerate(mine, start=len(extra)):
            rows[n], through[n] = C[row], float(D[row, 0])
    order = range(len(read.names))
    return A, B, np.array([rows[n] for n in order]), np.array([[through[n]] for n in order])


def closed(plant: Matrices, law: Matrices) -> Real:
    """The matrix of the loop v = -(law of y), the plant's states first.

    Raises ParameterError where what both pass at once makes an algebraic loop.
    """
    A, B, C, D = plant
    Ak, Bk, Ck, Dk = law
    whole = 1.0 + (Dk @ D)[0, 0]
    if abs(whole) < ALGEBRAIC:
        remedy = "the law and the model pass a signal on at once, and their product is -1: an algebraic loop"
        raise ParameterError(key="law", value=float((Dk @ D)[0, 0]), remedy=remedy)
    v = np.hstack([-Dk @ C, -Ck]) / whole  # of plant and law states
    y = np.hstack([C, np.zeros((len(C), len(Ak)))]) + D @ v
    top = np.hstack([A, np.zeros((len(A), len(Ak)))]) + B @ v
    bottom = np.hstack([np.zeros((len(Ak), len(A))), Ak]) + Bk @ y
    return np.vstack([top, bottom])


def pade(delay: float, order: int) -> Rational:
    """The Pade approximation of e^{-s delay} of that order, numerator and denominator alike."""
    powers = np.arange(order, -1, -1)
    sizes = [math.comb(order, k) * math.factorial(2 * order - k) / math.factorial(2 * order) for k in powers]
    terms = np.array(sizes) * delay**powers
    return Rational(tuple(terms * (-1.0) ** powers), tuple(terms))


def in_series(first: Matrices, second: Matrices) -> Matrices:
    """The second state space, of one signal, behind the first."""
    A, B, C, D = first
    a, b, c, d = second
    whole = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
    return whole, np.vstack([B, b @ D]), np.hstack([d @ C, c]), d @ D


if TYPE_CHECKING:
    import control

WRITTEN_BY = ": written by tfarm."  # ends the first line of every script
ONE: Any = np.ones(1)  # the polynomial
MAT_POINTS = 1000  # of the exact response in the file, even in ln w


def transfer_function(reduced: ReducedModel) -> control.TransferFunction:
    """The model as polynomials in s, with named signals.

    For hand calculations: coefficients of a high order lose digits (of order 20 a root moves by 1e-5), the state space
    does not.
    """
    import control

    model = reduced.model
    pairs = [np.poly(pair).real for pair in model.eigenvalues]
    rigid = [np.eye(3)[0, : model.rigid_states + 1]] if model.has_rigid_states else []
    single = [np.array([1.0, -pole]) for pole in model.single]
    delay = [np.array([model.arm.damping, 1.0])] if model.relaxation is not None else []
    denominators = [*rigid, *pairs, *single, *delay]
    whole = reduce(np.polymul, denominators, ONE)
    n1, n0 = model.numerators
    numerators = []
    for row in range(len(model.outputs)):
        parts = [model.rigid[row, ::-1][: model.rigid_states]] if rigid else []
        parts += [np.array(pair) for pair in zip(n1[row], n0[row], strict=True)]
        parts += [] if model.single_residues is None else [np.array([each]) for each in model.single_residues[row]]
        parts += [model.relaxation[row : row + 1]] if model.relaxation is not None else []
        total = model.static[row] * whole
        for place, part in enumerate(parts):
            others = reduce(np.polymul, denominators[:place] + denominators[place + 1 :], ONE)
            total = np.polyadd(total, np.polymul(part, others))
        numerators.append([total])
    return control.TransferFunction(
        numerators,
        [[whole]] * len(model.outputs),
        inputs=[model.input],
        outputs=list(model.outputs),
        name=reduced.name,
    )


def discrete(reduced: ReducedModel, period: float) -> control.StateSpace:
    """The model sampled every `period` seconds behind a zero-order hold, exactly (matrix exponential)."""
    import control

    period = positive("period", period, "a positive time in seconds, such as 0.01")
    return control.sample_system(reduced.state_space(), period, method="zoh")


def to_pymor(reduced: ReducedModel) -> Any:
    """The model as a `pymor.models.iosys.LTIModel`.  Raises ParameterError where pyMOR is not installed."""
    try:
        from pymor.models.iosys import LTIModel  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        raise ParameterError(key="pymor", value=None, remedy="not installed; run: pip install pymor") from None
    return LTIModel.from_matrices(*reduced.matrices(), name=reduced.name)


def save_mat(reduced: ReducedModel, path: Path, *, key: str = "path") -> tuple[Path, Path]:
    """Write a MATLAB file and, beside it, the script that makes of it `sys` (ss) and `exact` (frd).

    The file holds A, B, C, D, all names, the exact response over the band, and the worst error.  Returns both paths.
    Raises ParameterError, naming `key`, where they cannot be written, or a script of that name is another file's.
    """
    path = Path(path)
    if is_standard_output(path) or (os.path.exists(path) and not os.path.isfile(path)):
        raise ParameterError(key=key, value=str(path), remedy="is no regular file, and a script stands beside it")
    path = path if path.suffix == ".mat" else path.with_name(path.name + ".mat")
    script = path.with_name(f"load_{re.sub(r'[^A-Za-z0-9_]', '_', path.stem)}.m")
    _must_be_ours(script, path, key)
    write_file(script, _script(reduced, path).encode(), key=key)
    write_mat(path, _contents(reduced), key=key, oned_as="row")
    return path, script


def _must_be_ours(script: Path, path: Path, key: str) -> None:
    """Refuse to replace a script that was not written here for the same MATLAB file."""
    if not os.path.exists(script):
        return
    try:
        text = script.read_text(encoding="utf-8") if os.path.isfile(script) else ""
    except (OSError, UnicodeDecodeError):
        text = ""
    first, _, rest = text.partition("\n")
    if not (first.endswith(WRITTEN_BY) and _loads(path) in rest):
        remedy = f"{script.name} beside it is not its script and would be replaced; choose another name"
        raise ParameterError(key=key, value=str(path), remedy=remedy)


def _loads(path: Path) -> str:
    """The line of the script that names its file."""
    file = path.name.replace("'", "''")
    return f"data = load(fullfile(here, '{file}'));"


def _contents(reduced: ReducedModel) -> dict[str, Any]:
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
