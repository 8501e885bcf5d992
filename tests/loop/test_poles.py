"""Exact closed-loop poles, and where searches start: against the paper's determinant, models and closed forms."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebpts1
from scipy.interpolate import BarycentricInterpolator

import tfarm
from tests.loop.arms import loop_of, verdict_of, window_arm
from tests.rigs import some_rig
from tests.shared import refusal, thinned
from tests.spectrum.independent import newton_step
from tfarm import Hub, HubFeedback, Law
from tfarm.errors import ConvergenceError
from tfarm.loop.continuous import frequency_above_mode
from tfarm.loop.locus import BranchCrossing, Locus
from tfarm.loop.nyquist import compress_radius
from tfarm.loop.panels import Positions, loop_panels, positions, sensed_places
from tfarm.loop.plane import moment_axis, stable_edge
from tfarm.loop.plane_axes import Axis, rate_axis
from tfarm.loop.poles import Poles, closed_loop_poles, count_with_mirrors, first_poles, poles_below, starting_points
from tfarm.loop.stability import poles_on_axis
from tfarm.spectrum.box import Box
from tfarm.spectrum.gains import rate_unit

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
    poles = closed_loop_poles(arm, feedback, 8).nonzero
    assert max(newton_step(arm, complex(s), K1=feedback.K1, K2=feedback.K2, Kp=feedback.Kp) for s in poles) < 1e-14


@pytest.mark.parametrize(
    "law", [HubFeedback(K2=0.3), HubFeedback(K2=-4.0, Kp=2.0), HubFeedback(K1=0.3, K2=1.0)], ids=str
)
@pytest.mark.parametrize("arm", [ARM, STOCKY], ids=["paper", "stocky"])
def test_a_lossless_loop_neither_grows_nor_decays(arm, law) -> None:
    """C = 0 and K1 = 0: even in s; K2 = 1: the locked hub's own frequencies.  Not a last bit off the axis."""
    poles = closed_loop_poles(arm.with_numbers(damping=0.0), law, 8)
    ringing = poles.values[poles.values.imag > 0]
    assert ringing.size > 5
    assert (ringing.real == 0).all()
    assert poles.unstable == 0
    if law.K2 == 1:
        held = tfarm.modes(
            replace(arm.with_numbers(damping=0.0), hub=Hub(inertia=math.inf)), ringing.size
        ).natural_frequency
        np.testing.assert_allclose(ringing.imag, held, rtol=1e-13)


@pytest.mark.parametrize("count", [0, 1001, 2.0, True])
def test_counts_that_are_refused(count) -> None:
    assert "whole number" in str(refusal(closed_loop_poles, ARM, LAW, count))


@pytest.mark.parametrize("C", [1e-5, 1e-3])
def test_a_list_of_fewer_than_ten_poles_ends_at_the_shear_cut_off(C) -> None:
    """A count goes on above the same poles."""
    arm, law = STOCKY.with_numbers(damping=C), HubFeedback(K1=300.0, K2=0.3)
    few, ten = closed_loop_poles(arm, law), closed_loop_poles(arm, law, 10)
    assert few.ends_at_shear_cutoff
    assert not ten.ends_at_shear_cutoff
    assert 0.9 * arm.shear_cutoff < few.box.im_max <= arm.shear_cutoff
    assert few.values.size < 10 == ten.values.size
    same(few.nonzero, ten.nonzero[ten.nonzero.imag < few.box.im_max], 1e-12)
    usual = closed_loop_poles(LAB, LAW)
    assert (usual.values.size, usual.ends_at_shear_cutoff) == (10, False)


def test_a_count_goes_on_into_shear_where_bending_is_overdamped() -> None:
    """With psi' = 0 as good as held: shear waves in a free tip's arm, pi c/L apart, c^2 = kappa G/rho."""
    arm = ARM.with_numbers(damping=0.05)
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
    assert "for this arm 0, or at least 1e-12 times" in str(refusal(ask, LAB, HubFeedback(**gains)))


