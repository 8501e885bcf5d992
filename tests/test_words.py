"""Texts that a user reads are in the words of control and structural dynamics."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "tfarm"
UNUSED_WORDS = (
    "beside", "told", "tells?", "said", "says", "road", "clock", "stands", "so many", "cures?", "runs? away", "nobody",
    "mend(s|ed)?", "bears?", "led by", "leaves? apart",
)  # fmt: skip
UNUSED = re.compile(rf"\b({'|'.join(UNUSED_WORDS)})\b", re.IGNORECASE)
TEMPLATES = [path for path in PACKAGE.rglob("*") if path.suffix in (".html", ".js", ".css", ".md", ".txt")]
MODULES = sorted(PACKAGE.rglob("*.py"))


def strings(path: Path) -> list[tuple[int, str]]:
    """String constants with a space, docstrings left out, with their lines."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {
        id(node.value) for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }  # fmt: skip
    found = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return [(node.lineno, node.value) for node in found if id(node) not in docs and " " in node.value]


def test_strings_of_the_package_avoid_words_that_need_decoding() -> None:
    texts = [(path, *each) for path in MODULES for each in strings(path)]
    assert len(texts) > 1000
    found = [f"{path.relative_to(PACKAGE)}:{line}: {text!r}" for path, line, text in texts if UNUSED.search(text)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.name)
def test_templates_avoid_words_that_need_decoding(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    found = [f"{number}: {line.strip()}" for number, line in enumerate(lines, 1) if UNUSED.search(line)]
    assert not found, "\n".join(found)


def test_a_type_name_has_one_meaning() -> None:
    places = defaultdict(set)
    for path in MODULES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            match node:
                case ast.ClassDef(name=name) | ast.AnnAssign(target=ast.Name(id=name)):
                    places[name.lstrip("_")].add(path)
                case ast.Assign(targets=targets):
                    for target in targets:
                        places[getattr(target, "id", "").lstrip("_")].add(path)
    types = {name: where for name, where in places.items() if re.fullmatch(r"[A-Z][a-z]\w*", name)}
    assert len(types) > 300
    assert {name: where for name, where in types.items() if len(where) > 1} == {}
