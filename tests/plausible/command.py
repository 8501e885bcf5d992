"""The command line inside this process, as a user gets it: exit code, JSON, standard error, CPU seconds."""

import contextlib
import io
import json
import signal
import time
import traceback
import warnings
from dataclasses import dataclass

from tfarm.cli import main

PATIENCE = 60.0  # CPU s after which a command is stopped


class TooSlow(BaseException):
    """Raised inside a command that has used up its time; no `except Exception` holds it."""


@dataclass(frozen=True)
class Ran:
    """What came of one command; `code` is None where it was stopped, 1 where it raised."""

    arguments: tuple[str, ...]
    code: int | None
    answer: dict | None
    error: str
    seconds: float


def run(arguments, patience=PATIENCE):
    """Run `tfarm *arguments --json`."""
    out, err = io.StringIO(), io.StringIO()
    previous = signal.signal(signal.SIGPROF, _stop)
    start = time.process_time()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("always")
            signal.setitimer(signal.ITIMER_PROF, patience)
            try:
                code = _code([*arguments, "--json"])
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
    except TooSlow:
        code = None
    finally:
        signal.signal(signal.SIGPROF, previous)
    spent = time.process_time() - start
    answer = json.loads(out.getvalue()) if code == 0 else None
    return Ran(tuple(arguments), code, answer, err.getvalue(), spent)


def _code(arguments):
    try:
        main(arguments)
    except SystemExit as stop:
        return int(stop.code or 0)
    except Exception:  # a crash is a finding of the survey, not its end
        traceback.print_exc()
        return 1
    raise AssertionError("main exits")


def _stop(*_):
    raise TooSlow
