"""Inverse Laplace transforms by Durbin's method and in closed form, without poles of a loop.

The method (F. Durbin, Computer Journal 17, 1974) is a trapezoid of the transform on a line Re s = a at the frequencies
2 pi k/P by one FFT, which aliases by e^{-a P}; its last half is let down to 0 smoothly, so that vibration which has
decayed at a time leaves no error there.  With another period and another shift its errors are others.
A rational transform times delays is inverted by partial fractions with multiple poles.
"""

import math
from dataclasses import dataclass

import mpmath
import numpy as np

DIGITS = 40


def durbin(transform, duration, points=2**18, periods=4.0, shift=30.0):
    """Times (n,) from 0 to the duration and signals (rows, n) of `transform(s)` (rows, m), by one FFT.

    P is that many durations, and a P the shift: aliases by e^-30, and growth by e^7.5 at the end.
    """
    period = periods * duration
    a = shift / period
    values = transform(a + 2j * np.pi / period * np.arange(points // 2 + 1))
    values *= let_down(points // 2 + 1)
    t = np.arange(1 + math.ceil(points / periods)) * period / points
    return t, np.fft.irfft(values, points, axis=1)[:, : t.size] * (points / period) * np.exp(a * t)


def let_down(count):
    """Weights (count,) that are 1 in the first half and fall to 0 in the second, with all derivatives."""
    x = np.clip(np.arange(count) / (count - 1) * 2 - 1, 2e-3, 1 - 2e-3)
    return 1 / (1 + np.exp(1 / (1 - x) - 1 / x))


@dataclass(frozen=True)
class Exponentials:
    """sum of r t^(k - 1)/(k - 1)! e^{p t} of `terms` (p, k, r) for t >= 0, and an `impulse` at t = 0."""

    terms: tuple
    impulse: float

    def at(self, t):
        """Values from t = 0+ on, and 0 before."""
        later = np.maximum(t, 0.0)
        total = sum(r * later ** (k - 1) / math.factorial(k - 1) * np.exp(p * later) for p, k, r in self.terms)
        return np.where(t >= 0, total, 0.0)

    def rounding(self, t):
        """Error of these values at times t by rounding, large where poles nearly coincide."""
        later = np.maximum(t, 0.0)
        sizes = (abs(r) * later ** (k - 1) / math.factorial(k - 1) * np.exp(p * later) for p, k, r in self.terms)
        return np.finfo(float).eps * sum(sizes, 0 * later)


def inverse(num, poles):
    """The inverse of num(s)/prod (s - p)^m: highest powers first, and `poles` {p: m}, real; by series at each pole."""
    with mpmath.workdps(DIGITS):
        num = [mpmath.mpf(each) for each in np.trim_zeros(num, "f")] or [mpmath.mpf(0)]
        excess, terms = len(num) - 1 - sum(poles.values()), []
        assert excess <= 0, "a doublet or worse"
        for p, m in poles.items():
            series = [mpmath.polyval(derivative(num, k), p) / mpmath.factorial(k) for k in range(m)]
            for other, n in poles.items():
                if other != p:  # (p - other + x)^-n
                    gap = mpmath.mpf(p) - mpmath.mpf(other)
                    own = [mpmath.binomial(-n, k) * gap ** (-n - k) for k in range(m)]
                    series = [sum(series[j] * own[k - j] for j in range(k + 1)) for k in range(m)]
            terms += [(float(p), m - k, float(series[k])) for k in range(m)]
        return Exponentials(tuple(terms), float(num[0]) if excess == 0 else 0.0)


def derivative(num, k):
    """The k-th derivative of a polynomial, highest power first."""
    for _ in range(k):
        num = [each * (len(num) - 1 - n) for n, each in enumerate(num[:-1])] or [mpmath.mpf(0)]
    return num
