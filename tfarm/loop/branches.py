"""Branches of a root locus: poles that are followed from value to value, from those of the rig without feedback.

A branch is named after its origin there: a flexible mode, or one of `Origin`.  A factor on the law grows from 0 to 1 at
the first value, and each pole is followed on that way.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real, Whole
from tfarm.errors import ConvergenceError
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.varied import Varied
from tfarm.schema import Quantity
from tfarm.spectrum import damped_modes, modes
from tfarm.spectrum.following import assign_roots, follow

ORIGIN = Quantity(
    "origin",
    help="open-loop pole that the branch continues from; other: the motor's circuit, a delay, a fast real pole",
)


class Origin(IntEnum):
    """Origin of a branch of no flexible mode."""

    RIGID_BODY = 0
    CONTROLLER = -1
    OTHER = -2


def origin_name(origin: int) -> str:
    """Return the flexible mode of that number, or another origin of a branch."""
    if origin > 0:
        return f"mode {origin}"
    return Origin(origin).name.lower().replace("_", " ")


def follow_poles(family: Varied, gain: Real, number: int) -> tuple[Complex, Whole]:
    """Return all poles (b, n) but those at 0 at every value, mirror images included, and the origin of each."""
    # 2 flexible modes are followed beyond the box, whose poles may come into it
    row, origin = continue_from_rig(family, number + 2)
    row = np.r_[row, missing_poles(family, family.start, row)]
    rows = row[:, None]
    low = 0
    # 3 values after the first at which the poles of the box are counted
    nodes = np.unique(np.linspace(0, gain.size - 1, 3 + 1).round().astype(int)).tolist()[1:]
    while nodes:
        high = nodes[0]
        try:
            part = follow(family, gain[low : high + 1], rows[:, -1])
        except ConvergenceError:
            # of a pole that came into the box, and is next to one of these
            if high - low == 1:
                raise
            nodes.insert(0, (low + high) // 2)
            continue
        new = missing_poles(family, float(gain[high]), part[-1])
        if new.size:
            back = follow(family, gain[low : high + 1][::-1], np.r_[part[-1], new])
            part = np.hstack([part, back[::-1, part.shape[1] :]])
            rows = np.vstack([rows, np.full((new.size, rows.shape[1]), np.nan)])
        rows = np.hstack([rows, part[1:].T])
        low = nodes.pop(0)
    return rows, np.r_[origin, np.full(len(rows) - origin.size, Origin.OTHER)]


def missing_poles(family: Varied, value: float, row: Complex) -> Complex:
    """Return the poles of the box at a value that are not among these (b,); none where as many are in the box."""
    inside = row[family.box.holds(row) & (row != 0)]
    try:
        count = family.count(value)
    except ConvergenceError:
        # a pole on the edge of the box: there it comes or goes
        return row[:0]
    if count < inside.size:
        text = f"two branches cannot be distinguished at {family.vary} = {value:.10g}"
        raise ConvergenceError(text, value, inside.size)
    if count == inside.size:
        return row[:0]
    every = family.complete(value, row)
    away = abs(every[:, None] - row[~np.isnan(row)]).min(axis=1, initial=math.inf)
    # within 1e-6 of its size a pole of two searches is one
    return every[away > 1e-6 * abs(every)]


def continue_from_rig(family: Varied, number: int) -> tuple[Complex, Whole]:
    """Return poles at the first value (b,) that continue from the open rig's, and their origins; none pinned at 0.

    In the order of the modes, `number` flexible ones; poles of a law come last.
    """
    loop = family.first
    grown = Varied(loop.case, "gain", 0.0, 1.0, family.box)
    row, origin = open_poles(loop.arm, number)
    own = loop.law.poles[loop.law.poles != 0]
    resting = at_origin(grown.at(0.0))
    row = np.r_[np.zeros(resting.size - grown.pinned, complex), row, own]
    origin = np.r_[resting[grown.pinned :], origin, np.full(own.size, Origin.CONTROLLER)]
    if loop.feeds_back:
        try:
            row = follow(grown, np.array([0.0, 1.0]), row)[1]
        except ConvergenceError:
            # of poles that come in from afar, as under a delay
            row = assign_roots(grown, 1.0, row)
    # at 0 at the first value alone
    of_first = resting[family.pinned : grown.pinned]
    row = np.r_[np.zeros(of_first.size, complex), row]
    origin = np.r_[of_first, origin]
    return row[~np.isnan(row)], origin[~np.isnan(row)]


def at_origin(loop: ContinuousLoop) -> Whole:
    """Return the origins of the poles at s = 0 of a loop: those of the rig first."""
    is_of_rig = np.arange(loop.zeros_at_origin) < loop.k.at_rest
    return np.where(is_of_rig, Origin.RIGID_BODY, Origin.CONTROLLER)


def open_poles(arm: Arm, number: int) -> tuple[Complex, Whole]:
    """Return poles of the rig without feedback, both of each pair, and their origins, of at least `number` modes."""
    found = damped_modes(modes(arm, number))
    is_flexible = found.index > 0
    rigid = found.eigenvalues[~is_flexible].ravel()
    pairs = found.eigenvalues[is_flexible].ravel()
    others = [*found.others, *found.unassigned_pairs.ravel()]
    row = np.array([*rigid, *others, *pairs], complex)
    origin = np.repeat([Origin.RIGID_BODY, Origin.OTHER], [len(rigid), len(others)])
    origin = np.r_[origin, np.repeat(found.index[is_flexible], 2)]
    alive = np.isfinite(row) & (row != 0)
    return row[alive], origin[alive]
