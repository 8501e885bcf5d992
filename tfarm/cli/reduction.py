"""The verb that leaves exactness, and says by how much."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tfarm.cli.app import ArmName, Json, Place, SideName, app, give, load_arm, plain_number, read_on, whole_number
from tfarm.errors import ParameterError


@app.command()
def reduce(
    arm: ArmName,
    outputs: Annotated[str, typer.Option("--outputs", help="names separated by commas")] = "root_moment,hub_rate",
    order: Annotated[
        str | None, typer.Option("--order", metavar="N", help="number of states; even where C = 0")
    ] = None,
    error: Annotated[float | None, typer.Option("--error", help="or the largest error allowed, such as 1e-6")] = None,
    band: Annotated[str, typer.Option("--band", metavar="LOW,HIGH", help="frequencies [rad/s]")] = "0.1,1000",
    method: Annotated[str | None, typer.Option("--method", help="modal or aaa; the better one if left out")] = None,
    x: Place = None,
    side: SideName = None,
    mat: Annotated[Path | None, typer.Option("--mat", help="write a MATLAB file, and a script beside it")] = None,
    json: Json = False,
) -> None:
    """A state space of few states, with its worst error against the exact arm over a band."""
    try:
        low, high = (plain_number(part) for part in band.split(","))
    except ValueError:
        remedy = "two frequencies in rad/s such as 0.1,1000"
        raise ParameterError(key="--band", value=band, remedy=remedy) from None
    states = None if order is None else whole_number("--order", order, 0, 10**9)
    subject = load_arm(arm)
    from tfarm.reduced import reduce as find
    from tfarm.reduced import reduced_answer, save_mat

    wanted = read_on([name.strip() for name in outputs.split(",")], side)
    how: Any = {"order": states, "error": error, "method": method, "band": (low, high), "x": x}
    reduced = find(subject, wanted, **how)
    written = () if mat is None else save_mat(reduced, mat, key="--mat")
    from tfarm.cli.tables import say_written

    say_written(*written)
    give(reduced_answer(reduced), json, _show)


def _show(answer: dict[str, Any]) -> None:
    low, high = answer["band_rad_s"]
    print(f"{answer['arm']}: {answer['method']}, order {answer['order']}, from {answer['input']}")
    print(f"worst {answer['error_norm']} over {low:g} to {high:g} rad/s: {answer['worst_error']:.3g}")
    for name, error in answer["errors"].items():
        print(f"  {name}: {error:.3g}, at {answer['worst_at_rad_s'][name]:.6g} rad/s")
    frequency, hertz = answer["first_mode_lacking_rad_s"], answer["first_mode_lacking_hz"]
    print(f"first mode it lacks: {answer['first_mode_lacking']}, {frequency:.10g} rad/s ({hertz:.6g} Hz)")
    for name, (re, im) in zip(answer["states"][-len(answer["poles"]) :], answer["poles"], strict=True):
        if im >= 0:
            print(f"  {name.rsplit('_', 1)[0]}: pole {re:.10g}{im:+.10g}i 1/s")
    if answer["note"]:
        print(answer["note"])