BARE = tfarm.load("sasaki2012")
J, CORNER = 1e-5, 1e6  # kg m^2 at the hub; 1/s
PUSHED = Law({"hub_rate": ((0.05 - 2 * J * CORNER, 0.05 * CORNER), (1.0, CORNER)), "hub_angle": 0.2}, name="pushed")


def far_poles(found):
    """The real unstable poles beyond the box's height."""
    values = found.poles.values
    return values.real[(values.imag == 0) & (values.real > found.band)]


def test_acceleration_fed_forward_beyond_the_hubs_inertia_is_unstable_far_beyond_the_modes():
    """-2 J s^2 up to a corner takes more than all of the hub's inertia, which counts above the link's own impedance."""
    arm = LAB.with_numbers(hub_inertia=J)
    found = verdict_of(arm, PUSHED)
    assert (found.word, found.unstable_roots) == ("unstable", 2)
    rate = tfarm.transfer(arm, "hub_rate", method="appendix")
    for s in far_poles(found):
        law = ((0.05 - 2 * J * CORNER) * s + 0.05 * CORNER) / (s + CORNER) + 0.2 / s
        assert law * complex(rate(complex(s))).real == pytest.approx(-1, rel=1e-9)
    assert far_poles(found).size == 2


@pytest.mark.parametrize(("share", "number"), [(0.5, 0), (1.5, 1)])
def test_a_rate_gain_beyond_the_links_impedance_drives_a_pin_without_inertia(share, number):
    """The impedance of a link without losses goes to a constant; with more than that subtracted a pole is unstable."""
    arm = BARE.with_numbers(hub_inertia=0.0)
    rate = tfarm.transfer(arm, "hub_rate", method="appendix")
    impedance = 1 / complex(rate(1e12 + 0j)).real
    K1 = -share * impedance
    far = far_poles(verdict_of(arm, HubFeedback(K1=K1, Kp=1e-3)))
    assert far.size == number
    for s in far:
        assert (K1 + 1e-3 / s) * complex(rate(complex(s))).real == pytest.approx(-1, rel=1e-9)


@pytest.mark.parametrize("corner", [1e9, 1e100])
def test_a_corner_beyond_double_range_leaves_the_gain_alone(corner):
    """A gain on the rate through a corner so fast is that gain alone."""
    law = Law({"hub_rate": ((0.1 * corner,), (1.0, corner)), "hub_angle": 0.1})
    found, alone = verdict_of(LAB, law), verdict_of(LAB, Law({"hub_rate": 0.1, "hub_angle": 0.1}))
    assert far_poles(found).size == 0
    assert found.word == alone.word == "stable"
    np.testing.assert_allclose(found.poles.values[:4], alone.poles.values[:4], rtol=1e-6)


@pytest.mark.parametrize(("lead", "verdict"), [(-4e-11, None), (-4e-9, "unstable"), (0.0, "stable")])
def test_a_pole_of_the_law_beyond_all_boxes_is_named(lead, verdict):
    """A den that begins next to 0: one pole at 1/lead, where waves and powers of s are no doubles."""
    law = Law({"hub_rate": ((0.5,), (lead, 1.0, 1e3) if lead else (1.0, 1e3))})
    if verdict is None:
        with pytest.raises(ConvergenceError, match=r"pole at 2\.5e\+10"):
            verdict_of(LAB, law)
    else:
        assert verdict_of(LAB, law).word == verdict


def listed(*values):
    box = Box(-50.0, 10.0, -60.0, 60.0)
    return Poles(loop_of(LAB, HubFeedback(K1=0.3)), np.array(values, complex), box)


def test_a_shorter_list_has_a_lower_box_between_its_last_pole_and_the_next():
    """Of as many as are asked for; without a number ten, and every real one."""
    poles = listed(-3.0, -1.0, -2 + 4j, -1 + 10j, -1 + 40j)
    for count, top in ((2, 2.0), (3, 7.0), (4, 25.0), (5, 60.0)):
        some = first_poles(poles, count)
        np.testing.assert_array_equal(some.values, poles.values[:count])
        assert some.box == Box(-50.0, 10.0, -top, top)
        assert some.box.holds(some.values).all()
        assert not some.box.holds(poles.values[count:]).any()
    assert "2 poles are real" in str(refusal(first_poles, poles, 1))
    assert count_with_mirrors(poles.values) == poles.count == 8
    swinging = [-1 + 1j * n for n in range(1, 16)]
    for number, shown in ((0, 10), (2, 10), (12, 12)):
        real = [-1.0 - n for n in range(number)]
        assert first_poles(listed(*real, *swinging), None).values.size == shown


