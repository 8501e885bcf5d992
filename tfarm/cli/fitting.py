"""The verb that fits an arm to measured responses.

The verbs that make a measurement of a record over time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.cli.app import (
    ArmName,
    Json,
    TheoryName,
    app,
    give,
    hand_out,
    load_arm,
    progress,
    say_written,
    tell,
    whole_number,
)
from tfarm.errors import ParameterError
from tfarm.tables.files import write_csv
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
    from tfarm.fitting.answers import fit_answer, save_fit

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
    hand_out(lambda: fit_answer(found), partial(_print, found), json, png=png, picture=(found,), also=(save, page))
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


def _print(found: Fit, answer: dict[str, Any]) -> None:
    from tfarm.fitting.answers import PEAK_REACH, parameters_table

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
    from tfarm.fitting.answers import estimate_answer, measured_table
    from tfarm.fitting.recording import frequency_response, read_recording

    how = {"estimator": estimator, "window": window}
    found = frequency_response(read_recording(record), *named, columns=columns, segment=segment, overlap=overlap, **how)
    if csv is not None:
        write_csv(measured_table(found.measured), csv)
    if say_written(csv) or json:
        answer = estimate_answer(found)
        if not json and csv is None:
            show(answer["response"])
        give(answer, json, _estimated)


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
    from tfarm.fitting.answers import ring_answer
    from tfarm.fitting.recording import read_recording
    from tfarm.fitting.ringdown import MOST_RINGING
    from tfarm.fitting.ringdown import ring as find

    count = whole_number("--modes", modes, 1, MOST_RINGING)
    found = find(read_recording(record), signal, start=start, stop=stop, modes=count)
    give(ring_answer(found), json, _rung)


def _named(text: str) -> tuple[str, str]:
    """A signal's name, and that of its column in the record."""
    name, given, column = text.partition("=")
    if given and not column.strip():
        raise ParameterError(key="signal", value=text, remedy="write NAME=COLUMN, such as tip_acceleration=acc1")
    return name.strip(), column.strip() or name.strip()


def _estimated(answer: dict[str, Any]) -> None:
    rows = answer["response"]
    first, last = rows[0]["hz"], rows[len(rows) - 1]["hz"]
    overlapped = f", {100 * answer['overlap']:.3g} % overlapped" if answer["overlap"] else ""
    segments = f"{answer['segments']} segments of {answer['segment_s']:.6g} s ({answer['window']}{overlapped})"
    print(f"{answer['output']} / {answer['input']}: {len(rows)} lines from {first:.6g} to {last:.6g} Hz")
    print(f"{answer['estimator']} of {segments}, worth {answer['independent_averages']:.4g} independent averages")
    apart = f"{answer['resolution_hz']:.4g} Hz"
    flat = f"a resonance narrower than {apart} is flattened" if answer["window"] == "hann" else f"lines {apart} apart"
    print(f"median coherence {answer['median_coherence']:.4g}; {flat}")
    if answer["note"]:
        tell(answer["note"])


def _rung(answer: dict[str, Any]) -> None:

    show(answer["modes"])
    span = f"{answer['from_s']:g} to {answer['to_s']:g} s, {answer['samples']} samples"
    print(f"{answer['signal']} from {span}; residual {answer['residual_rms']:.4g} rms")
    print(f"from and to: the interval that holds the true value in {100 * answer['level']:.0f} of 100 such records")
    for mode in answer["modes"]:
        print(f"for tfarm fit: --mode N={mode['mode_option']}, where it is the arm's flexible mode N")
    for note in answer["notes"]:
        print(f"note: {note}")
