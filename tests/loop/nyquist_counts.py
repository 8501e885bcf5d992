"""Turns around -1 beside poles in a box, of random loops:  python -m tests.loop.nyquist_counts 500 [seed]

Arms and gains of `tests.loop.arms.some_loop`, Kp of either sign; `nyquist_of` compares its two counts and refuses where
they differ, so what is counted here are refusals, by reason.  A small negative Kp leaves one real unstable pole near 0.
"""

import sys
from collections import Counter

import numpy as np

from tests.loop.arms import some_loop
from tfarm.errors import ConvergenceError
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.stability import stability


def survey(number, seed):
    """The outcome of each loop: "agree", "no verdict" or why there is no plot."""
    rng, outcomes = np.random.default_rng(seed), []
    for _ in range(number):
        arm, law = some_loop(rng, slenderness=(5, 60))
        try:
            verdict = stability(arm, law)
        except ConvergenceError:
            outcomes.append("no verdict")
            continue
        try:
            nyquist_of(verdict)
            outcomes.append("agree")
        except ConvergenceError as error:
            outcomes.append(f"{verdict.verdict} loop refused: {error}")
    return outcomes


if __name__ == "__main__":
    NUMBER = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 2012
    TALLY = Counter(survey(NUMBER, SEED))
    for TEXT, COUNT in TALLY.most_common():
        print(f"{COUNT} x {TEXT}")
    sys.exit(any("by finding" in text for text in TALLY))
