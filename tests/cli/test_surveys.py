"""A small case of the survey of this room, in a process of its own, which forks."""

import subprocess
import sys

import pytest

from tests.cli import fuzz


def test_nothing_is_wrong():
    """A file that is read, one that is not, and an odd option; the whole survey is `make survey`."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.cli.fuzz", "2", "4"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0
    assert done.stdout.startswith("commands: {'exit 2': 2, 'exit 0': 1}, 0 wrong")


@pytest.mark.parametrize(
    ("code", "err", "wrong"),
    [
        (1, "ValueError: x\n", "exit 1"),
        (2, "", "without a word"),
        (2, "tfarm: a\ntfarm: b\n", "2 errors"),
        (0, "RuntimeWarning: overflow\n", "prints ['RuntimeWarning"),
        (None, "", "more than 20 CPU seconds"),
        (0, "tfarm: warning: a\ntfarm: b\n", ""),
    ],
)
def test_the_survey_detects_an_error(code, err, wrong):
    found = fuzz.judge(("modes",), code, "", err, 1.0)
    assert wrong in found
    assert bool(found) == bool(wrong)
