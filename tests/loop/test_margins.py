"""Margins of the exact loop function: against python-control, loops counted again, theory, and other units."""

import math
from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest
from scipy.optimize import brentq

import tfarm
from tests.loop.arms import held, loop_of, verdict_of, window_arm
from tests.loop.test_lossless import CLAMP
from tests.loop.test_stability import exceptional
from tests.odd_arms import odd_arms
from tests.rigs import some_rig
from tests.shared import thinned
from tests.similar import EITHER
from tests.transition import response as transition
from tfarm import Hub, HubFeedback, Law
from tfarm.loop.continuous import grid
from tfarm.loop.loop_margins import lowest
from tfarm.loop.plane import gain_map
from tfarm.loop.poles import Poles
from tfarm.loop.stability import Stability
from tfarm.reduced import relaxed_model
from tfarm.schema import to_dict
from tfarm.spectrum.box import Box
from tfarm.spectrum.gains import default_gains

margins = cache(tfarm.margins)  # several tests need those of the same loops

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAW = HubFeedback(K1=0.3, K2=0.3)
LOOPS = [
    (LAB, LAW),
    (LAB, HubFeedback(K1=0.3, K2=-2.0)),
    (LAB, HubFeedback(K1=5.0, K2=0.8, Kp=20.0)),
    (window_arm(), HubFeedback(K1=1.0, K2=-5.0)),
    (window_arm(), HubFeedback(K1=3e4, K2=0.5)),
    (held(), HubFeedback(K1=0.3, K2=0.3)),
]


def response(arm, law, up_to):
    """The loop function from the arm's public transfer functions, on a grid three times as dense as the margins'."""
    rough = np.asarray(grid(arm, up_to))
    omega = np.unique((rough[:-1, None] + np.diff(rough)[:, None] * np.arange(3) / 3).ravel())
    theta, moment = tfarm.transfer(arm, ["hub_angle", "root_moment"])(1j * omega)
    return control.frd((law.Kp + law.K1 * 1j * omega) * theta + law.K2 * moment, omega, smooth=False)


@pytest.mark.parametrize(("arm", "law"), thinned(LOOPS[::-1], 6))
def test_margins_are_those_of_python_control_on_a_fine_grid(arm, law) -> None:
    found = margins(arm, law).in_band
    L = response(arm, law, found.band)
    gains, phases, _, _, at, _ = control.stability_margins(L, returnall=True)
    assert found.phase == pytest.approx(min(phases, key=abs, default=math.inf), rel=2e-2)
    assert found.phase_lag == pytest.approx(min(phases[phases > 0], default=math.inf), rel=2e-2)
    assert found.phase_lead == pytest.approx(min(-phases[phases < 0], default=math.inf), rel=2e-2)
    lag = np.mod(phases, 360) * math.pi / 180
    assert found.delay == pytest.approx(min(lag / at, default=math.inf), rel=2e-2)
    at_rest = -1 / L.frdata[0, 0, 0].real  # the lowest frequency of a held arm is as good as 0, where L is real
    above = [g for g in (*gains, at_rest) if g > 1 and (g != at_rest or not arm.has_rigid_mode)]
    assert found.gain[1] == pytest.approx(min(above, default=math.inf), rel=1e-2)
    peak = max(1.0, abs(1 / (1 + L.frdata[0, 0])).max())
    assert found.peak_sensitivity == pytest.approx(peak, rel=5e-2)
    assert found.peak_sensitivity >= peak * (1 - 1e-9)


@pytest.mark.parametrize("K1", [1e-6, 1e-10])
def test_a_very_small_gain_has_the_margins_of_the_rigid_arm(K1) -> None:
    """L = K1/(J s): |L| = 1 at K1/J, 90 degrees of lag there, and no lead."""
    found = margins(LAB, HubFeedback(K1=K1)).in_band
    assert (found.phase, found.phase_lag, found.phase_lead) == pytest.approx((90.0, 90.0, math.inf))
    assert found.at["phase"] == pytest.approx(K1 / LAB.total_inertia, rel=1e-6, abs=0)
    assert found.delay == pytest.approx(math.pi / 2 * LAB.total_inertia / K1, rel=1e-6)


