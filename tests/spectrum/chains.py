"""Frequencies and damped modes of random rigs against two other models:  python -m tests.spectrum.chains 1000 [seed]

Rigs of 1 to 6 segments with whatever a rig can have (`tests.rigs`).  The first twenty frequencies of each are compared
with finite elements of high degree, one by one, so that none can be missing; every tenth is certified in balls.  Of as
many again times `DAMPED` the damped modes are listed: those in the box must be the elements', as many, and zeros of the
determinant of transition matrices; every tenth is certified.  Timed on rigs of three segments (time of the CPU).
"""

import math
import os
import sys
import time
from collections import Counter
from dataclasses import dataclass

if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import mpmath
import numpy as np

import tfarm
from tests.chain_elements import eigenvalues, natural_frequencies
from tests.rigs import some_rig
from tests.transition import determinant
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.search import count_below

MODES = 20
AGREED = 1e-7  # of the elements with a frequency: it is a matter of which, not of digits
SPLIT = 1e-10  # of a frequency, between both signs of the determinant where the elements are in doubt
DAMPED, MOST_DAMPED = 0.06, 8  # damped rigs a rig, and the most modes of one
AT_REST = 1e-5  # of the first frequency: nearer to 0 than that is the rigid body
STEP = 1e-9  # of an eigenvalue, Newton's on the determinant


@dataclass(frozen=True)
class Verdict:
    """What came of one rig: "right", "refused" or "wrong", why; how far the models are apart; milliseconds."""

    outcome: str
    reason: str = ""
    distance: float = 0.0
    listing: float = 0.0
    proving: float = 0.0
    segments: int = 0
    inside: int = 0


def judge(arm, *, certify=False, count=MODES):
    """The first frequencies of one undamped rig."""
    start = time.process_time()
    table = tfarm.modes(arm, count)
    listing, proving, wrong = _since(start), 0.0, []
    if certify:
        start = time.process_time()
        try:
            proof = table.certify()
        except CertificationError as error:
            return Verdict("refused", str(error).partition(" near ")[0], listing=listing)
        proving = _since(start)
        if proof.count != len(table):
            wrong.append(f"{proof.count} proven, {len(table)} listed")
    omega = table.natural_frequency[table.index > 0]
    gap = np.append(np.diff(omega), omega[-1] * 1e-9)
    below = [
        count_below(table.system.with_damping(0.0), float(w + 1e-3 * step)) for w, step in zip(omega, gap, strict=True)
    ]
    if below != list(range(1 + arm.has_rigid_mode, len(table) + 1)):
        wrong.append(f"the count says {below}")
    distance = abs(natural_frequencies(arm, count) / omega - 1)
    off = [
        float(w) for w, away in zip(omega, distance, strict=True) if away > AGREED and not changes_sign(arm, float(w))
    ]
    wrong += [f"no frequency at {w:.10g}" for w in off]
    outcome = "wrong" if wrong else "right"
    return Verdict(outcome, ", ".join(wrong), float(distance.max()), listing, proving, len(arm.links))


def changes_sign(arm, omega):
    """Whether the determinant of transition matrices does, across omega."""
    low, high = (determinant(arm, 1j * omega * (1 + shift), 30).real for shift in (-SPLIT, SPLIT))
    return low * high < 0


def judge_damped(arm, count, *, certify=False):
    """The first damped modes of one rig."""
    start = time.process_time()
    try:
        damped = damped_modes(tfarm.modes(arm, count))
        listing = _since(start)
        start = time.process_time()
        if certify:
            damped.certify()
        proving = certify * _since(start)
    except (CertificationError, ConvergenceError) as error:
        return Verdict("refused", f"{type(error).__name__}: {str(error)[:60]}")
    listed = np.concatenate([damped.eigenvalues.ravel(), np.array(damped.others, complex)])
    inside = moving(arm, listed[damped.box.holds(listed)])
    wrong = [] if damped.left_out == 0 else [f"{damped.left_out} left out"]
    theirs = eigenvalues(arm, abs(complex(damped.box.re_min, damped.box.im_max)) * 1.01)
    theirs = moving(arm, theirs[damped.box.holds(theirs)])
    if theirs.size != inside.size:
        wrong.append(f"{inside.size} listed in the box, {theirs.size} of the elements")
    steps = [newton_step(arm, s) for s in inside]
    wrong += [f"no zero at {s:.10g}" for s, step in zip(inside, steps, strict=True) if step > STEP]
    outcome = "wrong" if wrong and damped.left_out == 0 else "refused" if wrong else "right"
    return Verdict(outcome, ", ".join(wrong), max(steps, default=0.0), listing, proving, len(arm.links), inside.size)


def moving(arm, s):
    """Those eigenvalues in the upper half plane that are not the rigid body's 0."""
    slowest = tfarm.modes(arm, 1).natural_frequency[-1]
    return s[(abs(s) > AT_REST * slowest) & (s.imag >= 0)]


def newton_step(arm, s):
    """The step, as a share of s, that Newton's method on the determinant would take from there."""
    with mpmath.workdps(60):
        h = mpmath.mpf("1e-20") * abs(s)
        at, beside = determinant(arm, s), determinant(arm, mpmath.mpc(s) + h)
        return float(abs(at * h / (beside - at)) / abs(s))


def _since(start):
    return 1e3 * (time.process_time() - start)


def frequencies(number, seed):
    """Rigs and verdicts, without damping."""
    cases = []
    for n in range(number):
        arm = some_rig(np.random.default_rng([seed, n]), damped=False)
        cases.append((arm, judge(arm, certify=n % 10 == 0)))
    return cases


def damped_rigs(number, seed):
    """Rigs and verdicts, with damping."""
    cases = []
    for n in range(number):
        rng = np.random.default_rng([seed, n, 1])
        arm, count = some_rig(rng, damped=True), int(rng.integers(1, MOST_DAMPED + 1))
        cases.append((arm, judge_damped(arm, count, certify=n % 10 == 0)))
    return cases


def report(name, verdicts):
    """The tally as text."""
    tally, three = Counter(each.outcome for each in verdicts), [each for each in verdicts if each.segments == 3]
    proven = [each.proving for each in verdicts if each.proving]
    lines = [
        f"{len(verdicts)} {name}: {tally['right']} right, {tally['refused']} refused, {tally['wrong']} wrong",
        f"furthest from the other model {max((each.distance for each in verdicts), default=0.0):.1e}; "
        f"{sum(each.inside for each in verdicts)} eigenvalues in boxes",
        f"list of a rig of three segments {np.mean([each.listing for each in three] or [0]):.1f} ms in the mean; proof "
        f"{np.mean([each.proving for each in three if each.proving] or [0]):.1f} ms, of {len(proven)} rigs of any size",
    ]
    reasons = Counter(f"{each.outcome}: {each.reason}" for each in verdicts if each.outcome != "right")
    return "\n".join([*lines, *(f"{count} x {text}" for text, count in reasons.most_common())])


def main():
    number, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1
    judge(some_rig(np.random.default_rng(0), damped=False), certify=True)  # compile and cache
    plain, damped = frequencies(number, seed), damped_rigs(math.ceil(DAMPED * number), seed)
    print(report("rigs without damping", [verdict for _, verdict in plain]))
    print(report("damped rigs", [verdict for _, verdict in damped]))
    for arm, verdict in [*plain, *damped]:
        if verdict.outcome != "right":
            print(verdict.outcome, verdict.reason, arm)
    return any(verdict.outcome == "wrong" for _, verdict in [*plain, *damped])


if __name__ == "__main__":
    sys.exit(main())
