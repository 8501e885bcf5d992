"""The application and what its verbs share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import Event, Thread
from typing import IO, TYPE_CHECKING, Annotated, Any, cast

import typer

from tfarm.errors import ParameterError, one_line
from tfarm.files import is_standard_output
from tfarm.tables.files import to_json, write_csv

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.exact.outputs import Output


app = typer.Typer(
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
PROGRESS_EVERY = 4.0  # seconds from one line of progress to the next: few lines in a log, and no long silence
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
    """The preset or file of that name, under that theory or its own.

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
    if theory is not None:
        arm = arm.under(cast("Any", theory))
    if texts := implausible(arm):
        tell(f"warning: {arm.name}: {'; '.join(texts)}")
    return arm


def read_on(names: list[str], side: str | None) -> list[str | Output]:
    """The outputs of these names, or those of them on one side of a joint of two segments."""
    from tfarm.exact.outputs import on_side

    return [name if side is None else on_side(name, cast("Any", side)) for name in names]


def emit(
    found: Any,
    json: bool,
    said: Mapping[str, Any] | None = None,
    *,
    csv: Path | None = None,
    png: Path | None = None,
    also: Sequence[Path | None] = (),
) -> None:
    """A record to the outputs asked for: its curves or rows as CSV, its picture, then JSON or text.

    `said` is what else is known of the command, such as its default gains; `also` are files that are written already.
    Nothing is printed where standard output holds one of them.
    """
    from tfarm.schema import curve_table, to_dict

    if csv is not None:
        write_csv(curve_table(found), csv)
    if png is not None:
        import tfarm.plots  # noqa: F401  every picture is known once they are loaded
        from tfarm.plots.style import FIGURES, save_png

        save_png(FIGURES[type(found)](found), png)
    if not (say_written(*also, csv, png) or json):
        return
    if json:
        print(to_json({**to_dict(found), **(said or {})}))
        return
    print_record(found)
    if said and said.get("default_gains"):
        print(f"by default {said['default_gains_in_words']}")


def print_record(found: Any) -> None:
    """The record as text: single values under their labels, then its tables."""
    from tfarm.schema import sections
    from tfarm.tables.terminal import show, show_pairs

    for number, each in enumerate(sections(found)):
        if number and (each.pairs or each.table or each.drawing):
            print(f"\n{each.title}" if each.title else "")
        show_pairs(each.pairs)
        if each.table is not None:
            show(each.table)
        if each.drawing:
            print(each.drawing)


def say_written(*paths: Path | None) -> bool:
    """Say on standard error which files were written; False where one is standard output, which holds the table."""
    given = [path for path in paths if path is not None]
    if any(map(is_standard_output, given)):
        return False
    for path in given:
        print(f"written: {path}", file=sys.stderr)
    return True


@contextmanager
def progress() -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on a terminal; in a pipe a line every few seconds, of what runs."""
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("", total=None)
            yield lambda done, total, text: bar.update(task, completed=done, total=total, description=text)
        return
    state, over = ["starting"], Event()

    def advance(done: int, total: int, text: str) -> None:
        state[0] = f"{done} of {total} done" + f", running: {text}" * bool(text)

    def speak() -> None:
        while not over.wait(PROGRESS_EVERY):
            tell(state[0])

    speaker = Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield advance
    finally:
        over.set()
        speaker.join()


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
    from numba.core.event import Listener, register

    class Announcement(Listener):  # type: ignore[misc]  # numba comes without types
        said = False

        def on_start(self, event: Event) -> None:
            if not self.said:
                self.said = True
                tell("compiling once: the first use after an installation takes some seconds longer")

        def on_end(self, event: Event) -> None:
            pass

    register("numba:compile", Announcement())
