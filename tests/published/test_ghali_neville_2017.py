"""A. Ghali and A. M. Neville, Structural Analysis, 7th edition (2017), example 24.2: three masses on a cantilever.

Masses W/g, W/g and 4 W/g at l, 2 l and 3 l from the clamp, the beam itself without mass: 0.1609, 1.7604 and 5.0886
times (g EI/(W l^3))^(1/2).  As reproduced in the tests of the package pystran.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigvals

from tests.published.chains import natural_frequencies, unit_link
from tfarm import Arm, Hub, Payload
from tfarm.arm import Attachment
from tfarm.audit.published import agrees

PRINTED = ("0.1609", "1.7604", "5.0886")
MASSES = np.array([1.0, 1.0, 4.0])
LIGHT = 1e-9  # kg/m beside masses of 1 kg


def by_flexibility():
    """1/w of F M: F_ij = x_i^2 (3 x_j - x_i)/6 for x_i <= x_j, the deflection of a cantilever of EI = 1."""
    x = np.arange(1.0, 4.0)
    low, high = np.minimum.outer(x, x), np.maximum.outer(x, x)
    return np.sort(1 / np.sqrt(eigvals(low**2 * (3 * high - low) / 6 * MASSES).real))


def test_every_printed_digit_is_right_however_the_masses_are_put():
    """The outer mass is the payload, or an attachment at the tip; the link is one segment or three."""
    inner = tuple(Attachment(x=at, mass=1.0) for at in (1.0, 2.0))
    arm = Arm(
        link=unit_link(3.0, rhoA=LIGHT),
        hub=Hub(inertia=math.inf),
        payload=Payload(mass=4.0),
        attachments=inner,
        theory="euler-bernoulli",
    )
    hung = replace(arm, payload=Payload(), attachments=(*inner, Attachment(x=3.0, mass=4.0)))
    third = unit_link(1.0, rhoA=LIGHT)
    cut = replace(arm, link=third, outer=(third, third))
    for each in (arm, hung, cut):
        found = natural_frequencies(each, 3)
        assert found == pytest.approx(by_flexibility(), rel=10 * LIGHT)
        assert all(agrees(ours, printed) for ours, printed in zip(found.tolist(), PRINTED, strict=True))
