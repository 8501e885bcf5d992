"""The result card: the same numbers as the records', and as python-control's on other models of the same loops."""

import math
import re
from functools import cache

import control
import numpy as np
import pytest

import tfarm
from tests.shared import sized
from tests.shell import answer, run
from tests.synthesis.held_loop import HeldLoop
from tfarm.assessment import card
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, load_chain
from tfarm.loop.sampled_verdict import sampled_verdict, unaliased_poles
from tfarm.schema.terminal import table_lines

BARE, LAB = tfarm.load("sasaki2012"), tfarm.load("sasaki2012-lab")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)


@cache
def some_loops(count):
    """Arms with damped links under gains at the hub, both loops stable, at periods of 1 to 10 ms, with their cards."""
    rng, found = np.random.default_rng(20261126), []
    while len(found) < count:
        arm = LAB.with_numbers(damping=10 ** rng.uniform(-4, -3), payload_mass=LAB.payload.mass * rng.uniform(0.2, 3))
        law = tfarm.HubFeedback(K1=10 ** rng.uniform(-1, 0), K2=rng.uniform(-0.1, 0.5), Kp=10 ** rng.uniform(-1, 0.5))
        chain = Chain(sampling=Sampling(period=10 ** rng.uniform(-3, -2)))
        both = tfarm.margins(arm, law).stability.is_stable, sampled_verdict(Case(arm, law, chain)).is_stable
        found += [(arm, law, chain, tfarm.result_card(arm, law, chain))] if all(both) else []
    return found


def continuous_model(arm, law, _):
    """L(s) by python-control: the first modes of the arm with a static remainder, and the gains."""
    plant = tfarm.reduce(arm, ["hub_angle", "hub_rate", "root_moment"], order=30).state_space()
    return control.StateSpace([], [], [], [[law.Kp, law.K1, law.K2]]) * plant


def sampled_model(arm, law, chain):
    """L(z) by python-control: states of arm and law without feedback, and the row that closes the loop."""
    loop = sampled_verdict(Case(arm, law, chain)).full
    (A, b), closed = loop.rig.frame, loop.matrix()
    row = np.linalg.lstsq(b[:, None], A - closed, rcond=None)[0]
    return control.StateSpace(A, b[:, None], row, [[0.0]], chain.sampling.period)


@pytest.mark.parametrize("count", sized(1, 8))
@pytest.mark.parametrize(("name", "model"), [("continuous", continuous_model), ("sampled", sampled_model)])
def test_margins_of_random_loops_are_those_of_python_control(name, model, count):
    """To 1e-3: what a model of thirty states leaves out."""
    for arm, law, chain, card_of_both in some_loops(count):
        own = getattr(card_of_both, name)
        L = model(arm, law, chain)
        omega = np.geomspace(1e-2, math.pi / chain.sampling.period if L.isdtime() else 3e3, 10_000)
        curve = L(np.exp(1j * omega * L.dt) if L.isdtime() else 1j * omega)
        gains, phases, _, _, crossings, _ = control.stability_margins(control.FRD(curve, omega), returnall=True)
        up = min((gain for gain in gains if gain > 1), default=math.inf)
        assert 10 ** (own.gain_margin.value / 20) == pytest.approx(up, rel=1e-3)
        phase = abs((phases + 180) % 360 - 180)
        n = phase.argmin()
        assert own.phase_margin[:2] == pytest.approx((phase[n], crossings[n]), rel=1e-3)
        assert own.peak_sensitivity.value == pytest.approx(max(1.0, (1 / abs(1 + curve)).max()), rel=1e-3)


def crossings(omega, L, zero):
    """Frequencies [rad/s] and values of L where `zero` (n,) changes its sign, along a line between two points."""
    n = np.flatnonzero(zero[1:] * zero[:-1] <= 0)
    share = zero[n] / (zero[n] - zero[n + 1])
    return omega[n] + share * np.diff(omega)[n], L[n] + share * np.diff(L)[n]


@pytest.mark.parametrize(("loop", "error"), [("continuous", 1e-5), ("sampled", 1e-3)])
def test_margins_are_those_of_a_dense_grid(loop, error):
    """Of L by the arm's transfer functions, and of the samples by a Galerkin model under a hold."""
    own = getattr(tfarm.result_card(LAB, LAW), loop)
    if loop == "continuous":
        omega = np.geomspace(1e-2, 1e4, 400_000)
        L = 0.3 * tfarm.transfer(LAB, ["hub_rate", "root_moment"])(1j * omega).sum(axis=0)
        w, at = crossings(omega, L, abs(L) - 1)
        late = np.mod(math.pi + np.angle(at), 2 * math.pi) / w
        assert own.delay_margin.value == pytest.approx(1e3 * late.min(), rel=error)
    else:
        omega = np.linspace(0.1, 100 * math.pi, 10_000)
        L = HeldLoop(LAB, 0.01).loop(LAW, 0.01 * omega)
        w, at = crossings(omega, L, abs(L) - 1)
    phase = np.degrees(abs(np.angle(-at)))
    assert own.phase_margin[:2] == pytest.approx((phase.min(), w[phase.argmin()]), rel=error)
    factors = -1 / crossings(omega, L, L.imag)[1].real
    assert 10 ** (own.gain_margin.value / 20) == pytest.approx(factors[factors > 1].min(), rel=error)
    assert own.peak_sensitivity.value == pytest.approx(1 / abs(1 + L).min(), rel=error)
    assert own.disk_margin == pytest.approx((2 * abs(1 + L) / abs(1 - L)).min(), rel=error)


