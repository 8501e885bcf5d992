"""The closed loop, continuous and sampled, and proofs of modes: beside the limits that were set for them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import tfarm
from tfarm import Arm, HubFeedback
from tfarm.dsp import Chain, Simulator, sampled_map, sampled_verdict, scenario
from tfarm.loop.margins import margins
from tfarm.loop.plane import between, gain_map

from .rows import Row, Target
from .timing import interleaved, once

CLOSED, GROUP = "The closed loop", "The sampled loop, and proofs"
LAW = HubFeedback(K1=0.3, K2=0.3)
POINTS, MODES, DURATION = 200, 20, 3.0


def loop_rows() -> Iterator[Row]:
    """Margins, and a map of 200 x 200 gains, of the damped preset."""
    arm = tfarm.load("sasaki2012-lab")
    seconds = interleaved({"tfarm": lambda: margins(arm, LAW)}, 9).median("tfarm")
    yield Row(
        group=CLOSED, what="tfarm: verdict, windows, margins", n=1, each="loop", seconds=seconds,
        target=Target(measured=1e3 * seconds, limit=100.0, unit="ms"),
    )  # fmt: skip
    with once() as watch:
        gain_map(arm, between(-1, 3, POINTS), between(-2, 2, POINTS))
    yield Row(
        group=CLOSED, what="tfarm: unstable poles over a map", n=POINTS**2, each="point",
        seconds=watch.seconds / POINTS**2, target=Target(measured=watch.seconds, limit=2.0, unit="s for all"),
    )  # fmt: skip


def sampled_rows() -> Iterator[Row]:
    """A slew of 3 s with 20 modes, a map of 200 x 200 gains, and 100 modes proven to 30 digits."""
    arm = tfarm.load("sasaki2012-lab")
    what = f"tfarm: slew of {DURATION:g} s, {MODES} modes"
    seconds = interleaved({"tfarm": lambda: _simulator(arm).linear(LAW)}, 21).median("tfarm")
    yield Row(group=GROUP, what=what, n=1, each="slew", seconds=seconds)
    run = _simulator(arm)
    seconds = interleaved({"tfarm": lambda: run.linear(LAW)}, 21, warm=True).median("tfarm")
    yield Row(
        group=GROUP, what=f"{what}, under another law", n=1, each="slew", seconds=seconds, warm=True,
        target=Target(measured=1e3 * seconds, limit=1.0, unit="ms"),
    )  # fmt: skip
    with once() as watch:
        sampled_map(sampled_verdict(arm, LAW).loop, np.linspace(0.01, 5.0, POINTS), np.linspace(-0.5, 1.5, POINTS))
    yield Row(
        group=GROUP, what="tfarm: sampled map of gains", n=POINTS**2, each="point", seconds=watch.seconds / POINTS**2,
        target=Target(measured=watch.seconds, limit=5.0, unit="s for all"),
    )  # fmt: skip
    bare = tfarm.load("sasaki2012")
    seconds = interleaved({"tfarm": lambda: tfarm.modes(bare, 100).certify(30)}, 7).median("tfarm")
    yield Row(
        group=GROUP, what="tfarm: 100 modes proven to 30 digits, none missing", n=100, each="mode",
        seconds=seconds / 100, target=Target(measured=1e3 * seconds, limit=150.0, unit="ms for all"),
    )  # fmt: skip


def _simulator(arm: Arm) -> Simulator:
    """The slew with its model of the arm."""
    return Simulator(arm, Chain(), scenario("slew", arm, Chain(), DURATION), count=MODES)
