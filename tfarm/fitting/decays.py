"""A sum of damped sinusoids: its formula with derivatives, where a fit of it begins, and what its residuals leave.

Parameters are sigma, w, a and b of each mode, and the constant c last (see `ringdown`).
"""

from __future__ import annotations

import math

import numpy as np

from tfarm.arrays import Complex, Real

MOST_ROWS = 160  # of the Hankel matrix of the start; slower oscillations are looked for in means of so many samples
FASTEST = 3.0  # the logarithm by which a pole of the start may grow during the record
THINNER = 4  # from one such mean to the next
SPARE_POLES = 4  # further poles of the start, which take up drift and noise
CLEAR_LAG = 2.5  # deviations of an autocorrelation of white noise, 1/sqrt(n), above which one stands out
LINEAR = 1  # the constant c, the last of the parameters
EACH = 4  # parameters of a mode: sigma, w, a, b


def least_squares(t: Real, y: Real, start: Real | None) -> tuple[Real, Real, Real] | None:
    """The parameters with the least sum of squares from a start on, their Jacobian (samples, parameters), residuals.

    None where that is no oscillation in the record.
    """
    from scipy.optimize import least_squares as minimised

    if start is None:
        return None

    def residuals(x: Real) -> Real:
        return np.asarray(model(x, t)[0] - y)

    def slopes(x: Real) -> Real:
        return model(x, t)[1]

    found = minimised(residuals, start, jac=slopes, method="lm", x_scale="jac", xtol=1e-12)
    w, sigma = found.x[1:-LINEAR:EACH], found.x[:-LINEAR:EACH]
    period = t[1] - t[0]
    inside = (w > 0) & (w < np.pi / period) & (abs(sigma) < 2 / period)
    if not (found.success and inside.all()):
        return None
    values, J = model(found.x, t)
    return found.x, J, y - values


def model(x: Real, t: Real) -> tuple[Real, Real]:
    """The formula at times t (n,), and its derivatives by (sigma, w, a, b) of each mode and c: (n, 4 modes + 1)."""
    values, J = np.full(t.size, x[-1]), np.empty((t.size, x.size))
    J[:, -1] = 1.0
    for at in range(0, x.size - LINEAR, EACH):
        sigma, w, a, b = x[at : at + EACH]
        decay = np.exp(np.clip(-sigma * t, -700, 700))
        C, S = decay * np.cos(w * t), decay * np.sin(w * t)
        part = a * C + b * S
        values += part
        J[:, at], J[:, at + 1], J[:, at + 2], J[:, at + 3] = -t * part, t * (b * C - a * S), C, S
    return values, J


