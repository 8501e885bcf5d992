"""Help: glossary, completion, texts and examples of every command, version, `python -m tfarm`."""

import re
import shlex
import shutil
import subprocess
import sys

import pytest

import tfarm
from tests.shell import answer, refused, run
from tfarm.cli.app import GROUPS
from tfarm.cli.running import whole_command
from tfarm.schema.glossary import CERTAINTY, GLOSSARY_TERMS

VERBS = whole_command().commands


def test_the_glossary_has_each_word_once_in_order(capsys):
    terms = answer(capsys, "glossary")["terms"]
    names = [each["term"] for each in terms]
    assert names == [each.name for each in GLOSSARY_TERMS]
    assert names == sorted(set(names), key=str.casefold)
    assert {each.name for each in CERTAINTY} <= set(names)
    assert {"gain margin", "winding number", "Lyapunov region", "spillover"} <= set(names)
    assert all(each["meaning"].endswith(".") and len(each["meaning"]) < 300 for each in terms)
    found = answer(capsys, "glossary", "disk margin")["quantities"]
    assert {"quantity", "unit", "meaning"} == found[0].keys()
    assert all("gain and phase together" in each["meaning"] for each in found)  # which records declare


def test_a_term_is_found_by_a_part_of_it_and_no_other_is_refused(capsys):
    assert [each["term"] for each in answer(capsys, "glossary", "lyap")["terms"]] == ["Lyapunov region"]
    _, out, _ = run(capsys, "glossary", "proven")
    assert "theorem whose hypotheses were checked" in out
    assert 'did you mean "proven"?' in refused(capsys, "glossary", "provn")


def completed(capsys, monkeypatch, *words):
    """The words that tfarm gives to bash for the last of these."""
    monkeypatch.setenv("COMP_WORDS", " ".join(("tfarm", *words)))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    monkeypatch.setenv("_TFARM_COMPLETE", "complete_bash")
    return run(capsys)[1].split()


def test_commands_options_presets_and_choices_are_completed(capsys, monkeypatch):
    assert completed(capsys, monkeypatch, "") == list(VERBS)
    assert completed(capsys, monkeypatch, "mar") == ["margins"]
    assert completed(capsys, monkeypatch, "margins", "sasaki2012-") == ["sasaki2012-as-printed", "sasaki2012-lab"]
    assert completed(capsys, monkeypatch, "modes", "sasaki2012", "--c") == ["--count", "--certify", "--compare"]
    assert completed(capsys, monkeypatch, "modes", "sasaki2012", "--theory", "eu") == ["euler-bernoulli"]
    assert {*tfarm.presets()} <= set(completed(capsys, monkeypatch, "report", ""))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_a_shell_is_one_of_its_own(capsys, shell):
    code, script, err = run(capsys, "completion", shell)
    assert (code, err) == (0, "")
    assert f"_TFARM_COMPLETE=complete_{shell}" in script
    if (there := shutil.which(shell)) is not None:
        subprocess.run([there, "-n"], input=script, text=True, check=True)


@pytest.mark.parametrize("name", VERBS)
def test_help_is_whole_and_has_an_example_that_is_understood(capsys, monkeypatch, tmp_path, name):
    """At 80 columns: no text is cut, a unit in brackets is no markup, and the example parses."""
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = run(capsys, name, "--help")
    assert (code, err, "…" in out) == (0, "", False)
    words = " ".join(re.sub("[│╭╮╰╯─]", " ", out).split())
    command = VERBS[name]
    assert " ".join(command.help.replace("\\[", "[").split()) in words
    assert command.epilog in words
    verb, *rest = shlex.split(command.epilog.removeprefix("Example: tfarm "))
    monkeypatch.chdir(tmp_path)
    for file in ("record.csv", "my-arm.toml", "rig.toml"):
        (tmp_path / file).touch()
    assert verb == name
    command.make_context(verb, rest)


def test_both_ways_to_start_print_the_version_and_groups_of_commands(capsys):
    assert run(capsys, "--version") == (0, f"tfarm {tfarm.__version__}\n", "")
    done = subprocess.run([sys.executable, "-m", "tfarm", "--version"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (f"tfarm {tfarm.__version__}\n", "")
    out = run(capsys, "--help")[1]
    assert ("--version" in out, "…" in out) == (True, False)
    assert run(capsys)[1] == out
    places = [out.index(f"─ {title} ─") for title in GROUPS]
    assert places == sorted(places)
