"""Modes of a decay: a sum of damped sinusoids fitted to the samples of one signal.

    y(t) = c + sum_m exp(-sigma_m t) (a_m cos(w_m t) + b_m sin(w_m t)).

The start is by ESPRIT (Roy and Kailath 1989): the signal subspace of the Hankel matrix of the samples is the same one
sample later but for a matrix whose eigenvalues are exp(s T).  The end is by Gaussian least squares with the Jacobian of
the formula.  If the residuals e are white, the covariance is  s^2 (J' J)^-1.  If they are not (Ljung and Box 1978),
they are noise with a spectrum or something that the model lacks; the covariance is then

    (J' J)^-1 J' R J (J' J)^-1,   R the residuals' autocovariance, tapered (Newey and West 1987),

and a note is made: of noise that rings with the decay the fit has taken part away, so that nominal 95 % hold some 85,
and intervals of a wrong model are too narrow by any formula.

For each trial of the poles the other numbers are those of the linear least squares (`resonances`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
from scipy.special import stdtrit

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, require
from tfarm.fitting.data import CONFIDENCE
from tfarm.fitting.resonances import least_projected, project
from tfarm.fitting.whiteness import autocovariance, chance_of_lags
from tfarm.records import frozen
from tfarm.response.frequency import HERTZ
from tfarm.schema import Quantity

if TYPE_CHECKING:
    from tfarm.fitting.recording import Recording

# probability below which residuals are called correlated
NOT_WHITE = 1e-3


def count_parameters(modes: int) -> int:
    """Return the number of parameters of that many modes: the sigma, w, a and b of each, and the constant c."""
    return 4 * modes + 1


class DecayMode(NamedTuple):
    """A mode of a decay with its 95 % intervals."""

    mode: Annotated[int, Quantity("mode", help="number in the order of energy, from 1")]
    frequency: Annotated[float, Quantity("frequency", "Hz", 7, "frequency of the oscillation, Im s")]
    frequency_low: Annotated[float, Quantity("from", "Hz", 7, "lower end of its 95 % interval")]
    frequency_high: Annotated[float, Quantity("to", "Hz", 7, "upper end of its 95 % interval")]
    frequency_std: Annotated[float, Quantity(unit="Hz", help="standard deviation of the frequency")]
    natural_frequency: Annotated[
        float, Quantity(unit="Hz", help="abs(s), above the frequency by the damping")
    ]
    damping_ratio: Annotated[float, Quantity("damping ratio", digits=4, help="-Re s/abs(s)")]
    damping_ratio_low: Annotated[float, Quantity("from", digits=4, help="lower end of its 95 % interval")]
    damping_ratio_high: Annotated[float, Quantity("to", digits=4, help="upper end of its 95 % interval")]
    damping_ratio_std: Annotated[float, Quantity(help="standard deviation of the damping ratio")]
    amplitude: Annotated[
        float,
        Quantity("amplitude at the start", digits=4, help="in the unit of the signal, at the first sample"),
    ]
    option: Annotated[
        str,
        Quantity(
            "for tfarm fit --mode N=",
            key="mode_option",
            help="value that passes the mode on to a fit of the arm",
        ),
    ]
    first_half: Annotated[
        float | None,
        Quantity(key="frequency_first_half_hz", help="frequency by the first half of the record alone"),
    ]
    second_half: Annotated[
        float | None,
        Quantity(key="frequency_second_half_hz", help="frequency by the second half of the record alone"),
    ]


@frozen(kw_only=True)
class RingdownFit:
    """Modes of a decay, that of most energy first; intervals hold the true value in 95 of 100 records.

    `residual` is the root mean square of the residuals, `white` the probability of residuals as correlated as these if
    they were white noise; `notes` are limits of the intervals.
    """

    signal: Annotated[str, Quantity("signal", help="column of the record")]
    source: Annotated[str, Quantity("record", key="record", help="file of the record")]
    start: Annotated[float, Quantity("from", "s", key="from_s", help="first sample that is used")]
    stop: Annotated[float, Quantity("to", "s", key="to_s", help="last sample that is used")]
    samples: Annotated[int, Quantity("samples", help="number of samples that are used")]
    residual: Annotated[
        float,
        Quantity(
            "residual rms",
            digits=4,
            key="residual_rms",
            help="root mean square of the residuals, in the unit of the signal",
        ),
    ]
    white: Annotated[
        float,
        Quantity(
            "probability of white residuals",
            digits=3,
            key="whiteness_probability",
            help="of correlations as large as these in white noise (Ljung and Box 1978)",
        ),
    ]
    notes: Annotated[tuple[str, ...], Quantity("notes", help="limits of the intervals")]
    modes: Annotated[
        tuple[DecayMode, ...], Quantity("modes", help="damped oscillations, that of most energy first")
    ]
    level: Annotated[
        float, Quantity("probability of the intervals", help="share of intervals that hold the true value")
    ] = CONFIDENCE

    @property
    def is_white(
        self,
    ) -> Annotated[
        bool,
        Quantity(
            "residuals white", key="residuals_white", help="whether the residuals look like white noise"
        ),
    ]:
        """Whether the residuals look like white noise."""
        return self.white >= NOT_WHITE


def fit_ringdown(
    recording: Recording, name: str, *, start: float | None = None, stop: float | None = None, modes: int = 1
) -> RingdownFit:
    """Return frequency and damping of the decay of one signal between two times [s] of the record.

    Raises ParameterError for a signal or times that are not there and for too few samples, ConvergenceError where the
    oscillations are not found.
    """
    times, y = _samples(recording, name, start, stop, modes)
    t = times - times[0]
    poles = starting_poles(t, y, modes)
    found = nearest_sum(t, y, poles) if poles.size == modes else None
    if found is None:
        word = "oscillation" if modes == 1 else f"{modes} oscillations"
        raise ConvergenceError(
            f"no {word} found in the decay: choose other times, or fewer modes", None, None
        )
    squares = float(found.e @ found.e)
    # of the signal and of w: smaller differences are rounding
    rounding = 1e-9
    white = 1.0 if squares <= y.size * (rounding * abs(y).max()) ** 2 else chance_of_lags(found.e)
    notes = [recording.note] if recording.note else []
    if white < NOT_WHITE:
        chance = f"{white:.1g}" if white > 1e-9 else "below 1e-09"
        notes.append(
            f"the residuals are correlated (probability {chance} if they were white noise): intervals are "
            "by their autocovariance, and may be too narrow, above all if the residuals are no noise"
        )
    spread = found.covariance(is_white=white >= NOT_WHITE)
    middle = t.size // 2
    w1, variance1 = by_part(t[:middle], y[:middle], found.poles)
    w2, variance2 = by_part(t[middle:], y[middle:], found.poles)
    apart = np.sqrt(variance1 + variance2)
    # by more than four standard deviations
    is_drifting = abs(w1 - w2) > 4.0 * apart + rounding * found.poles.imag
    rows = []
    for number, n in enumerate(np.argsort(-found.energy, kind="stable").tolist(), start=1):
        first = float(w1[n]) / HERTZ
        second = float(w2[n]) / HERTZ
        halves = (first, second) if np.isfinite(apart[n]) else (None, None)
        rows.append(found.mode(n, number, spread, halves))
        if is_drifting[n]:
            notes.append(
                f"mode {number} rings at {first:.4g} Hz in its first half, {second:.4g} Hz in its "
                "second: no linear decay, or friction, or another mode"
            )
    return RingdownFit(
        signal=name,
        source=recording.source,
        start=float(times[0]),
        stop=float(times[-1]),
        samples=y.size,
        residual=math.sqrt(squares / found.freedom),
        white=white,
        notes=tuple(notes),
        modes=tuple(rows),
    )


def _samples(
    recording: Recording, name: str, start: float | None, stop: float | None, modes: int
) -> tuple[Real, Real]:
    """Return times [s] and samples of a signal between two times, enough for that many modes."""
    y = recording.signal(name, "--signal")
    times = recording.times
    low = float(times[0] if start is None else start)
    high = times[-1] if stop is None else stop
    # within half a millionth of a sample: rounding of times
    kept = abs(2 * times - low - high) <= high - low + 1e-6 * recording.period
    require(1 <= modes <= 20, "--modes", modes, "a whole number from 1 to 20")
    least = 4 * count_parameters(modes)
    taken = f"{kept.sum()} samples from {low:g} to {high:g} s; {modes} modes take {least}"
    remedy = f"{taken} (the record goes from {times[0]:g} to {times[-1]:g} s)"
    require(kept.sum() >= least, "--from", low, remedy, recording.source)
    require(np.ptp(y[kept]) > 0, "--signal", name, "does not move there", recording.source)
    return times[kept], y[kept]


def by_part(t: Real, y: Real, poles: Complex) -> tuple[Real, Real]:
    """Return w by a part of the record, from the whole's poles on, and its variance.

    Where the part does not determine it, w of the whole and an infinite variance.
    """
    w = np.asarray(poles.imag, float)
    variance = np.full(w.size, np.inf)
    found = nearest_sum(t - t[0], y, poles) if y.size > 2 * count_parameters(w.size) else None
    if found is not None:
        spread = found.covariance(is_white=chance_of_lags(found.e) >= NOT_WHITE)
        _, of_w, of_a, of_b = np.diag(spread)[:-1].reshape(4, w.size)
        # deviations of the amplitude of an oscillation that is determined: noise has 4
        variance = np.where(found.amplitude**2 > 8.0**2 * (of_a + of_b) / 2, of_w, np.inf)
        w = np.asarray(found.poles.imag, float)
    return w, variance


def basis(poles: Complex, t: Real) -> Real:
    """Return the decaying cosines and sines of the poles (n,) at times (samples,), and 1: (samples, 2 n + 1)."""
    waves = np.exp(np.clip(np.outer(t, poles.real), -700, 700) + 1j * np.outer(t, poles.imag))
    return np.c_[waves.real, waves.imag, np.ones(t.size)]


@frozen
class DampedSum:
    """A sum with `poles` (n,), `linear` (2 n + 1,), a, b and c, at times t, and its residuals e (samples,)."""

    poles: Complex
    linear: Real
    t: Real
    e: Real

    @cached_property
    def jacobian(self) -> Real:
        """Derivatives of the formula (samples, 4 n + 1) by the sigma, then by the w, the a, the b, and c."""
        n = self.poles.size
        columns = basis(self.poles, self.t)
        by_time = self.t[:, None]
        cosines, sines = np.hsplit(columns[:, :-1], 2)
        a, b = self.linear[:-1].reshape(2, n)
        return np.c_[-by_time * (a * cosines + b * sines), by_time * (b * cosines - a * sines), columns]

    @property
    def amplitude(self) -> Real:
        """(n,): (a^2 + b^2)^(1/2)."""
        return np.hypot(*self.linear[:-1].reshape(2, -1))

    @property
    def energy(self) -> Real:
        """(n,): the sum of squares of each mode alone."""
        cosines, sines = np.hsplit((basis(self.poles, self.t) * self.linear)[:, :-1], 2)
        return ((cosines + sines) ** 2).sum(axis=0)

    @property
    def freedom(self) -> int:
        """Samples less parameters."""
        return self.e.size - count_parameters(self.poles.size)

    def covariance(self, *, is_white: bool) -> Real:
        """Return that of the parameters (4 n + 1, 4 n + 1); columns are scaled for the inverse's sake."""
        scale = np.sqrt((self.jacobian**2).sum(axis=0))
        J = self.jacobian / scale
        e = self.e
        bread = np.linalg.pinv(J.T @ J)
        meat = J.T @ J * (e @ e) / self.freedom if is_white else _meat(J, e) * e.size / self.freedom
        return bread @ meat @ bread / np.outer(scale, scale)

    def mode(self, n: int, number: int, covariance: Real, halves: Sequence[float | None]) -> DecayMode:
        """Return mode n by its number, with intervals (Student's t); d zeta = (w^2 d sigma - sigma w d w)/|s|^3."""
        s = complex(self.poles[n])
        size = abs(s)
        places = [n, n + self.poles.size]
        slope = np.array([s.imag**2, s.real * s.imag]) / size**3
        own = covariance[np.ix_(places, places)]
        reach = float(stdtrit(self.freedom, 0.5 + CONFIDENCE / 2))
        f = s.imag / HERTZ
        df = math.sqrt(own[1, 1]) / HERTZ
        z = -s.real / size
        dz = math.sqrt(slope @ own @ slope)
        # `tfarm fit --mode` takes positive ones alone
        damping = f",{z:.6g}~{dz:.3g}" if 0 < z < 1 and dz > 0 else ""
        option = f"{f:.8g}hz~{df:.3g}{damping}"
        frequency = (f, f - reach * df, f + reach * df, df, size / HERTZ)
        ratio = (z, z - reach * dz, z + reach * dz, dz)
        return DecayMode(number, *frequency, *ratio, float(self.amplitude[n]), option, *halves)


