"""The driver of the surveys, which search random cases for a wrong answer.

    python -m tests.ROOM.NAME SIZE SEED [word ...]

A survey is a generator of findings for a size and a seed, most often `each_of` one function of a random generator.
Findings are counted by their outcome; what has words is printed as it comes, and of figures the median, the mean and
the largest.  The exit code is 1 where a finding is wrong.
"""

import sys
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Finding:
    """What came of one case: an outcome to count, words where someone has to look at it, numbers by their name."""

    outcome: str
    words: str = ""
    is_wrong: bool = False
    figures: dict[str, float] = field(default_factory=dict)


def each_of(judge):
    """The survey of a function of one generator; where it returns None the case does not count."""

    def findings(size, seed):
        rng, number = np.random.default_rng(seed), 0
        while number < size:
            found = judge(rng)
            if found is not None:
                number += 1
                yield found

    findings.__name__ = judge.__name__
    return findings


def numbered(judge):
    """The survey of a function of one generator, a new one for each case: by the seed and the case's number."""

    def findings(size, seed):
        yield from (judge(np.random.default_rng([seed, number])) for number in range(size))

    findings.__name__ = judge.__name__
    return findings


def tally(survey, size, seed):
    """Outcomes counted, and figures listed, of one survey; what has words is printed."""
    outcomes, figures, wrong = Counter(), defaultdict(list), 0
    for found in survey(size, seed):
        outcomes[found.outcome] += 1
        wrong += found.is_wrong
        for name, value in found.figures.items():
            figures[name].append(value)
        if found.words:
            print(f"{found.outcome}: {found.words}", flush=True)
    return outcomes, figures, wrong


def main(*surveys, size=100, seed=1):
    """Run the surveys that are named after size and seed on the command line, or all of them, and exit."""
    given = [int(text) for text in sys.argv[1:3]]
    size, seed = [*given, *(size, seed)[len(given) :]]
    failed = 0
    for survey in surveys:
        if survey.__name__ in (sys.argv[3:] or [survey.__name__]):
            begun = time.perf_counter()
            outcomes, figures, wrong = tally(survey, size, seed)
            failed += wrong
            print(
                f"{survey.__name__}: {dict(outcomes)}, {wrong} wrong, {time.perf_counter() - begun:.0f} s", flush=True
            )
            for name, values in figures.items():
                print(f"  {name}: median {np.median(values):.3g}, mean {np.mean(values):.3g}, most {max(values):.3g}")
    sys.exit(failed > 0)
