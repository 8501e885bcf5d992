"""Small cases of the surveys of this room: odd files and options, and kills at random moments."""

import os
import subprocess
import sys

import pytest

from tests.cli import fuzz


def test_odd_files_and_options_end_in_one_line():
    """A file that is read, one that is not, and an odd option; the whole survey is `make survey`."""
    found = fuzz.survey(2, 4)
    assert [each.wrong for each in found] == [""] * 3
    assert {each.code for each in found} >= {0, 2}


@pytest.mark.parametrize(
    ("code", "err", "wrong"),
    [
        (1, "ValueError: x\n", "exit 1"),
        (2, "", "without a word"),
        (2, "tfarm: a\ntfarm: b\n", "2 errors"),
        (0, "RuntimeWarning: overflow\n", "says RuntimeWarning"),
        (None, "", "more than 20 CPU seconds"),
        (0, "tfarm: warning: a\ntfarm: b\n", ""),
    ],
)
def test_the_survey_sees_what_is_wrong(code, err, wrong):
    assert wrong in fuzz.judge(("modes",), code, "", err, 1.0).wrong
    assert bool(fuzz.judge(("modes",), code, "", err, 1.0).wrong) == bool(wrong)


def test_kills_leave_whole_files_and_the_next_run_leaves_nothing_else():
    """In a process of its own, which forks."""
    command = [sys.executable, "-m", "tests.cli.kills", "4", "1", "csv"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=False)
    assert (done.returncode, done.stdout) == (0, "{'whole': 4, 'clean': 1}\n")
