"""Simulations under any law: against gains, a controller in Python, python-control; and those of a real rig."""

from pathlib import Path

import control
import numpy as np
import pytest

import tfarm
from tests.dsp.independent import radius_of, stepped
from tests.shared import thinned
from tfarm import Law, ParameterError
from tfarm.arm import FED_BACK, HubFeedback
from tfarm.arm.law_tables import load_law
from tfarm.case import Case, tracked
from tfarm.dsp import Actuator, Chain, Converters, Sampling, Simulator, load_chain, scenario
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict

T = 0.01
LAB, RIG = tfarm.load("sasaki2012-lab"), tfarm.load("quanser-2dsfl")
DATA = Path(__file__).parent.parent / "data" / "quanser-2dsfl"
ROUNDED = 1e-11  # of the largest: 200 samples of a loop that is stable


def assert_close(mine, theirs, tolerance=ROUNDED):
    assert mine.at_samples.t.size == theirs.at_samples.t.size
    for name in ("hub_angle", "root_moment", "tip_displacement"):
        a, b = getattr(mine.at_samples, name), getattr(theirs.at_samples, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * abs(b).max(), err_msg=name)
    np.testing.assert_allclose(mine.torque, theirs.torque, rtol=0, atol=tolerance * abs(theirs.torque).max())
    assert mine.saturated == theirs.saturated


def test_a_law_with_states_is_a_controller_that_remembers():
    """The same filter in Python, without references: a lead on the angle, and a gain on the moment."""
    law = Law({"hub_angle": ([4.0, -3.6], [1.0, -0.5]), "root_moment": 0.1}, period=T, delay=0.004)
    task, memory = scenario("slew", LAB, Chain(), 2.0), [0.0, 0.0]

    def controller(m):
        out = 0.5 * memory[0] + 4.0 * m.hub_angle - 3.6 * memory[1]
        memory[:] = out, m.hub_angle
        return m.feedforward - out - 0.1 * m.root_moment

    mine = Simulator(Case(LAB, law, Chain()), task, count=8).run()
    late = Case(LAB, HubFeedback(), Chain(sampling=Sampling(delay_samples=0.4)))
    assert_close(mine, Simulator(late, task, count=8).controller(controller))


def test_a_servo_follows_as_in_python_control():
    """A lead on hub angle less its reference, with a moment filter: the sampled plant and the law closed by hand."""
    law = Law(
        {"hub_angle": ([6.0, -5.4], [1.0, -0.5]), "moment@0.3": ([0.05], [1.0, -0.5])},
        period=T, references=("hub_angle",),
    )  # fmt: skip
    task = scenario("slew", LAB, Chain(), 2.0)
    mine = Simulator(Case(LAB, law, Chain()), task, count=6).run()
    A, B, C, D = law.matrices()
    plant = sampled_loop(Case(LAB, law, Chain()), count=6).pulse.state_space()
    loop, by_angle = control.feedback(plant, control.ss(A, B, C, D, T)), control.ss(A, B[:, [0]], C, D[:, [0]], T)
    t = np.arange(task.feedforward.size) * T
    led = task.feedforward + control.forced_response(by_angle, t, task.hub_angle).outputs
    found = control.forced_response(loop, t, led).outputs[0]
    np.testing.assert_allclose(mine.at_samples.hub_angle, found, atol=1e-9 * abs(found).max())


def test_gains_without_references_are_the_loop_of_gains_and_follow_none():
    """The feedback has all three parts, the controller in the computer reads its own signals alone."""
    gains, law = tfarm.HubFeedback(K1=0.3, K2=0.2), Law({"root_moment": 0.2, "hub_rate": 0.3})
    one, other = (sampled_loop(Case(LAB, each), count=6) for each in (gains, law))
    assert (one.weights, one.gains) == (other.weights, other.gains) == ((0.0, 0.3, 0.2), gains)
    np.testing.assert_array_equal(one.poles.z, other.poles.z)
    assert (tracked(LAB, law)[1], tracked(LAB, Law.of_gains(gains))[1]) == (law, gains)
    assert (Case(LAB, law).in_computer, Case(LAB, gains).in_computer.signals) == (law, FED_BACK)
    mine = Simulator(Case(LAB, law), scenario("slew", LAB, Chain(), 2.0), count=6)
    assert_close(mine.run(), mine.controller(lambda m: m.feedforward - 0.3 * m.hub_rate - 0.2 * m.root_moment))


