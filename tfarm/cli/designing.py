"""The verbs that choose a law: the map over two of its numbers, its design, and two laws or arms compared."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, TWO_GAINS, HubFeedback, as_law
from tfarm.cli.app import ArmName, Json, TheoryName, app, emit, load_arm, tell, whole_number
from tfarm.cli.inputs import (
    GAIN_OPTIONS,
    Given,
    HeldAngle,
    LawFile,
    Png,
    Typed,
    asked_law,
    bounds,
    range_option,
    with_options,
)
from tfarm.cli.sampling import Delay, DspFile, Period, asked_chain
from tfarm.errors import ParameterError

if TYPE_CHECKING:
    from tfarm.arm import AnyLaw, Arm
    from tfarm.arrays import Real
    from tfarm.dsp import Chain, GainMap

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
Arms = Annotated[list[str], typer.Argument(metavar="ARM [ARM]", help="presets or TOML files", show_default=False)]
Laws = Annotated[
    list[str] | None,
    typer.Option("--law", metavar="FILE", help="of one arm two laws; of two arms one for both, or one each"),
]


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
    theory: TheoryName = None,
    json: Json = False,
    *,
    typed: dict[str, str | None],
) -> None:
    """The map over the plane of both gains, or over two numbers of a law."""
    subject, of_law = load_arm(arm, theory), bool(vary or law)
    if of_law:
        _must_be_two_numbers(vary or [], typed | {ANGLE_GAIN: kp or None})
    from tfarm.loop.loop import Loop
    from tfarm.loop.plane import between, plane, ranges_of

    if of_law:
        number = whole_number("--points", points or "60", 2, 400)
        ranges = [_range_of("--vary", each) for each in vary or []]
        controller, _ = asked_law(subject, Given({}, law, arm))
    else:
        number, given = whole_number("--points", points or "101", 2, 2000), _bounds_of(typed)
        ranges = [(name, given[name] or usual) for name, usual in zip(PLANE, ranges_of(subject), strict=True)]
        controller = HubFeedback(Kp=kp)
    (first, across), (second, up) = ranges
    x, y = between(*across, number), between(*up, number)
    if (period, delay_samples, dsp) != (None,) * 3:
        chain = asked_chain(dsp or arm, period, delay_samples)
        emit(
            _sampled_plane(subject, controller if of_law else None, kp, chain, (first, second), (x, y)),
            json,
            csv=csv,
            png=png,
        )
        return
    emit(plane(Loop(subject, as_law(controller)), (first, second), x, y), json, csv=csv, png=png)


def _must_be_two_numbers(vary: list[str], gains: dict[str, Any]) -> None:
    """Refuse a plane of a law that does not have two numbers of its own, or has ranges of gains at the hub."""
    for name, value in gains.items():
        if value is not None:
            remedy = "leave it out: of a law the map is over two of its own numbers, --vary NAME=LO,HI twice"
            raise ParameterError(key=f"--{name}", value=value, remedy=remedy)
    if len(vary) != 2:
        remedy = "twice, such as --vary hub_angle=0,10 --vary delay=0,0.02"
        raise ParameterError(key="--vary", value=vary, remedy=remedy)


def _sampled_plane(
    arm: Arm, law: AnyLaw | None, kp: float, chain: Chain, vary: tuple[str, str], axes: tuple[Real, Real]
) -> GainMap:
    """The map of the sampled loop, with as many modes as the verdict on the law takes, or on the default gains."""
    from tfarm.dsp.crossings import sampled_map
    from tfarm.dsp.verdict import sampled_verdict
    from tfarm.spectrum.table import default_gains

    law = default_gains(arm).having(ANGLE_GAIN, kp) if law is None else law
    return sampled_map(sampled_verdict(arm, law, chain).full, *axes, vary)


def _range_of(option: str, text: str) -> tuple[str, tuple[float, float]]:
    """A name and its range, of NAME=LO,HI."""
    name, _, limits = text.partition("=")
    return name, bounds(f"{option} {name}", limits)


def _bounds_of(typed: dict[str, str | None]) -> dict[str, tuple[float, float] | None]:
    """The ranges of gains, None where not typed."""
    return {name: None if text is None else bounds(f"--{name}", text) for name, text in typed.items()}


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
    theory: TheoryName = None,
    json: Json = False,
    *,
    typed: dict[str, str | None],
) -> None:
    """The law that serves an objective best in the sampled loop, at the file's period or else 10 ms."""
    number, subject = whole_number("--modes", modes, 1, 30), load_arm(arm, theory)
    chain = asked_chain(dsp or arm, period, delay_samples)
    within: Any = {**_bounds_of(typed), ANGLE_GAIN: kp}
    ranges = dict(_range_of("--range", each) for each in over or [])
    from tfarm.arm.writing import save_law
    from tfarm.synthesis.design import design as find_law

    found = find_law(
        subject, objective, structure=structure, **within, modes=number, chain=chain,
        continuous=continuous, progress=tell if sys.stderr.isatty() else None,
        also=[load_arm(name, theory) for name in also or []], ranges=ranges,
    )  # fmt: skip
    if save is not None:
        save_law(as_law(found.law), save)
    emit(found, json, also=(save,))