def nearest_sum(t: Real, y: Real, start: Complex) -> DampedSum | None:
    """Return the sum with the least squares next to the poles of a start.

    None where that is no oscillation in the record.
    """
    period = t[1] - t[0]

    def poles_at(x: Real) -> Complex:
        real, imaginary = x.reshape(2, -1)
        return real + 1j * imaginary

    first = np.r_[start.real, start.imag]
    found = least_projected(lambda x: basis(poles_at(x), t), y, first, xtol=1e-12)
    poles = poles_at(found.x)
    is_inside = (poles.imag > 0) & (poles.imag < np.pi / period) & (abs(poles.real) < 2 / period)
    if not (found.success and is_inside.all()):
        return None
    linear, e = project(basis(poles, t), y)
    return DampedSum(poles, linear, t, e)


def starting_poles(t: Real, y: Real, modes: int) -> Complex:
    """Return poles to start from: of ESPRIT's at several rates of sampling those with the least residuals, one by one.

    Of a rate they are ln of the eigenvalues by which the signal subspace of the Hankel matrix moves in one sample.
    There are fewer where not enough poles turn half a turn in the record, and neither die in a sample nor explode.
    """
    # of the Hankel matrix of the start; slower oscillations are looked for in means of several samples
    most_rows = 160
    period = t[1] - t[0]
    duration = t[-1] - t[0]
    thin = 1
    found = []
    while thin == 1 or t.size // thin >= most_rows:
        means = (y - y.mean())[: t.size // thin * thin].reshape(-1, thin).mean(axis=1)
        rows = min(means.size // 2, most_rows)
        hankel = np.lib.stride_tricks.sliding_window_view(means, rows)
        # four further poles take up drift and noise
        V = np.linalg.eigh(hankel.T @ hankel)[1][:, -min(2 * modes + 4, rows - 1) :]
        z = np.linalg.eigvals(np.linalg.lstsq(V[:-1], V[1:], rcond=None)[0])
        found.append(np.log(z[z != 0]) / (thin * period))
        thin *= 4
    s = np.concatenate(found)
    # a pole of the start may grow by e^3 during the record
    s = np.unique(s[(s.imag > math.pi / duration) & (s.real * period > -1) & (s.real * duration < 3.0)])
    chosen = s[:0]
    while chosen.size < min(modes, s.size):
        tried = [np.r_[chosen, each] for each in s if each not in chosen]
        chosen = min(tried, key=lambda poles: (project(basis(poles, t), y)[1] ** 2).sum())
    return chosen


def _meat(J: Real, e: Real) -> Real:
    """Return J' R J with the residuals' autocovariances r_k, tapered (1 - k/M), M twice the last significant lag."""
    r = autocovariance(e)
    most = max(2, e.size // 3)
    # deviations, 1/sqrt(n), of an autocorrelation of white noise
    (clear,) = np.nonzero(abs(r[:most]) > 2.5 * r[0] / math.sqrt(e.size))
    lags = min(most, 2 * clear.max(initial=0) + 1)
    tapered = r[:lags] * (1 - np.arange(lags) / lags)
    return J.T @ np.apply_along_axis(np.convolve, 0, J, np.r_[tapered[:0:-1], tapered], "same")
