"""Rigs without any loss whose gauge does not read the moment on the hub: the K2 at which each mode leaves the axis.

At C = 0 and s = i w drive, hub angle theta and gauge M are real, so in  D = drive + (Kp + K1 s) theta + K2 M  only the
rate gain's part is imaginary.  With K1 != 0 poles are on the axis where theta = 0 alone, at the frequencies w_n of the
locked hub, and for one K2 each, whatever K1 and Kp:

    K2_n = -drive/M = (M0 + r Q0)/M         at theta = 0

(all of them 1 where the gauge reads the moment on the hub: Lyapunov's line).  For K1 > 0 the signs of drive + K2 M at
the zeros of theta count the poles (Hermite and Biehler): mode n has two on the right where K2/K2_n > 1 and none
elsewhere, K2 = 0 being a passive hub.  So the stable K2 lie between the nearest K2_n on either side of 0.

There are infinitely many.  With a hub radius K2_n tends to 1 + r k_n, k_n the wave number, as long as waves bend; with
a gauge at x it is M0/M(x), of either sign; from the shear cut-off on it may be anything.  So nothing is claimed beyond
the modes looked at.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.crossing import Crossings
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import loop_system
from tfarm.spectrum import modes
from tfarm.spectrum.search import ARMS_KEPT

from .frequencies import MOST_BAND_MODES
from .lines import along, line_parts

UNFELT_MOMENT = 1e-9  # a K2_n below this share of a whole moment is none: the hub feels nothing of that mode


@lru_cache(maxsize=ARMS_KEPT)
def locked_edges(arm: Arm) -> Crossings:
    """The K2_n of the first `MOST_BAND_MODES` modes of the locked hub, `at` their w_n [rad/s], `change` for K1 > 0.

    Of an arm that `is_reactive`.  They are those of a hub without inertia, whose drive is -(M0 + r Q0) and no small
    difference.  Raises ConvergenceError for a mode that the hub does not feel.
    """
    omega = modes(arm.having(hub_inertia=math.inf), MOST_BAND_MODES).natural_frequency
    hub = replace(arm.hub, inertia=0.0, friction=0.0, stiffness=0.0)
    pin = loop_system(replace(arm, hub=hub, motor=None, input="hub_torque"))
    drive, M = line_parts(pin, along("K2", HubFeedback()), 1j * omega)
    with np.errstate(divide="ignore", invalid="ignore"):  # a gauge where the mode has no moment: no K2 does anything
        K2 = -(drive * M.conj()).real / abs(M) ** 2 * arm.input_per_torque
    if (abs(K2) < UNFELT_MOMENT * arm.input_per_torque).any():
        first = float(omega[abs(K2) < UNFELT_MOMENT * arm.input_per_torque][0])
        raise ConvergenceError(f"the hub does not feel the mode at {first:.6g} rad/s: no gain decides", first, 0.0)
    return Crossings.of(zip(K2, omega, 2 * np.sign(K2), strict=True))


def stable_moments(arm: Arm) -> tuple[float, float]:
    """Between which K2 no mode of an arm that `is_reactive` is driven by K1 > 0: all modes, or those of `locked_edges`.

    Beyond infinite ends none was found.
    """
    if arm.is_told_by_lyapunov:
        return -math.inf, arm.input_per_torque
    gains = locked_edges(arm).gain
    return float(gains[gains < 0].max(initial=-math.inf)), float(gains[gains > 0].min(initial=math.inf))


def driven_modes(arm: Arm, K2: float) -> Crossings:
    """Those of `locked_edges` that lie between 0 and this K2: the modes that K1 > 0 drives."""
    return locked_edges(arm).within(min(0.0, K2), max(0.0, K2))
