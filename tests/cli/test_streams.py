"""Standard output and error that are full, closed or cut off: one line and exit 2, or silence, never a traceback."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import tfarm
from tests.shared import thinned
from tests.shell import heard, refused
from tfarm.cli import main

TFARM = f"{sys.executable} -m tfarm"


def shell(command, **environment):
    """Exit code, standard output and standard error of a line of bash; `tfarm` is the command."""
    line = command.replace("tfarm", TFARM)
    done = subprocess.run(["bash", "-c", line], capture_output=True, check=False, env={**os.environ, **environment})
    return done.returncode, done.stdout, heard(done.stderr.decode())


@pytest.mark.parametrize(
    ("command", "code", "why"),
    thinned(
        [
            ("tfarm new --list > /dev/full", 2, "No space left on device"),
            ("tfarm modes sasaki2021 > /dev/full", 2, "sasaki2021"),
            ("tfarm new --list >&-", 2, "Bad file descriptor"),
            ("tfarm no-such-verb >&-", 2, "no-such-verb"),
        ],
        2,
    ),
)
def test_output_that_cannot_be_written_is_one_line(command, code, why):
    got, out, err = shell(command)
    assert (got, out) == (code, b"")
    assert err.startswith("tfarm: ")
    assert err.count("\n") == 1
    assert why in err


@pytest.mark.parametrize("command", thinned(["tfarm modes sasaki2021 2>&-", "tfarm modes sasaki2021 2>/dev/full"], 2))
def test_a_message_to_a_closed_stream_goes_nowhere_else(command):
    assert shell(command) == (2, b"", "")


@pytest.mark.parametrize("command", ["response sasaki2012 --output hub_rate", "margins --help"])
def test_a_reader_that_leaves_is_silence(command):
    code, _, err = shell(f"tfarm {command} | true; exit ${{PIPESTATUS[0]}}")
    assert (code, err) == (0, "")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_letters_that_a_terminal_does_not_have_are_escaped(encoding, tmp_path, monkeypatch):
    """On the stream that a process has under PYTHONIOENCODING, as strict as Python makes it."""
    text = (Path(tfarm.__file__).parent / "arm" / "presets" / "stocky-steel.toml").read_text(encoding="utf-8")
    name, file = "Ölarm-λ", tmp_path / "a.toml"
    file.write_text(text.replace('"stocky-steel"', f'"{name}"', 1), encoding="utf-8")

    def printed(*more):
        stream = io.TextIOWrapper(written := io.BytesIO(), encoding, errors="strict")
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", stream)
            with pytest.raises(SystemExit) as stop:
                main(["modes", str(file), "--count", "1", *more])
        assert not stop.value.code
        return written.getvalue()

    assert name.encode(encoding, "backslashreplace") in printed()
    assert json.loads(printed("--json"))["arm"] == name


DASHED = [
    ("response sasaki2012 --output hub_rate --points 3", "--csv"),
    ("bode sasaki2012-lab --to 50", "--png"),
    ("simulate sasaki2012-lab --duration 0.05 --modes 2", "--mat"),
    ("design sasaki2012-lab --continuous --modes 1 --minimise damping", "--save"),
]


@pytest.mark.parametrize(("verb", "option"), DASHED)
def test_a_dash_is_standard_output(verb, option, capfdbinary, tmp_path, monkeypatch):
    """The output is the content of a file of that option, and nothing else: no table, no file called "-".

    In this process, whose standard output is caught as the file number 1 that it is.
    """
    monkeypatch.chdir(tmp_path)
    for where in ("-", "file"):
        with pytest.raises(SystemExit) as stop:
            main([*verb.split(), option, where])
        assert not stop.value.code
        if where == "-":
            out, err = capfdbinary.readouterr()
            assert (heard(err.decode()), list(tmp_path.iterdir())) == ("", [])
    assert (tmp_path / "file").read_bytes() == out


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("map sasaki2012-lab --csv - --png -", "one thing at a time"),
        ("map sasaki2012-lab --csv=- --json", "one thing at a time"),
        ("report sasaki2012-lab --out -", "only --csv, --figure, --png, --mat, --save may go there"),
        ("sampled sasaki2012-lab --dsp -", "only --csv, --figure, --png, --mat, --save may go there"),
    ],
)
def test_a_dash_that_cannot_be_standard_output_is_one_line(words, why, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert why in refused(capsys, *words.split())
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_things_are_imported_is_one_line(tmp_path):
    """A module of the name of the first that the commands need, interrupted as it is read."""
    (tmp_path / "typer.py").write_text("raise KeyboardInterrupt\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    assert shell("tfarm new --list", PYTHONPATH=path) == (130, b"", "tfarm: stopped\n")


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt(), 130, "stopped"),
        (OSError(28, "No space left on device", "/cache/kernel.nbc"), 2, "/cache/kernel.nbc: No space left on device"),
        (MemoryError(), 3, "not enough memory"),
    ],
)
def test_an_error_midway_is_one_line(error, code, line, capsys, monkeypatch):
    def fail(*_):
        raise error

    monkeypatch.setattr("tfarm.spectrum.table.natural_frequencies", fail)
    assert refused(capsys, "modes", "sasaki2012", code=code).startswith(f"tfarm: {line}")
