"""Small cases of the surveys of this room: odd files and options, and kills at random moments."""

import os
import subprocess
import sys

import pytest

from tests.cli import fuzz
from tests.survey import tally


def test_odd_files_and_options_end_in_one_line():
    """A file that is read, one that is not, and an odd option; the whole survey is `make survey`."""
    outcomes, figures, wrong = tally(fuzz.commands, 2, 4)
    assert wrong == 0
    assert (outcomes.total(), len(figures["CPU seconds"])) == (3, 3)
    assert outcomes.keys() >= {"exit 0", "exit 2"}


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


def test_kills_leave_whole_files_and_the_next_run_leaves_nothing_else():
    """In a process of its own, which forks."""
    own = "from tests.cli import kills; kills.COMMANDS = {'csv': kills.COMMANDS['csv']}; kills.survey.main(kills.kills)"
    command = [sys.executable, "-c", own, "4", "1"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    )
    assert done.returncode == 0
    assert done.stdout.startswith("kills: {'whole': 4, 'clean': 1}, 0 wrong")
