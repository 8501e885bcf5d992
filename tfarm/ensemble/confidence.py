"""The share of an ensemble on which something holds, with its confidence.

Where it holds on k of n independent draws, it holds on at least the share p with the confidence 1 - a, where k or more
of n have the probability a at p: the one-sided interval of Clopper and Pearson (Biometrika 26, 1934).
"""

import math

# whose statistics take half a second to load
import scipy

CONFIDENCE = 0.95


def least_share(successes: int, count: int) -> float:
    """Return the share that is exceeded with 95 % confidence, one-sided (Clopper and Pearson, 1934)."""
    test = scipy.stats.binomtest(successes, count, alternative="greater")
    return float(test.proportion_ci(CONFIDENCE, method="exact").low)


def least_share_words(share: float) -> str:
    """Return that share in per cent, rounded down."""
    # never more than was shown
    percent = math.floor(1e4 * share + 1e-6) / 100
    return f"at least {percent:g} % of all with {100 * CONFIDENCE:g} % confidence"