def test_the_rightmost_pole_is_not_one_at_0():
    poles = listed(0.0, 0.0, -3.0, -1 + 10j)
    assert poles.spectral_abscissa == -1.0
    np.testing.assert_array_equal(poles.nonzero, [-3.0, -1 + 10j])
    assert (poles.unstable, listed(2.0, 3 + 1j, -1 + 2j).unstable) == (0, 3)


def test_a_finding_has_three_crossings_and_counts_the_others():
    each = [
        BranchCrossing(gain=0.5 * n, omega=2 * math.pi * n, branch=n, direction=d)
        for n, d in enumerate(("stable", "unstable") * 3)
    ]

    def finding(crossings):
        return Locus.finding.fget(SimpleNamespace(vary="K2", crossings=crossings))

    assert finding([]) == "no branch crosses the imaginary axis"
    assert finding(each[:1]) == "a pole becomes stable at K2 = 0"
    assert finding(each[:3]) == "a pole becomes stable at K2 = 0, unstable at K2 = 0.5, stable at K2 = 1"
    assert finding(each) == finding(each[:3]) + " and 3 more"
    assert each[3].frequency == pytest.approx(3.0, rel=1e-15)


@pytest.mark.parametrize("arm", [LAB, STOCKY], ids=lambda arm: arm.name)
def test_the_rate_axis_is_linear_up_to_the_power_of_ten_below_the_default_gain(arm):
    axis, K1 = rate_axis(arm), tfarm.default_gains(arm).K1
    assert axis.linear <= K1 < 10 * axis.linear
    assert math.log10(axis.linear) == pytest.approx(round(math.log10(axis.linear)), abs=1e-12)
    assert (axis.low, axis.high) == (-axis.linear, pytest.approx(10 * rate_unit(arm), rel=1e-12))


def test_the_moment_axis_holds_the_default_range_and_all_that_is_unstable_below():
    """-4 to 2 where nothing below is unstable; else the picture shows the end of what is, in between logarithmic."""
    for arm in (BARE, LAB):
        assert moment_axis(arm, rate_axis(arm)) == Axis(-4.0, 2.0)
    arm, x = window_arm(), Axis(0.99, 1.01)  # unstable down to about -41 at K1 = 1
    assert moment_axis(arm, x) == Axis(-50.0, 2.0, 2.0)
    assert not tfarm.map(arm, x.grid(3), np.linspace(-42.0, -4.0, 40)).stable.all()


