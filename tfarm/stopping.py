"""Ctrl-C, SIGTERM and SIGHUP of the command line: one line, exit code 130, 143 or 129, no unfinished file or process.

No exception is raised: at a random moment it would meet locks half taken and files half registered.  The handler runs
between two steps of Python in the main thread, calls the registered functions and ends the process.  Where the main
thread is in a long compiled loop, which writes no files, a second thread does so after a moment.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Lock, Thread
from types import FrameType

# called by a long computation between its steps, with the number done, that of all, and the next step in words
Progress = Callable[[int, int, str], object]
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_undone: list[Callable[[], object]] = []
_stopping = Lock()


@contextmanager
def undone_if_stopped(undo: Callable[[], object]) -> Iterator[None]:
    """Call `undo` if the process is stopped inside of the context, the last one registered first."""
    _undone.append(undo)
    try:
        yield
    finally:
        _undone.remove(undo)


def stop_on_signals() -> None:
    """Let `SIGNALS` stop this process from now on, unless it was started with them ignored.

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
    """Stop some time after a signal, where the main thread has not done so."""
    number = os.read(reading, 1)[0]
    # seconds that the main thread has
    time.sleep(0.5)
    _stop(number)


def _stop(number: int, _: FrameType | None = None) -> None:
    """Print one line, call the registered functions and end; a second signal changes nothing.

    Standard error is closed for every other thread first.
    """
    if not _stopping.acquire(blocking=False):
        return
    with suppress(OSError, ValueError, AttributeError):
        stream = sys.stderr.fileno()
        kept = os.dup(stream)
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        os.write(kept, b"tfarm: stopped\n")
    for undo in reversed(_undone):
        with suppress(Exception):
            undo()
    os._exit(128 + number)
