"""The verbs of the continuous loop: poles, margins, Nyquist, spill-over and locus."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import ANGLE_GAIN, NAMES
from tfarm.cli.app import ArmName, Json, app, give, hand_out, whole_number
from tfarm.cli.inputs import Given, Png, under_a_law
from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.tables.terminal import heading, show

if TYPE_CHECKING:
    from tfarm.loop.margins import Margins

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
    from tfarm.loop.answers import poles_answer
    from tfarm.loop.poles import closed_loop_poles

    give(poles_answer(closed_loop_poles(subject, law, number), certify) | said, json, _print_poles)


def _print_poles(answer: dict[str, Any]) -> None:
    """A row a pole, then the box."""
    from tfarm.loop.answers import POLE_COLUMNS

    show(Table(columns=POLE_COLUMNS, record=[complex(*pole) for pole in answer["poles"]]))
    left, right, _, top = answer["box"]
    proven = "proven" if "discs" in answer else "by winding number"
    print(f"all poles with {left:.6g} < Re s < {right:.6g} and |Im s| < {top:.6g} ({proven}),")
    print(f"{answer['unstable']} of them unstable")
    if answer["ends_at_shear_cutoff"]:
        print(f"no more lie below sqrt(kGA/rhoI), {answer['shear_cutoff_rad_s']:.6g} rad/s, where the list ends;")
        print("--count goes on above it, in Timoshenko's theory into shear, which that hardly damps")
    print(answer["sign_convention"])


@app.command()
@under_a_law
def margins(arm: ArmName, json: Json = False, *, given: Given) -> None:
    """The verdict on a loop, the windows of each gain, and the margins of the exact loop function."""
    subject, law, said = given.loop()
    from tfarm.loop.answers import margins_answer
    from tfarm.loop.margins import margins as find_margins

    found = find_margins(subject, law)
    give(margins_answer(found) | said, json, partial(_print_margins, found))


def _print_margins(found: Margins, answer: dict[str, Any]) -> None:
    """The verdict, then everything else: of gains at the hub Lyapunov's argument, and how far each may go alone."""
    from tfarm.loop.answers import WINDOW_COLUMNS, gain_rows
    from tfarm.loop.windows import BEYOND_LAW

    far = answer["verdict"] == "unstable" or answer["known_beyond_the_band"]
    reach = "" if far else f" up to {answer['band_rad_s']:.4g} rad/s, not known beyond"
    poles = found.stability.poles
    is_of_gains = "lyapunov" in answer
    why = f"that {ANGLE_GAIN} = 0 leaves" if is_of_gains else "of a hub whose angle is not held"
    apart = f" (apart from the pole at 0 {why})" if poles.moving.size < poles.values.size else ""
    print(f"{answer['arm']}: {answer['verdict'].upper()}{reach}{apart}")
    more = " (infinitely many in all)" if answer["unstable_roots_infinite"] else ""
    print(f"unstable poles up to {answer['band_rad_s']:.6g} rad/s: {answer['unstable_roots']}{more}")
    print(answer["beyond_the_band"])
    for warning in answer.get("warnings", ()):
        print(f"warning: {warning}")
    ends = "no limit was found up to there, and beyond none was looked for"
    if is_of_gains:
        print(f"Lyapunov: {answer['lyapunov']['reason']}")
        show(Table(columns=WINDOW_COLUMNS, record=gain_rows(found)))
        ranges = ((name, *each.looked_at) for name, each in found.windows.items())
        spans = ", ".join(f"{name} ({low:.6g}, {high:.6g})" for name, low, high in ranges)
        print(f"looked at: {spans}; * {ends}")
    elif answer["passivity"]["kind"]:
        print(answer["passivity"]["reason"])
    if found.windows and not is_of_gains:
        show(answer["windows"])
        print(f"each looked at up to {BEYOND_LAW:g} times its size, of either sign; * {ends}")
    if answer["in_band"] is not None:
        _print_loop_margins(found, answer)
    print(answer["sign_convention"])


