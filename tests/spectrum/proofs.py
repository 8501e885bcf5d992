"""Certified lists against an independent Ritz model on random arms:  python -m tests.spectrum.proofs SIZE SEED

Arms of slenderness L/h 5 to 500, hub, payload mass and inertia each 0, inf or anything between; twenty flexible modes.
For each arm that `certify` proves, the Legendre-Ritz model (tests.models) must have a frequency in every bracket, and
as many below each gap between brackets as the proof counts.  The model is as accurate as its eigenvalue solver:
the flexibilities 1/w^2 come to ROUNDING x epsilon of the largest, so w_n to that times (w_n/w_1)^2 / 2.
"""

import time
from dataclasses import dataclass

import numpy as np

import tfarm
from tests import survey
from tests.models import Ritz
from tests.spectrum.test_certify import random_arm
from tests.survey import Finding, each_of
from tfarm import CertificationError

MODES = 20
TERMS = 64  # j_64(w L/c / 2)^2 is below rounding for the waves of twenty modes (test_discretisations)
ROUNDING = 256
EPS = np.finfo(float).eps


@dataclass(frozen=True)
class Verdict:
    """What came of one arm: "proven", "refused" or "wrong", why, and how far the model could tell."""

    outcome: str
    reason: str
    milliseconds: float
    tolerance: float = 0.0  # the model's, of the highest mode
    distance: float = 0.0  # the largest distance of the model's frequencies from the brackets, in its tolerances
    gaps: int = 0  # gaps between brackets that are wide enough for the model to count below them


def judge(arm):
    """Certify one arm and compare."""
    start = time.perf_counter()
    try:
        proof = tfarm.modes(arm, MODES).certify()
    except CertificationError as error:
        return Verdict("refused", str(error).partition(" near ")[2] or str(error), _since(start))
    spent = _since(start)
    low, high = np.array(proof.brackets, float).T
    omega = Ritz(arm, TERMS).natural_frequencies(MODES + 5)
    tolerance = ROUNDING * EPS * (omega / omega[0]) ** 2 + 4 * EPS  # the brackets' ends are rounded too
    own, relative = omega[:MODES], tolerance[:MODES]
    outside = np.maximum(low / own - 1, own / high - 1).clip(min=0.0) / relative
    clear = own * (1 + relative) < omega[1 : MODES + 1] * (1 - tolerance[1 : MODES + 1])
    middle = (high[:-1] + low[1:]) / 2
    counted = (omega[:, None] < middle).sum(axis=0) == np.arange(1, MODES)
    wrong = []
    if proof.count != MODES + arm.has_rigid_mode:
        wrong.append(f"{proof.count} counted")
    if (outside > 1).any():
        wrong.append(f"no frequency of the model in bracket {int(outside.argmax()) + 1}")
    if not counted[clear[:-1]].all():
        wrong.append("another count between the brackets")
    outcome = "wrong" if wrong else "proven"
    return Verdict(outcome, ", ".join(wrong), spent, float(relative[-1]), float(outside.max()), int(clear[:-1].sum()))


def _since(start):
    return 1e3 * (time.perf_counter() - start)


def arms(rng):
    """The finding on one arm."""
    arm = random_arm(rng)
    verdict = judge(arm)
    figures = {"milliseconds": verdict.milliseconds}
    if verdict.outcome == "proven":
        figures |= {"model's distance over its tolerance": verdict.distance, "tolerance": verdict.tolerance}
        figures |= {f"gaps counted, of {MODES - 1}": verdict.gaps}
    words = f"{verdict.reason} {arm}" if verdict.outcome != "proven" else ""
    return Finding(verdict.outcome, words, verdict.outcome == "wrong", figures)


if __name__ == "__main__":
    judge(random_arm(np.random.default_rng(0)))  # compile and cache
    survey.main(each_of(arms), size=1000, seed=2012)
