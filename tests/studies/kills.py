"""Studies killed at random moments:  python -m tests.studies.kills SIZE SEED

A worker process, the study itself, a worker of a Dask cluster and its scheduler are killed by SIGKILL.  The study is
run again until it is complete, and its parts have the bytes of an undisturbed one.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.cli.stops import members
from tests.shell import heard
from tests.survey import Finding
from tfarm.dsp import Chain

ROOT = Path(__file__).parents[2]
OVER = {"payload.mass": {"uniform": [0.0, 0.2]}, "law.K2": {"uniform": [0.0, 0.6]}}
DRAWS, PART = 480, 40
KINDS = ("worker", "study", "Dask worker", "scheduler")
PATIENCE = 300.0  # seconds, for any run


def declare(folder, draws=DRAWS, part=PART, ask=("modes",)):
    """Write the files of a study without computing a part."""
    arm = tfarm.load("sasaki2012-lab")
    return tfarm.study(arm, OVER, ask, None, Chain(), out=folder, draws=draws, part=part, stop_after=0.0)


def begin(folder, *options):
    """The process that completes a study."""
    return subprocess.Popen(
        [sys.executable, "-m", "tfarm", "study", str(folder / "study.toml"), "--out", str(folder), *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip


def complete(folder, *options):
    """The exit code and the lines of errors of a study that is completed."""
    process = begin(folder, *options)
    _, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, heard(errors)


def parts(folder):
    """The bytes of each part by its name."""
    return {each.name: each.read_bytes() for each in sorted(folder.glob("part-*"))}


def wait_for_parts(folder, count, process):
    """Whether that many parts are there before the process has ended."""
    while len(list(folder.glob("part-*"))) < count and process.poll() is None:
        time.sleep(2e-3)
    return process.poll() is None


def pool_of(session):
    """The worker processes of a study."""
    commands = {each: Path(f"/proc/{each}/cmdline").read_bytes() for each in members(session)}
    return [each for each, command in commands.items() if b"spawn_main" in command]


@contextmanager
def cluster():
    """A process with a Dask scheduler and two workers on the loopback: the process, its address, and its workers."""
    process = subprocess.Popen(
        [sys.executable, "-c", "from tests.studies.kills import serve; serve()"], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        found = json.loads(process.stdout.readline())
        yield process, found["address"], found["workers"]
    finally:
        process.kill()
        process.communicate()


def serve():
    """Run the scheduler and its workers until standard input ends."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as made:
        workers = [each.process.pid for each in made.workers.values()]
        print(json.dumps({"address": made.scheduler_address, "workers": workers}), flush=True)
        sys.stdin.read()


def killed(kind, folder, count, served=None):
    """Exit code and lines of a study of which one process is killed when `count` parts are there."""
    process = begin(folder, *(("--workers", "2") if served is None else ("--scheduler", served[1])))
    if wait_for_parts(folder, count, process):
        victim = {
            "worker": lambda: pool_of(process.pid)[0], "study": lambda: process.pid,
            "Dask worker": lambda: served[2][0], "scheduler": lambda: served[0].pid,
        }[kind]()  # fmt: skip
        os.kill(victim, signal.SIGKILL)
    _, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, heard(errors)


EXPECTED = {  # exit code, and the line on standard error
    "worker": (3, r"tfarm: a worker process ended .*\n"),
    "study": (-signal.SIGKILL, ""),
    "Dask worker": (0, ""),
    "scheduler": (3, r"tfarm: the cluster failed .*; run the study again\n"),
}


def is_expected(kind, outcome):
    """Whether a killed study ended as it should."""
    code, line = EXPECTED[kind]
    return outcome == (0, "") or (outcome[0] == code and re.fullmatch(line, outcome[1]) is not None)


def kills(size, seed):
    """Kill one process of a study after another, at a random number of parts, until it is complete; then anew."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as place:
        declare(Path(place) / "whole")
        assert complete(Path(place) / "whole")[0] == 0
        whole = parts(Path(place) / "whole")
        for n in range(size):
            kind, folder = KINDS[n % len(KINDS)], Path(place) / str(n)
            declare(folder)
            count = int(rng.integers(0, len(whole)))
            if kind in ("Dask worker", "scheduler"):
                with cluster() as served:
                    outcome = killed(kind, folder, count, served)
            else:
                outcome = killed(kind, folder, count)
            kept = parts(folder)
            again = complete(folder, "--workers", "2")
            is_right = is_expected(kind, outcome) and kept.items() <= whole.items() and parts(folder) == whole
            is_right &= len(kept) >= count and again == (0, "")
            words = "" if is_right else f"{kind} after {count} parts: {outcome}, then {again}"
            yield Finding(kind if is_right else "wrong", words, not is_right)


if __name__ == "__main__":
    survey.main(kills)
