"""The application, what its verbs share, and the one place where errors become exit codes."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.exceptions import TyperException

from tfarm.errors import CertificationError, ConvergenceError, ParameterError, TfarmError, one_line

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
Digits = Annotated[str | None, typer.Option("--digits", metavar="D", help="right digits, proven; strings above 15")]


def load_arm(name: str) -> Arm:
    """The preset or file of that name; values that look like a slip of units are named on standard error."""
    from tfarm.arm import implausible, load

    arm = load(name)
    if texts := implausible(arm):
        tell(f"warning: {arm.name}: {'; '.join(texts)}")
    return arm


def right_digits(text: str | None) -> int | None:
    """The --digits option as a number."""
    return None if text is None else whole("--digits", text, 1, 1000)


def whole(key: str, text: str, least: int, most: int) -> int:
    """A whole number in a range; it may be typed as 1e3."""
    remedy = f"a whole number from {least} to {most}"
    try:
        number = float(text)
    except ValueError:
        raise ParameterError(key=key, value=text, remedy=remedy) from None
    if not (least <= number <= most and number == int(number)):
        raise ParameterError(key=key, value=text, remedy=remedy)
    return int(number)


def main(arguments: list[str] | None = None) -> None:
    """Run one command and exit: 0, 2 for bad input, 3 for what could not be solved or proven."""
    given = sys.argv[1:] if arguments is None else arguments
    sys.exit(_run(given or ["--help"]))


def _run(arguments: list[str]) -> int:
    try:
        result: Any = typer.main.get_command(app).main(arguments, prog_name="tfarm", standalone_mode=False)
        sys.stdout.flush()
    except typer.Exit as stop:
        return stop.exit_code
    except (ConvergenceError, CertificationError) as error:
        return _fail(str(error), 3)
    except TfarmError as error:
        return _fail(str(error), 2)
    except BrokenPipeError:  # the reader, head for instance, has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (KeyboardInterrupt, typer.Abort):
        return _fail("stopped", 130)
    except TyperException as error:
        return _fail(_usage(error), 2)
    return result if isinstance(result, int) else 0


def _usage(error: Any) -> str:
    """The parser's complaint, in the words of our own errors."""
    near = getattr(error, "possibilities", None)
    if near:
        return f"{error.option_name}: no such option: did you mean {' or '.join(near)}?"
    return str(error.format_message()) if hasattr(error, "format_message") else str(error)


def _fail(message: str, code: int) -> int:
    tell(message)
    return code


def tell(message: str) -> None:
    """One line to the person at the terminal, on standard error."""
    print(f"tfarm: {one_line(message, 1000)}", file=sys.stderr)
