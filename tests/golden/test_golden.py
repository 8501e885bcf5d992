"""No answer changes unseen: what commands print with --json has the keys, units, verdicts and numbers that are kept."""

import pytest

from tests.golden.answers import answer_of, commands, differences, file_of, kept, words_of

IN_TESTS = commands(left_out=False)


@pytest.mark.parametrize("line", IN_TESTS)
def test_a_command_has_the_kept_answer(line):
    """What is meant to change is kept anew: python -m tests.golden --keep."""
    assert differences(line, kept(line), answer_of(line)) == []


def test_each_command_has_an_answer_and_each_answer_a_command():
    assert sorted(path.name for path in file_of("x").parent.iterdir()) == sorted(
        file_of(line).name for line in commands()
    )


def test_the_files_of_commands_are_found():
    used = {word.rpartition("=")[2].rpartition("/")[2] for line in commands() for word in words_of(line)}
    assert {path.name for path in file_of("x").parent.with_name("files").iterdir()} <= used


@pytest.mark.parametrize(
    ("now", "path"),
    [
        ({"verdict": "unstable", "edge": 1.0, "note": "as it is", "poles": [[1e-9, 5.0]]}, "verdict"),
        ({"verdict": "stable", "edge": 1.0 + 3e-8, "note": "as it is", "poles": [[1e-9, 5.0]]}, "edge"),
        ({"verdict": "stable", "edge": None, "note": "as it is", "poles": [[1e-9, 5.0]]}, "edge"),
        ({"verdict": "stable", "edge": 1.0, "note": None, "poles": [[1e-9, 5.0]]}, "note"),
        ({"verdict": "stable", "edge": 1.0, "note": "as it is", "poles": [[1e-7, 5.0]]}, "poles[0][0]"),
        ({"verdict": "stable", "edge": 1.0, "note": "as it is", "poles": []}, "poles[0][0]"),
        ({"verdict": "stable", "edge": 1.0, "note": "as it is"}, "poles[0][0]"),
    ],
)
def test_a_change_is_seen(now, path):
    before = {"verdict": "stable", "edge": 1.0, "note": "in other words", "poles": [[0.0, 5.0]]}
    assert differences("margins x", before, now)[0].split(":")[0] == path


def test_a_search_may_improve_and_not_fall_back():
    before = {"verdict": "stable", "value": 0.1, "K1": 3.0}
    for value, worse in ((0.2, []), (0.09, ["value: 0.1, 0.09"])):
        found = differences("design x --objective damping", before, {"verdict": "stable", "value": value, "K1": 9.0})
        assert found == worse
        assert bool(differences("design x --objective residual", before, {**before, "value": value})) is not bool(worse)
