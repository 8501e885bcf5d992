"""Times that survive a busy machine: processor time of one process, in which candidates take turns; medians of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .caches import ColdCalls, empty

TURN = 2e-3  # seconds


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds a call of each candidate, averaged over its turn, one entry a round."""

    rounds: dict[str, NDArray[np.float64]]

    def median(self, name: str) -> float:
        """Seconds of the middle round."""
        return float(np.median(self.rounds[name]))

    def ratio(self, name: str, to: str) -> float:
        """The median of the ratios of neighbours: what slowed one round down slowed both."""
        return float(np.median(self.rounds[name] / self.rounds[to]))


def interleaved(candidates: Mapping[str, Callable[[], object]], rounds: int, *, warm: bool = False) -> Times:
    """Let each candidate have its turn once a round: as many calls as fill `TURN`, the same number every time.

    Before each call the package's caches are emptied, outside of its time; a call that finds what an earlier one has
    left is an error (`caches`).  `warm` leaves them as they are: for what is made once and called again and again.
    """
    timers = {name: _Timer(call, None if warm else ColdCalls()) for name, call in candidates.items()}
    calls = {name: max(1, math.ceil(TURN / min(timer(), timer()))) for name, timer in timers.items()}  # compiled by now
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, timer in timers.items():
            seconds[name].append(sum(timer() for _ in range(calls[name])) / calls[name])
    return Times({name: np.array(each) for name, each in seconds.items()})


@dataclass(frozen=True, slots=True)
class _Timer:
    """One candidate; calling it gives the seconds of processor time of one call, on one thread."""

    call: Callable[[], object]
    cold: ColdCalls | None

    def __call__(self) -> float:
        if self.cold:
            self.cold.before()
        start = time.process_time()
        self.call()
        seconds = time.process_time() - start
        if self.cold:
            self.cold.after()
        return seconds


@dataclass(slots=True)
class Stopwatch:
    """Seconds of processor time inside `once`."""

    seconds: float = 0.0


@contextmanager
def once() -> Iterator[Stopwatch]:
    """Time one long run with empty caches by the processor's clock: other processes do not count."""
    empty()
    watch, start = Stopwatch(), time.process_time()
    yield watch
    watch.seconds = time.process_time() - start
