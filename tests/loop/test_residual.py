"""What a slew asks of the loop, against its integrals by quadrature, and what it leaves, against another model."""

import numpy as np
import pytest
from scipy.linalg import expm

import tfarm
from tests.loop.ritz_loop import RitzLoop
from tests.shared import thinned
from tfarm import HubFeedback
from tfarm.arm import many_laws
from tfarm.dsp import Chain, Sampling, Slew
from tfarm.loop.residual import PERIOD_SAMPLES, RISE, TURN, command, residual_moment

LAB = tfarm.load("sasaki2012-lab")


def transformed(signal, s):
    """The integral of signal(t) e^{s (RISE - t)} over the slew, by Gauss's rule on 40 parts of either half."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    ends = np.linspace(0.0, RISE, 81)
    middle, half = (ends[1:] + ends[:-1]) / 2, (ends[1:] - ends[:-1]) / 2
    t = (middle[:, None] + half[:, None] * nodes).ravel()
    return ((half[:, None] * weights).ravel() * signal(t) * np.exp(s * (RISE - t))).sum()


@pytest.mark.parametrize("gains", [HubFeedback(), HubFeedback(K1=0.3), HubFeedback(K1=0.1, Kp=2.0)])
def test_the_command_is_the_transform_of_a_bang_bang_slew(gains):
    """J theta_tt + K1 theta_t + Kp theta of the reference, whose angle stays at its end: the last term's end is /s."""
    angle, a = TURN, 4 * TURN / RISE**2

    def acceleration(t):
        return np.where(t < RISE / 2, a, -a)

    def rate(t):
        return np.where(t < RISE / 2, a * t, a * (RISE - t))

    def turned(t):
        return np.where(t < RISE / 2, a * t**2 / 2, angle - a * (RISE - t) ** 2 / 2)

    s = np.array([-1.3 + 71.5j, -2.0 + 204.0j, -0.46 + 0j])
    expected = [
        LAB.total_inertia * transformed(acceleration, each)
        + gains.K1 * transformed(rate, each)
        + gains.Kp * (transformed(turned, each) + angle / each)
        for each in s
    ]
    laws = np.repeat(many_laws(gains, K1=np.array([gains.K1])), s.size, axis=1)
    size = LAB.total_inertia * a + gains.K1 * a + gains.Kp * angle
    np.testing.assert_allclose(command(LAB, s, laws), expected, rtol=0, atol=1e-12 * size)


def played(gains, terms):
    """Root-mean-square of the moment over a period after the slew, by matrix exponentials of a Legendre-Ritz model.

    The states are those of the loop, and the reference's angle, rate and acceleration, which drive it.
    """
    loop = RitzLoop(LAB, terms)
    A, C, n = loop.state_matrix(gains), loop.damping, loop.n
    motion = np.linalg.solve(loop.M, loop.b)
    B = np.r_[np.zeros(n), motion, (loop.inertia * loop.b @ motion - 1) / C]
    whole = np.zeros((A.shape[0] + 3,) * 2)
    whole[: len(A), : len(A)] = A
    whole[: len(A), len(A) :] = np.outer(B, [gains.Kp, gains.K1, LAB.total_inertia])
    whole[len(A), len(A) + 1] = whole[len(A) + 1, len(A) + 2] = 1.0
    z, a = np.zeros(len(whole)), 4 * TURN / RISE**2
    for acceleration in (a, -a):
        z[-1] = acceleration
        z = expm(whole * RISE / 2) @ z
    z[-1] = 0.0
    period = 2 * np.pi / tfarm.modes(LAB, 1).natural_frequency[-1]
    step = expm(whole * period / PERIOD_SAMPLES)
    moments = []
    for _ in range(PERIOD_SAMPLES):
        moments.append(z[len(A) - 1])
        z = step @ z
    return np.sqrt(np.mean(np.square(moments)))


@pytest.mark.parametrize(
    ("gains", "modes"), thinned([(HubFeedback(K1=0.1, K2=-0.5, Kp=2.0), 10), (HubFeedback(K1=0.3, K2=0.3), 12)], 2)
)
def test_what_is_left_is_what_another_model_leaves(gains, modes):
    """The model's highest modes are not the arm's; as these have died down, the first ten or twelve leave it all."""
    found = residual_moment(LAB, many_laws(gains, K1=np.array([gains.K1])), modes)
    assert found == pytest.approx([played(gains, 16)], rel=1e-5)


def test_what_is_left_on_a_rig_is_what_a_fast_sampled_loop_leaves():
    """A motor with back-EMF and friction, a link of 0.4 m, and a slew of its own: at a 640th of the first period."""
    arm = tfarm.load("quanser-flexlink").having(damping=1e-4)
    gains, turn = HubFeedback(K1=0.5 * arm.rate_loss, Kp=2.0), 0.6
    period = 2 * np.pi / tfarm.modes(arm, 1).natural_frequency[-1]
    T = period / (10 * PERIOD_SAMPLES)
    rise = 600 * T
    chain = Chain(sampling=Sampling(period=T), slew=Slew(rise_time=rise, travel=turn * arm.reach))
    sampled = tfarm.simulate(arm, gains, chain=chain, duration=rise + period, count=6)
    moments = sampled.at_samples.root_moment[600 : 600 + 10 * PERIOD_SAMPLES : 10]
    laws = many_laws(gains, K1=np.array([gains.K1]))
    found = residual_moment(arm, laws, 6, rise=rise, turn=turn)
    assert found == pytest.approx([np.sqrt(np.mean(moments**2))], rel=3e-3)
