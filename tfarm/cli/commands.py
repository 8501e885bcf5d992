"""The verbs that look at an arm.  Rooms are imported inside them, so that `tfarm --help` answers at once.

The verb that leaves exactness, and says by how much.

The verbs that say why an answer can be trusted.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.cli.app import (
    ArmName,
    Compare,
    DigitCount,
    InputName,
    Json,
    MethodName,
    Place,
    SideName,
    TheoryName,
    app,
    give,
    load_arm,
    plain_number,
    read_on,
    right_digits,
    say_when_compiling,
    tell,
    whole_number,
)
from tfarm.cli.inputs import GAIN_OPTIONS, LawFiles, Typed, asked_laws, with_options
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain
from tfarm.errors import MISSING, ParameterError

if TYPE_CHECKING:
    from tfarm.arm import Arm

LaidOver = Annotated[
    str | None, typer.Option("--measured", metavar="OUTPUT/INPUT=FILE", help="lay a measured response over it")
]
MOST_LISTED = 1000  # modes with nodes and sensitivities: their work grows with the square, to some 20 s


@app.command()
def presets(json: Json = False) -> None:
    """List the arms that come with tfarm."""
    import tfarm

    arms = [tfarm.load(name) for name in tfarm.presets()]
    from tfarm.cli.tables import presets_table, print_presets

    give({"presets": presets_table(arms)}, json, print_presets)


@app.command()
def modes(
    arm: ArmName,
    count: Annotated[str, typer.Option("--count", metavar="N", help="flexible modes, 1 to 1000")] = "10",
    digits: DigitCount = None,
    certify: Annotated[bool, typer.Option("--certify", help="prove each bracket, and that no mode is missing")] = False,
    method: MethodName = "closed-form",
    compare: Compare = False,
    json: Json = False,
) -> None:
    """Natural frequencies and modes, complete by construction."""
    wanted, right = whole_number("--count", count, 1, MOST_LISTED), right_digits(digits)
    subject = load_arm(arm)
    from tfarm.cli.tables import BESIDE_COMPARE, print_compared, print_modes, refuse_beside, slow_method
    from tfarm.spectrum import modes as find_modes
    from tfarm.spectrum.answers import modes_answer, modes_by_methods_answer

    table = find_modes(subject, wanted)
    road = slow_method(method, len(table), right, compare)
    if compare:
        refuse_beside({"--certify": certify or None}, BESIDE_COMPARE)
        give(modes_by_methods_answer(table), json, print_compared)
        return
    answer = modes_answer(table, right, certify, road)
    give(answer, json, print_modes)
    if "damped_failure" in answer:
        tell(answer["damped_failure"])
        raise typer.Exit(3)  # as where nothing could be solved


@app.command()
def response(
    arm: ArmName,
    output: Annotated[str | None, typer.Option("--output", help="what is looked at, such as root_moment")] = None,
    s: Annotated[str | None, typer.Option("--s", help="points s [1/s]: 0.3+57.1j,10j")] = None,
    omega: Annotated[str | None, typer.Option("--omega", help="frequencies [rad/s]: 1,10,100")] = None,
    start: Annotated[float, typer.Option("--from", help="lowest frequency [rad/s]")] = 0.1,
    stop: Annotated[float, typer.Option("--to", help="highest frequency [rad/s]")] = 1000.0,
    points: Annotated[str, typer.Option("--points", help="how many, logarithmically spaced")] = "500",
    x: Place = None,
    side: SideName = None,
    driven: InputName = None,
    digits: DigitCount = None,
    method: MethodName = "closed-form",
    compare: Compare = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="write a table to this file")] = None,
    measured: LaidOver = None,
    png: Annotated[Path | None, typer.Option("--png", help="with --measured: write the picture to this file")] = None,
    json: Json = False,
) -> None:
    """The exact response to the arm's input: hub torque unless its file says otherwise, hub angle of a locked hub.

    With --measured tip_acceleration/hub_angle=sweep.csv: that measured response beside the exact one.
    """
    if measured is not None:
        from tfarm.cli.tables import lay_over

        others = {"--s": s, "--omega": omega, "--output": output, "--x": x, "--side": side, "--digits": digits}
        lay_over(arm, measured, others, csv, png, json)
        return
    (wanted,) = read_on([_asked_output(output, png)], side)
    from tfarm.cli.inputs import asked_input, points_on
    from tfarm.cli.tables import BESIDE_COMPARE, print_compared, refuse_beside, slow_method
    from tfarm.response import transfer
    from tfarm.response.answers import by_methods_answer, response_answer

    right, at = right_digits(digits), points_on(s, omega, start, stop, points)
    subject, driven = asked_input(load_arm(arm, driven=driven), driven)
    road = slow_method(method, at.size, right, compare)
    if compare:
        refuse_beside({"--csv": csv, "--input": driven}, BESIDE_COMPARE)
        give(by_methods_answer(transfer(subject, wanted, x=x), at), json, print_compared)
    else:
        G = transfer(subject, wanted, x=x, method=road, input=driven)
        _give_points(response_answer(G, at, right), csv, json)


def _asked_output(output: str | None, png: Path | None) -> str:
    """What is looked at.  Raises ParameterError where it is not said, and for a picture of nothing measured."""
    if output is None or png is not None:
        option = "--output" if output is None else "--measured"
        raise ParameterError(key=option, value=MISSING, remedy="say which response: --output root_moment, for one")
    return output


def _give_points(answer: dict[str, Any], csv: Path | None, json: bool) -> None:
    """A response as a table in a file or on the terminal, or as JSON."""
    from tfarm.cli.tables import hand_out, print_found
    from tfarm.response.answers import points_table
    from tfarm.tables.terminal import show

    printed = print_found if csv is not None else lambda found: show(points_table(found))
    hand_out(lambda: answer, printed, json, csv=csv, table=lambda: points_table(answer))


@app.command()
@with_options(GAIN_OPTIONS, after="only")
def report(
    arms: Annotated[
        list[str] | None, typer.Argument(metavar="[ARM ...]", help="presets or files; all presets if none")
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="the folder to write to")] = Path("reports"),
    only: Annotated[str | None, typer.Option("--only", help="one page: bode, modes, margins, locus ...")] = None,
    law: LawFiles = None,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    theory: TheoryName = None,
    measured: Annotated[
        list[str] | None, typer.Option("--measured", metavar="OUTPUT/INPUT=FILE", help="lay this over the exact one")
    ] = None,
    *,
    gains: Typed,
) -> None:
    """Write pages with pictures, tables and data: open index.html in a browser.

    With gains, or laws, or a [law] in an arm's file, the pages are about these; else about the default gains.
    """
    import tfarm

    names = arms or tfarm.presets()
    subjects = [load_arm(name, theory) for name in names]
    chains = [asked_chain(dsp or name, period, delay_samples) for name in names]
    laws = [asked_laws(arm, name, gains, law or []) for arm, name in zip(subjects, names, strict=True)]
    pages = None if only is None else (only,)
    print(_written(subjects, out, measured or [], chains=chains, laws=laws, only=pages))


def _written(subjects: list[Arm], out: Path, measured: list[str], **asked: Any) -> Path:
    """The page written, with the responses as they are typed; what is left out is said on standard error at the end."""
    from tfarm.cli.tables import progress
    from tfarm.fitting.data import data_of
    from tfarm.report import write

    responses = [data_of(text, "--measured") for text in measured]
    left_out: list[str] = []
    with progress() as advance:
        page = write(subjects, out, measured=responses, progress=advance, notice=left_out.append, **asked)
    for text in left_out:
        tell(text)
    return page


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


@app.command()
def audit(json: Json = False) -> None:
    """Every equation of the paper, as printed and as corrected, with the check that tells them apart."""
    say_when_compiling()
    from tfarm.audit import audit_answer
    from tfarm.cli.tables import print_audit

    give(audit_answer(), json, print_audit)


@app.command()
def assumptions(
    arm: ArmName,
    count: Annotated[str, typer.Option("--count", metavar="N", help="flexible modes, 1 to 100")] = "4",
    json: Json = False,
) -> None:
    """What the assumed section and hub do: frequencies over the candidates, with exact sensitivities."""
    wanted = whole_number("--count", count, 1, 100)
    subject = load_arm(arm)
    from tfarm.audit.assumptions import assumptions_answer
    from tfarm.cli.tables import print_assumptions

    give(assumptions_answer(subject, wanted), json, print_assumptions)


@app.command()
def validate(json: Json = False) -> None:
    """Natural frequencies of published tables beside the exact ones, and why where they differ."""
    say_when_compiling()
    from tfarm.audit.published import validate_answer
    from tfarm.cli.tables import print_validation

    give(validate_answer(), json, print_validation)
