"""The commands on measured data: the fit of an arm, and the estimates of a record over time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import tfarm
from tfarm.cli.app import (
    ArmName,
    Json,
    Png,
    TheoryName,
    advance,
    emit,
    group,
    load_arm,
    named,
    numbers,
    print_line,
)
from tfarm.errors import ParameterError

command = group("Measurement")
RecordName = Annotated[
    Path, typer.Argument(metavar="RECORD", exists=True, help="CSV or .mat file: t [s] and signals", show_default=False)
]


@command("fit rig.toml --data tip_acceleration/hub_angle=sweep.csv --free link.youngs_modulus,delay --save fitted.toml")
def fit(
    arm: ArmName,
    data: Annotated[
        list[str] | None,
        typer.Option(
            "--data",
            metavar="OUTPUT/INPUT=FILE",
            help="measured response; may be repeated",
        ),
    ] = None,
    free: Annotated[
        str,
        typer.Option(
            "--free",
            metavar="KEY,KEY",
            help="free numbers: keys of the arm's file, such as link.youngs_modulus, and gain, delay of each sensor",
        ),
    ] = "",
    start: Annotated[
        list[Any] | None,
        typer.Option("--start", parser=named(numbers(1)), metavar="KEY=VALUE", help="first value, if not the arm's"),
    ] = None,
    bounds: Annotated[
        list[Any] | None,
        typer.Option("--bounds", parser=named(numbers(2)), metavar="KEY=LO,HI", help="bounds of a number"),
    ] = None,
    prior: Annotated[
        list[Any] | None,
        typer.Option("--prior", parser=named(numbers(2)), metavar="KEY=MEAN,STD", help="prior mean and deviation"),
    ] = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(
            "--mode",
            metavar="N=HZ,RATIO",
            help="mode of a ring-down: 1=2.52hz,0.006, with standard deviations 1=2.52hz~0.01,0.006~0.001",
        ),
    ] = None,
    covariance: Annotated[
        bool, typer.Option("--covariance", help="intervals by the covariance alone, without profiles")
    ] = False,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="FILE", help="write the fitted arm to this TOML file")
    ] = None,
    png: Png = None,
    report: Annotated[bool, typer.Option("--report", help="write the pages of the fitted arm")] = False,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="the folder of the pages")] = Path("reports"),
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Fit of an arm's numbers to measured responses and ring-downs, with confidence intervals."""
    from tfarm.fitting import model, overlay
    from tfarm.fitting.data import data_of
    from tfarm.fitting.fit import save_fit

    subject, measured, page = load_arm(arm, theory), [data_of(text) for text in data or []], None
    for each in measured:
        overlay.check_unit(subject, each)
    found = tfarm.fit(
        subject, measured, [key.strip() for key in free.split(",") if key.strip()],
        rings=[model.mode_of(text) for text in mode or []], profile=not covariance, progress=advance,
        start={key: value for key, (value,) in start or []}, bounds=dict(bounds or []), priors=dict(prior or []),
    )  # fmt: skip
    if save is not None:
        save_fit(found, save)
    if report:
        from tfarm.report import write

        page = write([found.arm], out, fits=[found], progress=advance, notice=print_line)
    emit(found, json, png=png, also=(save, page))
    if not found.converged:
        raise typer.Exit(3)


@command("frf record.csv --input hub_torque --output tip_acceleration=acc1 --save measured.csv")
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
        float | None, typer.Option("--segment", help="length of a segment [s]; by default an eighth of the record")
    ] = None,
    overlap: Annotated[
        float | None, typer.Option("--overlap", help="share of a segment; by default 0.5, or 0 with boxcar")
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option("--save", "--csv", metavar="FILE", help="write the response, for --measured and --data"),
    ] = None,
    json: Json = False,
) -> None:
    """Frequency response of a record over time, by averaged cross-spectra, with coherence."""
    from tfarm.fitting import recording
    from tfarm.tables.terminal import show

    named, columns = zip(*map(signal_and_column, (output, input)), strict=True)
    how: Any = {"estimator": estimator, "window": window, "segment": segment, "overlap": overlap}
    found = recording.frequency_response(recording.read_recording(record), *named, columns=columns, **how)
    emit(found, json, csv=csv)
    if csv is None and not json:
        show(found.csv_table)
    if found.note:
        print_line(found.note)


def signal_and_column(text: str) -> tuple[str, str]:
    """Return the name of a signal, and that of its column in the record, of NAME or NAME=COLUMN."""
    name, given, column = text.partition("=")
    if given and not column.strip():
        raise ParameterError(key="signal", value=text, remedy="write NAME=COLUMN, such as tip_acceleration=acc1")
    return name.strip(), column.strip() or name.strip()


@command("ring record.csv --signal root_strain --from 2.5")
def ring(
    record: RecordName,
    signal: Annotated[str, typer.Option("--signal", help="column of the record that decays")],
    start: Annotated[float | None, typer.Option("--from", help="time [s] at which the excitation ends")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="last time [s]")] = None,
    modes: Annotated[int, typer.Option("--modes", min=1, help="number of oscillations")] = 1,
    json: Json = False,
) -> None:
    """Frequencies and damping ratios of a decay, with confidence intervals."""
    from tfarm.fitting import recording, resonances

    found = resonances.ring(recording.read_recording(record), signal, start=start, stop=stop, modes=modes)
    emit(found, json)
