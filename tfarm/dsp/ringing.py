"""How far each mode rings in what a simulation records: so that a picture of it knows how many points it takes.

Under the torque u that is held a mode goes round its rest, a + u/p, on a circle that shrinks with Re p.  The torques of
the simulation are played again, and the largest circle of every mode, times what it shows in an output, is its share.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tfarm.arrays import Real
from tfarm.dsp.plant import RECORDED
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation

POINTS_A_PERIOD = 20  # of a curve in each period of the fastest mode that is seen
VISIBLE = 1 / 300  # of the height of a curve: a pixel of a picture


class Ringing(NamedTuple):
    """`frequency` (m,) [rad/s] of the modes that ring, and how far they do in `RECORDED` (4, m)."""

    frequency: Real
    size: Real

    def fastest(self, signal: str, height: float) -> float:
        """The highest frequency [rad/s] that is seen in a curve of that height; 0 where none is."""
        seen = self.size[RECORDED.index(signal)] > VISIBLE * height
        return float(self.frequency[seen].max(initial=0.0))


def ringing(simulator: Simulator, run: Simulation) -> Ringing:
    """The ringing of a simulation by this simulator, its torques played again; no mode rings that decays faster."""
    p, weights = simulator.modal()
    rings = p.imag > -p.real
    p, weights, amplitude = p[rings], weights[:, rings], simulator.first_amplitudes()[rings]
    sampling, d = simulator.chain.sampling, simulator.chain.sampling.whole_delay
    late = sampling.fraction * sampling.period
    pieces = [(0, np.exp(p * late))] if late else []  # the torque before, and then this one
    pieces.append((1, np.exp(p * (sampling.period - late))))
    torque, largest = np.r_[np.zeros(d + 1), run.torque], np.zeros(p.size)
    for k, extra in enumerate(simulator.scenario.disturbance[: run.torque.size]):
        for shift, turn in pieces:
            rest = (torque[k + shift] + extra) / p
            circle = amplitude + rest
            largest = np.maximum(largest, abs(circle))
            amplitude = turn * circle - rest
    return Ringing(np.asarray(p.imag, dtype=float), np.asarray(abs(weights) * largest, dtype=float))


def records_between(simulator: Simulator, run: Simulation, heights: dict[str, float]) -> int:
    """How many records between two samples show every mode that is seen in curves of these heights [SI]."""
    found = ringing(simulator, run)
    fastest = max((found.fastest(signal, height) for signal, height in heights.items()), default=0.0)
    return max(0, math.ceil(POINTS_A_PERIOD * fastest * run.scenario.period / (2 * math.pi)) - 1)
