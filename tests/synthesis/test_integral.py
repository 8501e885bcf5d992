"""PI and PID laws: stable with their integrator, no steady-state error to a constant torque, and as good as PD."""

from dataclasses import replace

import control
import numpy as np
import pytest

import tfarm
from tests.shell import answer
from tests.synthesis.held_loop import HeldLoop
from tfarm import ConvergenceError, ParameterError
from tfarm.arm import TWO_GAINS, as_law
from tfarm.arm.law_tables import load_law
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import stability
from tfarm.synthesis import search
from tfarm.synthesis.design import design
from tfarm.synthesis.structures import INTEGRAL_SPEED, STRUCTURES, structure_of

LAB = tfarm.load("sasaki2012-lab")
T = 0.01
HELD = HeldLoop(LAB, T)


@pytest.fixture(scope="module")
def found():
    return {continuous: design(LAB, structure="PID", continuous=continuous) for continuous in (False, True)}


def controller(c):
    """C(s) of PID coefficients, the signs of a textbook."""
    s = control.tf("s")
    return c["Kp"] + c["Ki"] / s + c["Kd"] * s / (1 + s / c["pole_rad_s"])


@pytest.mark.parametrize("continuous", [False, True])
def test_the_law_is_that_of_the_textbook_and_stable_in_exact_loops(found, continuous):
    law, c = found[continuous].law, found[continuous].coefficients
    s = 1j * np.geomspace(1e-3, 1e4, 50)
    (part,) = as_law(law).parts
    own = part.block.numerators(s)[0] / part.block.denominator(s)
    np.testing.assert_allclose(own, controller(c)(s), rtol=1e-12)
    assert (part.signals, law.references) == (("hub_angle",), ("hub_angle",))
    assert found[continuous].verdict.is_stable
    assert c["pole_rad_s"] <= 2 / T
    poles = tfarm.closed_loop_poles(LAB, law, 6).values
    assert poles.real.max() < 0
    assert abs(poles).min() > 1e-3  # the integrator has moved off 0


def test_the_sampled_loop_is_stable_with_a_reserve_by_another_model(found):
    law = found[False].law
    assert all(sampled_verdict(LAB, law.times(share), found[False].chain).is_stable for share in (0.8, 1.0, 1.25))
    assert tfarm.sampled(LAB, law).verdict.is_stable
    assert np.log(HELD.radius(law)) == pytest.approx(np.log(found[False].sampled.spectral_radius), rel=1e-4)


def test_a_constant_torque_leaves_no_error_of_the_hub_angle(found):
    """S G -> s/Ki at s = 0, of the exact arm; (z - 1)/(T Ki) at z = 1 of the sampled one.  PD leaves 1/Kp."""
    c, s = found[True].coefficients, 1e-5j
    G = tfarm.transfer(LAB, "hub_angle")(s)
    assert abs(G / (1 + G * controller(c)(s))) == pytest.approx(abs(s) / c["Ki"], rel=1e-3)
    assert abs(G / (1 + G * c["Kp"])) == pytest.approx(1 / c["Kp"], rel=1e-3)
    law, Ki, q = found[False].law, found[False].coefficients["Ki"], np.array([1e-6])
    A, B, sense = HELD.parts
    held = sense[0] @ np.linalg.solve(np.exp(1j * q[0]) * np.eye(len(A)) - A, B)
    left = abs(held / (1 + HELD.loop(law, q)[0]))
    assert left == pytest.approx(q[0] / (T * Ki), rel=1e-2)
    assert left < 1e-3 / found[False].coefficients["Kp"]


def test_the_objective_is_not_worse_than_that_of_pd(found):
    """Without sampling; at 10 ms the derivative of the sampled angle lags a rate that is measured."""
    assert found[True].value >= design(LAB, structure="PD", continuous=True).value
    assert found[False].value >= 0.97 * design(LAB, structure="lead").value  # PD with a filter, of the angle too


def test_the_integral_gain_has_a_lower_limit(found):
    c = found[False].coefficients
    assert found[False].at_limit == ("Ki",)
    assert c["Ki"] == pytest.approx(INTEGRAL_SPEED * c["Kp"] * np.sqrt(c["Kp"] / LAB.total_inertia), rel=1e-9)


def test_pi_needs_friction(monkeypatch):
    """The roots of J s^3 + b s^2 + Kp s + Ki of a rigid arm are stable where b Kp > J Ki; without b never."""
    monkeypatch.setattr(search, "MOST_RUNS", 1)
    with pytest.raises(ConvergenceError, match="no law PI"):
        design(LAB, structure="PI")
    form = structure_of("PI", LAB, Kp=0.0, modes=2, period=T, bounds={})
    Kp, Ki = form.fixed["Kp"], 3 * form.free[0].bounds[0]
    for share, is_stable in ((1.1, True), (0.9, False)):
        rough = replace(LAB, hub=replace(LAB.hub, friction=share * LAB.total_inertia * Ki / Kp))
        assert np.roots([LAB.total_inertia, rough.hub.friction, Kp, Ki]).real.max() * (-1) ** is_stable > 0
        law = form.record_at(form.at([Ki]))
        assert stability(rough, law).is_stable == is_stable


def test_a_pi_law_of_a_motor_with_back_emf_is_saved_and_read_back(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(search, "MOST_RUNS", 1)
    file = tmp_path / "pi.toml"
    found = answer(capsys, "design", "quanser-flexlink", "--structure", "PI", "--save", str(file))
    values = {row["name"]: row["value"] for row in found["coefficients"]}
    (part,) = load_law(file).parts
    assert (part.block.num, part.block.den) == ((values["Kp"], values["Ki"]), (1.0, 0.0))
    assert answer(capsys, "sampled", "quanser-flexlink", "--law", str(file))["stable"] is True


def test_a_pinned_tip_has_laws_of_all_structures_and_a_locked_hub_none():
    """Sizes are those of the finite parts: the inertia of an arm with a pinned tip is infinite."""
    pinned, locked = LAB.having(payload_mass=np.inf), LAB.having(hub_inertia=np.inf)
    for name in STRUCTURES.keys() - {TWO_GAINS}:
        form = structure_of(name, pinned, Kp=0.0, modes=2, period=T, bounds={})
        assert np.isfinite([form.origin, *form.box]).all()
        assert 0.0 < form.fixed["Kp"] < np.inf
        with pytest.raises(ParameterError, match="locked hub"):
            design(locked, structure=name)
    assert design(pinned, structure="PD").verdict.is_stable
