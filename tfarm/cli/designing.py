"""The verbs that choose a law: the map over two of its numbers, its design, and two laws or arms compared."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, PLANE, RATE_GAIN, TWO_GAINS, HubFeedback, as_law
from tfarm.cli.app import ArmName, Json, TheoryName, app, hand_out, load_arm, tell, whole_number
from tfarm.cli.control import pair_words
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
from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.errors import ParameterError
from tfarm.tables.terminal import show

if TYPE_CHECKING:
    from tfarm.arm import AnyLaw, Arm
    from tfarm.arrays import Real
    from tfarm.comparing import Comparison
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
    from tfarm.dsp.crossings import map_answer as sampled_map_answer
    from tfarm.loop.answers import map_answer, plane_answer, plane_table
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
    x, y, names = between(*across, number), between(*up, number), [_column_of(first), _column_of(second)]
    if (period, delay_samples, dsp) != (None,) * 3:
        chain = asked_chain(dsp or arm, period, delay_samples)
        sampled = _sampled_plane(subject, controller if of_law else None, kp, chain, (first, second), (x, y))
        hand_out(
            lambda: sampled_map_answer(sampled), _print_sampled_map, json,
            csv=csv, table=lambda: plane_table(names, x, y, sampled.counts), png=png, picture=(sampled,),
        )  # fmt: skip
        return
    found = plane(Loop(subject, as_law(controller)), (first, second), x, y)
    hand_out(
        lambda: plane_answer(found) if of_law else map_answer(found), _print_map, json,
        csv=csv, table=lambda: plane_table(names, x, y, found.unstable), png=png, picture=(found,),
    )  # fmt: skip


def _must_be_two_numbers(vary: list[str], gains: dict[str, Any]) -> None:
    """Refuse a plane of a law that does not have two numbers of its own, or has ranges of gains at the hub."""
    for name, value in gains.items():
        if value is not None:
            remedy = "leave it out: of a law the map is over two of its own numbers, --vary NAME=LO,HI twice"
            raise ParameterError(key=f"--{name}", value=value, remedy=remedy)
    if len(vary) != 2:
        remedy = "twice, such as --vary hub_angle=0,10 --vary delay=0,0.02"
        raise ParameterError(key="--vary", value=vary, remedy=remedy)


def _column_of(name: str) -> str:
    """The name of a number as that of a column."""
    return name.replace(".", "_").replace("@", "_at_")


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


def _print_map(answer: dict[str, Any]) -> None:
    """The share of the plane that is stable, and a coarse picture: a dot where nothing is unstable."""
    counts, of_law = answer["unstable_roots"], "vary" in answer
    (first, second), (x, y) = answer.get("vary", PLANE), ("x", "y") if of_law else PLANE
    flat = [count for row in counts for count in row]
    reach = f"have no unstable pole below {answer['band_rad_s']:.6g} rad/s"
    pairs = f"pairs of {first} and {second} {reach}" if of_law else "gain pairs are stable"
    print(f"{answer['arm']}: {flat.count(0)} of {len(flat)} {pairs}")
    _print_plane(answer, counts, (x, y), (first, second))


def _print_sampled_map(answer: dict[str, Any]) -> None:
    """The share of the plane in which the sampled loop is stable, and a coarse picture."""
    counts, (first, second) = answer["unstable_poles"], answer["vary"]
    flat = [count for row in counts for count in row]
    reach = f"stable when sampled every {1e3 * answer['period_s']:g} ms (first {answer['modes_used']} modes)"
    print(f"{answer['arm']}: {flat.count(0)} of {len(flat)} pairs of {first} and {second} are {reach}")
    _print_plane(answer, counts, ("x", "y"), (first, second))


def _print_plane(
    answer: dict[str, Any], counts: list[list[Any]], keys: tuple[str, str], names: tuple[str, str]
) -> None:
    """A coarse picture of the counts over the values under two keys."""
    (x, y), (first, second) = keys, names
    step = max(1, len(counts) // 24), max(1, len(counts[0]) // 60)
    for value, row in list(zip(answer[y], counts, strict=True))[:: -step[0]]:
        print(f"{value:9.3g} " + "".join("." if count == 0 else "#" for count in row[:: step[1]]))
    print(f"{second} up, {first} from {answer[x][0]:g} to {answer[x][-1]:g} to the right; . stable, # unstable")
    print(answer["sign_convention"])


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
    from tfarm.synthesis.design import design_answer

    found = find_law(
        subject, objective, structure=structure, **within, modes=number, chain=chain,
        continuous=continuous, progress=tell if sys.stderr.isatty() else None,
        also=[load_arm(name, theory) for name in also or []], ranges=ranges,
    )  # fmt: skip
    if save is not None:
        save_law(as_law(found.law), save)
    hand_out(lambda: design_answer(found), _print_design, json, also=(save,))


def _print_design(answer: dict[str, Any]) -> None:
    """The law and what it reaches, how sure the optimum is, then a row an arm."""
    loop = f"the {answer['designed_for']} loop, {answer['modes']} modes"
    told = f"{answer['structure']}, objective {answer['objective']} of {loop}: {answer['value']:.6g}"
    print(f"{answer['arm']}, {told}")
    _print_coefficients(answer)
    sampled = answer["sampled"]
    words = (
        sampled["in_words"] if "gain_units" in answer else sampled["in_words"].replace("these gains are", "it is", 1)
    )
    print(f"{'' if sampled['stable'] else 'BUT '}{words}")
    beyond = "" if answer["known_beyond_the_band"] else f" up to {answer['band_rad_s']:.4g} rad/s, not known beyond"
    print(f"continuous-time loop: {answer['verdict']}{beyond}; --save FILE keeps the law for --law FILE")
    print(f"{answer['starts_agreed']} of {answer['starts']} searches agree within half a per cent")
    _print_bounds(answer)
    if (length := answer["slew_duration_s"]) is not None:
        what = "root moment less the rigid arm's, N m rms" if answer["objective"] == "residual" else "cost of the slew"
        print(f"{what}, in a record of {length:.6g} s (tfarm simulate --duration {length:.6g})")
    _print_arms(answer)
    print(answer["sign_convention"])


def _print_coefficients(answer: dict[str, Any]) -> None:
    """A row a coefficient: its value, how flat the optimum is along it, and where it was searched."""
    names, bounds = list(answer["coefficients"]), answer["bounds"]
    columns = (
        Column("coefficient", "coefficient", of=names),
        Column("value", "value", of=list(answer["coefficients"].values()), digits=singly(general, 7)),
        Column("flat", "within one per cent", of=[pair_words(answer.get(f"flat_{name}")) for name in names]),
        Column("bounds", "searched", of=[pair_words(bounds.get(name)) for name in names]),
    )
    show(Table(columns=columns))


def _print_bounds(answer: dict[str, Any]) -> None:
    """Which bounds were widened, and where the search was cut off."""
    values = answer["coefficients"]
    for name in answer["widened"]:
        wider = pair_words(answer["bounds"][name])
        print(f"the bounds of {name} were widened to {wider}: the best law lay on the first ones")
    for name in answer["at_limit"]:
        print(f"{name} = {values[name]:.6g} is at the physical end of {pair_words(answer['bounds'][name])}")
    cut = [name for name in answer["at_bound"] if name not in answer["at_limit"]]
    if cut:
        ends = [f"{name} = {values[name]:.6g} of {pair_words(answer['bounds'][name])}" for name in cut]
        print(f"no optimum: {' and '.join(ends)} is where the search was cut off; it may get better beyond")


def _print_arms(answer: dict[str, Any]) -> None:
    """A row an arm, where there are several, and how they were chosen."""
    arms = answer["arms"]
    if len(arms) == 1:
        return
    held = ["undecided" if (s := each["sampled"]["stable"]) is None else "stable" if s else "UNSTABLE" for each in arms]
    columns = (
        Column("arm", "arm", of=[each["name"] for each in arms]),
        Column("value", answer["objective"], of=[each["value"] for each in arms], digits=singly(general, 6)),
        Column("sampled", "sampled", of=held),
        Column("verdict", "continuous-time", of=[each["verdict"] for each in arms]),
    )
    show(Table(columns=columns))
    print(f"{answer['value']:.6g} is {answer['worst_case_in_words']}; {answer['worst_arm']} is the worst")


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
    from tfarm.comparing.answers import compared_answer

    names = _names_of([arm.name for arm in subjects], files)
    found = find(subjects, laws, names=names, modes=count, output=output, chain=chain)
    page = None
    if out is not None:
        from tfarm.report.writing import write_comparison

        page = write_comparison(found, out)
    hand_out(
        lambda: compared_answer(found), partial(_print_comparison, found), json, png=png, picture=(found,), also=(page,)
    )


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


def _print_comparison(found: Comparison, answer: dict[str, Any]) -> None:
    """The verdicts, then each table; of two laws on one arm its modes are the same, and left out."""
    from tfarm.comparing.answers import compared_windows, side_words

    for side in found.sides:
        print(side_words(side))
    if found.is_of_arms:
        print("\nnatural frequencies and damping of the arms by themselves:")
        show(answer["modes"])
    if found.is_sampled:
        print("\none law is a law in z: both loops are compared at their samples, each pole z as s = ln(z)/T")
    print("\noscillating closed-loop poles, by the mode whose open-loop pole each is nearest to:")
    show(answer["poles"])
    if len(answer["unpaired_poles"]):
        print("\npoles of one side alone:")
        show(answer["unpaired_poles"])
    print()
    show(answer["margins"])
    if (windows := compared_windows(found)) is not None:
        show(windows)
        print("* no limit was found up to there, and beyond none was looked for")
    print(answer["loops"][0]["sign_convention"])