@pytest.mark.parametrize("law", [HubFeedback(K1=1e-6, Kp=1e-8, K2=0.4), HubFeedback(K1=1e-9, Kp=1e-8, K2=-0.5)])
def test_slow_crossovers_are_where_the_rigid_loop_function_has_size_one(law) -> None:
    """-L = k + b/w^2 + i a/w of the rigid arm, a = K1/J, b = Kp/J, k = K2 (J - I_h)/J: a quadratic in w^2."""
    J, carried = LAB.total_inertia, LAB.total_inertia - LAB.hub.inertia
    a, b, k = law.K1 / J, law.Kp / J, law.K2 * carried / J
    unit = max(a, b**0.5)
    squares = np.roots([1 - k * k, -(2 * b * k + a * a) / unit**2, -b * b / unit**4])
    expected = unit * np.sqrt(squares[squares > 0])
    found = [w for w, _ in margins(LAB, law).in_band.gain_crossovers]
    np.testing.assert_allclose(found[: expected.size], np.sort(expected), rtol=1e-6)


@pytest.mark.parametrize(("arm", "law"), thinned(LOOPS[:4], 4))
def test_the_disk_margin_is_that_of_python_control_for_a_modal_model(arm, law) -> None:
    """Skew 0 is the symmetric disk; the model is right to the third digit at the frequency where it counts."""
    found = margins(arm, law).in_band
    A, B, C, D = relaxed_model(arm, ["hub_angle", "hub_rate", "root_moment"], 25).matrices()
    gains = np.array([[law.Kp, law.K1, law.K2]])
    omega = found.at["disk"] * (1 + np.linspace(-0.05, 0.05, 4001))
    alpha = control.disk_margins(control.ss(A, B, gains @ C, gains @ D), omega)[0]
    assert found.disk == pytest.approx(alpha, rel=5e-3)


@pytest.mark.parametrize(("arm", "law"), thinned(LOOPS[:5], 2))
def test_the_loop_bears_just_less_than_the_delay_margin(arm, law) -> None:
    """By the poles of the delayed loop, complete in their box by the winding number."""
    found = margins(arm, law)
    late = [replace(loop_of(arm, law).law, delay=found.exact_delay * share) for share in (1 - 1e-5, 1 + 1e-5)]
    assert [verdict_of(arm, each).unstable_roots for each in late] == [0, 2]


@pytest.mark.parametrize("ask", [tfarm.margins, tfarm.sampled])
def test_up_to_the_delay_margin_the_law_itself_is_among_the_stable_factors(ask) -> None:
    """Of both loops: crossovers and a map on one side, a scan and intervals of the circle on the other."""
    found = ask(LAB, LAW)
    delays = found.delay_margin_seconds * np.array([0.0, 0.99, 1.01])
    inside = [any(low < 1 < high for low, high in each) for each in found.factor_intervals(delays)]
    assert inside == [True, True, False]


def test_what_nothing_bounds_beyond_the_band_is_not_called_exact() -> None:
    """A pin without inertia: |L| falls through 1 beyond its band, where the delay margin is smaller.

    There the beam is a damped shaft in rotation, theta/M = 1/(s I sqrt(rho E (1 + C s))): |L| = 1 at about
    (K1/I)^2/(rho E C), with an angle of 135 degrees from -1.
    """
    arm, law = odd_arms()["free-pin"], HubFeedback(K1=0.283)
    found = margins(arm, law)
    link = arm.link
    omega = (law.K1 / link.section.second_moment) ** 2 / (link.density * link.youngs_modulus * link.damping)
    assert omega > found.in_band.band
    L = loop_of(arm, law).loop_function(1j * omega * np.array([0.5, 2.0]))
    assert abs(L[0]) > 1 > abs(L[1])
    assert np.mod(np.angle(-L), 2 * np.pi) == pytest.approx([0.75 * np.pi] * 2, abs=0.2)
    assert 0.75 * np.pi / (0.5 * omega) < 0.5 * found.in_band.delay
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, 2.0, 1.0)


