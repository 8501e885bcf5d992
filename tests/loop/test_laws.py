"""Any law on the exact arm: against gains at the hub, python-control, models closed otherwise, and theorems."""

import json
import re
from dataclasses import replace
from importlib import import_module
from itertools import pairwise, product
from types import SimpleNamespace

import control
import numpy as np
import pytest

import tfarm
from tests.loop.arms import loop_of, some_loop, verdict_of
from tests.loop.law_counts import judge, some_delay, some_law
from tests.shared import refusal, remember, sized, thinned
from tests.shell import run
from tfarm import ConvergenceError, HubFeedback, Law, ParameterError
from tfarm.case import Case
from tfarm.loop.lines import through_infinity, with_numbers
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.plane import plane
from tfarm.loop.plane_axes import cell_middles
from tfarm.loop.poles import poles_below
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.spillover import Spill
from tfarm.loop.theorem import cancel_hub_moment, definite, exact_polynomial, is_hurwitz, on_axis, signs_of
from tfarm.reduced.modal import closed_loop_matrix, sensed_model
from tfarm.response.signals import Signals

LAB, BARE, RIG = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "quanser-2dsfl"))


def test_signals_are_the_transfer_functions_at_rest_too():
    names = ("hub_angle", "tip_acceleration", "moment@0.2", "deflection@0.4", "rotation@0.3", "shear@0.1")
    read = Signals(LAB, names)
    for s in (1e-4j, 1e-2 + 1e-2j, 0.05j, 3j, 400 + 900j):
        for name, value in zip(names, read.values(np.array([s]))[:, 0], strict=True):
            output, _, x = name.partition("@")
            exact = tfarm.transfer(LAB, output, x=float(x) if x else None)(s)
            assert abs(value - exact) < 1e-11 * abs(exact), (name, s)  # (s/w1)^2 of the digits at the switch: 1e-5


@pytest.mark.parametrize("delay", thinned([0.002, 0.0], 2))
def test_margins_of_a_law_are_those_of_python_control_on_a_model(delay):
    """Order 40, the loop function's own values on a fine grid, so that the delay is exact."""
    s = control.tf("s")
    law = Law({"hub_angle": (2 * s + 1) / (0.01 * s + 1), "tip_acceleration": 0.05 / (s / 50 + 1)}, delay=delay)
    omega = np.unique(np.r_[np.geomspace(0.05, 1000, 900), np.linspace(40, 260, 1200)])
    G = control.ss(*sensed_model(LAB, law.signals, 20))(1j * omega)[:, 0]
    L = np.exp(-1j * omega * delay) * (law.values(1j * omega) * G).sum(axis=0)
    gm, pm, _, wpc, wgc, _ = control.stability_margins(control.FRD(L, omega), returnall=True)
    mine = verdict_of(LAB, law).in_band
    by_phase = [pair for pair in mine.phase_crossovers if omega[0] < pair[0] < omega[-1]]
    by_gain = [pair for pair in mine.gain_crossovers if omega[0] < pair[0] < omega[-1]]
    np.testing.assert_allclose([w for w, _ in by_gain], np.sort(wgc), rtol=2e-5)  # the model's own error at 260 rad/s
    theirs = [(angle + 180) % 360 - 180 for _, angle in sorted(zip(wgc, pm, strict=True))]
    np.testing.assert_allclose([a for _, a in by_gain], theirs, atol=0.02)
    shown = sorted((w, g) for w, g in zip(wpc, gm, strict=True) if w < 300)
    np.testing.assert_allclose([p for p in by_phase if p[0] < 300], shown, rtol=1e-3)


@pytest.mark.parametrize("number", sized(2, 5))
def test_random_loops_have_as_many_unstable_poles_by_a_second_method(number):
    rng, words = np.random.default_rng(5), []
    for _ in range(number):
        arm = some_loop(rng)[0]
        words.append(judge(arm, some_law(rng, arm, delay=some_delay(rng, arm) if arm.damping else 0.0)))
    assert set(words) <= {"right", "no second count"}
    assert words.count("right") >= 2