def test_of_a_small_rate_gain_the_card_is_that_of_a_rigid_arm():
    """L = K1/(J s), and K1 T/(J (z - 1)) of the samples, but for (w/w1)^2 = 1e-9 of the first mode."""
    T, w = 0.01, 4e-4 / LAB.total_inertia
    both = tfarm.result_card(LAB, tfarm.HubFeedback(K1=4e-4))
    turn = 2 * math.asin(w * T / 2)
    for own, omega, phase, slowest in (
        (both.continuous, w, 90.0, 1 / w),
        (both.sampled, turn / T, 90.0 - math.degrees(turn / 2), -T / math.log(1 - w * T)),
    ):
        assert own.phase_margin[:2] == pytest.approx((phase, omega), rel=1e-6)
        assert own.time_constant == pytest.approx(slowest, rel=1e-6)
    assert both.continuous.delay_margin.value == pytest.approx(1e3 * math.pi / 2 / w, rel=1e-6)
    assert (both.continuous.peak_sensitivity.value, both.continuous.disk_margin) == pytest.approx((1.0, 2.0), rel=1e-6)


@pytest.mark.parametrize(
    ("size", "margin", "grade"),
    [
        (6.0, "gain", "good"),
        (5.99, "gain", "low"),
        (2.99, "gain", "poor"),
        (math.inf, "phase", "good"),
        (2.0, "peak", "good"),
        (3.0, "peak", "low"),
        (math.inf, "peak", "poor"),
        (None, "periods", "-"),
    ],
)
def test_grades_change_at_their_limits(size, margin, grade):
    assert card.grade_of(size, margin) == grade


def test_delay_margin_disk_and_time_constant_are_those_of_the_records():
    found, at_samples = tfarm.margins(LAB, LAW), tfarm.sampled(LAB, LAW)
    both = tfarm.result_card(LAB, LAW)
    own = both.continuous
    assert (own.delay_margin.value, own.disk_margin) == (1e3 * found.exact_delay, found.exact_disk)
    assert own.delay_margin_periods == pytest.approx(found.exact_delay / 0.01, rel=1e-15)
    assert both.sampled.delay_margin.value == 1e3 * at_samples.delay_margin_seconds
    assert both.sampled.time_constant == at_samples.verdict.time_constant


def test_an_undamped_arm_keeps_its_stability_and_is_graded_with_a_little_damping():
    own = tfarm.result_card(BARE, LAW)
    C = card.reference_damping(BARE)
    graded = BARE.with_numbers(damping=C)
    assert tfarm.damped_modes(tfarm.modes(graded, 1)).damping_ratio[-1] == pytest.approx(1e-3, rel=1e-3)
    damped = tfarm.result_card(graded, LAW)
    assert own.continuous.phase_margin == damped.continuous.phase_margin
    assert (own.continuous.stability, own.sampled.stability) == ("stable", "unstable")
    assert own.sampled.phase_margin.value is None
    assert "undamped model" in own.notes[-1]
    figure = tfarm.sampled(BARE, LAW).minimum_damping
    assert (figure.value, figure.digits) == (own.sampled.minimum_damping, 4)
    sides = [tfarm.sampled(BARE.with_numbers(damping=share * figure.value), LAW) for share in (0.99, 1.01)]
    assert [each.verdict.is_stable for each in sides] == [False, True]


def test_print_and_notebook_show_the_card_and_a_narrow_terminal_opens_with_values(capsys):
    own = tfarm.result_card(LAB, tfarm.default_gains(LAB))
    assert "poor: phase margin, Ms; sampled, 10 ms stable, poor: phase margin" in repr(own)
    cell = r'<td class="text" data-label="continuous-time"[^>]*>7.901 at 63.28 rad/s, poor</td>'
    assert re.search(cell, own._repr_html_())
    print(own)
    lines = capsys.readouterr().out.splitlines()
    row = re.compile(r"phase margin +deg +7.901 at 63.28 rad/s, poor +26.15 at 63.4 rad/s, poor")
    assert any(map(row.fullmatch, lines))
    assert lines[-1] == own.notes[0]
    narrow = table_lines(own.table, 80)
    assert max(map(len, narrow)) <= 80
    assert narrow[1].split() == ["stability", "stable"]
    assert any(re.fullmatch(r"phase margin +deg +7.901 at 63.28 rad/s, poor", line) for line in narrow)