def test_resonances_too_narrow_for_any_grid_bound_the_exact_delay_margin() -> None:
    """With C = 1e-10 s modes 13 to 19 of the paper's arm ring through |L| = 1; by the product of 4x4 matrices."""
    arm = BARE.with_numbers(damping=1e-10)

    def minus_L(omega: float) -> complex:
        rate, moment = (complex(each) for each in transition(arm, 1j * omega, ("hub_rate", "root_moment"), 20).values())
        return -(LAW.K1 * rate + LAW.K2 * moment)

    borne = []
    for omega in tfarm.modes(arm, 22).natural_frequency[10:]:
        for flank in (0.97, 1.03):
            if abs(minus_L(omega)) > 1:
                crossing = brentq(lambda w: abs(minus_L(w)) - 1, *sorted((omega, flank * omega)), xtol=1e-12 * omega)
                borne.append(np.angle(minus_L(crossing)) % (2 * math.pi) / crossing)
    found = margins(arm, LAW)
    assert found.exact_delay == found.in_band.delay == pytest.approx(min(borne), rel=1e-6)


@pytest.mark.parametrize(("arm", "law"), thinned([*LOOPS, (BARE, LAW), (held(0.0), HubFeedback(K1=0.3, Kp=-2.0))], 3))
def test_the_loop_bears_just_less_than_the_gain_margin(arm, law) -> None:
    low, high = margins(arm, law).in_band.gain
    assert 0 <= low < 1 < high
    if high < math.inf:
        assert verdict_of(arm, law.times(high * (1 - 1e-6))).word == "stable"
        assert verdict_of(arm, law.times(high * (1 + 1e-6))).word == "unstable"
    if low > 0:
        assert verdict_of(arm, law.times(low * (1 - 1e-6))).word == "unstable"


def test_without_damping_the_exact_margins_are_zero_and_those_in_range_positive() -> None:
    found = margins(BARE, LAW)
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (0.0, 0.0, math.inf)
    assert 0 < found.in_band.delay < 1e-3
    assert 0 < found.in_band.disk < 1e-2
    wider = margins(BARE, LAW, band=4 * found.in_band.band)
    assert wider.in_band.delay < found.in_band.delay
    assert wider.in_band.disk < found.in_band.disk
    assert found.in_band.gain == (0.0, pytest.approx(1 / 0.3))
    assert margins(BARE, HubFeedback(K1=0.3, K2=-2.0)).in_band.gain == (0.0, math.inf)


@pytest.mark.parametrize(
    ("arm", "law"),
    [
        (LAB, HubFeedback(K1=0.3, K2=1.2)),
        (LAB, HubFeedback(K1=-0.3, K2=0.3)),
        (LAB, HubFeedback(K2=0.3)),
        (LAB, HubFeedback()),
        (BARE, HubFeedback(K1=0.3, K2=1.0)),
        (exceptional(), LAW),
    ],
)
def test_no_margin_without_stability(arm, law) -> None:
    answer = to_dict(margins(arm, law))
    assert answer["verdict"] != "stable"
    keys = ("delay_margin_s", "disk_margin", "gain_margin", "peak_sensitivity", "in_range")
    assert all(answer[key] is None for key in keys)
    assert answer["gain_crossovers"] == answer["phase_crossovers"] == []
    assert [row["interval"] for row in answer["stability_intervals"]] == [None] * 3


def test_the_loop_function_of_no_gains_limits_nothing() -> None:
    pin = replace(LAB, hub=Hub(inertia=0.0), payload=held().payload)
    found = margins(pin, HubFeedback())
    assert found.stability.word == "stable"
    assert (found.in_band.phase, found.in_band.delay) == (math.inf, math.inf)
    assert found.in_band.peak_sensitivity == 1.0


@pytest.mark.parametrize("band", [1000.0, 20000.0])
def test_a_passive_hub_keeps_its_disk_margin_without_damping(band):
    """At C = 0 and K2 = 0 L = i K1 w theta is imaginary: |S| <= 1, disk margin 2 in any band; any delay is too long."""
    found = margins(BARE, HubFeedback(K1=0.3, K2=0.0), band)
    # eps |L|, and |L| is 1e8 next to a pole
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == pytest.approx((0.0, 2.0, 1.0), rel=1e-7)


def test_a_dip_is_found_to_nine_digits_however_narrow_it_is() -> None:
    """|i w - p| of a pole is least at its imaginary part, where it is the real part: a millionth of a rad/s in 1e5."""
    for real, imag in ((-1e-6, 12345.678), (-1e-3, 1.2e5), (-0.3, 2.0)):
        omega = imag + abs(real) * np.array([-40.0, -2.1, -0.9, 0.37, 1.3, 50.0])
        least, at = lowest(lambda w, p=complex(real, imag): abs(1j * w - p), omega)
        assert least == pytest.approx(abs(real), rel=1e-9)
        assert abs(at - imag) < 1e-4 * abs(real)


