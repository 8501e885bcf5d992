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
from functools import cache, partial, wraps
from inspect import Parameter, Signature, getdoc, isfunction, signature
from pathlib import Path
from threading import Event, Thread
from typing import IO, Annotated, Any, cast, get_args, get_origin

import typer

import tfarm
from tfarm.arm import ANGLE_GAIN, LISTED, MOMENT_GAIN, RATE_GAIN, AnyLaw, Arm, Theory, implausible
from tfarm.errors import one_line, require
from tfarm.files import is_standard_output, write_file
from tfarm.schema import as_csv, curve_table, to_dict, to_json

app = typer.Typer(name="tfarm", rich_markup_mode="rich", pretty_exceptions_enable=False)
GROUPS = ("Arm", "Loop", "Sampled loop", "Design", "Measurement", "Report")  # of commands in the help, in its order
PROGRESS_AFTER, PROGRESS_EVERY = 2.0, 4.0  # seconds to the first line of progress, and from one to the next


@cache  # some 35 ms, which a process with several commands need not spend on each
def whole_command() -> Any:
    """Return the command with all its subcommands; called once every module of commands is loaded.

    An epilog is the example of its command, and a [unit] in a help text no markup of rich.
    """
    command: Any = typer.main.get_command(app)
    command.commands = dict(sorted(command.commands.items(), key=lambda each: GROUPS.index(each[1].rich_help_panel)))
    for each in command.commands.values():
        each.epilog = f"Example: tfarm {each.epilog}"
        for text in (each, *each.params):
            text.help = (text.help or "").replace("[", r"\[")
    return command


def print_version(wanted: bool) -> None:
    """Print the version and exit, where --version is given."""
    if wanted:
        print(f"tfarm {tfarm.__version__}")
        raise typer.Exit


@app.callback()
def tfarm_options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=print_version, help="print the version, and exit")
    ] = False,
) -> None:
    """Exact frequency-domain analysis of a rotating flexible Timoshenko arm."""


# ---------------------------------------------------------------------------------------------------------- options


def preset_names(incomplete: str) -> list[str]:
    """Return the presets that begin so, for the completion of a shell."""
    return [name for name in tfarm.presets() if name.startswith(incomplete)]


def numbers(form: str, count: int = 0, kind: Callable[[str], Any] = float) -> Callable[[str], tuple[Any, ...]]:
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


CONTROLLER, SAMPLING = "Controller", "Sampling"  # groups of options
ArmName = Annotated[
    str, typer.Argument(metavar="ARM", help="preset or TOML file", autocompletion=preset_names, show_default=False)
]
TheoryName = Annotated[Theory | None, typer.Option("--theory", help="beam theory; by default that of the arm's file")]
Json = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")]
Csv = Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="write the table to this file")]
Png = Annotated[
    Path | None,
    typer.Option("--figure", "--png", metavar="FILE", callback=check_figure,
                 help="draw the picture into this file: .png, or .pdf or .svg at the width of a paper's column"),
]  # fmt: skip
File = Annotated[Path | None, typer.Option(metavar="FILE")]  # to be written
Place = Annotated[float | None, typer.Option("--x", help="place on the arm [m], for outputs along it")]
SideName = Annotated[
    str | None, typer.Option("--side", help="outer (default) or inner side of a joint, for outputs along the arm")
]
InputName = Annotated[
    str | None,
    typer.Option("--input", help="hub_torque, motor_voltage, motor_current, hub_angle, force@X or moment_pair@X1,X2"),
]
ModeCount = Annotated[int, typer.Option("--modes", min=1, max=30, help="flexible modes")]
LawFile = Annotated[
    Path | None,
    typer.Option("--law", metavar="FILE", exists=True, help="TOML file with a [law]; by default that of the arm's file",
                 rich_help_panel=CONTROLLER),
]  # fmt: skip
LawFiles = Annotated[
    list[Path] | None,
    typer.Option("--law", metavar="FILE", exists=True, help="TOML file with a [law]; may be repeated",
                 rich_help_panel=CONTROLLER),
]  # fmt: skip
Period = Annotated[
    float | None,
    typer.Option("--period", help="sampling period [s]; by default the file's, or 0.01", rich_help_panel=SAMPLING),
]
Delay = Annotated[
    float | None,
    typer.Option("--delay-samples", help="computational delay in samples, any fraction", rich_help_panel=SAMPLING),
]
DspFile = Annotated[
    str | None,
    typer.Option("--dsp", metavar="FILE", rich_help_panel=SAMPLING,
                 help="TOML file with [sampling], [converters], [actuator], [slew]; by default that of the arm"),
]  # fmt: skip
Gains = dict[str, float | None]  # by name; None where not given
DEFAULT_GAINS = {
    RATE_GAIN: "hub rate gain [N m s/rad, V s/rad or A s/rad]; by default 0.00642 J w1 (0.3 on the paper's arm)",
    MOMENT_GAIN: f"root moment gain, u = ... - {MOMENT_GAIN} E I phi'(0); by default 0.3, 0 without hub inertia",
}


