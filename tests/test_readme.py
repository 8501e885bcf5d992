"""The README's examples, run as they stand."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib import pyplot
from typer.exceptions import TyperException

import tfarm
from tests.shell import heard, run
from tfarm.cli.running import whole_command
from tfarm.report import writing
from tfarm.report.writing import PIECES

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)


def test_python_examples_run_one_after_the_other(capsys, monkeypatch, tmp_path):
    names = {}
    monkeypatch.chdir(tmp_path)
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), names)
    pyplot.close("all")
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    out = capsys.readouterr().out
    assert "71.50568247" in out
    shown = re.findall(r"# ((?:Simulation|Locus)\(finding='[^']*')", TEXT)
    assert len(shown) == 2
    assert all(each in out for each in shown)
    assert names["shapes"].shape == (11, 201)


SHELL = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines() if line.strip()]
COMMANDS = [line for line in SHELL if line.startswith("tfarm ")]


def by_a_shell(line, folder):
    command = line.replace("tfarm", f"{sys.executable} -c 'from tfarm.cli import main; main()'", 1)
    done = subprocess.run(
        ["bash", "-c", command], cwd=folder, env=os.environ, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout, heard(done.stderr)


DEAR = (  # half a second to several, with nearly the same command elsewhere
    "PD+notch", "--digits 30 --certify", "--count 12 --certify", "tfarm compare ", "tfarm bode ", "tfarm locus ",
    "tfarm spill ", "tfarm sampled ", "tfarm assumptions ", "--objective damping",
)  # fmt: skip
QUICK = [
    pytest.param(line, marks=pytest.mark.survey) if any(word in line for word in DEAR) else line
    for line in COMMANDS
    if not line.startswith("tfarm report ")
]


@pytest.mark.parametrize("line", COMMANDS)
def test_shell_examples_are_understood(line, monkeypatch, tmp_path):
    """Verb, options and their values, of those too that only `make survey` runs."""
    monkeypatch.chdir(tmp_path)
    verb, *words = shlex.split(line)[1:]
    command = whole_command().commands[verb]
    command.make_context(verb, list(words))
    with pytest.raises(TyperException, match="no-such-option"):
        command.make_context(verb, [*words, "--no-such-option"])


@pytest.mark.parametrize("line", QUICK)
def test_shell_examples_run(line, tmp_path, capsys, monkeypatch, request):
    """Without a process each, which are a second or two of imports, but for the first."""
    monkeypatch.chdir(tmp_path)
    if line == "tfarm audit":
        request.getfixturevalue("audited")
    words = shlex.split(line)[1:]
    code, out, err = by_a_shell(line, tmp_path) if line == COMMANDS[0] else run(capsys, *words)
    assert code == 0
    assert [each for each in err.splitlines() if not each.startswith("written: ")] == []
    written = re.findall(r"--(?:csv|out|save|png) (\S+)", line)
    assert all((tmp_path / name).exists() for name in written)
    assert out or written


@pytest.mark.usefixtures("audited")
def test_the_example_of_a_report_runs(tmp_path, capsys, monkeypatch):
    """With two of its sections, no proof, no live page and empty scripts; the whole is the report of tests/report."""
    monkeypatch.chdir(tmp_path)
    for dear in ("save_proof", "save_live"):
        monkeypatch.setattr(writing, dear, lambda *_: None)
    monkeypatch.setattr(writing, "write_assets", lambda folder: (folder.mkdir(), (folder / "live.js").touch()))
    pieces = [each for each in PIECES if each.name in ("the arm", "root moment")]
    monkeypatch.setattr("tfarm.report.writing.PIECES", pieces)
    (line,) = (line for line in COMMANDS if line.startswith("tfarm report "))
    code, out, err = run(capsys, *shlex.split(line)[1:])
    assert (code, out.strip()) == (0, "pages/index.html")
    assert err == ""
    assert {path.name for path in (tmp_path / "pages").iterdir()} == {"assets", "index.html", "sasaki2012-lab", "trust"}
    assert (tmp_path / "pages" / "sasaki2012-lab" / "index.html").exists()


def test_make_has_the_verbs_of_the_readme():
    done = subprocess.run(["make"], cwd=ROOT, capture_output=True, text=True, check=True)
    verbs = {line.split()[1] for line in done.stdout.splitlines()}
    assert {line.split()[1] for line in SHELL if line.startswith("make ")} <= verbs
    assert {"install", "reports", "modes", "bode", "test", "survey", "lint", "bench", "clean"} <= verbs


def test_the_examples_of_an_arm_and_of_a_rig_are_arms(tmp_path):
    for name, toml in zip(("my-arm", "bench"), blocks("toml"), strict=True):
        file = tmp_path / f"{name}.toml"
        file.write_text(toml, encoding="utf-8")
        arm = tfarm.load(str(file))
        assert arm.name == name
        assert arm.is_uniform == (name == "my-arm")
        assert tfarm.modes(arm, 1).natural_frequency[1] > 0
