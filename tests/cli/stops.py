"""Reports stopped at random moments by Ctrl-C, SIGTERM or SIGHUP:  python -m tests.cli.stops SIZE SEED

Each run is a process of its own in a session of its own, with two workers.  The signal, or two of them up to 20 ms
apart, goes to the process or to its group.  Within two seconds the process has ended with 130, 143 or 129 and one line,
no process of the session is left, and the folder holds what it held before; a run that had ended is not counted.
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from itertools import product
from pathlib import Path

import numpy as np

from tests import survey
from tests.shell import heard
from tests.survey import Finding

COMMAND = (sys.executable, "-m", "tfarm", "report", "sasaki2012-lab", "--out", "pages")
WITHIN = 2.0  # seconds
LONGEST = 12.0  # seconds after the handlers are set, for the last moments
HANDLED = 1 << signal.SIGTERM - 1  # in the mask of signals that a process handles: from then on it can be stopped
EACH = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
SIGNALS = [*((each,) for each in EACH), *product(EACH, EACH)]


def members(session):
    """The processes of a session that run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            state, _, _, own = stat.read_text().rpartition(")")[2].split()[:4]
            found += [int(stat.parent.name)] * (own == str(session) and state != "Z")
    return found


def handles_signals(process):
    """Whether its handlers are set."""
    with suppress(FileNotFoundError):
        status = Path(f"/proc/{process}/status").read_text()
        return bool(int(re.search(r"SigCgt:\s*(\w+)", status)[1], 16) & HANDLED)
    return False


def outcome(signals, apart, send, after, folder):
    """What is wrong with the end of a run in an empty folder, "clean", or "ended before"; `after` [s] it is stopped."""
    process = subprocess.Popen(
        COMMAND, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    try:
        while not handles_signals(process.pid) and process.poll() is None:
            time.sleep(1e-3)
        time.sleep(after)
        if process.poll() is not None:
            return "ended before"
        sent = time.monotonic()
        for number in signals:
            with suppress(ProcessLookupError):  # it has gone
                send(process.pid, number)
            time.sleep(apart)
        out, err = process.communicate(timeout=30)
        took = time.monotonic() - sent - apart
        while members(process.pid) and time.monotonic() - sent < WITHIN:
            time.sleep(0.01)
        checks = {
            f"exit code {process.returncode}": process.returncode not in {128 + each for each in signals},
            f"prints {out!r} {err!r}": (out, heard(err)) != ("", "tfarm: stopped\n"),
            f"took {took:.2f} s": took > WITHIN,
            f"left {members(process.pid)}": members(process.pid),
            "files are left": list(folder.iterdir()),
        }
        return next((words for words, is_so in checks.items() if is_so), "clean")
    except subprocess.TimeoutExpired:
        return "does not end"
    finally:
        for each in members(process.pid):
            os.kill(each, signal.SIGKILL)
        process.wait()


def stops(size, seed):
    """The outcome of each stop: one and two signals, each kind, to the process and to its group."""
    rng = np.random.default_rng(seed)
    for i in range(size):
        signals, send = SIGNALS[i % len(SIGNALS)], (os.kill, os.killpg)[i // len(SIGNALS) % 2]
        apart, after = float(rng.choice([0.0, rng.uniform(0, 0.02)])), rng.uniform(0, LONGEST)
        with tempfile.TemporaryDirectory() as place:
            found = outcome(signals, apart, send, after, Path(place))
        is_wrong = found not in ("clean", "ended before")
        words = f"{found}: {signals} {apart} {send.__name__} {after}" if is_wrong else ""
        yield Finding("wrong" if is_wrong else found, words, is_wrong)


if __name__ == "__main__":
    survey.main(stops)
