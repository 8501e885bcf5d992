"""The verbs that look at an arm, and the one that leaves exactness.

Rooms are imported inside them, so that `tfarm --help` answers at once.
"""

from __future__ import annotations

import math
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
    hand_out,
    load_arm,
    read_on,
    right_digits,
    say_written,
    tell,
    whole_number,
)
from tfarm.cli.inputs import Png, asked_input, bounds, must_be_band, points_on
from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.errors import MISSING, ParameterError
from tfarm.tables.terminal import show

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.exact.values import Method

Csv = Annotated[Path | None, typer.Option("--csv", help="write the curve to this file")]
LaidOver = Annotated[
    str | None, typer.Option("--measured", metavar="OUTPUT/INPUT=FILE", help="lay a measured response over it")
]
MOST_LISTED = 1000  # modes with nodes and sensitivities: their work grows with the square, to some 20 s
MOST_SLOW = 2000  # points by balls or by the appendix, at some milliseconds each
BESIDE_COMPARE = "--compare prints a table of its own: ask for one of them"
MOST_LISTED_ROOTS = 12  # poles, or zeros, in one line of a terminal; --json has them all


@app.command()
def presets(json: Json = False) -> None:
    """List the arms that come with tfarm."""
    import tfarm

    names = ("name", "length", "damping", "hub_inertia", "payload_mass", "payload_inertia", "assumptions")
    columns = tuple(Column(key, of=key.replace("hub_", "hub.").replace("payload_", "payload.")) for key in names)
    arms = Table(columns=columns, record=[tfarm.load(name) for name in tfarm.presets()])
    give({"presets": arms}, json, _print_presets)


def _print_presets(answer: dict[str, Any]) -> None:
    """A line an arm, with its assumptions."""
    from rich.console import Console

    console = Console()
    for arm in answer["presets"]:
        console.print(f"[bold]{arm['name']}[/bold]", highlight=False)
        for text in arm["assumptions"]:
            console.print(f"  - {text}", highlight=False, markup=False)


