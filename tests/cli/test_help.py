"""Help: glossary, completion, texts and examples of every command, version, `python -m tfarm`."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tfarm
from tests.shell import answer, refused, run
from tfarm.cli.running import CHAPTERS, commands_of, hints, whole_command
from tfarm.schema.glossary import CERTAINTY, GLOSSARY_TERMS

WHOLE = whole_command()
COMMANDS = commands_of(WHOLE)
OLD = [
    tuple(line.split(" | "))
    for line in (Path(__file__).parents[1] / "data" / "old-commands.txt").read_text(encoding="utf-8").splitlines()[1:]
]


def test_the_glossary_has_each_word_once_in_order(capsys):
    terms = answer(capsys, "proof", "glossary")["terms"]
    names = [each["term"] for each in terms]
    assert names == [each.name for each in GLOSSARY_TERMS]
    assert names == sorted(set(names), key=str.casefold)
    assert {each.name for each in CERTAINTY} <= set(names)
    assert {"gain margin", "winding number", "Lyapunov region", "spillover"} <= set(names)
    assert all(each["meaning"].endswith(".") and len(each["meaning"]) < 300 for each in terms)
    found = answer(capsys, "proof", "glossary", "disk margin")["quantities"]
    assert {"quantity", "unit", "meaning"} == found[0].keys()
    assert all("gain and phase together" in each["meaning"] for each in found)  # which records declare


def test_a_term_is_found_by_a_part_of_it_and_no_other_is_refused(capsys):
    assert [each["term"] for each in answer(capsys, "proof", "glossary", "lyap")["terms"]] == ["Lyapunov region"]
    _, out, _ = run(capsys, "proof", "glossary", "proven")
    assert "theorem whose hypotheses were checked" in out
    assert 'did you mean "proven"?' in refused(capsys, "proof", "glossary", "provn")


def completed(capsys, monkeypatch, *words):
    """The words that tfarm gives to bash for the last of these."""
    monkeypatch.setenv("COMP_WORDS", " ".join(("tfarm", *words)))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    monkeypatch.setenv("_TFARM_COMPLETE", "complete_bash")
    return run(capsys)[1].split()


def test_commands_options_presets_and_choices_are_completed(capsys, monkeypatch):
    assert completed(capsys, monkeypatch, "") == [name for name in WHOLE.commands if name != "completion"]
    assert completed(capsys, monkeypatch, "proof", "a") == ["audit", "assumptions"]
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


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_whole_and_has_an_example_that_is_understood(capsys, monkeypatch, tmp_path, name):
    """At 80 columns: no text is cut, a unit in brackets is no markup, and the example parses."""
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = run(capsys, *name.split(), "--help")
    assert (code, err, "…" in out) == (0, "", False)
    words = " ".join(re.sub("[│╭╮╰╯─]", " ", out).split())
    command = COMMANDS[name]
    assert " ".join(command.help.replace("\\[", "[").split()) in words
    assert command.epilog in words
    example = command.epilog.removeprefix("Example: tfarm ")
    assert f"{example} ".startswith(f"{name} ")
    monkeypatch.chdir(tmp_path)
    for file in ("record.csv", "my-arm.toml", "rig.toml"):
        (tmp_path / file).touch()
    command.make_context(name, shlex.split(example.removeprefix(name)))


def test_both_ways_to_start_print_the_version_and_groups_of_commands(capsys):
    assert run(capsys, "--version") == (0, f"tfarm {tfarm.__version__}\n", "")
    done = subprocess.run([sys.executable, "-m", "tfarm", "--version"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (f"tfarm {tfarm.__version__}\n", "")
    out = run(capsys, "--help")[1]
    assert ("--version" in out, "…" in out) == (True, False)
    assert run(capsys)[1] == out
    places = [out.index(f"─ {title} ─") for title in CHAPTERS]
    assert places == sorted(places)


@pytest.mark.parametrize("columns", [80, 120])
def test_the_help_has_a_line_for_each_command_and_fits_a_screen(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    lines = run(capsys, "--help")[1].splitlines()
    # 45 for the 27 rows of 32 commands
    assert len(lines) <= 18 + len([name for name in WHOLE.commands if name != "completion"])
    assert max(map(len, lines)) == columns
    rows = [line.strip("│ ").split(None, 1) for line in lines if line.startswith("│")]
    assert dict(rows) == {
        name: each.help.splitlines()[0] for name, each in WHOLE.commands.items() if name != "completion"
    }
    assert not {line.split()[0] for line, _ in OLD} & {name for name, _ in rows}


def test_a_group_alone_prints_its_help(capsys):
    code, out, err = run(capsys, "proof")
    assert (code, out, err) == (0, run(capsys, "proof", "--help")[1], "")
    assert all(name in out for name in ("audit", "validate", "assumptions", "glossary"))


@pytest.mark.usefixtures("audited")
@pytest.mark.parametrize(("old", "new"), OLD)
def test_an_old_name_does_what_the_new_one_does_and_names_it(old, new, capsys, monkeypatch, tmp_path):
    """Standard output and exit code are equal, and standard error but for the first line."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *old.split())
    notice, _, rest = err.partition("\n")
    assert (code, out, rest) == run(capsys, *new.split())
    own = old.split()[0]
    name = "new --list" if new.startswith("new") else f"proof {own}"
    assert notice == f'tfarm: "tfarm {own}" has moved: write "tfarm {name}"'


def test_every_old_name_is_in_the_list():
    assert {old.split()[0] for old, _ in OLD} == hints()["renamed"].keys()


@pytest.mark.parametrize(("word", "ours"), hints()["commands"].items())
def test_a_command_of_another_tool_names_ours(word, ours, capsys):
    """In one line, with exit code 2; what it names is a command, or an option of the whole."""
    assert refused(capsys, word, "sasaki2012") == f"tfarm: No such command '{word}'. Did you mean \"{ours}\"?\n"
    words = ours.split()
    assert words[0] in ("--version", "--help") or {words[0], " ".join(words[:2])} & COMMANDS.keys()
