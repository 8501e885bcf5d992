"""Plausible arms through the command line, judged by Legendre-Ritz models that share nothing with tfarm.

    python -m tests.plausible.survey SIZE SEED

Steel to rubber, 5 cm to 10 m, L/h 5 to 300, rectangles, rods and tubes, hub 1e-2 to 1e2 and payload 0 to 1e2 times the
beam's, first damping ratio 1e-4 to 2e-2 or C = 0.  Natural frequencies, responses, poles, verdict and windows have to
be the model's where two models of it agree; a command that crashes, or prints on standard error what is not tfarm's,
is wrong too.  Budget: 2 CPU s an arm.
"""

import contextlib
import io
import json
import tempfile
import traceback
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests import survey
from tests.loop.ritz_loop import RitzLoop
from tests.models import Ritz
from tests.plausible.arms import draw
from tests.survey import Finding
from tfarm.cli import main

ROUGH, FINE = 56, 72  # Legendre terms of the two models: right to 1e-9 up to modes 27 and 36 (rounding apart)
SAFETY = 20  # times the difference of two models
BLIND = 1e-3  # relative: models that differ by more decide nothing
OFF_EDGE = 1e-3  # share of a printed edge on either side of which the loop is checked
CLEAR = 1e-7  # of |s|: a smaller real part does not decide stability


def run(arguments):
    """Exit code (1 where it raised), answer and standard error of `tfarm *arguments --json`."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("always")
        try:
            main([*arguments, "--json"])
        except SystemExit as stop:
            code = int(stop.code or 0)
        except Exception:  # a crash is a finding of the survey, not its end
            traceback.print_exc()
            code = 1
    return code, json.loads(out.getvalue()) if code == 0 else None, err.getvalue()


def compared(what, printed, model, rough):
    """Words where numbers (n,) differ by more than two models do, and how many these have."""
    size = np.maximum(abs(model), 1e-300)
    known = abs(model - rough) < BLIND / SAFETY * size
    off = abs(np.asarray(printed) - model) > SAFETY * abs(model - rough) + 1e-8 * size
    return [f"{what}: {np.asarray(printed)[known & off]} for {model[known & off]}"] * bool(
        (known & off).any()
    ), known.sum()


def modes(case, answer, rough, fine):
    printed = [row["natural_frequency_rad_s"] for row in answer["modes"] if row["index"]]
    return compared("frequencies", printed, *(ritz.natural_frequencies(len(printed)) for ritz in (fine, rough)))


def response(case, answer, rough, fine):
    s, value = (np.array([complex(*pair) for pair in answer[key]]) for key in ("s", "value"))
    return compared("tip", value, *(np.array([m.tip_w @ m.response(p, m.hub_psi) for p in s]) for m in (fine, rough)))


def poles(case, answer, rough, fine):
    """Each printed pole is one of the model's, and none of the model's in the box is missing."""
    printed = np.array([complex(*pair) for pair in answer["poles"]])
    near, far = (RitzLoop(case.arm, ritz.terms).eigenvalues(case.law) for ritz in (fine, rough))
    moving = printed[abs(printed) > 1e-7 * case.first]
    own, other = (each[abs(each - moving[:, None]).argmin(axis=1)] for each in (near, far))
    words, known = compared("poles", moving, own, other)
    left, right, _, top = answer["box"]
    box = near[(near.real > left) & (near.real < right) & (near.imag > 0) & (near.imag < (1 - 1e-6) * top)]
    box = box[(abs(box[:, None] - far).min(axis=1) < 1e-6 * abs(box)) & (abs(box) > 1e-7 * case.first)]
    missing = [f"{p} is missing" for p in box if abs(moving - p).min(initial=np.inf) > 1e-4 * abs(p)]
    return words + missing, known + box.size


def margins(case, answer, rough, fine):
    """Verdict, and a gain on either side of each edge."""
    tried = [(case.law, answer["stable"])] if answer["verdict"] != "marginal" else []
    for row in answer["stability_intervals"]:
        name = row["number"]
        low, high = row["search_range"]
        windows = [(float(each["low"]), float(each["high"])) for each in row["intervals"]]
        for end in [end for pair in windows for end in pair if low < end < high][:4]:
            step = OFF_EDGE * (abs(end) or abs(getattr(case.law, name)) or 1.0)
            values = [(value, any(a < value < b for a, b in windows)) for value in (end - step, end + step)]
            tried += [(replace(case.law, **{name: value}), is_inside) for value, is_inside in values]
    words, known = [], 0
    for law, is_stable in tried:
        growth = [RitzLoop(case.arm, ritz.terms).rightmost(law) / case.first for ritz in (rough, fine)]
        if abs(growth[0] - growth[1]) < 1e-3 * abs(growth[1]) and abs(growth[1]) > CLEAR:
            known += 1
            if is_stable and growth[1] > 0:
                words.append(f"{law} is called stable, and grows by {growth[1]:.3g} w1")
    return words, known


def along(case):
    """Points s of a response, on the axis and off it."""
    w = case.first * np.exp(case.rng.uniform(np.log(1e-3), np.log(60.0), 6))
    points = [complex(0.0, each) for each in w[:4]] + [complex(0.3 * each, each) for each in w[4:]]
    return ["--output", "tip_displacement", "--s=" + ",".join(f"{p.real!r}{p.imag:+.17g}j" for p in points)]


def gains(case):
    """The law as the command line takes it."""
    return [f"--{name}={value!r}" for name, value in case.law.by_name.items()]


VERBS = {  # options of a command, and its judge
    "modes": (lambda case: ["--count", "20"], modes),
    "response": (along, response),
    "poles": (gains, poles),
    "margins": (gains, margins),
}


def judged(verb, number, seed, terms=(ROUGH, FINE)):
    """The finding on the arm of that number, by models of `terms` Legendre terms."""
    case, (options, judge) = draw(number, seed), VERBS[verb]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.toml"
        path.write_text(case.toml)
        code, answer, error = run([verb, str(path), *options(case)])
    where = f"arm {number} of seed {seed}: tfarm {verb} arm.toml {' '.join(options(case))}\n{case.toml}"
    noise = [line for line in error.splitlines() if not line.startswith("tfarm: ")]
    if code in (2, 3) and not noise:
        return Finding("refused", f"{error.strip()} {where}")
    if code or noise:
        return Finding("wrong", f"exit {code}: {' | '.join(noise[-3:])} {where}", is_wrong=True)
    words, known = judge(case, answer, *(Ritz(case.arm, each) for each in terms))
    text = f"{'; '.join(words[:3])} {where}" if words else ""
    return Finding("wrong" if words else "answered", text, bool(words), {"checks": float(known)})


def survey_of(verb):
    """The survey of one command."""

    def findings(size, seed):
        return (judged(verb, number, seed) for number in range(size))

    findings.__name__ = verb
    return findings


if __name__ == "__main__":
    survey.main(*map(survey_of, VERBS), size=50, seed=2012)