@app.command()
def modes(
    arm: ArmName,
    count: Annotated[str, typer.Option("--count", metavar="N", help="flexible modes, 1 to 1000")] = "10",
    digits: DigitCount = None,
    certify: Annotated[bool, typer.Option("--certify", help="prove each bracket, and that no mode is missing")] = False,
    method: MethodName = "closed-form",
    compare: Compare = False,
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Natural frequencies and modes, complete by construction."""
    wanted, right = whole_number("--count", count, 1, MOST_LISTED), right_digits(digits)
    subject = load_arm(arm, theory)
    from tfarm.spectrum import modes as find_modes
    from tfarm.spectrum.answers import modes_answer, modes_by_methods_answer

    table = find_modes(subject, wanted)
    road = _slow_method(method, len(table), right, compare)
    if compare:
        _refuse_beside({"--certify": certify or None}, BESIDE_COMPARE)
        give(modes_by_methods_answer(table), json, _print_compared)
        return
    answer = modes_answer(table, right, certify, road)
    give(answer, json, _print_modes)
    if "damped_failure" in answer:
        tell(answer["damped_failure"])
        raise typer.Exit(3)  # as where nothing could be solved


def _print_modes(answer: dict[str, Any]) -> None:
    """The modal table; with damping, each eigenvalue beside its undamped frequency."""
    show(answer["modes"])
    if "proof" in answer:
        proof = answer["proof"]
        print(f"proven: each frequency enclosed, and {proof['count']} in all below {proof['below_rad_s']} rad/s")
    if "box" in answer:
        left, right, low, high = answer["box"]
        proven = "proven" if "proven_complete_in_box" in answer else "by winding number"
        print(f"{answer['eigenvalues_in_box']} eigenvalues with Re s from {left:.6g} to {right:.6g} 1/s and")
        print(f"Im s from {low:.6g} to {high:.6g} rad/s, all listed ({proven}). Beyond the box there are more:")
        print(f"{answer['box_note'].partition(': ')[2]}.")
        for each in answer.get("circuit_eigenvalues", ()):
            print(f"One more, {each:.8g} 1/s, belongs to no mode: it is the motor's circuit.")
        for each in answer.get("unassigned_eigenvalues", ()):
            re, im = each["eigenvalue"]
            print(f"One more, {re:.8g}{f' +- {im:.8g}i' if im else ''} 1/s, is assigned to no mode: {each['origin']}.")
        if "damped_note" in answer:
            print(answer["damped_note"])
    if answer["hub_locked_note"]:
        print(answer["hub_locked_note"])
    print(f"{answer['arm']}: the first {answer['count']} flexible modes, none missing ({answer['theory']} theory)")


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
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """The exact response to the arm's input: hub torque unless its file says otherwise, hub angle of a locked hub.

    With --measured tip_acceleration/hub_angle=sweep.csv: that measured response beside the exact one.
    """
    if measured is not None:
        others = {"--s": s, "--omega": omega, "--output": output, "--x": x, "--side": side, "--digits": digits}
        _lay_over(load_arm(arm, theory), measured, others, csv, png, json)
        return
    if output is None or png is not None:
        option = "--output" if output is None else "--measured"
        raise ParameterError(key=option, value=MISSING, remedy="say which response: --output root_moment, for one")
    (wanted,) = read_on([output], side)
    from tfarm.response import transfer
    from tfarm.response.answers import by_methods_answer, points_table, response_answer

    right, at = right_digits(digits), points_on(s, omega, start, stop, points)
    subject, driven = asked_input(load_arm(arm, theory, driven), driven)
    road = _slow_method(method, at.size, right, compare)
    if compare:
        _refuse_beside({"--csv": csv, "--input": driven}, BESIDE_COMPARE)
        give(by_methods_answer(transfer(subject, wanted, x=x), at), json, _print_compared)
        return
    answer = response_answer(transfer(subject, wanted, x=x, method=road, input=driven), at, right)
    printed = _print_found if csv is not None else lambda found: show(points_table(found))
    hand_out(lambda: answer, printed, json, csv=csv, table=lambda: points_table(answer))


def _slow_method(method: str, number: int, digits: int | None, compare: bool) -> Method:
    """The method asked for.  Raises ParameterError for an unknown one, too many points, digits beside a slow one."""
    from tfarm.exact.values import known_method

    chosen = known_method(method)
    if chosen == "closed-form" and not compare:
        return chosen
    if digits is not None:
        remedy = "they are proven by balls in any case: leave --method and --compare out"
        raise ParameterError(key="--digits", value=digits, remedy=remedy)
    if number > MOST_SLOW:
        remedy = f"at most {MOST_SLOW} by balls or the appendix, which take milliseconds for each"
        raise ParameterError(key="points", value=number, remedy=remedy)
    return chosen


def _refuse_beside(others: dict[str, Any], remedy: str) -> None:
    """Raise ParameterError for an option that another one would leave unheard."""
    for key, value in others.items():
        if value is not None:
            raise ParameterError(key=key, value=value, remedy=remedy)


def _print_found(answer: dict[str, Any]) -> None:
    """How many points, and where the response is largest, for those who have the table in a file."""
    sizes = [abs(complex(*map(float, value))) for value in answer["value"]]
    largest = max(range(len(sizes)), key=sizes.__getitem__)
    re, im = answer["s"][largest]
    what = f"largest |{answer['output']} / {answer['input']}| {sizes[largest]:.6g}"
    unit = f"{answer['unit']} / {answer['input_unit']}"
    print(f"{answer['arm']}: {len(sizes)} points, {what} {unit} at s = {re:.10g}{im:+.10g}i 1/s")


def _print_compared(answer: dict[str, Any]) -> None:
    """A row a point or a mode: the closed form's number, and how far the others are from it, relatively."""
    from tfarm.exact.values import METHODS_AGREE

    numbers = answer["methods"]["closed-form"]
    if "index" in answer:
        first = Column("index", "mode", of=answer["index"]), Column("", "rad/s", of=numbers, digits=singly(general, 15))
    else:
        points = [f"{complex(*at):.10g}" for at in answer["s"]]
        pairs = ([part if abs(part) > METHODS_AGREE * math.hypot(*pair) else 0.0 for part in pair] for pair in numbers)
        values = [f"{complex(*pair):.15g}" for pair in pairs]  # no part that is less than the rounding of the other
        first = Column("s", "s", "1/s", of=points), Column("", answer["output"], answer["unit"], of=values)
    apart = [
        Column(name, f"{name} differ{end} by", of=answer["differences"][name], digits=singly("{:.1e}".format))
        for name, end in (("balls", ""), ("appendix", "s"))
        if name in answer["differences"]
    ]
    show(Table(columns=(*first, *apart)))
    largest = answer["largest_difference"]
    if largest <= METHODS_AGREE:
        others = " and proven balls" if answer["left_out"] else ", proven balls and the paper's own determinant"
        print(f"Float64{others} agree to {largest:.1e}, their rounding.")
    else:
        print(f"They part by up to {largest:.1e}: more than rounding ({METHODS_AGREE:.0e}); the balls are proven.")
    for method, why in answer["left_out"].items():
        print(f"No {method} here: {why}.")


def _lay_over(subject: Arm, text: str, others: dict[str, Any], csv: Path | None, png: Path | None, json: bool) -> None:
    """Both curves: mode by mode on the terminal or as JSON, point by point as a table, and as a picture.

    Raises ParameterError for one of the `others`, options that would go unheard.
    """
    from tfarm.fitting.data import data_of
    from tfarm.fitting.overlay import curves_table, overlay, overlay_answer

    _refuse_beside(others, "a measured response has its own outputs and frequencies; leave this out")
    found = overlay(subject, data_of(text, "--measured"))
    hand_out(
        lambda: overlay_answer(found), _print_overlay, json,
        csv=csv, table=lambda: curves_table(found), png=png, picture=(found,),
    )  # fmt: skip


def _print_overlay(answer: dict[str, Any]) -> None:
    """Mode by mode what differs, then poles and zeros."""
    from tfarm.fitting.overlay import required_table

    low, high = answer["band_hz"]
    span = f"{answer['points']} points from {low:.6g} to {high:.6g} Hz"
    print(f"{answer['arm']}: {answer['output']} over {answer['input']} [{answer['unit']}], {span}")
    if len(answer["modes"]):
        show(answer["modes"])
    else:
        print("no resonance of the arm lies in the band")
    for peak in answer["unmatched_peaks_hz"]:
        print(f"measured peak at {peak:.6g} Hz: none of the arm's is near")
    if (table := required_table(answer)) is not None:
        print("what the arm's numbers would have to be, each alone and for each mode (to first order in logarithms):")
        show(table)
    for what in ("poles", "zeros"):
        print(f"{what} up to {answer['roots_up_to_rad_s']:.6g} rad/s [1/s]: {_listed(answer[what])}")
    if answer["common"]:
        print(f"common to both signals, and in neither: {_listed(answer['common'])}")
    print(f"noise by {answer['noise']}; rms of ln |measured/exact| {answer['rms_log_error']:.4g}")


def _listed(roots: list[list[float]]) -> str:
    """Those in the upper half-plane, the first of them."""
    texts = [f"{re:.6g}{im:+.6g}i" if im else f"{re:.6g}" for re, im in roots[:MOST_LISTED_ROOTS]]
    rest = f" and {len(roots) - MOST_LISTED_ROOTS} more" if len(roots) > MOST_LISTED_ROOTS else ""
    return ", ".join(texts) + rest if texts else "none"


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
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Bode plot of the exact response to the arm's input, with the poles and zeros that the output shows."""
    subject, driven = asked_input(load_arm(arm, theory, driven), driven)
    band, (wanted,) = _band(subject, start, stop), read_on([output], side)
    from tfarm.response import bode as find
    from tfarm.response.answers import bode_answer, bode_table

    found = find(subject, wanted, band, x=x, input=driven)
    hand_out(
        lambda: bode_answer(found), _print_bode, json,
        csv=csv, table=lambda: bode_table(found), png=png, picture=(found,),
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
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """A state space of few states, with its worst error against the exact arm over a band."""
    low, high = bounds("--band", band, "two frequencies in rad/s such as 0.1,1000")
    states = None if order is None else whole_number("--order", order, 0, 10**9)
    subject = load_arm(arm, theory)
    from tfarm.reduced import reduce as find
    from tfarm.reduced import reduced_answer, save_mat

    wanted = read_on([name.strip() for name in outputs.split(",")], side)
    how: Any = {"order": states, "error": error, "method": method, "band": (low, high), "x": x}
    reduced = find(subject, wanted, **how)
    written = () if mat is None else save_mat(reduced, mat, key="--mat")

    say_written(*written)
    give(reduced_answer(reduced), json, _print_reduced)


def _print_reduced(answer: dict[str, Any]) -> None:
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
