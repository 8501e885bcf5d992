"""Inverse Laplace transforms by two methods and in closed form, without poles of a loop.

Both methods are sums of the transform on a line Re s = a at the frequencies 2 pi k/P, which alias by e^{-a P}:
Durbin's is a trapezoid by one FFT (F. Durbin, Computer Journal 17, 1974), its last half let down to 0 smoothly, so that
vibration which has decayed at a time leaves no error there.  That of de Hoog, Knight and Stokes (SIAM J. Sci. Stat.
Comput. 3, 1982) continues the sum by a continued fraction of its next terms, here beyond a plain sum of the first ones.
A rational transform times delays is inverted by partial fractions with multiple poles.
"""

import math
from dataclasses import dataclass

import mpmath
import numpy as np

DURBIN_PERIODS, DURBIN_SHIFT = 4.0, 30.0  # P over the duration, and a P: aliases by e^-30, grows by e^7.5 at its end
HOOG_PERIODS, HOOG_SHIFT = 3.0, 28.0  # others, so that errors of both are different
TAIL = 12  # pairs of terms of the continued fraction
BLOCK = 128  # terms of the plain sum whose powers are made at once
MOST_OF_TAIL = 50.0  # of the first term left out: a larger continued fraction is one near its own pole
DIGITS = 40


def durbin(transform, duration, points=2**18):
    """Times (n,) from 0 to the duration and signals (rows, n) of `transform(s)` (rows, m), by one FFT."""
    period = DURBIN_PERIODS * duration
    a = DURBIN_SHIFT / period
    values = transform(a + 2j * np.pi / period * np.arange(points // 2 + 1))
    values *= let_down(points // 2 + 1)
    t = np.arange(1 + round(points / DURBIN_PERIODS)) * period / points
    return t, np.fft.irfft(values, points, axis=1)[:, : t.size] * (points / period) * np.exp(a * t)


def let_down(count):
    """Weights (count,) that are 1 in the first half and fall to 0 in the second, with all derivatives."""
    x = np.clip(np.arange(count) / (count - 1) * 2 - 1, 2e-3, 1 - 2e-3)
    return 1 / (1 + np.exp(1 / (1 - x) - 1 / x))


class DeHoog:
    """The sum of a transform of several groups, whose delays are taken out, at any times up to a duration.

    `transform(s)` is (groups, rows, m), and the signal sum_g sum_j w_gj y_g(t - t_gj) of `shifts`, for each group pairs
    (t_gj, w_gj).
    """

    def __init__(self, transform, shifts, duration, nodes=2**15):
        self.period = HOOG_PERIODS * duration
        self.a, self.shifts, self.nodes = HOOG_SHIFT / self.period, shifts, nodes
        k = np.arange(nodes + 2 * TAIL + 1)
        self.s = self.a + 2j * np.pi / self.period * k
        every = transform(self.s)
        every[:, :, 0] /= 2
        delays = [sum(w * np.exp(-self.s[:nodes] * at) for at, w in pairs) for pairs in shifts]
        self.first = sum(np.multiply(each[:, :nodes], delay) for each, delay in zip(every, delays, strict=True))
        self.rest = every[:, :, nodes:]
        self.fractions = [continued_fraction(rows) for rows in self.rest]

    def at(self, t):
        """Signals (2, rows, n) at times t (n,): with the continued fraction, and with a sum that is let down."""
        t = np.asarray(t, float)
        z = np.exp(2j * np.pi / self.period * t)
        low, high = (z ** np.arange(0, most, step)[:, None] for most, step in ((BLOCK, 1), (self.nodes, BLOCK)))
        sums = np.array([self.first, self.first * let_down(self.nodes)])
        total, plain = np.einsum("wrhn,hn->wrn", sums.reshape(2, len(self.first), -1, BLOCK) @ low, high)
        for rows, d, pairs in zip(self.rest, self.fractions, self.shifts, strict=True):
            for at, weight in pairs:
                own = z * np.exp(-2j * np.pi / self.period * at)
                tail = fraction_at(d, own)
                tail[~(abs(tail) <= MOST_OF_TAIL * abs(rows[:, :1]))] = 0.0
                total = total + weight * math.exp(-self.a * at) * tail * own**self.nodes
        return 2 / self.period * np.exp(self.a * t) * np.array([total, plain]).real


def continued_fraction(terms):
    """Coefficients d (rows, n) of d_0/(1 + d_1 z/(1 + d_2 z/...)) = sum of terms (rows, n) z^k, by differences."""
    d = np.zeros(terms.shape, complex)
    d[:, 0] = terms[:, 0]
    with np.errstate(all="ignore"):
        q, e = terms[:, 1:] / terms[:, :-1], np.zeros((len(terms), terms.shape[1]), complex)
        for r in range(1, (terms.shape[1] - 1) // 2 + 1):
            d[:, 2 * r - 1] = -q[:, 0]
            e = q[:, 1:] - q[:, :-1] + e[:, 1 : q.shape[1]]
            d[:, 2 * r] = -e[:, 0]
            q = q[:, 1:-1] * e[:, 1:] / e[:, :-1]
    return d


def fraction_at(d, z):
    """The continued fraction (rows, n) of coefficients d (rows, m) at z (n,), from its end."""
    value = np.ones((len(d), z.size), complex)
    with np.errstate(all="ignore"):
        for n in range(d.shape[1] - 1, 0, -1):
            value = 1 + d[:, n : n + 1] * z / value
        return d[:, :1] / value


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
