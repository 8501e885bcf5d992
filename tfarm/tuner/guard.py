"""The guard: the interval that the gain is kept in, and what is proven of it.

    time-varying   a sector [lo, hi] in which K may move from sample to sample as it likes: proven (see `sector`)
    frozen         the interval of constant gains that leave the loop stable.  Nothing is proven for a K that moves:
                   switching between two such gains can drive the loop unstable
    none           the plain softplus, K >= 0

A proven sector gives a contraction, so bounded references, and rounding by converters, leave bounded signals whatever
K(t) does in it; a torque or a moment that saturates is not covered.  The proof is of the arm, servo, sampling and
delay it was made for, with the modes that it names.  Where the hub's angle is held, it is one of the states that
contract: it follows its reference however K moves.

The network's gain kappa = ln(1 + e^z) is bent into the interval by K = lo + (hi - lo)(1 - e^-kappa), which is
lo + (hi - lo)/(1 + e^-z): smooth, so that the gradient sees it.

Which sector?  They slide: the larger the middle gain, the wider.  The default is the widest that holds the best
constant gain at least a tenth of its width away from its ends, or the one that comes nearest to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.dsp import Sampled, sampled_loop, stable_windows
from tfarm.dsp.crossings import around
from tfarm.dsp.sampling import held_amplitude
from tfarm.errors import CertificationError, ConvergenceError, must_be_known
from tfarm.records import record
from tfarm.tuner.kernel import Limits
from tfarm.tuner.sector import RADIUS_SHARE, CommonLyapunov, MovingGain

GuardKind = Literal["time-varying", "frozen", "none"]
GUARD_KINDS: tuple[GuardKind, ...] = get_args(GuardKind)

INSIDE = 0.8  # of half the width: how far the best constant gain may be from the middle
MOST_GAIN = 10.0  # where the frozen interval has no upper end
MIDDLE_GAINS = 60  # gains of a window that a sector is tried around
NARROWEST_SECTOR = 1e-4  # a sector this narrow is none
SECTORS_AGREE = 1e-3  # of the width: how little more modes may change it
SECTOR_TRIES, SECTOR_SHRINKS = 6, 0.9  # widths for which a proof is tried, each so much narrower than the one before
MIDDLE_HALVINGS = 12  # of the step between two middles: to a part of it that no guard tells
TIMES_THE_MODES = (4, 3, 2)  # of the loop: how many a larger one has, the first of which modes can be told apart
GUARD_MODES_UNDAMPED = 20  # of the larger loop that a guard is held against at C = 0
MOST_GUARD_MODES = 48  # of that at C > 0
REMEDY_DAMPINGS = np.geomspace(1e-12, 1e-2, 11)  # s, tried for the remedy


@dataclass(frozen=True)
@record
class Guard:
    """K stays in [lo, hi] (inf: no upper end).

    `modes_used` flexible modes were looked at, `is_settled` says that more do not change it.  `proofs`, of the
    time-varying kind only: a Lyapunov function of every model that was looked at.
    """

    kind: GuardKind
    lo: float
    hi: float
    modes_used: int
    is_settled: bool
    proofs: tuple[CommonLyapunov, ...] = ()

    @property
    def is_proven(self) -> bool:
        """Whether the loop is proven stable for every K(t) in it, and not that of its first modes alone."""
        return bool(self.proofs) and self.is_settled

    @property
    def limits(self) -> Limits:
        """As `kernel.guarded` takes it."""
        return Limits(self.lo, self.hi)

    @property
    def sentence(self) -> str:
        """What is proven, in words."""
        if self.kind == "none":
            return "no guard: K >= 0, nothing is proven"
        held = "more change nothing" if self.is_settled else "not settled: it holds for these alone"
        modes = f"{self.modes_used} modes, {held}"
        if self.kind == "frozen":
            return (
                f"[{self.lo:.4g}, {self.hi:.4g}]: stable for every constant K, not proven for one that moves ({modes})"
            )
        rate = max(proof.contraction for proof in self.proofs)
        what = "proven" if self.is_settled else f"proven for the first {self.modes_used} modes"
        return f"[{self.lo:.4g}, {self.hi:.4g}]: {what} for any K(t), shrinking by {1 - rate:.2g} a sample ({modes})"


def find_guard(loop: Sampled, kind: GuardKind, best_constant: float) -> Guard:
    """The guard of a loop (its servo, chain and modes); its moment gain does not matter.

    Raises CertificationError where there is none, with the damping that would have one.
    """
    must_be_known("guard", kind, GUARD_KINDS)
    if kind == "none":
        return Guard("none", 0.0, math.inf, loop.plant.count, False)
    loops = list(_larger(loop))
    guard = _frozen(loops, best_constant) if kind == "frozen" else _moving(loops, best_constant)
    if guard is None:
        raise CertificationError(_remedy(loop, kind))
    return guard


def constant_windows(loop: Sampled) -> list[tuple[float, float]]:
    """The intervals of constant gains K >= 0, up to 10, that leave the loop stable."""
    return [(max(low, 0.0), min(high, MOST_GAIN)) for low, high in stable_windows(loop, MOMENT_GAIN) if high > 0]


def _frozen(loops: list[Sampled], best_constant: float) -> Guard | None:
    """The interval that holds in every model, without its outermost hundredth."""
    found = []
    for loop in loops:
        windows = constant_windows(loop)
        if not windows:
            return None
        found.append(around(windows, best_constant) or min(windows, key=lambda w: abs(sum(w) / 2 - best_constant)))
    low, high = max(low for low, _ in found), min(high for _, high in found)
    edge = (1 - RADIUS_SHARE) * (high - low)
    if high - low < NARROWEST_SECTOR:
        return None
    return Guard("frozen", low + edge * (low > 0), high - edge, loops[-1].plant.count, _settled(loops, found))


def _moving(loops: list[Sampled], best_constant: float) -> Guard | None:
    """The sector of the default rule, proven in every model; narrower where the proof needs it."""
    models = [MovingGain(loop) for loop in loops]
    m = _middle(models[0], best_constant)
    if m is None:
        return None
    radii = [model.radius(m) for model in models]
    found = [(m - radius, m + radius) for radius in radii]
    share = RADIUS_SHARE
    for _ in range(SECTOR_TRIES):
        half = share * min(radii)
        lo, hi = max(0.0, m - half), m + half
        if half < NARROWEST_SECTOR:
            return None
        proofs = [model.proof(lo, hi) for model in models]
        if all(proofs):
            whole = tuple(proof for proof in proofs if proof is not None)
            return Guard("time-varying", lo, hi, loops[-1].plant.count, _settled(loops, found), whole)
        share *= SECTOR_SHRINKS
    return None


def _middle(model: MovingGain, best_constant: float) -> float | None:
    """The middle gain of the default rule; None where no gain is stable."""
    windows = constant_windows(model.loop)
    middles = np.array([m for low, high in windows for m in np.linspace(low, high, MIDDLE_GAINS + 2)[1:-1]])
    radii = np.array([model.radius(float(m)) for m in middles])
    if not (radii > NARROWEST_SECTOR).any():
        return None
    beyond = abs(best_constant - middles) - INSIDE * radii
    holds = beyond <= 0
    if not holds.any():
        return float(middles[int(np.argmin(beyond))])
    best = int(np.argmax(np.where(holds, radii, -1.0)))
    inner, outer = float(middles[best]), float(middles[min(best + 1, middles.size - 1)])
    for _ in range(MIDDLE_HALVINGS):  # up to where the best constant gain just is inside
        m = (inner + outer) / 2
        radius = model.radius(m)
        if abs(best_constant - m) <= INSIDE * radius and radius >= radii[best]:
            inner = m
        else:
            outer = m
    return inner


def _settled(loops: list[Sampled], found: list[tuple[float, float]]) -> bool:
    """Whether more modes changed nothing, and the modes left out are too damped to be driven.

    At C = 0 that can never be said.
    """
    if loops[0].plant.arm.is_undamped or len(found) < 2:
        return False
    (before_low, before_high), (low, high) = found
    agree = max(abs(low - before_low), abs(high - before_high)) <= SECTORS_AGREE * (high - low)
    return agree and upper_modes_are_quiet(loops[-1], high)


def upper_modes_are_quiet(loop: Sampled, highest: float) -> bool:
    """Whether the upper half of the modes lose more in a sample by themselves than the feedback could give them."""
    plant, T = loop.plant, loop.chain.sampling.period
    fed_back = loop.having(**{MOMENT_GAIN: highest}).push
    push = 2 * fed_back * abs(held_amplitude(plant.poles, T))
    upper = (plant.mode > plant.count // 2) & (plant.poles.imag > 0)
    return bool((push[upper] < -plant.poles.real[upper] * T).all())


def _larger(loop: Sampled) -> Iterator[Sampled]:
    """The loop, and the same with four times the modes; at C = 0 with twenty.

    Three times or twice, where two of the damped modes cannot be told apart.
    """
    yield loop
    arm, count = loop.plant.arm, loop.plant.count
    wanted = tuple(times * count for times in TIMES_THE_MODES) if arm.damping else (GUARD_MODES_UNDAMPED,)
    for number in (min(number, MOST_GUARD_MODES) for number in wanted):
        if number <= count:
            return
        try:
            more = loop.with_modes(number)
        except ConvergenceError:
            continue
        yield more
        return


def _remedy(loop: Sampled, kind: str) -> str:
    """Why there is no guard, and the smallest damping tried that has one."""
    arm = loop.plant.arm
    what = "no sector of moving gains" if kind == "time-varying" else "no constant gain"
    served = [name for name in (RATE_GAIN, ANGLE_GAIN) if name == RATE_GAIN or loop.number(name)]
    at = ", ".join(loop.gains.told(name, "{:g}".format) for name in served)
    start = f"{arm.name}: {what} is proven stable at {at}, C = {arm.damping:g} s"
    for C in REMEDY_DAMPINGS[arm.damping < REMEDY_DAMPINGS]:
        if _has_guard(arm.having(damping=float(C)), loop, kind):
            return f"{start}; with a damping of C = {C:.1e} s there is one"
    remedy = f"take another {RATE_GAIN}, or a shorter period or delay"
    return f"{start}, nor with any damping up to {REMEDY_DAMPINGS[-1]:g} s; {remedy}"


def _has_guard(arm: Arm, loop: Sampled, kind: str) -> bool:
    try:
        first = sampled_loop(arm, loop.gains, loop.chain, count=loop.plant.count)
        if not constant_windows(first):
            return False
        loops = list(_larger(first))
    except ConvergenceError:
        return False
    if kind == "frozen":
        guard = _frozen(loops, 0.0)
        return guard is not None and guard.is_settled
    models = [MovingGain(each) for each in loops]
    m = _middle(models[0], 0.0)
    if m is None:
        return False
    radii = [model.radius(m) for model in models]
    sectors = [(m - radius, m + radius) for radius in radii]
    return RADIUS_SHARE * min(radii) > NARROWEST_SECTOR and _settled(loops, sectors)
