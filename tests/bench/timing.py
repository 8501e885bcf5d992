"""Times that survive a busy machine: candidates take turns in one process, and medians are compared."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def interleaved(candidates: Mapping[str, Callable[[], object]], rounds: int) -> Times:
    """Let each candidate have its turn once a round: as many calls as fill `TURN`, the same number every time.

    Calls so short that the caches are still cold from another candidate's turn would measure that instead.
    """
    calls = {name: max(1, math.ceil(TURN / _shortest(call))) for name, call in candidates.items()}
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, call in candidates.items():
            start = time.perf_counter()
            for _ in range(calls[name]):
                call()
            seconds[name].append((time.perf_counter() - start) / calls[name])
    return Times({name: np.array(each) for name, each in seconds.items()})


def _shortest(call: Callable[[], object]) -> float:
    """Seconds of the faster of two calls: the first may have to load or compile."""
    seconds = math.inf
    for _ in range(2):
        start = time.perf_counter()
        call()
        seconds = min(seconds, time.perf_counter() - start)
    return seconds


@dataclass(slots=True)
class Stopwatch:
    """Seconds of processor time inside `once`."""

    seconds: float = 0.0


@contextmanager
def once() -> Iterator[Stopwatch]:
    """Time one long run, of single-threaded Python, by the processor's clock: other processes do not count."""
    watch, start = Stopwatch(), time.process_time()
    yield watch
    watch.seconds = time.process_time() - start
