"""Two processes at the lists of work: each keeps to one while there is work on it, and none waits at the end."""

import os
from concurrent.futures import Executor, Future

import pytest

from tfarm.processes import BLAS, one_thread_each, shared


class Steps:
    """In the place of the processes: what was handed to which of them, ended one at a time, as `order` says."""

    def __init__(self):
        self.handed, self.pending = [], []

    def submit(self, pool: Executor, task: str) -> Future:
        future = Future()
        self.handed.append((pool, task))
        self.pending.append((future, task))
        return future


@pytest.fixture
def by_turns(monkeypatch):
    """`wait` ends the task that was handed out first."""
    steps = Steps()

    def wait(running, return_when):
        future, task = steps.pending.pop(0)
        assert future in running
        future.set_result(task.upper())
        return type("Done", (), {"done": {future}})

    monkeypatch.setattr("tfarm.processes.wait", wait)
    return steps


def test_each_process_keeps_to_its_list_and_then_helps_the_other(by_turns):
    lists = [["a1", "a2", "a3", "a4", "a5"], ["b1", "b2"]]
    found = dict(shared(lists, by_turns.submit, 2))
    assert found == {task: task.upper() for each in lists for task in each}
    first, second = (by_turns.handed[i][0] for i in (0, 1))
    assert [task for pool, task in by_turns.handed if pool is first] == ["a1", "a2", "a3", "a4"]
    assert [task for pool, task in by_turns.handed if pool is second] == ["b1", "b2", "a5"]


def test_what_runs_is_named_while_it_runs(by_turns):
    """Both at first; then what one process begins, and what the other still has."""
    seen = []
    assert len(dict(shared([["a1", "a2"], ["b1"]], by_turns.submit, 2, begun=seen.append))) == 3
    assert seen == [["a1", "b1"], ["b1", "a2"], ["a2"]]


@pytest.mark.parametrize("lists", [[], [[]], [["a"]], [[], ["a"], [], ["b", "c"]]])
def test_lists_of_any_length(by_turns, lists):
    assert dict(shared(lists, by_turns.submit, 2)) == {task: task.upper() for each in lists for task in each}


def test_what_a_task_raises_is_raised_and_the_rest_is_not_begun(monkeypatch):
    handed = []

    def submit(pool, task):
        handed.append(task)
        future = Future()
        future.set_exception(OSError("disk full"))
        return future

    with pytest.raises(OSError, match="disk full"):
        list(shared([["a", "b", "c"], ["d"]], submit, 2))
    assert handed == ["a", "d"]


def test_new_processes_have_one_thread_of_blas_unless_the_user_chose(monkeypatch):
    for chosen, inside in ((None, "1"), ("3", "3")):
        if chosen is None:
            monkeypatch.delenv(BLAS, raising=False)
        else:
            monkeypatch.setenv(BLAS, chosen)
        with one_thread_each():
            assert os.environ[BLAS] == inside
        assert os.environ.get(BLAS) == chosen
