"""Tasks on a pool of a few processes, which end with the one that started them."""

import gc
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, MutableMapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import active_children, get_context, parent_process, resource_tracker
from threading import Thread
from types import ModuleType
from typing import Any, TypeVar

from tfarm.errors import ConvergenceError
from tfarm.stopping import SIGNALS, undone_if_stopped

BLAS = "OPENBLAS_NUM_THREADS"

Job = TypeVar("Job")
Result = TypeVar("Result")


def share_tasks(
    tasks: Iterable[tuple[Job, Callable[[], Result]]],
    count: int,
    on_start: Callable[[Sequence[Job]], object] = lambda _: None,
    *,
    joins: bool = False,
) -> Iterator[tuple[Job, Result]]:
    """Yield each task with its result as it comes, by `count` processes, or by this one for a count of 1.

    Where this one `joins`, it is one of them: a process less to start.
    `on_start` is called with the running tasks whenever one is begun.  An error of a task is raised here once the
    running ones have ended; the others are not begun.  Raises ConvergenceError where a process dies.
    """
    if count == 1:
        for task, call in tasks:
            on_start([task])
            yield task, call()
        return
    # which may make each task only when there is a process for it
    waiting = iter(tasks)
    running: dict[Future[Result], Job] = {}
    others = count - joins
    with _pool(others) as pool:

        def begin(most: int) -> None:
            # as long as a process lives that this may start; no task is of the main script, which may have no guard
            with _signals_blocked(), _entry(sys.modules, "__main__", ModuleType("__main__")):
                new = islice(waiting, max(0, most - len(running)))
                running.update({pool.submit(call): task for task, call in new})

        while True:
            begin(others)
            own = next(waiting, None) if joins else None
            # one more, for a process that ends its task before this one does
            begin(count)
            if own is None and not running:
                return
            now = [*running.values()][:others]
            if own is None:
                on_start(now)
            else:
                task, call = own
                on_start([*now, task])
                yield task, call()
            for future in wait(running, None if own is None else 0.0, FIRST_COMPLETED).done:
                task = running.pop(future)
                yield task, future.result()


@contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield processes with one thread of BLAS each, unless the user chose a number; killed where this one is stopped.

    On matrices of a hundred rows more threads only wait for each other.  Each process starts anew: a fork would lack
    the threads of this one.
    """
    others = set(active_children())

    def kill() -> None:
        for child in set(active_children()) - others:
            child.kill()
            child.join()

    # of semaphores of a stopped process
    with _entry(os.environ, "PYTHONWARNINGS", "ignore:resource_tracker"):
        resource_tracker.ensure_running()
    with (
        _entry(os.environ, BLAS, os.environ.get(BLAS, "1")),
        undone_if_stopped(kill),
        ProcessPoolExecutor(
            count, get_context("spawn"), initializer=_begin, initargs=gc.get_threshold()
        ) as pool,
    ):
        try:
            yield pool
        except BrokenProcessPool:
            # one that never began its work would be waited for
            kill()
            raise ConvergenceError(
                "a worker process ended before its work was done, perhaps for want of memory; ask for less",
                None,
                None,
            ) from None
        except KeyboardInterrupt:
            kill()
            raise


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Hold back `SIGNALS`, where the system can."""
    change = getattr(signal, "pthread_sigmask", lambda *_: None)
    change(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        change(signal.SIG_UNBLOCK, SIGNALS)


@contextmanager
def _entry(of: MutableMapping[str, Any], name: str, value: Any) -> Iterator[None]:
    """Set an entry of a mapping that new processes read, the environment or the modules."""
    before = {name: of[name]} if name in of else {}
    of[name] = value
    try:
        yield
    finally:
        del of[name]
        of.update(before)


def _begin(*thresholds: int) -> None:
    """Begin a worker, which collects garbage as seldom as the process that starts it."""
    gc.set_threshold(*thresholds)
    leave_with_parent()


def leave_with_parent() -> None:
    """End a worker when the process that started it is gone: it would wait for work for ever."""
    # Ctrl-C is for that process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()

    def leave() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=leave, daemon=True).start()
