"""Do the tests of a room see a mistake?  python -m tests.mutants SIZE [SEED] [room ...]

In each room SIZE places are drawn of an operator, a comparison or a number; one after the other is changed,
in a copy of the project, and the room's own tests are run until one fails, those first that call the changed function.
Survivors are printed, to be read: some change nothing that matters (a number of steps, a tolerance with room), the
others want a test.  A change in `exact` costs the compilation of its kernels.

To pytest this module is a plugin: with CALLS_TO each test's seconds and the functions of tfarm that it calls go to that
file, with CALLS_FROM the tests that call the function CALLED ("tfarm/room/file.py:LINE", its first line) come first,
short ones before long ones.  What numba has compiled calls unseen.
"""

import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("spectrum", "crossing", "loop", "dsp", "synthesis", "tuner", "exact")
SWAPS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.GtE, ast.LtE: ast.Gt,
    ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
PATIENCE = 900  # seconds for a room's tests


def places(tree):
    """Every node that can be changed, inside functions."""
    bodies = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    found = []
    for node in {id(each): each for body in bodies for line in body.body for each in ast.walk(line)}.values():
        operator = getattr(node, "op", None) or (getattr(node, "ops", None) or [None])[0]
        is_number = isinstance(node, ast.Constant) and type(node.value) in (int, float)
        if type(operator) in SWAPS or is_number:
            found.append(node)
    return sorted(found, key=lambda node: (node.lineno, node.col_offset, type(node).__name__))


def change(node):
    """Change a node in place; return its line, and the text before and after."""
    before = ast.unparse(node)
    if isinstance(node, ast.Constant):
        node.value = node.value + 1 if isinstance(node.value, int) else node.value * 1.5 + (node.value == 0)
    elif hasattr(node, "ops"):
        node.ops[0] = SWAPS[type(node.ops[0])]()
    else:
        node.op = SWAPS[type(node.op)]()
    return node.lineno, f"{before}  ->  {ast.unparse(node)}"


def mutant(path, number):
    """The text of a file with its place of that number changed, the line, and the change."""
    tree = ast.parse(path.read_text())
    line, change_made = change(places(tree)[number])
    return ast.unparse(tree), line, change_made


def function_of(path, line):
    """The innermost function around a line: its file from the root and its first line, with its decorators."""
    defined = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]
    around = [node for node in defined if node.lineno <= line <= node.end_lineno]
    inner = max(around, key=lambda node: node.lineno)
    first = min(each.lineno for each in (inner, *inner.decorator_list))
    return f"{path.parent.parent.name}/{path.parent.name}/{path.name}:{first}"


def all_pass(copy, room, **named):
    """Whether the room's tests in the copy all pass; `named` are variables of the plugin."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", "-p", "tests.mutants"]
    command.append(f"tests/{room}")
    environment = os.environ | {"PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1"} | named
    try:
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def drawn(folder, size, rng):
    """Places in the files of a room: pairs of a path and a number."""
    every = [(path, n) for path in sorted(folder.glob("*.py")) for n in range(len(places(ast.parse(path.read_text()))))]
    return rng.sample(every, min(size, len(every)))


def survey(size, seed, rooms):
    """How many were killed in each room, and how many there were."""
    rng, tally = random.Random(seed), {}
    with tempfile.TemporaryDirectory() as folder:
        copy, calls = Path(folder) / "copy", str(Path(folder) / "calls.json")
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".git", ".venv", "reports", ".mypy_cache"))
        for room in rooms:
            if not all_pass(copy, room, CALLS_TO=calls):
                raise SystemExit(f"tests/{room} fail before anything is changed")
            chosen, killed = drawn(copy / "tfarm" / room, size, rng), 0
            for path, number in chosen:
                whole, (text, line, change_made) = path.read_text(), mutant(path, number)
                called = function_of(path, line)
                path.write_text(text)
                alive = all_pass(copy, room, CALLS_FROM=calls, CALLED=called)
                path.write_text(whole)
                killed += not alive
                if alive:
                    print(f"survives: {path.relative_to(copy)}:{line} {change_made}", flush=True)
            tally[room] = killed, len(chosen)
            print(f"{room}: {killed} of {len(chosen)} killed", flush=True)
    return tally


TO, FROM = os.environ.get("CALLS_TO"), os.environ.get("CALLS_FROM")
calls = {}  # of each test's name: its seconds, and the functions that it calls


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    codes, begun = set(), time.perf_counter()
    if TO:
        sys.setprofile(lambda frame, event, _: codes.add(frame.f_code) if event == "call" else None)
    try:
        return (yield)
    finally:
        sys.setprofile(None)
        own = {f"{code.co_filename.removeprefix(f'{ROOT}{os.sep}')}:{code.co_firstlineno}" for code in codes}
        calls[item.nodeid] = time.perf_counter() - begun, sorted(each for each in own if each.startswith("tfarm"))


def pytest_sessionfinish():
    if TO:
        Path(TO).write_text(json.dumps(calls), encoding="utf-8")


def pytest_collection_modifyitems(items):
    if FROM:
        known = json.loads(Path(FROM).read_text(encoding="utf-8"))
        items.sort(key=lambda item: order(*known.get(item.nodeid, (0.0, []))))


def order(seconds, functions):
    return os.environ["CALLED"] not in functions, seconds


if __name__ == "__main__":
    numbers = [int(each) for each in sys.argv[1:] if each.isdigit()]
    named = [each for each in sys.argv[1:] if not each.isdigit()]
    survey(*(numbers + [40, 2026][len(numbers) :]), named or ROOMS)
