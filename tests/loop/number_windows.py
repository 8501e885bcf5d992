"""Windows of the numbers of random laws, held against verdicts:  python -m tests.loop.number_windows SIZE SEED

Random damped arms and laws as in `tests.loop.law_counts`, delays among them.  Of a law whose windows are found one
number is drawn and one of its windows: inside it, and just inside and outside of each of its edges, the law with that
number is counted anew.
"""

import numpy as np

from tests import survey
from tests.loop.arms import some_loop
from tests.loop.law_counts import some_delay, some_law
from tests.survey import Finding
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.stability import stability
from tfarm.loop.windows import windows_of

OFF_EDGE = 1e-5  # of an edge: distance at which the verdict is evaluated
LEAST = 1e-6  # of the width of a window: the least size of an edge near 0


def places(rng, window, low, high):
    """Values of the number, and whether the loop should be stable there."""
    yield low + (high - low) * rng.uniform(), True
    for edge, inwards in ((low, 1), (high, -1)):
        if window.end(edge) == "edge":
            step = OFF_EDGE * max(abs(edge), LEAST * (high - low))
            yield edge + inwards * step, True
            yield edge - inwards * step, False


def judge(rng, arm, law):
    """A word for each check: "right", "refused", "marginal", or "wrong: ..."."""
    try:
        verdict = stability(arm, law)
        windows = {name: each for name, each in windows_of(verdict).items() if each.all}
    except (ConvergenceError, ParameterError):
        return ["refused"]
    if verdict.is_stable and any(each.around is None for each in windows.values()):
        return ["wrong: a stable law outside its own windows"]
    if not windows:
        return ["no window"]
    name = str(rng.choice(list(windows)))
    window = windows[name]
    low, high = window.all[rng.integers(len(window.all))]
    words = []
    for at, stable in places(rng, window, low, high):
        try:
            there = stability(arm, law.having(name, float(at)))
        except (ConvergenceError, ParameterError):
            words.append("refused")
            continue
        if there.verdict == "marginal":
            words.append("marginal")
        elif there.is_stable == stable:
            words.append("right")
        else:
            words.append(f"wrong: {name} in ({low!r}, {high!r}) at {float(at)!r}: {there.unstable_roots} unstable")
    return words


def places_of_windows(size, seed):
    """The findings at places in and next to a window of each loop."""
    rng, number = np.random.default_rng(seed), 0
    while number < size:
        arm = some_loop(rng)[0]
        if not arm.least_damping:
            continue
        law, number = some_law(rng, arm, delay=some_delay(rng, arm)), number + 1
        for word in judge(rng, arm, law):
            outcome, _, words = word.partition(":")
            is_wrong = outcome == "wrong"
            yield Finding(outcome, f"{words} {arm} {law}" if is_wrong else "", is_wrong)


if __name__ == "__main__":
    survey.main(places_of_windows)