@app.command()
@with_options(GAIN_OPTIONS, after="arms")
def compare(
    arms: Arms,
    law: Laws = None,
    modes: Annotated[str, typer.Option("--modes", metavar="N", help="flexible modes, 1 to 30")] = "10",
    output: Annotated[str, typer.Option("--output", help="what the Bode plot of two arms shows")] = "root_moment",
    period: Period = None,
    delay_samples: Delay = None,
    dsp: DspFile = None,
    theory: TheoryName = None,
    png: Png = None,
    out: Annotated[Path | None, typer.Option("--out", help="write a page, compare.html, to this folder")] = None,
    json: Json = False,
    *,
    gains: Typed,
) -> None:
    """Two arms, or two laws on one arm, compared: modes, poles, verdicts, margins; differences in per cent or deg."""
    count, files = whole_number("--modes", modes, 1, 30), law or []
    _check_number(arms, files)
    subjects = [load_arm(name, theory) for name in arms]
    chain = asked_chain(dsp or arms[0], period, delay_samples)
    pairs = [(subjects[min(n, len(arms) - 1)], arms[min(n, len(arms) - 1)]) for n in (0, 1)]
    wanted = [None, None] if not files else files * (2 // len(files))
    laws = [asked_law(arm, Given(gains, file, name))[0] for (arm, name), file in zip(pairs, wanted, strict=True)]
    from tfarm.comparing import compare as find

    names = _names_of([arm.name for arm in subjects], files)
    found = find(subjects, laws, names=names, modes=count, output=output, chain=chain)
    page = None
    if out is not None:
        from tfarm.report.writing import write_comparison

        page = write_comparison(found, out)
    emit(found, json, png=png, also=(page,))


def _check_number(arms: list[str], files: list[str]) -> None:
    """Raise ParameterError where there are not two of anything."""
    if len(arms) > 2 or len(files) > 2:
        key, given = ("ARM", arms) if len(arms) > 2 else ("--law", files)
        raise ParameterError(key=key, value=given[2], remedy="two at most can be compared")
    if len(arms) == 1 and len(files) < 2:
        raise ParameterError(key="ARM", value=arms[0], remedy="give a second arm, or --law FILE twice")


def _names_of(arms: list[str], files: list[str]) -> list[str]:
    """What the two are called: by their arms, else by their laws' files, else by their numbers."""
    stems, whole_names = [Path(file).stem for file in files], [str(file) for file in files]
    for names in (arms, stems, whole_names):
        if len(names) == 2 and names[0] != names[1]:
            return names
    return ["first", "second"]
