"""Tables in narrow terminals: every character of every cell is there, whatever the width."""

import cProfile
import os
import pty
import re
import sys
from dataclasses import replace

import pytest

from tfarm.digits import TEXTS
from tfarm.schema import Column, Table
from tfarm.schema.terminal import first_and_last, show_text, table_lines

COLUMNS = (
    Column("mode", "mode", of=["1", "2"]),
    Column("omega", "natural frequency rad/s", of=["71.505682466890", "204.33313936381"]),
    Column("eigenvalue", "eigenvalue", of=["-0.2556+71.505i", "-2.0869+204.32i"]),
    Column("note", "what is noted on it", of=["lightly damped, and the first of all there are", "-"], folds=True),
)


def printed(width, columns=COLUMNS):
    return table_lines(Table(columns=columns), width)


def test_in_a_pipe_only_a_long_text_is_folded():
    text = "lightly damped " * 9
    lines = printed(None, (*COLUMNS[:3], replace(COLUMNS[3], of=[text, "-"])))
    assert max(map(len, lines)) <= 120
    assert [line.split()[0] for line in lines if line[:4].strip()] == ["mode", "1", "2"]
    numbers = [Column(str(n), "frequency", of=["71.505682466890"]) for n in range(20)]
    assert len(printed(None, numbers)) == 2  # a row of numbers is one line, however long


def test_blocks_begin_with_every_leading_column():
    table = Table(columns=COLUMNS, leading=2)
    lines = table_lines(table, 50)
    assert [line.split()[:2] for line in lines if line.startswith("1")] == [["1", "71.505682466890"]] * 2


def words(lines):
    return sorted(" ".join(lines).split())


@pytest.mark.parametrize("width", [100, 80, 60, 50, 40])
def test_no_word_is_cut_and_no_line_is_too_long(width):
    lines = printed(width)
    assert max(map(len, lines)) <= width
    whole = words(printed(sys.maxsize))
    repeated = [word for word in words(lines) if word not in ("mode", "1", "2")]
    assert repeated == [word for word in whole if word not in ("mode", "1", "2")]


def test_columns_that_do_not_fit_are_below_with_the_first_one():
    lines = printed(50, (*COLUMNS[:3], replace(COLUMNS[3], folds=False)))
    assert lines.count("") == 1
    blank = lines.index("")
    assert [line.split()[0] for line in lines[blank - 2 : blank]] == ["1", "2"]
    assert [line.split()[0] for line in lines[-2:]] == ["1", "2"]


def test_a_table_without_rows_has_its_titles():
    assert printed(80, (Column("a", "a", of=[]), Column("b", "b", of=[]))) == ["a  b"]


def points(number, digits=TEXTS):
    """A table of that many points with three columns of numbers."""
    values = list(range(1, number + 1))
    return Table(columns=tuple(Column(key, key, "rad/s", of=values, digits=digits) for key in "abc"))


def test_of_many_points_the_first_and_the_last_are_shown():
    table, words = first_and_last(points(1000))
    lines = table_lines(table, 80)
    ends = [*range(1, 21), *range(981, 1001)]
    assert [line.split() for line in lines[1:21] + lines[22:]] == [[str(each)] * 3 for each in ends]
    assert lines[21].split() == ["...", "960", "rows", "...", "..."]
    assert words == "rows left out: 960 of 1000; --csv FILE writes all"
    assert len({len(line) for line in lines}) == 1
    for whole in (points(41), points(1), points(0)):
        assert first_and_last(whole) == (whole, "")


def test_no_more_cells_are_formatted_than_are_shown():
    formatted = []

    def digits(values):
        formatted.extend(values)
        return TEXTS(values)

    first_and_last(points(100_000, digits))
    assert len(formatted) == 3 * 40


@pytest.mark.parametrize("width", [sys.maxsize, 20])
def test_twice_the_rows_take_twice_the_calls(width):
    """Of every Python function, in the width of all columns and in blocks one below the other."""

    def calls(number):
        table, profile = points(number), cProfile.Profile()
        profile.runcall(table_lines, table, width)
        return sum(each.callcount for each in profile.getstats())

    assert calls(400) < 3 * calls(200)  # four times as many where each cell asks the whole column


BOTH = """
import pickle, sys
from tfarm.audit import paper
with open(sys.argv.pop(), "rb") as file:
    rows = pickle.load(file)
paper.audit = lambda: rows
from tfarm.cli.running import run
for words in (["modes", "sasaki2012-lab", "--count", "3"], ["proof", "audit"]):
    assert run(words) == 0
    print("----")
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
    text, rows, _ = in_a_terminal("-c", BOTH, str(audit_file)).split("----\n")
    assert max(map(len, re.findall(r"^ .*$", text, flags=re.MULTILINE))) <= 80
    for number in ("71.5056824669", "11.3804828", "-0.2556456155+71.50522553i", "0.00357518", "1332.3"):
        assert number in text
    assert "…" not in rows
    assert len(re.findall(r"^ *\S.*  (confirmed|corrected|contradictory|\w+)", rows, flags=re.MULTILINE)) >= 23


def test_a_long_line_of_text_is_folded_on_a_terminal_and_whole_in_a_pipe(monkeypatch, capsys):
    line = (
        "by default K1 = 0.0106 V s/rad (0.00642 J w1 of this arm) and K2 = 2.34 V/(N m), through the motor's voltage"
    )
    show_text(line)
    assert capsys.readouterr().out == f"{line}\n"
    monkeypatch.setattr("tfarm.schema.terminal.terminal_width", lambda: 80)
    show_text(line)
    first, second = capsys.readouterr().out.splitlines()
    assert (f"{first} {second}", max(len(first), len(second)) <= 80) == (line, True)
