"""Which gains?  The best K1, K2 (and Kp) within bounds, judged by the exact loop.

A coarse grid first, because stable regions have several parts; then the downhill simplex of Nelder and Mead (1965)
from the best points of the grid.  Gains that are not stable never win.  How flat the optimum is, is part of the answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from tfarm.arm import Arm, HubFeedback
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record

from .damping import least_damping
from .frequencies import band_of, grid
from .margins import disk_at
from .plant import Loop
from .regions import region
from .residual import residual_moment
from .stability import Stability, stability

Real = NDArray[np.float64]
Objective = Literal["damping", "margin", "residual"]
Bounds = tuple[float, float]

OBJECTIVES = ("damping", "margin", "residual")
COARSE = 21  # grid points along each gain
STARTS = 3  # best grid points from which the simplex starts
BAD = 1e9  # the score of gains that are not stable
TIE = 0.01  # weight of the damping ratio beside the disk margin: K2 = 0 has margin 2 at every K1
FLAT = 0.01  # gains whose value is worse by less than this share bound the flat part


@dataclass(frozen=True)
@record
class Design:
    """The best law, its value (damping ratio, disk margin, or residual moment [N m]), its verdict, and how flat it is.

    `flat_K1` and `flat_K2` are the gains between which, the other held, the value is within one per cent of the best.
    """

    objective: str
    law: HubFeedback
    value: float
    verdict: Stability
    bounds: dict[str, Bounds]
    flat_K1: Bounds
    flat_K2: Bounds
    modes: int


def design(
    arm: Arm, objective: Objective = "damping", *, K1: Bounds | None = None, K2: Bounds | None = None,
    Kp: float = 0.0, modes: int = 2,
) -> Design:  # fmt: skip
    """The gains that serve an objective best within bounds.

    "damping" maximises the least damping ratio of the oscillating poles below mode `modes` + 1; "margin" the disk
    margin up to there (of nearly equal ones that with more damping); "residual" minimises the root moment left after
    the slew of `residual`.  Raises ParameterError for a bad objective or bounds, ConvergenceError if no gains within
    the bounds are stable.
    """
    if objective not in OBJECTIVES:
        raise ParameterError(key="objective", value=objective, remedy=f"use one of {', '.join(OBJECTIVES)}")
    Loop(arm, HubFeedback(K1=1.0, K2=0.5 if arm.hub.inertia else 0.0, Kp=Kp))
    inertia = arm.total_inertia if arm.has_rigid_mode else arm.hub.inertia
    K1 = _checked("K1", K1 or (0.0, 2.0 * inertia * band_of(arm, 1)))
    K2 = _checked("K2", K2 or (-3.0, 1.0))
    score = _score(arm, objective, Kp, modes)
    a, b = _inside(K1), _inside(K2)
    stable = region(arm, a, b, Kp).stable
    if not stable.any():
        raise ConvergenceError(f"no gains with K1 in {K1} and K2 in {K2} are stable: widen the bounds", None, stable)
    grid_K1, grid_K2 = np.meshgrid(a, b)
    values = np.full(stable.size, np.inf)
    values[stable.ravel()] = score(grid_K1[stable], grid_K2[stable])
    starts = _starts(values, grid_K1, grid_K2)
    for each in (score, _guarded(score, arm, Kp)):  # only where the simplex leaves what is stable each step is judged
        best = min((_polished(each, x, K1, K2) for x in starts), key=lambda found: found[1])
        law = HubFeedback(K1=float(best[0][0]), K2=float(best[0][1]), Kp=Kp)
        if _holds(arm, law):
            break
    verdict = stability(arm, law)
    if not verdict.is_stable:
        text = f"the best gains found, K1 = {law.K1:.6g} and K2 = {law.K2:.6g}, are not stable"
        raise ConvergenceError(text, law, best)
    value = best[1] if objective == "residual" else -best[1]
    if objective == "margin":
        value = _disk(verdict.loop, np.asarray(grid(arm, band_of(arm, modes))))
    flat = [_flat(score, best, axis, bounds) for axis, bounds in enumerate((K1, K2))]
    return Design(objective, law, value, verdict, {"K1": K1, "K2": K2}, flat[0], flat[1], modes)


def _checked(name: str, bounds: Bounds) -> Bounds:
    low, high = (float(value) for value in bounds)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ParameterError(key=name, value=bounds, remedy="bounds are two finite numbers, the lower first")
    return low, high


def _inside(bounds: Bounds) -> Real:
    """Points between the bounds, the ends left out: there verdicts are marginal."""
    return np.asarray(np.linspace(*bounds, COARSE + 2)[1:-1])


def _score(arm: Arm, objective: str, Kp: float, modes: int) -> Callable[[Real, Real], Real]:
    """What is minimised, for arrays of K1 and K2."""
    if objective == "damping":
        return lambda K1, K2: -least_damping(arm, K1, K2, np.full(K1.size, Kp), modes)
    if objective == "residual":
        return lambda K1, K2: residual_moment(arm, K1, K2, np.full(K1.size, Kp), modes)
    band = band_of(arm, modes)
    omega = np.asarray(grid(arm, band))

    def disk(K1: Real, K2: Real) -> Real:
        loops = (Loop(arm, HubFeedback(K1=float(a), K2=float(b), Kp=Kp)) for a, b in zip(K1, K2, strict=True))
        size = np.array([_disk(loop, omega) for loop in loops])
        return -size - TIE * least_damping(arm, K1, K2, np.full(K1.size, Kp), modes)

    return disk


def _guarded(score: Callable[[Real, Real], Real], arm: Arm, Kp: float) -> Callable[[Real, Real], Real]:
    """The score where the loop is stable, and `BAD` where it is not."""

    def guarded(K1: Real, K2: Real) -> Real:
        laws = [HubFeedback(K1=float(a), K2=float(b), Kp=Kp) for a, b in zip(K1, K2, strict=True)]
        return np.where([_holds(arm, law) for law in laws], score(K1, K2), BAD)

    return guarded


def _holds(arm: Arm, law: HubFeedback) -> bool:
    try:
        return stability(arm, law).is_stable
    except ConvergenceError:  # on the edge
        return False


def _disk(loop: Loop, omega: Real) -> float:
    return float(disk_at(loop, omega).min())


def _starts(values: Real, K1: Real, K2: Real) -> list[Real]:
    order = np.argsort(values)[:STARTS]
    return [np.array([K1.ravel()[i], K2.ravel()[i]]) for i in order if np.isfinite(values[i])]


def _polished(score: Callable[[Real, Real], Real], start: Real, K1: Bounds, K2: Bounds) -> tuple[Real, float]:
    low, high = np.array([K1[0], K2[0]]), np.array([K1[1], K2[1]])

    def of_shares(x: Any) -> float:
        gains = low + (high - low) * np.clip(x, 1e-9, 1 - 1e-9)
        return float(score(gains[:1], gains[1:])[0]) + 10 * float(np.sum(np.maximum(0, abs(x - 0.5) - 0.5)))

    first = (start - low) / (high - low)
    simplex = first + 0.02 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options: Any = {"initial_simplex": simplex, "xatol": 1e-6, "fatol": 1e-9}
    found = minimize(of_shares, first, method="Nelder-Mead", options=options)
    return low + (high - low) * np.clip(found.x, 1e-9, 1 - 1e-9), float(found.fun)


def _flat(score: Callable[[Real, Real], Real], best: tuple[Real, float], axis: int, bounds: Bounds) -> Bounds:
    """Between which values of one gain the score stays within `FLAT` of the best, on a grid of a hundred."""
    values = np.linspace(*bounds, 203)[1:-1]
    gains = [np.full(values.size, best[0][0]), np.full(values.size, best[0][1])]
    gains[axis] = values
    good = score(*gains) <= best[1] + FLAT * abs(best[1])
    centre = int(np.argmin(abs(values - best[0][axis])))
    low = high = centre
    while low > 0 and good[low - 1]:
        low -= 1
    while high < values.size - 1 and good[high + 1]:
        high += 1
    return min(float(values[low]), float(best[0][axis])), max(float(values[high]), float(best[0][axis]))
