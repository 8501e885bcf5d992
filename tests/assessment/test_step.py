"""Figures of time responses: those of textbooks, of the same loop sampled ever faster, and of `tfarm simulate`."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shell import answer, run
from tfarm.arm import Attachment
from tfarm.arm.chain import Sampling
from tfarm.assessment.signal_figures import PARTS, LoopRecord, SignalCurve
from tfarm.dsp import Chain
from tfarm.loop.time_response import Peak

LAB, LOSSLESS = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)
SERVO = tfarm.HubFeedback(K1=1.0, K2=0.3, Kp=3.0)
IN_Z = tfarm.Law({"hub_rate": 0.3}, period=0.01)
SCENARIOS = ("reference", "slew", "pulse", "deflection")


def test_figures_of_a_second_order_system_are_those_of_the_textbook():
    """Overshoot e^{-pi z/sqrt(1 - z^2)} at pi/wd, rise and settling times from the closed form."""
    z, w = 0.4, 5.0
    wd = w * math.sqrt(1 - z * z)

    def y(t):
        return 2 * (1 - np.exp(-z * w * t) * (np.cos(wd * t) + z * w / wd * np.sin(wd * t)))

    t = np.linspace(0.0, 10.0, 200_001)
    record = LoopRecord(LAB, ("hub_angle", "tip_displacement", "root_moment"), 0.0, t, {"hub_angle": 2.1 + 0 * t}, 0.02)
    found = record.figures("hub_angle", SignalCurve(t, y(t), 0 * t))
    assert found.overshoot == pytest.approx(math.exp(-math.pi * z / math.sqrt(1 - z * z)), rel=1e-6)
    assert found.peak_time == pytest.approx(math.pi / wd, rel=1e-4)
    assert found.steady_state_error == pytest.approx(0.1, rel=1e-4)
    low, high = (next(s for s in t if y(s) >= 2 * share) for share in (0.1, 0.9))
    assert found.rise_time == pytest.approx(high - low, abs=1e-4)
    outside = t[abs(y(t) / 2 - 1) > 0.02]
    assert found.settling_time == pytest.approx(outside[-1], abs=1e-4)
    assert found.residual_rms is None


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_sampled_response_becomes_the_continuous_one(scenario):
    """With a period of 0.2 ms instead of 10 ms the figures of both loops differ by a hundredth, T w1."""
    found = tfarm.step(LAB, SERVO, Chain(sampling=Sampling(period=2e-4)), scenario, 1.5)
    for part in PARTS:
        one, other = getattr(found.continuous, part), getattr(found.sampled, part)
        assert other.peak == pytest.approx(one.peak, rel=0.01), part
        name = one.signal
        apart = abs(found.continuous.signals[name] - found.sampled.signals[name])
        assert np.quantile(apart, 0.98) < 0.02 * abs(one.peak), part
    assert (found.continuous.stability, found.sampled.stability) == ("stable", "stable")


def test_the_settling_time_of_the_root_moment_is_that_of_simulate():
    """At the samples the same number; between them it is found more finely."""
    found, run_ = tfarm.step(LAB, LAW, scenario_name="slew", duration=3.0), tfarm.simulate(LAB, LAW, duration=3.0)
    every = round(found.period / found.t[1])
    t, moment = found.t[::every], found.sampled.signals["root_moment"][::every]
    coarse = LoopRecord(LAB, found.names, found.busy_until, t, {}, 0.02).figures(
        "root_moment", SignalCurve(t, moment, 0 * t)
    )
    assert coarse.settling_time == pytest.approx(run_.settling_time, rel=1e-12)
    assert found.sampled.root_moment.settling_time == pytest.approx(run_.settling_time, abs=0.01)
    assert found.sampled.root_moment.residual_rms == pytest.approx(run_.residual_raw, rel=0.05)
    assert found.sampled.torque.peak == pytest.approx(run_.torque[abs(run_.torque).argmax()], rel=1e-6)


def test_a_servo_follows_the_slew_and_the_step():
    slew = tfarm.step(LAB, SERVO, scenario_name="slew")
    travel = 1.15
    for loop in slew.loops.values():
        assert loop.hub.final_value == pytest.approx(travel, rel=2e-3)
        assert loop.tip.final_value == pytest.approx(travel * LAB.reach, rel=2e-3)
    step = tfarm.step(LAB, SERVO)
    assert step.continuous.hub.signal == "hub_angle"
    assert step.continuous.hub.final_value == pytest.approx(1.0, abs=2e-3)
    assert step.continuous.certainty.startswith("converged, ")
    assert tfarm.step(LOSSLESS, SERVO, duration=0.5).continuous.certainty.startswith("approximate, ")


@pytest.mark.parametrize(("share", "words"), [(0.0, None), (0.003, None), (0.03, "peak")])
def test_a_figure_is_not_determined_where_its_bound_leaves_a_hundredth_open(share, words):
    """A decaying cosine with an error of that share: each figure is within 1 %, or it has a reason in words."""
    t = np.linspace(0.0, 10.0, 5001)
    y = 2.0 * np.exp(-t) * np.cos(7 * t)
    record = LoopRecord(LAB, ("hub_rate", "velocity@1.0", "root_moment", "torque"), 0.0, t, {}, 0.02)
    peak = Peak(0.0, 2.0, 2 * share, 2.0 + 2 * share)
    found = record.figures("hub_rate", SignalCurve(t, y, share * 2 + 0 * t, peak))
    if words is None:
        assert found.peak == 2.0
        assert found.note is None or not found.note.startswith("peak")
    else:
        assert found.peak is None
        assert "peak: remainder 6 %" in found.note
    assert (found.settling_time is None) == (share > 0)  # the band of 2 % is not left by more than 0.3 %
    assert (found.settling_time is None) == ("settling time" in (found.note or ""))


def test_a_differentiated_step_has_an_impulse_of_torque_and_no_number():
    law = tfarm.Law({"hub_angle": ([1.0, 3.0], [1.0])}, references=("hub_angle",))
    found = tfarm.step(LAB, law, duration=1.5).continuous
    assert (found.torque.peak, found.torque.peak_time, found.torque.settling_time) == (None, None, None)
    assert found.torque.note == "impulse"
    assert found.hub.peak == pytest.approx(max(found.signals["hub_angle"]), rel=1e-4)
    assert found.certainty.startswith("approximate, ")


def test_the_peak_of_the_torque_of_a_delayed_filter_is_the_laws_own():
    """(s + 3)/(1 + s/300)^2 has its largest step response at t = 1/(300 - 3): before 2 tau nothing is fed back."""
    law = tfarm.Law({"hub_angle": ([1.0, 3.0], [1 / 300**2, 2 / 300, 1.0])}, delay=0.01, references=("hub_angle",))
    found = tfarm.step(LAB, law, duration=0.5)
    own = 1 / (300 - 3)
    value = 3 - 3 * math.exp(-300 * own) * (1 + 300 * own) + 300**2 * own * math.exp(-300 * own)
    assert found.continuous.torque.peak == pytest.approx(value, rel=1e-9)
    assert found.continuous.torque.peak_time == pytest.approx(0.01 + own, rel=1e-6)
    gain = tfarm.Law({"hub_angle": 3.0, "hub_rate": 1.0}, delay=0.01, references=("hub_angle",))
    constant = tfarm.step(LAB, gain, duration=0.5).continuous.torque  # until 2 tau
    assert abs(constant.peak - 3.0) <= constant.remainder_bound < 1e-4
    assert 0.01 <= constant.peak_time <= 0.02
    before = found.t < 0.01
    assert not any(y[before].any() for y in found.continuous.signals.values())


def test_settling_counts_from_the_end_of_the_motion_within_the_band():
    """Of the sampled signals by hand: the last time outside the band of the travel, less the slew; none is negative."""
    found = tfarm.step(LAB, SERVO, scenario_name="slew", duration=3.0, settling_band=0.0005)
    usual = LoopRecord(LAB, found.names, found.busy_until, found.t, found.reference, 0.02)
    for name, of, scale in (("hub_angle", found.sampled.hub, 1.15), ("root_moment", found.sampled.root_moment, None)):
        y = found.sampled.signals[name]
        away = abs(y - y[found.t >= 2.7 - 1e-9].mean())
        for band, figures in ((0.0005, of), (0.02, usual.figures(name, SignalCurve(found.t, y, 0 * y)))):
            last = found.t[np.flatnonzero(away > band * (scale or away.max()))[-1] + 1]
            is_settled = last < 2.7
            assert (figures.settling_time is not None) == is_settled
            if is_settled:
                assert figures.settling_time == pytest.approx(max(0.0, last - 1.0), abs=2e-3)
                assert figures.at_rest_after == pytest.approx(max(1.0, last), abs=2e-3)
    angle = SignalCurve(found.t, found.sampled.signals["hub_angle"], 0 * found.t)
    assert usual.figures("hub_angle", angle).settling_time == 0.0
    with pytest.raises(tfarm.ParameterError, match=r"settling_band = 2: a share of the travel between 0 and 1"):
        tfarm.step(LAB, SERVO, settling_band=2)


def test_with_a_spring_to_ground_the_root_moment_settles_about_its_final_value():
    """Statics: a spring of 2 N m/rad at the hub takes all of the torque; one at the tip bends the link."""
    arm = replace(LAB, attachments=(Attachment(x=LAB.length, stiffness=4.0),))
    found = tfarm.step(arm, SERVO)
    assert found.duration > 2 * 1.0
    root = found.continuous.root_moment
    angle, tip = found.continuous.hub.final_value, found.continuous.tip.final_value
    assert root.final_value == pytest.approx(-4.0 * tip * LAB.length, rel=1e-3)
    assert found.continuous.torque.final_value == pytest.approx(3.0 * (1 - angle) - 0.3 * root.final_value, rel=1e-3)
    y = found.continuous.signals["root_moment"]
    outside = found.t[abs(y - root.final_value) > 0.021 * abs(y - root.final_value).max()]
    assert outside[-1] <= root.settling_time < found.duration


def test_without_a_controller_the_first_mode_rings_on():
    """At C = 0 a cosine of the first natural frequency, from a deflection of the tip of a hundredth of the length."""
    found = tfarm.step(LOSSLESS, tfarm.HubFeedback(), scenario_name="deflection", duration=1.0)
    w = float(tfarm.modes(LOSSLESS, 1).natural_frequency[-1])
    expected = 0.01 * LOSSLESS.length * np.cos(w * found.t)
    np.testing.assert_allclose(found.continuous.signals["tip_displacement"], expected, atol=1e-12)
    assert abs(found.continuous.signals["torque"]).max() == 0.0
    assert found.continuous.stability == "marginal"


def test_an_unstable_loop_has_a_response_and_no_figures():
    found = tfarm.step(LAB, tfarm.HubFeedback(K1=-1.0, K2=0.3), duration=3.0)
    assert {each.stability for each in found.loops.values()} == {"unstable"}
    assert all(getattr(loop, part) is None for loop in found.loops.values() for part in PARTS)
    assert "the response grows, its figures are not defined" in found.finding
    hub = found.continuous.signals["hub_rate"]
    assert abs(hub[-200:]).max() > 3 * abs(hub[:1000]).max()


def test_a_law_in_z_has_the_sampled_response_alone():
    found = tfarm.step(LAB, replace(IN_Z, references=("hub_rate",)), duration=10.0)
    assert (found.continuous, list(found.loops)) == (None, ["sampled, 10 ms"])
    assert found.sampled.hub.signal == "hub_rate"
    assert found.sampled.hub.settling_time > 0


def test_a_column_of_references_is_the_reference_of_its_signal():
    """C (reference - hub angle) as one state space of two columns, and as a signal with a reference."""
    A, B, C, D = [[-50.0]], [[1.0, -1.0]], [[100.0]], [[0.0, 0.0]]
    columns = tfarm.Law.of_matrices(A, B, C, D, ("hub_angle", "reference:hub_angle"))
    signal = tfarm.Law({"hub_angle": ([100.0], [1.0, 50.0])}, references=("hub_angle",))
    one, other = (tfarm.step(LAB, law, duration=0.5) for law in (columns, signal))
    for kind in ("continuous", "sampled"):
        for name in one.names:
            y, expected = getattr(one, kind).signals[name], getattr(other, kind).signals[name]
            np.testing.assert_allclose(y, expected, rtol=1e-8, atol=1e-10 * abs(expected).max())


PINNED = LAB.with_numbers(payload_mass=math.inf)
REFUSED = {  # arm, law, scenario, and words of the refusal
    "locked": (LAB.with_numbers(hub_inertia=math.inf), LAW, "slew", "locked hub"),
    "driven angle": (replace(LAB, input="hub_angle"), LAW, "slew", "input = .hub_angle."),
    "algebraic": (LAB.with_numbers(hub_inertia=0.0), LAW, "slew", "K2 = 0.3"),
    "unknown": (LAB, LAW, "impulse", "scenario = .impulse"),
    "no reference": (LAB, tfarm.HubFeedback(K2=0.3), "reference", "neither hub angle nor hub rate"),
    "no such reference": (
        LAB, tfarm.Law({"tip_deflection": 0.1}, references=("tip_deflection",)), "slew", "references = .tip_deflection"
    ),
    "pinned": (PINNED, LAW, "deflection", "scenario = .deflection.: no free decay"),
    "pinned, in z": (PINNED, IN_Z, "deflection", "scenario = .deflection.: no free decay"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_has_no_response_is_refused_in_a_line(what):
    arm, law, scenario, words = REFUSED[what]
    with pytest.raises(tfarm.ParameterError, match=words):
        tfarm.step(arm, law, scenario_name=scenario)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_record_has_whole_samples_and_one_shorter_than_a_period_is_refused(scenario):
    """Others are of whole samples, of 10 ms; a released mode and a massless hub have a response too."""
    with pytest.raises(tfarm.ParameterError, match=r"duration = 0\.004: at least one sampling period, 0\.01 s"):
        tfarm.step(LAB, LAW, None, scenario, 0.004)
    assert tfarm.step(LAB, LAW, None, scenario, 0.011).t[-1] >= 0.01
    arm, law = (LAB.with_numbers(hub_inertia=0.0), tfarm.HubFeedback(K1=0.3)) if scenario == "pulse" else (LAB, LAW)
    found = tfarm.step(arm, law, None, scenario, 0.2049)
    assert (found.duration, found.t[-1], found.continuous.stability) == (0.2, 0.2, "stable")
    assert all(np.isfinite(y).all() for y in found.continuous.signals.values())


def test_the_command_prints_both_loops_and_writes_their_signals(capsys, tmp_path):
    words = ["step", "sasaki2012-lab", "--scenario", "pulse", "--duration", "0.5", "--output", "moment@0.25"]
    found = answer(capsys, *words)
    assert {"continuous", "sampled", "scenario_in_words", "duration_s", "period_s"} <= found.keys()
    own = tfarm.step(LAB, tfarm.default_gains(LAB), scenario_name="pulse", duration=0.5)
    for loop, part in (("continuous", "hub"), ("sampled", "torque")):
        assert found[loop][part]["peak"] == pytest.approx(getattr(getattr(own, loop), part).peak, rel=1e-9)
    code, out, _ = run(capsys, *words, "--csv", str(tmp_path / "signals.csv"))
    assert (code, columns_of(out)) == (0, ["continuous-time", "sampled, 10 ms"])
    with (tmp_path / "signals.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows[0][:2] == ["t [s]", "hub_angle [rad]"]
    assert {"moment@0.25 [N m]", "sampled_torque [N m]"} <= set(rows[0])
    column = np.array([float(row[1]) for row in rows[1:]])
    np.testing.assert_array_equal(column, own.continuous.signals["hub_angle"])


def columns_of(out):
    (line,) = [each for each in out.splitlines() if each.startswith("quantity")]
    return [each.strip() for each in line.split("  ") if each.strip()][2:]
