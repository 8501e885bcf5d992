"""Is every plausible arm reported on, and does no sentence of its pages contradict a number?

    python -m tests.report.plausible SIZE SEED

SIZE arms drawn at random by tests/strategies.py, the pages of each written by a process of its own.
Budget: a minute or two of CPU an arm.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tests import survey
from tests.report.written import Links
from tests.strategies import some_arm
from tests.survey import Finding
from tfarm import Arm
from tfarm.arm import to_toml

WRITE = (
    "import sys; from pathlib import Path; import tfarm; from tfarm.report import write; "
    "from tfarm.report.sections import QUESTIONS; "
    "write([tfarm.load(sys.argv[1])], Path(sys.argv[2]), only=tuple(QUESTIONS), notice=print)"
)
BY_NYQUIST = "unstable poles by Nyquist's criterion"
LONGEST = 1800.0  # s that one arm may take, on a machine that others use too


def contradictions(folder: Path) -> list[str]:
    """Contradictions on an arm's pages between sentences and tables."""
    found = []
    for page in sorted(folder.glob("*.html")):
        pictures = [each for each in Links(page).targets if each.endswith(".svg")]
        found += [f"{page.name}: {each} is not there" for each in pictures if not (folder / each).is_file()]
        text = re.sub(r"<(style|footer).*?</\1>|<[^>]*>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        found += [f"{page.name}: {odd[0]!r}" for odd in re.finditer(r"\bnan\b|Traceback|\d[eE][-+]\d\d", text)]
    return [*found, *_of_the_loop(folder)]


def _of_the_loop(folder: Path) -> list[str]:
    return [
        f"{law}: {of[BY_NYQUIST]} by Nyquist, {of['unstable poles']} in a box"
        for law, of in _across(folder, "nyquist-count").items()
        if not of["poles on the axis to working precision"] and of[BY_NYQUIST] != of["unstable poles"]
    ]


def _across(folder: Path, stem: str) -> dict[str, dict[str, Any]]:
    """The quantities of each law in a table with a column a law."""
    rows = _rows(folder, stem)
    laws = [key for key in rows[0] if key not in ("quantity", "unit")] if rows else []
    return {law: {row["quantity"]: row[law] for row in rows} for law in laws}


def _rows(folder: Path, stem: str) -> list[dict[str, Any]]:
    """The rows of a table's file; none where there is no such table."""
    file = folder / "data" / f"{stem}.json"
    return json.loads(file.read_text(encoding="utf-8"))["rows"] if file.is_file() else []


def report_on(arm: Arm, folder: Path) -> tuple[float, list[str], list[str]]:
    """Seconds, what is wrong, and the sections left out, of the pages of one arm."""
    file = folder / "arm.toml"
    file.write_text(to_toml(arm), encoding="utf-8")
    start = time.perf_counter()
    command = [sys.executable, "-c", WRITE, str(file), str(folder / "out")]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LONGEST, check=False,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return LONGEST, [f"not done after {LONGEST:g} s"], []
    wrong = [f"exit {done.returncode}"] * (done.returncode != 0)
    wrong += [line for line in done.stderr.splitlines()[-3:] if line]
    if not wrong:
        wrong = contradictions(folder / "out" / arm.name)
    return time.perf_counter() - start, wrong, done.stdout.splitlines()


def arms(size, seed):
    """Of each arm what is wrong, and what was left out."""
    for number in range(size):
        arm = some_arm(np.random.default_rng([seed, number]), ("some", "some", "zero"), slenderness=(5, 300))
        arm = replace(arm, name=f"plausible-{seed}-{number}")
        with tempfile.TemporaryDirectory() as folder:
            seconds, wrong, left_out = report_on(arm, Path(folder))
        words = "\n  ".join([arm.name, *wrong, *left_out]) if wrong else ""
        yield Finding("wrong" if wrong else "right", words, bool(wrong), {"seconds": seconds})


if __name__ == "__main__":
    survey.main(arms)