def _print_loop_margins(found: Margins, answer: dict[str, Any]) -> None:
    """Each margin, exact and in the band, then the crossovers."""
    from tfarm.loop.answers import margin_rows

    assert found.in_band is not None
    rows, band, six = list(margin_rows(found, found.in_band)), answer["in_band"], singly(general, 6)
    columns = (
        Column("margin", "margin", of=["gain (factors)", *(heading(row.column) for row in rows)]),
        Column("exact", "exact", of=[pair_words(answer["gain_margin"]), *(row.exact for row in rows)], digits=six),
        Column("band", f"up to {band['band_rad_s']:.6g} rad/s", of=["", *(row.in_band for row in rows)], digits=six),
        Column("at", "at", "rad/s", of=["", *("-" if row.at == "" else row.at for row in rows)], digits=six),
    )
    show(Table(columns=columns))
    for key, empty in (("gain_crossovers", "|L| = 1"), ("phase_crossovers", "L < 0")):
        if answer[key]:
            show(answer[key])
        else:
            print(f"nowhere in the band {empty}")
    phase = band["phase_margin_deg"]
    if phase < 0:
        print(f"phase margin {phase:.6g} deg: lead; not an instability")


def pair_words(pair: Any) -> str:
    return f"({pair[0]:.8g}, {pair[1]:.8g})" if pair else ""


@app.command()
@under_a_law
def nyquist(arm: ArmName, png: Png = None, csv: Csv = None, json: Json = False, *, given: Given) -> None:
    """Nyquist plot of the exact loop: the turns around -1 counted, beside the poles found in a box."""
    subject, law, said = given.loop()
    from tfarm.loop.answers import nyquist_answer
    from tfarm.loop.nyquist import nyquist as find
    from tfarm.loop.nyquist import nyquist_table

    found = find(subject, law)
    hand_out(
        lambda: nyquist_answer(found) | said, _print_nyquist, json,
        csv=csv, table=lambda: nyquist_table(found), png=png, picture=(found,),
    )  # fmt: skip


def _print_nyquist(answer: dict[str, Any]) -> None:
    """The verdict, then the two counts."""
    reach = f"up to {answer['band_rad_s']:.6g} rad/s"
    print(f"{answer['arm']}: {answer['verdict'].upper()}")
    print(f"turns around -1 {reach}, counter-clockwise positive: {answer['encirclements']}")
    print(f"poles of L right of the contour: {answer['unstable_open']}")
    print(
        f"unstable poles by Nyquist's criterion: {answer['unstable_by_nyquist']}, in a box: {answer['unstable_roots']}"
    )
    if answer["on_axis"]:
        print(f"undecided: {answer['on_axis']} that lie on the axis to working precision")
    print(answer["beyond_the_band"])
    print(answer["sign_convention"])


@app.command()
@under_a_law
def spill(
    arm: ArmName,
    modes: Annotated[str, typer.Option("--modes", metavar="N", help="models of 1 to so many modes")] = "20",
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Does a law drive a mode that its design model leaves out?  The exact loop beside models of 1, 2, 3 ... modes."""
    number = whole_number("--modes", modes, 1, 60)
    subject, law, said = given.loop()
    from tfarm.loop.answers import spill_answer
    from tfarm.loop.spill import spill as find

    give(spill_answer(find(subject, law, number)) | said, json, _print_spill)


def _print_spill(answer: dict[str, Any]) -> None:
    """What it means, then a row a model."""
    print(f"{answer['arm']}: {answer['in_words']}")
    print(answer["beyond_the_band"])
    show(answer["models"])
    print(answer["sign_convention"])


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
    from tfarm.loop.loci import branch_columns, locus_answer, reduced_of
    from tfarm.loop.locus import locus as find

    number = None if points is None else whole_number("--points", points, 2, 100_000)
    found = find(subject, law, vary, start, stop, number, count)
    reduced = reduced_of(found)
    answer = locus_answer(found, reduced)
    columns = (
        Column(answer["vary"], unit=answer["unit"], of=answer["gain"]),
        *branch_columns(found.branches, "{part}_{n}"),
    )
    hand_out(
        lambda: answer | said, _print_locus, json,
        csv=csv, table=lambda: Table(columns=columns), png=png, picture=(found, reduced),
    )  # fmt: skip


def _print_locus(answer: dict[str, Any]) -> None:
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
    for each in answer["crossings"]:
        where = f"{name} = {each['gain']:.10g}, {each['omega_rad_s']:.10g} rad/s ({each['frequency_hz']:.6g} Hz)"
        which = "a pole that is on no branch" if each["branch"] is None else f"branch {each['branch']}"
        print(f"{which} becomes {each['direction']} at {where}")
    if not answer["crossings"]:
        print("no branch crosses the imaginary axis")
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


def _complex(point: list[float] | None) -> str:
    if point is None:
        return "-"
    re, im = point
    return f"{re:.10g}{im:+.10g}i" if im else f"{re:.10g}"
