"""The verb that follows closed-loop poles along a gain or a parameter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tfarm.arm import NAMES
from tfarm.arrays import Complex
from tfarm.cli.app import ArmName, Json, app, load_arm, whole_number
from tfarm.cli.inputs import Given, Png, asked_law, under_a_law
from tfarm.columns import Column, Table
from tfarm.digits import singly

Vary = Annotated[
    str,
    typer.Option(
        "--vary",
        help=f"{', '.join(NAMES)}, all (a scale on all of them), payload_mass, payload_inertia, hub_inertia, length or "
        "damping; or gain (a factor on the law), delay, SIGNAL, SIGNAL.num.N or SIGNAL.den.N",
    ),
]
HELP_ON_POINTS = "values, equally spaced; 500, along a gain, delay or signal of a law 100"
HELP_ON_BRANCHES = "branches, 1 to 200; along those the flexible modes below the top of the box"


@app.command()
@under_a_law
def locus(
    arm: ArmName,
    vary: Vary,
    start: Annotated[float, typer.Option("--from", help="value at which the locus begins")],
    stop: Annotated[float, typer.Option("--to", help="value at which it ends")],
    points: Annotated[str | None, typer.Option("--points", metavar="N", help=HELP_ON_POINTS)] = None,
    branches: Annotated[str, typer.Option("--branches", metavar="N", help=HELP_ON_BRANCHES)] = "10",
    png: Png = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="write the branches to this file")] = None,
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Root locus of the exact arm along a gain or a parameter; crossings of the imaginary axis are solved for."""
    count, subject = whole_number("--branches", branches, 1, 200), load_arm(arm)
    law, said = asked_law(subject, given)
    from tfarm.cli.tables import hand_out
    from tfarm.loop.loci import locus_answer, reduced_of
    from tfarm.loop.locus import locus as find

    number = None if points is None else whole_number("--points", points, 2, 100_000)
    found = find(subject, law, vary, start, stop, number, count)
    reduced = reduced_of(found)
    answer = locus_answer(found, reduced)
    hand_out(
        lambda: answer | said, print_locus, json,
        csv=csv, table=lambda: branches_table(answer, found.branches), png=png, picture=(found, reduced),
    )  # fmt: skip


def branches_table(answer: dict[str, Any], branches: Complex) -> Table:
    """A row a gain, two columns a branch."""
    from tfarm.loop.loci import branch_columns

    first = Column(answer["vary"], unit=answer["unit"], of=answer["gain"])
    return Table(columns=(first, *branch_columns(branches, "{part}_{n}")))


def print_locus(answer: dict[str, Any]) -> None:
    """A row a branch, then the crossings, how far the reduced branches are, and the box."""
    from tfarm.tables.terminal import show

    first, last, name, branches = answer["gain"][0], answer["gain"][-1], answer["vary"], answer["branches"]
    columns = [
        Column("branch", "branch", of=range(len(branches))),
        Column("mode", "mode", of=answer["mode"]),
        Column("first", f"s [1/s] at {name} = {first:g}", of=[_complex(branch[0]) for branch in branches]),
        Column("last", f"at {name} = {last:g}", of=[_complex(branch[-1]) for branch in branches]),
        Column("gap", "gap to reduced", of=answer.get("gap_by_branch"), digits=singly("{:.1e}".format)),
    ]
    show(Table(columns=tuple(column for column in columns if column.of is not None)))
    _print_crossings(answer)
    for each in answer["ends"]:
        print(f"branch {each['branch']} is followed to {name} = {each['gain']:.10g}")
    if "gap_to_reduced" in answer:
        gap, order = answer["gap_to_reduced"], answer["reduced_order"]
        print(f"largest gap to python-control on a model of order {order}: {gap:.1e}")
    left, right, _, top = answer["box"]
    print(
        f"poles complete at a few values with {left:.6g} < Re s < {right:.6g} and |Im s| < {top:.6g}; - : not followed"
    )
    print(answer["sign_convention"])


def _print_crossings(answer: dict[str, Any]) -> None:
    """A line a crossing of the imaginary axis."""
    for each in answer["crossings"]:
        where = (
            f"{answer['vary']} = {each['gain']:.10g}, {each['omega_rad_s']:.10g} rad/s ({each['frequency_hz']:.6g} Hz)"
        )
        which = "a pole that is on no branch" if each["branch"] is None else f"branch {each['branch']}"
        print(f"{which} becomes {each['direction']} at {where}")
    if not answer["crossings"]:
        print("no branch crosses the imaginary axis")


def _complex(point: list[float] | None) -> str:
    if point is None:
        return "-"
    re, im = point
    return f"{re:.10g}{im:+.10g}i" if im else f"{re:.10g}"
