"""Time constant of back-calculation to the integrator of a law, C(s) = Ki/s + Kp + Kd s + ... at low frequencies.

    Tt = sqrt(Ti Td) = sqrt(Kd/Ki), or Ti = Kp/Ki without derivative action

(Astrom and Hagglund, Advanced PID Control, 2006, sec. 3.5.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tfarm.arm import Law
from tfarm.arm.blocks import Rational


def with_anti_windup(law: Law) -> Law:
    """Return a law of ratios with anti-windup to its first integrator; itself without one, or with Ki against Kp."""
    for part in law.parts:
        block = part.block
        if isinstance(block, Rational) and block.order and block.den[-1] == 0.0:
            # ascending, without the integrator
            n = np.pad(block.num, (2, 0))[::-1]
            d = np.pad(block.den[:-1], (2, 0))[::-1]
            Ki = n[0] / d[0]
            Kp = (n[1] - Ki * d[1]) / d[0]
            Kd = (n[2] - Ki * d[2] - Kp * d[1]) / d[0]
            square = Kd / Ki if Kd / Ki > 0 else max(Kp / Ki, 0.0) ** 2
            return replace(law, anti_windup=float(np.sqrt(square)))
    return law
