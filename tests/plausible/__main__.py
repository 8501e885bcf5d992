"""The survey:  python -m tests.plausible SIZE [SEED] [verb ...]

SIZE plausible arms (steel to rubber, 5 cm to 10 m, L/h 5 to 300, rectangles, rods and tubes, hub 1e-2 to 1e2 and
payload 0 to 1e2 times the beam's, first damping ratio 1e-4 to 2e-2 or C = 0, periods 0.1 to 100 ms), each verb asked
through the command line and judged by a model that shares nothing with tfarm (`model`, `held`); `tune` gets every
fiftieth arm.  Budget: 20 CPU s an arm for all verbs, half of it tfarm's own, 3 without design, reduce and the sampled
ones.  SURVEY_SECONDS=600 ends it after the arm at which ten minutes are over, SURVEY_PROCESSES=2 shares the arms out.

The table has for each verb how many were asked, answered, refused (exit 2 or 3), wrong (a check of the model failed,
a crash, or a line on standard error that is not tfarm's), how many took more than 10 CPU s, the median and the worst,
the checks made and those that the model could not (its own error is too large), and the worst error found.
"""

import os
import sys
import time

from tests.plausible.survey import SLOW, VERBS, listing, survey, table


def _tell(done, size, found):
    for row in found:
        if row.outcome != "answered" or row.seconds > SLOW:
            print(
                f"{done}/{size} arm {row.number} {row.verb} {row.outcome} {row.seconds:.1f} s: {row.words}", flush=True
            )


def _main(arguments):
    size = int(arguments[0]) if arguments else 50
    seed = int(arguments[1]) if len(arguments) > 1 else 2012
    verbs = arguments[2:] or list(VERBS)
    start = time.perf_counter()
    processes, seconds = (
        float(os.environ.get(key, text)) for key, text in (("SURVEY_PROCESSES", "1"), ("SURVEY_SECONDS", "inf"))
    )
    rows = survey(size, seed, verbs, int(processes), _tell, seconds)
    print(listing(rows, seed))
    print("\noracles:")
    for verb in verbs:
        print(f"  {verb:12s} {VERBS[verb].oracle}")
    done = len({row.number for row in rows})
    print(f"\n{done} arms of {size}, seed {seed}, {time.perf_counter() - start:.0f} s")
    print(table(rows, verbs))
    return any(row.outcome in ("wrong", "unjudged") for row in rows)


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
