"""Waves, and the free response at the tip with its slopes: against 30 digits, the fields along the arm, differences."""

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm.exact.coefficients import coefficients
from tfarm.exact.fields import fields, waves
from tfarm.exact.free import free_response, tip_response

S = np.array([0.4 + 3j, -3 + 40j, 2 + 900j, -80 + 5e3j, 60.0])  # slow, where series are taken, and fast


def tip(k, s):
    """Rotation, moment and shear at the tip for a unit of the input."""
    free, at_tip = free_response(k, s), tip_response(k, s)
    drive = free.drive.c[0] * np.exp(free.scale - at_tip.scale)
    return np.array([part.c[0] / drive for part in at_tip[:3]])


@pytest.mark.parametrize("name", ["sasaki2012", "sasaki2012-lab"])
def test_at_the_tip_are_the_fields_of_the_whole_length(name):
    k = coefficients(tfarm.load(name))
    along, _ = fields(k, S, 1.0)
    assert tip(k, S) == pytest.approx(along[1:], rel=1e-12)


@pytest.mark.parametrize("name", ["sasaki2012", "sasaki2012-lab"])
def test_slopes_are_differences_over_six_points(name):
    """Slope over value, in which the scale that is not part of it takes no part: with h = 1e-3 |s| good to 1e-10."""
    k, h = coefficients(tfarm.load(name)), 1e-3 * abs(S)
    here = tip_response(k, S)

    def values(n):
        other = tip_response(k, S + n * h)
        return np.array([part.c[0] * np.exp(other.scale - here.scale) for part in other[:3]])

    difference = (45 * (values(1) - values(-1)) - 9 * (values(2) - values(-2)) + values(3) - values(-3)) / (60 * h)
    assert np.array([part.c[1] for part in here[:3]]) == pytest.approx(difference, rel=1e-10)


@pytest.mark.parametrize("name", ["sasaki2012", "stocky-steel"])
def test_the_first_wave_is_the_larger_root_and_the_other_keeps_its_digits(name):
    """Roots z of z^2 - S (a + b) z + S (a b S + g) at C = 0, all around s = 0: by 30 digits, in order of size."""
    k = coefficients(tfarm.load(name))
    s = np.outer([3.0, 400.0, 3e4], np.exp(1j * np.linspace(0.02, 3.1, 24))).ravel()
    _, _, _, one, two = waves(k, s)
    a, b, g = (mpmath.mpf(each.numerator) / each.denominator for each in (k.a, k.b, k.g))
    with mpmath.workdps(30):
        for n, at in enumerate(s):
            S = mpmath.mpc(complex(at)) ** 2
            roots = sorted(mpmath.polyroots([1, -S * (a + b), S * (a * b * S + g)], extraprec=60), key=abs)
            assert abs(one.z[n]) >= abs(two.z[n]) * (1 - 1e-12)
            for found in (one.z[n], two.z[n]):
                assert min(abs(complex(found / root) - 1) for root in roots) < 1e-13
