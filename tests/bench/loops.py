"""The closed loop: margins and a map of gains, beside the same from the eigenvalues of a modal model of sixty modes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tfarm
from tfarm import Arm, HubFeedback
from tfarm.loop.margins import margins
from tfarm.loop.plane import Plane, between, gain_map
from tfarm.reduced import relaxed_model

from .rows import Row, Target
from .timing import interleaved, once

GROUP = "The closed loop"
POINTS = 200  # along each gain of the map
SIXTY = 60  # modes of the model
SAMPLE = 12  # of its maps' points along each gain: the whole would take minutes
LAW = HubFeedback(K1=0.3, K2=0.3)


def loop_rows() -> Iterator[Row]:
    """Margins, and a map of 200 x 200 gains, of the damped preset."""
    arm = tfarm.load("sasaki2012-lab")
    seconds = interleaved({"tfarm": lambda: margins(arm, LAW)}, 9).median("tfarm")
    yield Row(
        group=GROUP, what="tfarm: verdict, windows, margins", n=1, each="loop", seconds=seconds,
        target=Target(measured=1e3 * seconds, limit=100.0, unit="ms"),
    )  # fmt: skip
    yield _map_row(arm)


def _map_row(arm: Arm) -> Row:
    K1, K2 = between(-1, 3, POINTS), between(-2, 2, POINTS)
    with once() as watch:
        found = gain_map(arm, K1, K2)
    theirs, differ = _by_eigenvalues(arm, found)
    return Row(
        group=GROUP, what="tfarm: unstable poles over a map", n=K1.size * K2.size, each="point",
        seconds=watch.seconds / found.unstable.size, ratio=watch.seconds / found.unstable.size / theirs,
        to="eigenvalues", to_seconds=theirs, target=Target(measured=watch.seconds, limit=2.0, unit="s for all"),
        note=f"eigenvalues: those of {SIXTY} damped modes and a relaxing remainder, at {SAMPLE**2} points of the map; "
        f"their count differs from the exact one at {differ} of them.",
    )  # fmt: skip


def _by_eigenvalues(arm: Arm, found: Plane) -> tuple[float, int]:
    """Seconds a point, and at how many points of a coarser map the count differs."""
    A, B, C, D = relaxed_model(arm, ["hub_rate", "root_moment"], SIXTY).matrices()
    step, differ = POINTS // SAMPLE, 0
    with once() as watch:
        for i in range(0, SAMPLE * step, step):
            for j in range(0, SAMPLE * step, step):
                gains = np.array([[found.K1[i], found.K2[j]]])
                s = np.linalg.eigvals(A - B @ gains @ C / (1 + gains @ D))
                differ += int((s.real > 1e-9 * abs(s)).sum() - _at_zero(s)) != found.unstable[j, i]
    return watch.seconds / SAMPLE**2, differ


def _at_zero(s: np.ndarray) -> int:
    """Whether the eigenvalue at 0 of the free hub angle has come out positive."""
    least = s[np.argmin(abs(s))]
    return int(least.real > 1e-9 * abs(least))
