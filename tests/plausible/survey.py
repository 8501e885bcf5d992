"""One arm after another through every verb, and what is printed of it."""

import math
import multiprocessing
import tempfile
import time
import traceback
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from tests.plausible import loops, samples, spectra
from tests.plausible.arms import draw
from tests.plausible.command import run

VERBS = {
    "modes": spectra.Modes(),
    "response": spectra.Response(),
    "reduce": spectra.Reduce(),
    "assumptions": spectra.Assumptions(),
    "poles": loops.Poles(),
    "margins": loops.Margins(),
    "map": loops.Map(),
    "locus": loops.Locus(),
    "design": loops.Design(),
    "sampled": samples.Sampled(),
    "simulate": samples.Simulate(),
    "tune": samples.Tune(),
}
FEW = {"tune": 50}  # of so many arms one is asked
SLOW = 10.0  # CPU s


@dataclass(frozen=True)
class Row:
    """One verb on one arm."""

    number: int
    verb: str
    arguments: tuple
    outcome: str  # answered, refused, wrong, stopped
    words: str
    seconds: float
    worst: float
    checks: int
    blind: int


def survey_one(number, seed, verbs, terms=(spectra.ROUGH, spectra.FINE)):
    """Every verb on the arm of that number, judged by models of so many Legendre terms."""
    case = draw(number, seed)
    models = spectra.Models(case.beam, *terms)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.toml"
        path.write_text(case.toml)
        asked = [verb for verb in verbs if number % FEW.get(verb, 1) == 0]
        return [ask(case, models, verb, str(path)) for verb in asked]


def ask(case, models, verb, path):
    """Run one command and have it judged."""
    judge = VERBS[verb]
    options = judge.arguments(case)
    ran = run([verb, path, *options])
    row = partial(Row, case.number, verb, (verb, "arm.toml", *options))
    noise = [line for line in ran.error.splitlines() if not line.startswith("tfarm: ")]
    if ran.code in (2, 3) and not noise:
        return row("refused", ran.error.strip(), ran.seconds, 0.0, 0, 0)
    if ran.code is None:
        return row("stopped", "no answer", ran.seconds, 0.0, 0, 0)
    if ran.code or noise:
        return row("wrong", f"exit {ran.code}: {' | '.join(noise[-3:])}", ran.seconds, 0.0, 0, 0)
    try:
        judged = judge.judge(case, models, ran)
    except Exception:  # the survey's own fault, to be mended there
        return row("unjudged", traceback.format_exc()[-600:], ran.seconds, 0.0, 0, 0)
    words, outcome = "; ".join(judged.wrong[:3]), "wrong" if judged.wrong else "answered"
    return row(outcome, words, ran.seconds, judged.worst, judged.checks, judged.blind)


def table(rows, verbs):
    """The tally as text."""
    head = "asked answered refused wrong over-10s  median-s  worst-s   checks    blind  worst-error"
    lines = [f"{'verb':12s} {head}"]
    for verb in verbs:
        own = [row for row in rows if row.verb == verb]
        if not own:
            continue
        count = {name: sum(row.outcome == name for row in own) for name in ("answered", "refused", "wrong", "stopped")}
        seconds = np.array([row.seconds for row in own])
        lines.append(
            f"{verb:12s} {len(own):5d} {count['answered']:8d} {count['refused'] + count['stopped']:7d} "
            f"{count['wrong']:5d} {int((seconds > SLOW).sum()):8d} {np.median(seconds):9.3f} {seconds.max():8.2f} "
            f"{sum(row.checks for row in own):8d} {sum(row.blind for row in own):8d} "
            f"{max(row.worst for row in own):12.2g}"
        )
    return "\n".join(lines)


def listing(rows, seed):
    """Each refusal, error and slow answer, with its file and command line."""
    lines = []
    for row in rows:
        if row.outcome != "answered" or row.seconds > SLOW:
            command = " ".join(row.arguments)
            lines += [f"\n--- {row.outcome}, {row.seconds:.1f} s: arm {row.number} of seed {seed}", f"tfarm {command}"]
            lines += [row.words, draw(row.number, seed).toml.replace("\n", "\n    ").strip()]
    return "\n".join(lines)


def survey(size, seed, verbs, processes=1, tell=None, seconds=math.inf):
    """The rows of so many arms, or of as many as were done when so many seconds were over."""
    work, rows = partial(survey_one, seed=seed, verbs=verbs), []
    numbers, end = range(size), time.perf_counter() + seconds
    survey_one(0, 0, verbs)  # kernels are compiled once after an installation, and no arm is charged for it
    if processes == 1:
        found = map(work, numbers)
        rows = _gathered(found, size, tell, end)
    else:
        with multiprocessing.get_context("spawn").Pool(processes) as pool:
            rows = _gathered(pool.imap_unordered(work, numbers), size, tell, end)
    return sorted(rows, key=lambda row: (verbs.index(row.verb), row.number))


def _gathered(found, size, tell, end):
    rows = []
    for done, new in enumerate(found, start=1):
        rows += new
        if tell:
            tell(done, size, new)
        if time.perf_counter() > end:
            break
    return rows
