"""The sampled loop: a slew, a map of gains at 10 ms, and proofs of modes, beside the limits that were set for them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tfarm
from tfarm import HubFeedback
from tfarm.dsp import Chain, Simulator, sampled_map, sampled_verdict, scenario

from .rows import Row, Target
from .timing import interleaved, once

GROUP = "The sampled loop, and proofs"
LAW = HubFeedback(K1=0.3, K2=0.3)
POINTS, MODES, DURATION = 200, 20, 3.0


def sampled_rows() -> Iterator[Row]:
    """A slew of 3 s with 20 modes, a map of 200 x 200 gains, and 100 modes proven to 30 digits."""
    arm = tfarm.load("sasaki2012-lab")
    run = Simulator(arm, Chain(), scenario("slew", arm, Chain(), DURATION), count=MODES)
    seconds = interleaved({"tfarm": lambda: run.linear(LAW)}, 21).median("tfarm")
    yield Row(
        group=GROUP, what=f"tfarm: slew of {DURATION:g} s, {MODES} modes", n=1, each="slew", seconds=seconds,
        target=Target(measured=1e3 * seconds, limit=1.0, unit="ms"),
    )  # fmt: skip
    loop = sampled_verdict(arm, LAW).loop
    with once() as watch:
        sampled_map(loop, np.linspace(0.01, 5.0, POINTS), np.linspace(-0.5, 1.5, POINTS))
    yield Row(
        group=GROUP, what="tfarm: sampled map of gains", n=POINTS**2, each="point", seconds=watch.seconds / POINTS**2,
        target=Target(measured=watch.seconds, limit=5.0, unit="s for all"),
    )  # fmt: skip
    modes = tfarm.modes(tfarm.load("sasaki2012"), 100)
    seconds = interleaved({"tfarm": lambda: modes.certify(30)}, 7).median("tfarm")
    yield Row(
        group=GROUP, what="tfarm: 100 modes proven to 30 digits, none missing", n=100, each="mode",
        seconds=seconds / 100, target=Target(measured=1e3 * seconds, limit=150.0, unit="ms for all"),
    )  # fmt: skip
