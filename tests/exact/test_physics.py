"""What nature guarantees for every arm: conjugate symmetry, reciprocity, passivity, the work of a damper."""

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import tfarm
from tests.outputs import OF_ONE_LINK
from tests.strategies import arms, dampings, finite, frequencies, undamped

EPS = np.finfo(float).eps
ENDS = [name for name, output in OF_ONE_LINK.items() if output.place != "x"]
free_hubs = st.one_of(st.just(0.0), finite)
angles = st.floats(-1.5, 1.5)
dear = settings(max_examples=max(1, settings.default.max_examples * 2 // 5))  # of many points along the arm


def values(arm, names, s):
    """The outputs at s; a pole, which a random s hits only by being exactly on one, is no example."""
    try:
        return tfarm.transfer(arm, names)(s)
    except tfarm.ParameterError:
        assume(False)


@given(arm=arms(), size=frequencies, angle=st.floats(0.001, 3.14))
def test_conjugate_s_gives_the_conjugate_output(arm, size, angle):
    """To the last bit: no operation of the kernel distinguishes i from -i."""
    s = complex(size * math.cos(angle), size * math.sin(angle))
    assert np.array_equal(values(arm, ENDS, s.conjugate()), values(arm, ENDS, s).conj())


@given(arm=arms(), s=frequencies)
def test_a_real_s_gives_a_real_output(arm, s):
    """But for rounding: below some s the waves are a complex pair even there."""
    G = tfarm.transfer(arm, ENDS)
    for value, slope in zip(values(arm, ENDS, s), G.derivative(s), strict=True):
        assert abs(complex(value).imag) <= 90 * EPS * (abs(value) + abs(s * slope))


@given(arm=arms(damping=undamped), omega=frequencies)
def test_on_the_imaginary_axis_an_undamped_arm_does_no_work(arm, omega):
    """At C = 0 an output over s^power is real there, but for the rounding of a travelling wave."""
    G = tfarm.transfer(arm, ENDS)
    for name, value, slope in zip(ENDS, values(arm, ENDS, 1j * omega), G.derivative(1j * omega), strict=True):
        across = value.real if OF_ONE_LINK[name].power == 1 else value.imag
        assert abs(across) <= 90 * EPS * (abs(value) + abs(omega * slope))


@given(arm=arms(hub=free_hubs, damping=dampings), size=frequencies, angle=angles)
def test_the_hub_rate_is_passive(arm, size, angle):
    """Torque times hub rate is work done on an arm that only stores or dissipates: Re (s theta/u) >= 0 for Re s > 0."""
    s = complex(size * math.cos(angle), size * math.sin(angle))
    rate, angle = values(arm, ["hub_rate", "hub_angle"], s)
    slope = abs(s * tfarm.transfer(arm, "hub_rate").derivative(s) / rate)
    assert rate.real >= -90 * EPS * (1 + slope) * abs(rate)


@dear
@given(arm=arms(hub=free_hubs), omega=st.floats(0.1, 6.0), x=st.floats(0.05, 0.95))
def test_the_fields_balance_the_arm(arm, omega, x):
    """Newton and Euler for the part of the arm beyond x, at C = 0 or not: its shear and moment carry what it does.

    Q(x) = -s^2 (int rho A w + m w(L)), by Gauss's rule over the deflection of that part.
    """
    link, L = arm.link, arm.link.length
    s = 1j * omega * math.sqrt(link.EI / (link.rhoA * L**4))
    if math.isinf(arm.payload.mass):
        assume(False)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    points = L * (x + (1 - x) * (nodes + 1) / 2)
    theta, tip = values(arm, ["hub_angle", "tip_displacement"], s)
    w = np.array([tfarm.transfer(arm, "deflection", x=at)(s) + at * theta for at in points])
    inertia = link.rhoA * L * (1 - x) / 2 * (weights @ w) + arm.payload.mass * tip
    scale = link.rhoA * L * (weights @ abs(w)) + arm.payload.mass * abs(tip)
    shear = tfarm.transfer(arm, "shear", x=x * L)(s)
    assert abs(shear + s**2 * inertia) <= 64 * EPS * (abs(shear) + abs(s) ** 2 * scale)