def test_poles_of_a_delayed_integrator_are_those_of_the_lambert_function():
    """A rigid hub of great inertia: J s + K e^{-s tau} has its poles at W_n(-K tau/J)/tau."""
    from scipy.special import lambertw

    J = 1e6
    arm = replace(LAB, hub=replace(LAB.hub, inertia=J))
    K, tau = 1.5 * J, 2.0
    poles = poles_below(loop_of(arm, Law({"hub_rate": K}, delay=tau)), 12.0).nonzero
    expected = np.array([lambertw(-K * tau / J, n) / tau for n in range(-4, 5)])
    for pole in poles:
        assert abs(expected - pole).min() < 1e-5 * abs(pole)  # the link's share of the inertia: 1e-6 of it
    inside = [w for w in expected if 0 <= w.imag < 12 and w.real > -2 / tau]
    assert len(poles) >= len(inside) > 2


def test_without_damping_a_delay_drives_ever_more_modes():
    law = Law({"hub_rate": 0.3, "root_moment": 0.3}, delay=0.005)
    found = [verdict_of(BARE, law, band) for band in (3e3, 1e4, 3e4)]
    assert all(each.unstable_roots_infinite and each.word == "unstable" for each in found)
    counts = [each.unstable_roots for each in found]
    assert all(a < b for a, b in pairwise(counts))


def test_a_law_with_a_sign_is_known_beyond_the_band_by_its_theorem():
    """A passive law drives nothing whatever holds the hub; positive position feedback must be held against too."""
    passive, ppf = (Law({"hub_angle": each}) for each in (([2.0, 1.0], [0.01, 1.0]), ([-3.0], [1.0, 2.0, 5.0])))
    for arm in (BARE, LAB, RIG):
        found = verdict_of(arm, passive)
        assert (found.word, found.is_known_beyond) == ("stable", True)
    for arm in (LAB, BARE):
        held = replace(arm, hub=replace(arm.hub, stiffness=0.7))
        assert "dissipates energy" in (tail := verdict_of(held, passive).tail)
        assert "imaginary" not in tail
        assert "strictly negative imaginary" in verdict_of(held, ppf).tail
    washout = verdict_of(BARE, Law({"hub_rate": ([0.3, 0.0], [1.0, 5.0])}))
    assert washout.word == "marginal"  # the hub drifts: two poles stay at 0
    assert (washout.poles.values == 0).sum() == 2


def test_an_inertia_that_a_law_takes_off_the_hub_is_not_passive():
    """C(s)/s = m s + 1 + 1/s has Re 1 on the axis for either sign of m, and Re m right of it, far out."""
    for signal, nums in {
        "hub_angle": {(1.0, 1.0, 1.0): "strictly passive", (-1.0, 1.0, 1.0): "", (-0.001, 1.0, 1.0): ""},
        "hub_rate": {(1.0, 1.0): "strictly passive", (-1.0, 1.0): "", (1.0, 1.0, 1.0): ""},
    }.items():
        assert {num: signs_of(Law({signal: (num, [1.0])})).kind for num in nums} == nums


def test_positive_position_feedback_needs_a_spring_that_is_stiffer():
    """-C = 3/(s^2 + 2 s + 5) is strictly negative imaginary, C(0) = -0.6."""
    filters = ([-3.0], [1.0, 2.0, 5.0])
    assert signs_of(Law({"hub_angle": filters})).kind == "negative imaginary"
    assert verdict_of(LAB, Law({"hub_angle": filters})).unstable_roots == 1
    for Kp, stable in ((0.5, False), (0.7, True)):
        held = Law.of_matrices([[-2.0, -5.0], [1.0, 0.0]], [[1.0], [0.0]], [[0.0, -3.0]], [[Kp]], ["hub_angle"])
        num = np.polyadd(Kp * np.array([1.0, 2.0, 5.0]), [-3.0])
        fraction = Law({"hub_angle": (num.tolist(), [1.0, 2.0, 5.0])})

        assert verdict_of(LAB, held).is_stable == verdict_of(LAB, fraction).is_stable == stable
        assert verdict_of(BARE, fraction).is_known_beyond  # a pole crosses the axis at s = 0 alone: no mode is driven


