"""Exact closed-loop poles against the paper's determinant, modal models, winding numbers and equivalent arms."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.arms import window_arm
from tests.shared import thinned
from tests.spectrum.independent import newton_step
from tfarm import Hub, HubFeedback, Law, ParameterError
from tfarm.case import Case
from tfarm.errors import ConvergenceError
from tfarm.loop.poles import closed_loop_poles
from tfarm.loop.stability import stability

ARM = tfarm.load("sasaki2012")
LAB = tfarm.load("sasaki2012-lab")
STOCKY = tfarm.load("stocky-steel")
LAW = HubFeedback(K1=0.3, K2=0.3)


def same(ours, theirs, tolerance=1e-13) -> None:
    """Both lists of poles in any order, each within a share of its own size."""
    assert ours.size == theirs.size
    for pole in ours:
        assert abs(theirs - pole).min() <= tolerance * abs(pole), (pole, theirs)


@pytest.mark.parametrize(
    "feedback", thinned([LAW, HubFeedback(K1=2.0, K2=-7.0, Kp=30.0), HubFeedback(K1=0.1, K2=1.2)], 2), ids=str
)
@pytest.mark.parametrize("arm", [ARM, LAB, STOCKY, window_arm()], ids=["paper", "lab", "stocky", "window"])
def test_the_papers_determinant_vanishes_at_fifty_digits(arm, feedback) -> None:
    poles = closed_loop_poles(arm, feedback, 8).moving
    assert max(newton_step(arm, complex(s), K1=feedback.K1, K2=feedback.K2, Kp=feedback.Kp) for s in poles) < 1e-14


@pytest.mark.parametrize(
    "law", [HubFeedback(K2=0.3), HubFeedback(K2=-4.0, Kp=2.0), HubFeedback(K1=0.3, K2=1.0)], ids=str
)
@pytest.mark.parametrize("arm", [ARM, STOCKY], ids=["paper", "stocky"])
def test_a_lossless_loop_neither_grows_nor_decays(arm, law) -> None:
    """C = 0 and K1 = 0: even in s; K2 = 1: the locked hub's own frequencies.  Not a last bit off the axis."""
    poles = closed_loop_poles(arm.having(damping=0.0), law, 8)
    ringing = poles.values[poles.values.imag > 0]
    assert ringing.size > 5
    assert (ringing.real == 0).all()
    assert poles.unstable == 0
    if law.K2 == 1:
        held = tfarm.modes(replace(arm.having(damping=0.0), hub=Hub(inertia=math.inf)), ringing.size).natural_frequency
        np.testing.assert_allclose(ringing.imag, held, rtol=1e-13)


@pytest.mark.parametrize("count", [0, 1001, 2.0, True])
def test_counts_that_are_refused(count) -> None:
    with pytest.raises(ParameterError, match="whole number") as refused:
        closed_loop_poles(ARM, LAW, count)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("C", [1e-5, 1e-3])
def test_a_list_of_fewer_than_ten_poles_ends_at_the_shear_cut_off(C) -> None:
    """A count goes on above the same poles."""
    arm, law = STOCKY.having(damping=C), HubFeedback(K1=300.0, K2=0.3)
    few, ten = closed_loop_poles(arm, law), closed_loop_poles(arm, law, 10)
    assert few.ends_at_shear_cutoff
    assert not ten.ends_at_shear_cutoff
    assert 0.9 * arm.shear_cutoff < few.box.im_max <= arm.shear_cutoff
    assert few.values.size < 10 == ten.values.size
    same(few.moving, ten.moving[ten.moving.imag < few.box.im_max], 1e-12)
    usual = closed_loop_poles(LAB, LAW)
    assert (usual.values.size, usual.ends_at_shear_cutoff) == (10, False)


def test_a_count_goes_on_into_shear_where_bending_is_overdamped() -> None:
    """With psi' = 0 as good as held: shear waves in a free tip's arm, pi c/L apart, c^2 = kappa G/rho."""
    arm = ARM.having(damping=0.05)
    poles = closed_loop_poles(arm, LAW, 9)
    link = arm.link
    apart = math.pi / link.length * math.sqrt(link.shear_factor * link.shear_modulus / link.density)
    np.testing.assert_allclose(np.diff(poles.values.imag[-5:]), apart, rtol=1e-3)
    assert poles.values.size == 9


