"""Tables in narrow terminals: every character of every cell is there, whatever the width."""

import os
import pty
import re
import sys

import pytest

from tfarm.cli.layout import Rows

COLUMNS = ("mode", "natural frequency rad/s", "eigenvalue", "what is said of it")


def table(fold=("what is said of it",)):
    rows = Rows(COLUMNS, fold)
    rows.add_row(1, "71.505682466890", "-0.2556+71.505i", "lightly damped, and the first of all there are")
    rows.add_row(2, "204.33313936381", "-2.0869+204.32i", "-")
    return rows


def words(lines):
    return sorted(" ".join(lines).split())


def test_in_a_pipe_a_row_is_a_line():
    lines = table().lines(sys.maxsize)
    assert len(lines) == 3
    assert len({len(line) for line in lines}) == 1


@pytest.mark.parametrize("width", [100, 80, 60, 50, 40])
def test_no_word_is_cut_and_no_line_is_too_long(width):
    lines = table().lines(width)
    assert max(map(len, lines)) <= width
    whole = words(table().lines(sys.maxsize))
    repeated = [word for word in words(lines) if word not in ("mode", "1", "2")]
    assert repeated == [word for word in whole if word not in ("mode", "1", "2")]


def test_what_does_not_fit_stands_below_beside_the_first_column():
    lines = table(fold=()).lines(50)
    blank = lines.index("")
    assert [line.split()[0] for line in lines[blank - 2 : blank]] == ["1", "2"]
    assert [line.split()[0] for line in lines[-2:]] == ["1", "2"]


def test_a_row_is_known_by_as_many_columns_as_it_takes():
    rows = Rows(("", "depth", "first frequency", "second frequency"), keys=2)
    rows.add_row("*", "0.006", "71.505682466890", "204.33313936381")
    assert [line.split() for line in rows.lines(30) if "*" in line] == [
        ["*", "0.006", "71.505682466890"],
        ["*", "0.006", "204.33313936381"],
    ]


def test_a_table_without_rows_has_its_titles():
    assert Rows(("a", "b")).lines(80) == ["a  b"]


WITH_ROWS = """
import pickle, sys
from tfarm.audit import paper
with open(sys.argv.pop(), "rb") as file:
    rows = pickle.load(file)
paper.audit = lambda: rows
from tfarm.cli import main
main()
"""


def in_a_terminal(*arguments):
    """What Python prints, run with these arguments, in a terminal of 80 columns."""
    pid, handle = pty.fork()
    if pid == 0:
        os.environ.update(COLUMNS="80", TERM="xterm")
        os.execv(sys.executable, [sys.executable, *arguments])
    text = b""
    try:
        while part := os.read(handle, 65536):
            text += part
    except OSError:  # the end, on Linux
        pass
    os.close(handle)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    return text.decode().replace("\r\n", "\n")


def test_modes_and_audit_answer_within_80_columns(audit_file):
    """All digits of all frequencies, in rad/s and Hz, and all verdicts; the same as in a pipe."""
    text = in_a_terminal("-m", "tfarm", "modes", "sasaki2012-lab", "--count", "3")
    assert max(map(len, re.findall(r"^ .*$", text, flags=re.MULTILINE))) <= 80
    for number in ("71.5056824669", "11.3804828", "-0.25564562 + 71.50522553i", "0.00357518", "1332.3"):
        assert number in text
    text = in_a_terminal("-c", WITH_ROWS, "audit", str(audit_file))
    assert "…" not in text
    assert len(re.findall(r"^ *\S.*  (confirmed|corrected|contradictory|\w+)", text, flags=re.MULTILINE)) >= 23
