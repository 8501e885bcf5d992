"""The application and what its verbs share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from inspect import Parameter, signature
from typing import IO, TYPE_CHECKING, Annotated, Any, cast

import typer

from tfarm.errors import ParameterError, one_line

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.exact.outputs import Output


class Asked(str):
    """A preset's name or a file as it is typed, and the theory that is asked for instead of the arm's own."""

    theory: str | None = None


class Verbs(typer.Typer):
    """The application, whose commands on an ARM all take --theory."""

    def command(self, *arguments: Any, **options: Any) -> Callable[[Any], Any]:
        """The decorator that makes a command of a function."""
        register = super().command(*arguments, **options)
        return lambda function: register(of_an_arm(function))


def of_an_arm(command: Callable[..., None]) -> Callable[..., None]:
    """The command with an option --theory before its last one, if it takes an ARM: what it gets is `Asked`."""
    whole_signature = signature(command, eval_str=True)
    *rest, last = whole_signature.parameters.values()
    if "arm" not in whole_signature.parameters:
        return command

    @wraps(command)
    def with_theory(arm: str, theory: str | None, **arguments: Any) -> None:
        asked = Asked(arm)
        asked.theory = theory
        command(arm=asked, **arguments)

    shown = [*rest, Parameter("theory", Parameter.KEYWORD_ONLY, default=None, annotation=TheoryName), last]
    keywords = [each.replace(kind=Parameter.KEYWORD_ONLY) for each in shown]
    with_theory.__signature__ = whole_signature.replace(parameters=keywords)  # type: ignore[attr-defined]
    return with_theory


app = Verbs(
    name="tfarm",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@cache  # some 35 ms, which a process with several commands need not spend on each
def whole_command() -> Any:
    """The command of all verbs as Click has it; asked for once all rooms of verbs are loaded."""
    return typer.main.get_command(app)


def _say_version(asked: bool) -> None:
    if asked:
        from tfarm import __version__

        print(f"tfarm {__version__}")
        raise typer.Exit


@app.callback()
def options_of_all(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_say_version, help="print the version, and exit")
    ] = False,
) -> None:
    """Exact frequency-domain analysis of a rotating flexible Timoshenko arm."""


ArmName = Annotated[str, typer.Argument(metavar="ARM", help="a preset's name or a TOML file", show_default=False)]
TheoryName = Annotated[
    str | None,
    typer.Option("--theory", help="timoshenko, shear, rayleigh or euler-bernoulli; the arm's own if not said"),
]
INPUT_REMEDY = "Set input to hub_torque, motor_voltage or motor_current at the top of the file."
SideName = Annotated[
    str | None, typer.Option("--side", help="outer (if not said) or inner side of a joint, for outputs along the arm")
]
Place = Annotated[float | None, typer.Option("--x", help="place on the arm [m], for outputs along it")]
INPUT_WORDS = "hub_torque, motor_voltage, motor_current, hub_angle, force@X or moment_pair@X1,X2"
InputName = Annotated[str | None, typer.Option("--input", help=INPUT_WORDS)]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on standard output")]
MethodName = Annotated[str, typer.Option("--method", help="closed-form, balls, or appendix: the paper's determinant")]
Compare = Annotated[bool, typer.Option("--compare", help="all three methods beside each other, and where they part")]
DigitCount = Annotated[str | None, typer.Option("--digits", metavar="D", help="right digits, proven; strings above 15")]


def load_arm(name: str, theory: str | None = None, driven: str | None = None) -> Arm:
    """The preset or file of that name, under that theory, or what is `Asked`, or its own.

    Values that look like a slip of units, and a motor without an input (`driven` or the file's), are named on standard
    error.
    """
    from tfarm.arm import implausible
    from tfarm.arm.reading import arm_in, load_tables

    say_when_compiling()
    table, file = load_tables(name)
    arm = arm_in(table, file)
    if "motor" in table and "input" not in table and driven is None:
        tell(f"warning: {file}: input: not given with a [motor], {arm.input} is assumed. {INPUT_REMEDY}")
    if (other := theory or getattr(name, "theory", None)) is not None:
        arm = arm.under(cast("Any", other))
    if texts := implausible(arm):
        tell(f"warning: {arm.name}: {'; '.join(texts)}")
    return arm


def read_on(names: list[str], side: str | None) -> list[str | Output]:
    """The outputs of these names, or those of them on one side of a joint of two segments."""
    from tfarm.exact.outputs import on_side

    return [name if side is None else on_side(name, cast("Any", side)) for name in names]


def give(answer: dict[str, Any], json: bool, show: Callable[[dict[str, Any]], None]) -> None:
    """The answer as one JSON object, or as `show` prints it, then what is not known and which gains are defaults."""
    if json:
        from tfarm.tables.files import to_json

        print(to_json(answer))
        return
    show(answer)
    if answer.get("windows_note"):
        print(answer["windows_note"])
    if answer.get("default_gains"):
        print(f"by default {answer['default_gains_in_words']}")


def right_digits(text: str | None) -> int | None:
    """The --digits option as a number."""
    return None if text is None else whole_number("--digits", text, 1, 1000)


def whole_number(key: str, text: str, least: int, most: int) -> int:
    """A whole number in a range; it may be typed as 1e3."""
    remedy = f"a whole number from {least} to {most}"
    try:
        number = plain_number(text)
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not (least <= number <= most and number == int(number)):
        raise ParameterError(key=key, value=text, remedy=remedy)
    return int(number)


def plain_number(text: str) -> float:
    """A number as people write it; ValueError for Python's own 5_0 and for digits that are not ASCII."""
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def tell(message: str) -> None:
    """One line to the person at the terminal, on standard error; nothing where nobody can hear it."""
    try:
        print(f"tfarm: {one_line(message, 1000)}", file=sys.stderr)
    except OSError:
        discard(sys.stderr)


def discard(stream: IO[str]) -> None:
    """Send what the stream still holds nowhere: Python would complain about it on leaving."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


@cache
def say_when_compiling() -> None:
    """From now on the first compilation of a numerical kernel is announced, once, on standard error.

    numba keeps what it has compiled, so this is the first use after an installation or an update.
    """
    from numba.core.event import Event, Listener, register

    class Announcement(Listener):  # type: ignore[misc]  # numba comes without types
        said = False

        def on_start(self, event: Event) -> None:
            if not self.said:
                self.said = True
                tell("compiling once: the first use after an installation takes some seconds longer")

        def on_end(self, event: Event) -> None:
            pass

    register("numba:compile", Announcement())