def test_the_stable_edge_has_stable_points_on_one_side():
    """Of the crossings in each column those where the verdict is stable above or below, but not both."""
    x, y = Axis(0.02, 3.0, 0.02), Axis(-4.0, 2.0)
    points = stable_edge(tfarm.map(LAB, x.grid(60), y.grid(90)))
    assert len(points) > 20
    assert ((points[:, 0] > 0) & (points[:, 0] <= 3.0) & (points[:, 1] >= -4.0) & (points[:, 1] <= 2.0)).all()
    for K1, K2, omega in points[:: len(points) // 6]:
        sides = [verdict_of(LAB, HubFeedback(K1=K1, K2=K2 + way)).is_stable for way in (-1e-6, 1e-6)]
        assert sides[0] != sides[1]
        poles = poles_below(loop_of(LAB, HubFeedback(K1=K1, K2=K2)), 1.1 * omega).values
        assert abs(poles - 1j * omega).min() < 1e-9 * omega


WIDE = some_rig(np.random.default_rng(53))  # polynomials miss the second panel, and half of it, by up to 1e-8


@pytest.mark.parametrize(("arm", "modes"), [(LAB, 5), (BARE, 5), (WIDE, 12)], ids=["lab", "paper", "halved twice"])
def test_between_its_samples_a_panel_is_the_loop_function_too(arm, modes):
    """By SciPy's interpolation at Chebyshev points; no gap from 0 to the band, the first panel on both sides of 0."""
    band, law = frequency_above_mode(arm, modes), HubFeedback(K1=0.3, K2=-0.7, Kp=2.0)
    found = loop_panels(arm, band)
    assert (found.low[0], found.high[-1]) == (-found.high[0], band)
    np.testing.assert_array_equal(found.low[1:], found.high[:-1])
    assert found.error <= 1e-11
    points = chebpts1(found.values.shape[-1])
    inside = np.array([-0.93, -0.31, 0.07, 0.55, 0.99])
    for low, high, values in zip(found.low, found.high, np.moveaxis(found.values, 1, 0), strict=True):
        assert arm is WIDE or abs(values).max() == pytest.approx(1.0, rel=1e-15)  # or else a value between is
        d, theta, m = (BarycentricInterpolator(points, part[::-1])(inside) for part in values)
        s = 1j * ((low + high) / 2 + (high - low) / 2 * inside)
        fed_back = (law.Kp + law.K1 * s) * theta + law.K2 * m * s**2
        whole = loop_of(arm, law).loop_function(s)
        np.testing.assert_allclose(fed_back / (d * s**found.order), whole, rtol=1e-6 * (1 + abs(whole).max()))
    if arm is WIDE:
        width = np.diff(found.high)[1:4]  # of the panel that was halved, and its first half again
        np.testing.assert_allclose(width / width[0], [1.0, 1.0, 2.0])
        with pytest.raises(ConvergenceError, match="do not follow"):
            loop_panels(arm, band, most_panels=len(found.low) - 1)


def test_a_contour_passes_the_poles_of_a_law_on_the_axis_below_its_band():
    """Where it rings without damping, and its integrator if the rig has no zero there."""
    slow, fast = ([1.0, 0.0, w**2] for w in (30.0, 900.0))
    loop = loop_of(LAB, Law({"hub_rate": ([1.0], slow), "root_moment": ([1.0], fast)}))
    np.testing.assert_allclose(poles_on_axis(loop, 400.0), [0.0, 30.0], rtol=1e-9)
    np.testing.assert_allclose(poles_on_axis(loop, 1000.0), [0.0, 30.0, 900.0], rtol=1e-9)
    np.testing.assert_allclose(poles_on_axis(loop, 10.0), [0.0])
    bare = loop_of(BARE, Law({"root_moment": ([1.0], slow)}))  # finite at rest, where the arm turns
    omega = tfarm.modes(BARE, 3).natural_frequency[1:]
    expected = np.sort([30.0, *omega[omega < 400.0]])
    np.testing.assert_allclose(poles_on_axis(bare, 400.0), expected, rtol=1e-9)


def test_resonators_in_one_fraction_are_passed_as_they_are_in_several():
    """The roots of their product are off the axis by rounding; turns and poles found still agree."""
    slow, fast = ([1.0, 0.0, w**2] for w in (30.0, 200.0))
    den = np.polymul(slow, fast)
    num = np.polyadd(0.3 * den, [0.5, 0.0, 0.0, 0.0])
    law = Law({"hub_rate": (num.tolist(), den.tolist())})
    assert law.poles.real.any()
    found = tfarm.nyquist(LAB, law)
    np.testing.assert_allclose(found.poles, [0.0, 30.0, 200.0], rtol=1e-9)
    assert (found.unstable_open, found.unstable_by_nyquist) == (0, found.verdict.unstable_roots)


def test_the_plane_is_drawn_in_a_disc():
    """r at r/(1 + r), its direction kept: back again r/(1 - r); what is infinite at 1."""
    L = np.array([0.0, 0.3 - 0.4j, -1.0, 7j, -1e8 + 1e8j])
    drawn = compress_radius(L)
    assert (abs(drawn) < 1).all()
    np.testing.assert_allclose(drawn / (1 - abs(drawn)), L, rtol=1e-7)
    assert compress_radius(np.array([complex(np.inf, 3.0)])).tolist() == [1.0]


@pytest.mark.parametrize("C", [2e-4, 0.01, 0.1, pytest.param(1e-4, marks=pytest.mark.survey)])
@pytest.mark.parametrize(("sensor", "share"), [("displacement", 1.0), ("moment", 0.3)])
def test_at_each_zero_of_a_sensor_its_response_vanishes(C, sensor, share):
    """The tip moves against the hub at first, so it has real ones on the right; -1/C may be below mode 1."""
    arm = LAB.with_numbers(damping=C)
    x = share * arm.length
    found, G = positions(arm, sensor, np.array([x]), 4), tfarm.transfer(arm, sensor, x=x)
    (zeros,) = found.zeros
    assert (abs(G(zeros)) < 1e-6 * abs(G(zeros * 1.01))).all()
    assert ((zeros.imag == 0) & (zeros.real > 0)).any() == (sensor == "displacement" or C < 1e-3)
    assert ((zeros.real > 0) | (zeros.imag > 0)).all()
    assert (zeros.real <= found.band).all()


@pytest.mark.parametrize("name", ["sasaki2012", "quanser-2dsfl"])
def test_a_sensor_at_a_node_has_a_zero_at_the_mode(name):
    arm = tfarm.load(name)
    modes = tfarm.modes(arm, count=3)
    node = modes.nodes[-1][0]
    found = positions(arm, "displacement", np.array([node, arm.length]), 3)
    assert found.participation[2, 0] == pytest.approx(0.0, abs=1e-9)
    assert abs(found.zeros[0] - 1j * modes.natural_frequency[-1]).min() < 1e-7 * modes.natural_frequency[-1]


def test_participation_is_the_shape_over_its_largest():
    arm = tfarm.load("stocky-steel")
    x = np.linspace(0.0, arm.length, 5)[1:]
    found, modes = positions(arm, "displacement", x, 2), tfarm.modes(arm, count=2)
    w = modes.shape(x)[1:]
    assert found.participation == pytest.approx(w / abs(w).max(axis=1)[:, None])
    assert found.natural_frequency == pytest.approx(modes.natural_frequency[1:])


def test_of_a_zero_what_is_no_more_than_its_error_is_left_out():
    zeros = np.array([3.0 + 4e-9j, 1e-9 + 5j, -2.0 + 2j])
    found = Positions(np.array([0.5]), 10.0, np.ones(1), np.ones((1, 1)), (zeros, zeros[:0]))
    assert [each.tolist() for each in found.known_zeros] == [[3.0, 5j, -2.0 + 2j], []]


def test_an_end_that_no_mode_moves_is_no_place_for_a_sensor():
    """The clamp of a hub without radius does not move, nor does the tip without payload bend."""
    arm = tfarm.load("sasaki2012").with_numbers(payload_mass=0.0, payload_inertia=0.0)
    x = np.linspace(0.0, arm.length, 5)
    assert sensed_places(arm, "displacement", x, 3).tolist() == x[1:].tolist()
    assert sensed_places(arm, "moment", x, 3).tolist() == x[:-1].tolist()


def test_an_arm_that_cannot_turn_has_no_such_zeros():
    locked = tfarm.load("sasaki2012").with_numbers(hub_inertia=math.inf)
    assert "an arm that cannot turn" in str(refusal(positions, locked, "moment", np.array([0.1]), 2))


def test_poles_of_a_long_delay_have_starts_next_to_them():
    """A delay of half a second has a pole every 2 pi/delay; three of four starts are within a hundredth of that."""
    loop = loop_of(LAB, Law({"hub_rate": 30.0}, delay=0.5))
    poles, starts = poles_below(loop, 300.0).values, starting_points(loop, 300.0)
    upper = poles[poles.imag > 0]
    away = np.abs(upper[:, None] - starts).min(axis=1)
    assert upper.size == 26  # 300 delay/(2 pi), and those of two modes
    assert np.quantile(away, 0.7) < 0.01 * 2 * math.pi / loop.law.delay
