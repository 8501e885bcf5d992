"""The tables of what is proven and measured of each arm, for the page on trust."""

from __future__ import annotations

from collections.abc import Sequence

from tfarm.columns import Column, Table
from tfarm.digits import scientific, significant, singly, worded
from tfarm.report.damped_table import PROVEN_DIGITS
from tfarm.report.trust_proofs import BRACKET_DIGITS, PROVEN_MODES, PROVEN_OUTPUTS, ArmProof, shared_digits
from tfarm.report.words import typeset

UNPROVEN = "not proven"
DIGITS_CAPTION = (
    f"First {PROVEN_MODES} flexible modes at C = 0, angular frequency in rad/s. All {BRACKET_DIGITS} digits are "
    "proven; the dots stand for those that follow (digits are cut off, not rounded)."
)
COUNTS_CAPTION = (
    "The count is made at one frequency between the last mode of the list and the next: as many as the flexible modes "
    "enclosed, and one more where the arm turns as a rigid body. Each arm's folder has the enclosures as proof.json."
)
BOXES_CAPTION = (
    "Eigenvalues off the axis, s in 1/s, conjugates and those at 0 counted. Each is enclosed in a disc of "
    f"{PROVEN_DIGITS} digits that holds exactly one (Rouché's theorem), and the argument principle, evaluated in ball "
    "arithmetic around the box, counts as many inside: none is missing there. With damping no box can hold all: "
    "lightly damped shear modes exist far above any, and slow real eigenvalues accumulate at -1/C."
)


def digits_table(proofs: Sequence[ArmProof]) -> Table:
    """A row a mode, a column an arm: every digit that is proven."""
    dotted = worded(lambda text: f"{text}…" if text else UNPROVEN)
    columns = [Column("mode", "mode", of=range(1, PROVEN_MODES + 1))]
    for proof in proofs:
        digits = [shared_digits(bracket, proof.digits) for bracket in proof.brackets] or [""] * PROVEN_MODES
        columns.append(Column(f"{proof.name}_rad_s", proof.name, "rad/s", of=digits, digits=dotted))
    return Table(
        stem="digits",
        title=f"Natural frequencies, {BRACKET_DIGITS} digits",
        caption=DIGITS_CAPTION,
        columns=tuple(columns),
    )


def counts_table(proofs: Sequence[ArmProof]) -> Table:
    """How many lie below where, and how many were enclosed."""
    return Table(
        stem="counts",
        title="None missing",
        caption=COUNTS_CAPTION,
        record=list(proofs),
        columns=(
            Column("arm", "arm", of="name"),
            Column("rigid_body", "rigid body", of=lambda proof: int(proof.has_rigid_mode)),
            Column("enclosed", "flexible modes enclosed", of=lambda proof: len(proof.brackets)),
            Column("count", "counted"),
            Column(
                "below_rad_s", "below", "rad/s", of="below",
                shown=lambda proof: significant(float(proof.below), 9) if proof.below else "",
            ),
            Column(
                "verdict", "verdict",
                of=lambda proof: f"{UNPROVEN}: {proof.failure}" if proof.failure else "complete, proven",
            ),
        ),
    )  # fmt: skip


def boxes_tables(proofs: Sequence[ArmProof]) -> tuple[Table, ...]:
    """Damped modes and closed-loop poles, a row a box; no table where there is none."""
    rows = [(proof.name, each) for proof in proofs for each in proof.boxes]
    if not rows:
        return ()
    four = singly(significant, 4)
    edges = ((0, "re_min", "Re s from"), (1, "re_max", "Re s to"), (3, "im_max", "|Im s| below"))
    table = Table(
        stem="boxes",
        title="Damped modes and closed-loop poles",
        caption=BOXES_CAPTION,
        record=[each for _, each in rows],
        columns=(
            Column("arm", "arm", of=[name for name, _ in rows]),
            Column("what", "of", digits=worded(typeset)),
            Column("count", "counted"),
            *(Column(key, title, "1/s", of=[each.box[i] for _, each in rows], digits=four) for i, key, title in edges),
            Column("verdict", "verdict", of=lambda each: each.failure or "complete, proven"),
        ),
    )
    return (table,)


def accuracy_table(proofs: Sequence[ArmProof]) -> Table:
    """The worst error of each arm's two responses."""
    columns = [
        Column("arm", "arm", of=[proof.name for proof in proofs]),
        Column("band_rad_s", "from … to, rad/s", of=[" … ".join(significant(x, 4) for x in p.band) for p in proofs]),
    ]
    for output in PROVEN_OUTPUTS:
        errors = [dict(proof.errors).get(output) for proof in proofs]
        cells = ["zero throughout" if error is None else scientific(error, 2) for error in errors]
        values = ["" if error is None else error for error in errors]
        columns.append(Column(output, output.replace("_", " "), of=values, shown=cells))
    caption = "Worst error of double precision over those frequencies, counted as said above."
    return Table(
        stem="accuracy", title="Double precision against proven digits", caption=caption, columns=tuple(columns)
    )
