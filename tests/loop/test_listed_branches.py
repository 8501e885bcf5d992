"""Which branches of a locus are listed: of every pole one, though it goes through real ones between two values."""

import numpy as np

from tfarm import Arm, HubFeedback, Link, Payload, Section
from tfarm.arm import Hub
from tfarm.loop.locus import locus
from tfarm.loop.poles import closed_loop_poles

TUBE = Section.tube(outer_diameter=0.0056, inner_diameter=0.0038)
PLASTIC = Arm(  # a hub of next to no inertia and a heavy tip: K1 makes mode 1 two real poles at once
    link=Link.isotropic(
        length=0.62, density=1150.0, youngs_modulus=2.5e9, poissons_ratio=0.4, damping=2.5e-4, section=TUBE
    ),
    hub=Hub(inertia=6.5e-5), payload=Payload(mass=0.325), name="plastic tube",
)  # fmt: skip
LAW = HubFeedback(K1=10.9, K2=-0.39)


def test_a_mode_that_is_real_between_two_values_alone_has_its_branch():
    """At gain 0 mode 1 swings at 54 rad/s; at the next value it has met the hub's pole, and is a mirror image there."""
    found = locus(PLASTIC, LAW, "all", 0.0, 2.0, 60, 6)
    assert found.mode.tolist() == [0, 0, 1, 2, 3, 4]
    for n in (0, 30, 59):
        poles = closed_loop_poles(PLASTIC, LAW.times(float(found.gain[n])), 5).values
        away = abs(poles[:, None] - found.branches[:, n]).min(axis=1)
        np.testing.assert_array_less(away, 1e-9 * np.maximum(1.0, abs(poles)))
