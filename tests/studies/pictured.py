"""A study whose quantities are planted: closed forms of the varied numbers, with every kind of missing value."""

import math
from dataclasses import replace
from unittest import mock

import tfarm
from tests.hostile import NAME, TEXT
from tfarm.studies import running

LAB = tfarm.load("sasaki2012-lab")
OVER = {"payload.mass": {"uniform": [0.0, 0.2]}, "law.K2": {"uniform": [0.0, 1.4]}}
DRAWS = 40


def planted(one, sources):
    """Return margins that fall with K2; unstable above 1, no limit of the gain below 0.3, an error above 1.3."""
    mass, K2 = one.case.arm.payload.mass, one.case.law.gains.K2
    if K2 > 1.3:
        raise tfarm.ConvergenceError(f"{TEXT} {K2}", None, None)
    found = {}
    for loop, word in (("continuous", "converged"), ("sampled", "certified")):
        is_stable = K2 < 1 and not (loop == "sampled" and K2 > 0.9)
        found |= {
            f"{loop}.stability": "stable" if is_stable else "unstable",
            f"{loop}.certainty": f"{word} to 100 rad/s",
            f"{loop}.gain_margin_db": math.inf if K2 < 0.3 else 20 * math.log10(1 / K2) if is_stable else None,
            f"{loop}.phase_margin_deg": 60 * (1 - K2) + mass if is_stable else None,
            f"{loop}.delay_margin_ms": 12.5,
            f"{loop}.least_damping": 0.1 * (1 - K2),
        }
    names = (name for own, _ in sources for name in own)
    return {name: found.get(name) for name in (*names, "failed")}


def planted_study(folder, draws=DRAWS, **how):
    """Return that study of an arm with a hostile name, computed in this process."""
    with mock.patch.object(running, "values_of", planted):
        return tfarm.study(replace(LAB, name=NAME), over=OVER, ask=["card"], draws=draws, out=folder, workers=1, **how)
