"""How many flexible modes a simulation takes for the digits that are asked for, or what it is off by.

The signals with twice the modes tell: their largest change, relative to the largest value of each signal, is what half
the modes were off by, and mostly more than what is left.  It is no bound: without damping the moment after an impulse
converges slowly (of 70 random arms one had nearly twice the change left); a loop whose high modes grow is for
`dsp.verdict` to find.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tfarm.dsp.simulation import Simulation, Trace
from tfarm.errors import ConvergenceError

MODE_COUNTS = (10, 20, 40)  # flexible modes; 80 would take a heavily damped arm 8 s of CPU time
ENOUGH_CHANGE = 1e-4  # of each signal's largest value: as many as a table of a simulation shows


class Enough(NamedTuple):
    """How many flexible `modes`; `change` of the signals, in their largest, when the modes were doubled to these."""

    modes: int
    change: float


def enough_modes(simulate: Callable[[int], Simulation]) -> Enough:
    """The fewest of 20 or 40 modes that change no signal by more than 1e-4, else the most there are.

    `simulate` makes the simulation with so many modes, its converters ideal: steps would hide what modes do.
    """
    before, found = simulate(MODE_COUNTS[0]), Enough(MODE_COUNTS[0], np.inf)
    for count in MODE_COUNTS[1:]:
        try:
            now = simulate(count)
        except ConvergenceError:  # two damped modes that cannot be told apart: what there is must do
            return found
        found = Enough(count, change(before.at_samples, now.at_samples))
        if found.change <= ENOUGH_CHANGE:
            return found
        before = now
    return found


def change(before: Trace, after: Trace) -> float:
    """The largest change of any signal at the samples that both have, relative to that signal's largest value."""
    n, changes = min(before.t.size, after.t.size), [0.0]
    for name in after.names:
        old, new = before.signal(name)[:n], after.signal(name)[:n]
        largest = abs(new).max(initial=0.0)
        if largest > 0:
            changes.append(float(abs(new - old).max() / largest))
    return max(changes)
