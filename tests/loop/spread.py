"""CPU of `margins` of fresh random loops, and its spread:  python -m tests.loop.spread SIZE SEED

A third each of plausible arms under gains, arms of any ends under laws with states and delays, and rigs of several
segments with drives, springs and payloads under such laws.  Caches are emptied before each loop.  Printed are the
median, and the 99th percentile and the largest in medians; speed is never wrong.
"""

import time

import numpy as np

import tfarm
from tests import caches, survey
from tests.loop.arms import some_loop
from tests.loop.law_counts import some_delay, some_law
from tests.plausible.arms import draw
from tests.rigs import some_rig
from tests.survey import Finding
from tfarm.case import Case
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.continuous import ContinuousLoop

UNTIMED = 3  # loops before the first that is timed: what they import is used by all


def some_case(number, seed):
    """Arm and law of a case: a plausible arm, an arm of any ends or a rig, by its number."""
    rng = np.random.default_rng([seed, number])
    if number % 3 == 0:
        case = draw(number, seed)
        return case.arm, case.law
    while True:
        arm = some_loop(rng)[0] if number % 3 == 1 else some_rig(rng)
        try:
            law = some_law(rng, arm, delay=0.0 if arm.is_undamped else some_delay(rng, arm))
            ContinuousLoop(Case(arm, law))
        except (ParameterError, ConvergenceError):  # a locked hub, or no loop
            continue
        return arm, law


def seconds(arm, law):
    """CPU [s] of `margins` without anything kept, and its record or its error."""
    caches.empty()
    begun = time.process_time()
    try:
        found = tfarm.margins(arm, law)
    except (ConvergenceError, ParameterError) as error:
        found = error
    return time.process_time() - begun, found


def spread(size, seed):
    """The finding on each loop, and their spread."""
    for number in range(UNTIMED):
        seconds(*some_case(number, seed))
    times = []
    for number in range(size):
        spent, found = seconds(*some_case(number, seed))
        times.append(spent)
        yield Finding("refused" if isinstance(found, Exception) else found.stability.word, figures={"CPU [s]": spent})
    median = np.median(times)
    print(f"  99th percentile {np.percentile(times, 99) / median:.3g} medians, worst {max(times) / median:.3g}")


if __name__ == "__main__":
    survey.main(spread, size=300)
