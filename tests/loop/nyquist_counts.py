"""Encirclements of -1 against poles in a box, of random loops:  python -m tests.loop.nyquist_counts SIZE SEED

Arms and gains of `tests.loop.arms.some_loop`, Kp of either sign; `nyquist_of` compares its two counts and refuses where
they differ, so what is counted here are refusals, by reason.  A small negative Kp leaves one real unstable pole near 0.
"""

from tests import survey
from tests.loop.arms import some_loop, verdict_of
from tests.survey import Finding, each_of
from tfarm.errors import ConvergenceError
from tfarm.loop.nyquist import nyquist_of


def plots(rng):
    """ "agree", "no verdict" or "refused", with the reason; a plot whose counts are by finding poles is wrong."""
    arm, law = some_loop(rng, slenderness=(5, 60))
    try:
        verdict = verdict_of(arm, law)
    except ConvergenceError:
        return Finding("no verdict")
    try:
        nyquist_of(verdict)
    except ConvergenceError as error:
        return Finding("refused", f"{verdict.word} loop: {error}", "by finding" in str(error))
    return Finding("agree")


if __name__ == "__main__":
    survey.main(each_of(plots), size=500, seed=2012)
