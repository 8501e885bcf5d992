"""Converters and arithmetic of the controller: compiled once, used by every simulation.

A signal is rounded to the nearest step (mid-tread) and clipped to the codes that its bits have, as two's complement has
them: -2^(b-1) .. 2^(b-1) - 1 steps of 2 R / 2^b.  An ideal converter has step 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.dsp.chain import Chain
from tfarm.dsp.kernel import DAC
from tfarm.records import record


@dataclass(frozen=True)
@record
class Quantisers:
    """`rows` (3, 3): step, lowest and highest value of the angle, the moment and the torque; step 0 is ideal.

    Their numbers are those of `kernel`: ENCODER, AMPLIFIER, DAC.
    """

    rows: NDArray[np.float64]


def quantisers(chain: Chain) -> Quantisers:
    """The steps and ranges of a chain; the torque's range also respects the motor's limit."""
    converters, limit = chain.converters, chain.actuator.torque_limit
    counts = converters.encoder_counts
    rows = np.array([
        [0.0 if counts is None else 2 * math.pi / counts, -math.inf, math.inf],
        _converter(converters.moment_bits, converters.moment_range),
        _converter(converters.torque_bits, converters.torque_range),
    ])  # fmt: skip
    rows[DAC, 1] = max(rows[DAC, 1], -limit)
    rows[DAC, 2] = min(rows[DAC, 2], limit)
    return Quantisers(rows)


def _converter(bits: int | None, span: float | None) -> list[float]:
    if span is None:
        return [0.0, -math.inf, math.inf]
    if bits is None:
        return [0.0, -span, span]
    step = 2 * span / 2**bits
    return [step, -span, span - step]
