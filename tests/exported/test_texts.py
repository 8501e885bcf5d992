"""Names and texts of a user in exported files: identifiers, comments and literals, compiled and parsed."""

import ast
import re
from dataclasses import replace

import pytest

from tests.exported.cases import GAINS, IDEAL, LAB, NOTCH, task_of
from tests.exported.compilers import build, needed, run
from tests.hostile import C_TEXTS, NAME
from tests.shared import thinned
from tfarm.exported.controller import c_controller
from tfarm.exported.result import write_into
from tfarm.exported.systems import list_literal, without_dots
from tfarm.exported.texts import comment, identifiers, matlab_text

KEYWORDS = ("int", "restrict", "class", "end", "lambda", "function", "_Bool", "None", "while")


def test_identifiers_are_distinct_short_and_no_keywords():
    names = [*KEYWORDS, *C_TEXTS, "strain@0.05", "strain@0.050", "Strain_0_05", "x" * 50, "x" * 51, "", "é", "1"]
    found = identifiers(names, "y_")
    assert list(found) == list(dict.fromkeys(names))
    assert len({each.lower() for each in found.values()}) == len(found)
    for each in found.values():
        assert re.fullmatch(r"y_[A-Za-z0-9_]{1,29}", each)
        assert len(each) <= 31
    assert found["strain@0.05"] == "y_strain_0_05"


@pytest.mark.parametrize("words", C_TEXTS)
def test_a_comment_is_one_line_that_ends_nothing(words):
    line = comment(words)
    assert line.isascii()
    assert line.isprintable()
    assert not re.search(r"\*/|/\*|\?\?/|\\|\n|\r", line)
    assert comment(line) == line


@pytest.mark.parametrize("words", C_TEXTS)
def test_literals_are_read_back(words):
    assert ast.literal_eval(list_literal([words])) == without_dots([words])
    quoted = matlab_text(words)
    assert quoted[0] == quoted[-1] == "'"
    assert "\n" not in quoted
    assert "'" not in quoted[1:-1].replace("''", "")


@pytest.mark.parametrize(
    ("words", "compiler"), [*thinned([(each, "gcc") for each in C_TEXTS], 6), (C_TEXTS[3], "clang")]
)
def test_hostile_names_compile_to_the_same_code(tmp_path, words, compiler):
    """Of controller and identifiers: a comment that ends, a trigraph, a line that continues, a keyword."""
    needed(compiler)
    plain = c_controller(task_of((LAB, NOTCH, IDEAL), name="x")).contents["controller.c"]
    law = replace(NOTCH, name=words)
    found = c_controller(task_of((replace(LAB, name=NAME), law, IDEAL), name=words))
    write_into(tmp_path, found.contents)
    assert run(build(tmp_path, compiler, *["-trigraphs"] * (compiler == "gcc"))).startswith(b"0 of 1000")
    own = next(each.identifier for each in found.names if each.name == words)
    code = found.contents["controller.c"].partition(b"\n")[2].replace(f"{own}_".encode(), b"x_")
    assert code == plain.partition(b"\n")[2]
    assert sorted(found.contents) == ["controller.c", "controller.h", "example.c", "self_test.c"]


def test_names_are_listed_with_their_identifiers():
    found = c_controller(task_of((LAB, GAINS, IDEAL), name="2nd axis"))
    assert found.names[0] == ("2nd axis", "n_2nd_axis")
    assert ("root_moment", "y_root_moment") in found.names
    assert b"int n_2nd_axis_step(" in found.contents["controller.h"]


def test_all_files_are_written_or_none(tmp_path):
    folder = tmp_path / "new" / "folder"
    with pytest.raises(TypeError):
        write_into(folder, {"a.c": b"a", "b.c": None})
    assert not (tmp_path / "new").exists()
    write_into(folder, {"a.c": b"a", "resources/b.c": b"b"})
    assert (folder / "resources" / "b.c").read_bytes() == b"b"
