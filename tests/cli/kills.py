"""Commands that write files, killed at random moments:  python -m tests.cli.kills SIZE SEED

Each command runs in a copy of a folder that holds its files as another arm left them.  After each of SIZE kills every
file there is whole, the old one or the new, to the last byte, and no page names a file that is not there; after at most
five kills the same command runs to its end, and then the folder holds the new files and nothing else.

The runs are forks of this process, so that the kills fall on the work and not on imports; half of them fall into the
time from the first temporary file on.
"""

import contextlib
import io
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.survey import Finding
from tfarm.arm import to_toml
from tfarm.cli.running import run

KILLS_A_RUN = 5
COMMANDS = {
    "csv": ("response", "arm.toml", "--output", "root_moment", "--points", "3000", "--csv", "table.csv"),
    "mat": ("simulate", "arm.toml", "--duration", "0.5", "--csv", "run.csv", "--mat", "run.mat"),
    "save": ("tune", "arm.toml", "--trials", "1", "--guard", "none", "--duration", "1", "--save", "tuner.json"),
    "report": ("report", "arm.toml", "--only", "modes", "--out", "pages"),
}


def files_of(folder):
    """The content of all files below a folder by name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def started(arguments, folder, *files):
    """The process id of a fork that runs the command in that folder, with files for its output and errors."""
    child = os.fork()
    if child:
        return child
    try:
        os.chdir(folder)
        for number, file in enumerate(files, 1):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        os._exit(run(list(arguments)))
    except BaseException as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
    finally:
        os._exit(1)


def completed(arguments, folder):
    """Run it to its end; the seconds that it took and those until the first temporary file, or None where it failed."""
    begun, child, first = time.perf_counter(), started(arguments, folder, os.devnull), None
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if first is None and _is_writing(folder):
            first = time.perf_counter() - begun
        if done:
            spent = time.perf_counter() - begun
            return (spent, spent if first is None else first) if status == 0 else None
        time.sleep(1e-3)


def _is_writing(folder):
    return any(
        name.startswith(".") for each in (folder, folder / "pages") if each.is_dir() for name in os.listdir(each)
    )


def killed(arguments, folder, after, from_writing):
    """Kill a run some seconds after its start or, with `from_writing`, after its first temporary file."""
    child = started(arguments, folder, os.devnull)
    while from_writing and not _is_writing(folder) and not os.waitpid(child, os.WNOHANG)[0]:
        time.sleep(1e-3)
    time.sleep(after)
    try:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    except (ProcessLookupError, ChildProcessError):  # it had ended
        pass


def wrong_with(found, old, new):
    """What is wrong with the files after a kill, or an empty text."""
    for name, content in found.items():
        if any(part.startswith(".") for part in Path(name).parts):
            continue  # what the next run has to remove
        if content not in (old.get(name), new.get(name)):
            return f"{name} is neither the old file nor the new one"
        if name.endswith(".html"):
            for target in re.findall(rb'(?:src|href)="([^"#:?]+)"', content):
                if os.path.normpath(Path(name).parent / target.decode()) not in found:
                    return f"{name} names {target.decode()}, which is not there"
    return ""


def _given(folder, arm):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.toml").write_text(to_toml(arm), encoding="utf-8")


def _here(arguments, folder, arm):
    """The files of a run in this process, so that the forks have everything imported and compiled."""
    _given(folder, arm)
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        run(list(arguments))
    return files_of(folder)


def kills(size, seed):
    """The outcome of each of some kills of every command, and of each run after some."""
    rng = np.random.default_rng(seed)
    lab = tfarm.load("sasaki2012-lab")
    other = replace(lab, hub=tfarm.Hub(inertia=0.2))
    with tempfile.TemporaryDirectory() as place:
        for which, name in enumerate(COMMANDS):
            share = size // len(COMMANDS) + (which < size % len(COMMANDS))
            yield from kills_of(name, share, Path(place) / name, lab, other, rng)


def kills_of(name, number, folder, arm, other, rng):
    """The same of one command, on an arm in whose folder another one's files are."""
    arguments = COMMANDS[name]
    old = _here(arguments, folder / "old", other)
    shutil.copytree(folder / "old", folder / "new")
    new = _here(arguments, folder / "new", arm)
    spent, first = completed(arguments, folder / "new")
    for share in range(number, 0, -KILLS_A_RUN):
        shutil.rmtree(folder / "now", ignore_errors=True)
        shutil.copytree(folder / "old", folder / "now")
        _given(folder / "now", arm)
        for _ in range(min(share, KILLS_A_RUN)):
            late = bool(rng.random() < 0.5)
            killed(arguments, folder / "now", rng.uniform(0, 1.1 * (spent - first if late else spent)), late)
            wrong = wrong_with(files_of(folder / "now"), old, new)
            yield Finding("wrong" if wrong else "whole", wrong, bool(wrong))
        ended = completed(arguments, folder / "now") is not None
        is_clean = ended and files_of(folder / "now") == new
        words = "" if is_clean else f"{name}: a run after kills leaves other files"
        yield Finding("clean" if is_clean else "wrong", words, not is_clean)


if __name__ == "__main__":
    survey.main(kills)
