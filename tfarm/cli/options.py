"""Options that commands share, and what they name: the arm, the law, the case and the chain."""

from cmath import inf, isnan
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

import tfarm
from tfarm.arm import ANGLE_GAIN, PLANE, AnyLaw, Arm, Theory, implausible
from tfarm.arm.reading import ArmFile, load_tables
from tfarm.cli.progress import print_line
from tfarm.errors import require

if TYPE_CHECKING:
    from tfarm.arm.chain import Chain
    from tfarm.fitting.recording import Recording
    from tfarm.fitting.runs import RigRun
    from tfarm.fitting.signals import RecordSignal


def preset_names(incomplete: str) -> list[str]:
    """Return the presets that begin so, for the completion of a shell."""
    return [name for name in tfarm.presets() if name.startswith(incomplete)]


def read_arm(name: str) -> ArmFile:
    """Return the tables of a preset or file, for all that a command makes of them."""
    return load_tables(name)


def read_arms(names: Any) -> list[ArmFile]:
    """Return those of several; none of None."""
    return [load_tables(name) for name in names or ()]


def numbers(
    form: str, count: int = 0, kind: Callable[[str], Any] = float
) -> Callable[[str], tuple[Any, ...]]:
    """Return the parser of numbers that commas separate, `count` of them or any; `form` is that of the option."""

    def parse(text: str) -> tuple[Any, ...]:
        with suppress(ValueError):
            found = tuple(kind(part.strip()) for part in text.split(","))
            if len(found) == (count or len(found)) and not any(map(isnan, found)):
                return found
        raise typer.BadParameter(f"{text!r}: write {form}")

    return parse


def interval(text: str) -> tuple[float, ...]:
    """Return the two numbers of LOW,HIGH."""
    low, high = numbers("LOW,HIGH", 2)(text)
    if not -inf < low < high < inf:
        raise typer.BadParameter(f"{text!r}: write LOW,HIGH, the lower number first, such as -1,3")
    return low, high


def name_and(parser: Callable[[str], Any]) -> Callable[[str], tuple[str, Any]]:
    """Return the parser of NAME=VALUE, with one for the value."""

    def parse(text: str) -> tuple[str, Any]:
        name, _, value = text.partition("=")
        return name.strip(), parser(value)

    return parse


def check_figure(path: Path | None) -> Path | None:
    """Return the name of a file of a figure; one without a suffix, such as "-", is a PNG."""
    if path is not None and path.suffix.lower() not in ("", ".png", ".svg", ".pdf"):
        raise typer.BadParameter(f"{str(path)!r}: give a name that ends in .png, .svg or .pdf")
    return path


# groups of options
CONTROLLER = "Controller"


SAMPLING = "Sampling"


# in a command the tables of that file, read and parsed once
ArmName = Annotated[
    Any,
    typer.Argument(
        metavar="ARM",
        help="preset or TOML file",
        parser=str,
        callback=read_arm,
        autocompletion=preset_names,
        show_default=False,
    ),
]


TheoryName = Annotated[
    Theory | None, typer.Option("--theory", help="beam theory; by default that of the arm's file")
]


Png = Annotated[
    Path | None,
    typer.Option(
        "--figure",
        "--png",
        metavar="FILE",
        callback=check_figure,
        help="draw the picture into this file: .png, or .pdf or .svg at the width of a paper's column",
    ),
]


# to be written
File = Annotated[Path | None, typer.Option(metavar="FILE")]


InputName = Annotated[
    str | None,
    typer.Option(
        "--input", help="hub_torque, motor_voltage, motor_current, hub_angle, force@X or moment_pair@X1,X2"
    ),
]


ModeCount = Annotated[int, typer.Option("--modes", min=1, max=30, help="flexible modes")]


LawFile = Annotated[
    Path | None,
    typer.Option(
        "--law",
        metavar="FILE",
        exists=True,
        help="TOML file with a [law]; by default that of the arm's file",
        rich_help_panel=CONTROLLER,
    ),
]


LawFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--law",
        metavar="FILE",
        exists=True,
        help="TOML file with a [law]; may be repeated",
        rich_help_panel=CONTROLLER,
    ),
]


AngleGain = Annotated[
    float, typer.Option(f"--{ANGLE_GAIN}", help="hub angle gain", rich_help_panel=CONTROLLER)
]


