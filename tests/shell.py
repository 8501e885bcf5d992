"""Commands run as a shell runs them."""

import json

import pytest

from tfarm.cli import main


def run(capsys, *arguments):
    """Exit code, standard output and standard error."""
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, heard(err)


def heard(err):
    """What a command says on standard error, but for the notice that comes with its first use after an installation."""
    return "".join(line for line in err.splitlines(keepends=True) if not line.startswith("tfarm: compiling once"))


def answer(capsys, *arguments):
    """What the command prints with --json, which holds no NaN; nothing on standard error."""
    code, out, err = run(capsys, *arguments, "--json")
    assert (code, err) == (0, "")
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
