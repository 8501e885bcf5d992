"""Converters and arithmetic of the controller: compiled once, used by every simulation.

A signal is rounded to the nearest step (mid-tread) and clipped to the codes that its bits have, as two's complement has
them: -2^(b-1) .. 2^(b-1) - 1 steps of 2 R / 2^b.  An ideal converter has step 0.
"""

from __future__ import annotations

import math

import numpy as np

from tfarm.arrays import Real
from tfarm.dsp.chain import Chain
from tfarm.dsp.kernel import DAC, HIGHEST, LOWEST


def quantisers(chain: Chain) -> Real:
    """Step, lowest and highest value (3, 3) of a chain's encoder, strain amplifier and DAC, as `kernel` numbers them.

    A step of 0 is ideal; the torque's range also respects the motor's limit.
    """
    converters, limit = chain.converters, chain.actuator.torque_limit
    counts = converters.encoder_counts
    rows = np.array([
        [0.0 if counts is None else 2 * math.pi / counts, -math.inf, math.inf],
        _converter(converters.moment_bits, converters.moment_range),
        _converter(converters.torque_bits, converters.torque_range),
    ])  # fmt: skip
    rows[DAC, LOWEST] = max(rows[DAC, LOWEST], -limit)
    rows[DAC, HIGHEST] = min(rows[DAC, HIGHEST], limit)
    return rows


def _converter(bits: int | None, span: float | None) -> list[float]:
    if span is None:
        return [0.0, -math.inf, math.inf]
    if bits is None:
        return [0.0, -span, span]
    step = 2 * span / 2**bits
    return [step, -span, span - step]
