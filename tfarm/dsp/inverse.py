"""The torque of the exact inverse at the hub: that under which the hub of the linear arm follows a slew by itself.

    u(s) = theta(s)/P(s),   P = theta/u the exact transfer function of the hub angle

The poles of 1/P are those of the arm with its hub held.  So u goes on after the slew, and decays with their damping
alone; without damping it never ends.

The table has its means over each sample, as the hold keeps one value: the inverse transform of u(s) (e^{sT} - 1)/(sT).
It is summed on Re s = c by the fast Fourier transform, over twice the record, W: what returns from beyond has e^{-cW}.
"""

import numpy as np
import scipy.fft

from tfarm.arm import Arm
from tfarm.arm.chain import Chain
from tfarm.arrays import Real
from tfarm.dsp.profiles import transform_of_profile
from tfarm.errors import ConvergenceError
from tfarm.response import transfer


def inverse_torque(arm: Arm, chain: Chain, count: int) -> Real:
    """Return the means (count,) of the torque over the samples of a slew of limited jerk, from its begin on.

    Raises ConvergenceError where the transform has not converged to 1e-5 of the largest.
    """
    # e^-18 = 1.5e-8 returns from beyond the record; of rounding e^9 = 8e3 times 2e-16
    decay = 9.0
    T = chain.sampling.period
    slew = chain.slew
    rise = slew.rise_time
    # the record, and the slew in any case
    size = scipy.fft.next_fast_len(2 * max(count, int(2 * rise / T) + 1), real=True)
    c = 2 * decay / (size * T)
    P = transfer(arm, "hub_angle")
    turn = slew.travel_of(arm.reach) / arm.reach
    before: Real | None = None
    change = np.inf
    # points a sample, of the highest frequency
    for points in (4, 8, 16, 32, 64):
        n = points * size
        s = c + 2j * np.pi * np.arange(n // 2 + 1) / (size * T)
        motion = turn * rise * transform_of_profile(chain.reference.profile, s * rise)
        means = motion / P(s) * np.expm1(s * T) / (s * T)
        found = scipy.fft.irfft(means, n)[::points][:count] * points / T * np.exp(c * T * np.arange(count))
        if before is not None:
            change = float(abs(found - before).max() / abs(found).max())
            if change <= 1e-5:
                return np.asarray(found)
        before = found
    raise ConvergenceError("the torque of the inverse at the hub has not converged", arm, change)
