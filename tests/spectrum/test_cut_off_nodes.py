"""The mode at the shear cut-off of a pinned-pinned beam moves nowhere: W = 0, Psi = const; no point of it is a node."""

import math
from dataclasses import replace

import numpy as np

import tfarm
from tfarm import Hub, Payload


def test_a_mode_without_displacement_has_no_nodes() -> None:
    arm = replace(tfarm.load("stocky-steel"), hub=Hub(inertia=0.0), payload=Payload(mass=math.inf))
    modes = tfarm.modes(arm, 12)
    (row,) = np.nonzero(np.isclose(modes.natural_frequency, arm.shear_cutoff, rtol=1e-13))[0]
    x = np.linspace(0.0, arm.link.length, 50)
    assert abs(modes.shape(x)[row]).max() < 1e-12 * abs(modes.rotation(x)[row]).max()
    assert np.ptp(modes.rotation(x)[row]) < 1e-12 * abs(modes.rotation(x)[row]).max()
    assert modes.nodes[row].size == 0
    assert modes.nodes[row - 1].size > 0
