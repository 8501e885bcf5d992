"""The commands on an arm.  Packages are imported inside them: `tfarm --help` needs none."""

import math
from functools import partial
from typing import Annotated, Any, cast

import numpy as np
import typer

import tfarm
from tfarm.cli.app import add_command
from tfarm.cli.options import (
    ArmName,
    File,
    InputName,
    TheoryName,
    chain_of_options,
    interval,
    load_arm,
    load_loop,
    numbers,
    outputs_on,
    refuse,
)
from tfarm.cli.output import emit, emit_loop, emit_record
from tfarm.cli.progress import print_line
from tfarm.errors import require

command = partial(add_command, "Arm")
OWN_TABLE = "--compare prints a table of its own: ask for one of them"


def check_method(
    number: int,
    *,
    method: Annotated[
        str, typer.Option("--method", help="closed-form, balls, or appendix (the paper's determinant)")
    ] = "closed-form",
    compare: Annotated[
        bool, typer.Option("--compare", help="all three methods and their differences")
    ] = False,
    digits: Annotated[
        int | None, typer.Option("--digits", min=1, max=1000, help="certified digits; texts in JSON above 15")
    ] = None,
) -> tuple[Any, bool, int | None]:
    """Return method, comparison and digits of an answer at that number of points.

    Raises ParameterError for digits, or too many points, by one of the slow methods.
    """
    if method != "closed-form" or compare:
        refuse(
            {"digits": digits}, "they are certified by balls in any case: leave --method and --compare out"
        )
        remedy = "at most 2000 by balls or the appendix, which take milliseconds for each"
        require(number <= 2000, "points", number, remedy)
    return method, compare, digits


@command(epilog="modes sasaki2012-lab --count 5")
def modes(
    *,
    arm: ArmName,
    count: Annotated[int, typer.Option(min=1, max=1000)] = 10,
    certify: bool = False,
    theory: TheoryName = None,
    how: Any = check_method,
    show: Any = emit_record,
) -> None:
    """Natural frequencies, damping ratios and modes, none missing.

    Options:
    count: flexible modes
    certify: prove each bracket, and that no mode is missing
    """
    from tfarm.response.transfer import ByMethods
    from tfarm.spectrum.listing import listed_modes

    found = tfarm.modes(load_arm(arm, theory), count)
    method, is_compared, digits = how(len(found))
    if is_compared:
        refuse({"certify": certify}, OWN_TABLE)
        show(
            ByMethods(found.arm.name, "natural_frequency", "rad/s", found.index.tolist(), found.by_methods())
        )
        return
    listed = listed_modes(found, digits, certify, method)
    show(listed)
    if listed.damped_failure:
        print_line(listed.damped_failure)
        # as where nothing could be solved
        raise typer.Exit(3)


@command(epilog="response sasaki2012-lab --from 1 --to 100 --csv root.csv")
def response(
    *,
    arm: ArmName,
    output: str | None = None,
    s: Annotated[
        Any,
        typer.Option(
            metavar="S,S",
            parser=numbers(
                "numbers in 1/s such as 0.3+57.1j,10j", kind=lambda text: complex(text.replace("i", "j"))
            ),
        ),
    ] = None,
    omega: Annotated[
        Any, typer.Option(metavar="W,W", parser=numbers("frequencies in rad/s such as 1,10,100"))
    ] = None,
    start: Annotated[float, typer.Option("--from")] = 0.1,
    stop: Annotated[float, typer.Option("--to")] = 1000.0,
    points: Annotated[int, typer.Option(min=2, max=1_000_000)] = 500,
    driven: InputName = None,
    measured: Annotated[str | None, typer.Option(metavar="OUTPUT/INPUT=FILE")] = None,
    theory: TheoryName = None,
    along: Any = outputs_on,
    how: Any = check_method,
    show: Any = emit,
) -> None:
    """Exact frequency response of an output, or values at points s.

    The input is the hub torque unless the arm's file names another, and the hub angle of a locked hub.
    With --measured tip_acceleration/hub_angle=sweep.csv it is compared with that response.

    Options:
    output: output, such as tip_displacement; by default root_moment
    s: points s [1/s]: 0.3+57.1j,10j
    omega: frequencies [rad/s]: 1,10,100
    start: lowest frequency [rad/s]
    stop: highest frequency [rad/s]
    points: number of frequencies, logarithmically spaced
    measured: compare with a measured response
    """
    if measured is not None:
        from tfarm.fitting.data import data_of

        own = {"s": s, "omega": omega, "output": output, **along.keywords, "digits": how.keywords["digits"]}
        remedy = "a measured response has its own outputs and frequencies; leave this out"
        refuse(own, remedy)
        show(tfarm.overlay(load_arm(arm, theory), data_of(measured, "--measured")))
        return
    refuse({"png": show.keywords["png"]}, "a picture needs --measured; tfarm bode draws the exact response")
    from tfarm.response.transfer import ByMethods, values_at

    (wanted,), x = along(["root_moment" if output is None else output])
    method = how.keywords["method"]
    G = tfarm.transfer(load_arm(arm, theory, driven), wanted, x=x, method=method, input=driven)
    at = places_of(s, omega, (start, stop), points)
    _, is_compared, digits = how(at.size)
    if is_compared:
        refuse({"csv": show.keywords["csv"], "input": driven if G.load else None}, OWN_TABLE)
        show(ByMethods(G.arm.name, G.outputs[0], G.units[0], at.tolist(), G.by_methods(at)))
        return
    show(values_at(G, at, digits), rows=True)


