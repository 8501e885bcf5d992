"""Ctrl-C and SIGTERM of the command line: one line, exit code 130 or 143, and nothing left of what was begun.

No exception is raised: at a random moment it would meet locks half taken and files half registered.  The handler runs
between two steps of Python in the main thread, undoes what is registered here and ends the process.  Where the main
thread is in a long compiled loop, which writes no files, a second thread does so after a moment.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Lock, Thread
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
PATIENCE = 0.5  # seconds that the main thread has before the second thread ends the process
CLEAR_LINE = b"\r\x1b[2K\x1b[?25h"  # on a terminal: a progress bar's line, and the cursor that it hides

_undone: list[Callable[[], object]] = []
_stopping = Lock()


def when_stopped(undo: Callable[[], object]) -> None:
    """`undo` is called if the process is stopped, the last one registered first."""
    _undone.append(undo)


@contextmanager
def undone_if_stopped(undo: Callable[[], object]) -> Iterator[None]:
    """The same while the context lasts."""
    when_stopped(undo)
    try:
        yield
    finally:
        _undone.remove(undo)


def stop_on_signals() -> None:
    """From now on SIGINT and SIGTERM stop this process, unless it was started with them ignored.

    Called in the main thread.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    Thread(target=_stop_late, args=(reading,), daemon=True).start()
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for each in SIGNALS:
        if signal.getsignal(each) is not signal.SIG_IGN:
            signal.signal(each, _stop)


def _stop_late(reading: int) -> None:
    number = os.read(reading, 1)[0]
    time.sleep(PATIENCE)
    _stop(number)


def _stop(number: int, _: FrameType | None = None) -> None:
    """Undo what is registered, say so and end; a second signal changes nothing."""
    if not _stopping.acquire(blocking=False):
        return
    _say_last(b"tfarm: stopped\n")
    for undo in reversed(_undone):
        with suppress(Exception):
            undo()
    os._exit(128 + number)


def _say_last(line: bytes) -> None:
    """The line on standard error, and nothing more there by any thread of this process."""
    with suppress(OSError, ValueError, AttributeError):
        stream = sys.stderr.fileno()
        kept, nowhere = os.dup(stream), os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream)
        os.write(kept, CLEAR_LINE * os.isatty(kept) + line)
