"""Root loci: the exact one beside python-control's on a model of the same number of poles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tfarm
from tfarm.arm import HubFeedback
from tfarm.loop.loci import open_loop, reduced_locus
from tfarm.loop.locus import Locus, locus
from tfarm.loop.loop import Loop
from tfarm.spectrum.proofs import enclosed

from .reference import Complex
from .rows import Row, Target
from .timing import interleaved

GROUP = "Root locus over K1"
BRANCHES, POINTS, ORDER, STOP = 20, 500, 20, 10.0
SLOWEST = 1.0  # of root_locus_map's time
CLOSEST = 0.01  # of its error
SAMPLES = 6  # gains at which every branch is held against 50 digits
DIGITS = 50


def locus_rows() -> Iterator[Row]:
    """Time and error of both, the errors against 50-digit zeros of the exact characteristic function."""
    import control

    arm, law = tfarm.load("sasaki2012"), HubFeedback()
    gain, system = np.linspace(0.0, STOP, POINTS), open_loop(arm, law, "K1", ORDER // 2 - 1)
    times = interleaved(
        {
            "tfarm": lambda: locus(arm, law, "K1", 0.0, STOP, POINTS, BRANCHES),
            "control": lambda: control.root_locus_map(system, gain),
        },
        20,
    )
    exact = locus(arm, law, "K1", 0.0, STOP, POINTS, BRANCHES)
    upper = locus(arm, law, "K1", 0.0, STOP, POINTS, ORDER // 2 + 1)  # what a model of that order can have
    ours, theirs = (_error(each, values) for each, values in ((exact, exact.branches), _reduced(upper)))
    ratio = times.ratio("tfarm", "control")
    each = BRANCHES * POINTS
    yield Row(
        group=GROUP, what="tfarm: sasaki2012, exact", n=each, each="zero", seconds=times.median("tfarm") / each,
        ratio=ratio, to="control", to_seconds=times.median("control") / each, error=ours,
        target=Target(measured=ratio, limit=SLOWEST, unit="times control.root_locus_map"),
        note=f"{BRANCHES} branches with Im s >= 0 by tfarm, {ORDER} poles, conjugates counted, by control on a modal "
        f"model of order {ORDER}; {POINTS} gains K1 from 0 to {STOP:g}.",
    )  # fmt: skip
    yield Row(
        group=GROUP, what=f"control.root_locus_map: order {ORDER}", n=each, each="zero",
        seconds=times.median("control") / each, error=theirs,
        target=Target(measured=ours / theirs, limit=CLOSEST, unit="tfarm's error over this one"),
        note=f"Errors relative to |s|, of all branches at {SAMPLES} gains, against {DIGITS} digits.",
    )  # fmt: skip


def _reduced(upper: Locus) -> tuple[Locus, Complex]:
    return upper, reduced_locus(upper, ORDER).branches


def _error(exact: Locus, values: Complex) -> float:
    """The largest |s - z|/|z| over sampled gains and all branches apart from z = 0, z being right to 50 digits."""
    worst = 0.0
    for n in np.linspace(1, exact.gain.size - 1, SAMPLES).round().astype(int):
        loop = Loop(exact.arm, exact.law.having("K1", float(exact.gain[n])))
        for near, value in zip(exact.branches[:, n], values[:, n], strict=True):
            if near:
                disc = enclosed(loop.k, complex(near), DIGITS, loop.exact)
                true = complex(float(disc.re), float(disc.im))
                worst = max(worst, abs(value - true) / abs(true))
    return worst
