"""The application: options that commands share, the arm and the law that they name, and the output of a record."""

import os
import re
import sys
import time
from cmath import inf, isnan
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from dataclasses import replace
from functools import partial, wraps
from inspect import Parameter, Signature, getdoc, isfunction, signature
from pathlib import Path
from threading import Event, Thread
from typing import IO, TYPE_CHECKING, Annotated, Any, cast, get_args, get_origin

import typer

import tfarm
from tfarm.arm import ANGLE_GAIN, PLANE, AnyLaw, Arm, Theory, implausible
from tfarm.arm.reading import ArmFile, load_tables
from tfarm.errors import one_line, require
from tfarm.files import is_standard_output, write_file
from tfarm.schema import Table, as_csv, curve_table, to_dict, to_json

if TYPE_CHECKING:
    from tfarm.arm.chain import Chain

app = typer.Typer(name="tfarm", rich_markup_mode="rich", pretty_exceptions_enable=False)
# seconds to the first line of progress
PROGRESS_AFTER = 2.0


def print_version(wanted: bool) -> None:
    """Print the version and exit, where --version is given."""
    if wanted:
        print(f"tfarm {tfarm.__version__}")
        raise typer.Exit


@app.callback(options_metavar="[--version] [--help]")
def tfarm_options(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=print_version, help="print the version, and exit"),
    ] = False,
) -> None:
    """Exact frequency-domain analysis of a rotating flexible Timoshenko arm."""


# ---------------------------------------------------------------------------------------------------------- options


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


