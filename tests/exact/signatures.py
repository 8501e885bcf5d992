"""The kernels of the usual commands: compiled in one process, and those with more than one signature.

    python -m tests.exact.signatures           # compiles them, with a line for each command: the end of `make install`

Real and complex numbers, two precisions, and counts of tuples may have a signature each; layouts, flags of arrays and
literals may not.  With a warm cache only kernels that Python calls are seen, with an empty one those that kernels call.
"""

import gc
import io
import json
import sys
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from itertools import chain

from numba.core import types
from numba.core.registry import CPUDispatcher

from tfarm.cli.running import run

COMMANDS = (
    "modes sasaki2012-lab",
    "modes tests/data/quanser-2dsfl/rig.toml",
    "margins sasaki2012",
    "simulate sasaki2012-lab --duration 0.1",
    "sampled sasaki2012-lab",
    "tune sasaki2012-lab --trials 1",
    "tune sasaki2012-lab --trials 1 --mode online",
)


def numbers_of(kind):
    """The types of the numbers in a type of an argument."""
    if isinstance(kind, types.BaseTuple):
        return [number for each in kind.types for number in numbers_of(each)]
    return [kind.dtype if isinstance(kind, types.Array) else kind]


def allowed(signature):
    """What may differ between two signatures of a kernel."""
    numbers = [numbers_of(each) for each in signature]
    flat = list(chain.from_iterable(numbers))
    is_complex = any(isinstance(each, types.Complex) for each in flat)
    return is_complex, types.float32 in flat, tuple(len(each) if types.none not in each else 0 for each in numbers)


def compiled_twice(*kernels):
    """Name and signatures of each such kernel, by default of those of the package in this process."""
    every = kernels or [each for each in gc.get_objects() if isinstance(each, CPUDispatcher)]
    found = {f"{each.py_func.__module__}.{each.py_func.__name__}": each.signatures for each in every}
    return {
        name: list(map(str, signatures))
        for name, signatures in found.items()
        if name.startswith("tfarm.") and max(Counter(map(allowed, signatures)).values(), default=0) > 1
    }


def run_all():
    """Run the commands, which compile what they call; what they print is not shown."""
    for n, command in enumerate(COMMANDS, 1):
        print(f"compiling kernels {n} of {len(COMMANDS)} (tfarm {command})", file=sys.stderr, flush=True)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
            code = run(command.split())
        assert code == 0, said.getvalue()


def save(file):
    """Run the commands and write what has been compiled twice since this process began."""
    gc.unfreeze()
    with redirect_stderr(io.StringIO()):
        run_all()
    file.write_text(json.dumps(compiled_twice()), encoding="utf-8")


if __name__ == "__main__":
    run_all()
