"""The answers of some hundred commands, kept in answers/, and how far another answer may lie from them.

Keys, units, verdicts and whole numbers are compared exactly, prose not at all, a float to `TOLERANCE` or that of
`LOOSER`.  Of a search (design, fit, tune) only the verdict and the score count: where the optimum lies hangs on
the last bits.
"""

import contextlib
import io
import json
import math
import re
import tempfile
from pathlib import Path

from tfarm.cli import main

HERE = Path(__file__).parent
TOLERANCE = 1e-8  # relative, of what is well conditioned: a frequency, a pole, a margin, an edge
MOST_ITEMS = 40  # of a list that is kept whole
ROW_NAMES = ("quantity", "branch", "mode", "number", "output")  # keys that name a row
KEPT_ITEMS = 8  # of a longer one, evenly spread
PHRASES = re.compile(r"(^|[._])(verdict|method|objective|structure|units?(\.\w+)?(\[\])?|theory|name)$")  # no prose
SEARCHES = {"design": "value", "tune": "cost_tuned", "fit": "chi_squared"}  # what a search is judged by
LARGER_IS_BETTER = ("--objective damping", "--objective margin")
SPREAD = 1e-3  # of a score, relative, over the kernels of BLAS; it may improve

# Command and path, relative tolerance, and whether it is relative to the largest number of its list; the first match.
LOOSER = (
    (r".*(poles|eigenvalue|zeros|value|residue)s?\[\]\[\]", TOLERANCE, True),  # [real, imaginary]
    (r"reduce D\[\]\[\]", 2e-5, True),  # what fitted tails, known to 5e-9, leave of static terms 4,000 times as large
    (r"reduce [A-D]\[\]\[\]", TOLERANCE, True),  # a matrix: its small entries are sums of large ones
    (r"locus branch_list\[\]\.gap", 1e-2, False),  # what rounding the polynomials of python-control leaves
    (r"locus .*\.gap", 1e-6, False),  # the difference of poles a hundred million times as large
    (r"reduce .*error", 1e-4, False),  # the difference of two responses that agree to 1e-10
    (r"locus first_mode_most_damped\.gain", 1e-6, False),  # as the next
    (r"reduce .*worst_at_rad_s", 1e-4, False),  # the place of a maximum: half of the four digits of its size
    (r"norm .*upper_bound", 1e-5, False),  # rounded up to six digits
    (r"norm gap", 1e-1, False),  # what is left of them: some 1e-3
    (r".*_at_rad_s", 1e-6, False),  # the place of a maximum: half of the digits; seven are given
    (r"step .*\.peak_time_s", 1e-6, False),  # the time of a maximum: half of the digits
    (r"sampled minimum_damping_s\.value", 1e-6, False),  # solved for to 4e-7
)


def commands(left_out=True):
    """The lines of commands.txt; those without a "*" only with `left_out`."""
    lines = [line for line in (HERE / "commands.txt").read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    return [line.removesuffix(" *") for line in lines if left_out or line.endswith(" *")]


def words_of(line):
    """The words of a command, a file's name as its path."""
    for word in line.split():
        option, equals, name = word.rpartition("=")
        of_data = HERE.parent / name if name.startswith("data/") else HERE / "files" / name
        yield f"{option}{equals}{of_data}" if of_data.is_file() else word


def answer_of(line):
    """What the command prints with --json, long lists thinned; FOLDER is a new one.  AssertionError where it fails."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), tempfile.TemporaryDirectory() as folder:
        try:
            main([*(folder if word == "FOLDER" else word for word in words_of(line)), "--json"])
        except SystemExit as stop:
            if stop.code:
                raise AssertionError(f"{line}: exit code {stop.code}, {err.getvalue()}") from stop
    return thinned(json.loads(out.getvalue().replace(str(HERE.parent), "tests")))


def thinned(value):
    """The same with some items of each long list, and how many there are."""
    if isinstance(value, dict):
        return {key: thinned(each) for key, each in value.items()}
    if not isinstance(value, list):
        return value
    if len(value) <= MOST_ITEMS:
        return [thinned(each) for each in value]
    some = [round(i * (len(value) - 1) / (KEPT_ITEMS - 1)) for i in range(KEPT_ITEMS)]
    return {"items": len(value), "some": [thinned(value[i]) for i in some]}


def file_of(line):
    """Where a command's answer is kept."""
    return HERE / "answers" / (re.sub(r"[^\w.+-]+", "_", line.replace("--", "")) + ".json")


def kept(line):
    return json.loads(file_of(line).read_text(encoding="utf-8"))


def keep(line, answer):
    """Write an answer, a line for each key."""
    lines = ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in answer.items())
    file_of(line).write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def differences(line, before, now):
    """What differs by more than it may: a list of "path: before, now".  Keys that are new are no difference."""
    command = line.split()[0]
    if command in SEARCHES:
        return list(_of_search(line, before, now))
    return [*_differences(line, dict(flat(before)), dict(flat(now)))]


def _of_search(line, before, now):
    """The differences of a search: its keys, its verdict, and a score that has become worse."""
    score, sign = SEARCHES[line.split()[0]], -1 if any(each in line for each in LARGER_IS_BETTER) else 1
    if lost := before.keys() - now.keys():
        yield f"keys: {sorted(lost)}"
    if before.get("verdict") != now.get("verdict"):
        yield f"verdict: {before.get('verdict')}, {now.get('verdict')}"
    if sign * (now[score] - before[score]) > SPREAD * abs(before[score]):
        yield f"{score}: {before[score]}, {now[score]}"


def flat(value, path="", scale=0.0):
    """Path, and value with the size of the list that it is in, of every entry.

    A row of a table is called by the first of `ROW_NAMES` that it has, not by its number.
    """
    if isinstance(value, dict) and value:
        for key, each in value.items():
            yield from flat(each, f"{path}.{key}".lstrip("."))
    elif isinstance(value, list) and value:
        size = max((abs(each) for each in value if _is_number(each)), default=0.0)
        for number, each in enumerate(value):
            yield from flat(each, f"{path}[{_row_name(each, number)}]", max(size, scale))
    else:
        yield path, (value, scale)


def _row_name(row, number):
    """What a row of a table is called, or its number."""
    keys = [key for key in ROW_NAMES if key in row] if isinstance(row, dict) and "omega_rad_s" not in row else []
    return row[keys[0]] if keys else number


def _differences(line, before, now):
    """The differences of two flat answers."""
    for path, (old, scale) in before.items():
        if path not in now:
            if old not in (None, [], {}):
                yield f"{path}: is not there"
            continue
        new, size = now[path]
        if isinstance(old, float) and _is_number(new):
            tolerance, of_list = allowed(line.split()[0], re.sub(r"\[[^\]]*\]", "[]", path))
            if abs(old - new) > tolerance * max(abs(old), abs(new), max(scale, size) * of_list):
                yield f"{path}: {old!r}, {new!r}"
        elif not _are_alike(re.sub(r"\[[^\]]*\]", "[]", path), old, new):
            yield f"{path}: {old!r}, {new!r}"


def _is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _are_alike(path, before, now):
    """Whether two values that are no floats are equal; of prose, whether there is some."""
    if isinstance(before, str) and isinstance(now, str) and " " in before and not PHRASES.search(path):
        return bool(now)
    return type(before) is type(now) and before == now


def allowed(command, path):
    """The relative tolerance of a float, and whether it is relative to the largest of its list."""
    for pattern, tolerance, of_list in LOOSER:
        if re.fullmatch(pattern, f"{command} {path}"):
            return tolerance, of_list
    return TOLERANCE, False
