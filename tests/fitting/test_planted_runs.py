"""The records of planted rigs: the elements in time against tfarm's own simulation, closed forms and conservation."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.chain_elements import frequency_response, reached
from tests.fitting.elements_in_time import ANALOG, Body, Computer, Drive, Plant, simulate
from tests.fitting.planted import some_arm
from tests.fitting.planted_runs import KINDS, WRONG, is_above, judged, planted
from tfarm.arm import HubFeedback
from tfarm.arm.law import Law
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Sampling, Simulator
from tfarm.dsp.scenarios import Scenario
from tfarm.spectrum.table import first_frequency

NAMES = ("hub_angle", "hub_rate", "root_moment")
HELD = 5  # samples of each level of the input


def rig(seed, damped=True):
    """A planted arm of some damping, so that a dozen modes are enough, or of none."""
    arm = some_arm(np.random.default_rng(seed))
    return arm.with_numbers(damping=damped * 2e-3 / first_frequency(arm))


def levels(seed, count):
    return np.random.default_rng(seed).choice([-1.0, 1.0], count // HELD).repeat(HELD)


def off(found, expected):
    """The largest difference of a signal, over its largest value."""
    return max(abs(a - b).max() / abs(b).max() for a, b in zip(found, expected, strict=True))


def theirs(arm, law, chain, u, angle, count):
    """What tfarm's own simulation measures under a torque fed forward and a reference of the angle."""
    zero = np.zeros(angle.size)
    task = Scenario("planted", chain.sampling.period, zero + u, angle, zero, zero, zero)
    return Simulator(Case(arm, law, chain), task, count=count).run()


@pytest.mark.parametrize("delay", [0.0, 0.4, 2.7])
def test_an_open_loop_is_that_of_the_simulator(delay):
    """More modes and shorter elements bring them together; hold, dead time and filter are those of the chain."""
    arm = rig(1)
    w1 = first_frequency(arm)
    T, corner, u = 0.15 / w1, 6.0 * w1, levels(2, 300)
    chain = Chain(sampling=Sampling(period=T, delay_samples=delay, antialias_corner=corner))
    errors = []
    for count, up_to in ((2, 1), (6, 2), (16, 4)):
        plant = Plant(arm, NAMES, reached(arm, up_to), corner=corner)
        read, _, _ = simulate(plant, Drive(delay=delay * T), Computer(T, u.size, u))
        errors.append(off(read[..., 0], theirs(arm, HubFeedback(), chain, u, 0 * u, count).measured.T))
    assert errors[0] > 1e3 * max(errors[1:])
    assert max(errors[1:]) < 1e-6


def test_signals_and_filter_have_the_responses_of_the_elements():
    """C (s - A)^-1 B is the elements' own response, times corner/(s + corner) where the signal is analog."""
    arm = rig(1)
    w1 = first_frequency(arm)
    names, corner, s = (*NAMES, "tip_acceleration"), 2.0 * w1, 1.3j * w1
    plant = Plant(arm, names, reached(arm, 3), corner=corner)
    found = plant.C @ np.linalg.solve(s * np.eye(len(plant.A)) - plant.A, plant.B)
    expected = frequency_response(arm, s, names) * np.where(
        [name in ANALOG for name in names], corner / (s + corner), 1
    )
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def pd_with_filter(w1, J, T):
    """A lead law in z of the error of the hub's angle, and a late one of the moment."""
    wc, pole = 0.15 * w1, math.exp(-2 * w1 * T)
    P, D = J * wc**2, 1.4 * J * wc / T * (1 - pole)
    return {"hub_angle": ([P + D, -P * pole - D], [1.0, -pole]), "root_moment": ([0.1], [1.0, -0.5])}


@pytest.mark.parametrize("kind", ["gains", "filter", "counted"])
def test_a_closed_loop_is_that_of_the_simulator(kind):
    """Three gains at the hub, a filter, and a filter behind an encoder: there most readings are the same counts."""
    arm = rig(3)
    w1, J = first_frequency(arm), arm.turned_inertia
    T = 0.2 / w1
    entries = {
        "hub_angle": ([0.1 * J * w1**2], [1.0]),
        "hub_rate": ([0.5 * J * w1], [1.0]),
        "root_moment": ([0.3], [1.0]),
    }
    counts = {"counted": 5000}.get(kind)
    law = HubFeedback(Kp=0.1 * J * w1**2, K1=0.5 * J * w1, K2=0.3)
    if kind != "gains":
        entries = pd_with_filter(w1, J, T)
        law = Law(entries, period=T, references=("hub_angle",))
    chain = Chain(sampling=Sampling(period=T, delay_samples=0.6), converters=Converters(encoder_counts=counts))
    reference = 0.1 * levels(4, 400)
    steps = {"hub_angle": 2 * math.pi / counts} if counts else {}
    plant = Plant(arm, NAMES, reached(arm, 3))
    computer = Computer(T, 400, law=entries, references={"hub_angle": reference}, step=steps)
    read, u, _ = simulate(plant, Drive(delay=0.6 * T), computer)
    expected = theirs(arm, law, chain, 0.0, reference, 16)
    if counts:
        counted = np.rint(expected.measured[:, 0] * counts / (2 * math.pi)) * 2 * math.pi / counts
        assert (abs(read[0, :, 0] - counted) < 1e-9).mean() > 0.95
        assert abs(read[0, :, 0] - expected.measured[:, 0]).max() < 1.5 * steps["hub_angle"]
    else:
        assert off(read[..., 0], expected.measured.T) < 2e-6
        assert off(u.T, [expected.torque]) < 2e-6


