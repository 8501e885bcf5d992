"""Lines on standard error while a command runs: its progress, and what it has to say."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import IO

from tfarm.errors import one_line

# of the command, for the lines of progress
_state = ["running"]


def advance(done: int, total: int, text: str) -> None:
    """Set the next line of progress: the task that runs, and how many of all are done."""
    _state[0] = f"{done} of {total} done, running: {text}" if total else text


@contextmanager
def progress(after: float = 2.0) -> Iterator[Callable[[int, int, str], None]]:
    """Print a line on standard error every few seconds while a command runs, the first `after` some [s]."""
    _state[0] = "running"
    over = Event()
    began = time.monotonic()

    def speak() -> None:
        pause = after
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
