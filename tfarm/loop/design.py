"""Which gains?  The best K1, K2 (and Kp) within bounds, judged by the exact loop.

A grid over the bounds first, its minima refined together (`search`).  Gains that are not stable never win.  How flat
the optimum is, and whether it is one or only where the bounds cut the search off, is part of the answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback, law_of, many_laws
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.spectrum import modes as natural_modes
from tfarm.spectrum.scales import rate_unit, turning_inertia

from .damping import least_damping
from .frequencies import band_of, grid
from .margins import disk_at
from .plant import Loop
from .regions import region
from .residual import RISE, residual_moment
from .search import END, POLISHED, Axis, Bounds, Found, Score, minima, polished, rate_axis, refined
from .stability import Stability, stability

Real = NDArray[np.float64]
Objective = Literal["damping", "margin", "residual"]

OBJECTIVES = ("damping", "margin", "residual")
TIE = 0.01  # weight of the damping ratio beside the disk margin: K2 = 0 has margin 2 at every K1
FLAT = 0.01  # gains whose value is worse by less than this share bound the flat part
AT_BOUND = 1e-3  # share of an axis: an optimum so near to its end is where the bound is
BASIN = 6  # points of the grid in each basin of a residual
SIMPLEX = 2.0**-8  # of a step of the grid: its first size
HALVINGS = 40  # of an interval, for the ends of the flat part and the way back into the stable region


class Effort(NamedTuple):
    """Points of the grid along K1 and K2, and how many of its minima are refined."""

    K1: int
    K2: int
    starts: int


@dataclass(frozen=True)
@record
class Design:
    """The best law, its value (damping ratio, disk margin, or residual moment [N m]), its verdict, and how flat it is.

    `flat_K1` and `flat_K2` are the gains between which, the other held, the value is within one per cent of the best.
    `at_bound` names the gains that lie at an end of `bounds`: there the search was cut off, and the value is no
    optimum.
    """

    objective: str
    law: HubFeedback
    value: float
    verdict: Stability
    bounds: dict[str, Bounds]
    flat_K1: Bounds
    flat_K2: Bounds
    modes: int
    at_bound: tuple[str, ...]


def design(
    arm: Arm, objective: Objective = "damping", *, K1: Bounds | None = None, K2: Bounds | None = None,
    Kp: float = 0.0, modes: int = 2,
) -> Design:  # fmt: skip
    """The gains that serve an objective best within bounds.

    "damping" maximises the least damping ratio of the oscillating poles below mode `modes` + 1; "margin" the disk
    margin up to there (of nearly equal ones that with more damping); "residual" minimises the root moment left after
    the slew of `residual`.  The verdict is that of the continuous loop: gains that are best there need not hold when
    sampled, `tfarm.sampled(arm, found.law)` says whether they do.  Raises ParameterError for a bad objective or bounds,
    ConvergenceError if no gains within the bounds are stable.
    """
    if objective not in OBJECTIVES:
        raise ParameterError(key="objective", value=objective, remedy=f"use one of {', '.join(OBJECTIVES)}")
    Loop(arm, HubFeedback(K1=1.0, K2=0.0 if arm.has_massless_hub else 0.5 * arm.input_per_torque, Kp=Kp))
    K1 = _checked("K1", K1 or (0.0, 2.0 * turning_inertia(arm) * band_of(arm, 1)))
    unit = arm.input_per_torque
    K2 = _checked("K2", K2 or (-3.0 * unit, 1.0 * unit))
    axes = rate_axis(K1, rate_unit(arm)), Axis(*K2)
    score = _score(arm, objective, Kp, modes)
    best = _best(arm, score, axes, Kp, _effort(arm, objective, K2, modes))
    law = _law(axes, best.shares, Kp)
    verdict = stability(arm, law)
    value = best.score if objective == "residual" else -best.score
    if objective == "margin":
        value = _disk(verdict.loop, np.asarray(grid(arm, band_of(arm, modes))))
    flat = [_flat(score, (law.K1, law.K2), best.score, axis, bounds) for axis, bounds in enumerate((K1, K2))]
    ends = zip(("K1", "K2"), best.shares, strict=True)
    at_bound = tuple(name for name, share in ends if min(share, 1 - share) < AT_BOUND)
    return Design(objective, law, value, verdict, {"K1": K1, "K2": K2}, flat[0], flat[1], modes, at_bound)


def _effort(arm: Arm, objective: str, K2: Bounds, number: int) -> Effort:
    """A residual has as many basins along K2 as its modes' frequencies run through periods of the slew.

    Feeding K2 back makes of the hub one of inertia I_h/(1 - K2); from K2 = 1 on it stands still.
    """
    if objective == "margin":  # the one that is dear
        return Effort(24, 24, 4)
    if objective == "damping":  # which has few basins
        return Effort(32, 36, 12)
    starts = max(6, 80 // number)
    shares = (1 - gain / arm.input_per_torque for gain in K2)
    hubs = (arm.hub_inertia / share if share > 0 else math.inf for share in shares)
    ends = [natural_modes(arm.having(hub_inertia=hub), number).natural_frequency[-number:] for hub in hubs]
    basins = float(abs(ends[0] - ends[1]).max()) * RISE / (4 * math.pi)
    return Effort(36, int(min(max(60.0, BASIN * basins), max(60, 1600 // number))), starts)


def _best(arm: Arm, score: Score, axes: tuple[Axis, Axis], Kp: float, effort: Effort) -> Found:
    """The best stable gains, in shares of the axes.  Raises ConvergenceError where none are stable."""
    shares = [axis.middles(number) for axis, number in zip(axes, effort[:2], strict=True)]
    a, b = (axis.gain(share) for axis, share in zip(axes, shares, strict=True))
    stable = region(arm, a, b, Kp).stable
    if not stable.any():
        text = "K1 in ({:g}, {:g}) and K2 in ({:g}, {:g})".format(*(x for each in axes for x in (each.low, each.high)))
        raise ConvergenceError(f"no gains with {text} are stable: widen the bounds", None, stable)
    grid_K1, grid_K2 = np.meshgrid(a, b)
    values = np.full(stable.shape, np.inf)
    values[stable] = score(grid_K1[stable], grid_K2[stable])
    places = minima(values, effort.starts)[:, ::-1]
    starts = np.stack([share[places[:, i]] for i, share in enumerate(shares)], axis=1)
    steps = 1 / np.array(effort[:2])
    inside = _inside(score, axes, stable)
    found = sorted(refined(inside, axes, starts, steps), key=lambda each: each.score)
    found = [polished(inside, axes, each, SIMPLEX * float(steps.min())) for each in found[:POLISHED]] + found[POLISHED:]
    grid_best = [Found(start, float(values[row, column])) for start, (column, row) in zip(starts, places, strict=True)]
    for each in sorted([*found, *grid_best], key=lambda each: each.score):
        if _holds(arm, _law(axes, each.shares, Kp)):
            return each
    raise ConvergenceError("none of the best gains found is stable", None, found)


def _inside(score: Score, axes: tuple[Axis, Axis], stable: NDArray[np.bool_]) -> Score:
    """The score where the nearest point of the grid is stable, inf elsewhere."""

    def inside(K1: Real, K2: Real) -> Real:
        places = [
            np.clip((axis.share(gain) * number).astype(int), 0, number - 1)
            for axis, gain, number in zip(axes, (K1, K2), stable.shape[::-1], strict=True)
        ]
        good = stable[places[1], places[0]]
        values = np.full(K1.size, np.inf)
        if good.any():
            values[good] = score(K1[good], K2[good])
        return values

    return inside


def _law(axes: tuple[Axis, Axis], shares: Real, Kp: float) -> HubFeedback:
    K1, K2 = (float(axis.gain(share)) for axis, share in zip(axes, shares, strict=True))
    return HubFeedback(K1=K1, K2=K2, Kp=Kp)


def _checked(name: str, bounds: Bounds) -> Bounds:
    low, high = (float(value) for value in bounds)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ParameterError(key=name, value=bounds, remedy="bounds are two finite numbers, the lower first")
    return low, high


def _score(arm: Arm, objective: str, Kp: float, modes: int) -> Callable[[Real, Real], Real]:
    """What is minimised, for arrays of K1 and K2."""
    rest = HubFeedback(Kp=Kp)
    if objective == "damping":
        return lambda K1, K2: -least_damping(arm, many_laws(rest, K1=K1, K2=K2), modes)
    if objective == "residual":
        return lambda K1, K2: residual_moment(arm, many_laws(rest, K1=K1, K2=K2), modes)
    band = band_of(arm, modes)
    omega = np.asarray(grid(arm, band))

    def disk(K1: Real, K2: Real) -> Real:
        laws = many_laws(rest, K1=K1, K2=K2)
        size = np.array([_disk(Loop(arm, law_of(law)), omega) for law in laws.T])
        return -size - TIE * least_damping(arm, laws, modes)

    return disk


def _holds(arm: Arm, law: HubFeedback) -> bool:
    try:
        return stability(arm, law).is_stable
    except ConvergenceError:  # on the edge
        return False


def _disk(loop: Loop, omega: Real) -> float:
    return float(disk_at(loop, omega).min())


def _flat(score: Score, gains: tuple[float, float], best: float, axis: int, bounds: Bounds) -> Bounds:
    """Between which values of one gain the score stays within `FLAT` of the best, the other held.

    Walked outwards in steps that grow by three tenths, then halved: narrow valleys are seen as well as wide ones.
    """
    limit, centre = best + FLAT * abs(best), gains[axis]

    def good(values: Real) -> NDArray[np.bool_]:
        held = [np.full(values.size, gain) for gain in gains]
        held[axis] = values
        return np.asarray(score(*held) <= limit)

    ends = []
    for bound in bounds:
        way = np.geomspace(1e-9, 1.0, 80) * (bound - centre)
        (bad,) = np.nonzero(~good(centre + way * (1 - END)))
        if not bad.size:
            ends.append(bound)
            continue
        low, high = (way[bad[0] - 1] if bad[0] else 0.0), way[bad[0]]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if good(np.array([centre + middle]))[0] else (low, middle)
        ends.append(centre + float(low))
    return ends[0], ends[1]
