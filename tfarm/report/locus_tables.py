"""The numbers of a root locus: crossings of the axis, the gap to the reduced model, the branches."""

from __future__ import annotations

import math

from tfarm.columns import Column, Table
from tfarm.digits import kept_digits, scientific, significant, singly
from tfarm.loop.loci import GAPS_HELD, POLE_DIGITS, Loci, branch_columns, held_branches


def crossing_table(data: Loci, stem: str) -> Table:
    """Where the branches cross the imaginary axis."""
    found = list(data.exact.crossings)
    gain, omega = (kept_digits([getattr(each, key) for each in found], POLE_DIGITS) for key in ("gain", "omega"))
    return Table(
        stem=stem,
        title=f"Crossings of the imaginary axis along {data.name}",
        caption="Solved for gain and frequency together on the exact characteristic function, to the digits shown.",
        record=found,
        columns=(
            Column(data.name, data.name, data.unit, of=gain, digits=singly(significant, 8)),
            Column("omega_rad_s", "frequency", "rad/s", of=omega, digits=singly(significant, 7)),
            Column("frequency_hz", "", "Hz", of=[w / (2 * math.pi) for w in omega], digits=singly(significant, 7)),
            Column(
                "mode",
                "mode",
                of=lambda each: "of no branch" if each.branch is None else int(data.exact.mode[each.branch]),
            ),
            Column("becomes", "becomes", of="direction"),
        ),
    )


def gap_table(data: Loci, stem: str) -> Table:
    """How far each reduced branch is from the exact one."""
    gap, names = kept_digits(data.reduced.gap, GAPS_HELD), [f"mode {n}" if n else "rigid body" for n in data.exact.mode]
    return Table(
        stem=stem,
        title=f"How far python-control's locus is from the exact one, along {data.name}",
        caption=f"Largest distance over the whole range, as a share of |s| (or of the first natural frequency, where "
        f"that is more). The reduced model has order {data.reduced.order}; its poles are those of "
        "control.root_locus_map, taken to their last digits by Newton's method.",
        columns=(
            Column("branch", "branch from", of=names),
            Column("gap", "largest gap", "of |s|", of=gap, digits=singly(scientific, 3)),
        ),
    )


def loci_data(data: Loci, stem: str) -> Table:
    """The exact and the reduced branches."""
    first = Column(data.name, data.name, data.unit, of=data.exact.gain)
    exact, reduced = held_branches(data.exact.branches), held_branches(data.reduced.branches)
    columns = (
        first,
        *branch_columns(exact, "exact_{n}_{part}", "exact branch {n}, {part}"),
        *branch_columns(reduced, "reduced_{n}_{part}", "reduced branch {n}, {part}"),
    )
    return Table(stem=stem, title=f"Loci along {data.name}", columns=columns)