def test_signs_of_polynomials_are_those_of_their_roots():
    rng = np.random.default_rng(7)
    for _ in range(60):
        roots = rng.integers(-5, 6, size=rng.integers(1, 6)).tolist()
        poly = exact_polynomial(np.poly(roots).round().tolist())
        odd = any(roots.count(r) % 2 for r in roots if r > 0)
        assert definite(poly) == ("" if odd else "not below" if max(roots) > 0 else "above"), roots
        assert is_hurwitz(poly) == (max(roots) < 0)
    for _ in range(60):
        c = rng.integers(-9, 10, size=rng.integers(2, 8)).tolist()
        roots = np.roots(c)
        if c[0] and abs(roots.real).min(initial=1.0) > 1e-6:
            assert is_hurwitz(exact_polynomial(c)) == bool((roots.real < 0).all()), c


@pytest.mark.parametrize(
    ("entries", "others", "key"),
    [
        ({"root_moment": ([1.0, 0.0, 0.0], [1.0])}, {}, "law.root_moment.num"),
        ({"hub_angle": ([1.0, 0.0, 0.0], [1.0])}, {}, "law.hub_angle.num"),
        ({"hub_speed": 1.0}, {}, "output"),
        ({"strain": 1.0}, {}, "strain.x"),
        ({"moment@9": 1.0}, {}, "moment@9"),
        ({"hub_rate@0.1": 1.0}, {}, "hub_rate@0.1"),
        ({"hub_rate": 1.0}, {"period": 0.01}, "period"),
        ({"hub_rate": 1.0}, {"input": "motor_current"}, "input"),
    ],
)
def test_no_loop_is_refused_by_its_key(entries, others, key):
    assert refusal(loop_of, LAB, Law(entries, **others)).key == key


def test_an_unstable_cancellation_in_the_law_is_reported():
    law = Law({"hub_angle": {"zeros": [2.0], "poles": [2.0, -5.0], "gain": 1.0}, "hub_rate": 0.3})
    (words,) = loop_of(LAB, law).warnings
    assert "cancels its own unstable pole" in words
    assert verdict_of(LAB, law).unstable_roots == 1


def test_commands_take_a_law_from_a_file_or_the_arm_s_own(capsys, tmp_path, monkeypatch):
    remember(monkeypatch, import_module("tfarm.loop.margins"), "margins")  # three commands call it alike
    text = "[law]\nname = 'PD'\ndelay = 0.002\n[law.hub_angle]\nnum = [2.0, 1.0]\nden = [0.01, 1.0]\n"
    (tmp_path / "law.toml").write_text(text)
    (tmp_path / "arm.toml").write_text(tfarm.arm.to_toml(LAB) + "\n" + text)
    code, of_file, err = run(capsys, "margins", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), "--json")
    assert (code, err) == (0, "")
    code, of_arm, _ = run(capsys, "margins", str(tmp_path / "arm.toml"), "--json")
    assert json.loads(of_arm) == json.loads(of_file)
    answer = json.loads(of_file)
    law = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)
    assert answer["in_range"]["phase_margin_deg"] == tfarm.margins(LAB, law).in_band.phase
    assert answer["law_order"] == 1
    code, out, _ = run(capsys, "margins", str(tmp_path / "arm.toml"))
    assert re.search(r"^stability +stable$", out, re.MULTILINE)
    code, out, _ = run(capsys, "poles", str(tmp_path / "arm.toml"), "--K1", "0.3", "--json")
    assert json.loads(out)["K1"] == 0.3  # gains that are typed come before the file's law
    assert run(capsys, "margins", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), "--K1", "1")[0] == 2
    assert run(capsys, "margins", "sasaki2012-lab", "--law", "sasaki2012")[0] == 2