def start_of(t: Real, y: Real, modes: int) -> Real | None:
    """Parameters to start from: of ESPRIT's poles at several rates of sampling those that leave least, one by one.

    None if there are not so many poles that turn half a turn in the record, and neither die in a sample nor explode.
    """
    period, duration, thin, found = t[1] - t[0], t[-1] - t[0], 1, []
    while thin == 1 or t.size // thin >= MOST_ROWS:
        means = (y - y.mean())[: t.size // thin * thin].reshape(-1, thin).mean(axis=1)
        found.append(_poles(means, 2 * modes + SPARE_POLES) / (thin * period))
        thin *= THINNER
    s = np.concatenate(found)
    s = s[(s.imag > math.pi / duration) & (s.real * period > -1) & (s.real * duration < FASTEST)]
    chosen, x = s[:0], None
    for _ in range(modes):
        tried = [_linear(np.r_[chosen, each], t, y) for each in s if each not in chosen]
        if not tried:
            return None
        _, x = min(tried, key=lambda pair: pair[0])
        chosen = -x[:-LINEAR:EACH] + 1j * x[1:-LINEAR:EACH]
    return x


def _linear(s: Complex, t: Real, y: Real) -> tuple[float, Real]:
    """What those with these poles leave of y, squared, and their parameters: the linear ones by least squares."""
    x = np.zeros(EACH * s.size + LINEAR)
    x[:-LINEAR:EACH], x[1:-LINEAR:EACH] = -s.real, s.imag
    linear = np.r_[[EACH * m + k for m in range(s.size) for k in (2, 3)], x.size - 1]
    basis = model(x, t)[1][:, linear]
    x[linear], *_ = np.linalg.lstsq(basis, y, rcond=None)
    return float(((basis @ x[linear] - y) ** 2).sum()), x


def _poles(y: Real, count: int) -> Complex:
    """ln of the eigenvalues by which the signal subspace of so many dimensions moves in one sample."""
    rows = min(y.size // 2, MOST_ROWS)
    hankel = np.lib.stride_tricks.sliding_window_view(y, rows)
    _, V = np.linalg.eigh(hankel.T @ hankel)
    V = V[:, -min(count, rows - 1) :]
    turn, *_ = np.linalg.lstsq(V[:-1], V[1:], rcond=None)
    z = np.linalg.eigvals(turn)
    return np.asarray(np.log(z[z != 0]))


def mode_energy(x: Real, duration: float) -> Real:
    """Of each mode: amplitude squared times the integral of exp(-2 sigma t)."""
    sigma, a, b = (x[place:-LINEAR:EACH] for place in (0, 2, 3))
    decay = np.where(abs(sigma) * duration < 1e-9, 1e-9 / duration, sigma)
    return np.asarray((a**2 + b**2) * -np.expm1(np.clip(-2 * decay * duration, -700, 700)) / (2 * decay))


def covariance(J: Real, e: Real, freedom: int, *, is_white: bool) -> Real:
    """Of the parameters (parameters, parameters); the columns of J are scaled for the inverse's sake."""
    scale = np.sqrt((J**2).sum(axis=0))
    scaled = J / scale
    bread = np.linalg.pinv(scaled.T @ scaled)
    meat = scaled.T @ scaled * (e @ e) / freedom if is_white else _meat(scaled, e) * e.size / freedom
    return np.asarray(bread @ meat @ bread / np.outer(scale, scale))


def _meat(J: Real, e: Real) -> Real:
    """J' R J with the residuals' autocovariances r_k, tapered (1 - k/M), M twice the last lag that stands out."""
    r, most = _autocovariance(e), max(2, e.size // 3)
    (clear,) = np.nonzero(abs(r[:most]) > CLEAR_LAG * r[0] / math.sqrt(e.size))
    lags = min(most, 2 * int(clear.max(initial=0)) + 1)
    found = J.T @ J * r[0]
    for k in range(1, lags):
        across = J[k:].T @ J[:-k] * r[k] * (1 - k / lags)
        found += across + across.T
    return np.asarray(found)


def whiteness(e: Real) -> float:
    """The probability of autocorrelations as large as these in white noise (Ljung and Box 1978), of the first lags."""
    from scipy.special import chdtrc

    r, n = _autocovariance(e), e.size
    if r[0] == 0:
        return 1.0
    lags = np.arange(1, min(20, n // 5) + 1)
    Q = n * (n + 2) * ((r[lags] / r[0]) ** 2 / (n - lags)).sum()
    return float(chdtrc(lags.size, Q))


def _autocovariance(e: Real) -> Real:
    size = 2 ** math.ceil(math.log2(2 * e.size))
    power = abs(np.fft.rfft(e, size)) ** 2
    return np.asarray(np.fft.irfft(power, size)[: e.size] / e.size)


def counted_from(x: Real, by: float) -> Real:
    """The parameters of the same decay with t counted from `by` [s] on."""
    found = x.copy()
    for at in range(0, x.size - LINEAR, EACH):
        sigma, w, a, b = x[at : at + EACH]
        turned = (a - 1j * b) * np.exp((-sigma + 1j * w) * by)
        found[at + 2], found[at + 3] = turned.real, -turned.imag
    return found
