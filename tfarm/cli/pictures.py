"""The verbs that draw: a Bode plot and a Nyquist plot, with the numbers that stand in them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.cli.app import ArmName, InputName, Json, Place, SideName, app, load_arm, read_on
from tfarm.cli.inputs import Given, Png, asked_input, asked_law, must_be_band, under_a_law

if TYPE_CHECKING:
    from tfarm.arm import Arm

Csv = Annotated[Path | None, typer.Option("--csv", help="write the curve to this file")]


@app.command()
def bode(
    arm: ArmName,
    output: Annotated[
        str, typer.Option("--output", help="what is looked at, such as tip_displacement")
    ] = "root_moment",
    start: Annotated[float | None, typer.Option("--from", help="lowest frequency [rad/s]")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="highest; by default ten flexible modes are seen")] = None,
    x: Place = None,
    side: SideName = None,
    driven: InputName = None,
    png: Png = None,
    csv: Csv = None,
    json: Json = False,
) -> None:
    """Bode plot of the exact response to the arm's input, with the poles and zeros that the output shows."""
    subject, driven = asked_input(load_arm(arm, driven=driven), driven)
    band, (wanted,) = _band(subject, start, stop), read_on([output], side)
    from tfarm.cli.tables import hand_out
    from tfarm.response import bode as find
    from tfarm.response.answers import bode_answer, bode_table

    found = find(subject, wanted, band, x=x, input=driven)
    hand_out(
        lambda: bode_answer(found), _print_bode, json,
        csv=csv, table=lambda: bode_table(found), png=png, picture=(found,),
    )  # fmt: skip


@app.command()
@under_a_law
def nyquist(arm: ArmName, png: Png = None, csv: Csv = None, json: Json = False, *, given: Given) -> None:
    """Nyquist plot of the exact loop: the turns around -1 counted, beside the poles found in a box."""
    subject = load_arm(arm)
    law, said = asked_law(subject, given)
    from tfarm.cli.tables import hand_out
    from tfarm.loop.answers import nyquist_answer
    from tfarm.loop.nyquist import nyquist as find
    from tfarm.loop.nyquist import nyquist_table

    found = find(subject, law)
    hand_out(
        lambda: nyquist_answer(found) | said, _print_nyquist, json,
        csv=csv, table=lambda: nyquist_table(found), png=png, picture=(found,),
    )  # fmt: skip


def _band(arm: Arm, start: float | None, stop: float | None) -> tuple[float, float] | None:
    """The band [rad/s] that is asked for, an end that is not given as a page has it; None for the page's own."""
    if start is None and stop is None:
        return None
    from tfarm.response.frequency import resonant_band

    low, high = resonant_band(arm)
    low, high = low if start is None else start, high if stop is None else stop
    must_be_band(low, high)
    return low, high


def _print_bode(answer: dict[str, Any]) -> None:
    """Poles and zeros, then peaks and dips."""
    from tfarm.tables.terminal import show

    low, high = answer["band_rad_s"]
    at = f" at x = {answer['x']:g} m" if "x" in answer else ""
    print(f"{answer['arm']}: {answer['output']}{at} / {answer['input']} [{answer['unit']}], {low:g} to {high:g} rad/s")
    if not any(map(any, answer["value"])):
        print("zero at every frequency")
        return
    none = {"peaks": ": |G| has no local maximum here", "dips": ": |G| has no local minimum here"}
    for kind in ("poles", "zeros", "peaks", "dips"):
        if len(answer[kind]):
            print(f"{kind}:")
            show(answer[kind])
        else:
            print(f"no {kind}{none.get(kind, '')}")


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
