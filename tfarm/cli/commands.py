"""The commands on an arm, and the reduced model.  Packages are imported inside them: `tfarm --help` needs none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import typer

import tfarm
from tfarm.cli.app import (
    ArmName,
    Csv,
    InputName,
    Json,
    Place,
    Png,
    SideName,
    TheoryName,
    emit,
    group,
    interval,
    load_arm,
    numbers,
    outputs_on,
    print_line,
    refuse,
)
from tfarm.schema import Quantity

command = group("Arm")
MethodName = Annotated[str, typer.Option("--method", help="closed-form, balls, or appendix (the paper's determinant)")]
Compare = Annotated[bool, typer.Option("--compare", help="all three methods and their differences")]
DigitCount = Annotated[
    int | None, typer.Option("--digits", min=1, max=1000, help="certified digits; texts in JSON above 15")
]
MOST_SLOW = 2000  # points by balls or by the appendix, at some milliseconds each


@dataclass(frozen=True)
class Preset:
    """An arm that comes with tfarm."""

    name: Annotated[str, Quantity("name")]
    length: Annotated[float, Quantity("length [m]")]
    damping: Annotated[float, Quantity("damping C [s]")]
    hub_inertia: Annotated[float, Quantity("hub inertia", "kg m^2")]
    payload_mass: Annotated[float, Quantity("payload mass", "kg")]
    payload_inertia: Annotated[float, Quantity("payload inertia", "kg m^2")]
    assumptions: Annotated[tuple[str, ...], Quantity("assumptions")]


@dataclass(frozen=True)
class Presets:
    """All of them."""

    presets: Annotated[list[Preset], Quantity("arms")]


@command("presets")
def presets(json: Json = False) -> None:
    """List the arms that come with tfarm, with their assumptions."""
    arms = map(tfarm.load, tfarm.presets())
    rows = [
        Preset(
            *(arm.name, arm.length, arm.damping, arm.hub.inertia, arm.payload.mass, arm.payload.inertia),
            arm.assumptions,
        )
        for arm in arms
    ]
    emit(Presets(rows), json)


@command("modes sasaki2012-lab --count 5")
def modes(
    arm: ArmName,
    count: Annotated[int, typer.Option("--count", min=1, max=1000, help="flexible modes")] = 10,
    digits: DigitCount = None,
    certify: Annotated[bool, typer.Option("--certify", help="prove each bracket, and that no mode is missing")] = False,
    method: MethodName = "closed-form",
    compare: Compare = False,
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Natural frequencies, damping ratios and modes, complete by construction."""
    from tfarm.response.points import ByMethods
    from tfarm.spectrum.listing import listed_modes

    found = tfarm.modes(load_arm(arm, theory), count)
    check_method(method, len(found), digits, compare)
    if compare:
        refuse({"--certify": certify}, "--compare prints a table of its own: ask for one of them")
        emit(ByMethods(found.arm.name, "natural_frequency", "rad/s", found.index.tolist(), found.by_methods()), json)
        return
    listed = listed_modes(found, digits, certify, cast("Any", method))
    emit(listed, json)
    if listed.damped_failure:
        print_line(listed.damped_failure)
        raise typer.Exit(3)  # as where nothing could be solved


def as_complex(text: str) -> complex:
    """Return the number of 0.3+57.1j or 0.3+57.1i."""
    return complex(text.replace("i", "j"))


