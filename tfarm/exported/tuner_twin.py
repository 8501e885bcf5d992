"""The arithmetic of an exported tuner, operation by operation in the order of its C code.

    u = servo (+ r),   x = moment (- rigid moment),   K = network(u, u1, e1, e2, x, x1 (, K1)),   e = u - K x

    torque = r + servo - K x,   servo = Kp (angle reference - hub angle) + K1 (rate reference - hub rate)

with r the feedforward torque, counted in u under the reading "total", where no rigid moment is subtracted.  Numbers 1
and 2 are those of one and two samples before.  Where an input, or u, e, x, K or the torque, is NaN, infinite or beyond
`largest`, a step returns the kind of the error, holds the torque of the step before and keeps its state.  Below
`largest` no sum of the network overflows, so that a kept state refuses no later sample.

exp and log of its activation:

    e^x = 2^k e^r,   k = x/ln 2 to the nearest whole number,   r = (x - k h) - k l,   |r| <= ln(2)/2

with ln 2 = h + l, h of so few bits that k h is exact (Cody and Waite, Software Manual for the Elementary Functions,
1980), e^r by Taylor's polynomial, coefficients 1/n!, and 2^k as a product of powers of 1/2.

    ln(1 + y) = n ln 2 + 2 artanh s,   2 artanh s = f - s (f - R),   s = f/(2 + f),   R = 2 s^2/3 + 2 s^4/5 + ...

with n = 0, f = y, or from y = sqrt(2) - 1 on n = 1, f = (y - 1)/2 (the form of FDLIBM's e_log.c).  The coefficients
are those of the two series, rounded to the precision; what the series leave out is below a tenth of half a unit in the
last place.  The largest errors are `ULPS` of these units.

Every number has one precision: literals of Python would make doubles of single-precision operands.
"""

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from tfarm.arrays import Real, Whole
from tfarm.errors import require
from tfarm.exact.compiled import compiled
from tfarm.exported.twin import INPUT_ERROR, OVERFLOW
from tfarm.tuner.trial import SavedTuner

ULPS = {"exp": 1.5, "log": 2.0}  # bounds of the errors: of e^x, x from `lowest` to 0, and of ln(1 + y), y from 0 to 1
LN_2 = Fraction(math.log(2.0)) + Fraction(2319046813846299558, 10**35)  # 35 digits: math.log(2) and its remainder

ANGLE, RATE, MOMENT, WANTED_ANGLE, WANTED_RATE, WANTED_MOMENT, FORWARD = 0, 1, 2, 3, 4, 5, -1
U, E, X, K, E_BEFORE, TORQUE = range(6)  # places of the state: the last sample, and e of the one before


class Numbers(NamedTuple):
    """Numbers of a tuner in one precision.

    e^x is 0 up to `lowest`; adding and subtracting `shift` rounds to a whole number; `inverse` is 1/ln 2, ln 2 = `high`
    + `low`; series in ascending order.  Then network, servo and guard, as in `tfarm.tuner.kernel`.
    """

    zero: float
    half: float
    one: float
    two: float
    lowest: float
    shift: float
    inverse: float
    high: float
    low: float
    turn: float
    taylor: Real
    artanh: Real
    W1: Real
    w2: Real
    scales: Real
    K1: float
    Kp: float
    lo: float
    hi: float
    largest: float
    is_total: bool
    is_free: bool


def numbers_of(saved: SavedTuner, real: Any) -> Numbers:
    """The numbers of a tuner in np.float64 or np.float32, the guard rounded inwards.

    Raises ParameterError for a number beyond the range of the precision.
    """
    bits, lowest, terms, odd = (42, -708.0, 14, 10) if real is np.float64 else (16, -87.0, 9, 4)
    high = Fraction(round(LN_2 * 2**bits), 2**bits)
    shift = 1.5 * 2 ** np.finfo(real).nmant
    scalars = 0.0, 0.5, 1.0, 2.0, lowest, shift, 1 / math.log(2.0), high, LN_2 - high, math.sqrt(2.0) - 1
    series = [1 / math.factorial(n) for n in range(terms)], [2 / (2 * j + 1) for j in range(1, odd + 1)]
    limits, names = saved.gain().guard, ("W1", "w2", "scales", "K1", "Kp")
    with np.errstate(over="ignore", under="ignore"):
        W1, w2, scales, K1, Kp = rounded = [np.array(getattr(saved, name), dtype=real) for name in names]
        lo, hi = map(real, limits)
    lo = np.nextafter(lo, real(math.inf)) if float(lo) < limits.lo else lo
    hi = np.nextafter(hi, real(0.0)) if float(hi) > limits.hi else hi
    usable = [*(np.isfinite(each).all() for each in rounded), scales.all(), lo < hi]
    for name, is_usable in zip((*names, "scales", "guard"), usable, strict=True):
        require(is_usable, name, getattr(saved, name), "beyond the range or the digits of float: export it in double")
    share = float(scales.min()) / (2 * scales.size * max(1.0, float(abs(W1).max())))
    largest = real(min(1.0, share) * float(np.finfo(real).max))
    return Numbers._make([
        *(real(float(each)) for each in scalars), *(np.array(each, dtype=real) for each in series),
        W1, w2, scales, real(K1), real(Kp), lo, hi, largest, saved.signals == "total", saved.guard is None,
    ])  # fmt: skip


