"""The verbs of the continuous loop: poles, margins, Nyquist, spill-over and locus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tfarm.arm import NAMES
from tfarm.cli.app import ArmName, Json, app, emit, whole_number
from tfarm.cli.inputs import Given, Png, under_a_law

Csv = Annotated[Path | None, typer.Option("--csv", help="write the curve to this file")]
HELP_ON_COUNT = (
    "poles with Im s >= 0, 1 to 1000; if not given ten, or those below the shear cut-off where they are fewer"
)
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
def poles(
    arm: ArmName,
    count: Annotated[str | None, typer.Option("--count", metavar="N", help=HELP_ON_COUNT)] = None,
    certify: Annotated[bool, typer.Option("--certify", help="prove each, and that none is missing")] = False,
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Closed-loop poles of the exact arm, complete in a printed box."""
    number = None if count is None else whole_number("--count", count, 1, 1000)
    subject, law, said = given.loop()
    from tfarm.loop.poles import closed_loop_poles

    found = closed_loop_poles(subject, law, number)
    emit(found.certified() if certify else found, json, said)


@app.command()
@under_a_law
def margins(arm: ArmName, json: Json = False, *, given: Given) -> None:
    """Stability, the stability interval of each gain, and the margins of the exact loop function."""
    subject, law, said = given.loop()
    from tfarm.loop.margins import margins as find

    emit(find(subject, law), json, said)


@app.command()
@under_a_law
def nyquist(arm: ArmName, png: Png = None, csv: Csv = None, json: Json = False, *, given: Given) -> None:
    """Nyquist plot of the exact loop: encirclements of -1, and the unstable poles found in a box."""
    subject, law, said = given.loop()
    from tfarm.loop.nyquist import nyquist as find

    emit(find(subject, law), json, said, csv=csv, png=png)


@app.command()
@under_a_law
def spill(
    arm: ArmName,
    modes: Annotated[str, typer.Option("--modes", metavar="N", help="models of 1 to so many modes")] = "20",
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Spillover into modes that a design model leaves out: the exact loop and models of 1, 2, 3 ... modes."""
    number = whole_number("--modes", modes, 1, 60)
    subject, law, said = given.loop()
    from tfarm.loop.spill import spill as find

    emit(find(subject, law, number), json, said)


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
    count = whole_number("--branches", branches, 1, 200)
    subject, law, said = given.loop()
    from tfarm.loop.loci import Loci, reduced_of
    from tfarm.loop.locus import locus as find

    number = None if points is None else whole_number("--points", points, 2, 100_000)
    found = find(subject, law, vary, start, stop, number, count)
    emit(Loci(found, reduced_of(found)), json, said, csv=csv, png=png)
