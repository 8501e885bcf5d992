"""Starts of Newton's method for damped eigenvalues, from the frequencies of the undamped arm."""

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real


def damped_starts(arm: Arm, omega: Real) -> Complex:
    """Return estimates [1/s] of damped eigenvalues from undamped frequencies (n,) [rad/s], both of each pair.

    In each segment both waves of such a frequency have numbers k, and with damping each of these has the four s of

        (rhoI s^2 + kGA + EI (1 + C s) k^2) (rhoA s^2 + kGA k^2) - kGA^2 k^2 = 0,

    which are the eigenvalues of its companion matrix.  The frequencies themselves are for segments without damping.
    """
    starts: list[Complex] = [1j * omega, -1j * omega]
    for link in dict.fromkeys(each for each in arm.links if each.damping):
        EI, kGA, rhoA, rhoI, C = map(float, (link.EI, link.kGA, link.rhoA, link.rhoI, link.damping))
        half_sum = omega**2 * (rhoI / EI + rhoA / kGA) / 2
        product = omega**2 * rhoA / EI * (omega**2 * rhoI / kGA - 1)
        spread = np.sqrt(half_sum**2 - product)
        k2 = np.concatenate([half_sum + spread, half_sum - spread])
        k2 = k2[k2 > 0]  # below the shear cut-off the second wave does not travel
        c0 = EI / rhoI * kGA / rhoA * k2**2
        c1 = EI * C / rhoI * kGA / rhoA * k2**2
        c2 = kGA / rhoA * k2 + kGA / rhoI + EI / rhoI * k2
        c3 = EI * C / rhoI * k2
        unit = c0**0.25
        companion = np.zeros((k2.size, 4, 4))
        companion[:, 0] = -np.stack([c3 / unit, c2 / unit**2, c1 / unit**3, np.ones(k2.size)], axis=1)
        companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
        starts.append(np.linalg.eigvals(companion).astype(complex).ravel() * np.repeat(unit, 4))
    return np.concatenate(starts)
