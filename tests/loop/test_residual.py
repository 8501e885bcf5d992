"""What a slew asks of the loop, against its integrals by quadrature; what is left is tested with the designs."""

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback
from tfarm.arm import many_laws
from tfarm.loop.residual import RISE, TRAVEL, command

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
    angle = TRAVEL / LAB.length
    a = 4 * angle / RISE**2

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
