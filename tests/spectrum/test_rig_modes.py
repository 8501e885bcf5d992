"""Modes of rigs whose parts move the axis, the root moment or both."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm


@pytest.mark.parametrize("name", ["tests/rigs/bench-rig.toml", "quanser-flexlink"])
def test_a_rigid_body_turns_about_the_axis_and_the_root_moment_is_that_of_the_field(name):
    """The turning rig moves its tip by (r + L + ...): the residue at 0 of tip over torque, without friction."""
    arm = tfarm.load(name).elastic.lossless_hub
    arm = replace(arm, clamp=replace(arm.clamp, damping=0.0), input="hub_torque")
    table = tfarm.modes(arm, 3)
    s = 1e-3j
    tip = tfarm.transfer(arm, "tip_displacement")(s) * s**2
    assert table.shape(arm.length)[0] * table.hub_participation[0] == pytest.approx(tip.real, rel=1e-6)
    np.testing.assert_allclose(table.modal_moment, table.moment(0.0), rtol=1e-9, atol=1e-12)