@pytest.mark.parametrize("Kp", [1e-3, 0.5, 20.0])
def test_where_an_angle_is_held_alone_L_settles_nowhere_at_rest(Kp) -> None:
    """L ~ Kp/(J s^2): its factor at the lowest frequency is small, and no crossing; every one listed is one."""
    law = HubFeedback(K1=0.3, K2=0.3, Kp=Kp)
    for w, factor in margins(LAB, law).in_band.phase_crossovers:
        assert w > 0
        assert abs(1 + factor * loop_of(LAB, law).loop_function(np.array([1j * w]))[0]) < 1e-6


@pytest.mark.parametrize("share", [1e-3, 1e-5])
def test_the_peak_of_the_sensitivity_next_to_a_pole_near_the_axis_is_found(share):
    """With both gains just below the gain margin, L is that share from -1 at its frequency."""
    gain = margins(LAB, LAW).in_band.gain[1] * (1 - share)
    assert margins(LAB, HubFeedback(K1=0.3 * gain, K2=0.3 * gain)).exact_peak >= 1 / share * (1 - 1e-6)


LEAD = {"hub_angle": ([3.0, 20.0], [0.002, 1.0]), "root_moment": ([0.2], [1e-4, 2e-2, 1.0])}  # num and den in s
POWERS = {"phase": 0, "phase_lag": 0, "phase_lead": 0, "delay": 1, "disk": 0, "peak_sensitivity": 0}
POWERS |= {"peak_complementary": 0}
TOLD = ("word", "unstable_roots")


def digits(*numbers):
    """How many significant digits the shortest of them is written with."""
    return min(len(repr(abs(each)).split("e")[0].replace(".", "").strip("0")) for each in numbers)


def agree(here, there, unit=1.0):
    """Whether two numbers are one, to the digits that the shorter is given with."""
    shown = digits(here, there)
    return here * unit == there or abs(here * unit - there) <= 3 * 10.0 ** (1 - shown) * abs(there)


def close(here, there, rel):
    """Whether arrays are of one shape and size."""
    here, there = np.asarray(here, dtype=float), np.asarray(there, dtype=float)
    return here.shape == there.shape and np.allclose(there, here, rtol=rel, atol=0.0)


def apart(here, there, units):
    """Which margins (`LoopMargins`) of a loop and of the same in other units are not the same."""
    time = units.time
    same = {name: agree(getattr(here, name), getattr(there, name), time**power) for name, power in POWERS.items()}
    same |= {f"at {name}": close(here.at[name], there.at[name] * time, 1e-5) for name in POWERS}
    same["gain"] = close(here.gain, there.gain, 1e-7)
    for name in ("gain_crossovers", "phase_crossovers"):
        mine, theirs = (np.array(getattr(each, name)).reshape(-1, 2) for each in (here, there))
        same[name] = close(mine[:, 0], theirs[:, 0] * time, 1e-9)
        same[name] &= all(agree(*pair) for pair in zip(mine[:, 1].tolist(), theirs[:, 1].tolist(), strict=False))
    return [name for name, is_one in same.items() if not is_one]


def differing(arm, law, units):
    """What is not the same of verdict, windows and margins of the loop and of that in other units."""
    here, there = margins(arm, law), margins(units.arm(arm), units.law(arm, law))
    same = {name: getattr(here.stability, name) == getattr(there.stability, name) for name in TOLD}
    for name, windows in here.windows.items():
        unit = units.law(arm, HubFeedback(**{name: 1.0}))[name]
        same[f"windows of {name}"] = close(np.multiply(windows.all, unit), there.windows[name].all, 1e-5)
    same["margins"] = (there.in_band is None) == (here.in_band is None)
    found = [name for name, is_one in same.items() if not is_one]
    return found if found or here.in_band is None else apart(here.in_band, there.in_band, units)


