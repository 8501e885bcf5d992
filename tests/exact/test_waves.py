"""Wave numbers of a segment against 30 digits."""

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm.exact.layout import kernel_row
from tfarm.exact.system import system_of
from tfarm.exact.waves import fill_wave_numbers


@pytest.mark.parametrize("name", ["sasaki2012", "stocky-steel"])
def test_the_first_wave_is_the_larger_root_and_the_other_keeps_its_digits(name):
    """Roots z of z^2 - S (a + b) z + S (a b S + g) at C = 0, all around s = 0: by 30 digits, in order of size."""
    (segment,) = system_of(tfarm.load(name)).segments
    s = np.outer([3.0, 400.0, 3e4], np.exp(1j * np.linspace(0.02, 3.1, 24))).ravel()
    found = np.empty((6, s.size), complex)
    fill_wave_numbers(s, np.array(kernel_row(segment)), found)
    one, two = found[0], found[3]
    a, b, g = (mpmath.mpf(each.numerator) / each.denominator for each in segment[:3])
    with mpmath.workdps(30):
        for n, at in enumerate(s):
            S = mpmath.mpc(complex(at)) ** 2
            roots = sorted(mpmath.polyroots([1, -S * (a + b), S * (a * b * S + g)], extraprec=60), key=abs)
            assert abs(one[n]) >= abs(two[n]) * (1 - 1e-12)
            for z in (one[n], two[n]):
                assert min(abs(complex(z / root) - 1) for root in roots) < 1e-13
