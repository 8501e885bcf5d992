"""What helps with the other verbs: the glossary, completion, the version, `python -m tfarm`."""

import re
import shutil
import subprocess
import sys

import pytest

import tfarm
from tests.shell import answer, run
from tfarm.cli.running import whole_command
from tfarm.glossary import GLOSSARY_TERMS

VERBS = whole_command().commands


def test_the_glossary_has_each_word_once_in_order(capsys):
    terms = answer(capsys, "glossary")["terms"]
    names = [each["term"] for each in terms]
    assert names == [each.name for each in GLOSSARY_TERMS]
    assert names == sorted(set(names), key=str.casefold)
    needed = {"proven", "enclosed", "winding number", "Lyapunov region", "certified", "band", "spill-over", "settled"}
    assert needed <= set(names)
    assert all(each["meaning"].endswith(".") and len(each["meaning"]) < 300 for each in terms)


def test_a_term_is_found_by_a_part_of_it_and_no_other_is_refused(capsys):
    assert [each["term"] for each in answer(capsys, "glossary", "lyap")["terms"]] == ["Lyapunov region"]
    _, out, _ = run(capsys, "glossary", "proven")
    assert "theorem whose hypotheses hold" in out
    code, out, err = run(capsys, "glossary", "provn")
    assert (code, out) == (2, "")
    assert 'did you mean "proven"?' in err
    assert err.count("\n") == 1


def completed(script, *words):
    """What bash offers for the last of these words."""
    line = f"""{script}
COMP_WORDS=({" ".join(f"'{word}'" for word in ("tfarm", *words))}); COMP_CWORD={len(words)}
_tfarm; printf '%s\\n' "${{COMPREPLY[@]}}\""""
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout.split()


def test_bash_completes_verbs_options_and_presets(capsys):
    code, script, err = run(capsys, "completion", "bash")
    assert (code, err) == (0, "")
    assert completed(script, "") == [*sorted(VERBS), "--help", "--version"]
    assert completed(script, "mar") == ["margins"]
    assert completed(script, "margins", "sasaki2012-") == ["sasaki2012-as-printed", "sasaki2012-lab"]
    assert completed(script, "modes", "sasaki2012", "--c") == ["--count", "--certify", "--compare"]
    for verb, command in VERBS.items():
        known = {option for each in command.params for option in each.opts if option.startswith("--")}
        assert set(completed(script, verb, "--")) == known | {"--help"}
    assert {*tfarm.presets()} <= set(completed(script, "report", ""))


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_have_the_same_words(capsys, shell):
    code, script, err = run(capsys, "completion", shell)
    assert (code, err) == (0, "")
    assert {*VERBS, *tfarm.presets()} <= set(re.findall(r"[\w-]+", script))
    if (there := shutil.which(shell)) is not None:
        subprocess.run([there, "-n"], input=script, text=True, check=True)


def test_an_unknown_shell_is_one_line(capsys):
    code, out, err = run(capsys, "completion", "fsh")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert 'did you mean "fish"?' in err


def test_the_version_is_said_by_every_way_in(capsys):
    assert run(capsys, "--version") == (0, f"tfarm {tfarm.__version__}\n", "")
    done = subprocess.run([sys.executable, "-m", "tfarm", "--version"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (f"tfarm {tfarm.__version__}\n", "")
    assert "--version" in run(capsys, "--help")[1]