def with_a_notch():
    """Tip feedback with its notch above mode 1: stable with two modes, unstable with the third."""
    s, w = control.tf("s"), float(tfarm.modes(BARE, 1).natural_frequency[-1])
    notch = (s**2 + 0.02 * w * s + (1.08 * w) ** 2) / (s**2 + 1.4 * w * s + w**2)
    return Law({"tip_displacement": 3.0 * notch * (0.3 * s + 1) / (0.015 * s + 1)})


def test_a_law_stable_on_two_modes_drives_the_third():
    found = tfarm.spill(BARE, with_a_notch(), 6)
    assert found.unstable[:2].tolist() == [0, 0]
    assert (found.unstable[2:] > 0).all()
    assert (found.verdict.is_stable, found.first_mode, found.shown_from) == (False, 3, 3)
    third = tfarm.modes(BARE, 3).natural_frequency[-1]
    assert abs(found.destabilised_poles[0].imag - third) < 0.01 * third
    with pytest.warns(DeprecationWarning, match=r"it is Spill\.destabilised_poles"):
        assert found.driven[0] == found.destabilised_poles[0]
    assert "models of 1 to 2 modes are stable" in found.in_words


@pytest.mark.parametrize(("C", "most"), [(1e-3, 9), (2e-2, 12)])
def test_models_of_a_strongly_damped_arm_have_no_poles_of_higher_modes(C, most):
    """A search of nine modes has all of them at the first C; one of twelve at the second leaves real poles to none."""
    arm, law = LAB.with_numbers(damping=C), Law({"hub_angle": 1.0, "root_moment": -2.0})
    found = tfarm.spill(arm, law, most)
    for number in (1, 2, 4, 7):
        A, B, C, D = sensed_model(arm, law.signals, number)
        poles = np.linalg.eigvals(closed_loop_matrix((A, B, C, 0 * D), law.matrices()))
        poles = poles[abs(poles) > 1e-6]
        assert found.unstable[number - 1] == (poles.real > 0).sum()
        assert found.rightmost[number - 1].real == pytest.approx(poles.real.max(), rel=1e-8)


FOUND = {  # unstable poles of each model; driven poles of the exact loop; printed text
    "some": ([0, 0, 2], [-0.1 + 9j, 1 + 204j], "mode 2 is unstable in the exact loop, at 204.002 rad/s; "
             "models of 1 to 2 modes are stable, those from 3 modes on are not"),
    "one": ([0, 2, 2], [1 + 204j], "the model of 1 mode is stable, those from 2 modes on are not"),
    "all": ([0, 0, 0], [1 + 204j], "models of 1 to 3 modes are stable, the largest among them"),
    "none": ([1, 1, 2], [2.0], "a pole below the first mode is unstable in the exact loop, at 2 rad/s, "
             "and every model is unstable"),
    "scattered": ([0, 2, 0], [1 + 204j], "2 of the models up to 3 modes are stable, the largest among them"),
    "stable": ([0, 0, 0], [-1 + 2j], "none: the exact loop is stable in the frequency range"),
}  # fmt: skip


@pytest.mark.parametrize("name", FOUND)
def test_spillover_in_words(name):
    unstable, poles, words = FOUND[name]
    loop = SimpleNamespace(arm=LAB)
    verdict = SimpleNamespace(
        poles=SimpleNamespace(nonzero=np.array(poles, complex)), loop=loop, band=300.0, word="stable",
        is_known_beyond=False,
    )  # fmt: skip
    found = Spill(verdict, np.arange(1, 4), np.array(unstable), np.array([-1.0, 1 - 2j, 2.0]))
    assert found.in_words.endswith(words)
    assert found.shown_from == {"some": 3, "one": 2, "none": 1}.get(name)
    assert [each.rightmost.imag for each in found.models] == [0.0, 2.0, 0.0]


