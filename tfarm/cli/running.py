"""One command from its arguments to its exit code: errors and broken streams become one line on standard error."""

from __future__ import annotations

import os
import sys

import typer
from typer.exceptions import TyperException

from tfarm.cli import (  # noqa: F401  each adds its verbs to the application
    commands,
    comparing,
    control,
    fitting,
    help,
    loops,
    measuring,
    pictures,
    reduction,
    sampling,
    trust,
    tuning,
)
from tfarm.cli.app import discard, tell, whole_command
from tfarm.cli.meaning import check_numbers, check_streams, check_verb, usage
from tfarm.errors import CertificationError, ConvergenceError, TfarmError


def run(arguments: list[str]) -> int:
    """The exit code of a command: 0, 2 for bad input, 3 for what could not be solved or proven, 130 if interrupted."""
    _mend_streams()
    try:
        result = _call(arguments or ["--help"])
        sys.stdout.flush()
        return result
    except (KeyboardInterrupt, typer.Abort):
        code = _fail("stopped", 130)
    except (ConvergenceError, CertificationError) as error:
        code = _fail(str(error), 3)
    except TfarmError as error:
        code = _fail(str(error), 2)
    except TyperException as error:
        code = _fail(usage(error), 2)
    except BrokenPipeError:  # the reader, head for instance, has left
        discard(sys.stdout)
        return 0
    except MemoryError:
        code = _fail("not enough memory for this; ask for less at a time", 3)
    except OSError as error:  # of standard output, or of a folder that compiled code is kept in
        discard(sys.stdout)
        code = _fail(_of_the_system(error), 2)
    try:  # what was printed before the error
        sys.stdout.flush()
    except OSError:
        discard(sys.stdout)
    return code


def _call(arguments: list[str]) -> int:
    command = whole_command()
    check_verb(arguments[0], command)
    check_numbers(arguments)
    check_streams(arguments)
    try:  # not command.main, which takes a closed pipe for an error
        with command.make_context("tfarm", list(arguments)) as context:
            command.invoke(context)
    except typer.Exit as stop:
        return stop.exit_code
    return 0


def _mend_streams() -> None:
    """Streams that take every letter and fail like a full disk where they are closed.

    A closed standard error swallows what is said: Python would print it on standard output.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  for as long as the process lives
    if sys.stdout is None:
        read_only = os.open(os.devnull, os.O_RDONLY)
        sys.stdout = open(read_only, "w", encoding="utf-8")  # noqa: SIM115  writing raises OSError
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _of_the_system(error: OSError) -> str:
    reason = error.strerror or str(error)
    if error.filename is None:
        return f"standard output cannot be written ({reason}); free some space, or send it elsewhere"
    return f"{error.filename}: {reason}; free some space, or set NUMBA_CACHE_DIR to a folder with some"


def _fail(message: str, code: int) -> int:
    tell(message)
    return code
