"""Whether what a model leaves of a record is noise: white, and independent of what drove the rig."""

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc, fdtrc, kolmogorov

from tfarm.arrays import Real


def chance_of_white(residuals: Real) -> float:
    """Return the probability that white noise is as far from being so as residuals (n,).

    Thrice the least of three: of autocorrelations over 20 lags (Ljung and Box 1978), of the largest line of the
    periodogram (Fisher 1929), and of the sum of its lines up to each (Bartlett 1955), which shows a band.
    """
    e = residuals - residuals.mean()
    n = e.size
    if n < 5 or not e.any():
        return 1.0
    lines = abs(np.fft.rfft(e)[1 : (n + 1) // 2]) ** 2
    share = float(lines.max() / lines.sum())
    # the first term of Fisher's series: an upper bound, and the whole of it where it is small
    by_line = lines.size * (1 - share) ** (lines.size - 1)
    sums = np.cumsum(lines)[:-1] / lines.sum()
    off = float(abs(sums - np.arange(1, lines.size) / lines.size).max(initial=0.0))
    by_band = float(kolmogorov(np.sqrt(lines.size) * off))
    return least_of([chance_of_lags(e), by_line, by_band])


def chance_of_lags(e: Real) -> float:
    """Return the probability of first autocorrelations as large as these in white noise (Ljung and Box 1978)."""
    r = autocovariance(e)
    n = e.size
    if r[0] == 0:
        return 1.0
    lags = np.arange(1, min(20, n // 5) + 1)
    Q = n * (n + 2) * ((r[lags] / r[0]) ** 2 / (n - lags)).sum()
    return float(chdtrc(lags.size, Q))


def autocovariance(e: Real) -> Real:
    """Return the autocovariances (n,) of noise (n,) of mean 0, from lag 0 on."""
    from scipy.signal import correlate

    return correlate(e, e)[e.size - 1 :] / e.size


def least_of(chances: Sequence[float]) -> float:
    """Return the least of some chances as that of all tests together (Bonferroni); 1 of none."""
    return min(1.0, len(chances) * min(chances, default=1.0))


def chance_of_independent(residuals: Real, driving: Real) -> float:
    """Return the probability that what drove a rig (inputs, n) explains as much of white residuals (n,) by chance.

    By the F test of a regression on its last 40 values: what a wrong linear model leaves is a response to its input.
    """
    n = residuals.size
    lags = min(40, n // 20)
    columns = [np.ones(n)]
    for x in driving:
        columns += (np.r_[np.zeros(lag), x][:n] for lag in range(1, lags + 1))
    regressors = np.array(columns).T
    # inputs that are constant, or made up by others, have no part of it
    U, sizes, _ = np.linalg.svd(regressors, full_matrices=False)
    basis = U[:, sizes > 1e-6 * sizes[0]]
    e = residuals - residuals.mean()
    explained = float(((basis.T @ e) ** 2).sum())
    left = float(e @ e) - explained
    number = basis.shape[1] - 1
    freedom = n - basis.shape[1]
    if number < 1 or freedom < 1 or left <= 0:
        return 1.0
    return float(fdtrc(number, freedom, explained / number / (left / freedom)))
