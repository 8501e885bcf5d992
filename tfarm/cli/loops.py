"""The verb that follows closed-loop poles along a gain or a parameter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tfarm.cli.app import ArmName, Json, app, give, load_arm, whole
from tfarm.cli.inputs import Given, gains_of, under_a_law
from tfarm.columns import Column, Table
from tfarm.digits import singly

Vary = Annotated[
    str,
    typer.Option(
        "--vary",
        help="K1, K2, Kp, all (a scale on the three), payload_mass, payload_inertia, hub_inertia, length or damping",
    ),
]


@app.command()
@under_a_law
def locus(
    arm: ArmName,
    vary: Vary,
    start: Annotated[float, typer.Option("--from", help="value at which the locus begins")],
    stop: Annotated[float, typer.Option("--to", help="value at which it ends")],
    points: Annotated[str, typer.Option("--points", metavar="N", help="values, equally spaced")] = "500",
    branches: Annotated[str, typer.Option("--branches", metavar="N", help="branches, 1 to 200")] = "10",
    csv: Annotated[Path | None, typer.Option("--csv", help="write the branches to this file")] = None,
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Root locus of the exact arm along a gain or a parameter; crossings of the imaginary axis are solved for."""
    number, count = whole("--points", points, 2, 100_000), whole("--branches", branches, 1, 200)
    subject = load_arm(arm)
    law, said = gains_of(subject, given)
    from tfarm.loop.locus import locus as find
    from tfarm.loop.locus_answer import locus_answer
    from tfarm.loop.reduced_locus import reduced_locus

    exact = find(subject, law, vary, start, stop, number, count)
    answer = locus_answer(exact, reduced_locus(exact)) | said
    if csv is not None:
        from tfarm.tables.files import write_csv

        write_csv(branches_table(answer), csv)
    from tfarm.cli.tables import say_written

    if json or say_written(csv):
        give(answer, json, print_locus)


def branches_table(answer: dict[str, Any]) -> Table:
    """A row a gain, two columns a branch."""
    columns = [Column(answer["vary"], unit=answer["unit"], of=answer["gain"])]
    for n, branch in enumerate(answer["branches"]):
        re, im = zip(*(point or ("", "") for point in branch), strict=True)
        columns += [Column(f"re_{n}", unit="1/s", of=re), Column(f"im_{n}", unit="1/s", of=im)]
    return Table(columns=tuple(columns))


def print_locus(answer: dict[str, Any]) -> None:
    """A row a branch, then the crossings."""
    from tfarm.tables.terminal import show

    first, last, name, branches = answer["gain"][0], answer["gain"][-1], answer["vary"], answer["branches"]
    columns = (
        Column("branch", "branch", of=range(len(branches))),
        Column("mode", "mode", of=answer["mode"]),
        Column("first", f"s [1/s] at {name} = {first:g}", of=[_complex(branch[0]) for branch in branches]),
        Column("last", f"at {name} = {last:g}", of=[_complex(branch[-1]) for branch in branches]),
        Column("gap", "gap to reduced", of=answer["gap_by_branch"], digits=singly("{:.1e}".format)),
    )
    show(Table(columns=columns))
    for each in answer["crossings"]:
        where = f"{name} = {each['gain']:.10g}, {each['omega_rad_s']:.10g} rad/s ({each['frequency_hz']:.6g} Hz)"
        which = "a pole that is on no branch" if each["branch"] is None else f"branch {each['branch']}"
        print(f"{which} becomes {each['direction']} at {where}")
    for each in answer["ends"]:
        print(f"branch {each['branch']} is followed to {name} = {each['gain']:.10g}: then it comes to -1/C, or is lost")
    if not answer["crossings"]:
        print("no branch crosses the imaginary axis")
    print(
        f"largest gap to python-control on a model of order {answer['reduced_order']}: {answer['gap_to_reduced']:.1e}"
    )
    print(answer["sign_convention"])


def _complex(point: list[float] | None) -> str:
    if point is None:
        return "ended"
    re, im = point
    return f"{re:.10g}{im:+.10g}i" if im else f"{re:.10g}"
