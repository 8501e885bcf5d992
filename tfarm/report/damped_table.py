"""The damped modes beside the undamped ones: eigenvalues, damping ratios, and the box in which none is missing."""

from __future__ import annotations

import numpy as np

from tfarm.columns import Column, Table
from tfarm.digits import aligned, lined, plain, significant
from tfarm.spectrum import DampedModes, Modes, damped_modes

DAMPED = (
    "Eigenvalues of the arm with its own damping, C = {C} s, each continued from the undamped mode of its number. "
    "Each is enclosed in a disc of 12 digits that holds exactly one. All {count} eigenvalues with {left} < Re s < "
    "{right} 1/s and |Im s| < {top} rad/s are listed (conjugates counted{rigid}): the argument principle in ball "
    "arithmetic counts those in this box. {outside}Beyond any such box there are more: shear is undamped in this "
    "model, so lightly damped modes exist at ever higher frequency, and the slow real eigenvalues of overdamped "
    "bending modes accumulate at −1/C = {limit} 1/s."
)
LEFT_OUT = "Modes above {last} are not listed: their branches cannot be told apart. "
OUTSIDE = (
    "Rows that are “outside” lie, with one eigenvalue or both, beyond the box: beside them others may exist that are "
    "not listed. "
)


SMALL = 1e-3  # a damping ratio below this has less than three digits in five decimals


def damped_table(modes: Modes) -> Table:
    """The table of the arm's damped modes, each number proven to 12 digits and printed to fewer."""
    damped = damped_modes(modes)
    damped.certify(12)
    C, box, one = modes.arm.link.damping, damped.box, damped.eigenvalues[:, 0]
    edges = {"left": box.re_min, "right": box.re_max, "top": box.im_max, "limit": -1 / C}
    rigid = ", with 0 twice" if modes.arm.has_rigid_mode else ""
    words = {name: _rounded(value) for name, value in edges.items()}
    inside = np.all(box.holds(damped.eigenvalues), axis=1)
    left_out = LEFT_OUT.format(last=damped.index[-1]) if damped.left_out else ""
    where = ["in the box" if each else "outside" for each in inside]
    return Table(
        stem="damped-modes",
        title="Damped modes",
        caption=DAMPED.format(
            C=plain(C), count=damped.count, rigid=rigid, outside=("" if inside.all() else OUTSIDE) + left_out, **words
        ),
        columns=(
            Column("index", "mode", of=damped.index),
            Column("eigenvalue_re", "Re s", "1/s", of=one.real, digits=lined(7, 6)),
            _imaginary(damped),
            Column("damping_ratio", "damping ratio", "-", of=damped.damping_ratio, digits=_ratios(damped)),
            Column("complete", "list complete", of=where),
        ),
    )


def _imaginary(damped: DampedModes) -> Column:
    """Im s, or the second of two real eigenvalues."""
    one, two = damped.eigenvalues.T
    rising = aligned(one.imag, 8, least=7)
    cells = [
        f"overdamped, and {significant(float(two[n].real), 7)}" if overdamped else rising[n]
        for n, overdamped in enumerate(damped.is_overdamped)
    ]
    return Column("eigenvalue_im", "Im s", "rad/s", of=one.imag, digits=cells)


def _ratios(damped: DampedModes) -> list[str]:
    """Five decimals; a ratio that would lose its digits there has four digits of its own."""
    return [
        "0" if not index else f"{ratio:.5f}" if ratio >= SMALL else significant(float(ratio), 4)
        for ratio, index in zip(damped.damping_ratio, damped.index, strict=True)
    ]


def _rounded(value: float) -> str:
    return plain(round(value)) if abs(value) >= 100 else plain(value, 3)
