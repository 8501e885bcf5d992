"""The response to an input that is held from each sample to the next, as samples of the output have it.

The sampler adds to H(s) with the hold Z(s) = (1 - e^{-sT})/(sT) the images of H about whole multiples of its rate, so

    H_held(s) = H(e^{sT}) = Z(s) H(s) + A(s),    A(s) = sum over k != 0 of Z H at s + 2 pi i k/T.

Below half of the rate A is small, and smooth: H keeps its poles and zeros there, and Z is a delay of T/2 and a loss of
gain.  A is the pulse transfer function less Z H of the same modes.
"""

from __future__ import annotations

import math

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.chain import Chain, Sampling
from tfarm.arrays import Complex
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant
from tfarm.spectrum import modes_below


def modes_at_period(arm: Arm, period: float) -> int:
    """Return the number of modes that samples are computed with: up to four times half of their rate, two more."""
    most = 20
    return min(most, modes_below(arm, 4 * math.pi / period) + 2)


def held_parts(arm: Arm, name: str, period: float, s: Complex) -> tuple[Complex, Complex]:
    """Return Z and A at points s of a signal of an arm, of the shape of s."""
    plant = sensed_plant(arm, Chain(), (name,), modes_at_period(arm, period)).together
    flat = np.ravel(s)
    hold = -np.expm1(-flat * period) / (flat * period)
    modal = plant.residues[0] @ (1 / (flat - plant.poles[:, None]))
    modal = modal + plant.static[0] + plant.rigid[0, 0] / flat**2 + plant.rigid[0, 1] / flat
    images = PulseTransfer(plant, Sampling(period=period))(np.exp(flat * period))[0] - hold * modal
    return hold.reshape(np.shape(s)), images.reshape(np.shape(s))
