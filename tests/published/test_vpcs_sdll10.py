"""Société française des mécaniciens, sheet SDLL10/89: a beam clamped at both ends whose breadth falls exponentially.

As code_aster's test sdll10a reproduces it: L = 0.6 m, depth 0.01 m, breadth 0.03 m e^(-2 a x) with a = 1/m, E = 200
GPa, 7800 kg/m^3, Euler-Bernoulli; 143.303, 396.821, 779.425 and 1289.577 Hz.  The shapes are e^(l x), where
l = a +- (a^2 +- k^2)^(1/2) and k^4 = w^2 rhoA/EI.  The sheet's frequencies are those of a^2 with the other sign (the
first to 1.1e-4 only): they lie below the uniform beam's, and must lie above.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.published.chains import natural_frequencies, stepped, unit_link, without_steps
from tfarm import Arm, Hub, Payload

PRINTED = np.array([143.303, 396.821, 779.425, 1289.577])  # Hz
LENGTH, SHARE = 0.6, 1.0  # m, 1/m
UNIT = math.sqrt(200e9 / (12 * 7800.0)) * 0.01 / (2 * math.pi)  # Hz m^2, of k^2
HELD = Payload(mass=math.inf, inertia=math.inf)


def by_the_equation(square, guesses):
    """2 r s (1 - cosh r L cos s L) + (r^2 - s^2) sinh r L sin s L = 0 of r^2 = k^2 + a^2, s^2 = k^2 - a^2 [Hz]."""

    def equation(frequency):
        k2 = frequency / UNIT
        r, s = math.sqrt(k2 + square), math.sqrt(k2 - square)
        waves = 2 * r * s * (1 / math.cosh(r * LENGTH) - math.cos(s * LENGTH))
        return waves + 2 * square * math.tanh(r * LENGTH) * math.sin(s * LENGTH)

    return np.array([brentq(equation, 0.99 * guess, 1.01 * guess) for guess in guesses])


def tapered(steps):
    def breadth(x):
        return math.exp(-2 * SHARE * LENGTH * x)

    return stepped(steps, breadth, breadth, HELD, length=LENGTH)


def test_steps_come_to_the_exact_solution_and_the_sheet_to_that_of_the_other_sign():
    ours = without_steps(tapered, 4, steps=(8, 16)) * UNIT
    exact = by_the_equation(SHARE**2, ours)
    assert ours == pytest.approx(exact, rel=1e-5)  # 6e-6: the next power of the steps
    theirs = by_the_equation(-(SHARE**2), PRINTED)
    assert theirs[1:] == pytest.approx(PRINTED[1:], abs=6e-4)
    assert theirs[0] == pytest.approx(PRINTED[0], rel=1.2e-4)
    uniform = Arm(link=unit_link(LENGTH), hub=Hub(inertia=math.inf), payload=HELD, theory="euler-bernoulli")
    plain = natural_frequencies(uniform, 4) * UNIT
    assert (plain > PRINTED).all()
    assert (ours > plain).all()
