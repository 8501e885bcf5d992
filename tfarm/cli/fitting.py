"""The verb that fits an arm to measured responses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.cli.app import ArmName, Json, app, load_arm, tell
from tfarm.errors import ParameterError

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.fitting.fit import Fit

HELP_ON_DATA = "OUTPUT/INPUT=FILE, such as tip_acceleration/hub_angle=sweep.csv; again for each response"
HELP_ON_FREE = "what is free: keys of the arm's file, such as link.youngs_modulus, and gain, delay of each sensor"
HELP_ON_MODE = "N=FREQUENCY,RATIO of a ring-down, such as 1=2.52hz,0.006; deviations after ~: 1=2.52hz~0.01,0.006~0.001"


@app.command()
def fit(
    arm: ArmName,
    data: Annotated[list[str] | None, typer.Option("--data", metavar="OUTPUT/INPUT=FILE", help=HELP_ON_DATA)] = None,
    free: Annotated[str, typer.Option("--free", metavar="KEY,KEY", help=HELP_ON_FREE)] = "",
    start: Annotated[
        list[str] | None, typer.Option("--start", metavar="KEY=VALUE", help="where a number starts, if elsewhere")
    ] = None,
    bounds: Annotated[list[str] | None, typer.Option("--bounds", metavar="KEY=LO,HI", help="its bounds")] = None,
    prior: Annotated[
        list[str] | None, typer.Option("--prior", metavar="KEY=MEAN,STD", help="what is known of it beforehand")
    ] = None,
    mode: Annotated[list[str] | None, typer.Option("--mode", metavar="N=HZ,RATIO", help=HELP_ON_MODE)] = None,
    covariance: Annotated[
        bool, typer.Option("--covariance", help="intervals by the covariance alone, without profiles")
    ] = False,
    save: Annotated[Path | None, typer.Option("--save", help="write the fitted arm to this TOML file")] = None,
    png: Annotated[Path | None, typer.Option("--png", help="draw measured over fitted curves into this file")] = None,
    report: Annotated[
        bool, typer.Option("--report", help="write the fitted arm's pages, with what the data leave open")
    ] = False,
    out: Annotated[Path, typer.Option("--out", help="the folder of the pages")] = Path("reports"),
    json: Json = False,
) -> None:
    """The numbers of an arm that explain what was measured of it, with intervals, and what is left open."""
    from tfarm.cli.tables import hand_out
    from tfarm.fitting.answers import fit_answer, save_fit

    found = _fitted(
        load_arm(arm), data or [], free, mode or [], profile=not covariance,
        start={key: value for key, (value,) in _numbers("--start", start or [], 1)},
        bounds=dict(_numbers("--bounds", bounds or [], 2)), priors=dict(_numbers("--prior", prior or [], 2)),
    )  # fmt: skip
    if save is not None:
        save_fit(found, save)
    page = _report(found, out) if report else None
    hand_out(lambda: fit_answer(found), partial(_print, found), json, png=png, picture=(found,), also=(save, page))
    if not found.converged:
        raise typer.Exit(3)


def _fitted(subject: Arm, data: list[str], free: str, modes: list[str], **known: Any) -> Fit:
    """The fit to responses and ring-downs as they are typed, with what is `known` of the numbers that are free."""
    from tfarm.cli.tables import progress
    from tfarm.fitting.fit import fit as find
    from tfarm.fitting.overlay import check_unit
    from tfarm.fitting.reading import data_of
    from tfarm.fitting.ringing import mode_of

    measured = [data_of(text) for text in data]
    for each in measured:
        check_unit(subject, each)
    keys = [key.strip() for key in free.split(",") if key.strip()]
    with progress() as advance:
        return find(subject, measured, keys, rings=[mode_of(text) for text in modes], progress=advance, **known)


def _numbers(option: str, texts: Iterable[str], count: int) -> Iterable[tuple[str, Any]]:
    """Key and numbers of KEY=NUMBER,NUMBER."""
    for text in texts:
        key, given, numbers = text.partition("=")
        try:
            values = tuple(float(part) for part in numbers.split(","))
        except ValueError:
            values = ()
        if not given or len(values) != count or any(map(math.isnan, values)):
            form = "KEY=" + ",".join(["NUMBER"] * count)
            raise ParameterError(key=option, value=text, remedy=f"write {form}, in SI units")
        yield key.strip(), values


def _report(found: Fit, out: Path) -> Path:
    from tfarm.cli.tables import progress
    from tfarm.report import write

    with progress() as advance:
        return write([found.arm], out, fits=[found], progress=advance, notice=tell)


def _print(found: Fit, answer: dict[str, Any]) -> None:
    from tfarm.fitting.answers import PEAK_REACH, parameters_table
    from tfarm.tables.terminal import show

    print(f"{answer['arm_name']}: {answer['in_words']}")
    show(parameters_table(found))
    print(
        f"from and to: the 95 % interval {'of the covariance' if not found.profiled else 'of the profile likelihood'}"
    )
    for words in answer["not_determined"]:
        print(words)
    if answer["records"] is not None:
        print(answer["records"]["in_words"])
        for key, (low, high) in answer["records"]["intervals"].items():
            print(f"{key} by records: {low:.6g} to {high:.6g}")
    rows = zip(*answer["frequencies_hz"].values(), strict=True)
    shown = [" -> ".join("-" if each is None else f"{each:.5g}" for each in row) for row in rows]
    if shown:
        print(f"resonances [Hz], before -> after -> measured: {'; '.join(shown)}")
    for peak in answer["unexplained_peaks_hz"]:
        print(f"the peak measured at {peak:.5g} Hz is {100 * PEAK_REACH:.0f} % and more from every pole of the arm")
    if answer["rms_log_error"] is not None:
        print(f"rms of ln(computed/measured): {answer['rms_log_error']:.4g}")
