"""Damped modes of random arms, counted by four roads:  python -m tests.spectrum.damped 200 [seed] [certify every]

Arms of slenderness L/h 5 to 500 with C = 1e-7 to 1e-3 s, hub, payload mass and inertia each 0, inf or anything between;
1 to 24 flexible modes.  In the printed box there must be as many eigenvalues by the list, by the winding number in
float64, by the proof in ball arithmetic and by a Galerkin model (`damped_roads`), whose own must be the listed ones.
"""

import os
import sys
import time
from collections import Counter
from dataclasses import dataclass

if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import tfarm
from tests.spectrum.damped_roads import ritz_eigenvalues
from tests.strategies import some_arm
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.exact.characteristic import zeros_at_origin
from tfarm.spectrum.damped import damped_modes

MOST_MODES = 24
TERMS = 56
AGREED = 1e-6  # of the model with the listed eigenvalues: it is a matter of which, not of digits
ROUNDING = 64 * np.finfo(float).eps  # of the model's flexibilities 1/w^2, in units of the largest


@dataclass(frozen=True)
class Verdict:
    """What came of one arm: "right", "refused" or "wrong", and why; milliseconds of the list and of the proof."""

    outcome: str
    reason: str = ""
    listing: float = 0.0
    proving: float = 0.0
    inside: int = 0
    overdamped: int = 0


def some_damped_arm(rng):
    """A random arm with C = 1e-7..1e-3 s, and a number of modes to ask for."""
    arm = some_arm(rng, damping=float(10 ** rng.uniform(-7, -3)))
    return arm, int(rng.integers(1, MOST_MODES + 1))


def judge(arm, count, *, certify=True, model=True):
    """List the damped modes of one arm and count them again."""
    start = time.perf_counter()
    try:
        damped = damped_modes(tfarm.modes(arm, count))
        listing = 1e3 * (time.perf_counter() - start)
        start = time.perf_counter()
        proof = damped.certify() if certify else None
        proving = 1e3 * (time.perf_counter() - start)
    except (ConvergenceError, CertificationError) as error:
        return Verdict("refused", f"{type(error).__name__}: {str(error).partition(' near ')[0]}")
    flexible = damped.eigenvalues[damped.index > 0].ravel()
    inside = flexible[damped.box.holds(flexible)]
    wrong = []
    if inside.size + zeros_at_origin(damped.undamped.system) != damped.count:
        wrong.append(f"{inside.size} flexible eigenvalues listed in the box of {damped.count}")
    if model:
        wrong += compared(arm, damped, inside)
    if proof is not None and [len(discs) for discs in proof] != [2 - (pair[0].imag > 0) for pair in pairs(damped)]:
        wrong.append("not a disc for each eigenvalue")
    outcome, text = ("wrong", ", ".join(wrong)) if wrong else ("right", "")
    return Verdict(outcome, text, listing, proving, inside.size, int(damped.is_overdamped.sum()))


def pairs(damped):
    """Eigenvalues of the flexible modes."""
    return damped.eigenvalues[damped.index > 0]


def compared(arm, damped, inside):
    """What the Galerkin model has against the list."""
    theirs = ritz_eigenvalues(arm, TERMS)
    theirs = theirs[damped.box.holds(theirs)]
    if theirs.size != inside.size:
        return [f"{theirs.size} eigenvalues of the model in the box, {inside.size} listed"]
    lowest = abs(theirs).min(initial=np.inf)
    far = [abs(theirs / zero - 1).min() / max(AGREED, ROUNDING * abs(zero / lowest) ** 2) for zero in inside]
    return [f"eigenvalue {inside[int(np.argmax(far))]:.6g} not in the model"] if max(far, default=0) > 1 else []


def survey(number, seed, every=1):
    """Arms, counts and verdicts; every so-and-so-manieth is certified."""
    rng = np.random.default_rng(seed)
    drawn = [some_damped_arm(rng) for _ in range(number)]
    return [(arm, count, judge(arm, count, certify=n % every == 0)) for n, (arm, count) in enumerate(drawn)]


def report(verdicts):
    """The tally as text."""
    tally = Counter(verdict.outcome for verdict in verdicts)
    listing = [verdict.listing for verdict in verdicts]
    proving = [verdict.proving for verdict in verdicts if verdict.proving > 0.1]
    lines = [
        f"{len(verdicts)} arms: {tally['right']} right, {tally['refused']} refused, {tally['wrong']} wrong",
        f"{sum(v.inside for v in verdicts)} eigenvalues in boxes, {len(proving)} boxes proven; "
        f"{sum(v.overdamped for v in verdicts)} overdamped modes",
        f"list {np.mean(listing):.1f} ms in the mean, {np.max(listing):.1f} at most",
        f"proof {np.mean(proving or [0]):.1f} ms in the mean, {np.max(proving or [0]):.1f} at most",
    ]
    reasons = Counter(f"{v.outcome}: {v.reason}" for v in verdicts if v.outcome != "right")
    return "\n".join([*lines, *(f"{count} x {text}" for text, count in reasons.most_common())])


if __name__ == "__main__":
    NUMBER, SEED, EVERY = (
        int(sys.argv[n]) if len(sys.argv) > n else default for n, default in ((1, 200), (2, 1), (3, 1))
    )
    judge(*some_damped_arm(np.random.default_rng(0)))  # compile and cache
    SURVEY = survey(NUMBER, SEED, EVERY)
    print(report([verdict for *_, verdict in SURVEY]))
    for ARM, COUNT, VERDICT in SURVEY:
        if VERDICT.outcome != "right":
            print(VERDICT.outcome, VERDICT.reason, COUNT, ARM)
    sys.exit(any(case[-1].outcome == "wrong" for case in SURVEY))