def places_of(s: Any, omega: Any, limits: tuple[float, float], points: int) -> Any:
    """Return the points s [1/s] that are given, or those at frequencies given or between limits [rad/s]."""
    refuse({"omega": omega if s else None}, "give --s or --omega, not both")
    if s:
        return np.array(s)
    if omega is None:
        check_range(*limits)
        omega = np.geomspace(*limits, points)
    return 1j * np.array(omega)


def check_range(start: float, stop: float) -> None:
    """Raise ParameterError for what is no frequency range [rad/s]."""
    require(0 < start < math.inf, "--from", start, "a positive frequency in rad/s")
    require(start < stop < math.inf, "--to", stop, f"a frequency above --from, {start:g} rad/s")


@command(epilog="bode sasaki2012-lab --output tip_displacement --png bode.png")
def bode(
    *,
    arm: ArmName,
    output: str | None = None,
    start: Annotated[float | None, typer.Option("--from")] = None,
    stop: Annotated[float | None, typer.Option("--to")] = None,
    driven: InputName = None,
    loop: bool = False,
    along: Any = outputs_on,
    under: Any = load_loop,
    chain: Any = chain_of_options,
    show: Any = emit,
) -> None:
    """Bode plot of the exact response, or of the loop function.

    The response is that to the arm's input, with the poles and zeros of the output.
    With --loop of the loop function at the actuator, with its gain, phase and delay margin; with --period,
    --delay-samples or --dsp of the sampled loop too.

    Options:
    output: output, such as tip_displacement; by default root_moment
    start: lowest frequency [rad/s]
    stop: highest frequency [rad/s]; by default above ten flexible modes
    loop: loop function under the controller, in place of the response of an output
    """
    if loop:
        own = {"output": output, "from": start, "to": stop, **along.keywords, "input": driven}
        remedy = "the loop function has no output and its own frequencies; leave this out"
        refuse(own, remedy)
        emit_loop("loop", arm, under, chain, show)
        return
    from tfarm.response.frequency import resonant_band

    of_loop = {**under.keywords["gains"].keywords, "law": under.keywords["law"], **chain.keywords}
    refuse(
        of_loop,
        "the loop function: give --loop too",
    )
    subject = load_arm(arm, under.keywords["theory"], driven)
    (wanted,), x = along(["root_moment" if output is None else output])
    low, high = resonant_band(tfarm.transfer(subject, wanted, x=x, input=driven).arm)
    if start is not None:
        low = start
    if stop is not None:
        high = stop
    band = (low, high)
    check_range(*band)
    show(tfarm.bode(subject, wanted, band, x=x, input=driven))


@command(epilog="reduce sasaki2012 --outputs root_moment,hub_rate --order 14")
def reduce(
    *,
    arm: ArmName,
    outputs: str = "root_moment,hub_rate",
    order: Annotated[int | None, typer.Option(min=0)] = None,
    error: float | None = None,
    band: Annotated[Any, typer.Option(parser=interval, metavar="LOW,HIGH")] = "0.1,1000",
    method: str | None = None,
    mat: File = None,
    theory: TheoryName = None,
    along: Any = outputs_on,
    show: Any = emit_record,
) -> None:
    """Reduced state-space model, and its error over a range.

    The error is the largest one against the exact arm over the frequency range.

    Options:
    outputs: names separated by commas
    order: number of states; even where C = 0
    error: or the largest error allowed, such as 1e-6
    band: frequency range [rad/s]
    method: modal or aaa; by default that of the smaller error
    mat: write a MATLAB file, and a script of that name
    """
    from tfarm.exported.systems import save_mat

    wanted, x = along([name.strip() for name in outputs.split(",")])
    reduced = tfarm.reduce(
        load_arm(arm, theory), wanted, order=order, error=error, method=cast("Any", method), band=band, x=x
    )
    show(reduced, also=() if mat is None else save_mat(reduced, mat, key="--mat"))