UNSTABLE = {"hub_angle": {"zeros": [-3.0], "poles": [4.0, -60.0], "gain": 900.0}, "hub_rate": 0.5}


@pytest.mark.parametrize(
    ("arm", "law"),
    [
        (LAB, Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)),
        (LAB, Law(UNSTABLE)),
        (BARE, Law({"hub_rate": 0.3, "tip_acceleration": ([0.05], [0.02, 1.0])})),
        (BARE, with_a_notch()),
        (LAB, Law({"hub_rate": ([0.3, 0.0], [1.0, 0.0, 900.0]), "root_moment": 0.2})),  # poles of the law on the axis
    ],
    ids=["PD", "unstable by itself", "acceleration", "notch", "resonant"],
)
def test_turns_around_the_point_are_the_poles_that_were_found(arm, law):
    plot = tfarm.nyquist(arm, law)
    assert plot.unstable_by_nyquist == plot.verdict.unstable_roots
    assert plot.unstable_open == (law.poles.real > 0).sum()
    assert plot.encirclements == plot.unstable_open - plot.unstable_by_nyquist
    assert np.isfinite(plot.L[~plot.is_arc]).all()


SAMPLED = {  # poles of L on the circle: of the rigid body, of all modes, of a resonator; and an unstable one of a law
    "gains": HubFeedback(K1=0.3, K2=-0.3),
    "late": Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002),
    "resonator": Law({"hub_rate": ([0.3, 0.0], [1.0, 0.0, 900.0]), "root_moment": 0.2}),
    "unstable by itself": Law(UNSTABLE),
}


@pytest.mark.parametrize(("arm", "name"), [*product((LAB, BARE), SAMPLED)])
def test_around_the_circle_turns_are_the_eigenvalues_outside(arm, name):
    """Of the closed-loop matrix; one that is on the circle to nine digits counts either way."""
    plot = nyquist_of(sampled_verdict(Case(arm, SAMPLED[name])))
    radii = abs(np.linalg.eigvals(plot.verdict.full.matrix()))
    outside = int((radii > 1 + 1e-9).sum())
    assert outside <= plot.unstable_by_nyquist <= (radii > 1 - 1e-9).sum()
    assert plot.unstable_open == (name == "unstable by itself")
    assert plot.encirclements == plot.unstable_open - plot.unstable_by_nyquist
    assert plot.s.imag.max() <= np.pi / plot.verdict.full.period


def test_parts_on_the_axis_are_those_of_the_quotient_there():
    """Real part, and imaginary part over w, of num/den at i w, times |den|^2: exact polynomials in w^2."""
    rng = np.random.default_rng(12)
    for _ in range(6):
        num, den = rng.uniform(-2, 2, rng.integers(1, 5)), rng.uniform(-2, 2, rng.integers(2, 6))
        real, imaginary = on_axis(exact_polynomial(num), exact_polynomial(den))
        for w in (0.3, 1.7):
            whole = np.polyval(num, 1j * w) * np.conj(np.polyval(den, 1j * w))
            assert float(real.eval(w * w)) == pytest.approx(whole.real, rel=1e-12, abs=1e-13)
            assert w * float(imaginary.eval(w * w)) == pytest.approx(whole.imag, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("rest", thinned([-1e-9, 1e-4, 1e-7, -1e-7, 1e-9], 4))
def test_however_slow_a_law_s_corner_is_its_slow_pole_is_on_its_own_side(rest):
    """s + rest on the angle and 0.3 s on top: the pole at rest is at -rest/1.3, never taken for one at 0 itself."""
    law = Law({"hub_angle": ([1.0, rest], [0.1, 1.0]), "hub_rate": 0.3})
    found = verdict_of(tfarm.load("sasaki2012-lab"), law)
    slowest = found.poles.values[abs(found.poles.values).argmin()]
    assert slowest == pytest.approx(-rest / 1.3, rel=1e-3)
    assert (found.word, found.unstable_roots) == (("stable", 0) if rest > 0 else ("unstable", 1))


LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)


