"""Work shared by two processes.  Each keeps to one arm while it has work, so that its sections share what they compute.

A process that is done takes the next list of work, and when none is left the last piece of another's: so neither waits
for the other at the end.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from multiprocessing import active_children, forkserver, get_context, parent_process, resource_tracker
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from threading import Thread
from typing import TypeVar

from tfarm.stopping import SIGNALS, undone_if_stopped, when_stopped

BLAS = "OPENBLAS_NUM_THREADS"
WARNINGS = "PYTHONWARNINGS"
LOADS_ONCE = sys.platform == "linux"  # macOS' own libraries do not bear a fork, and Windows has none

Task = TypeVar("Task")
Result = TypeVar("Result")


def shared(
    lists: Sequence[Sequence[Task]],
    submit: Callable[[Executor, Task], Future[Result]],
    workers: int,
    modules: Sequence[str] = (),
    begun: Callable[[Sequence[Task]], object] = lambda _: None,
) -> Iterator[tuple[Task, Result]]:
    """Each task of the lists with its result, as it comes.  `submit` hands one to a process, which has the `modules`.

    `begun` is given the tasks that run, whenever one is begun.  What a task raises is raised here, when those that run
    have ended; the others are not begun.
    """
    waiting = deque(deque(each) for each in lists)
    others = set(active_children())
    with ExitStack() as stack:
        stack.enter_context(one_thread_each())
        context = load_beforehand(modules)
        pools = [ProcessPoolExecutor(1, context, leave_with_parent) for _ in range(workers)]
        for pool in pools:
            stack.callback(pool.shutdown, wait=True, cancel_futures=True)
        stack.enter_context(_killed_by_interrupts(others))
        own: list[deque[Task]] = [deque() for _ in pools]
        running: dict[Future[Result], tuple[int, Task]] = {}
        idle = list(range(workers))
        while True:
            for i in idle:
                if (task := _next(own, i, waiting)) is not None:
                    running[submit(pools[i], task)] = i, task
            if not running:
                return
            begun([task for _, task in running.values()])
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
    context.set_forkserver_preload(["tfarm.grouped", *modules, "tfarm.frozen"])
    when_stopped(kill_workers)
    with _environment_with(WARNINGS, "ignore:resource_tracker"):  # of the semaphores of a process that was stopped
        resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        forkserver.ensure_running()  # inherits that both signals are blocked, as do those forked from it
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return context


def kill_workers() -> None:
    """End the process that workers are forked from, and all of these, at once; they are gone when this returns."""
    server = getattr(forkserver._forkserver, "_forkserver_pid", None)
    for child in active_children() if server is None else []:
        child.kill()
    if server is None:
        return
    with suppress(ProcessLookupError):  # it has its group once it has begun to load
        os.kill(server, signal.SIGKILL)
        os.killpg(server, signal.SIGKILL)
    with suppress(ChildProcessError, ProcessLookupError):
        os.waitpid(server, 0)
        for _ in range(50):
            os.killpg(server, 0)
            time.sleep(0.01)


@contextmanager
def _killed_by_interrupts(others: set[BaseProcess]) -> Iterator[None]:
    """Processes but the `others` end where this one is interrupted; tasks that run would be waited for."""
    try:
        with undone_if_stopped(kill_workers):
            yield
    except KeyboardInterrupt:
        for child in set(active_children()) - others:
            child.kill()
        raise


def _next(own: list[deque[Task]], i: int, waiting: deque[deque[Task]]) -> Task | None:
    """What process i is to do next: the first of its own list or of the next one, or the last of the longest."""
    while waiting and not own[i]:
        own[i] = waiting.popleft()
    if own[i]:
        return own[i].popleft()
    longest = max(own, key=len)
    return longest.pop() if longest else None


def one_thread_each() -> AbstractContextManager[None]:
    """New processes inherit one thread of BLAS, unless the user chose a number.

    On matrices of a hundred rows more threads only wait for each other, and two processes' would share two cores.
    """
    return _environment_with(BLAS, os.environ.get(BLAS, "1"))


@contextmanager
def _environment_with(name: str, value: str) -> Iterator[None]:
    """That variable is so for new processes."""
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def leave_with_parent() -> None:
    """In a worker: end when the process that started it is gone; a pool's workers would wait for work for ever.

    Ctrl-C is for that process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
