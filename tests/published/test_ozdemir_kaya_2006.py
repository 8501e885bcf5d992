"""O. Ozdemir Ozgumus and M. O. Kaya (2006), flapwise bending of a rotating double-tapered beam: its rows at rest.

As reproduced in International Journal of Mechanical and Materials Engineering 10 (2015), "Flapwise bending vibration
analysis of functionally graded rotating double-tapered beams", table 1, where they stand beside its own.  Breadth
b = 1 - tau_b x, depth h = 1 - tau_h x, clamped at x = 0; w L^2 (rhoA/EI)^(1/2) of the root's section; Euler-Bernoulli.
At rest the hub's radius does nothing.  Here the taper is 6, 12 and 24 steps, continued to infinitely many.
"""

import pytest

from tests.published.chains import stepped, without_steps
from tfarm import Payload
from tfarm.audit.published import agrees

# (tau_h, tau_b): the first three
TABLE = {
    (0.2, 0.4): ("4.18932", "21.6327", "57.2257"),
    (0.4, 0.0): ("3.73708", "19.1138", "50.3537"),
}


@pytest.mark.parametrize(("tau_h", "tau_b"), TABLE)
def test_every_printed_digit_is_right(tau_h, tau_b):
    def beam(steps):
        def rhoA(x):
            return (1 - tau_b * x) * (1 - tau_h * x)

        return stepped(steps, lambda x: rhoA(x) * (1 - tau_h * x) ** 2, rhoA, Payload())

    found = without_steps(beam, 3)
    for ours, printed in zip(found.tolist(), TABLE[tau_h, tau_b], strict=True):
        assert agrees(ours, printed)
