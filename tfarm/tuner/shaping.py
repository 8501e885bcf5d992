"""Input shaping: the remedy that every practitioner tries first, on the exact sampled poles of the loop.

The reference is passed through a few impulses whose sum vanishes at the poles z of the modes that it is not to excite
(Singer and Seering, 1990).  On the sample grid a zero-vibration shaper (ZV) has three impulses: now, n and n + 1
samples later, with n the whole samples of half a period:

    c_0 + c_n z^-n + c_{n+1} z^-(n+1) = 0,   c_0 + c_n + c_{n+1} = 1

exactly zero for that mode of the linear loop, whatever the period.  The extra-insensitive one (EI; Singhose, Seering
and Singer, 1994) lets a share V of the vibration remain at the mode itself, and is zero at two frequencies beside it,
w (1 +- d) with cos(pi d) = (1 - V)/(1 + V): two ZV shapers in a row.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from tfarm.arm import MOMENT_GAIN
from tfarm.arrays import Real
from tfarm.dsp import Sampled, Scenario
from tfarm.dsp.chain import TIME_ROUNDING
from tfarm.tuner.trial import Trial

Shaper = Literal["ZV", "EI"]
SHAPERS: tuple[Shaper, ...] = ("ZV", "EI")

SHAPED_MODES = 2  # which a slew excites most
TOLERATED = 0.05  # V: the share of the vibration that EI leaves at the mode itself, as its authors have it
NEARLY_PI = 0.999  # of pi rad a sample: the fastest frequency beside a mode that a shaper can have


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