@pytest.mark.parametrize(
    ("vary", "x", "y"),
    thinned(
        [
            (("hub_angle.num.0", "tip_acceleration.num.0"), (-1, 10), (-2, 2)),
            (("delay", "gain"), (0, 0.03), (-1, 9)),
            (("gain", "delay"), (-1, 9), (0, 0.03)),
            (("hub_angle.den.0", "gain"), (0.001, 0.1), (-1, 60)),
            (("gain", "hub_angle.num.0"), (-1, 9), (-1, 10)),
        ],
        2,
    ),
)
@pytest.mark.parametrize("points", sized(2, 4))
def test_counts_are_those_of_full_searches(vary, x, y, points):
    found = plane(loop_of(LAB, LAW), vary, cell_middles(*x, 8), cell_middles(*y, 10))
    assert len(np.unique(found.unstable)) > 2
    for i, j in np.random.default_rng(1).integers((8, 10), size=(points, 2)):
        law = with_numbers(LAW, dict(zip(vary, (found.x[i], found.y[j]), strict=True)))
        assert verdict_of(LAB, law, found.band).unstable_roots == found.unstable[j, i], law


def test_the_impedance_matching_gain_of_a_massless_hub_moves_a_pole_to_infinity():
    """At C = 0 a hub without inertia feels the impedance of an endless beam far right: I sqrt(E rho)."""
    arm = BARE.with_numbers(hub_inertia=0.0)
    far = np.array([1e6, 1e7, 1e8], complex) * tfarm.modes(arm, 1).natural_frequency[1]
    drive, (_, rate, _), _ = loop_of(arm, Law({"hub_rate": 1.0})).signals.parts(far)
    assert through_infinity(drive, rate) == -1  # right of the axis at smaller gains alone, farther right
    assert through_infinity(drive * far, rate) == 0


@pytest.mark.parametrize(
    ("vary", "key"),
    [
        (("gain", "gain"), "vary"),
        (("gain", "hub_speed"), "law"),
        (("gain", "hub_angle.num.7"), "law"),
        (("hub_angle.den.0", "gain"), "hub_angle.den.0"),  # a leading coefficient keeps its sign
        (("gain", "hub_angle.den.0"), "hub_angle.den.0"),
    ],
)
def test_what_is_no_pair_of_numbers_is_refused(vary, key):
    assert refusal(plane, loop_of(LAB, LAW), vary, *[np.array([-0.1, 0.03])] * 2).key == key


def test_a_map_around_a_law_s_own_resonance_counts_as_the_verdict_does():
    """Two zeros close to each other turn the phase once around between two points of a contour of even steps."""
    law = Law({"hub_angle": 1.0, "hub_rate": 0.3, "tip_deflection": ([-100.0], [1.0, 2 * 0.02 * 39.487, 39.487**2])})
    lab, values = tfarm.load("sasaki2012-lab"), np.linspace(0.9, 1.1, 3)
    assert verdict_of(lab, law).is_stable
    assert plane(loop_of(lab, law), ("hub_angle", "tip_deflection.num.0"), values, values).stable.all()


def test_a_map_whose_counts_do_not_hold_at_its_corners_is_refused():
    """As if a pair had come into the band through its top, on the way to the last corner; one that rests is open."""
    law = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])})
    vary, across, up = ("gain", "hub_angle.den.1"), np.array([1.0, 5.0, 20.0]), np.array([0.5, 1.0, 3.0])
    found = plane(loop_of(LAB, law), vary, across, up)
    found.must_agree(lambda x, y: None if x == 20.0 else 0, "")
    with pytest.raises(ConvergenceError, match=r"at gain = 20, hub_angle.den.1 = 3 2 poles .* not 0: ask for less"):
        found.must_agree(lambda x, y: 2 * (x == 20.0 and y == 3.0), "ask for less")


