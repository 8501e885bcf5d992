"""Stable windows of each number of a law, the others held: from the crossings along it and the count where it is.

The characteristic function is linear in any one of them (`law_map`); a delay has its margin instead.
"""

from __future__ import annotations

import itertools

import numpy as np

from tfarm.crossing import Crossings, Window, counts_over, intervals, joined
from tfarm.errors import ConvergenceError

from .frequencies import grid
from .law_map import LEADING, asked_at, law_crossings, unstable_below
from .law_stability import band_for, is_told_without
from .loop import Loop
from .stability import Stability
from .windows import BEYOND_LAW, Windows


def law_windows(verdict: Stability[Loop]) -> dict[str, Windows]:
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
        value = numbers[name]
        try:
            found = law_crossings(loop, name, np.array([low, high]), omega, known, band)
            stable = _stable(verdict, name, (low, high), found, band)
        except ConvergenceError:  # `answers.unsettled` names it
            continue
        around = next((pair for pair in stable if pair[0] < value < pair[1]), None) if verdict.is_stable else None
        windows[name] = Windows(name, around, tuple(stable), (low, high), found.within(low, high), band)
    return windows


def _stable(
    verdict: Stability[Loop], name: str, limits: tuple[float, float], found: Crossings, band: float
) -> list[Window]:
    """The windows, from the verdict's count; where nothing is known beyond the band each is counted if need be.

    Then a pair of poles may leave the band through its top, or come from there, and the count at an end tells of it.
    """
    loop, value = verdict.loop, verdict.loop.law.numbers[name]
    count = np.array([verdict.unstable_roots])

    def unstable_at(at: float) -> int:
        return unstable_below(loop.under(loop.law.having(name, at)), band)

    if not verdict.is_known_beyond:
        (carried,) = counts_over(np.array(limits), [found], value, count)
        if carried.tolist() != [unstable_at(end) for end in limits]:
            edges = [limits[0], *found.within(*limits).gain.tolist(), limits[1]]
            pairs = [pair for pair in itertools.pairwise(edges) if pair[0] < pair[1]]
            return joined([pair for pair in pairs if not unstable_at((pair[0] + pair[1]) / 2)])
    return intervals(found, *limits, value, verdict.unstable_roots)


def _range(loop: Loop, name: str, value: float) -> tuple[float, float]:
    """Between which values a number is looked at: of a leading coefficient from a tenth of what it is on, with its
    sign, where without it high modes are driven."""
    if name.endswith(LEADING) and value and not is_told_without(loop, name):
        low, high = sorted((value / BEYOND_LAW, value * BEYOND_LAW))
        return low, high
    return -BEYOND_LAW * abs(value), BEYOND_LAW * abs(value)