@pytest.mark.parametrize("K2", [0.0, -3.0])
@pytest.mark.parametrize("K1", [1e-7, -1e-10])
def test_a_very_small_gain_moves_the_rigid_body_pole_alone(K1, K2) -> None:
    """J s^2 + K1 s with J the effective inertia; the others are those at K1 = 0."""
    J = LAB.hub.inertia + (1 - K2) * (LAB.total_inertia - LAB.hub.inertia)
    zero, slow, *others = closed_loop_poles(LAB, HubFeedback(K1=K1, K2=K2), 5).values
    assert zero == 0
    assert slow == pytest.approx(-K1 / J, rel=1e-9, abs=0)
    np.testing.assert_allclose(others, closed_loop_poles(LAB, HubFeedback(K2=K2), 5).values[2:], rtol=1e-7)


def test_a_spring_far_too_weak_for_the_flexible_arm_swings_the_rigid_one() -> None:
    J, K1, Kp = LAB.total_inertia, 1e-6, 1e-8
    pair = np.roots([J, K1, Kp])
    poles = closed_loop_poles(LAB, HubFeedback(K1=K1, Kp=Kp), 4).values
    assert poles[0] == pytest.approx(pair[pair.imag > 0][0], rel=1e-9, abs=0)


@pytest.mark.parametrize("ask", [closed_loop_poles, tfarm.sampled])
@pytest.mark.parametrize("gains", [{"K1": 5e-324}, {"K2": -9e-13}])
def test_a_gain_far_below_its_unit_is_refused(ask, gains) -> None:
    with pytest.raises(ParameterError, match=r"for this arm 0, or at least 1e-12 times"):
        ask(LAB, HubFeedback(**gains))


BARE = tfarm.load("sasaki2012")
J, CORNER = 1e-5, 1e6  # kg m^2 at the hub; 1/s
PUSHED = Law({"hub_rate": ((0.05 - 2 * J * CORNER, 0.05 * CORNER), (1.0, CORNER)), "hub_angle": 0.2}, name="pushed")


def far_poles(found):
    """The real unstable poles beyond the box's height."""
    values = found.poles.values
    return values.real[(values.imag == 0) & (values.real > found.band)]


def test_acceleration_fed_forward_beyond_the_hubs_inertia_is_unstable_far_beyond_the_modes():
    """-2 J s^2 up to a corner takes more than all of the hub's inertia, which counts above the link's own impedance."""
    arm = LAB.having(hub_inertia=J)
    found = stability(Case(arm, PUSHED))
    assert (found.word, found.unstable_roots) == ("unstable", 2)
    rate = tfarm.transfer(arm, "hub_rate", method="appendix")
    for s in far_poles(found):
        law = ((0.05 - 2 * J * CORNER) * s + 0.05 * CORNER) / (s + CORNER) + 0.2 / s
        assert law * complex(rate(complex(s))).real == pytest.approx(-1, rel=1e-9)
    assert far_poles(found).size == 2


@pytest.mark.parametrize(("share", "number"), [(0.5, 0), (1.5, 1)])
def test_a_rate_gain_beyond_the_links_impedance_drives_a_pin_without_inertia(share, number):
    """The impedance of a link without losses goes to a constant; with more than that subtracted a pole is unstable."""
    arm = BARE.having(hub_inertia=0.0)
    rate = tfarm.transfer(arm, "hub_rate", method="appendix")
    impedance = 1 / complex(rate(1e12 + 0j)).real
    K1 = -share * impedance
    far = far_poles(stability(Case(arm, HubFeedback(K1=K1, Kp=1e-3))))
    assert far.size == number
    for s in far:
        assert (K1 + 1e-3 / s) * complex(rate(complex(s))).real == pytest.approx(-1, rel=1e-9)


@pytest.mark.parametrize("corner", [1e9, 1e100])
def test_a_corner_beyond_double_range_leaves_the_gain_alone(corner):
    """A gain on the rate through a corner so fast is that gain alone."""
    law = Law({"hub_rate": ((0.1 * corner,), (1.0, corner)), "hub_angle": 0.1})
    found, alone = stability(Case(LAB, law)), stability(Case(LAB, Law({"hub_rate": 0.1, "hub_angle": 0.1})))
    assert far_poles(found).size == 0
    assert found.word == alone.word == "stable"
    np.testing.assert_allclose(found.poles.values[:4], alone.poles.values[:4], rtol=1e-6)


@pytest.mark.parametrize(("lead", "verdict"), [(-4e-11, None), (-4e-9, "unstable"), (0.0, "stable")])
def test_a_pole_of_the_law_beyond_all_boxes_is_named(lead, verdict):
    """A den that begins next to 0: one pole at 1/lead, where waves and powers of s are no doubles."""
    law = Law({"hub_rate": ((0.5,), (lead, 1.0, 1e3) if lead else (1.0, 1e3))})
    if verdict is None:
        with pytest.raises(ConvergenceError, match=r"pole at 2\.5e\+10"):
            stability(Case(LAB, law))
    else:
        assert stability(Case(LAB, law)).word == verdict
