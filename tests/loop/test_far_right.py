"""Real poles far right of every mode: where a hub of little or no inertia meets a law that pushes it.

Their second road is the paper's own determinant: at a pole s the law and the transfer function multiply to -1.
"""

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback, Law
from tfarm.errors import ConvergenceError
from tfarm.loop.loop import Loop
from tfarm.loop.stability import stability

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
J, CORNER = 1e-5, 1e6  # kg m^2 at the hub; 1/s
PUSHED = Law({"hub_rate": ((0.05 - 2 * J * CORNER, 0.05 * CORNER), (1.0, CORNER)), "hub_angle": 0.2}, name="pushed")


def far_poles(found):
    """The real unstable poles beyond the box's height."""
    values = found.poles.values
    return values.real[(values.imag == 0) & (values.real > found.band)]


def test_acceleration_fed_forward_beyond_the_hubs_inertia_is_unstable_far_beyond_the_modes():
    """-2 J s^2 up to a corner takes more than all of the hub's inertia, which counts above the link's own impedance."""
    arm = LAB.having(hub_inertia=J)
    found = stability(arm, PUSHED)
    assert (found.verdict, found.unstable_roots) == ("unstable", 2)
    rate = tfarm.transfer(arm, "hub_rate", method="appendix")
    for s in far_poles(found):
        law = ((0.05 - 2 * J * CORNER) * s + 0.05 * CORNER) / (s + CORNER) + 0.2 / s
        assert law * complex(rate(complex(s))).real == pytest.approx(-1, rel=1e-9)
    assert far_poles(found).size == 2


@pytest.mark.parametrize("corner", [1e3, 1e9])
def test_wherever_the_corner_of_such_a_law_is_each_turn_of_the_real_axis_is_a_pole(corner):
    """1 + L at 400 places up to ten corners: as many turns of its sign as poles are listed there."""
    arm = LAB.having(hub_inertia=J)
    law = Law({"hub_rate": ((0.05 - 2 * J * corner, 0.05 * corner), (1.0, corner)), "hub_angle": 0.2})
    found = stability(arm, law)
    x = np.geomspace(found.band, 10 * max(corner, found.band), 400)
    turns = int((np.diff(np.sign(1 + Loop(arm, law).loop_function(x + 0j).real)) != 0).sum())
    assert turns == far_poles(found).size == (2 if corner == 1e9 else 0)
    assert (found.verdict == "unstable") == (turns > 0)


@pytest.mark.parametrize("as_law", [False, True])
@pytest.mark.parametrize(("share", "number"), [(0.5, 0), (1.5, 1)])
def test_a_rate_gain_beyond_the_links_impedance_drives_a_pin_without_inertia(as_law, share, number):
    """The impedance of a link without losses goes to a constant: more than that taken off, and one pole runs away."""
    arm = BARE.having(hub_inertia=0.0)
    rate = tfarm.transfer(arm, "hub_rate", method="appendix")
    impedance = 1 / complex(rate(1e12 + 0j)).real
    K1 = -share * impedance
    law = Law({"hub_rate": K1, "hub_angle": 1e-3}, delay=0.0)
    found = stability(arm, law) if as_law else stability(arm, HubFeedback(K1=K1, Kp=1e-3))
    far = far_poles(found)
    assert far.size == number
    for s in far:
        assert (K1 + 1e-3 / s) * complex(rate(complex(s))).real == pytest.approx(-1, rel=1e-9)


@pytest.mark.parametrize("corner", [1e9, 1e100])
def test_where_powers_of_s_are_no_doubles_nothing_is_warned_of_and_nothing_is_far(corner):
    """A gain on the rate through a corner so fast is that gain alone."""
    law = Law({"hub_rate": ((0.1 * corner,), (1.0, corner)), "hub_angle": 0.1})
    found, alone = stability(LAB, law), stability(LAB, Law({"hub_rate": 0.1, "hub_angle": 0.1}))
    assert far_poles(found).size == 0
    assert found.verdict == alone.verdict == "stable"
    np.testing.assert_allclose(found.poles.values[:4], alone.poles.values[:4], rtol=1e-6)


@pytest.mark.parametrize(("lead", "verdict"), [(-4e-14, None), (-4e-11, "unstable"), (0.0, "stable")])
def test_a_pole_of_the_law_beyond_all_boxes_is_named(lead, verdict):
    """A den that begins next to 0: one pole at 1/lead, where waves and powers of s are no doubles."""
    law = Law({"hub_rate": ((0.5,), (lead, 1.0, 1e3) if lead else (1.0, 1e3))})
    if verdict is None:
        with pytest.raises(ConvergenceError, match=r"pole at 2\.5e\+13"):
            stability(LAB, law)
    else:
        assert stability(LAB, law).verdict == verdict
