"""Which gains?  The best K1, K2 (and Kp), judged by the sampled loop of the exact arm or by the continuous one.

A grid over the bounds first, its minima refined together (`search`).  Gains that are not stable never win.  How flat
the optimum is, and whether it is one or only where the bounds cut the search off, is part of the answer.  Bounds that
nobody asked for are widened as long as the best gains lie on them: K2 < 0 until what it leaves of the hub's inertia,
I_h/(1 - K2), is a sixty-fourth; not below K1 = 0, where the law drives the hub, nor above the K2 at which it holds it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback, as_law
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.dsp.chain import chain_or_usual
from tfarm.dsp.verdict import SampledBrief, sampled_brief
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.frequencies import band_of
from tfarm.loop.loop import Loop
from tfarm.loop.stability import Stability, stability
from tfarm.records import record
from tfarm.spectrum.scales import check_gains, rate_unit, turning_inertia
from tfarm.synthesis.continuous import ContinuousJudge
from tfarm.synthesis.sampled import sampled_judges
from tfarm.synthesis.search import (
    AXIS_END,
    POLISHED,
    Bounds,
    Found,
    GainAxis,
    Score,
    by_simplex,
    minima,
    refined,
    searched_rates,
)
from tfarm.synthesis.together import Judge, OnArm, Worst, in_step, score_of, worst_value
from tfarm.synthesis.worst_case import WITHOUT_BOX, NamedArm, WorstCase

Objective = Literal["damping", "margin", "residual", "cost"]
LoopKind = Literal["sampled", "continuous"]

GAIN_OBJECTIVES: tuple[Objective, ...] = get_args(Objective)
FLAT_WITHIN = 0.01  # gains whose value is worse by less than this share bound the flat part
AT_BOUND = 1e-3  # share of an axis: an optimum so near to its end is where the bound is
SIMPLEX_SIZE = 2.0**-8  # of a step of the grid: its first size
INTERVAL_HALVINGS = 40  # of an interval, for the ends of the flat part and the way back into the stable region
WIDENINGS = 4  # K1 to 16 times its bound, 1 - K2 likewise
PHYSICAL_ENDS = (("K1", 0), ("K2", 1))  # ends of the usual bounds that are physical ones


@dataclass(frozen=True)
@record
class Design:
    """The best law, its value (damping ratio, disk margin, or residual moment [N m]), its verdict, and how flat it is.

    `loop` is what it was designed for: the "sampled" loop of `chain` or the "continuous" one; `verdict` is that of the
    continuous loop, `sampled` that of the sampled one, both of the arm itself; `arms` has them for each arm that it was
    chosen for, the arm itself first, and `value` is the worst among them.  `flat_K1` and `flat_K2` are the gains
    between which, the other held, the value is within one per cent of the best.  `widened` names the gains whose bounds
    were widened to `bounds`; `at_bound` those that lie at an end of them even so: there the search was cut off, and the
    value is no optimum; `at_limit` those of them that are at a physical end, K1 = 0 or the K2 = 1 that stops the hub.
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
    at_limit: tuple[str, ...]
    widened: tuple[str, ...]
    loop: LoopKind
    chain: Chain
    sampled: SampledBrief
    arms: tuple[OnArm, ...]
    worst_case: WorstCase = WITHOUT_BOX


class _Best(NamedTuple):
    """Both gains and their score."""

    gains: tuple[float, float]
    score: float