def test_no_reference_is_made_up():
    with pytest.raises(ParameterError) as error:
        tfarm.simulate(LAB, Law({"tip_displacement": 1.0}, references=("tip_displacement",)))
    assert error.value.key == "references"


def real(name):
    return load_law(DATA / f"{name}.toml")


@pytest.mark.parametrize("late", thinned([0.0, 0.005, 0.01], 2))
@pytest.mark.parametrize("name", ["lqg", "hinf"])
def test_the_exact_rig_under_the_real_controllers_is_that_of_a_model_of_order_80(name, late):
    law = real(name)
    chain = Chain(sampling=Sampling(delay_samples=late / T))
    loop = sampled_verdict(Case(RIG, law, chain), count=40).loop
    other = radius_of(stepped(RIG, loop.law, loop.chain), loop.has_free_angle)
    assert loop.poles.log_spectral_radius == pytest.approx(other, abs=1e-10)
    assert loop.poles.is_stable == (name == "hinf")


def test_real_controllers_bring_the_rig_to_the_reference_within_the_current():
    chain = load_chain(DATA / "chain.toml")
    wanted = np.radians(20)
    for name in ("lqg", "hinf"):
        found = tfarm.simulate(RIG, real(name), chain, duration=4.0, count=10)
        assert found.stopped is None
        assert abs(found.torque).max() <= 0.9
        assert found.at_samples.hub_angle[-1] == pytest.approx(wanted, rel=0.02)


KP, KI, KD, POLE = 8.0, 8.0, 4.0, 50.0


def limited(anti_windup, limit, arithmetic="float64"):
    """A slew under PID of a hub whose motor reaches its limit."""
    num = [KD + KP / POLE, KP + KI / POLE, KI]
    law = Law({"hub_angle": (num, [1 / POLE, 1.0, 0.0])}, references=("hub_angle",), anti_windup=anti_windup)
    chain = Chain(actuator=Actuator(torque_limit=limit), converters=Converters(arithmetic=arithmetic))
    return Simulator(Case(LAB, law, chain), scenario("slew", LAB, chain, 8.0), count=6)


@pytest.mark.parametrize("arithmetic", ["float64", "float32"])
def test_anti_windup_changes_no_bit_without_a_limit(arithmetic):
    """Neither without a limit nor within one that is not reached."""
    plain = limited(0.0, np.inf, arithmetic).run()
    assert abs(plain.torque).max() < 40.0
    for limit in (np.inf, 40.0):
        with_it = limited(0.5, limit, arithmetic).run()
        assert with_it.torque.tobytes() == plain.torque.tobytes()
        assert with_it.at_samples.tip_displacement.tobytes() == plain.at_samples.tip_displacement.tobytes()


def textbook(Tt, limit):
    """P, I and D apart, each by Tustin's rule; the integral gets T/Tt of the part of u that the limit takes."""
    state = {"I": 0.0, "D": 0.0, "e": 0.0}

    def controller(m):
        e = m.angle_reference - m.hub_angle
        lag = 2 / (POLE * T)
        state["D"] = ((lag - 1) * state["D"] + KD * 2 / T * (e - state["e"])) / (lag + 1)
        u = m.feedforward + KP * e + state["I"] + KI * T / 2 * e + state["D"]
        state["I"] += KI * T * e + T / Tt * (np.clip(u, -limit, limit) - u)
        state["e"] = e
        return u

    return controller


def test_anti_windup_is_the_back_calculation_of_a_textbook_and_overshoots_less():
    limit = 1.0
    wound, unwound = limited(0.0, limit).run(), limited(0.3, limit).run()
    assert_close(unwound, limited(0.0, limit).controller(textbook(0.3, limit)))
    assert unwound.saturated["torque"] > 20
    end = unwound.scenario.hub_angle[-1]
    over = [each.at_samples.hub_angle.max() - end for each in (wound, unwound)]
    assert over[1] < 0.5 * over[0]
