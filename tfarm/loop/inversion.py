"""Numerical inversion of a Laplace transform near t = 0, with its error measured.

    y(t) = e^{a t}/(2 pi) int F(a + i w) e^{i w t} dw

as a trapezoidal sum with the step 2 pi/P, which adds e^{-k a P} y(t + k P), k = 1, 2, ...; all times from one FFT
(Abate and Whitt, ORSA J. on Computing 7, 1995).  The sum ends at a frequency where F has been faded out by a cosine.
Errors measured at each run: the difference from a sum that ends at half of that frequency, and y(-t), which is 0.
"""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.records import frozen

# of the sum
POINTS = 2**15


@frozen
class Inversion:
    """Signals at even times `t` [s] from 0 to an end, their measured errors (signals, n), and their splines."""

    t: Real
    error: Real
    values_at: CubicSpline

    @property
    def end(self) -> float:
        """The last time [s]."""
        return float(self.t[-1])

    def errors_at(self, t: Real) -> Real:
        """Return the measured error (signals, n) at times t [s]."""
        return np.array([np.interp(t, self.t, each) for each in self.error])


def invert_transform(transform: Callable[[Complex], Complex], end: float, growth: float = 0.0) -> Inversion:
    """Return the inverse of a transform, (signals, n) at s (n,), from 0 to `end` [s]; poles have Re s <= `growth`."""
    # P is four times the times that are wanted; e^-36 of what follows is added
    periods = 4.0
    aliased = 36.0
    # times the points of the sum: even times, 4 in a period of its last frequency, 8 of the largest not faded
    finer = 4
    # of these times to either side, whose largest error is taken: the difference of two sums has zeros
    near = 32
    period = periods * end
    shift = growth + aliased / period
    n = np.arange(POINTS)
    values = transform(shift + 2j * np.pi * n / period)
    values[:, 0] /= 2
    k = np.arange(finer * POINTS)
    t = period / k.size * np.where(k < k.size / 2, k, k - k.size)
    rising = 2 / period * np.exp(shift * t)

    def add_up(last: int) -> Real:
        fade = np.clip(2 - 2 * n / last, 0, 1)
        faded = values * np.sin(np.pi / 2 * fade) ** 2
        return np.asarray(rising * (np.fft.ifft(faded, k.size, axis=1) * k.size).real)

    y = add_up(POINTS)
    shorter = add_up(POINTS // 2)
    error = np.maximum(abs(y - shorter), abs(np.roll(y[:, ::-1], 1, axis=1)))
    error = maximum_filter1d(error, 2 * near + 1, axis=1, mode="wrap")
    error += MACHINE_EPS * rising * abs(values).sum(axis=1, keepdims=True)
    wanted = slice(k.size // int(periods) + 1)
    return Inversion(t[wanted], error[:, wanted], CubicSpline(t[wanted], y[:, wanted], axis=1))