def gain_option(name: str, text: str, kind: Any = float | None) -> Any:
    """Return the type of the option of a gain."""
    return Annotated[kind, typer.Option(f"--{name}", help=text, rich_help_panel=CONTROLLER)]


AngleGain = gain_option(ANGLE_GAIN, "hub angle gain", float)
GAIN_OPTIONS = [
    Parameter(gain.name, Parameter.KEYWORD_ONLY, default=None, annotation=gain_option(
        gain.name, DEFAULT_GAINS.get(gain.name, f"{gain.output.replace('_', ' ')} gain [{gain.unit}]; by default 0")
    ))
    for gain in LISTED
]  # fmt: skip


def add_command(group: str, **how: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return the decorator that adds a command to a group of the help; `how` are its name and its example.

    Its parameters are its arguments and options.  "name: text" below "Options:" in its docstring is the help of one.  A
    parameter of type `Gains` has an option for each gain.  One whose default is a function has an option for each of
    its keywords, and is that function with their values.
    """

    def add(command: Callable[..., None]) -> Callable[..., None]:
        words, helps = help_of(command)
        own = signature(command).parameters
        groups = {name: parts for name, each in own.items() if (parts := options_of(each))}

        @wraps(command)
        def called(**options: Any) -> None:
            for name, parts in groups.items():
                values, default = {each.name: options.pop(each.name) for each in parts}, own[name].default
                options[name] = partial(default, **values) if isfunction(default) else values
            command(**options)

        alone = [_with_help(each, helps.get(name, "")) for name, each in own.items() if name not in groups]
        called.__signature__ = Signature([*alone, *(each for parts in groups.values() for each in parts)])  # type: ignore[attr-defined]
        called.__doc__ = words
        app.command(rich_help_panel=group, **how)(called)
        return command

    return add


def help_of(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Return the docstring of a function without its options, and the help of each option."""
    words, _, lines = (getdoc(function) or "").partition("\n\nOptions:\n")
    return words, dict(line.split(": ", 1) for line in re.split(r"\n(?=\w)", lines) if lines)


def options_of(parameter: Parameter) -> list[Parameter]:
    """Return the options that a parameter collects: those of gains, or the keywords of the function that it is."""
    if parameter.annotation == Gains:
        return GAIN_OPTIONS
    if not isfunction(parameter.default):
        return []
    known, (_, helps) = signature(parameter.default).parameters.values(), help_of(parameter.default)
    return [_with_help(each, helps.get(each.name, "")) for each in known if each.kind is Parameter.KEYWORD_ONLY]


def _with_help(option: Parameter, text: str) -> Parameter:
    """Return the parameter of a command with that help; a plain one becomes the option --NAME."""
    kind, *infos = get_args(option.annotation) if get_origin(option.annotation) is Annotated else [option.annotation]
    info = copy(infos[0]) if infos else typer.Option(f"--{option.name.replace('_', '-')}")
    info.help = " ".join(text.split()) or info.help
    return option.replace(kind=Parameter.KEYWORD_ONLY, annotation=Annotated[kind, info])


# ------------------------------------------------------------------------------------------------------------ inputs


def load_arm(name: str, theory: Theory | None = None, driven: str | None = None) -> Arm:
    """Return the arm of a preset or file, under that theory.

    Values that look like a wrong unit, and a motor without an input (`driven` or the file's), are named on standard
    error.
    """
    from tfarm.arm.reading import arm_in, load_tables

    table, file = load_tables(name)
    arm = arm_in(table, file)
    if "motor" in table and "input" not in table and driven is None:
        print_line(
            f"warning: {file}: input: not given with a [motor], {arm.input} is assumed. "
            "Set input to hub_torque, motor_voltage or motor_current at the top of the file."
        )
    if theory is not None:
        arm = arm.under(theory)
    if texts := implausible(arm):
        print_line(f"warning: {arm.name}: {'; '.join(texts)}")
    return arm


def load_law(arm: Arm, name: str, gains: Gains, file: Path | None = None) -> tuple[AnyLaw, dict[str, Any]]:
    """Return the law of a file, of the gains given, or of the arm's own [law], and what JSON has of default gains.

    `default_gains` names those that are not given and have a default, `default_gains_in_words` is their values.
    """
    from tfarm.arm.law_tables import load_law as read
    from tfarm.spectrum.table import default_words

    typed = {gain: value for gain, value in gains.items() if value is not None}
    if file is not None:
        refuse({f"--{gain}": value for gain, value in typed.items()}, f"the law is that of {file}; leave this out")
    own = None if typed else read(name if file is None else file)
    if own is not None:
        return own, {}
    require(file is None, "--law", str(file), "has no table [law]")
    missing = [gain for gain in DEFAULT_GAINS if gain not in typed]
    words = default_words(arm, missing) if missing else None
    return replace(tfarm.default_gains(arm), **typed), {"default_gains": missing, "default_gains_in_words": words}


def load_loop(name: str, theory: Theory | None, gains: Gains, law: Path | None) -> tuple[Arm, AnyLaw, dict[str, Any]]:
    """Return arm and law of a command, and what JSON has of default gains."""
    arm = load_arm(name, theory)
    return arm, *load_law(arm, name, gains, law)


def load_driven_loop(
    name: str, theory: Theory | None, gains: Gains, law: Path | None
) -> tuple[Arm, AnyLaw, dict[str, Any]]:
    """Return the same of a command without sampling, the arm with the analog damping that its file states."""
    from tfarm.dsp.plant import driven

    arm, controller, defaults = load_loop(name, theory, gains, law)
    return driven(arm, load_chain(name))[0], controller, defaults


def load_chain(arm: str, *, period: Period = None, delay_samples: Delay = None, dsp: DspFile = None) -> Any:
    """Return the sampled chain of a file, or of the arm's, with the period and the delay that are given instead."""
    from tfarm.arm.chain import load_chain as read

    chain, typed = read(dsp or arm), {"period": period, "delay_samples": delay_samples}
    sampling = replace(chain.sampling, **{key: value for key, value in typed.items() if value is not None})
    return replace(chain, sampling=sampling, period_from=chain.period_from if period is None else "--period")


def outputs_on(names: Sequence[str], side: str | None) -> list[Any]:
    """Return the outputs of these names, on one side of a joint where that is given."""
    from tfarm.exact.outputs import on_side

    return [name if side is None else on_side(name, cast("Any", side)) for name in names]


def refuse(others: Mapping[str, Any], remedy: str) -> None:
    """Raise ParameterError for an option that another one excludes."""
    for key, value in others.items():
        require(value is None or value is False, key, value, remedy)


# ----------------------------------------------------------------------------------------------------------- outputs


def emit(
    record: Any,
    json: bool,
    defaults: Mapping[str, Any] | None = None,
    *,
    csv: Path | None = None,
    png: Path | None = None,
    also: Sequence[Path | None] = (),
    rows: bool = False,
    summary: Any = None,
    picture: str | None = None,
) -> None:
    """Write the curves or rows of a record to CSV and its `picture` to a file, then print it as JSON or as text.

    `defaults` is what JSON has of default gains; `also` are files that are written already.  The text ends with the
    `rows` of the CSV file where they are wanted and not written, and begins with the result card `summary`, as the
    "summary" of JSON.  Nothing is printed where standard output is one of the files.
    """
    if csv is not None:
        write_file(csv, as_csv(curve_table(record), units=True).encode(), key="--csv")
    if png is not None:
        from tfarm import plots  # every picture is registered once they are loaded

        plots.style.save_picture(
            getattr(plots, picture).figure if picture else plots.style.FIGURES[type(record)], record, png
        )
    written = [path for path in (*also, csv, png) if path is not None]
    if any(map(is_standard_output, written)):
        return
    for path in written:
        print(f"written: {path}", file=sys.stderr)
    if json:
        print(to_json({**({"summary": to_dict(summary)} if summary else {}), **to_dict(record), **(defaults or {})}))
        return
    from tfarm.schema.terminal import show, show_table, show_text

    if summary is not None:
        show_table(summary.table)
        show_text("\n".join(summary.notes))
        print()
    words = f"by default {defaults['default_gains_in_words']}" if defaults and defaults["default_gains"] else ""
    show(record, curve_table(record) if rows and csv is None else None, words)


def emit_loop(
    picture: str, arm: str, theory: Theory | None, gains: Gains, law: Path | None, chain: Any, json: bool, **files: Any
) -> None:
    """Emit the loop function of a command with that picture of it; of the sampled loop where sampling is given."""
    is_sampled = any(value is not None for value in chain.keywords.values())
    subject, controller, defaults = (load_loop if is_sampled else load_driven_loop)(arm, theory, gains, law)
    found = tfarm.loop_function(subject, controller, chain(arm) if is_sampled else None)
    emit(found, json, defaults, picture=picture, **files)


_state = ["running"]  # of the command, for the lines of progress


def advance(done: int, total: int, text: str) -> None:
    """Set the next line of progress: the task that runs, and how many of all are done."""
    _state[0] = f"{done} of {total} done, running: {text}" if total else text


@contextmanager
def progress() -> Iterator[Callable[[int, int, str], None]]:
    """Print a line on standard error every few seconds while a command runs."""
    _state[0], over, began = "running", Event(), time.monotonic()

    def speak() -> None:
        while not over.wait(PROGRESS_EVERY if time.monotonic() - began > PROGRESS_AFTER else PROGRESS_AFTER):
            if _state[0]:  # none between a question and its answer
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
