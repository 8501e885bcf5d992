"""Modes of rigs whose parts move the axis, the root moment or both."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.spectrum.damped import damped_at_hub


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


def test_with_the_losses_of_the_hub_alone_clamp_and_link_lose_nothing():
    """A clamp and a link that lose nothing have the rig's own poles; what they would lose changes nothing."""
    rig = tfarm.load("quanser-2dsfl")
    yielding = replace(rig, clamp=replace(rig.clamp, stiffness=300.0))
    lossy = replace(yielding, clamp=replace(yielding.clamp, damping=1e-3)).having(damping=1e-3)
    found, expected = damped_at_hub(lossy, 3), tfarm.damped_modes(tfarm.modes(yielding, 3))
    np.testing.assert_allclose(found.eigenvalues, expected.eigenvalues, rtol=1e-9)
    assert (tfarm.damped_modes(tfarm.modes(lossy, 3)).eigenvalues[1:, 0].real < 2 * found.eigenvalues[1:, 0].real).any()
    assert damped_at_hub(tfarm.load("sasaki2012-lab"), 3) is None