def test_dead_time_gain_bias_and_offsets_of_a_rigid_arm_are_those_of_the_closed_form():
    """J theta'' = gain u(t - delay) + bias, u before the record included, integrated from switch to switch."""
    arm = rig(5)
    stiff = replace(
        arm.link, youngs_modulus=1e7 * arm.link.youngs_modulus, shear_modulus=1e7 * arm.link.shear_modulus, damping=1e-6
    )
    arm = replace(arm, link=stiff, clamp=tfarm.RotarySpring())
    T, u, drive = 0.01, levels(6, 40), Drive(gain=1.7, delay=0.0137, bias=0.3)
    computer = Computer(T, 40, u, offset={"hub_angle": 0.2}, before=0.5)
    read, _, _ = simulate(Plant(arm, NAMES[:1], reached(arm, 2)), drive, computer)
    t, switches = T * np.arange(40), drive.delay + T * np.arange(40)
    past = np.maximum(t[:, None] - switches, 0.0)
    steps = np.diff(np.r_[computer.before, u])
    angle = drive.gain * (past**2 / 2 @ steps) + (drive.gain * computer.before + drive.bias) * t**2 / 2
    np.testing.assert_allclose(read[0, :, 0], 0.2 + angle / arm.turned_inertia, rtol=1e-6)


def test_energy_is_the_work_of_the_drive():
    """Of an undamped arm: q'^2/2 + w^2 q^2/2 over its modes, and u times the hub's turn in each sample."""
    arm = rig(7, damped=False)
    plant, u = Plant(arm, NAMES[:1], reached(arm, 3)), levels(8, 500)
    T = 0.2 / first_frequency(arm)
    read, _, end = simulate(plant, Drive(), Computer(T, u.size + 1, np.r_[u, 0.0]))
    x, n = end[:, 0], len(end) // 2
    unit = 1 / np.diag(plant.A[:n, n:])
    w2 = -np.diag(plant.A[n:, :n]) / unit
    energy = (x[n:] ** 2 + w2 * (unit * x[:n]) ** 2).sum() / 2
    assert energy == pytest.approx(u @ np.diff(read[0, :, 0]), rel=1e-7)


def test_a_body_on_a_spring_at_the_tip_is_an_absorber():
    """At its own frequency the payload is at rest; on a rigid spring it is the payload itself, at rest its mass."""
    arm = rig(9, damped=False)
    w1 = first_frequency(arm)

    def tip(omega, body):
        plant = Plant(arm, ["payload_displacement"], reached(arm, 3), body=body)
        return (plant.C @ np.linalg.solve(1j * omega * np.eye(len(plant.A)) - plant.A, plant.B))[0]

    body = Body(share=0.6, frequency=1.7 * w1, damping=0.0)
    assert abs(tip(body.frequency, body)) < 1e-6 * abs(tip(1.6 * w1, body))
    assert tip(0.6 * w1, replace(body, frequency=1e4 * w1)) == pytest.approx(tip(0.6 * w1, None), rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_elements_of_records_are_short_enough(kind):
    """Shorter ones shift no number by a hundredth of its deviation; a wrong arm's records show that it is one."""
    rigs = [planted(kind, seed) for seed in range(2)]
    assert max(rig.bias for rig in rigs) < 0.01
    assert kind not in WRONG or max(rig.excess / rig.run.count for rig in rigs) > 1


def test_noise_of_records_is_what_they_state():
    """Linear least squares on the elements' own derivatives: errors in deviations, and chi-squared, as stated."""
    errors = []
    for seed in range(6):
        rig = planted("open", seed)
        shift, left = rig.expected
        errors += shift.tolist()
        freedom = rig.run.count * len(rig.names)
        assert abs(left - freedom) < 4.5 * math.sqrt(2 * freedom) + 20
    assert 0.4 < np.std(errors) < 1.8
    assert max(map(abs, errors)) < 4


@pytest.mark.parametrize(("kind", "seed"), [("open", 10001), ("closed", 10000)])
def test_numbers_of_planted_records_are_found_again(kind, seed):
    """By a model that is not rejected, at a sum of squares no larger than that of a search from the truth."""
    row = judged(kind, seed)
    assert row["verdict"] == "fitted"
    assert not is_above(row)
    for number in row["numbers"].values():
        assert abs(number["value"] - number["truth"]) < 4 * number["deviation"]
