"""How far a sampled loop is from its edges in delay and in damping, and how many modes it takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq

from tfarm.arm import AnyLaw, Arm
from tfarm.dsp.chain import Chain
from tfarm.dsp.discretise import acting_law, with_all_gains
from tfarm.dsp.plant import Branching
from tfarm.dsp.sampled import Sampled, sampled_loop
from tfarm.dsp.sampling import FORGOTTEN, held_amplitude
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum import modes_below
from tfarm.spectrum.damped import COMPANY, LITTLE, Branches, all_damped_modes
from tfarm.spectrum.scales import first_frequency

LONGEST_DELAY_SAMPLES = 20.0  # samples: the delay margin is looked for up to here
MOST_STEPS = 2000  # of a scan of the delay
LONGEST_SCAN_STEP, STEPS_A_TURN = 0.05, 12  # samples, and steps in a turn of the fastest mode that may be driven
PUSH_ROOM = 4  # times what the feedback pushes a pole by to first order: what damps itself more than that is not driven
DELAY_KNOWN = 1e-10  # samples: to so much a delay margin is solved for
CLEARLY = 1e-6  # within the circle: an eigenvalue there is not polished, as even a double one is right to 1e-7
KEPT_BEYOND = 2  # modes kept beyond the last one that outlives a sample
MODES_BEYOND = 4  # those of a whole loop that do not outlive a sample
MOST_LOOP_MODES = 128  # of a whole loop: half a second of work
FEWER_SHARES = (0.85, 0.72, 0.61, 0.54)  # of these, tried in turn where two damped modes cannot be told apart
SURELY_OVERDAMPED = 2.5  # C w from which on a mode surely is: following it further costs a hundred times as much
FAR_BEYOND = 5.0  # of critical in the first mode: all poles of bending lie left of any line, one mode shows it as well
STRONGEST = 0.15  # of critical in the first mode: no stronger damping is looked at
DAMPING_MODES = 40  # of the loop in which a required damping is looked for, where no number is said
DAMPING_DECADES = 16  # down from there
DAMPING_XTOL, DAMPING_RTOL, MADE_SURE = 1e-7, 4e-7, 1e-6  # relative: C is solved for to the first two, then raised
NUDGES = (0.0, 1e-6, -1e-6)  # of C, tried in turn where two damped modes are one at it


@dataclass(frozen=True)
@record
class DelayMargin:
    """`samples` of further delay that the loop bears; `is_bound` where none up to there makes it unstable."""

    samples: float
    is_bound: bool


def delay_margin(loop: Sampled) -> DelayMargin:
    """How many samples of further delay, any fraction, until a stable loop is stable no more; 0 if it is not stable.

    Scanned finely enough for the fastest mode that the loop can drive unstable, then bisected to 1e-10.
    """
    now = loop.chain.sampling.delay_samples

    def log_radius(more: float) -> float:
        return loop.with_delay(now + more).poles.log_spectral_radius

    def grows(more: float) -> bool:
        later = loop.with_delay(now + more)
        near = abs(later.eigenvalues) > 1 - CLEARLY
        return bool(near.any()) and later.polished(near).log_spectral_radius >= 0

    if log_radius(0.0) >= 0:
        return DelayMargin(0.0, False)
    plant, T = loop.plant, loop.chain.sampling.period
    reach = PUSH_ROOM * loop.push * abs(held_amplitude(plant.poles, T))
    risky = (reach > -plant.poles.real * T) & (plant.poles.imag > 0)  # whose own damping the feedback could outweigh
    fastest = (plant.poles.imag[risky] * T).max(initial=np.pi / 4)
    step = float(min(LONGEST_SCAN_STEP, 2 * np.pi / fastest / STEPS_A_TURN))  # samples
    for i in range(1, MOST_STEPS + 1):
        if i * step > LONGEST_DELAY_SAMPLES:
            break
        low, high = (i - 1) * step, i * step
        if grows(high) and log_radius(high) >= 0:  # a pole on the circle but for rounding is on either side
            is_between = log_radius(low) < 0
            return DelayMargin(float(brentq(log_radius, low, high, xtol=DELAY_KNOWN)) if is_between else low, False)
    return DelayMargin(min(MOST_STEPS * step, LONGEST_DELAY_SAMPLES), True)


def required_damping(arm: Arm, law: AnyLaw, chain: Chain, *, count: int = DAMPING_MODES) -> float:
    """The smallest C [s] from which on the loop of this law is stable on this arm (its own C is set aside).

    0 where it is stable without damping, inf where none up to 15 % of critical in the first mode helps.
    """
    return damping_edge(sampled_loop(arm.elastic, law, chain, count=count), Branches(LITTLE))


def damping_edge(loop: Sampled, branches: Branching) -> float:
    """`required_damping` of an undamped loop, with its number of modes.

    Every decade is looked at from the strongest C down, so that larger ones on that grid are stable too; the edge is
    found to 1e-6.
    """

    @cache
    def log_radius(C: float) -> float:
        return log_radius_with(loop, C, loop.plant.count, branches)

    if loop.poles.is_stable:
        return 0.0
    high = 2 * STRONGEST / first_frequency(loop.plant.arm)
    if log_radius(high) >= 0:
        return math.inf
    for _ in range(DAMPING_DECADES):
        low = high / 10
        if log_radius(low) >= 0:  # a radius is nearly linear in C where C is small
            C = float(brentq(log_radius, low, high, xtol=DAMPING_XTOL * low, rtol=DAMPING_RTOL))
            return C * (1 + MADE_SURE)
        high = low
    return high


def log_radius_with(loop: Sampled, C: float, count: int, branches: Branching) -> float:
    """The log spectral radius at C; where two damped modes are one there, at a C that differs by 1e-6.

    Modes that a strong C has settled before the next sample, or overdamped, are left to the remainder, but for a few.
    """
    arm = loop.plant.arm
    outliving = min(alive(arm.having(damping=C), loop.chain), modes_below(arm, SURELY_OVERDAMPED / C))
    for nudge in NUDGES:
        try:
            damped = loop.on(arm.having(damping=C * (1 + nudge)), min(count, KEPT_BEYOND + outliving), branches)
        except ConvergenceError:
            if nudge < 0:
                raise
            continue
        return damped.poles.log_spectral_radius
    raise AssertionError("unreachable")


def alive(arm: Arm, chain: Chain) -> int:
    """How many bending modes of a damped arm outlive the rest of a sample: C w^2 T (1 - f)/2 below 40."""
    remaining = chain.sampling.period * (1 - chain.sampling.fraction)
    return modes_below(arm, math.sqrt(2 * FORGOTTEN / (arm.least_damping * remaining)))


def most_modes(arm: Arm, chain: Chain) -> int:
    """The most that a loop has: of a damped arm those that outlive a sample and ring, and a few; never more than 128.

    What is overdamped has its slow poles beside -1/C, where the remainder has them too.
    """
    if not arm.least_damping:
        return MOST_LOOP_MODES
    outliving = min(alive(arm, chain), modes_below(arm, SURELY_OVERDAMPED / arm.least_damping))
    return min(MOST_LOOP_MODES, MODES_BEYOND + outliving)


def whole_loop(arm: Arm, law: AnyLaw, chain: Chain, branches: Branching = all_damped_modes) -> Sampled:
    """The loop of a damped arm with every mode that outlives a sample and a few, or the first 128.

    With somewhat fewer where two damped modes cannot be told apart; with one where the first is far overdamped.
    Raises ConvergenceError where not even that one can be followed.
    """
    criticals = arm.damping * first_frequency(arm) / 2
    most = most_modes(arm, acting_law(arm, with_all_gains(arm, law), chain)[1])
    numbers = [most, *(int(share * most) for share in FEWER_SHARES)]
    if criticals > FAR_BEYOND:
        numbers, branches = [1], Branches(COMPANY[:1])
    for number in numbers:
        try:
            return sampled_loop(arm, law, chain, count=max(1, number), branches=branches)
        except ConvergenceError as error:
            lost = error
    where = f"C = {arm.damping:g} s, {criticals:.3g} times critical in the first mode"
    raise ConvergenceError(f"modes cannot be followed to {where}: {lost}", lost.best, lost.residual)
