"""Reports stopped at random moments by Ctrl-C or SIGTERM:  python -m tests.cli.stops SIZE SEED

Each run is a process of its own in a session of its own, with two workers.  The signal, or two of them up to 20 ms
apart, goes to the process or to its group.  Within two seconds the process has ended with 130 or 143 and one line, no
process of the session is left, and the folder holds what it held before; a run that had ended is not counted.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests import survey
from tests.cli.kills import files_of
from tests.shell import heard
from tests.survey import Finding

COMMAND = (sys.executable, "-m", "tfarm", "report", "sasaki2012-lab", "--out", "pages")
WITHIN = 2.0  # seconds
LONGEST = 12.0  # seconds after the start, for the last moments
HANDLED = 1 << signal.SIGTERM - 1  # in the mask of signals that a process handles: from then on it can be stopped


@dataclass(frozen=True)
class Stop:
    """Signals, the seconds between them, to the process or its group, and how long after its handlers are set."""

    signals: tuple[int, ...]
    apart: float
    to_group: bool
    after: float


def some_stops(number, seed, longest=LONGEST):
    """Stops drawn at random: one and two signals, each kind, to the process and to its group."""
    rng = np.random.default_rng(seed)
    kinds = [(each,) for each in (signal.SIGINT, signal.SIGTERM)]
    kinds += [(first, second) for (first,) in kinds for (second,) in kinds]
    return [
        Stop(kinds[i % 6], float(rng.choice([0.0, rng.uniform(0, 0.02)])), bool(i // 6 % 2), rng.uniform(0, longest))
        for i in range(number)
    ]


def members(session):
    """The processes of a session that run, by number: name."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().partition("(")[2].rpartition(")")
        except (FileNotFoundError, ProcessLookupError):
            continue
        if rest.split()[3] == str(session) and rest.split()[0] != "Z":
            found[int(stat.parent.name)] = name
    return found


def handles_signals(process):
    """Whether its handlers are set."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        return False
    (caught,) = (line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught, 16) & HANDLED)


def outcome(stop, folder):
    """ "clean", "ended before", or what is wrong."""
    before = files_of(folder), sorted(folder.rglob("*"))
    process = subprocess.Popen(
        COMMAND, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    try:
        while not handles_signals(process.pid) and process.poll() is None:
            time.sleep(1e-3)
        time.sleep(stop.after)
        if process.poll() is not None:
            return "ended before"
        sent = time.monotonic()
        for i, number in enumerate(stop.signals):
            time.sleep(stop.apart * bool(i))
            send(process.pid, number, stop.to_group)
        out, err = process.communicate(timeout=30)
        took = time.monotonic() - sent
        while members(process.pid) and time.monotonic() - sent < WITHIN:
            time.sleep(0.01)
        lines = heard(err).splitlines()
        return wrong_with(process.returncode, out, lines, took, members(process.pid), stop) or (
            "clean" if (files_of(folder), sorted(folder.rglob("*"))) == before else f"files are left: {stop}"
        )
    except subprocess.TimeoutExpired:
        return f"does not end: {stop}"
    finally:
        for each in members(process.pid):
            os.kill(each, signal.SIGKILL)
        process.wait()


def send(process, number, to_group):
    """The signal; nothing where the process has gone."""
    with suppress(ProcessLookupError):
        (os.killpg if to_group else os.kill)(process, number)


def wrong_with(code, out, lines, took, left, stop):
    """What is wrong with the end of a run, or an empty text."""
    if code not in {128 + each for each in stop.signals}:
        return f"exit code {code}: {lines} {stop}"
    if lines != ["tfarm: stopped"] or out:
        return f"prints {lines} {out!r}: {stop}"
    if took > WITHIN or left:
        return f"took {took:.2f} s, left {left}: {stop}"
    return ""


def stops(size, seed):
    """The outcome of each stop, in an empty folder."""
    for stop in some_stops(size, seed):
        with tempfile.TemporaryDirectory() as place:
            found = outcome(stop, Path(place))
        is_wrong = found not in ("clean", "ended before")
        yield Finding("wrong" if is_wrong else found, found if is_wrong else "", is_wrong)


if __name__ == "__main__":
    survey.main(stops)
