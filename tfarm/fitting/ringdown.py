"""Frequency and damping of a decay: a sum of damped sinusoids through the samples, and how sure they are.

    y(t) = c + sum_m exp(-sigma_m t) (a_m cos(w_m t) + b_m sin(w_m t))

The start is by ESPRIT (Roy and Kailath 1989): the signal subspace of the Hankel matrix of the samples is the same one
sample later but for a matrix whose eigenvalues are exp(s T).  The end is by Gaussian least squares with the Jacobian of
the formula.  If the residuals e are white, the covariance is  s^2 (J' J)^-1.  If they are not (Ljung and Box 1978),
what is left is noise with a spectrum or something that the model lacks; the covariance is then

    (J' J)^-1 J' R J (J' J)^-1,   R the residuals' autocovariance, tapered (Newey and West 1987),

and the answer says so: of noise that rings with the decay the fit has taken part away, so that nominal 95 % hold some
85, and intervals of a wrong model are too narrow by any formula.

A sum of damped sinusoids: its formula with derivatives, where a fit of it begins, and what its residuals leave.

Parameters are sigma, w, a and b of each mode, and the constant c last (see `ringdown`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record

from .data import CONFIDENCE
from .recording import Recording

MOST_RINGING = 20  # of one decay
NOT_WHITE = 1e-3  # probability below which residuals are called correlated
RARE = 1e-9  # a probability below which its size says nothing more
RING_ROUNDING = 1e-9  # of the signal and of w: what is less is rounding, of which nothing is said
HALVES_APART = 4.0  # standard deviations that the two halves of a record differ by before it is said
AMPLITUDE_TOLD = 8.0  # deviations of its amplitude in a half of a record that tells of an oscillation: noise has 4
MOST_ROWS = 160  # of the Hankel matrix of the start; slower oscillations are looked for in means of so many samples
FASTEST = 3.0  # the logarithm by which a pole of the start may grow during the record
THINNER = 4  # from one such mean to the next
SPARE_POLES = 4  # further poles of the start, which take up drift and noise
CLEAR_LAG = 2.5  # deviations of an autocorrelation of white noise, 1/sqrt(n), above which one stands out
LINEAR = 1  # the constant c, the last of the parameters
EACH = 4  # parameters of a mode: sigma, w, a, b


@dataclass(frozen=True, kw_only=True)
@record
class Ring:
    """Modes (n,) of a decay, that of most energy first, and how sure: intervals hold the truth in 95 of 100 records.

    `poles` [1/s] are -sigma + i w; `amplitude` (n,) is that at `start` [s], in the signal's unit.  `covariance` is that
    of sigma and w, mode by mode (n, 2, 2) [1/s^2].  `residual` is the root mean square of what is left, `white` the
    probability of residuals as correlated as these if they were white noise.  `early` and `late` are w (n,) [rad/s] by
    the two halves of the record alone.
    """

    signal: str
    source: str
    clock: str
    start: float
    stop: float
    samples: int
    poles: Complex
    amplitude: Real
    covariance: Real
    freedom: int
    residual: float
    white: float
    early: Real
    late: Real
    halves_std: Real

    @property
    def frequency(self) -> Real:
        """The frequencies w (n,) [rad/s] at which it rings."""
        return np.asarray(self.poles.imag)

    @property
    def natural_frequency(self) -> Real:
        """|s| (n,) [rad/s], that without damping."""
        return np.asarray(abs(self.poles), dtype=float)

    @property
    def damping_ratio(self) -> Real:
        """sigma/|s| (n,)."""
        return np.asarray(-self.poles.real / abs(self.poles))

    @property
    def frequency_std(self) -> Real:
        """Standard deviations (n,) [rad/s]."""
        return np.sqrt(self.covariance[:, 1, 1])

    @cached_property
    def damping_ratio_std(self) -> Real:
        """Standard deviations (n,), by d zeta = (w^2 d sigma - sigma w d w)/|s|^3."""
        sigma, w = -self.poles.real, self.poles.imag
        slope = np.c_[w**2, -sigma * w] / abs(self.poles)[:, None] ** 3
        return np.sqrt(np.einsum("mi,mij,mj->m", slope, self.covariance, slope))

    @cached_property
    def reach(self) -> float:
        """How many standard deviations an interval reaches to each side (Student's t)."""
        from scipy.special import stdtrit

        return float(stdtrit(self.freedom, 0.5 + CONFIDENCE / 2))

    @property
    def is_white(self) -> bool:
        """Whether what is left looks like white noise."""
        return self.white >= NOT_WHITE

    @property
    def drifts(self) -> NDArray[np.bool_]:
        """Whether the two halves of the record differ in w (n,) by more than chance."""
        return np.asarray(abs(self.early - self.late) > HALVES_APART * self.halves_std + RING_ROUNDING * self.frequency)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said beside the intervals."""
        found = [self.clock] if self.clock else []
        if not self.is_white:
            chance = f"{self.white:.1g}" if self.white > RARE else f"below {RARE:g}"
            found.append(
                f"the residuals are correlated (probability {chance} if they were white noise): intervals are "
                "by their autocovariance, and may be too narrow, above all if what is left is no noise"
            )
        for mode in np.flatnonzero(self.drifts):
            pair = f"{self.early[mode] / (2 * np.pi):.4g} Hz in its first half, {self.late[mode] / (2 * np.pi):.4g} Hz"
            found.append(
                f"mode {mode + 1} rings at {pair} in its second: no linear decay, or friction, or another mode"
            )
        return tuple(found)


def ring(
    recording: Recording, name: str, *, start: float | None = None, stop: float | None = None, modes: int = 1
) -> Ring:
    """Frequency and damping of the decay of one signal between two times [s] of the record.

    Raises ParameterError for a signal or times that are not there and for too few samples, ConvergenceError where so
    many oscillations are not found.
    """
    t, y = _part(recording, name, start, stop, modes)
    found = least_squares(t - t[0], y, start_of(t - t[0], y, modes))
    if found is None:
        word = "oscillation" if modes == 1 else f"{modes} oscillations"
        raise ConvergenceError(f"no {word} found in the decay: choose other times, or fewer modes", None, None)
    x, J, e = found
    cosine, sine = J[:, 2:-LINEAR:EACH], J[:, 3:-LINEAR:EACH]
    energy = ((cosine * x[2:-LINEAR:EACH] + sine * x[3:-LINEAR:EACH]) ** 2).sum(axis=0)
    order = np.argsort(-energy, kind="stable")
    freedom = y.size - x.size
    white = whiteness(e) if e @ e > y.size * (RING_ROUNDING * abs(y).max()) ** 2 else 1.0
    spread = covariance(J, e, freedom, is_white=white >= NOT_WHITE)
    places = EACH * order
    early, late, std = _halves(t - t[0], y, x, order)
    return Ring(
        signal=name,
        source=recording.source,
        clock=recording.said,
        start=float(t[0]),
        stop=float(t[-1]),
        samples=y.size,
        poles=-x[places] + 1j * x[places + 1],
        amplitude=np.hypot(x[places + 2], x[places + 3]),
        covariance=np.array([spread[p : p + 2, p : p + 2] for p in places]),
        freedom=freedom,
        residual=float(np.sqrt(e @ e / freedom)),
        white=white,
        early=early,
        late=late,
        halves_std=std,
    )


def _part(recording: Recording, name: str, start: float | None, stop: float | None, modes: int) -> tuple[Real, Real]:
    """Times and samples between two times, refused where they are too few for so many modes."""
    y, t = recording.signal(name, "--signal"), recording.times
    low, high = t[0] if start is None else start, t[-1] if stop is None else stop
    half = recording.period / 2
    kept = (t >= low - half * 1e-6) & (t <= high + half * 1e-6)
    if not 1 <= modes <= MOST_RINGING:
        raise ParameterError(key="--modes", value=modes, remedy=f"a whole number from 1 to {MOST_RINGING}")
    least = 4 * (EACH * modes + LINEAR)
    if kept.sum() < least:
        span = f"the record goes from {t[0]:g} to {t[-1]:g} s"
        remedy = f"{kept.sum()} samples from {low:g} to {high:g} s; {modes} modes take {least} ({span})"
        raise ParameterError(key="--from", value=float(low), remedy=remedy, file=recording.source)
    if np.ptp(y[kept]) == 0:
        raise ParameterError(key="--signal", value=name, remedy="does not move there", file=recording.source)
    return t[kept], y[kept]


def _halves(t: Real, y: Real, x: Real, order: NDArray[np.intp]) -> tuple[Real, Real, Real]:
    """w by each half of the record, from the whole's parameters on, and the deviation of their difference.

    Where a half does not tell, w of the whole and an infinite deviation.
    """
    middle = t.size // 2
    pairs = []
    for part in (slice(None, middle), slice(middle, None)):
        own_t = t[part] - t[part][0]
        s = -x[:-LINEAR:EACH] + 1j * x[1:-LINEAR:EACH]
        found = least_squares(own_t, y[part], _linear(s, own_t, y[part])[1]) if y[part].size > 2 * x.size else None
        if found is None:
            pairs.append((x[1:-LINEAR:EACH], np.full(order.size, np.inf)))
            continue
        own, J, e = found
        C = covariance(J, e, e.size - x.size, is_white=whiteness(e) >= NOT_WHITE)
        w, variance = own[1:-LINEAR:EACH], np.diag(C)[1:-LINEAR:EACH]
        a, b, of_a, of_b = (each[k:-LINEAR:EACH] for each in (own, np.diag(C)) for k in (2, 3))
        pairs.append((w, np.where(a**2 + b**2 > AMPLITUDE_TOLD**2 * (of_a + of_b) / 2, variance, np.inf)))
    (early, one), (late, other) = pairs
    return early[order], late[order], np.sqrt(one + other)[order]


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
