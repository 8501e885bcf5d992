"""The damped modes beside the undamped ones: eigenvalues, damping ratios, and the box in which none is missing."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tfarm.arm import Arm
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
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
NOT_LISTED = "Modes above {last} are not listed: their branches cannot be told apart. "
OUTSIDE_NOTE = (
    "Rows that are “outside” lie, with one eigenvalue or both, beyond the box: beside them others may exist that are "
    "not listed. "
)


PROVEN_DIGITS = 12  # of an eigenvalue: more than a page prints of any
BOX_WORDS = {True: "in the box", False: "outside"}


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
    rigid = ", with 0 twice" if arm.has_rigid_mode else ""
    if arm.has_rigid_mode and resisted:
        rigid = f", with 0 and the {significant(damped.single[0], 6)} 1/s to which friction resists the turning rig"
    for each in damped.others:
        rigid += f"; {significant(each, 6)} 1/s, of the motor's circuit, is one of no mode"
    words = {name: plain(round(x)) if abs(x) >= 100 else plain(x, 3) for name, x in edges.items()}
    inside = np.all(box.holds(damped.eigenvalues), axis=1)
    left_out = NOT_LISTED.format(last=damped.index[-1]) if damped.left_out else ""
    return Table(
        stem="damped-modes",
        title="Damped modes",
        caption=(DAMPED_CAPTION if C else NO_C_CAPTION).format(
            C=plain(C),
            count=damped.count,
            rigid=rigid,
            outside=("" if inside.all() else OUTSIDE_NOTE) + left_out,
            beyond=typeset(beyond_the_box(arm)),
            **words,
        ),
        columns=(
            *DAMPED_MODE_COLUMNS,
            Column("complete", "list complete", of=[BOX_WORDS[bool(each)] for each in inside]),
        ),
        record=damped,
    )
