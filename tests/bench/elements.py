"""The same arm by finite elements (scikit-fem), its link of one segment or several.

Deflection of degree p, rotation of degree p - 1: w' - psi does not lock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh, splu

import tfarm
from tfarm import Arm

from . import responses, spectra
from .reference import OUTPUTS, Complex, ExactResponse, frequency_errors
from .rows import Row
from .timing import interleaved

MODES = 100
MESHES = ((1000, 2), (60, 8))  # elements, degree: the textbook's choice, and the best of a dozen tried
SMALL = (8, 8)  # enough for 1e4 rad/s; a finer mesh loses more to rounding than it gains
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
    """The arm on so many elements, equal in each segment: by scikit-fem's forms, hub and payload as lumped inertias."""
    mesh, pair = skfem.MeshLine(_nodes(arm, elements)), _pair(degree)
    basis = skfem.Basis(mesh, pair[0] * pair[1], intorder=2 * degree)
    EI, kGA, rhoA, rhoI = (_along(arm, name) for name in ("EI", "kGA", "rhoA", "rhoI"))
    bending = skfem.BilinearForm(lambda w, psi, v, phi, at: EI(at.x[0]) * psi.grad[0] * phi.grad[0])
    shear = skfem.BilinearForm(lambda w, psi, v, phi, at: kGA(at.x[0]) * (w.grad[0] - psi) * (v.grad[0] - phi))
    inertia = skfem.BilinearForm(lambda w, psi, v, phi, at: rhoA(at.x[0]) * w * v + rhoI(at.x[0]) * psi * phi)
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


def _nodes(arm: Arm, elements: int) -> NDArray[np.float64]:
    """The ends of the elements [m], joints of segments among them."""
    joints = np.cumsum([0.0, *(link.length for link in arm.links)])
    each = [np.linspace(a, b, max(1, round(elements * (b - a) / joints[-1])) + 1) for a, b in pairwise(joints)]
    return np.concatenate([[0.0], *(inner[1:] for inner in each)])


def _along(arm: Arm, name: str) -> Callable[[Any], Any]:
    """A property of the links as a function of x [m]."""
    ends = np.cumsum([link.length for link in arm.links])[:-1]
    values = np.array([getattr(link, name) for link in arm.links])
    return lambda x: values[np.searchsorted(ends, x)]


def _pair(degree: int) -> tuple[skfem.Element, skfem.Element]:
    if degree == 2:
        return skfem.ElementLineP2(), skfem.ElementLineP1()
    return skfem.ElementLinePp(degree), skfem.ElementLinePp(degree - 1)


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


def direct(arm: Arm, s: Complex, elements: int, degree: int) -> Complex:
    """Three outputs by one sparse factorisation a point."""
    model = assemble(arm, elements, degree)
    C, torque = arm.link.damping, np.zeros(model.mass.shape[0], complex)
    torque[model.hub] = 1.0
    values = np.empty((3, s.size), complex)
    for i, each in enumerate(s):
        motion = splu((1 + C * each) * model.bending + model.shear + each**2 * model.mass).solve(torque)
        angle = motion[model.hub]
        values[:, i] = angle, (arm.hub.inertia * each**2 * angle - 1) / (1 + C * each), motion[model.tip]
    return values


def modes_rows() -> Iterator[Row]:
    """A hundred modes by shift and invert, beside tfarm's; assembly included."""
    arm = tfarm.load("sasaki2012")
    exact = tfarm.modes(arm, MODES).natural_frequency[1:]
    if frequency_errors(arm, exact).max() > ROUNDING:
        raise ArithmeticError("tfarm's own frequencies are no reference here: they are not right to rounding")
    for size in MESHES:
        yield _modes(arm, exact, size)


def _modes(arm: Arm, exact: NDArray[np.float64], size: tuple[int, int]) -> Row:
    calls = {"tfarm": lambda: tfarm.modes(arm, MODES).natural_frequency, "elements": lambda: modes(arm, *size)}
    times = interleaved(calls, 5)
    errors = abs(np.sqrt(modes(arm, *size)[1][1:]) / exact - 1)
    return Row(
        group=spectra.GROUP, what=f"scikit-fem, {_mesh(*size)}: sasaki2012", n=MODES, each="mode",
        seconds=times.median("elements") / MODES, ratio=times.ratio("elements", "tfarm"), to="tfarm",
        to_seconds=times.median("tfarm") / MODES, error=errors.max(),
        note=f"scikit-fem, {_mesh(*size)}: error {errors[:10].max():.0e} at most in the first ten modes.",
    )  # fmt: skip


def response_rows() -> Iterator[Row]:
    """A thousand points: a modal sum at C = 0, and sparse solves at C > 0 (no modes diagonalise it)."""
    s = 1j * np.geomspace(0.1, 1e4, 1000)
    yield _response(s, "modal sum", "sasaki2012", modal_sum, MESHES[-1])
    yield _response(s, "sparse solves", "sasaki2012-lab", direct, SMALL)


def _response(s: Complex, what: str, name: str, solve: Any, size: tuple[int, int]) -> Row:
    arm = tfarm.load(name)
    calls = {"tfarm": lambda: tfarm.transfer(arm, list(OUTPUTS))(s), "elements": lambda: solve(arm, s, *size)}
    times = interleaved(calls, 7)
    some = s[np.linspace(0, s.size - 1, responses.CHECKED).astype(int)]
    clear = some[abs(some) > 1.0]
    error, beyond = (ExactResponse(arm, points).error(solve(arm, points, *size)) for points in (some, clear))
    return Row(
        group=responses.GROUP, what=f"scikit-fem, {_mesh(*size)}, {what}: {name}, log grid", n=s.size, each="point",
        seconds=times.median("elements") / s.size, ratio=times.ratio("elements", "tfarm"), to="tfarm",
        to_seconds=times.median("tfarm") / s.size, error=error,
        note=f"scikit-fem, {what}: error {beyond:.0e} at most above 1 rad/s; the time includes assembly.",
    )  # fmt: skip


def _mesh(elements: int, degree: int) -> str:
    return f"{elements} elements of degree {degree}/{degree - 1}"
