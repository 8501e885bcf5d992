"""Plausible arms through the command line, judged by a model that shares nothing with tfarm (`model`).

    python -m tests.plausible.survey SIZE SEED [verb ...]

Steel to rubber, 5 cm to 10 m, L/h 5 to 300, rectangles, rods and tubes, hub 1e-2 to 1e2 and payload 0 to 1e2 times the
beam's, first damping ratio 1e-4 to 2e-2 or C = 0.  An answer is wrong where a check of the model fails, where the
command crashes, or says on standard error what is not tfarm's.  Budget: 2 CPU s an arm for all verbs.
"""

import contextlib
import io
import json
import tempfile
import time
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path

from tests import survey
from tests.plausible import judges
from tests.plausible.arms import draw
from tests.survey import Finding
from tfarm.cli import main

VERBS = {
    "modes": judges.Modes(),
    "response": judges.Response(),
    "poles": judges.Poles(),
    "margins": judges.Margins(),
}


@dataclass(frozen=True)
class Ran:
    """What came of one command; `code` is 1 where it raised."""

    code: int
    answer: dict | None
    error: str
    seconds: float


def run(arguments):
    """Run `tfarm *arguments --json`."""
    out, err, start = io.StringIO(), io.StringIO(), time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("always")
        try:
            main([*arguments, "--json"])
        except SystemExit as stop:
            code = int(stop.code or 0)
        except Exception:  # a crash is a finding of the survey, not its end
            traceback.print_exc()
            code = 1
    return Ran(code, json.loads(out.getvalue()) if code == 0 else None, err.getvalue(), time.process_time() - start)


def judged(verb, number, seed, terms=(judges.ROUGH, judges.FINE)):
    """The finding on the arm of that number, by models of so many Legendre terms."""
    case = draw(number, seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.toml"
        path.write_text(case.toml)
        options = VERBS[verb].arguments(case)
        ran = run([verb, str(path), *options])
    where = f"arm {number} of seed {seed}: tfarm {verb} arm.toml {' '.join(options)}\n{case.toml}"
    noise = [line for line in ran.error.splitlines() if not line.startswith("tfarm: ")]
    if ran.code in (2, 3) and not noise:
        return Finding("refused", f"{ran.error.strip()} {where}", figures={"CPU s": ran.seconds})
    if ran.code or noise:
        return Finding("wrong", f"exit {ran.code}: {' | '.join(noise[-3:])} {where}", is_wrong=True)
    found = VERBS[verb].judge(case, judges.Models(case.beam, *terms), ran)
    figures = {"CPU s": ran.seconds, "worst error": found.worst, "checks": found.checks, "blind": found.blind}
    words = f"{'; '.join(found.wrong[:3])} {where}" if found.wrong else ""
    return Finding("wrong" if found.wrong else "answered", words, bool(found.wrong), figures)


def survey_of(verb):
    """The survey of one command."""

    def findings(size, seed):
        return (judged(verb, number, seed) for number in range(size))

    findings.__name__ = verb
    return findings


if __name__ == "__main__":
    survey.main(*map(survey_of, VERBS), size=50, seed=2012)
