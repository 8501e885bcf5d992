"""The README's examples, run as they stand, and their printed output."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
from matplotlib import pyplot
from typer.exceptions import TyperException

from tests.shell import run
from tfarm.cli.running import commands_of, whole_command
from tfarm.report import writing
from tfarm.report.sections import PIECES

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_LINES = 130


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, flags=re.DOTALL | re.MULTILINE)


SHELL = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines()]
COMMANDS = [line for line in [*SHELL, *re.findall(r"`(tfarm [^`]*)`", TEXT)] if line.startswith("tfarm ")]


def test_it_is_two_screens():
    assert len(TEXT.splitlines()) <= MOST_LINES


def test_the_commands_print_what_is_shown(capsys, monkeypatch, tmp_path):
    """Numbers of a search are the same to a digit less than a search converges to."""
    monkeypatch.chdir(tmp_path)
    outs = {}
    for line in SHELL:
        if line.startswith("tfarm "):
            verb, *words = shlex.split(line)[1:]
            code, outs[verb], _ = run(capsys, verb, *words)
            assert code == 0
    for printed, shown in zip(outs["design"].splitlines(), blocks("text")[0].splitlines(), strict=False):
        (words, numbers), (wanted, limits) = (split_numbers(each) for each in (printed, shown))
        assert words == wanted
        assert numbers == pytest.approx(limits, rel=2e-3)


def split_numbers(line):
    """The words of a line, and its numbers."""
    number = r"(?<![A-Za-z])\d+(?:\.\d+)?(?:e[+-]?\d+)?"
    return re.sub(rf"{number}|\s+", " ", line).split(), [float(each) for each in re.findall(number, line)]


def test_the_python_example_prints_what_is_shown(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (block,) = blocks("python")
    exec(compile(block, "README.md", "exec"), {})
    pyplot.close("all")
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    assert capsys.readouterr().out == blocks("text")[1]


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_are_understood(line, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    verb, *words = shlex.split(line)[1:]
    if verb == "--help":
        return
    if verb == "proof":
        verb = f"proof {words.pop(0)}"
    command = commands_of(whole_command())[verb]
    for name in ("my-arm.toml", "good.toml"):
        (tmp_path / name).touch()
    command.make_context(verb, list(words))
    with pytest.raises(TyperException, match="no-such-option"):
        command.make_context(verb, [*words, "--no-such-option"])


@pytest.mark.usefixtures("audited")
def test_a_report_runs(tmp_path, capsys, monkeypatch):
    """With two of its sections, no proof, no live page and empty scripts; the whole is the report of tests/report."""
    monkeypatch.chdir(tmp_path)
    for dear in ("save_proof", "save_live"):
        monkeypatch.setattr(writing, dear, lambda *_: None)
    monkeypatch.setattr(writing, "write_assets", lambda folder: (folder.mkdir(), (folder / "live.js").touch()))
    pieces = [each for each in PIECES if each.name in ("the arm", "root moment")]
    monkeypatch.setattr("tfarm.report.sections.PIECES", pieces)
    code, out, err = run(capsys, "report", "sasaki2012-lab", "--out", "pages")
    assert (code, out.strip()) == (0, "pages/index.html")
    assert err == "tfarm: written first: pages/sasaki2012-lab/index.html; the other pages follow\n"
    assert {path.name for path in (tmp_path / "pages").iterdir()} == {"assets", "index.html", "sasaki2012-lab", "trust"}
    assert (tmp_path / "pages" / "sasaki2012-lab" / "index.html").exists()


def test_make_has_the_verbs_of_the_readme():
    done = subprocess.run(["make"], cwd=ROOT, capture_output=True, text=True, check=True)
    verbs = {line.split()[1] for line in done.stdout.splitlines()}
    assert {line.split()[1] for line in SHELL if line.startswith("make ")} <= verbs
    assert {"install", "reports", "modes", "bode", "test", "survey", "lint", "bench", "clean"} <= verbs


@pytest.mark.parametrize("path", re.findall(r"\]\(([^)#]+)\)", TEXT) + re.findall(r"`(tests/[^`]*\.py)`", TEXT))
def test_linked_files_are_there(path):
    assert (ROOT / path).exists()