def gains_of_options(
    *,
    K1: Annotated[
        float | None,
        typer.Option(
            "--K1",
            help="hub rate gain [N m s/rad, V s/rad or A s/rad]; by default 0.00642 J w1 (0.3 on the paper's arm)",
            rich_help_panel=CONTROLLER,
        ),
    ] = None,
    K2: Annotated[
        float | None,
        typer.Option(
            "--K2",
            help="root moment gain, u = ... - K2 E I phi'(0); by default 0.3, 0 without hub inertia",
            rich_help_panel=CONTROLLER,
        ),
    ] = None,
    Kp: Annotated[
        float | None,
        typer.Option("--Kp", help="hub angle gain [N m/rad]; by default 0", rich_help_panel=CONTROLLER),
    ] = None,
) -> dict[str, float]:
    """Return the gains that are given, by name."""
    return without_none({"K1": K1, "K2": K2, "Kp": Kp})


def without_none(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are not None, by name."""
    return {name: value for name, value in values.items() if value is not None}


# ------------------------------------------------------------ the records that they name


def load_arm(file: ArmFile, theory: Theory | None = None, driven: str | None = None) -> Arm:
    """Return the arm of a file, under that theory.

    Values that look like a wrong unit, and a motor without an input (`arm_under_chain` or the file's), are named on
    standard error.
    """
    arm = tfarm.load(file)
    if "motor" in file.tables and "input" not in file.tables and driven is None:
        print_line(
            f"warning: {file.name}: input: not given with a [motor], {arm.input} is assumed. "
            "Set input to hub_torque, motor_voltage or motor_current at the top of the file."
        )
    if theory is not None:
        arm = arm.under(theory)
    if texts := implausible(arm):
        print_line(f"warning: {arm.name}: {'; '.join(texts)}")
    return arm


def law_of_options(
    file: ArmFile, arm: Arm, gains: Mapping[str, float], other: Path | ArmFile | None = None
) -> tuple[AnyLaw, dict[str, Any]]:
    """Return the law of another file, of the gains given, or of the arm's own [law], and JSON's part of default gains.

    `default_gains` names those that are not given and have a default, `default_gains_in_words` is their values.
    """
    from tfarm.arm.law_tables import load_law
    from tfarm.spectrum.gains import default_words

    if other is not None:
        file = load_tables(other)
        refuse(
            gains,
            f"the law is that of {file.name}; leave this out",
        )
        is_law_alone = "requirements" in file.tables and "link" not in file.tables
        remedy = f"of {file.name} are read by no command: write them into the arm's file, or after design --require"
        require(not is_law_alone, "requirements", file.tables.get("requirements"), remedy)
    own = None if gains else load_law(file)
    if own is not None:
        return own, {}
    require(other is None, "--law", file.name, "has no table [law]")
    missing = [gain for gain in PLANE if gain not in gains]
    words = default_words(arm, missing) if missing else None
    return replace(tfarm.default_gains(arm), **gains), {
        "default_gains": missing,
        "default_gains_in_words": words,
    }


def load_loop(
    file: ArmFile, *, law: LawFile = None, theory: TheoryName = None, gains: Any = gains_of_options
) -> tuple[Any, dict[str, Any]]:
    """Return the `tfarm.Case` of a command, through the usual chain, and JSON's part of default gains."""
    arm = load_arm(file, theory)
    controller, defaults = law_of_options(file, arm, gains(), law)
    return tfarm.Case(arm, controller), defaults


def load_driven_loop(file: ArmFile, *, loop: Any = load_loop) -> tuple[Any, dict[str, Any]]:
    """Return the same of a command without sampling, through the chain of the file and with its analog damping."""
    from tfarm.dsp.plant import arm_under_chain

    case, defaults = loop(file)
    arm, chain = arm_under_chain(case.arm, chain_of_options(file))
    return case.on(arm).through(chain), defaults


def chain_of_options(
    file: str | ArmFile,
    *,
    period: Annotated[
        float | None,
        typer.Option(
            "--period", help="sampling period [s]; by default the file's, or 0.01", rich_help_panel=SAMPLING
        ),
    ] = None,
    delay_samples: Annotated[
        float | None,
        typer.Option(
            "--delay-samples", help="computational delay in samples, any fraction", rich_help_panel=SAMPLING
        ),
    ] = None,
    dsp: Annotated[
        str | None,
        typer.Option(
            "--dsp",
            metavar="FILE",
            rich_help_panel=SAMPLING,
            help="TOML file with [sampling], [converters], [actuator], [slew], [reference]; by default that of the arm",
        ),
    ] = None,
) -> "Chain":
    """Return the sampled chain of a file, or of the arm's, with the period and the delay that are given instead."""
    from tfarm.arm.chain import load_chain

    chain = load_chain(file if dsp is None else load_tables(dsp, "--dsp"))
    sampling = replace(chain.sampling, **without_none({"period": period, "delay_samples": delay_samples}))
    return replace(chain, sampling=sampling, period_from=chain.period_from if period is None else "--period")


def outputs_on(
    names: Sequence[str],
    *,
    x: Annotated[float | None, typer.Option("--x", help="place on the arm [m], for outputs along it")] = None,
    side: Annotated[
        str | None,
        typer.Option("--side", help="outer (default) or inner side of a joint, for outputs along the arm"),
    ] = None,
) -> tuple[list[Any], float | None]:
    """Return the outputs of these names, on one side of a joint where that is given, and the place of those along."""
    from tfarm.exact.outputs import on_side

    return [name if side is None else on_side(name, cast("Any", side)) for name in names], x


SignalTexts = Annotated[
    list[str] | None,
    typer.Option(
        "--signal",
        metavar="NAME=COLUMN",
        help="column of a signal, with a unit, a scale or a standard deviation: hub_angle=enc[deg], "
        "hub_angle=enc*0.00153, hub_angle=enc~1e-4, t=time[ms]; may be repeated, and others are not read then",
    ),
]


def record_of_options(
    path: Path,
    signals: "Sequence[RecordSignal]",
    *,
    decimate: Annotated[
        int, typer.Option("--decimate", min=1, help="keep one sample of this number, filtered first")
    ] = 1,
) -> "Recording":
    """Return the record of a file, of these signals, or of all where there are none; decimated through a filter."""
    from tfarm.fitting.recording import decimated, read_recording

    remedy = "a standard deviation is for runs; leave it out"
    for each in signals:
        require(each.sigma is None, each.key, f"~{each.sigma}", remedy)
    found = decimated(read_recording(path, signals), decimate)
    if found.note:
        print_line(found.note)
    return found


def runs_of_options(
    arm: Arm,
    *,
    run: Annotated[
        list[str] | None,
        typer.Option(
            "--run",
            metavar="FILE",
            help="record of a rig in motion; FILE=LAW.toml under the controller that was running; may be repeated",
        ),
    ] = None,
    signal: SignalTexts = None,
    decimate: Annotated[
        int,
        typer.Option(
            "--decimate", min=1, help="keep one sample of this number, over which the input is constant"
        ),
    ] = 1,
) -> "list[RigRun]":
    """Return the runs of an arm that --run names; none where it is not given."""
    from tfarm.fitting.run_files import runs_of

    if not run:
        refuse(
            {"signal": signal, "decimate": decimate if decimate > 1 else None},
            "is of a record: give --run too",
        )
    return runs_of(run or [], arm, signal or [], decimate)


def together_of_options(
    read: Callable[..., Any],
    theory: Theory | None,
    *,
    others: Annotated[
        list[str] | None,
        typer.Option(
            "--with", metavar="ARM=FILE", help="another arm of the fit and its run, FILE or FILE=LAW.toml"
        ),
    ] = None,
    shared: Annotated[
        str, typer.Option("--shared", metavar="KEY,KEY", help="free numbers that all arms have in common")
    ] = "",
) -> "tuple[list[Arm], list[list[RigRun]], list[str]]":
    """Return the other arms of a fit, their runs as `read` reads one, and the keys of shared numbers."""
    found: dict[str, tuple[Arm, list[RigRun]]] = {}
    for text in others or []:
        name, _, file = text.partition("=")
        require(
            name and file, "--with", text, "write ARM=FILE, or ARM=FILE=LAW.toml of a record in closed loop"
        )
        if name not in found:
            found[name] = load_arm(load_tables(name), theory), []
        arm, runs = found[name]
        runs += read(arm, run=[file])
    require(found or not shared, "--shared", shared, "is of several arms: give --with too")
    keys = [key.strip() for key in shared.split(",") if key.strip()]
    return [arm for arm, _ in found.values()], [runs for _, runs in found.values()], keys


def weight_entry(text: str) -> tuple[Any, ...]:
    """Return numerator and denominator of NUM/DEN, coefficients in descending powers of s; of NUM over 1."""
    num, _, den = text.partition("/")
    coefficients = numbers("coefficients NUM or NUM/DEN in descending powers of s, such as 0.5,2/1,0.02")
    return coefficients(num), coefficients(den or "1")


WeightEntries = Annotated[
    list[Any] | None,
    typer.Option(
        parser=name_and(weight_entry),
        metavar="NAME=NUM/DEN",
        help="weight on S, KS or T, coefficients in descending powers of s; may be repeated, and replaces those of a "
        "file",
    ),
]


def refuse(others: Mapping[str, Any], remedy: str) -> None:
    """Raise ParameterError for an option, by its name as a parameter, that another one excludes."""
    for name, value in others.items():
        shown = str(value) if isinstance(value, Path) else value
        require(value is None or value is False, f"--{name.replace('_', '-')}", shown, remedy)