@compiled
def polynomial(x: float, coefficients: Real) -> float:
    """The sum of coefficients[n] x^n, by Horner's rule."""
    total = coefficients[coefficients.size - 1]
    for n in range(coefficients.size - 2, -1, -1):
        total = total * x + coefficients[n]
    return total


@compiled
def exponential(x: float, of: Numbers) -> float:
    """e^x for x <= 0; 0 of NaN, which u, e or x then is too: the step is refused."""
    if not x > of.lowest:
        return of.zero
    k = (x * of.inverse + of.shift) - of.shift
    result = polynomial((x - k * of.high) - k * of.low, of.taylor)
    power, n = of.half, int(-k)
    while n > 0:  # at most ten times
        if n % 2 == 1:
            result *= power
        power *= power
        n //= 2
    return result


@compiled
def logarithm(y: float, of: Numbers) -> float:
    """ln(1 + y) for 0 <= y <= 1."""
    is_small = y < of.turn
    f = y if is_small else of.half * (y - of.one)
    s = f / (of.two + f)
    square = s * s
    below = s * (f - square * polynomial(square, of.artanh))
    return f - below if is_small else of.high + (f - (below - of.low))


@compiled
def sigmoid(z: float, of: Numbers) -> float:
    """1/(1 + e^-z)."""
    small = exponential(-z if z > of.zero else z, of)
    return (of.one if z > of.zero else small) / (of.one + small)


@compiled
def softplus(z: float, of: Numbers) -> float:
    """ln(1 + e^z)."""
    is_positive = z > of.zero
    tail = logarithm(exponential(-z if is_positive else z, of), of)
    return z + tail if is_positive else tail


@compiled
def network_gain(of: Numbers, row: Real) -> float:
    """K of a row of inputs."""
    z = of.zero
    for j in range(of.w2.size):
        net = of.zero
        for i in range(of.scales.size):
            net += of.W1[j, i] * (row[i] / of.scales[i])
        z += of.w2[j] * sigmoid(net, of)
    if of.is_free:
        return softplus(z, of)
    gain = of.lo + (of.hi - of.lo) * sigmoid(z, of)  # not below lo; above hi by rounding
    return of.hi if gain > of.hi else gain


@compiled
def step(of: Numbers, state: Real, inputs: Real) -> int:
    """Advance by one sample; return 0, or the kind of an error."""
    for value in inputs:
        if not -of.largest <= value <= of.largest:
            return INPUT_ERROR
    x = inputs[MOMENT] if of.is_total else inputs[MOMENT] - inputs[WANTED_MOMENT]
    servo = of.Kp * (inputs[WANTED_ANGLE] - inputs[ANGLE]) + of.K1 * (inputs[WANTED_RATE] - inputs[RATE])
    u = servo + inputs[FORWARD] if of.is_total else servo
    row = np.array([u, state[U], state[E], state[E_BEFORE], x, state[X], state[K]])
    gain = network_gain(of, row)
    e, torque = u - gain * x, (inputs[FORWARD] + servo) - gain * x
    for value in (u, e, x, gain, torque):
        if not -of.largest <= value <= of.largest:
            return OVERFLOW
    state[U], state[E], state[X], state[K], state[E_BEFORE], state[TORQUE] = u, e, x, gain, state[E], torque
    return 0


@compiled
def run(of: Numbers, state: Real, inputs: Real, torque: Real, status: Whole) -> None:
    """Step over rows of inputs."""
    for k in range(status.size):
        status[k] = step(of, state, inputs[k])
        torque[k] = state[TORQUE]
