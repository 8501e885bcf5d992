"""The verbs of the continuous loop: poles, margins, map and design."""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, TWO_GAINS, as_law
from tfarm.cli.app import ArmName, Json, app, give, load_arm, plain_number, tell, whole_number
from tfarm.cli.inputs import Given, HeldAngle, LawFile, Png, asked_law, range_option, under_a_law, with_options
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain
from tfarm.errors import ParameterError

if TYPE_CHECKING:
    from tfarm.arm import AnyLaw, Arm
    from tfarm.arrays import Real
    from tfarm.dsp import Chain

HELP_ON_COUNT = (
    "poles with Im s >= 0, 1 to 1000; if not given ten, or those below the shear cut-off where they are fewer"
)

HELP_ON_ALSO = "a further arm that the law has to serve: the objective is the worst of all; may be repeated"
HELP_ON_RANGE = "numbers that the arm may have, such as payload.mass=0.1,0.5; up to four: corners, and a search inside"
HELP_ON_VARY = "twice: two numbers of a law and their ranges; gain, delay, SIGNAL, SIGNAL.num.N or SIGNAL.den.N"

MapPeriod = Annotated[
    float | None, typer.Option("--period", help="sampling period [s]: the map of the sampled loop, as with --dsp")
]
HELP_ON_MAP = (
    f"How many poles are unstable over the plane of {' and '.join(PLANE)}, and the exact boundary; "
    "or over two numbers of a law."
)
HELP_ON_OBJECTIVE = "damping, margin, sensitivity, delay, residual or cost (of the tuner's trial)"
HELP_ON_STRUCTURE = f"{TWO_GAINS}, PD, PD+notch, lead, PPF or strain-rate"
USUAL_RANGES = {  # of a map
    RATE_GAIN: f"by default -1,3 on the paper's arm, -3.33 to 10 times the default {RATE_GAIN} on a rig",
    MOMENT_GAIN: "by default -2,2, times what one N m takes of the input of a rig",
}
RANGES = {name: range_option(name, f"range of {name}; {usual}") for name, usual in USUAL_RANGES.items()}
BOUNDS = {name: range_option(name, f"bounds of {name}") for name in PLANE}