def test_the_count_of_two_poles_that_meet_at_rest_follows_the_lag():
    """J s^2 + g (1 - 0.1 s): one pole right of the axis for g < 0, and both for g > 0."""
    law, gains = Law({"hub_angle": ([-0.1, 1.0], [1e-3, 1.0])}), np.array([-0.02, 0.02])
    found = tfarm.map(LAB, np.array([1e-3, 2e-3]), gains, law=law, vary=("hub_angle.den.0", "gain"))
    assert found.unstable.tolist() == [[1, 1], [2, 2]]


GAINS = HubFeedback(K1=0.3, K2=0.3, Kp=2.0)
ACROSS, UP = np.array([0.5, 2.0, 6.0]), np.array([0.001, 0.01, 0.03])


ASK = [tfarm.closed_loop_poles, tfarm.margins, tfarm.nyquist, tfarm.sampled, tfarm.simulate, tfarm.spill]
ASK += [
    lambda arm, law: tfarm.compare(arm, [law, law]),
    lambda arm, law: tfarm.locus(arm, law, "K2", 0.0, 1.0),
    lambda arm, law: tfarm.map(arm, ACROSS, UP, law=law or 0, vary=("gain", "delay")),
]


@pytest.mark.parametrize("ask", ASK)
@pytest.mark.parametrize("law", [None, 3, "law.toml", LAB], ids=["none", "number", "path", "arm"])
def test_what_is_no_law_is_refused_everywhere(ask, law):
    with pytest.raises(ParameterError, match="give a HubFeedback or a Law"):
        ask(LAB, law)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: tfarm.tune(LAB, 3), "give a tfarm.tuner.Plan"),
        (lambda: tfarm.tune(LAB, None, 0.01), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.sampled(LAB, GAINS, 0.01), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.simulate(LAB, GAINS, 0.01, duration=0.1), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.compare(LAB, [GAINS, GAINS], chain=0.01), "give a tfarm.dsp.Chain"),
        (lambda: tfarm.map(LAB, LAW, UP), "give the law as law="),
        (lambda: tfarm.map(LAB, "K1", UP), "an ascending range"),
        (lambda: tfarm.map(LAB, ACROSS, UP, law=LAW), "two numbers of the law"),
        (lambda: tfarm.map(LAB, ACROSS, UP, vary=("gain", "delay")), "whose numbers vary names"),
        (lambda: tfarm.map(LAB, ACROSS, UP, 1.0, law=LAW, vary=("gain", "delay")), "give Kp in the law"),
        (lambda: tfarm.locus(LAB, GAINS, "K3", 0.0, 1.0), "known are: K1, K2"),
        (lambda: tfarm.locus(LAB, GAINS, 2, 0.0, 1.0), "the name of what varies, such as K2"),
        (lambda: tfarm.locus(LAB, LAW, "K2", 0.0, 1.0), "known are: gain, delay, hub_angle"),
        (lambda: tfarm.default_gains("sasaki2012"), "give tfarm.load"),
        (lambda: tfarm.damped_modes(LAB), "give what tfarm.modes returns"),
        (lambda: tfarm.overlay(LAB, "sweep.csv"), "give what tfarm.read_measured returns"),
        (lambda: tfarm.fit(LAB, "sweep.csv", ["hub.inertia"]), "give what tfarm.read_measured returns"),
        (lambda: tfarm.transfer(LAB, 3), "the name of an output"),
        (lambda: tfarm.plots.locus(LAB), "what tfarm.locus returns"),
    ],
)
def test_a_wrong_argument_is_refused_with_the_form_to_give(call, words):
    with pytest.raises(ParameterError, match=words):
        call()


def test_the_moment_that_a_static_law_cancels_is_its_gain_over_its_denominator():
    """A half over two is a quarter, and the rest of the law stays."""
    share, rest = cancel_hub_moment(loop_of(BARE, Law({"hub_rate": 0.3, "root_moment": ([0.5], [2.0])})))
    assert share == pytest.approx(0.25, rel=1e-15)
    assert "root_moment" not in rest.signals
    assert rest.gains.K1 == 0.3
