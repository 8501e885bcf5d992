"""The best constant gain: what a tuner that moves the gain has to beat."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.tuner.guard import constant_windows
from tfarm.tuner.trial import Trial

CONSTANT_GAINS = 200  # constant gains of a window that are tried, before the best are refined
BEST_REFINED = 3  # of them
GAIN_XTOL = 1e-9  # to so much they are refined: a cost is flat there, so that the last digits say nothing


class BestConstant(NamedTuple):
    """The gain, and the trial's cost with it."""

    gain: float
    cost: float


def best_constant(trial: Trial) -> BestConstant:
    """The best constant gain K >= 0 among those that leave the loop stable: all of a grid, the three lowest refined.

    Where no constant gain is stable, K = 0.
    """
    windows = constant_windows(trial.loop)
    found = [BestConstant(0.0, trial.with_constant(0.0).cost)] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, CONSTANT_GAINS + 2)[1:-1]
        costs = np.array([trial.with_constant(float(K)).cost for K in gains])
        step = (high - low) / (CONSTANT_GAINS + 1)
        for i in np.argsort(costs)[:BEST_REFINED]:
            done = minimize_scalar(
                lambda K: trial.with_constant(float(K)).cost,
                bounds=(max(float(gains[i]) - step, low), min(float(gains[i]) + step, high)),
                method="bounded",
                options={"xatol": GAIN_XTOL},
            )
            found.append(BestConstant(float(done.x), float(done.fun)))
    return min(found, key=lambda each: each.cost)
