"""Stable windows of each number of a law, the others held: from the crossings along it and the count where it is.

The characteristic function is linear in any one of them (`law_map`); a delay has its margin instead.
"""

from __future__ import annotations

import numpy as np

from tfarm.crossing import intervals
from tfarm.errors import ConvergenceError

from .frequencies import grid
from .law_loop import LawLoop
from .law_map import LEADING, asked_at, law_crossings
from .law_stability import band_for, is_told_without
from .stability import Stability
from .windows import BEYOND_LAW, Windows


def law_windows(verdict: Stability[LawLoop]) -> dict[str, Windows]:
    """The windows of each of `Law.numbers` between ten times what it is and minus that (`_range`).

    None where a pole is on the axis for whatever numbers, of an arm with elastic links, all of whose modes meet on it,
    and of a number along which poles meet at s = 0 and cannot be counted.  All are of poles up to one band: as high as
    both ends of each range ask for, or that of a verdict beyond which nothing is known.
    """
    loop, numbers = verdict.loop, verdict.loop.law.numbers
    if verdict.verdict == "marginal" or loop.arm.has_elastic_link:
        return {}
    ranges = {name: _range(loop, name, value) for name, value in numbers.items()}
    band = verdict.band
    if verdict.is_known_beyond:
        ends = (loop.law.having(name, end) for name, pair in ranges.items() for end in asked_at(name, pair))
        band = max(band, *(band_for(loop.under(law)) for law in ends))
    omega = np.asarray(grid(loop.arm, band))
    known, windows = loop.signals.parts(1j * omega), {}
    for name, (low, high) in ranges.items():
        try:
            found, value = law_crossings(loop, name, np.array([low, high]), omega, known, band), numbers[name]
        except ConvergenceError:  # `answers.unsettled` names it
            continue
        stable = intervals(found, low, high, value, verdict.unstable_roots)
        around = next((pair for pair in stable if pair[0] < value < pair[1]), None) if verdict.is_stable else None
        windows[name] = Windows(name, around, tuple(stable), (low, high), found.within(low, high), band)
    return windows


def _range(loop: LawLoop, name: str, value: float) -> tuple[float, float]:
    """Between which values a number is looked at: of a leading coefficient from a tenth of what it is on, with its
    sign, where without it high modes are driven."""
    if name.endswith(LEADING) and value and not is_told_without(loop, name):
        low, high = sorted((value / BEYOND_LAW, value * BEYOND_LAW))
        return low, high
    return -BEYOND_LAW * abs(value), BEYOND_LAW * abs(value)
