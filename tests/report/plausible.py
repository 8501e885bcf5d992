"""Is every plausible arm reported on, and does no sentence of its pages contradict a number?

    python -m tests.report.plausible SIZE SEED

SIZE arms drawn at random (steel to rubber, 5 cm to 10 m, L/h 5 to 300, rectangles and tubes, hub 1e-2 to 1e2 and
payload 0 to 1e2 times the beam's, damping ratio 1e-4 to 2e-2 in the first mode, or C = 0), the pages of each written
by a process of its own.  Budget: a minute or two of CPU an arm.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

import tfarm
from tests import survey
from tests.survey import Finding
from tfarm import Arm, Hub, Link, Payload, Section
from tfarm.arm import to_toml

MATERIALS = {  # density [kg/m^3], Young's modulus [Pa], Poisson's ratio
    "steel": (7850.0, 2.1e11, 0.3),
    "aluminium": (2700.0, 7.0e10, 0.33),
    "CFRP": (1600.0, 1.2e11, 0.3),
    "titanium": (4430.0, 1.14e11, 0.34),
    "nylon": (1150.0, 2.5e9, 0.4),
    "rubber": (1100.0, 5.0e6, 0.49),
}
WRITE = (
    "import sys; from pathlib import Path; import tfarm; from tfarm.report import write; "
    "from tfarm.report.pieces import QUESTIONS; "
    "write([tfarm.load(sys.argv[1])], Path(sys.argv[2]), only=tuple(QUESTIONS), notice=print)"
)
LONGEST = 1800.0  # s that one arm may take, on a machine that others use too


def some_arm(rng: np.random.Generator, name: str) -> Arm:
    """A plausible arm."""

    def log(low: float, high: float) -> float:
        return float(f"{10 ** rng.uniform(math.log10(low), math.log10(high)):.4g}")

    density, E, nu = MATERIALS[str(rng.choice(list(MATERIALS)))]
    length = log(0.05, 10.0)
    depth = float(f"{length / log(5.0, 300.0):.4g}")
    if rng.random() < 0.5:
        section = Section.rectangle(width=depth * log(0.5, 20.0), depth=depth)
    else:
        section = Section.tube(outer_diameter=depth, inner_diameter=depth * float(rng.uniform(0.5, 0.95)))
    link = Link.isotropic(length=length, density=density, youngs_modulus=E, poissons_ratio=nu, section=section)
    mass = link.rhoA * length
    payload = Payload() if rng.random() < 0.4 else Payload(mass=mass * log(1e-2, 1e2))
    arm = Arm(link=link, hub=Hub(inertia=mass * length**2 / 3 * log(1e-2, 1e2)), payload=payload, name=name)
    ratio = 0.0 if rng.random() < 0.3 else log(1e-4, 2e-2)
    C = 2 * ratio / float(tfarm.modes(arm, 1).natural_frequency[-1])
    return replace(arm, link=replace(link, damping=float(f"{C:.3g}")))


class Words(HTMLParser):
    """The text of a page, and the pictures that it names."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.text, self.pictures = "", list[str]()
        self._hidden = 0
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._hidden += tag in ("style", "footer")
        if tag == "img":
            self.pictures.append(str(dict(attrs)["src"]))

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in ("style", "footer")

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self.text += data


def contradictions(folder: Path) -> list[str]:
    """What is wrong with an arm's pages: sentences against the tables beside them."""
    found = []
    for page in sorted(folder.glob("*.html")):
        words = Words(page)
        found += [
            f"{page.name}: {picture} is not there" for picture in words.pictures if not (folder / picture).is_file()
        ]
        found += [f"{page.name}: {odd[0]!r}" for odd in re.finditer(r"\bnan\b|Traceback|\d[eE][-+]\d\d", words.text)]
    return [*found, *_of_the_loop(folder)]


def _of_the_loop(folder: Path) -> list[str]:
    found = [
        f"{row['law']}: {row['unstable_by_nyquist']} by Nyquist, {row['unstable_in_box']} in a box"
        for row in _rows(folder, "nyquist-count")
        if not row["on_axis_in_box"] and row["unstable_by_nyquist"] != row["unstable_in_box"]
    ]
    edges = [
        float(str(row["stable_around_it"]).split()[1])
        for row in _rows(folder, "windows")
        if (row["law"], row["gain"]) == ("default gains", "K2") and not str(row["stable_around_it"]).startswith("none")
    ]
    found += [
        f"K2 = {row['K2']} is {row['verdict']}, below the edge at {edge}"
        for edge in edges
        for row in _rows(folder, "beyond")
        if float(row["K2"]) < edge * (1 - 1e-9) and row["verdict"] != "stable"
    ]
    return found


def _rows(folder: Path, stem: str) -> list[dict[str, float | str]]:
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
        arm = some_arm(np.random.default_rng([seed, number]), f"plausible-{seed}-{number}")
        with tempfile.TemporaryDirectory() as folder:
            seconds, wrong, left_out = report_on(arm, Path(folder))
        words = "\n  ".join([arm.name, *wrong, *left_out]) if wrong else ""
        yield Finding("wrong" if wrong else "right", words, bool(wrong), {"seconds": seconds})


if __name__ == "__main__":
    survey.main(arms)
