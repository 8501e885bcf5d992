"""What a simulation records besides its four signals, at the samples and between; and simulated rigs."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tests.dsp.independent import held, stepped
from tests.rigs import some_rig
from tests.shared import thinned
from tfarm.arm import HubFeedback, Law, RotarySpring
from tfarm.arm.chain import Slew
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Sampling, Simulator, scenario
from tfarm.dsp.plant import RECORDED
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.traces import away
from tfarm.errors import ParameterError
from tfarm.exact.outputs import OUTPUTS
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.reduced import modal_model
from tfarm.tuner.trial import tip_off

LAB = tfarm.load("sasaki2012-lab")
GAINS = HubFeedback(K1=0.3, K2=0.3)
OTHERS = ("tip_rotation", "tip_angle", "root_shear", "tip_acceleration")
SAME = 1e-11  # of the largest value: the same residues by two methods
FITTED = 1e-7  # of a heavily damped arm: what its slow poles leave is shared out by a fit, which rounding moves


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.6])
@pytest.mark.parametrize("arm", [LAB, tfarm.load("sasaki2012")])
def test_signals_are_those_of_the_modal_state_space(arm, delay):
    """The torques and a disturbance replayed by matrix exponentials of a fifth of a sample; and the torques by hand."""
    chain = Chain(sampling=Sampling(delay_samples=delay))
    task = scenario("slew", arm, chain, 0.3)
    task = replace(task, disturbance=np.random.default_rng(4).normal(size=task.t.size))
    run = Simulator(Case(arm, HubFeedback(), chain), task, count=4, between=4, outputs=OTHERS).linear(GAINS)
    names = (*RECORDED, *OTHERS)
    A, B, C, D = modal_model(arm, names, 4).matrices()
    step, by_torque = held(A, B, chain.sampling.period / 5)
    x, found = np.zeros(len(A)), [np.zeros(len(names))]
    for j in range(5 * task.t.size):
        k, late = j // 5, (j - round(5 * delay)) // 5
        torque = task.disturbance[k] + (run.torque[late] if late >= 0 else 0.0)
        x = step @ x + by_torque * torque
        found.append(C @ x + D[:, 0] * torque)
    assert run.at_samples.names == names
    for name, signal in zip(names, np.array(found[:-1]).T.reshape(len(names), -1, 5), strict=True):
        for trace, exact in ((run.at_samples, signal[:, 0]), (run.between, signal[:, 1:].ravel())):
            np.testing.assert_allclose(trace.signal(name), exact, atol=1e-9 * abs(signal).max())
    off, seen = task.hub_rate - run.at_samples.hub_rate, run.at_samples.root_moment - task.rigid_moment
    by_hand = task.feedforward + 0.3 * off - 0.3 * seen
    np.testing.assert_allclose(run.torque, by_hand, atol=1e-12 * abs(run.torque).max())


CHAINS = {
    "plain": Chain(),
    "filtered": Chain(sampling=Sampling(antialias_corner=200.0, delay_samples=1.3)),
    "damped hub": Chain(actuator=Actuator(hub_damping=0.05)),
}
INSIDE = Law({"hub_rate": 0.3, "moment@0.2": ([0.02], [1.0, -0.5])}, period=0.01)  # which reads the rig at a point
ARMS = [LAB, LAB.with_numbers(damping=0.01), replace(LAB, hub=replace(LAB.hub, radius=0.1))]


@pytest.mark.parametrize(("arm", "law", "kind"), thinned(product(ARMS, [GAINS, INSIDE], CHAINS), 4))
def test_what_is_read_at_an_end_is_what_is_recorded_there(arm, law, kind):
    """Fields along the arm against the closed forms at its ends; no filter changes either."""
    names = ("moment@0", f"displacement@{arm.length!r}", "tip_displacement", "tip_rotation")
    found = tfarm.simulate(arm, law, CHAINS[kind], duration=0.5, count=6, between=2, outputs=names)
    plain = tfarm.simulate(arm, law, CHAINS[kind], duration=0.5, count=6, between=2)
    assert list(found.at_samples.others) == [name for name in names if name != "tip_displacement"]
    for trace, before in ((found.at_samples, plain.at_samples), (found.between, plain.between)):
        for one, other in ((names[0], "root_moment"), (names[1], "tip_displacement")):
            off = abs(trace.signal(one) - trace.signal(other)).max()
            assert off <= (FITTED if arm.damping > LAB.damping else SAME) * abs(trace.signal(other)).max()
        for name in RECORDED:
            assert np.array_equal(trace.signal(name), before.signal(name))


def test_every_output_there_is_can_be_recorded_or_is_refused_in_a_line():
    """What does not belong to a rig is named, nothing else is."""
    rng, chain = np.random.default_rng(5), Chain()
    rig = some_rig(rng, damped=True, segments=2, drive="hub_torque")
    rig = replace(rig, clamp=RotarySpring(), joint=RotarySpring(), hub=replace(rig.hub, inertia=1.0))
    task, refused = scenario("step", rig, chain, 0.05), []
    for name, each in OUTPUTS.items():
        requested = f"{name}@{0.4 * rig.length!r}" if each.place == "x" else name
        try:
            found = Simulator(Case(rig, HubFeedback(K1=0.1)), task, count=3, outputs=[requested]).run()
        except ParameterError as error:
            refused.append((name, str(error)))
            continue
        assert np.isfinite(found.at_samples.signal(requested)).all()
        assert found.at_samples.units == ({} if name in RECORDED else {requested: each.unit})
    assert [name for name, _ in refused] == ["strain"]  # its section has no given depth


@pytest.mark.parametrize(
    ("name", "why"),
    [("tip_rotatoin", 'did you mean "tip_rotation"'), ("moment", "moment@x"), ("moment@7", "lies between 0 and 1 m")],
)
def test_what_cannot_be_read_is_refused(name, why):
    with pytest.raises(ParameterError, match=why):
        Simulator(Case(LAB, HubFeedback(), Chain()), scenario("step", LAB, Chain(), 0.1), outputs=[name])


def test_an_output_that_was_not_requested_is_refused_with_the_known_ones():
    trace = tfarm.simulate(LAB, GAINS, duration=0.1, count=2, outputs=["tip_angle"]).at_samples
    with pytest.raises(ParameterError, match=r"known are: hub_angle, .*tip_angle"):
        trace.signal("tip_rotation")


# with friction the hub's rate does not feel the rigid body
@pytest.mark.parametrize("friction", thinned([0.02, 0.0], 2))
@pytest.mark.parametrize("law", [GAINS, INSIDE])
def test_a_hub_that_its_actuator_damps_is_a_hub_with_that_friction(law, friction):
    """Twenty modes leave 1e-9 of the signals; what is read along the arm has the poles of what is read at the hub."""
    names = ("tip_rotation", "moment@0.3")
    by_actuator = Chain(actuator=Actuator(hub_damping=0.05))
    rig, rubbed = (replace(LAB, hub=replace(LAB.hub, friction=each)) for each in (friction, friction + 0.05))
    one, other = sampled_loop(Case(rig, law, by_actuator), count=20), sampled_loop(Case(rubbed, law, Chain()), count=20)
    assert one.poles.log_spectral_radius == pytest.approx(other.poles.log_spectral_radius, rel=1e-9)
    one = tfarm.simulate(rig, law, by_actuator, "impulse", 0.3, count=20, outputs=names).at_samples
    other = tfarm.simulate(rubbed, law, Chain(), "impulse", 0.3, count=20, outputs=names).at_samples
    for name in one.names:
        np.testing.assert_allclose(one.signal(name), other.signal(name), atol=1e-7 * abs(other.signal(name)).max())


SLOW = 1e-3  # 1/s: the rig turns as one piece, and s^2 of its next term is beyond the digits compared


@pytest.mark.parametrize("name", ["tests/rigs/bench-rig.toml", "quanser-2dsfl", "quanser-flexlink"])
def test_the_feedforward_of_a_slew_turns_the_rig_against_its_friction(name):
    """Input over angle of the slowly turning exact rig is loss s + J s^2 + ..., and its gauge reads -J_g s^2."""
    arm = tfarm.load(name)
    task = slew_scenario(arm, Chain(), 1.5)
    forth, back = (1 / tfarm.transfer(arm, "hub_angle")(s) for s in (SLOW, -SLOW))
    loss, inertia = (forth - back) / (2 * SLOW), (forth + back) / (2 * SLOW**2)
    mean = np.r_[np.diff(task.hub_angle), 0.0] / task.period
    acceleration = np.r_[np.diff(task.hub_rate), 0.0] / task.period
    wanted = (loss * mean + inertia * acceleration).real[:-1]
    np.testing.assert_allclose(task.feedforward[:-1], wanted, rtol=1e-3, atol=1e-6 * abs(wanted).max())
    gauge = (tfarm.transfer(arm, "root_moment")(1j * SLOW) / tfarm.transfer(arm, "hub_angle")(1j * SLOW)).real
    np.testing.assert_allclose(task.rigid_moment[1:], gauge / -(SLOW**2) * np.diff(task.hub_rate) / task.period,
                               rtol=1e-4, atol=1e-9)  # fmt: skip


@pytest.mark.parametrize("name", thinned(["tests/rigs/bench-rig.toml", "quanser-2dsfl", "quanser-flexlink"], 2))
@pytest.mark.parametrize("factor", [1.0, -40.0])
def test_the_verdict_on_a_damped_rig_is_proven(name, factor):
    """Poles of friction and of the circuit are among those that are counted; as many grow as in a stepped model."""
    arm = tfarm.load(name).with_numbers(damping=2e-5)
    gains = tfarm.default_gains(arm).times(factor)
    verdict = sampled_verdict(Case(arm, gains))
    assert verdict.is_settled
    z = np.linalg.eigvals(stepped(arm, Law.of_gains(gains), Chain(), verdict.modes_used))
    grow = int((np.log(abs(z)) > 1e-9).sum())
    assert grow == (verdict.loop.poles.log_radius > 0).sum()
    assert (grow > 0) == (factor < 0)


def test_a_slew_ends_at_the_tip_position_of_the_rigid_arm():
    """G_tip/G_angle at rest is r + L: with the angle held the slew ends on its travel, as it does without a radius."""
    bench = tfarm.load("tests/rigs/bench-rig.toml")
    r, L = bench.hub.radius, bench.length
    assert r > 0.05 * L
    tip, angle = tfarm.transfer(bench, ["tip_displacement", "hub_angle"])(1e-3j)
    assert bench.reach == pytest.approx((tip / angle).real, rel=1e-6)
    for chain, travel in ((Chain(), 1.15 * (r + L)), (Chain(slew=Slew(travel=0.2)), 0.2)):
        run = tfarm.simulate(bench, tfarm.HubFeedback(K1=0.05, Kp=0.5), chain, duration=10.0, count=4)
        assert run.scenario.hub_angle[-1] == pytest.approx(travel / (r + L), rel=1e-12)
        assert run.at_samples.tip_displacement[-1] == pytest.approx(travel, abs=1e-4)
        assert abs(away(bench, run)[-1]) < 1e-4
        of_trial = SimpleNamespace(arm=bench, loop=SimpleNamespace(chain=chain))
        assert abs(tip_off(run, of_trial)) < 1e-4
