"""Closed forms at both ends of the frequency axis: the rigid arm with its static bending, and the arm without end."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial

import tfarm
from tests.outputs import OF_ONE_LINK
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm import Hub, Payload

EPS = np.finfo(float).eps
ENDS = [name for name, output in OF_ONE_LINK.items() if output.place != "x"]
FINITE = [case for case in BOUNDARY_CASES if "infinite" not in case]
LOCKED = [case for case in BOUNDARY_CASES if case[0] == "infinite" and "infinite" not in case[1:]]


def slowly(arm):
    """An s so slow that the first correction to the limits, of order s^2 J L/EI or C s, is below rounding."""
    link, payload = arm.link, arm.payload
    inertia = link.rhoA * link.length**3 + payload.mass * link.length**2 + payload.inertia
    return 1e-3 * math.sqrt(EPS * link.EI / (inertia * link.length)) / (1 + link.slenderness * link.damping)


def static(arm):
    """M(x), Q(x), psi - theta and w - x theta of an arm turned with unit angular acceleration."""
    link, payload = arm.link, arm.payload
    L, x = link.length, Polynomial([0, 1])
    Q = -(link.rhoA * (L**2 - x**2) / 2 + payload.mass * L)
    beyond = link.rhoA * (L**3 / 3 - x * L**2 / 2 + x**3 / 6)  # int from x to L of rho A z (z - x) dz
    M = -(beyond + payload.mass * L * (L - x) + link.rhoI * (L - x) + payload.inertia)
    Phi = (M / link.EI).integ()
    return M, Q, Phi, (Phi + Q / link.kGA).integ()


@pytest.mark.parametrize("case", FINITE + LOCKED)
def test_a_slow_input_turns_a_rigid_arm(case):
    """By 1/J of a torque and by s^2 of a hub angle, as an acceleration: with the bending of an accelerated beam."""
    arm = some_arm(np.random.default_rng((FINITE + LOCKED).index(case)), case, damping=0.0)
    s, L = slowly(arm) * 1j, arm.link.length
    M, Q, Phi, Y = static(arm)
    turned = s**2 if arm.is_locked else 1 / arm.total_inertia
    expected = {
        "hub_angle": 1 / s**2,
        "hub_rate": 1 / s,
        "tip_displacement": L / s**2,
        "tip_deflection": Y(L),
        "tip_acceleration": L,
        "root_moment": M(0),  # of a torque it is -(J - I_h)/J, without the subtraction
        "root_shear": Q(0),
    }
    values = np.array(tfarm.transfer(arm, ENDS)(s)) / turned
    assert dict(zip(ENDS, values, strict=True)) == pytest.approx(expected, rel=64 * EPS, abs=0)
    for x in (1e-3 * L, 0.2 * L, 0.5 * L, 0.9 * L):
        found = np.array(tfarm.transfer(arm, ["moment", "shear", "rotation", "deflection"], x=x)(s)) / turned
        # the polynomials themselves lose what their terms cancel
        scales = [Polynomial(abs(field.coef))(x) for field in (M, Q, Phi, Y)]
        assert (abs(found - [field(x) for field in (M, Q, Phi, Y)]) <= 64 * EPS * np.array(scales)).all()
    if not arm.is_locked:
        assert M(0) == pytest.approx(arm.hub.inertia - arm.total_inertia, abs=8 * EPS * arm.total_inertia)


def test_a_pinned_or_clamped_tip_makes_a_slow_torque_bend_a_beam():
    """Root stiffness of a beam: 4 EI/L clamped, 3 EI/L pinned, EI/L guided at its far end, each with shear."""
    arm = replace(tfarm.load("stocky-steel"), hub=Hub(inertia=0.0))
    link = arm.link
    L, sigma = link.length, link.EI / (link.kGA * link.length**2)
    stiffness = {
        (math.inf, math.inf): (4 + 12 * sigma) / (1 + 12 * sigma),
        (math.inf, 0.0): 3 / (1 + 3 * sigma),
        (0.0, math.inf): 1.0,
    }
    for (mass, inertia), factor in stiffness.items():
        held = replace(arm, payload=Payload(mass=mass, inertia=inertia))
        s = 1e-3 * math.sqrt(EPS * link.EI / (link.rhoA * L**4)) * 1j
        assert tfarm.transfer(held, "hub_angle")(s) == pytest.approx(L / (factor * link.EI), rel=64 * EPS, abs=0)
        assert tfarm.transfer(held, "root_moment")(s) == pytest.approx(-1, rel=4 * EPS, abs=0)


@pytest.mark.parametrize("size", [1e4, 1e12])
@pytest.mark.parametrize("angle", [0.0, 0.7, -1.2])
@pytest.mark.parametrize("case", BOUNDARY_CASES)
def test_at_huge_s_no_wave_comes_back_from_the_tip(case, angle, size):
    """Two decaying waves with W(0) = 0 make M(0) = -E I d theta (g1 l1 - g2 l2)/(g1 - g2), without an overflow."""
    arm = some_arm(np.random.default_rng(BOUNDARY_CASES.index(case)), case, damping=0.0, slenderness=(5, 50))
    link, s = arm.link, cmath.rect(size * arm.shear_cutoff, angle)
    bend, shear = link.rhoI / link.EI * s * s, link.rhoA / link.kGA * s * s
    spread = cmath.sqrt(((bend - shear) / 2) ** 2 - link.rhoA * s * s / link.EI)
    l1, l2 = (cmath.sqrt((bend + shear) / 2 + sign * spread) for sign in (1, -1))
    g1, g2 = ((l * l - shear) / l for l in (l1, l2))
    moment = -link.EI * (g1 * l1 - g2 * l2) / (g1 - g2)
    with np.errstate(all="raise", under="ignore"):
        theta, M, W = tfarm.transfer(arm, ["hub_angle", "root_moment", "tip_displacement"])(s)
    assert W == 0
    if arm.is_locked:
        assert theta == pytest.approx(1, rel=4 * EPS, abs=0)
        assert pytest.approx(moment, rel=1e3 * EPS, abs=0) == M
    else:
        assert theta == pytest.approx(1 / (arm.hub.inertia * s * s - moment), rel=1e3 * EPS, abs=0)
