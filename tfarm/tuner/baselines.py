"""Baselines of a gain that moves: the best constant gain, input shaping, and the bound that no controller passes.

The *bound* is the finite-horizon linear-quadratic optimum, with the full state and preview of the slew:

    minimise T sum of a x_k^2/2 + b e_k^2/2,   s_{k+1} = A s_k + B (e_k + r_k),   x_k = c s_k - m_k,   s_0 = 0

with r (feedforward not counted in u) and m (what is taken off the moment) known beforehand.  The value of the remaining
samples is s^T P s/2 + q^T s + a constant, and e_k = -(B^T P (A s + B r) + B^T q)/(T b + B^T P B).  It bounds
every e(t), for this arm, slew, sampling and cost, whatever network, gain or law makes it.

*Input shaping* is on the exact sampled poles of the loop.  The reference is passed through a few impulses whose sum
vanishes at the poles z of the modes that it is not to excite (Singer and Seering, 1990).  On the sample grid a
zero-vibration shaper (ZV) has three impulses: now, n and n + 1 samples later, with n the whole samples of half
a period:

    c_0 + c_n z^-n + c_{n+1} z^-(n+1) = 0,   c_0 + c_n + c_{n+1} = 1

exactly zero for that mode of the linear loop, whatever the period.  The extra-insensitive one (EI; Singhose, Seering
and Singer, 1994) lets a share V of the vibration remain at the mode itself, and is zero at two frequencies beside it,
w (1 +- d) with cos(pi d) = (1 - V)/(1 + V): two ZV shapers in a row.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.arm import MOMENT_GAIN
from tfarm.arrays import Real
from tfarm.dsp import Sampled, Scenario
from tfarm.dsp.chain import TIME_ROUNDING
from tfarm.tuner import kernel
from tfarm.tuner.guard import constant_windows
from tfarm.tuner.trial import Record, Trial

CONSTANT_GAINS = 200  # constant gains of a window that are tried, before the best are refined
LEAST_GAINS = 20  # of them where trials are long
GAIN_SAMPLES = 2_000_000  # that the trials of a window's gains may have together
BEST_REFINED = 3  # of them
GAIN_XTOL = 1e-9  # to so much they are refined: a cost is flat there, so that the last digits say nothing
Shaper = Literal["ZV", "EI"]
SHAPERS: tuple[Shaper, ...] = ("ZV", "EI")
SHAPED_MODES = 2  # which a slew excites most
TOLERATED = 0.05  # V: the share of the vibration that EI leaves at the mode itself, as its authors have it
NEARLY_PI = 0.999  # of pi rad a sample: the fastest frequency beside a mode that a shaper can have


class BestConstant(NamedTuple):
    """The gain, and the trial's cost with it."""

    gain: float
    cost: float


def tried_gains(samples: int) -> int:
    """How many constant gains of a window are tried in trials of so many samples."""
    return min(CONSTANT_GAINS, max(LEAST_GAINS, GAIN_SAMPLES // samples))


def best_constant(trial: Trial) -> BestConstant:
    """The best constant gain K >= 0 among those that leave the loop stable: all of a grid, the three lowest refined.

    Where no constant gain is stable, K = 0.
    """
    windows = constant_windows(trial.loop)
    number = tried_gains(trial.n)
    found = [BestConstant(0.0, trial.with_constant(0.0).cost)] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, number + 2)[1:-1]
        costs = np.array([trial.with_constant(float(K)).cost for K in gains])
        step = (high - low) / (number + 1)
        for i in np.argsort(costs)[:BEST_REFINED]:
            done = minimize_scalar(
                lambda K: trial.with_constant(float(K)).cost,
                bounds=(max(float(gains[i]) - step, low), min(float(gains[i]) + step, high)),
                method="bounded",
                options={"xatol": GAIN_XTOL},
            )
            found.append(BestConstant(float(done.x), float(done.fun)))
    return min(found, key=lambda each: each.cost)


def lq_bound(trial: Trial) -> Record:
    """The optimal trial; its K is zero, for it is no moment feedback, and its u is e."""
    rest, rigid = trial.reference.rest, trial.reference.rigid
    gains, (offsets, x, e, moment) = np.zeros((trial.n, trial.model.B.size)), np.zeros((4, trial.n))
    kernel.optimal(trial.model, rest, rigid, trial.numbers, gains, offsets)
    kernel.controlled(trial.model, rest, rigid, gains, offsets, x, e, moment)
    cost = float(trial.numbers.T * np.sum(trial.cost.a * x**2 + trial.cost.b * e**2) / 2)
    return Record(trial.task.t, x, e, e, np.zeros(trial.n), moment, cost, None)


def zero_vibration(z: complex) -> Real:
    """The impulses (n + 2,) of the shaper that is zero at z and its conjugate, 0 < arg z < pi."""
    n = max(1, math.floor(math.pi / abs(np.angle(z)) * (1 + TIME_ROUNDING)))
    at = np.array([0, n, n + 1])
    powers = z ** (-at.astype(float))
    shares = np.linalg.solve(np.array([powers.real, powers.imag, np.ones(3)]), [0.0, 0.0, 1.0])
    impulses = np.zeros(n + 2)
    impulses[at] = shares
    return impulses


def extra_insensitive(z: complex) -> Real:
    """Two such shapers in a row, beside the frequency of z."""
    d = math.acos((1 - TOLERATED) / (1 + TOLERATED)) / math.pi
    turn = float(np.angle(z))
    beside = [abs(z) * np.exp(1j * min(turn * factor, NEARLY_PI * math.pi)) for factor in (1 - d, 1 + d)]
    return np.convolve(zero_vibration(complex(beside[0])), zero_vibration(complex(beside[1])))


def shaper(loop: Sampled, kind: Shaper, modes: int = SHAPED_MODES) -> Real:
    """The impulses for the first modes below half the sample rate, at the poles of the loop without moment feedback."""
    impulses, build = np.ones(1), zero_vibration if kind == "ZV" else extra_insensitive
    poles: Any = loop.having(**{MOMENT_GAIN: 0.0}).poles
    for mode in range(1, modes + 1):
        own = loop.plant.poles[(loop.plant.mode == mode) & (loop.plant.poles.imag > 0)]
        upper = poles.z[(poles.mode == mode) & (poles.z.imag > 0)]
        if own.size and upper.size and own[0].imag * loop.chain.sampling.period < math.pi:
            impulses = np.convolve(impulses, build(complex(upper[0])))
    return impulses


def shaped(task: Scenario, impulses: Real) -> Scenario:
    """The scenario with every reference passed through the impulses; it is busy so much longer."""

    def through(signal: Real) -> Real:
        return np.convolve(signal, impulses)[: signal.size]

    return replace(
        task,
        feedforward=through(task.feedforward),
        hub_angle=through(task.hub_angle),
        hub_rate=through(task.hub_rate),
        rigid_moment=through(task.rigid_moment),
        busy_until=task.busy_until + (impulses.size - 1) * task.period,
    )


def shaped_trial(trial: Trial, kind: Shaper) -> Trial:
    """The trial with its slew shaped.

    x is then the moment less the rigid arm's under the shaped slew, and the linear-quadratic bound of the unshaped slew
    does not hold: it arrives later.
    """
    return replace(trial, task=shaped(trial.task, shaper(trial.loop, kind)))