@pytest.mark.parametrize("seed", thinned(range(16), 8))
def test_random_rigs_have_the_same_margins(seed):
    """Where poles are too narrow for doubles too: fewer digits are given then, and no crossing that is a pole."""
    rng = np.random.default_rng([41, seed])
    rigs = (some_rig(rng) for _ in range(20))
    arm = next(arm for arm in rigs if arm.input != "hub_angle" and not arm.is_locked)
    unit = default_gains(arm)
    law = HubFeedback(K1=unit.K1 * float(10 ** rng.uniform(-1, 3)), K2=unit.K2 * float(rng.uniform(-3, 3)))
    assert differing(arm, law, EITHER["slow" if seed % 2 else "fast"]) == []


@pytest.mark.parametrize("units", EITHER.values(), ids=EITHER)
@pytest.mark.parametrize("arm", [LAB, CLAMP], ids=lambda arm: arm.name)
def test_a_map_has_the_same_counts(arm, units):
    K1, K2 = np.linspace(-1.03, 2, 7), np.linspace(-2.04, 2, 8)
    here = gain_map(arm, K1, K2)
    unit = units.law(arm, HubFeedback(K1=1.0, K2=1.0))
    there = gain_map(units.arm(arm), K1 * unit.K1, K2 * unit.K2)
    np.testing.assert_array_equal(there.unstable, here.unstable)
    np.testing.assert_allclose(there.boundary[:, 0], here.boundary[:, 0] * unit.K1, rtol=1e-6)


@pytest.mark.parametrize("name", thinned(EITHER, 2))
def test_a_law_with_dynamics_has_the_same_margins(name):
    units = EITHER[name]
    other, law = units.arm(LAB), units.law(LAB, LEAD)
    here, there = tfarm.margins(LAB, tfarm.Law(LEAD)), tfarm.margins(other, law)
    assert there.stability.word == here.stability.word == "stable"
    assert apart(here.in_band, there.in_band, units) == []
    here, there = tfarm.closed_loop_poles(LAB, tfarm.Law(LEAD), 9), tfarm.closed_loop_poles(other, law, 9)
    np.testing.assert_allclose(there.values * units.time, here.values, rtol=1e-9)


def test_a_slow_pair_is_no_real_pole_to_a_locus():
    """Under next to no stiffness an arm swings as a rigid one, at 2e-4 rad/s."""
    w, ratio = 2e-4, 0.1
    law = Law({"hub_angle": w * w * LAB.total_inertia, "hub_rate": 2 * ratio * w * LAB.total_inertia})
    found = tfarm.locus(LAB, law, "gain", 0.5, 1.0, points=3, branches=1).branches[:, -1]
    slow = found[abs(found) < 1e-3]
    np.testing.assert_allclose(slow, [w * complex(-ratio, math.sqrt(1 - ratio**2))], rtol=1e-4)


def test_without_losses_no_law_is_quiet_however_little_it_feeds_back(monkeypatch):
    """At each of its modes |L| is infinite, though between them it is 1e-12: exact margins are not reported."""
    monkeypatch.setattr("tfarm.loop.margins.windows_of", lambda _: {})  # which take longest
    found = tfarm.margins(BARE, Law({"hub_rate": ([1e-12, 1e-12], [1.0, 2.0])}), band=1000.0)
    assert found.stability.is_stable
    assert found.in_band is not None
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, None, None)


def test_models_that_nothing_damps_are_not_unstable_by_rounding():
    """Their poles are at up to 6e4 rad/s, and right of the axis by some last digits."""
    arm = tfarm.load("stocky-steel").with_numbers(damping=0.0)
    found = tfarm.spill(arm, Law({"hub_angle": 1.0, "root_moment": 0.3}), 4)
    assert found.rightmost.real.max() > 0
    assert found.unstable.tolist() == [0] * 4
    assert found.destabilised_poles.size == 0


def test_margins_look_at_what_is_narrow_in_the_law_itself():
    """A notch a ten-millionth wide."""
    w, ratio = 40.0, 1e-7
    law = Law({"hub_rate": ([0.3, 0.0, 0.3 * w * w], [1.0, 2 * ratio * w, w * w])})
    loop = loop_of(LAB, law)
    poles = Poles(loop, np.empty(0, complex), Box(-100.0, 10.0, -100.0, 100.0))
    omega = Stability(loop, "stable", 0, False, 100.0, "", poles).frequencies
    assert (abs(omega - w) <= 2 * ratio * w).sum() > 5
