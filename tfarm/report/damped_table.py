"""The damped modes beside the undamped ones: eigenvalues, damping ratios, and the box in which none is missing."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tfarm.arm import Arm
from tfarm.columns import FILES, Column, Table
from tfarm.digits import plain, significant
from tfarm.errors import MISSING
from tfarm.report.words import typeset
from tfarm.spectrum import DampedModes, Modes, damped_modes, modes
from tfarm.spectrum.answers import DAMPED_MODE_COLUMNS, beyond_the_box

DAMPED_CAPTION = (
    "Eigenvalues of the arm with its own damping, C = {C} s, each continued from the undamped mode of its number. "
    "Each is enclosed in a disc of 12 digits that holds exactly one. All {count} eigenvalues with {left} < Re s < "
    "{right} 1/s and |Im s| < {top} rad/s are listed (conjugates counted{rigid}): the argument principle in ball "
    "arithmetic counts those in this box. {outside}Beyond any such box there are more: {beyond}."
)
NO_C_CAPTION = (
    "Eigenvalues of the rig with what its hub, clamp and joint lose (C = {C} in the link), each continued from the "
    "undamped mode of its number. Each is enclosed in a disc of 12 digits that holds exactly one. All {count} "
    "eigenvalues with {left} < Re s < {right} 1/s and |Im s| < {top} rad/s are listed (conjugates counted{rigid}): the "
    "argument principle in ball arithmetic counts those in this box. {outside}Beyond any such box there are more, at "
    "ever higher frequency: {beyond}."
)
UNASSIGNED_NOTE = (
    "Rows without a number are eigenvalues that continue from no mode for certain, named after the part of the drive "
    "that sets them, where one does; a mode that is “not assigned” has one of them, or none in the box. "
)
NOT_LISTED = "Modes above {last} are not listed: their branches cannot be told apart. "
OUTSIDE_NOTE = (
    "Rows that are “outside” lie, with one eigenvalue or both, beyond the box: beside them others may exist that are "
    "not listed. "
)


PROVEN_DIGITS = 12  # of an eigenvalue: more than a page prints of any
BOX_WORDS = "in the box", "outside"


@lru_cache(maxsize=8)  # the arm's page and the page on trust speak of the same ones, and a proof takes seconds
def proven_damped_modes(arm: Arm, count: int) -> DampedModes:
    """The arm's first damped modes, each enclosed to 12 digits, none missing in their box.

    Raises CertificationError where that cannot be proven, ConvergenceError where they cannot be told apart.
    """
    found = damped_modes(modes(arm, count))
    found.certify(PROVEN_DIGITS)
    return found


def damped_table(undamped: Modes) -> Table:
    """The table of the arm's damped modes, each number proven to 12 digits and printed to fewer."""
    arm = undamped.arm
    damped = proven_damped_modes(arm, int(undamped.index[-1]))
    C, box = arm.damping, damped.box
    edges = {"left": box.re_min, "right": box.re_max, "top": box.im_max}
    resisted = damped.single.size - len(damped.others)
    rigid = ""
    if arm.has_rigid_mode:
        rigid = ", with 0 twice" if damped.eigenvalues[0, 1] == 0 else ", with 0"
    if arm.has_rigid_mode and resisted:
        rigid = f", with 0 and the {significant(damped.single[0], 6)} 1/s to which friction resists the turning rig"
    for each in damped.others:
        rigid += f"; {significant(each, 6)} 1/s, of the motor's circuit, is one of no mode"
    words = {name: plain(round(x)) if abs(x) >= 100 else plain(x, 3) for name, x in edges.items()}
    every = np.concatenate([damped.eigenvalues, damped.unassigned_pairs])
    inside = np.all(box.holds(every) | np.isnan(every), axis=1)
    words_of = np.where(np.isnan(every[:, 0]), "-", np.where(inside, *BOX_WORDS))
    notes = NOT_LISTED.format(last=damped.index[-1]) if damped.left_out else ""
    if damped.unassigned or not damped.is_assigned.all():
        notes += UNASSIGNED_NOTE
    names = [*[MISSING] * len(damped.index), *(each.origin for each in damped.unassigned)]
    origins = [Column("origin", of=names, on=(FILES,))] if damped.unassigned else []
    return Table(
        stem="damped-modes",
        title="Damped modes",
        caption=(DAMPED_CAPTION if C else NO_C_CAPTION).format(
            C=plain(C),
            count=damped.count,
            rigid=rigid,
            outside=("" if inside.all() else OUTSIDE_NOTE) + notes,
            beyond=typeset(beyond_the_box(arm)),
            **words,
        ),
        columns=(
            *DAMPED_MODE_COLUMNS,
            Column("complete", "list complete", of=words_of),
            *origins,
        ),
        record=damped,
    )