@app.command()
@under_a_law
def poles(
    arm: ArmName,
    count: Annotated[str | None, typer.Option("--count", metavar="N", help=HELP_ON_COUNT)] = None,
    certify: Annotated[bool, typer.Option("--certify", help="prove each, and that none is missing")] = False,
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Closed-loop poles of the exact arm, complete in a printed box."""
    number, subject = None if count is None else whole_number("--count", count, 1, 1000), load_arm(arm)
    law, said = asked_law(subject, given)
    from tfarm.cli.control_tables import print_poles
    from tfarm.loop.answers import poles_answer
    from tfarm.loop.poles import closed_loop_poles

    give(poles_answer(closed_loop_poles(subject, law, number), certify) | said, json, print_poles)


@app.command()
@under_a_law
def margins(arm: ArmName, json: Json = False, *, given: Given) -> None:
    """The verdict on a loop, the windows of each gain, and the margins of the exact loop function."""
    subject = load_arm(arm)
    law, said = asked_law(subject, given)
    from tfarm.cli.control_tables import print_margins
    from tfarm.loop.answers import margins_answer
    from tfarm.loop.margins import margins as find_margins

    found = find_margins(subject, law)
    give(margins_answer(found) | said, json, partial(print_margins, found))


@app.command()
@under_a_law
def spill(
    arm: ArmName,
    modes: Annotated[str, typer.Option("--modes", metavar="N", help="models of 1 to so many modes")] = "20",
    json: Json = False,
    *,
    given: Given,
) -> None:
    """Does a law drive a mode that its design model leaves out?  The exact loop beside models of 1, 2, 3 ... modes."""
    number, subject = whole_number("--modes", modes, 1, 60), load_arm(arm)
    law, said = asked_law(subject, given)
    from tfarm.cli.control_tables import print_spill
    from tfarm.loop.answers import spill_answer
    from tfarm.loop.spill import spill as find

    give(spill_answer(find(subject, law, number)) | said, json, print_spill)


@app.command("map", help=HELP_ON_MAP)
@with_options(RANGES, after="arm")
def gain_map(
    arm: ArmName,
    kp: HeldAngle = 0.0,
    points: Annotated[str | None, typer.Option("--points", help="grid points along each; 101, of a law 60")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="write both numbers and the count to this file")] = None,
    png: Png = None,
    law: LawFile = None,
    vary: Annotated[list[str] | None, typer.Option("--vary", metavar="NAME=LO,HI", help=HELP_ON_VARY)] = None,
    period: MapPeriod = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    json: Json = False,
    *,
    typed: dict[str, str | None],
) -> None:
    """The map over the plane of both gains, or over two numbers of a law."""
    number, subject = whole_number("--points", points or "101", 2, 2000), load_arm(arm)
    chain = None if (period, delay_samples, dsp) == (None,) * 3 else asked_chain(dsp or arm, period, delay_samples)
    if vary or law:
        _must_be_none_of(typed | {ANGLE_GAIN: kp or None})
        _law_map(subject, arm, law, vary or [], whole_number("--points", points or "60", 2, 400), chain, csv, png, json)
        return
    from tfarm.loop.plane import ranges_of

    usual, given = ranges_of(subject), _bounds_of(typed)
    x, y = (given[name] or known for name, known in zip(PLANE, usual, strict=True))
    from tfarm.cli.control_tables import print_map
    from tfarm.cli.tables import hand_out
    from tfarm.loop.answers import map_answer, plane_table
    from tfarm.loop.plane import between
    from tfarm.loop.plane import gain_map as find

    if chain is not None:
        from tfarm.spectrum.table import default_gains

        gains = default_gains(subject).having(ANGLE_GAIN, kp)
        _sampled_map(subject, gains, chain, PLANE, (between(*x, number), between(*y, number)), csv, png, json)
        return
    found = find(subject, between(*x, number), between(*y, number), kp)
    hand_out(
        lambda: map_answer(found), print_map, json,
        csv=csv, table=lambda: plane_table(PLANE, *found.axes, found.unstable), png=png, picture=(found,),
    )  # fmt: skip


def _must_be_none_of(typed: dict[str, Any]) -> None:
    """Refuse ranges of gains beside a law, which has numbers of its own."""
    for name, value in typed.items():
        if value is not None:
            remedy = "leave it out: of a law the map is over two of its own numbers, --vary NAME=LO,HI twice"
            raise ParameterError(key=f"--{name}", value=value, remedy=remedy)


def _law_map(
    subject: Arm,
    name: str,
    law: str | None,
    vary: list[str],
    number: int,
    chain: Chain | None,
    csv: Path | None,
    png: Path | None,
    json: bool,
) -> None:
    """The map over two numbers of a law, those of a file or of the arm's own."""
    if len(vary) != 2:
        remedy = "twice, such as --vary hub_angle=0,10 --vary delay=0,0.02"
        raise ParameterError(key="--vary", value=vary, remedy=remedy)
    ranges = [_range_of("--vary", each) for each in vary]
    typed = asked_law(subject, Given({}, law, name))[0]
    from tfarm.cli.control_tables import print_law_map
    from tfarm.cli.tables import hand_out
    from tfarm.loop.answers import law_map_answer, plane_table
    from tfarm.loop.loop import Loop
    from tfarm.loop.plane import between, plane

    x, y = (between(*limits, number) for _, limits in ranges)
    if chain is not None:
        _sampled_map(subject, typed, chain, (ranges[0][0], ranges[1][0]), (x, y), csv, png, json)
        return
    found = plane(Loop(subject, as_law(typed)), (ranges[0][0], ranges[1][0]), x, y)
    names = [name.replace(".", "_").replace("@", "_at_") for name in found.vary]
    hand_out(
        lambda: law_map_answer(found), print_law_map, json,
        csv=csv, table=lambda: plane_table(names, found.x, found.y, found.unstable), png=png, picture=(found,),
    )  # fmt: skip


def _sampled_map(
    subject: Arm, law: AnyLaw, chain: Chain, vary: tuple[str, str], axes: tuple[Real, Real], csv: Path | None,
    png: Path | None, json: bool,
) -> None:  # fmt: skip
    """The map over two numbers of the law of a sampled loop, with as many modes as the verdict on the law takes."""
    from tfarm.cli.control_tables import print_sampled_map
    from tfarm.cli.tables import hand_out
    from tfarm.dsp.crossings import law_map, map_answer
    from tfarm.dsp.verdict import sampled_verdict
    from tfarm.loop.answers import plane_table

    found = law_map(sampled_verdict(subject, law, chain).full, *axes, vary)
    names = [name.replace(".", "_").replace("@", "_at_") for name in vary]
    hand_out(
        lambda: map_answer(found), print_sampled_map, json,
        csv=csv, table=lambda: plane_table(names, found.x, found.y, found.counts), png=png, picture=(found,),
    )  # fmt: skip


def _range_of(option: str, text: str) -> tuple[str, tuple[float, float]]:
    """A name and its range, of NAME=LO,HI."""
    name, _, limits = text.partition("=")
    return name, bounds(f"{option} {name}", limits)


@app.command()
@with_options(BOUNDS, after="structure")
def design(
    arm: ArmName,
    objective: Annotated[str, typer.Option("--objective", help=HELP_ON_OBJECTIVE)] = "damping",
    structure: Annotated[str, typer.Option("--structure", help=HELP_ON_STRUCTURE)] = TWO_GAINS,
    kp: HeldAngle = 0.0,
    modes: Annotated[str, typer.Option("--modes", help="flexible modes in the band, 1 to 30")] = "2",
    continuous: Annotated[bool, typer.Option("--continuous", help="for the continuous-time loop")] = False,
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    also: Annotated[list[str] | None, typer.Option("--also", metavar="ARM", help=HELP_ON_ALSO)] = None,
    over: Annotated[list[str] | None, typer.Option("--range", metavar="KEY=LO,HI", help=HELP_ON_RANGE)] = None,
    save: Annotated[Path | None, typer.Option("--save", help="write the law to this TOML file, for --law")] = None,
    json: Json = False,
    *,
    typed: dict[str, str | None],
) -> None:
    """The law that serves an objective best in the sampled loop, at the file's period or else 10 ms."""
    number, subject = whole_number("--modes", modes, 1, 30), load_arm(arm)
    chain = asked_chain(dsp or arm, period, delay_samples)
    within: Any = {**_bounds_of(typed), ANGLE_GAIN: kp}
    ranges = dict(_range_of("--range", each) for each in over or [])
    from tfarm.arm.writing import save_law
    from tfarm.cli.control_tables import print_design
    from tfarm.cli.tables import hand_out
    from tfarm.synthesis.design import design as find_law
    from tfarm.synthesis.design import design_answer

    found = find_law(
        subject, objective, structure=structure, **within, modes=number, chain=chain,
        continuous=continuous, progress=tell if sys.stderr.isatty() else None,
        also=[load_arm(name) for name in also or []], ranges=ranges,
    )  # fmt: skip
    if save is not None:
        save_law(as_law(found.law), save)
    hand_out(lambda: design_answer(found), print_design, json, also=(save,))


def _bounds_of(typed: dict[str, str | None]) -> dict[str, tuple[float, float] | None]:
    """The ranges of gains, None where not typed."""
    return {name: None if text is None else bounds(f"--{name}", text) for name, text in typed.items()}


def bounds(key: str, text: str) -> tuple[float, float]:
    """Two numbers separated by a comma, the lower first."""
    remedy = "two numbers, the lower first, such as -1,3"
    try:
        low, high = (plain_number(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not -math.inf < low < high < math.inf:
        raise ParameterError(key=key, value=text, remedy=remedy)
    return low, high
