"""The tables of what is proven and measured of each arm, for the page on trust."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tfarm.report.digits import scientific, significant
from tfarm.report.loop_laws import typeset
from tfarm.report.tables import Column, Table, number_column, text_column
from tfarm.report.trust_proofs import BOX_DIGITS, DIGITS, MODES, OUTPUTS, Proof, digits_of

UNPROVEN = "not proven"
DIGITS_CAPTION = (
    f"First {MODES} flexible modes at C = 0, angular frequency in rad/s. All {DIGITS} digits are proven; the dots "
    "stand for those that follow (digits are cut off, not rounded)."
)
COUNTS_CAPTION = (
    "The count is made at one frequency between the last mode of the list and the next: as many as the flexible modes "
    "enclosed, and one more where the arm turns as a rigid body. Each arm's folder has the enclosures as proof.json."
)
BOXES_CAPTION = (
    "Eigenvalues off the axis, s in 1/s, conjugates and those at 0 counted. Each is enclosed in a disc of "
    f"{BOX_DIGITS} digits that holds exactly one (Rouché's theorem), and the argument principle, evaluated in ball "
    "arithmetic around the box, counts as many inside: none is missing there. With damping no box can hold all: "
    "lightly damped shear modes exist far above any, and slow real eigenvalues accumulate at -1/C."
)


def digits_table(proofs: Sequence[Proof]) -> Table:
    """A row a mode, a column an arm: every digit that is proven."""
    numbers = list(range(1, MODES + 1))
    columns = [Column(key="mode", title="mode", values=numbers, cells=[str(number) for number in numbers])]
    for proof in proofs:
        digits = [digits_of(bracket, proof.digits) for bracket in proof.brackets] or [""] * MODES
        cells = [f"{text}…" if text else UNPROVEN for text in digits]
        columns.append(Column(key=f"{proof.name}_rad_s", title=proof.name, unit="rad/s", values=digits, cells=cells))
    return Table(
        stem="digits", title=f"Natural frequencies, {DIGITS} digits", caption=DIGITS_CAPTION, columns=tuple(columns)
    )


def counts_table(proofs: Sequence[Proof]) -> Table:
    """How many lie below where, and how many were enclosed."""
    return Table(
        stem="counts",
        title="None missing",
        caption=COUNTS_CAPTION,
        columns=(
            text_column("arm", "arm", [proof.name for proof in proofs]),
            numbers("rigid_body", "rigid body", [int(proof.has_rigid_mode) for proof in proofs]),
            numbers("enclosed", "flexible modes enclosed", [len(proof.brackets) for proof in proofs]),
            numbers("count", "counted", [proof.count for proof in proofs]),
            Column(
                key="below_rad_s",
                title="below",
                unit="rad/s",
                values=[proof.below for proof in proofs],
                cells=[significant(float(proof.below), 9) if proof.below else "" for proof in proofs],
            ),
            text_column("verdict", "verdict", [_verdict(proof) for proof in proofs]),
        ),
    )


def boxes_tables(proofs: Sequence[Proof]) -> tuple[Table, ...]:
    """Damped modes and closed-loop poles, a row a box; no table where there is none."""
    rows = [(proof.name, each) for proof in proofs for each in proof.boxes]
    if not rows:
        return ()
    edges = ((0, "re_min", "Re s from"), (1, "re_max", "Re s to"), (3, "im_max", "|Im s| below"))
    limits = [
        number_column(key, title, "1/s", values, [significant(float(value), 4) for value in values])
        for which, key, title in edges
        for values in [np.array([each.box[which] for _, each in rows])]
    ]
    verdicts = [each.failure or "complete, proven" for _, each in rows]
    named = [each.what for _, each in rows]
    table = Table(
        stem="boxes",
        title="Damped modes and closed-loop poles",
        caption=BOXES_CAPTION,
        columns=(
            text_column("arm", "arm", [name for name, _ in rows]),
            Column(key="what", title="of", values=named, cells=[typeset(each) for each in named]),
            numbers("count", "counted", [each.count for _, each in rows]),
            *limits,
            text_column("verdict", "verdict", verdicts),
        ),
    )
    return (table,)


def _verdict(proof: Proof) -> str:
    return f"{UNPROVEN}: {proof.failure}" if proof.failure else "complete, proven"


def numbers(key: str, title: str, values: Sequence[int]) -> Column:
    """A column of whole numbers."""
    return Column(key=key, title=title, values=values, cells=[str(value) for value in values])


def accuracy_table(proofs: Sequence[Proof]) -> Table:
    """The worst error of each arm's two responses."""
    columns = [
        text_column("arm", "arm", [proof.name for proof in proofs]),
        text_column(
            "band_rad_s", "from … to, rad/s", [" … ".join(significant(x, 4) for x in proof.band) for proof in proofs]
        ),
    ]
    for output in OUTPUTS:
        errors = [dict(proof.errors).get(output) for proof in proofs]
        cells = ["zero throughout" if error is None else scientific(error, 2) for error in errors]
        values = ["" if error is None else error for error in errors]
        columns.append(Column(key=output, title=output.replace("_", " "), values=values, cells=cells))
    caption = "Worst error of double precision over those frequencies, counted as said above."
    return Table(
        stem="accuracy", title="Double precision against proven digits", caption=caption, columns=tuple(columns)
    )