@command("response sasaki2012-lab --from 1 --to 100 --csv root.csv")
def response(
    arm: ArmName,
    output: Annotated[
        str | None, typer.Option("--output", help="output, such as tip_displacement; by default root_moment")
    ] = None,
    s: Annotated[
        Any, typer.Option("--s", parser=numbers(kind=as_complex), metavar="S,S", help="points s [1/s]: 0.3+57.1j,10j")
    ] = None,
    omega: Annotated[
        Any, typer.Option("--omega", parser=numbers(), metavar="W,W", help="frequencies [rad/s]: 1,10,100")
    ] = None,
    start: Annotated[float, typer.Option("--from", help="lowest frequency [rad/s]")] = 0.1,
    stop: Annotated[float, typer.Option("--to", help="highest frequency [rad/s]")] = 1000.0,
    points: Annotated[
        int, typer.Option("--points", min=2, max=1_000_000, help="number of frequencies, logarithmically spaced")
    ] = 500,
    x: Place = None,
    side: SideName = None,
    driven: InputName = None,
    digits: DigitCount = None,
    method: MethodName = "closed-form",
    compare: Compare = False,
    csv: Csv = None,
    measured: Annotated[
        str | None, typer.Option("--measured", metavar="OUTPUT/INPUT=FILE", help="compare with a measured response")
    ] = None,
    png: Png = None,
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Exact frequency response to the arm's input, or its values at points s.

    The input is the hub torque unless the arm's file names another, and the hub angle of a locked hub.
    With --measured tip_acceleration/hub_angle=sweep.csv it is compared with that response.
    """
    if measured is not None:
        from tfarm.fitting.data import data_of

        others = {"--s": s, "--omega": omega, "--output": output, "--x": x, "--side": side, "--digits": digits}
        refuse(others, "a measured response has its own outputs and frequencies; leave this out")
        emit(tfarm.overlay(load_arm(arm, theory), data_of(measured, "--measured")), json, csv=csv, png=png)
        return
    refuse({"--png": png}, "a picture needs --measured; tfarm bode draws the exact response")
    refuse({"--omega": omega if s else None}, "give --s or --omega, not both")
    from tfarm.response import points as results
    from tfarm.tables.terminal import show

    (wanted,) = outputs_on([output or "root_moment"], side)
    subject, load = load_arm(arm, theory, driven), load_on_link(driven)
    if s is None and omega is None:
        check_range(start, stop)
        omega = np.geomspace(start, stop, points)
    at = np.array(s) if s else 1j * np.array(omega)
    check_method(method, at.size, digits, compare)
    if compare:
        refuse({"--csv": csv, "--input": load}, "--compare prints a table of its own: ask for one of them")
        G = tfarm.transfer(subject, wanted, x=x)
        emit(results.ByMethods(subject.name, G.outputs[0], G.units[0], at.tolist(), G.by_methods(at)), json)
        return
    found = results.points(tfarm.transfer(subject, wanted, x=x, method=cast("Any", method), input=load), at, digits)
    emit(found, json, csv=csv)
    if csv is None and not json:
        show(found.csv_table)


def load_on_link(driven: str | None) -> str | None:
    """Return the input where it is a load on the link, force@X or moment_pair@X1,X2."""
    return driven if driven and "@" in driven else None


def check_method(method: str, number: int, digits: int | None, compare: bool) -> None:
    """Raise ParameterError for digits, or too many points, by one of the slow methods."""
    if method != "closed-form" or compare:
        refuse({"--digits": digits}, "they are certified by balls in any case: leave --method and --compare out")
        most = f"at most {MOST_SLOW} by balls or the appendix, which take milliseconds for each"
        refuse({"points": number if number > MOST_SLOW else None}, most)


def check_range(start: float, stop: float) -> None:
    """Raise ParameterError for what is no frequency range [rad/s]."""
    refuse({"--from": None if 0 < start < math.inf else start}, "a positive frequency in rad/s")
    refuse({"--to": None if start < stop < math.inf else stop}, f"a frequency above --from, {start:g} rad/s")


@command("bode sasaki2012-lab --output tip_displacement --png bode.png")
def bode(
    arm: ArmName,
    output: Annotated[str, typer.Option("--output", help="output, such as tip_displacement")] = "root_moment",
    start: Annotated[float | None, typer.Option("--from", help="lowest frequency [rad/s]")] = None,
    stop: Annotated[
        float | None, typer.Option("--to", help="highest frequency [rad/s]; by default above ten flexible modes")
    ] = None,
    x: Place = None,
    side: SideName = None,
    driven: InputName = None,
    png: Png = None,
    csv: Csv = None,
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Bode plot of the exact response to the arm's input, with the poles and zeros of that output."""
    from tfarm.response.frequency import resonant_band

    subject, (wanted,) = load_arm(arm, theory, driven), outputs_on([output], side)
    low, high = resonant_band(subject)
    band = low if start is None else start, high if stop is None else stop
    check_range(*band)
    emit(tfarm.bode(subject, wanted, band, x=x, input=load_on_link(driven)), json, csv=csv, png=png)


@command("reduce sasaki2012 --outputs root_moment,hub_rate --order 14")
def reduce(
    arm: ArmName,
    outputs: Annotated[str, typer.Option("--outputs", help="names separated by commas")] = "root_moment,hub_rate",
    order: Annotated[int | None, typer.Option("--order", min=0, help="number of states; even where C = 0")] = None,
    error: Annotated[float | None, typer.Option("--error", help="or the largest error allowed, such as 1e-6")] = None,
    band: Annotated[
        Any, typer.Option("--band", parser=interval, metavar="LOW,HIGH", help="frequency range [rad/s]")
    ] = "0.1,1000",
    method: Annotated[
        str | None, typer.Option("--method", help="modal or aaa; by default that of the smaller error")
    ] = None,
    x: Place = None,
    side: SideName = None,
    mat: Annotated[
        Path | None, typer.Option("--mat", metavar="FILE", help="write a MATLAB file, and a script of that name")
    ] = None,
    theory: TheoryName = None,
    json: Json = False,
) -> None:
    """Reduced state-space model, with its largest error against the exact arm over a frequency range."""
    from tfarm.reduced import save_mat

    wanted = outputs_on([name.strip() for name in outputs.split(",")], side)
    how: Any = {"order": order, "error": error, "method": method, "band": band, "x": x}
    reduced = tfarm.reduce(load_arm(arm, theory), wanted, **how)
    emit(reduced, json, also=() if mat is None else save_mat(reduced, mat, key="--mat"))
