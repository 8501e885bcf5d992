"""Frequency and damping of a decay: a sum of damped sinusoids through the samples, and how sure they are.

    y(t) = c + sum_m exp(-sigma_m t) (a_m cos(w_m t) + b_m sin(w_m t))

The start is by ESPRIT (Roy and Kailath 1989): the signal subspace of the Hankel matrix of the samples is the same one
sample later but for a matrix whose eigenvalues are exp(s T).  The end is by Gaussian least squares with the Jacobian of
the formula.  If the residuals e are white, the covariance is  s^2 (J' J)^-1.  If they are not (Ljung and Box 1978),
what is left is noise with a spectrum or something that the model lacks; the covariance is then

    (J' J)^-1 J' R J (J' J)^-1,   R the residuals' autocovariance, tapered (Newey and West 1987),

and the answer says so: of noise that rings with the decay the fit has taken part away, so that nominal 95 % hold some
85, and intervals of a wrong model are too narrow by any formula.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record

from .decays import EACH, LINEAR, counted_from, covariance, least_squares, mode_energy, start_of, whiteness
from .noise import CONFIDENCE
from .recording import Recording

MOST_RINGING = 20  # of one decay
NOT_WHITE = 1e-3  # probability below which residuals are called correlated
RARE = 1e-9  # a probability below which its size says nothing more
RING_ROUNDING = 1e-9  # of the signal and of w: what is less is rounding, of which nothing is said
HALVES_APART = 4.0  # standard deviations that the two halves of a record differ by before it is said
AMPLITUDE_TOLD = 8.0  # deviations of its amplitude in a half of a record that tells of an oscillation: noise has 4


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
    order = np.argsort(-mode_energy(x, t[-1] - t[0]), kind="stable")
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
        shifted = counted_from(x, t[part][0])
        found = least_squares(t[part] - t[part][0], y[part], shifted) if y[part].size > 2 * x.size else None
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
