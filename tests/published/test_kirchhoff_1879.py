"""G. Kirchhoff (1879): a wedge and a cone, clamped at the thick end, which come to a point.

Fundamentals 5.315 and 8.719 times (EI/(rhoA L^4))^(1/2) of the thick end, as every textbook has them (Timoshenko,
Vibration Problems in Engineering, section on beams of variable section).  Set down without a copy at hand; confirmed
here by his Bessel functions and by steps.
"""

import mpmath
import pytest

from tests.published.chains import natural_frequencies, stepped
from tfarm import Payload
from tfarm.audit.published import agrees

# power of 1 - x in rhoA, which is 2 less than that in EI; the fundamental
SHAPES = {"wedge": (1, "5.315"), "cone": (2, "8.719")}


def by_bessel_functions(n):
    """z^2/4 of J_n I_(n+1) + I_n J_(n+1) = 0 at z: w = y^(-n/2) (a J_n + b I_n)(2 sqrt(...)), y from the point."""

    def equation(z):
        J, I = mpmath.besselj, mpmath.besseli
        return J(n, z) * I(n + 1, z) + I(n, z) * J(n + 1, z)

    return float(mpmath.findroot(equation, 3.3 + 1.3 * n) ** 2 / 4)


@pytest.mark.parametrize("shape", SHAPES)
def test_both_roads_give_the_printed_fundamental(shape):
    """The steps come from below, 1/n^2 apart, and so a third of their last difference is still missing."""
    n, printed = SHAPES[shape]
    exact = by_bessel_functions(n)
    assert agrees(exact, printed)

    def beam(steps):
        return stepped(steps, lambda x: (1 - x) ** (n + 2), lambda x: (1 - x) ** n, Payload())

    coarse, fine = (natural_frequencies(beam(steps), 1)[0] for steps in (16, 32))
    assert coarse < fine < exact
    assert fine + (fine - coarse) / 3 == pytest.approx(exact, rel=1e-3)
    assert (exact - fine) / (exact - coarse) == pytest.approx(1 / 4, abs=0.02)
