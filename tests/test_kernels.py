"""That `make kernels` runs what it says it runs.

The sampler of mutants changes what it says, once.
"""

import ast
import subprocess
import sys
from pathlib import Path

from tests import kernels
from tests.callers import order
from tests.mutants import change, function_of, places

ROOT = Path(__file__).parent.parent


def test_what_is_chosen_is_what_runs() -> None:
    """Where NumPy and SciPy bring their OpenBLAS, the oldest kernels are never a CPU's own; NumPy's loops likewise."""
    own, oldest = kernels.probed({}), kernels.probed({"OPENBLAS_CORETYPE": "Prescott"})
    assert own.count(", ") == 2
    if "no OpenBLAS" not in own:
        assert oldest.split(", ")[:2] != own.split(", ")[:2]
    assert oldest.split(", ")[2] == own.split(", ")[2]
    plain = kernels.probed(kernels.variants(kernels.CORES)["NumPy without AVX512, AVX2 and FMA3"])
    assert plain == ", ".join([*own.split(", ")[:2], "baseline"])


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


def test_the_tests_that_call_the_changed_function_come_first_the_short_ones_before_the_long(tmp_path):
    path = tmp_path / "tfarm" / "room" / "file.py"
    path.parent.mkdir(parents=True)
    path.write_text("def outer():\n    @twice\n    def inner():\n        return 1\n    return inner() + 1\n")
    outer, inner = function_of(path, 5), function_of(path, 4)
    assert (outer, inner) == ("tfarm/room/file.py:1", "tfarm/room/file.py:2")
    tests = {"long": (2.0, [inner]), "short": (1.0, [outer, inner]), "shortest": (0.5, [outer]), "other": (0.1, [])}
    assert sorted(tests, key=lambda each: order(*tests[each], inner)) == ["short", "long", "other", "shortest"]
