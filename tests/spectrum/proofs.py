"""Certified lists against an independent Ritz model on random arms:  python -m tests.spectrum.proofs 1000 [seed]

Arms of slenderness L/h 5 to 500, hub, payload mass and inertia each 0, inf or anything between; twenty flexible modes.
For each arm that `certify` proves, the Legendre-Ritz model (tests.models) must have a frequency in every bracket, and
as many below each gap between brackets as the proof counts.  The model is as accurate as its eigenvalue solver:
the flexibilities 1/w^2 come to ROUNDING x epsilon of the largest, so w_n to that times (w_n/w_1)^2 / 2.
"""

import os
import sys
import time
from collections import Counter
from dataclasses import dataclass

if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 129 rows: threads cost more than they bring

import numpy as np

import tfarm
from tests.models import Ritz
from tests.spectrum.test_certify import random_arm
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


def survey(number, seed):
    """Arms and verdicts."""
    generator = np.random.default_rng(seed)
    arms = [random_arm(generator) for _ in range(number)]
    return [(arm, judge(arm)) for arm in arms]


def report(verdicts):
    """The tally as text."""
    tally = Counter(verdict.outcome for verdict in verdicts)
    proven = [verdict for verdict in verdicts if verdict.outcome == "proven"]
    spent = [verdict.milliseconds for verdict in verdicts]
    tolerances = [verdict.tolerance for verdict in proven]
    lines = [
        f"{len(verdicts)} arms, {MODES} flexible modes: {tally['proven']} proven, {tally['refused']} refused, "
        f"{tally['wrong']} wrong",
        f"{np.mean(spent):.1f} ms an arm in the mean, {np.max(spent):.1f} at most",
        f"{MODES * len(proven)} brackets: model at most {max(v.distance for v in proven):.2f} of its tolerance away; "
        f"{sum(v.gaps for v in proven)} of {(MODES - 1) * len(proven)} gaps counted",
        f"the model's tolerance for mode {MODES}: median {np.median(tolerances):.0e}, largest {max(tolerances):.0e}",
    ]
    reasons = Counter(f"{v.outcome}: {v.reason}" for v in verdicts if v.outcome != "proven")
    return "\n".join([*lines, *(f"{count} x {text}" for text, count in reasons.most_common())])


if __name__ == "__main__":
    NUMBER = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 2012
    judge(random_arm(np.random.default_rng(0)))  # compile and cache
    SURVEY = survey(NUMBER, SEED)
    print(report([verdict for _, verdict in SURVEY]))
    for ARM, VERDICT in SURVEY:
        if VERDICT.outcome != "proven":
            print(VERDICT.outcome, VERDICT.reason, ARM)
    sys.exit(any(verdict.outcome == "wrong" for _, verdict in SURVEY))
