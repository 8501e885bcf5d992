"""Exact residues of the arm's outputs at its eigenvalues, by the road that keeps its digits.

An output is G = N/D with N and the drive D analytic, so its residue at a simple zero p of D is N(p)/D'(p): one
evaluation with its derivative, all eigenvalues at once.  Where hub angle or moment is a small difference there, the
hub's own balance gives it.  Along the arm, and for double frequencies, mode shapes do it at C = 0 (residue c b,
Meirovitch, Fundamentals of Vibrations, 2001, ch. 7) and Cauchy's integral around p at C > 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.chain import ElementChain
from tfarm.exact.chain_values import free_slopes
from tfarm.exact.free import free_response
from tfarm.exact.outputs import Output, unit_scale
from tfarm.exact.system import System
from tfarm.exact.values import evaluate_outputs, kernel_table
from tfarm.exact.vector import HUB_REST, TORQUE_DIVISOR
from tfarm.spectrum import Modes

CLOSE_FREQUENCIES = 1e-6  # relative gap under which two frequencies are told apart by their shapes alone
UNIT_CIRCLE = np.exp(2j * np.pi * np.arange(32) / 32)  # of Cauchy's integral: a pole 4 radii off adds 4^-32 of its own
POLES_AWAY = 4  # radii of its circle: how far off another pole is at least
RADII_TRIED, RADIUS_FALLS = 9, 3  # circles after the first, each a third of the one before
RADII_AGREE = 1e-11  # of the largest value on the circle: what two radii may differ by


def undamped_residues(table: Modes, wanted: Sequence[Output], k: System, x: float) -> Real:
    """Residues in the variable s^2 of each output over s^power at the flexible modes (C = 0): (outputs, modes).

    c b, with c the output of the mode and b its hub participation (its root moment where the hub is locked).
    `x` is a share of the length.
    """
    omega, powers = table.natural_frequency[table.index > 0], np.array([[each.power] for each in wanted])
    if isinstance(k, ElementChain):
        return np.asarray((_of_chain(k, wanted, 1j * omega, x)[0] * 2j * omega / (1j * omega) ** powers).real)
    close = np.r_[False, np.diff(omega) < CLOSE_FREQUENCIES * omega[1:], False]
    by_shapes = close[:-1] | close[1:] | any(not each.is_at_end for each in wanted)
    products = np.empty((len(wanted), omega.size))
    if not by_shapes.all():
        residues, doubtful = end_residues(k, wanted, 1j * omega)
        products[:] = (residues * 2j * omega / (1j * omega) ** powers).real
        by_shapes |= doubtful
    if by_shapes.any():
        products[:, by_shapes] = _from_shapes(table, wanted, k, x)[:, by_shapes]
    return products


def end_residues(k: System, wanted: Sequence[Output], p: Complex, x: float = 0.0) -> tuple[Complex, NDArray[np.bool_]]:
    """Residues (outputs, p) of outputs at hub and tip at eigenvalues p, and where they are in doubt."""
    if isinstance(k, ElementChain):
        return _of_chain(k, wanted, p, x)
    with np.errstate(all="ignore"):
        free = free_response(k, p)
        rest, inertia, force = k.kernel[HUB_REST:TORQUE_DIVISOR]
        balance = rest + inertia * p * p  # balance theta = force M, and the larger side has lost digits
        heavy = abs(balance) > force
        theta = np.where(heavy, force * free.M.c[0] / np.where(heavy, balance, 1.0), free.theta.c[0])
        moment = np.where(heavy, free.M.c[0], balance * free.theta.c[0] / (force or 1.0))
        state = {"theta": theta, "M": moment, "Q": free.Q.c[0], "W": free.W.c[0], "Y": free.Y.c[0]}
        slope = free.drive.c[1]
        residues = np.array([
            state.get(each.quantity, theta) * float(unit_scale(each, k)) * p**each.power
            / (slope * (1.0 + k.damping * p) ** each.gauge)
            for each in wanted
        ])  # fmt: skip
    return residues, free.parallel | ~np.isfinite(residues).all(axis=0)


def _of_chain(k: ElementChain, wanted: Sequence[Output], p: Complex, x: float) -> tuple[Complex, NDArray[np.bool_]]:
    """Residues of a chain's outputs anywhere on it, and where they are in doubt."""
    with np.errstate(all="ignore"):
        here, slopes = free_slopes(k, wanted, p, x)
        residues: Complex = here.outputs / slopes.drive
    return residues, np.asarray(~np.isfinite(residues).all(axis=0))


def contour_residues(k: System, wanted: Sequence[Output], p: Complex, x: float) -> Complex:
    """Residues (outputs, p) by the trapezoid rule on circles around p, which converges geometrically.

    A circle is right where one of a third of its radius agrees with it; until then it shrinks.
    Raises ConvergenceError where that never happens: two eigenvalues are one to the last digits.
    """
    apart = abs(p[:, None] - p) + np.where(np.eye(p.size, dtype=bool), np.inf, 0.0)
    radius = np.minimum(apart.min(axis=1, initial=np.inf), abs(p)) / POLES_AWAY
    for point in k.singular:
        radius = np.minimum(radius, abs(p - point) / POLES_AWAY)
    residues, size = _around(k, wanted, p, radius, x)
    todo = np.arange(p.size)
    for _ in range(RADII_TRIED):
        radius[todo] /= RADIUS_FALLS
        again, smaller = _around(k, wanted, p[todo], radius[todo], x)
        right = (abs(again - residues[:, todo]) <= RADII_AGREE * np.maximum(size[:, todo], smaller)).all(axis=0)
        residues[:, todo[~right]], size[:, todo[~right]] = again[:, ~right], smaller[:, ~right]
        todo = todo[~right]
        if not todo.size:
            return residues
    worst = complex(p[todo[0]])
    raise ConvergenceError(f"no residue at the eigenvalue {worst:.10g} 1/s: another one is too close", worst, 0.0)


def _around(
    k: System, wanted: Sequence[Output], p: Complex, radius: Real, x: float
) -> tuple[Complex, NDArray[np.float64]]:
    """Cauchy's integral on the circles, and the largest |G| radius on each."""
    arrow = radius[:, None] * UNIT_CIRCLE
    values = evaluate_outputs(k, wanted, kernel_table(k, wanted), (p[:, None] + arrow).ravel(), x)
    values = values.reshape(len(wanted), *arrow.shape) * arrow
    return values.mean(axis=2), abs(values).max(axis=2)


def _from_shapes(table: Modes, wanted: Sequence[Output], k: System, x: float) -> Real:
    """c b of every flexible mode by the mode shapes."""
    length = float(k.length)
    drive = table.modal_moment if k.is_locked else table.hub_participation
    theta = table.hub_participation

    def seen(each: Output) -> Real:
        at = each.share(x) * length
        if each.quantity == "theta":
            return theta
        if each.quantity in ("W", "Y"):
            return table.shape(at) - at * theta * (each.quantity == "Y")
        if each.quantity == "Phi":
            return table.rotation(at) - theta
        return table.moment(at) if each.quantity == "M" else table.shear(at)

    return np.array([seen(each) * drive for each in wanted])[:, table.index > 0]
