"""Exact residues of the arm's outputs at its eigenvalues, by the road that keeps its digits.

An output is G = N/D with N and the drive D analytic, so its residue at a simple zero p of D is N(p)/D'(p): one
evaluation with its derivative, all eigenvalues at once.  Where hub angle or moment is a small difference there, the
hub's own balance gives it.  For double frequencies mode shapes do it at C = 0 (residue c b, Meirovitch, Fundamentals
of Vibrations, 2001, ch. 7) and Cauchy's integral around p at C > 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.outputs import Output, unit_scale
from tfarm.exact.system import System
from tfarm.exact.values import evaluate_outputs, free_slopes
from tfarm.spectrum import Modes

CLOSE_FREQUENCIES = 1e-6  # relative gap under which two frequencies are told apart by their shapes alone
UNIT_CIRCLE = np.exp(2j * np.pi * np.arange(32) / 32)  # of Cauchy's integral: a pole 4 radii off adds 4^-32 of its own
POLES_AWAY = 4  # radii of its circle: how far off another pole is at least
RADII_TRIED, RADIUS_FALLS = 9, 3  # circles after the first, each a third of the one before
OF_SHAPES = ("theta", "W", "Y", "Phi", "M", "Q")  # quantities that a table of modes has
AT_HUB = (  # moment and shear force of the link at the hub, and the hub's angle
    Output(quantity="M", place="root", unit="N m", label="moment at the root"),
    Output(quantity="Q", place="root", unit="N", label="shear at the root"),
    Output(quantity="theta", place="root", unit="rad", label="angle of the hub"),
)
RADII_AGREE = 1e-11  # of the largest value on the circle: what two radii may differ by


def undamped_residues(table: Modes, wanted: Sequence[Output], k: System, x: float) -> Real:
    """Residues in the variable s^2 of each output over s^power at the flexible modes (C = 0): (outputs, modes).

    c b, with c the output of the mode and b its hub participation (its root moment where the hub is locked).
    `x` is a share of the length.
    """
    omega, powers = table.natural_frequency[table.index > 0], np.array([[each.power] for each in wanted])
    residues, doubtful = end_residues(k, wanted, 1j * omega, x)
    products: Real = (residues * 2j * omega / (1j * omega) ** powers).real
    close = np.r_[False, np.diff(omega) < CLOSE_FREQUENCIES * omega[1:], False]
    by_shapes = close[:-1] | close[1:] | doubtful
    if by_shapes.any() and all(each.quantity in OF_SHAPES and each.side == "outer" for each in wanted):
        products[:, by_shapes] = _from_shapes(table, wanted, k, x)[:, by_shapes]
    return products


def end_residues(k: System, wanted: Sequence[Output], p: Complex, x: float = 0.0) -> tuple[Complex, NDArray[np.bool_]]:
    """Residues N(p)/D'(p) (outputs, p) at eigenvalues p, and where they are in doubt.

    There A theta = B M on the hub (see `tfarm.exact.system`); of the two the one on the larger side has lost digits.
    """
    with np.errstate(all="ignore"):
        here, slopes = free_slopes(k, [*wanted, *AT_HUB], p, x)
        residues: Complex = here.outputs[: len(wanted)] / slopes.drive
        moment, shear, theta = (
            row / float(unit_scale(each, k)) for row, each in zip(here.outputs[-3:], AT_HUB, strict=True)
        )
        A, B = (np.polyval([float(c) for c in reversed(each)], p) for each in (k.drive.of_angle, k.drive.of_moment))
        heavy = abs(A) > abs(B)
        balanced = {
            "theta": np.where(heavy, (moment + float(k.radius) * shear) * B / A, theta),
            "M": np.where(heavy | (B == 0), moment, theta * A / B),
        }
        for row, each in enumerate(wanted):
            at_root = each.share(x) == 0 and (each.place == "x" or not each.gauge or k.gauge.share == 0)
            if each.quantity == "theta" or (each.quantity == "M" and at_root and k.reads_hub_moment):
                damper = (1.0 + k.segments[-1].damping * p) ** each.gauge
                value = balanced[each.quantity] * float(unit_scale(each, k)) * p**each.power
                residues[row] = value / (slopes.drive * damper)
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
    values = evaluate_outputs(k, wanted, (p[:, None] + arrow).ravel(), x)
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
            return table.shape(at) - (at + float(k.radius) * length) * theta * (each.quantity == "Y")
        if each.quantity == "Phi":
            return table.rotation(at) - theta
        return table.moment(at) if each.quantity == "M" else table.shear(at)

    return np.array([seen(each) * drive for each in wanted])[:, table.index > 0]
