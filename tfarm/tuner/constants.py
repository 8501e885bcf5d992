"""The best constant gain: what a tuner that moves the gain has to beat."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.tuner.guard import gain_windows
from tfarm.tuner.trial import Trial

GRID = 200


class BestConstant(NamedTuple):
    """The gain, and the trial's cost with it."""

    gain: float
    cost: float


def best_constant(trial: Trial) -> BestConstant:
    """The best constant gain K >= 0 among those that leave the loop stable: all of a grid, the three lowest refined.

    Where no constant gain is stable, K = 0.
    """
    windows = gain_windows(trial.loop)
    found = [BestConstant(0.0, trial.with_constant(0.0).cost)] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, GRID + 2)[1:-1]
        costs = np.array([trial.with_constant(float(K)).cost for K in gains])
        step = (high - low) / (GRID + 1)
        found += [_refined(trial, float(gains[i]), step, low, high) for i in np.argsort(costs)[:3]]
    return min(found, key=lambda each: each.cost)


def _refined(trial: Trial, K: float, step: float, low: float, high: float) -> BestConstant:
    ends = (max(K - step, low), min(K + step, high))
    done = minimize_scalar(
        lambda K: trial.with_constant(float(K)).cost, bounds=ends, method="bounded", options={"xatol": 1e-9}
    )
    return BestConstant(float(done.x), float(done.fun))
