"""Work shared by two processes.  Each keeps to one arm while it has work, so that its sections share what they compute.

A process that is done takes the next list of work, and when none is left the last piece of another's: so neither waits
for the other at the end.
"""

from __future__ import annotations

import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from multiprocessing import forkserver, get_context, parent_process
from multiprocessing.context import BaseContext
from threading import Thread, current_thread, main_thread
from typing import TypeVar

BLAS = "OPENBLAS_NUM_THREADS"
LOADS_ONCE = sys.platform == "linux"  # macOS' own libraries do not bear a fork, and Windows has none

Task = TypeVar("Task")
Result = TypeVar("Result")


def shared(
    lists: Sequence[Sequence[Task]],
    submit: Callable[[Executor, Task], Future[Result]],
    workers: int,
    modules: Sequence[str] = (),
) -> Iterator[tuple[Task, Result]]:
    """Each task of the lists with its result, as it comes.  `submit` hands one to a process, which has the `modules`.

    What a task raises is raised here, when those that run have ended; the others are not begun.
    """
    waiting = deque(deque(each) for each in lists)
    with ExitStack() as stack:
        stack.enter_context(one_thread_each())
        context = load_beforehand(modules)
        pools = [ProcessPoolExecutor(1, context, leave_with_parent) for _ in range(workers)]
        for pool in pools:
            stack.callback(pool.shutdown, wait=True, cancel_futures=True)
        own: list[deque[Task]] = [deque() for _ in pools]
        running: dict[Future[Result], tuple[int, Task]] = {}
        idle = list(range(workers))
        while True:
            for i in idle:
                if (task := _next(own, i, waiting)) is not None:
                    running[submit(pools[i], task)] = i, task
            if not running:
                return
            done = wait(running, return_when=FIRST_COMPLETED).done
            ended = [(future.result(), *running.pop(future)) for future in done]
            idle = [i for _, i, _ in ended]
            yield from ((task, result) for result, _, task in ended)


def load_beforehand(modules: Sequence[str]) -> BaseContext:
    """How processes are started: on Linux from one that loads the modules for all of them, elsewhere each anew.

    That one begins at once, while this process may still be busy.  (None is forked from the caller's own, whose threads
    it would not have.)
    """
    if not LOADS_ONCE:
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload([*modules, "tfarm.frozen"])
    with _deaf_to_interrupts():
        forkserver.ensure_running()
    return context


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """New processes ignore Ctrl-C, which would stop them amid their imports with a traceback."""
    if current_thread() is not main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _next(own: list[deque[Task]], i: int, waiting: deque[deque[Task]]) -> Task | None:
    """What process i is to do next: the first of its own list or of the next one, or the last of the longest."""
    while waiting and not own[i]:
        own[i] = waiting.popleft()
    if own[i]:
        return own[i].popleft()
    longest = max(own, key=len)
    return longest.pop() if longest else None


@contextmanager
def one_thread_each() -> Iterator[None]:
    """New processes inherit one thread of BLAS, unless the user chose a number.

    On matrices of a hundred rows more threads only wait for each other, and two processes' would share two cores.
    """
    chosen = os.environ.get(BLAS)
    os.environ.setdefault(BLAS, "1")
    try:
        yield
    finally:
        if chosen is None:
            os.environ.pop(BLAS, None)


def leave_with_parent() -> None:
    """In a worker: end when the process that started it is gone; a pool's workers would wait for work for ever.

    Ctrl-C stops what it does.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parent = parent_process()

    def leave() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=leave, daemon=True).start()


def may_start_processes() -> bool:
    """A new process runs the main script again: not where that is a plain script, which may have no guard."""
    main = sys.modules.get("__main__")
    file = getattr(main, "__file__", None)
    return file is None or getattr(main, "__spec__", None) is not None or not str(file).endswith(".py")
