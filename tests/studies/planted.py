"""Confidence of studies where the share of stable arms is known in closed form.

    python -m tests.studies.planted SIZE SEED

Without damping of the link the loop is stable exactly where K1 > 0 and K2 < 1 (the paper's theorem).  With K1 and K2
drawn independently the share of stable arms is P(K1 > 0) P(K2 < 1).  Each of SIZE studies has other distributions and
another number of draws.  A bound with 95 % confidence exceeds the share in at most 5 % of the studies: the survey is
wrong where their number has a probability below 0.1 % by chance.  The share of the draws themselves, in the
place of the bound, has to be found out: it exceeds the true one in about half of the studies.
"""

import tempfile

import numpy as np
from scipy import stats

import tfarm
from tests import survey
from tests.survey import Finding

ARM = "sasaki2012"  # C = 0
CHANCE = 1e-3  # of a right method to be called wrong
DRAWS = 6, 14


def planted_study(rng, folder):
    """A study of the stability of random gains, and the true share of stable arms."""
    low, high = -rng.uniform(0.02, 0.3), rng.uniform(0.5, 1.0)
    mean, deviation = rng.uniform(0.3, 0.8), rng.uniform(0.1, 0.4)
    over = {"law.K1": {"uniform": [low, high]}, "law.K2": {"normal": [mean, deviation]}}
    found = tfarm.study(
        tfarm.load(ARM), over, ["continuous.stability"], tfarm.HubFeedback(K1=0.1, K2=0.1), out=folder,
        draws=int(rng.integers(*DRAWS)), seed=int(rng.integers(2**31)), workers=1, part=DRAWS[1],
    )  # fmt: skip
    return found, high / (high - low) * stats.norm.cdf((1 - mean) / deviation)


def confidence(size, seed):
    """The survey: each arm against the theorem, then the number of bounds above the truth."""
    above = by_share = 0
    for number in range(size):
        with tempfile.TemporaryDirectory() as folder:
            found, share = planted_study(np.random.default_rng([seed, number]), folder)
            table = found.table()
        (own,) = found.shares
        is_stable = (table["law.K1"] > 0) & (table["law.K2"] < 1)
        is_right = (table["continuous.stability"] == "stable").tolist() == is_stable.tolist()
        above += own.at_least > share
        by_share += own.stable / len(is_stable) > share
        yield Finding("right" if is_right else "verdict of an arm", "" if is_right else str(number), not is_right)
    if stats.binomtest(above, size, 0.05, alternative="greater").pvalue < CHANCE:
        yield Finding("too many bounds above the true share", f"{above} of {size}", is_wrong=True)
    yield Finding("bounds", figures={"above the true share": above / size, "shares above it": by_share / size})
    if stats.binomtest(by_share, size, 0.05, alternative="greater").pvalue > CHANCE:
        yield Finding("the survey has no power", f"{by_share} of {size} shares above", is_wrong=size >= 30)


if __name__ == "__main__":
    survey.main(confidence)