def best_gains(
    arm: Arm, objective: Objective = "damping", *, K1: Bounds | None = None, K2: Bounds | None = None,
    Kp: float = 0.0, modes: int = 2, chain: Chain | None = None, continuous: bool = False,
    others: Sequence[NamedArm] = (),
) -> Design:  # fmt: skip
    """The gains that serve an objective best within bounds, in the sampled loop of a chain (10 ms unless given).

    "damping" maximises the least damping ratio of the oscillating poles of the first `modes` modes; "margin" the disk
    margin; "residual" minimises the root moment left after the slew, "cost" what the tuner's trial costs with constant
    gains.  What is recommended holds when sampled, with every mode that its verdict takes, and with all gains a quarter
    larger or smaller.  `continuous`: of the continuous loop instead; gains that are best there need not hold when
    sampled.  With `others` the objective is the worst of the arms, all of which hold; references and feed-forward are
    made for the arm itself.  Raises ParameterError for a bad objective or bounds, ConvergenceError if no gains within
    the bounds are stable.
    """
    if objective not in GAIN_OBJECTIVES:
        raise ParameterError(key="objective", value=objective, remedy=f"use one of {', '.join(GAIN_OBJECTIVES)}")
    if objective == "cost" and continuous:
        remedy = "the cost of the tuner's trial is one of samples: leave the continuous loop out"
        raise ParameterError(key="objective", value=objective, remedy=remedy)
    chain, held = chain_or_usual(chain), HubFeedback(Kp=Kp)
    arms = (NamedArm(arm.name, arm, {}), *others)
    start = _bounds_at_first(arms, K1, K2, held)
    free = {name: bounds is None for name, bounds in (("K1", K1), ("K2", K2))}
    judges = [_judges(each.arm, arm, chain, objective, held, modes, continuous) for each in arms]
    judge, bounds, best = _first_that_holds(map(Worst, in_step(judges)), arm, start, free, held)
    law = held.at(*best.gains)
    on_arms = tuple(
        OnArm(each.name, each.numbers, value, stability(each.arm, law), sampled_brief(each.arm, law, chain))
        for each, value in zip(arms, judge.values(law), strict=True)
    )
    ends = _ends(arm, bounds, best)
    flat = _flat(judge.score, best, bounds)
    return Design(
        objective=objective, law=law, value=worst_value(objective, [each.value for each in on_arms]),
        verdict=on_arms[0].verdict, bounds=bounds,
        flat_K1=flat[0], flat_K2=flat[1], modes=modes, at_bound=tuple(name for name, _ in ends),
        at_limit=tuple(name for name, end in ends if free[name] and (name, end) in PHYSICAL_ENDS),
        widened=tuple(name for name in bounds if bounds[name] != start[name]),
        loop="continuous" if continuous else "sampled", chain=chain, sampled=on_arms[0].sampled,
        arms=on_arms,
    )  # fmt: skip


def _bounds_at_first(
    arms: Sequence[NamedArm], K1: Bounds | None, K2: Bounds | None, held: HubFeedback
) -> dict[str, Bounds]:
    """The bounds of the gains, the usual ones of the first arm where none are given.

    Raises ParameterError for what is no bounds, for an arm without a loop, and for gains too large for one.
    """
    arm, unit = arms[0].arm, arms[0].arm.input_per_torque
    for each in arms:
        Loop(each.arm, as_law(held.at(1.0, 0.0 if each.arm.has_massless_hub else 0.5 * unit)))
    bounds = {
        "K1": _checked("K1", K1 or (0.0, 2.0 * turning_inertia(arm) * band_of(arm, 1))),
        "K2": _checked("K2", K2 or (-3.0 * unit, 1.0 * unit)),
    }
    for across, up in zip(bounds["K1"], bounds["K2"], strict=True):
        for each in arms:
            check_gains(each.arm, held.at(across, up))
    return bounds


def _judges(
    arm: Arm, known: Arm, chain: Chain, objective: str, held: HubFeedback, modes: int, continuous: bool
) -> Iterator[Judge]:
    """Judges of gains on an arm, of ever more modes; `known` is what the slew is made for."""
    if continuous:
        return iter([ContinuousJudge(arm, objective, held, modes, known, chain.slew)])
    return sampled_judges(arm, chain, objective, held, modes, known)


def gains_score_on(found: Design, arm: Arm) -> float:
    """What a design minimised, on another arm; inf where the loop does not hold."""
    law, known = found.law, found.verdict.loop.arm
    judge = next(_judges(arm, known, found.chain, found.objective, law, found.modes, found.loop == "continuous"))
    if found.loop == "continuous" and not judge.holds(law):
        return math.inf
    return score_of(judge, law)


def _first_that_holds(
    judges: Iterable[Worst], arm: Arm, bounds: dict[str, Bounds], free: dict[str, bool], held: HubFeedback
) -> tuple[Worst, dict[str, Bounds], _Best]:
    """The best gains by the first judge whose gains hold.  Raises ConvergenceError where those of none do."""
    lost = None
    for judge in judges:
        try:
            return judge, *_widened(judge, arm, bounds, free, held)
        except ConvergenceError as error:
            lost = error
    raise lost or AssertionError("no judge")


def _widened(
    judge: Worst, arm: Arm, bounds: dict[str, Bounds], free: dict[str, bool], held: HubFeedback
) -> tuple[dict[str, Bounds], _Best]:
    """The best gains, and the bounds widened wherever they lie on one that is free: only what is new is searched."""
    best = _best(judge, arm, bounds, held)
    for _ in range(WIDENINGS):
        ends = [each for each in _ends(arm, bounds, best) if free[each[0]] and each not in PHYSICAL_ENDS]
        if not ends:
            break
        name, end = ends[0]
        low, high = bounds[name]
        wider = (low, 2 * high) if end else (arm.input_per_torque - 2 * (arm.input_per_torque - low), high)
        new = (high, wider[1]) if end else (wider[0], low)
        try:
            beyond = _best(judge, arm, bounds | {name: new}, held)
        except ConvergenceError:  # nothing holds there
            beyond = best
        bounds = bounds | {name: wider}
        best = min(best, beyond, key=lambda each: each.score)
    return bounds, best


