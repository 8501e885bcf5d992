"""Work shared by processes: each task once, the running ones are named, and a process that dies is one error."""

import os
import subprocess
import sys
import time
from functools import partial

import pytest

import tfarm
from tests.shared import refusal
from tfarm.processes import BLAS, share_tasks


def test_each_task_has_its_result_and_the_running_ones_are_named(monkeypatch):
    """Two at first, then one more whenever one ends; each process has one thread of BLAS."""
    monkeypatch.delenv(BLAS, raising=False)
    tasks = {name: partial(str.upper, name) for name in "abcd"} | {"threads": partial(os.getenv, BLAS)}
    seen = []
    found = dict(share_tasks(tasks.items(), 2, on_start=seen.append))
    assert found == {"a": "A", "b": "B", "c": "C", "d": "D", "threads": "1"}
    assert seen[0] == ["a", "b"]
    assert {name for names in seen for name in names} == set(tasks)
    assert max(map(len, seen)) == 2
    assert BLAS not in os.environ


def appears(file):
    """Whether a file is there within half a minute."""
    for _ in range(600):
        if file.exists():
            return True
        time.sleep(0.05)
    return False


def test_a_process_that_joins_is_one_of_them_and_the_other_need_not_wait_for_it(tmp_path):
    """It takes the second task, and ends it only when the other process has begun a second one of its own."""
    file, seen = tmp_path / "third", []
    tasks = {"first": os.getpid, "second": partial(appears, file), "third": file.touch}
    tasks |= dict.fromkeys(range(5), os.getpid)
    found = dict(share_tasks(tasks.items(), 2, on_start=seen.append, joins=True))
    assert found["second"]
    assert found.keys() == tasks.keys()
    assert len({found[n] for n in ("first", *range(5))} - {os.getpid()}) == 1
    assert seen[0] == ["first", "second"]
    assert max(map(len, seen)) == 2


SCRIPT = """
import os
from tfarm.processes import share_tasks
print("begun")
found = {process for _, process in share_tasks([(n, os.getpid) for n in range(9)], 2)}
print(os.getpid() in found, __name__, flush=True)
"""


def test_a_script_without_a_guard_is_run_once_and_has_its_processes(tmp_path):
    """As a study with two workers has them, which does nothing else."""
    (tmp_path / "my.py").write_text(SCRIPT)
    paths = os.pathsep.join([os.getcwd(), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"PYTHONPATH": paths}
    command = [sys.executable, str(tmp_path / "my.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert (done.stdout, done.stderr) == ("begun\nFalse __main__\n", "")


@pytest.mark.parametrize(("position", "joins"), [(0, False), (0, True), (1, True)])
def test_an_error_of_a_task_is_raised_by_whichever_process_has_it_and_the_rest_is_not_begun(position, joins, tmp_path):
    tasks = [(i, partial(os.mkdir, tmp_path / str(i))) for i in range(9)]
    tasks.insert(0, ("slow", partial(time.sleep, 0.3)))
    tasks.insert(position, ("fails", partial(os.listdir, tmp_path / "none")))
    with pytest.raises(FileNotFoundError):
        list(share_tasks(tasks, 2, joins=joins))
    assert len(os.listdir(tmp_path)) < 9


def test_a_killed_process_is_an_error_of_one_line():
    found = share_tasks({"dies": partial(os._exit, 9), "other": time.time}.items(), 2)
    assert "worker process ended before its work was done" in str(refusal(list, found, kind=tfarm.ConvergenceError))
