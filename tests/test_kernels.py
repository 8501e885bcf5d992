"""That `make kernels` runs what it says it runs.

The sampler of mutants changes what it says, once.
"""

import ast
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import kernels
from tests.callers import order
from tests.mutants import change, function_of, mutant, places

ROOT = Path(__file__).parent.parent


@pytest.fixture(params=[{}, {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "AVX2"}])
def surroundings(request, monkeypatch):
    """An environment that chooses no kernels, and one that does."""
    for name in kernels.CHOSEN_BY:
        monkeypatch.delenv(name, raising=False)
    for name, value in request.param.items():
        monkeypatch.setenv(name, value)


@pytest.mark.usefixtures("surroundings")
def test_what_is_chosen_is_what_runs() -> None:
    """Where NumPy and SciPy bring their OpenBLAS, the oldest kernels are never a CPU's own; NumPy's loops likewise."""
    own, oldest = kernels.probed({}), kernels.probed({"OPENBLAS_CORETYPE": "Prescott"})
    assert own.count(", ") == 2
    if "no OpenBLAS" not in own:
        assert oldest.split(", ")[:2] != own.split(", ")[:2]
    assert oldest.split(", ")[2] == own.split(", ")[2]
    plain = kernels.probed(kernels.variants(kernels.CORES)["NumPy without AVX512, AVX2 and FMA3"])
    assert plain == ", ".join([*own.split(", ")[:2], "baseline"])


@pytest.mark.usefixtures("surroundings")
def test_a_kernel_that_is_none_is_named_and_skipped(monkeypatch, capsys) -> None:
    """SkylakeX dies of an unknown instruction, Zen is Haswell again, Nehalem has a failing test."""
    what = {"Haswell": "h", "SkylakeX": "exit -4", "Zen": "h", "Nehalem": "n", "Prescott": "p"}
    ran = []

    def run(_, env, **_how):
        core = env.get("OPENBLAS_CORETYPE")
        ran.append(core)
        return SimpleNamespace(returncode=int(core == "Nehalem"), stdout=f"tests under {core}", stderr="")

    monkeypatch.setattr(kernels, "probed", lambda chosen: what.get(chosen.get("OPENBLAS_CORETYPE"), str(chosen)))
    monkeypatch.setattr(kernels.subprocess, "run", run)
    assert kernels.main(["tests/exact"]) == 1
    assert Counter(ran) == {"Haswell": 1, "Nehalem": 1, "Prescott": 1, None: 2}  # two at a time, so in any order
    said = capsys.readouterr().out
    assert "OpenBLAS Nehalem: n\ntests under Nehalem\n" in said
    assert "OpenBLAS SkylakeX: skipped, this CPU cannot run it (exit -4)" in said
    assert "OpenBLAS Zen: skipped, it is h, as OpenBLAS Haswell" in said
    assert "failures under OpenBLAS Nehalem" in said


def test_only_files_with_a_marked_test_are_loaded() -> None:
    """Those that pytest itself chooses by the mark."""
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "--collect-only", "-m", "kernels", "tests/reduced"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    files = {str(Path(file).relative_to(ROOT)) for file in kernels.with_the_mark([str(ROOT / "tests" / "reduced")])}
    assert {line.partition("::")[0] for line in listed if "::" in line} == files
    assert 0 < len(files) < 5


def test_each_place_is_changed_once_and_said():
    text = "def f(a, b):\n    if a < 2 and b == 0:\n        return a * b\n    return a + 0.5\n"
    changed = set()
    for number in range(len(places(ast.parse(text)))):
        tree = ast.parse(text)
        line, said = change(places(tree)[number])
        (where,) = [n for n, both in enumerate(zip(text.splitlines(), ast.unparse(tree).splitlines(), strict=True), 1)
                    if both[0] != both[1]]  # fmt: skip
        assert where == line
        before, after = said.split("  ->  ")
        assert before in ast.unparse(ast.parse(text))
        assert after in ast.unparse(tree)
        changed.add(ast.unparse(tree).splitlines()[line - 1].strip())
    assert changed == {
        "if a < 2 or b == 0:", "if a >= 2 and b == 0:", "if a < 2 and b != 0:", "if a < 3 and b == 0:",
        "if a < 2 and b == 1:", "return a / b", "return a - 0.5", "return a + 0.75",
    }  # fmt: skip


def test_a_mutant_of_a_file_is_that_file_but_for_one_line(tmp_path):
    path = tmp_path / "room.py"
    path.write_text("ONE = 1\n\n\ndef double(x):\n    return 2 * x\n")
    assert mutant(path, 0) == ("ONE = 1\n\ndef double(x):\n    return 2 / x", 5, "2 * x  ->  2 / x")


def test_the_tests_that_call_the_changed_function_come_first_the_short_ones_before_the_long(tmp_path):
    path = tmp_path / "tfarm" / "room" / "file.py"
    path.parent.mkdir(parents=True)
    path.write_text("def outer():\n    @twice\n    def inner():\n        return 1\n    return inner() + 1\n")
    outer, inner = function_of(path, 5), function_of(path, 4)
    assert (outer, inner) == ("tfarm/room/file.py:1", "tfarm/room/file.py:2")
    tests = {"long": (2.0, [inner]), "short": (1.0, [outer, inner]), "shortest": (0.5, [outer]), "other": (0.1, [])}
    assert sorted(tests, key=lambda each: order(*tests[each], inner)) == ["short", "long", "other", "shortest"]
