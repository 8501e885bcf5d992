"""K. R. Chun (1972), Free vibration of a beam with one end spring-hinged and the other free, J. Appl. Mech. 39, 1154.

Root: a hinge with a spring of k L/EI to the ground.  L (w^2 rhoA/EI)^(1/4) of the first mode for k L/EI = 0.1 to 100.
Set down without a copy at hand; each digit is confirmed by the transcendental equation.
"""

import math

import mpmath
import pytest

from tests.published.chains import natural_frequencies, unit_link
from tfarm import Arm, Hub
from tfarm.arm import RotarySpring
from tfarm.audit.published import agrees

TABLE = {0.1: "0.7358", 1.0: "1.2479", 10.0: "1.7227", 100.0: "1.8568"}


def hinged(**parts):
    return Arm(link=unit_link(), theory="euler-bernoulli", **parts)


@pytest.mark.parametrize("stiffness", TABLE)
def test_every_printed_digit_is_right_wherever_the_spring_is_put(stiffness):
    """A yielding clamp, a yielding joint and a spring on a hub without inertia are one and the same here."""
    arms = [
        hinged(hub=Hub(inertia=math.inf), clamp=RotarySpring(stiffness=stiffness)),
        hinged(hub=Hub(inertia=math.inf), joint=RotarySpring(stiffness=stiffness)),
        hinged(hub=Hub(inertia=0.0, stiffness=stiffness)),
    ]
    for arm in arms:
        found = math.sqrt(natural_frequencies(arm, 1)[0])
        assert agrees(found, TABLE[stiffness])
        assert found == pytest.approx(by_the_equation(stiffness, found), rel=1e-9)


def by_the_equation(k, guess):
    """k (1 + cos z cosh z) + z (cos z sinh z - sin z cosh z) = 0."""

    def equation(z):
        cosine, sine = mpmath.cos(z), mpmath.sin(z)
        return k * (1 + cosine * mpmath.cosh(z)) + z * (cosine * mpmath.sinh(z) - sine * mpmath.cosh(z))

    return float(mpmath.findroot(equation, guess))
