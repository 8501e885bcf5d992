"""The command line: arguments in, one call, output.  No arithmetic.

app        the application, and the decorator that makes a command of a function
options    options that commands share, and the arm, law and chain that they name
output     records as text, JSON, CSV file and picture
progress   lines on standard error while a command runs
running    one command from its arguments to its exit code
arm_files  commands that begin and check an arm's file
commands   commands on an arm and on measured data
control    commands on the continuous-time loop and the sampled one
designing  commands that choose a law, compare, and study uncertain arms
pages      commands that write pages, give evidence, and help with the others
"""

import atexit
import gc
import os
import sys

from tfarm.stopping import stop_on_signals


def main(arguments: list[str] | None = None) -> None:
    """Run one command and exit: 0, 2 for bad input, 3 for what was not solved or proven, 128 + N for signal N.

    Everything is imported inside, so that an interrupt is one line from the first moment on (see `stopping`).  BLAS
    has one thread, unless the user chose a number: on matrices of a hundred rows more only wait for each other.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # the usual 700 new objects are reached hundreds of times by imports alone
    gc.set_threshold(100_000, 20, 20)
    if arguments is None:
        stop_on_signals()
        # a last look through all that was loaded takes half a second, and frees nothing
        atexit.register(gc.freeze)
    try:
        from tfarm.cli.running import run

        code = run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        if sys.stderr is not None:
            print("tfarm: stopped", file=sys.stderr)
        code = 130
    sys.exit(code)
