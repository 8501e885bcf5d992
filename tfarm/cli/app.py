"""The application and what its verbs share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import IO, TYPE_CHECKING, Annotated, Any

import typer

from tfarm.errors import ParameterError, one_line

if TYPE_CHECKING:
    from tfarm.arm import Arm

app = typer.Typer(
    name="tfarm",
    help="Exact frequency-domain analysis of a rotating flexible Timoshenko arm.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

ArmName = Annotated[str, typer.Argument(metavar="ARM", help="a preset's name or a TOML file", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on standard output")]
MethodName = Annotated[str, typer.Option("--method", help="closed-form, balls, or appendix: the paper's determinant")]
Compare = Annotated[bool, typer.Option("--compare", help="all three methods beside each other, and where they part")]
Digits = Annotated[str | None, typer.Option("--digits", metavar="D", help="right digits, proven; strings above 15")]


def load_arm(name: str) -> Arm:
    """The preset or file of that name; values that look like a slip of units are named on standard error."""
    from tfarm.arm import implausible, load

    say_when_compiling()
    arm = load(name)
    if texts := implausible(arm):
        tell(f"warning: {arm.name}: {'; '.join(texts)}")
    return arm


def give(answer: dict[str, Any], json: bool, show: Callable[[dict[str, Any]], None]) -> None:
    """The answer as one JSON object, or as `show` prints it, with a line about the gains that were not given."""
    if json:
        from tfarm.tables.files import to_json

        print(to_json(answer))
        return
    show(answer)
    if answer.get("default_gains"):
        print(f"by default {answer['default_gains_in_words']}")


def right_digits(text: str | None) -> int | None:
    """The --digits option as a number."""
    return None if text is None else whole("--digits", text, 1, 1000)


def whole(key: str, text: str, least: int, most: int) -> int:
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