def test_default_gains_are_no_design_and_a_law_in_z_has_a_sampled_card_alone():
    at_default = tfarm.result_card(LAB, tfarm.default_gains(LAB)).notes
    assert [note.partition(";")[0] for note in at_default] == ["default gains: scaled from the paper's, not a design"]
    assert tfarm.result_card(LAB, tfarm.HubFeedback(K1=0.3, K2=0.31)).notes == ()
    in_z = tfarm.result_card(LAB, tfarm.Law({"hub_rate": ([0.3, 0.0], [1.0, -0.1])}, period=0.01))
    assert (in_z.continuous, in_z.sampled.stability) == (None, "stable")


def test_damping_ratios_of_the_sampled_loop_tend_to_those_of_the_continuous_one():
    """Of modes far above the sampling rate too, at a short period: to first order in it."""
    both = tfarm.result_card(LAB, LAW, Chain(sampling=Sampling(period=1e-5)))
    assert both.sampled.least_damping.mode == both.continuous.least_damping.mode
    assert both.sampled.least_damping.ratio == pytest.approx(both.continuous.least_damping.ratio, rel=2e-3)


@pytest.mark.parametrize(("gain", "w", "ratio"), [(-0.1, 172.0, 1.5e-3), (0.3, 16.0, 1.3e-3), (0.5, 300.0, 3e-3)])
def test_the_least_damped_pole_may_be_of_the_controller(gain, w, ratio):
    """A resonant filter has a pair of poles more than the arm; all pairs by python-control, to what a model leaves."""
    law = tfarm.Law({"hub_angle": 1.0, "hub_rate": 0.3, "root_moment": ([gain * w * w], [1, 2 * ratio * w, w * w])})
    own = tfarm.result_card(LAB, law).continuous
    plant = tfarm.reduce(LAB, ["hub_angle", "hub_rate", "root_moment"], order=40).state_space()
    C = control.append(
        control.ss([], [], [], [[1.0, 0.3]]), control.ss(control.tf([gain * w * w], [1, 2 * ratio * w, w * w]))
    )
    L = control.ss([], [], [], [[1.0, 1.0]]) * C * plant
    poles = control.feedback(L, 1).poles()
    poles = poles[(poles.imag > 0) & (abs(poles) < 1000)]
    least = poles[np.argmin(-poles.real / abs(poles))]
    assert own.least_damping.ratio == pytest.approx(-least.real / abs(least), rel=1e-3)
    assert own.least_damping.mode == "the hub or the controller"
    assert (own.least_damping.ratio < 0) == (own.stability == "unstable")


@pytest.mark.parametrize(("K1", "K2"), [(34.83, 0.774), (381.0, 0.774)])
def test_a_negative_real_pole_oscillates_at_half_the_sampling_rate(K1, K2):
    """Whatever the sign of its rounded imaginary part: s = ln(z)/T = (ln abs(z) + i pi)/T, aliases of it alike."""
    law = tfarm.HubFeedback(K1=K1, K2=K2)
    found = tfarm.sampled(LAB, law).verdict.full
    z = found.poles.z
    (n,) = np.flatnonzero((z.real < -1) & (abs(z.imag) < 1e-9))
    own = unaliased_poles(found)[int(found.poles.mode[n])]
    assert own.real == pytest.approx(math.log(abs(z[n])) / 0.01, rel=1e-9)
    assert own.imag % (2 * math.pi / 0.01) == pytest.approx(math.pi / 0.01, rel=1e-6)


@pytest.mark.parametrize("K1", [-0.08, -0.05, -0.02])
def test_a_positive_real_pole_has_no_damping_ratio_whatever_rounding_leaves_of_it(K1):
    """The hub runs away along it; the least damping ratio is that of the oscillating eigenvalues below pi/T."""
    law = tfarm.HubFeedback(K1=K1, K2=0.3)
    found = tfarm.sampled(LAB, law).verdict.full
    z = found.eigenvalues
    assert (abs(z) > 1).sum() == (z.real[abs(z) > 1] > 0).sum() > 0
    least = card.result_card(LAB, law).sampled.least_damping
    assert least.mode.startswith("mode")
    s = np.log(z[z.imag > 1e-6])
    assert abs(-s.real / abs(s) / least.ratio - 1).min() < 1e-6  # of mode 1 or 2, which is not aliased


def test_a_delay_margin_at_the_end_of_its_search_is_a_lower_bound():
    rig, chain = tfarm.load("quanser-flexlink"), load_chain("quanser-flexlink")
    rig, law = rig.with_numbers(damping=card.reference_damping(rig)), tfarm.default_gains(rig)
    own, found = tfarm.result_card(rig, law, chain), tfarm.sampled(rig, law, chain)
    assert found.is_lower_bound
    assert own.sampled.delay_margin.as_text(4) == f"≥ {1e3 * found.delay_margin_seconds:g}, good"


@pytest.mark.parametrize("command", ["margins", "sampled"])
def test_the_command_begins_with_the_card(capsys, command):
    _, text, _ = run(capsys, command, "sasaki2012-lab")
    assert text.splitlines()[1].split() == ["stability", "stable", "stable"]
    found, own = answer(capsys, command, "sasaki2012-lab")["summary"], tfarm.result_card(LAB, tfarm.default_gains(LAB))
    assert found["continuous"]["phase_margin_deg"]["value"] == own.continuous.phase_margin.value
    assert found["sampled"]["grade"] == own.sampled.grade
