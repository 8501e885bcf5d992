"""Commands run as a shell runs them."""

import json
import re

import pytest

from tfarm.cli import main


def run(capsys, *arguments):
    """Exit code, standard output and standard error."""
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, heard(err)


PROGRESS = re.compile(r"^tfarm: .*\(\d+ s\)\n", re.MULTILINE)


def heard(err):
    """Standard error of a command without its lines of progress, which depend on the time that it takes."""
    return PROGRESS.sub("", err)


def refused(capsys, *arguments, code=2):
    """The one line on standard error of a command that fails; standard output is empty."""
    stopped, out, err = run(capsys, *arguments)
    assert (stopped, out, err.count("\n")) == (code, "", 1)
    return err


def answer(capsys, *arguments):
    """What the command prints with --json, which holds no NaN; nothing on standard error but what was written."""
    code, out, err = run(capsys, *arguments, "--json")
    assert code == 0
    assert [line for line in err.splitlines() if not line.startswith("written: ")] == []
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
