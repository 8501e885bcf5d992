"""The verb that follows closed-loop poles along a gain or a parameter."""

from __future__ import annotations

import csv as tables
import io
from pathlib import Path
from typing import Annotated, Any

import typer

from tfarm.cli.app import ArmName, Json, app, load_arm, whole
from tfarm.cli.inputs import Given, gains_of, say_defaults, under_a_law

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
        _write(answer, csv)
    from tfarm.cli.tables import say_written

    if json:
        from tfarm.cli.answers import to_json

        print(to_json(answer))
    elif say_written(csv):
        _show(answer)
        say_defaults(answer)


def _write(answer: dict[str, Any], path: Path) -> None:
    """A row a gain, two columns a branch; written beside and then renamed."""
    from tfarm.files import write_file

    text = io.StringIO()
    writer = tables.writer(text, lineterminator="\n")
    heads = [f"{part}_{n} [1/s]" for n in range(len(answer["branches"])) for part in ("re", "im")]
    writer.writerow([f"{answer['vary']} [{answer['unit']}]", *heads])
    for gain, points in zip(answer["gain"], zip(*answer["branches"], strict=True), strict=True):
        writer.writerow([gain, *(part for point in points for part in point)])
    write_file(path, text.getvalue().encode(), key="--csv")


def _show(answer: dict[str, Any]) -> None:
    from tfarm.cli.tables import new_table, show

    first, last, name = answer["gain"][0], answer["gain"][-1], answer["vary"]
    rows = new_table(("branch", "mode", f"s [1/s] at {name} = {first:g}", f"at {name} = {last:g}", "gap to reduced"))
    for n, (mode, branch) in enumerate(zip(answer["mode"], answer["branches"], strict=True)):
        rows.add_row(
            str(n), str(mode), *(_complex(branch[end]) for end in (0, -1)), f"{answer['gap_by_branch'][n]:.1e}"
        )
    show(rows)
    for each in answer["crossings"]:
        where = f"{name} = {each['gain']:.10g}, {each['omega_rad_s']:.10g} rad/s ({each['frequency_hz']:.6g} Hz)"
        print(f"branch {each['branch']} becomes {each['direction']} at {where}")
    if not answer["crossings"]:
        print("no branch crosses the imaginary axis")
    print(
        f"largest gap to python-control on a model of order {answer['reduced_order']}: {answer['gap_to_reduced']:.1e}"
    )
    print(answer["sign_convention"])


def _complex(point: list[float]) -> str:
    re, im = point
    return f"{re:.10g}{im:+.10g}i" if im else f"{re:.10g}"
