"""The verbs that make a measurement of a record over time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from tfarm.cli.app import Json, app, give, tell, whole_number
from tfarm.errors import ParameterError

RecordName = Annotated[str, typer.Argument(metavar="RECORD", help="CSV or .mat file: t [s] and signals")]


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
    from tfarm.cli.tables import say_written
    from tfarm.fitting.record_answers import estimate_answer, measured_table
    from tfarm.fitting.recording import read_recording
    from tfarm.fitting.spectra import frequency_response
    from tfarm.tables.files import write_csv
    from tfarm.tables.terminal import show

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
    from tfarm.fitting.record_answers import ring_answer
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
    from tfarm.tables.terminal import show

    show(answer["modes"])
    span = f"{answer['from_s']:g} to {answer['to_s']:g} s, {answer['samples']} samples"
    print(f"{answer['signal']} from {span}; residual {answer['residual_rms']:.4g} rms")
    print(f"from and to: the interval that holds the true value in {100 * answer['level']:.0f} of 100 such records")
    for mode in answer["modes"]:
        print(f"for tfarm fit: --mode N={mode['mode_option']}, where it is the arm's flexible mode N")
    for note in answer["notes"]:
        print(f"note: {note}")
