"""Frequency and damping of a decay: a sum of damped sinusoids through the samples, and how sure they are.

    y(t) = c + sum_m exp(-sigma_m t) (a_m cos(w_m t) + b_m sin(w_m t))

The start is by ESPRIT (Roy and Kailath 1989): the signal subspace of the Hankel matrix of the samples is the same one
sample later but for a matrix whose eigenvalues are exp(s T).  The end is by Gaussian least squares with the Jacobian of
the formula.  If the residuals e are white, the covariance is  s^2 (J' J)^-1.  If they are not (Ljung and Box 1978),
what is left is noise with a spectrum or something that the model lacks; the covariance is then

    (J' J)^-1 J' R J (J' J)^-1,   R the residuals' autocovariance, tapered (Newey and West 1987),

and the answer says so: of noise that rings with the decay the fit has taken part away, so that nominal 95 % hold some
85, and intervals of a wrong model are too narrow by any formula.

The amplitudes a, b and the constant c are linear: for each trial of the poles s = -sigma + i w they are those of the
least squares (Golub and Pereyra 1973), so that only the poles are searched for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.schema import Quantity

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
EACH = 4  # parameters of a mode: sigma, w, a, b; the constant c is the last


@dataclass(frozen=True, kw_only=True)
@record
class Ring:
    """Modes (n,) of a decay, that of most energy first, and how sure: intervals hold the truth in 95 of 100 records.

    `poles` [1/s] are -sigma + i w; `amplitude` (n,) is that at `start` [s], in the signal's unit.  `covariance` is that
    of sigma and w, mode by mode (n, 2, 2) [1/s^2].  `residual` is the root mean square of what is left, `white` the
    probability of residuals as correlated as these if they were white noise.  `early` and `late` are w (n,) [rad/s] by
    the two halves of the record alone.
    """

    signal: Annotated[str, Quantity("signal")]
    source: Annotated[str, Quantity("record", key="record")]
    clock: str
    start: Annotated[float, Quantity("from", "s", key="from_s")]
    stop: Annotated[float, Quantity("to", "s", key="to_s")]
    samples: Annotated[int, Quantity("samples")]
    poles: Complex
    amplitude: Real
    covariance: Real
    freedom: int
    residual: Annotated[float, Quantity("residual rms", digits=4, key="residual_rms")]
    white: Annotated[float, Quantity("probability of white residuals", digits=3, key="whiteness_probability")]
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
    def is_white(self) -> Annotated[bool, Quantity("residuals white", key="residuals_white")]:
        """Whether what is left looks like white noise."""
        return self.white >= NOT_WHITE

    @property
    def drifts(self) -> NDArray[np.bool_]:
        """Whether the two halves of the record differ in w (n,) by more than chance."""
        return np.asarray(abs(self.early - self.late) > HALVES_APART * self.halves_std + RING_ROUNDING * self.frequency)

    @property
    def notes(self) -> Annotated[tuple[str, ...], Quantity("notes")]:
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
    poles = starting_poles(t - t[0], y, modes)
    found = None if poles is None else nearest_sum(t - t[0], y, poles)
    if found is None:
        word = "oscillation" if modes == 1 else f"{modes} oscillations"
        raise ConvergenceError(f"no {word} found in the decay: choose other times, or fewer modes", None, None)
    order = np.argsort(-found.energy, kind="stable")
    residual = float(np.sqrt(found.e @ found.e / found.freedom))
    is_rounding = found.e @ found.e <= y.size * (RING_ROUNDING * abs(y).max()) ** 2
    white = 1.0 if is_rounding else whiteness(found.e)
    spread = found.covariance(is_white=white >= NOT_WHITE)
    early, late, std = _halves(t - t[0], y, found.poles)
    return Ring(
        signal=name,
        source=recording.source,
        clock=recording.said,
        start=float(t[0]),
        stop=float(t[-1]),
        samples=y.size,
        poles=found.poles[order],
        amplitude=found.amplitude[order],
        covariance=np.array([spread[np.ix_([n, n + modes], [n, n + modes])] for n in order]),
        freedom=found.freedom,
        residual=residual,
        white=white,
        early=early[order],
        late=late[order],
        halves_std=std[order],
    )


def _part(recording: Recording, name: str, start: float | None, stop: float | None, modes: int) -> tuple[Real, Real]:
    """Times and samples between two times, refused where they are too few for so many modes."""
    y, t = recording.signal(name, "--signal"), recording.times
    low, high = t[0] if start is None else start, t[-1] if stop is None else stop
    half = recording.period / 2
    kept = (t >= low - half * 1e-6) & (t <= high + half * 1e-6)
    if not 1 <= modes <= MOST_RINGING:
        raise ParameterError(key="--modes", value=modes, remedy=f"a whole number from 1 to {MOST_RINGING}")
    least = 4 * (EACH * modes + 1)
    if kept.sum() < least:
        span = f"the record goes from {t[0]:g} to {t[-1]:g} s"
        remedy = f"{kept.sum()} samples from {low:g} to {high:g} s; {modes} modes take {least} ({span})"
        raise ParameterError(key="--from", value=float(low), remedy=remedy, file=recording.source)
    if np.ptp(y[kept]) == 0:
        raise ParameterError(key="--signal", value=name, remedy="does not move there", file=recording.source)
    return t[kept], y[kept]


def _halves(t: Real, y: Real, poles: Complex) -> tuple[Real, Real, Real]:
    """w by each half of the record, from the whole's poles on, and the deviation of their difference.

    Where a half does not tell, w of the whole and an infinite deviation.
    """
    middle, count = t.size // 2, poles.size
    pairs = []
    for part in (slice(None, middle), slice(middle, None)):
        is_long = y[part].size > 2 * (EACH * count + 1)
        found = nearest_sum(t[part] - t[part][0], y[part], poles) if is_long else None
        if found is None:
            pairs.append((poles.imag, np.full(count, np.inf)))
            continue
        variance = np.diag(found.covariance(is_white=whiteness(found.e) >= NOT_WHITE))
        _, of_w, of_a, of_b = variance[:-1].reshape(EACH, count)
        is_clear = found.amplitude**2 > AMPLITUDE_TOLD**2 * (of_a + of_b) / 2
        pairs.append((found.poles.imag, np.where(is_clear, of_w, np.inf)))
    (early, one), (late, other) = pairs
    return np.asarray(early), np.asarray(late), np.sqrt(one + other)


def basis(poles: Complex, t: Real) -> Real:
    """The decaying cosines and sines of the poles (n,) at times (samples,), and 1: (samples, 2 n + 1)."""
    waves = np.exp(np.clip(np.outer(t, poles.real), -700, 700) + 1j * np.outer(t, poles.imag))
    return np.c_[waves.real, waves.imag, np.ones(t.size)]


def _linear(poles: Complex, t: Real, y: Real) -> tuple[Real, Real]:
    """Their amplitudes a, then b, and c by least squares, and what is left of y."""
    columns = basis(poles, t)
    linear = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], dtype=float)
    return linear, np.asarray(y - columns @ linear)


@dataclass(frozen=True)
@record
class DampedSum:
    """A sum with `poles` (n,), `linear` (2 n + 1,), a, b and c, at times t, and what it leaves of y: e (samples,)."""

    poles: Complex
    linear: Real
    t: Real
    e: Real

    @cached_property
    def jacobian(self) -> Real:
        """Derivatives of the formula (samples, 4 n + 1) by the sigma, then by the w, the a, the b, and c."""
        n, columns, by_time = self.poles.size, basis(self.poles, self.t), self.t[:, None]
        cosines, sines, (a, b) = columns[:, :n], columns[:, n:-1], self.linear[:-1].reshape(2, n)
        return np.c_[-by_time * (a * cosines + b * sines), by_time * (b * cosines - a * sines), columns]

    @property
    def amplitude(self) -> Real:
        """(n,): (a^2 + b^2)^(1/2)."""
        return np.asarray(np.hypot(*self.linear[:-1].reshape(2, -1)))

    @property
    def energy(self) -> Real:
        """(n,): the sum of squares of each mode alone."""
        n, parts = self.poles.size, (basis(self.poles, self.t) * self.linear)[:, :-1]
        return np.asarray(((parts[:, :n] + parts[:, n:]) ** 2).sum(axis=0))

    @property
    def freedom(self) -> int:
        """Samples less parameters."""
        return self.e.size - EACH * self.poles.size - 1

    def covariance(self, *, is_white: bool) -> Real:
        """Of the parameters (4 n + 1, 4 n + 1); the Jacobian's columns are scaled for the inverse's sake."""
        scale = np.sqrt((self.jacobian**2).sum(axis=0))
        J, e = self.jacobian / scale, self.e
        bread = np.linalg.pinv(J.T @ J)
        meat = J.T @ J * (e @ e) / self.freedom if is_white else _meat(J, e) * e.size / self.freedom
        return np.asarray(bread @ meat @ bread / np.outer(scale, scale))


def nearest_sum(t: Real, y: Real, start: Complex) -> DampedSum | None:
    """The sum with the least squares next to the poles of a start; None where that is no oscillation in the record."""
    from scipy.optimize import least_squares

    def left(x: Real) -> Real:
        return _linear(x[: start.size] + 1j * x[start.size :], t, y)[1]

    found = least_squares(left, np.r_[start.real, start.imag], method="lm", x_scale="jac", xtol=1e-12)
    poles, period = found.x[: start.size] + 1j * found.x[start.size :], t[1] - t[0]
    is_inside = (poles.imag > 0) & (poles.imag < np.pi / period) & (abs(poles.real) < 2 / period)
    if not (found.success and is_inside.all()):
        return None
    linear, e = _linear(poles, t, y)
    return DampedSum(poles, linear, t, e)


def starting_poles(t: Real, y: Real, modes: int) -> Complex | None:
    """Poles to start from: of ESPRIT's at several rates of sampling those that leave least, one by one.

    None if there are not so many poles that turn half a turn in the record, and neither die in a sample nor explode.
    """
    period, duration, thin, found = t[1] - t[0], t[-1] - t[0], 1, []
    while thin == 1 or t.size // thin >= MOST_ROWS:
        means = (y - y.mean())[: t.size // thin * thin].reshape(-1, thin).mean(axis=1)
        found.append(_poles(means, 2 * modes + SPARE_POLES) / (thin * period))
        thin *= THINNER
    s = np.concatenate(found)
    s = s[(s.imag > math.pi / duration) & (s.real * period > -1) & (s.real * duration < FASTEST)]
    chosen = s[:0]
    for _ in range(modes):
        tried = [np.r_[chosen, each] for each in s if each not in chosen]
        if not tried:
            return None
        chosen = min(tried, key=lambda poles: float((_linear(poles, t, y)[1] ** 2).sum()))
    return chosen


def _poles(y: Real, count: int) -> Complex:
    """ln of the eigenvalues by which the signal subspace of so many dimensions moves in one sample."""
    rows = min(y.size // 2, MOST_ROWS)
    hankel = np.lib.stride_tricks.sliding_window_view(y, rows)
    _, V = np.linalg.eigh(hankel.T @ hankel)
    V = V[:, -min(count, rows - 1) :]
    turn, *_ = np.linalg.lstsq(V[:-1], V[1:], rcond=None)
    z = np.linalg.eigvals(turn)
    return np.asarray(np.log(z[z != 0]))


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
    from scipy.signal import correlate

    return np.asarray(correlate(e, e)[e.size - 1 :] / e.size)