def _ends(arm: Arm, bounds: dict[str, Bounds], best: _Best) -> list[tuple[str, int]]:
    """The gains that lie at an end of their bounds, and at which, 0 or 1."""
    axes, found = _axes(arm, bounds), []
    for name, axis, gain in zip(bounds, axes, best.gains, strict=True):
        share = float(axis.share(np.array(gain)))
        if min(share, 1 - share) < AT_BOUND:
            found.append((name, int(share > 0.5)))
    return found


def _axes(arm: Arm, bounds: dict[str, Bounds]) -> tuple[GainAxis, GainAxis]:
    return searched_rates(bounds["K1"], rate_unit(arm)), GainAxis(*bounds["K2"])


def _best(judge: Worst, arm: Arm, bounds: dict[str, Bounds], held: HubFeedback) -> _Best:
    """The best gains that hold.  Raises ConvergenceError where none are stable."""
    axes, effort = _axes(arm, bounds), judge.effort(bounds["K2"])
    values, score = judge.landscape(axes, effort)
    if not np.isfinite(values).any():
        text = "K1 in ({:g}, {:g}) and K2 in ({:g}, {:g})".format(*bounds["K1"], *bounds["K2"])
        raise ConvergenceError(f"no gains with {text} are stable: widen the bounds", None, values)
    places = minima(values, effort.starts)[:, ::-1]
    shares = [axis.middles(number) for axis, number in zip(axes, effort[:2], strict=True)]
    starts = np.stack([share[places[:, i]] for i, share in enumerate(shares)], axis=1)
    steps = 1 / np.array(effort[:2])
    found = sorted(refined(score, axes, starts, steps), key=lambda each: each.score)
    size = SIMPLEX_SIZE * float(steps.min())
    found = by_simplex(score, axes, found[:POLISHED], size) + found[POLISHED:]
    grid_best = [Found(start, float(values[row, column])) for start, (column, row) in zip(starts, places, strict=True)]
    for each in sorted([*found, *grid_best], key=lambda each: each.score):
        across, up = (float(axis.gain(share)) for axis, share in zip(axes, each.shares, strict=True))
        if np.isfinite(each.score) and judge.holds(held.at(across, up)):
            return _Best((across, up), each.score)
    raise ConvergenceError("none of the best gains found is stable", None, found)


def _checked(name: str, bounds: Bounds) -> Bounds:
    low, high = (float(value) for value in bounds)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ParameterError(key=name, value=bounds, remedy="bounds are two finite numbers, the lower first")
    return low, high


def _flat(score: Score, best: _Best, bounds: dict[str, Bounds]) -> list[Bounds]:
    """Between which values of each gain the score stays within `FLAT_WITHIN` of the best, the other held.

    Walked outwards in steps that grow by three tenths, then halved: narrow valleys are seen as well as wide ones.  All
    four ways at once.
    """
    limit, centre = best.score + FLAT_WITHIN * abs(best.score), np.array(best.gains)
    along = np.repeat(np.arange(centre.size), 2)  # of each way, which gain changes
    limits = np.array([end for ends in bounds.values() for end in ends])

    def good(way: Real, which: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Of steps (k, n) along some of the ways."""
        points = np.repeat(centre[:, None], way.size, axis=1).reshape(-1, *way.shape)
        points[along[which], np.arange(which.size)] += way
        return np.asarray(score(points.reshape(centre.size, -1)) <= limit).reshape(way.shape)

    steps = np.geomspace(1e-9, 1.0, 80) * (limits - centre[along])[:, None]
    bad = ~good(steps * (1 - AXIS_END), np.arange(along.size))
    (cut,) = np.nonzero(bad.any(axis=1))
    if cut.size:
        first = bad[cut].argmax(axis=1)
        low, high = np.where(first > 0, steps[cut, first - 1], 0.0), steps[cut, first]
        for _ in range(INTERVAL_HALVINGS):
            middle = (low + high) / 2
            holds = good(middle[:, None], cut)[:, 0]
            low, high = np.where(holds, middle, low), np.where(holds, high, middle)
        limits[cut] = centre[along[cut]] + low
    K1_low, K1_high, K2_low, K2_high = limits.tolist()
    return [(K1_low, K1_high), (K2_low, K2_high)]
