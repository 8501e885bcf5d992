"""Small cases of the surveys of this room, in processes of their own, which fork."""

import subprocess
import sys

import pytest

from tests.cli import fuzz

ONE = "from tests.cli import kills; kills.COMMANDS = {'csv': kills.COMMANDS['csv']}; kills.survey.main(kills.kills)"


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        # a file that is read, one that is not, and an odd option; the whole surveys are `make survey`
        (("-m", "tests.cli.fuzz", "2", "4"), "commands: {'exit 2': 1, 'exit 0': 2}, 0 wrong"),
        (("-c", ONE, "4", "1"), "kills: {'whole': 4, 'clean': 1}, 0 wrong"),
    ],
)
def test_nothing_is_wrong(words, printed):
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout[: len(printed)]) == (0, printed)


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