def named(parser: Callable[[str], Any]) -> Callable[[str], tuple[str, Any]]:
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
ArmName = Annotated[  # in a command the tables of that file, read and parsed once
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


def given_gains(
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


def add_command(
    chapter: str | None, group: typer.Typer = app, **how: Any
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return the decorator that adds a command to a chapter of the help; `how` are its name and its example.

    Its keyword-only parameters are its arguments and options.  "name: text" below "Options:" in its docstring is the
    help of one.  A parameter whose default is a function has an option for each keyword-only parameter of that, and is
    the function with their values.
    """

    def add(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def called(**options: Any) -> None:
            command(**keywords_of(command, options))

        called.__signature__ = Signature(options_of(command))  # type: ignore[attr-defined]
        called.__doc__ = help_of(command)[0]
        group.command(rich_help_panel=chapter, **how)(called)
        return command

    return add


def help_of(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Return the docstring of a function without its options, and the help of each option."""
    words, _, lines = (getdoc(function) or "").partition("\n\nOptions:\n")
    # a paragraph is one line: where it is broken, the width of the terminal decides
    paragraphs = [" ".join(each.split()) for each in words.split("\n\n")]
    return "\n\n".join(paragraphs), dict(
        line.split(": ", 1) for line in re.split(r"\n(?=\w)", lines) if lines
    )


def keyword_only(function: Callable[..., Any]) -> Iterator[Parameter]:
    """Yield the keyword-only parameters of a function."""
    return (each for each in signature(function).parameters.values() if each.kind is Parameter.KEYWORD_ONLY)


def options_of(function: Callable[..., Any]) -> list[Parameter]:
    """Return the options of a command, or of a function that has some of them."""
    helps = help_of(function)[1]
    found: list[Parameter] = []
    for each in keyword_only(function):
        if isfunction(each.default):
            found += options_of(each.default)
        else:
            found.append(_with_help(each, helps.get(each.name, "")))
    return found


def keywords_of(function: Callable[..., Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keywords of a command, or of a function that has some of its options, by the values of all."""
    found: dict[str, Any] = {}
    for each in keyword_only(function):
        if isfunction(each.default):
            found[each.name] = partial(each.default, **keywords_of(each.default, options))
        else:
            found[each.name] = options[each.name]
    return found


def _with_help(option: Parameter, text: str) -> Parameter:
    """Return the parameter of a command with that help; a plain one becomes the option --NAME."""
    kind, *infos = (
        get_args(option.annotation) if get_origin(option.annotation) is Annotated else [option.annotation]
    )
    info = copy(infos[0]) if infos else typer.Option(f"--{option.name.replace('_', '-')}")
    info.help = " ".join(text.split()) or info.help
    return option.replace(annotation=Annotated[kind, info])


# ------------------------------------------------------------------------------------------------------------ inputs


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


def load_law(
    file: ArmFile, arm: Arm, gains: Mapping[str, float], other: Path | ArmFile | None = None
) -> tuple[AnyLaw, dict[str, Any]]:
    """Return the law of another file, of the gains given, or of the arm's own [law], and JSON's part of default gains.

    `default_gains` names those that are not given and have a default, `default_gains_in_words` is their values.
    """
    from tfarm.arm.law_tables import load_law as read
    from tfarm.spectrum.gains import default_words

    if other is not None:
        file = load_tables(other)
        refuse(
            {f"--{gain}": value for gain, value in gains.items()},
            f"the law is that of {file.name}; leave this out",
        )
    own = None if gains else read(file)
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
    file: ArmFile, *, law: LawFile = None, theory: TheoryName = None, gains: Any = given_gains
) -> tuple[Any, dict[str, Any]]:
    """Return the `tfarm.Case` of a command, through the usual chain, and JSON's part of default gains."""
    arm = load_arm(file, theory)
    controller, defaults = load_law(file, arm, gains(), law)
    return tfarm.Case(arm, controller), defaults


def load_driven_loop(file: ArmFile, *, loop: Any = load_loop) -> tuple[Any, dict[str, Any]]:
    """Return the same of a command without sampling, through the chain of the file and with its analog damping."""
    from tfarm.dsp.plant import arm_under_chain

    case, defaults = loop(file)
    arm, chain = arm_under_chain(case.arm, load_chain(file))
    return case.on(arm).through(chain), defaults


def load_chain(
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
            help="TOML file with [sampling], [converters], [actuator], [slew]; by default that of the arm",
        ),
    ] = None,
) -> "Chain":
    """Return the sampled chain of a file, or of the arm's, with the period and the delay that are given instead."""
    from tfarm.arm.chain import load_chain as read

    chain = read(dsp or file)
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


def refuse(others: Mapping[str, Any], remedy: str) -> None:
    """Raise ParameterError for an option that another one excludes."""
    for key, value in others.items():
        require(value is None or value is False, key, value, remedy)


# ----------------------------------------------------------------------------------------------------------- outputs


def emit_record(
    record: Any,
    defaults: Mapping[str, Any] | None = None,
    also: Sequence[Path | None] = (),
    rows: Table | None = None,
    summary: Any = None,
    *,
    json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> None:
    """Print a record as JSON or as text.

    `defaults` is what JSON has of default gains; `also` are files that are written already.  The text ends with the
    `rows` of a table, and begins with the result card `summary`, as the "summary" of JSON.  Nothing is printed where
    standard output is one of the files.
    """
    written = [path for path in also if path is not None]
    if any(map(is_standard_output, written)):
        return
    for path in written:
        print(f"written: {path}", file=sys.stderr)
    if json:
        head = {"summary": to_dict(summary)} if summary else {}
        print(to_json({**head, **to_dict(record), **(defaults or {})}))
        return
    from tfarm.schema.terminal import show, show_table, show_text

    if summary is not None:
        show_table(summary.table)
        show_text("\n".join(summary.notes))
        print()
    if defaults and defaults["default_gains"]:
        words = f"by default {defaults['default_gains_in_words']}"
    else:
        words = ""
    show(record, rows, words)


def emit(
    record: Any,
    defaults: Mapping[str, Any] | None = None,
    also: Sequence[Path | None] = (),
    rows: bool = False,
    picture: str | None = None,
    *,
    show: Any = emit_record,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="write the table to this file")
    ] = None,
    png: Png = None,
) -> None:
    """Write the curves or rows of a record to CSV and its `picture` to a file, then print it.

    The `rows` of the CSV file are printed where they are wanted and not written.
    """
    if csv is not None:
        write_file(csv, as_csv(curve_table(record), units=True).encode(), key="--csv")
    if png is not None:
        # every picture is registered once they are loaded
        from tfarm import plots

        draw = getattr(plots, picture).figure if picture else plots.style.FIGURES[type(record)]
        plots.files.save_picture(draw, record, png)
    show(record, defaults, (*also, csv, png), curve_table(record) if rows and csv is None else None)


def emit_loop(picture: str, file: ArmFile, loop: Any, chain: Any, show: Any) -> None:
    """Emit the loop function of a command with that picture of it; of the sampled loop where sampling is given."""
    if given(chain):
        case, defaults = loop(file)
        found = case.through(chain(file)).loop_function()
    else:
        case, defaults = load_driven_loop(file, loop=loop)
        found = tfarm.loop_function(case.arm, case.law)
    show(found, defaults, picture=picture)


def given(options: Any) -> bool:
    """Return whether one of the options of a function is given."""
    return any(value is not None for value in options.keywords.values())


# of the command, for the lines of progress
_state = ["running"]


def advance(done: int, total: int, text: str) -> None:
    """Set the next line of progress: the task that runs, and how many of all are done."""
    _state[0] = f"{done} of {total} done, running: {text}" if total else text


@contextmanager
def progress() -> Iterator[Callable[[int, int, str], None]]:
    """Print a line on standard error every few seconds while a command runs."""
    _state[0], over, began = "running", Event(), time.monotonic()

    def speak() -> None:
        pause = PROGRESS_AFTER
        while not over.wait(pause):
            pause = 4.0
            # none between a question and its answer
            if _state[0]:
                print_line(f"{_state[0]} ({time.monotonic() - began:.0f} s)")

    Thread(target=speak, daemon=True).start()
    try:
        yield advance
    finally:
        over.set()


def print_line(message: str) -> None:
    """Print one line on standard error; a closed one swallows it."""
    try:
        print(f"tfarm: {one_line(message, 1000)}", file=sys.stderr)
    except OSError:
        discard(sys.stderr)


def discard(stream: IO[str]) -> None:
    """Send what a stream still holds nowhere: Python would complain about it on leaving."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
