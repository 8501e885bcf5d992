"""The verb that fits an arm to measured responses.

The verbs that make a measurement of a record over time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.cli.app import (
    ArmName,
    Json,
    TheoryName,
    app,
    emit,
    load_arm,
    progress,
    tell,
    whole_number,
)
from tfarm.errors import ParameterError
from tfarm.tables.terminal import show

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.fitting.fit import Fit

HELP_ON_DATA = "OUTPUT/INPUT=FILE, such as tip_acceleration/hub_angle=sweep.csv; again for each response"
HELP_ON_FREE = "what is free: keys of the arm's file, such as link.youngs_modulus, and gain, delay of each sensor"
HELP_ON_MODE = "N=FREQUENCY,RATIO of a ring-down, such as 1=2.52hz,0.006; deviations after ~: 1=2.52hz~0.01,0.006~0.001"
RecordName = Annotated[str, typer.Argument(metavar="RECORD", help="CSV or .mat file: t [s] and signals")]


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
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """The numbers of an arm that explain what was measured of it, with intervals, and what is left open."""
    from tfarm.fitting.fit import save_fit

    found = _fitted(
        load_arm(arm, theory), data or [], free, mode or [], profile=not covariance,
        start={key: value for key, (value,) in _numbers("--start", start or [], 1)},
        bounds=dict(_numbers("--bounds", bounds or [], 2)), priors=dict(_numbers("--prior", prior or [], 2)),
    )  # fmt: skip
    if save is not None:
        save_fit(found, save)
    page = None
    if report:
        from tfarm.report import write

        with progress() as advance:
            page = write([found.arm], out, fits=[found], progress=advance, notice=tell)
    emit(found, json, png=png, also=(save, page))
    if not found.converged:
        raise typer.Exit(3)


def _fitted(subject: Arm, data: list[str], free: str, modes: list[str], **known: Any) -> Fit:
    """The fit to responses and ring-downs as they are typed, with what is `known` of the numbers that are free."""
    from tfarm.fitting.data import data_of
    from tfarm.fitting.fit import fit as find
    from tfarm.fitting.model import mode_of
    from tfarm.fitting.overlay import check_unit

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


@app.command()
def frf(
    record: RecordName,
    input: Annotated[str, typer.Option("--input", help="such as hub_torque; or hub_torque=COLUMN of the record")],
    output: Annotated[str, typer.Option("--output", help="such as tip_acceleration; or tip_acceleration=COLUMN")],
    estimator: Annotated[
        str, typer.Option("--estimator", help="H1 (noise on the output), H2 (on the input) or Hv")
    ] = "H1",
    window: Annotated[
        str, typer.Option("--window", help="hann for random excitation, boxcar for whole sweeps")
    ] = "hann",
    segment: Annotated[
        float | None, typer.Option("--segment", help="length [s]; an eighth of the record if not said")
    ] = None,
    overlap: Annotated[
        float | None, typer.Option("--overlap", help="share of a segment; 0.5, or 0 with boxcar")
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--save", "--csv", help="write the response, for --measured and --data")
    ] = None,
    json: Json = False,
) -> None:
    """The frequency response of a record over time, by averaged cross-spectra, with coherence."""
    named, columns = zip(*(_named(each) for each in (output, input)), strict=True)
    from tfarm.fitting.recording import frequency_response, read_recording

    how = {"estimator": estimator, "window": window}
    found = frequency_response(read_recording(record), *named, columns=columns, segment=segment, overlap=overlap, **how)
    emit(found, json, csv=csv)
    if csv is None and not json:
        show(found.csv_table)
    if found.note:
        tell(found.note)


@app.command()
def ring(
    record: RecordName,
    signal: Annotated[str, typer.Option("--signal", help="column of the record that decays")],
    start: Annotated[float | None, typer.Option("--from", help="time [s] from which on it is left alone")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="time [s] up to which")] = None,
    modes: Annotated[str, typer.Option("--modes", help="how many oscillations")] = "1",
    json: Json = False,
) -> None:
    """Frequency and damping of a decay, with intervals."""
    from tfarm.fitting.recording import read_recording
    from tfarm.fitting.resonances import MOST_RINGING
    from tfarm.fitting.resonances import ring as find

    count = whole_number("--modes", modes, 1, MOST_RINGING)
    found = find(read_recording(record), signal, start=start, stop=stop, modes=count)
    emit(found, json)


def _named(text: str) -> tuple[str, str]:
    """A signal's name, and that of its column in the record."""
    name, given, column = text.partition("=")
    if given and not column.strip():
        raise ParameterError(key="signal", value=text, remedy="write NAME=COLUMN, such as tip_acceleration=acc1")
    return name.strip(), column.strip() or name.strip()
