"""The verbs that look at an arm, and the one that leaves exactness.

Rooms are imported inside them, so that `tfarm --help` answers at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from tfarm.arm import Arm
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
    emit,
    load_arm,
    read_on,
    right_digits,
    tell,
    whole_number,
)
from tfarm.cli.inputs import Png, asked_input, bounds, must_be_band, points_on
from tfarm.errors import MISSING, ParameterError
from tfarm.schema import Quantity
from tfarm.tables.terminal import show

if TYPE_CHECKING:
    from tfarm.exact.values import Method

Csv = Annotated[Path | None, typer.Option("--csv", help="write the curve to this file")]
LaidOver = Annotated[
    str | None, typer.Option("--measured", metavar="OUTPUT/INPUT=FILE", help="lay a measured response over it")
]
MOST_LISTED = 1000  # modes with nodes and sensitivities: their work grows with the square, to some 20 s
MOST_SLOW = 2000  # points by balls or by the appendix, at some milliseconds each
BESIDE_COMPARE = "--compare prints a table of its own: ask for one of them"


@app.command()
def presets(json: Json = False) -> None:
    """List the arms that come with tfarm."""
    import tfarm

    emit(Presets([_preset(tfarm.load(name)) for name in tfarm.presets()]), json)


class Preset(NamedTuple):
    """An arm that comes with tfarm."""

    name: Annotated[str, Quantity("name")]
    length: Annotated[float, Quantity("length [m]")]
    damping: Annotated[float, Quantity("damping C [s]")]
    hub_inertia: Annotated[float, Quantity("hub inertia", "kg m^2")]
    payload_mass: Annotated[float, Quantity("payload mass", "kg")]
    payload_inertia: Annotated[float, Quantity("payload inertia", "kg m^2")]
    assumptions: Annotated[tuple[str, ...], Quantity("assumptions")]


def _preset(arm: Arm) -> Preset:
    payload = arm.payload
    return Preset(arm.name, arm.length, arm.damping, arm.hub.inertia, payload.mass, payload.inertia, arm.assumptions)


@dataclass(frozen=True)
class Presets:
    """All of them."""

    presets: Annotated[list[Preset], Quantity("arms")]


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
    from tfarm.response.points import ByMethods
    from tfarm.spectrum import modes as find_modes
    from tfarm.spectrum.listing import listed_modes

    found = find_modes(subject, wanted)
    chosen = _slow_method(method, len(found), right, compare)
    if compare:
        _refuse_beside({"--certify": certify or None}, BESIDE_COMPARE)
        emit(ByMethods(subject.name, "natural_frequency", "rad/s", found.index.tolist(), found.by_methods()), json)
        return
    answer = listed_modes(found, right, certify, chosen)
    emit(answer, json)
    if answer.damped_failure:
        tell(answer.damped_failure)
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
    from tfarm.response.points import ByMethods
    from tfarm.response.points import points as values_at
    from tfarm.schema import curve_table

    right, at = right_digits(digits), points_on(s, omega, start, stop, points)
    subject, driven = asked_input(load_arm(arm, theory, driven), driven)
    chosen = _slow_method(method, at.size, right, compare)
    if compare:
        _refuse_beside({"--csv": csv, "--input": driven}, BESIDE_COMPARE)
        G = transfer(subject, wanted, x=x)
        emit(ByMethods(subject.name, G.outputs[0], G.units[0], at.tolist(), G.by_methods(at)), json)
        return
    found = values_at(transfer(subject, wanted, x=x, method=chosen, input=driven), at, right)
    emit(found, json, csv=csv)
    if csv is None and not json:
        show(curve_table(found))


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


def _lay_over(subject: Arm, text: str, others: dict[str, Any], csv: Path | None, png: Path | None, json: bool) -> None:
    """Both curves: mode by mode on the terminal or as JSON, point by point as a table, and as a picture.

    Raises ParameterError for one of the `others`, options that would go unheard.
    """
    from tfarm.fitting.data import data_of
    from tfarm.fitting.overlay import overlay

    _refuse_beside(others, "a measured response has its own outputs and frequencies; leave this out")
    emit(overlay(subject, data_of(text, "--measured")), json, csv=csv, png=png)


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

    emit(find(subject, wanted, band, x=x, input=driven), json, csv=csv, png=png)


def _band(arm: Arm, start: float | None, stop: float | None) -> tuple[float, float] | None:
    """The band [rad/s] that is asked for, an end that is not given as a page has it; None for the page's own."""
    if start is None and stop is None:
        return None
    from tfarm.response.frequency import resonant_band

    low, high = resonant_band(arm)
    low, high = low if start is None else start, high if stop is None else stop
    must_be_band(low, high)
    return low, high


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
    from tfarm.reduced import save_mat

    wanted = read_on([name.strip() for name in outputs.split(",")], side)
    how: Any = {"order": states, "error": error, "method": method, "band": (low, high), "x": x}
    reduced = find(subject, wanted, **how)
    written = () if mat is None else save_mat(reduced, mat, key="--mat")

    emit(reduced, json, also=written)
