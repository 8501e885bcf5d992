"""The same arm by finite elements (scikit-fem), of one segment.

Deflection of degree p, rotation of degree p - 1: w' - psi does not lock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh

import tfarm
from tfarm import Arm

from . import responses, spectra
from .reference import OUTPUTS, Complex, ExactResponse, frequency_errors
from .rows import Row
from .timing import interleaved

MODES = 100
MESH = (60, 8)  # elements, degree: the best of a dozen tried
NAME = f"{MESH[0]} elements of degree {MESH[1]}/{MESH[1] - 1}"
ROUNDING = 1e-14


@dataclass(frozen=True, slots=True)
class Elements:
    """Matrices of bending, shear and mass with w(0) = 0 taken out; entries of hub angle and tip displacement."""

    bending: Any
    shear: Any
    mass: Any
    hub: int
    tip: int


def assemble(arm: Arm, elements: int, degree: int) -> Elements:
    """The arm of one segment on so many equal elements: by scikit-fem's forms, hub and payload as lumped inertias."""
    mesh, link = skfem.MeshLine(np.linspace(0.0, arm.length, elements + 1)), arm.link
    pair = skfem.ElementLinePp(degree) * skfem.ElementLinePp(degree - 1)
    basis = skfem.Basis(mesh, pair, intorder=2 * degree)
    bending = skfem.BilinearForm(lambda w, psi, v, phi, at: link.EI * psi.grad[0] * phi.grad[0])
    shear = skfem.BilinearForm(lambda w, psi, v, phi, at: link.kGA * (w.grad[0] - psi) * (v.grad[0] - phi))
    inertia = skfem.BilinearForm(lambda w, psi, v, phi, at: link.rhoA * w * v + link.rhoI * psi * phi)
    root, tip = (basis.get_dofs(lambda x, at=at: x[0] == at).nodal for at in (0.0, mesh.p.max()))
    mass = inertia.assemble(basis).tolil()
    for entry, body in (
        (root["u^2"], arm.hub.inertia),
        (tip["u^1"], arm.payload.mass),
        (tip["u^2"], arm.payload.inertia),
    ):
        mass[entry[0], entry[0]] += body
    free = np.delete(np.arange(basis.N), root["u^1"])
    parts = (part.tocsc()[free][:, free] for part in (bending.assemble(basis), shear.assemble(basis), mass))
    return Elements(*parts, *(int(np.searchsorted(free, entry[0])) for entry in (root["u^2"], tip["u^1"])))


def modes(arm: Arm, elements: int, degree: int) -> tuple[Elements, NDArray[np.float64], NDArray[np.float64]]:
    """The rigid-body mode and the first hundred flexible ones: squared frequencies and vectors of unit modal mass."""
    model = assemble(arm, elements, degree)
    square, vectors = eigsh(model.bending + model.shear, MODES + 1, model.mass, sigma=-1e3)
    square[0] = 0.0  # known, and else 1e-8 of rounding
    return model, square, vectors


def modal_sum(arm: Arm, s: Complex, elements: int, degree: int) -> Complex:
    """Three outputs from a hundred modes and the rigid body; C = 0.  The moment is that of the hub's balance."""
    model, square, vectors = modes(arm, elements, degree)
    over = 1 / (square[:, None] + s**2)
    angle, tip = ((vectors[entry] * vectors[model.hub]) @ over for entry in (model.hub, model.tip))
    return np.array([angle, arm.hub.inertia * s**2 * angle - 1, tip])


def mode_row() -> Row:
    """A hundred modes by shift and invert, beside tfarm's; assembly included."""
    arm = tfarm.load("sasaki2012")
    exact = tfarm.modes(arm, MODES).natural_frequency[1:]
    if frequency_errors(arm, exact).max() > ROUNDING:
        raise ArithmeticError("tfarm's own frequencies are no reference here: they are not right to rounding")
    calls = {"tfarm": lambda: tfarm.modes(arm, MODES).natural_frequency, "elements": lambda: modes(arm, *MESH)}
    times = interleaved(calls, 5)
    errors = abs(np.sqrt(modes(arm, *MESH)[1][1:]) / exact - 1)
    return Row(
        group=spectra.GROUP, what=f"scikit-fem, {NAME}: sasaki2012", n=MODES, each="mode",
        seconds=times.median("elements") / MODES, ratio=times.ratio("elements", "tfarm"), to="tfarm",
        to_seconds=times.median("tfarm") / MODES, error=errors.max(),
        note=f"scikit-fem, {NAME}: error {errors[:10].max():.0e} at most in the first ten modes.",
    )  # fmt: skip


def response_row() -> Row:
    """A thousand points by a modal sum at C = 0."""
    arm, s = tfarm.load("sasaki2012"), 1j * np.geomspace(0.1, 1e4, 1000)
    calls = {"tfarm": lambda: tfarm.transfer(arm, list(OUTPUTS))(s), "elements": lambda: modal_sum(arm, s, *MESH)}
    times = interleaved(calls, 7)
    some = s[np.linspace(0, s.size - 1, responses.CHECKED).astype(int)]
    clear = some[abs(some) > 1.0]
    error, beyond = (ExactResponse(arm, points).error(modal_sum(arm, points, *MESH)) for points in (some, clear))
    return Row(
        group=responses.GROUP, what=f"scikit-fem, {NAME}, modal sum: sasaki2012, log grid", n=s.size, each="point",
        seconds=times.median("elements") / s.size, ratio=times.ratio("elements", "tfarm"), to="tfarm",
        to_seconds=times.median("tfarm") / s.size, error=error,
        note=f"scikit-fem, modal sum: error {beyond:.0e} at most above 1 rad/s; the time includes assembly.",
    )  # fmt: skip
