"""Frequencies and damped modes of random rigs against two other models:  python -m tests.spectrum.chains SIZE SEED

Rigs of 1 to 6 segments with whatever a rig can have (`tests.rigs`).  The first twenty frequencies of each are compared
with finite elements of high degree, one by one, so that none can be missing; every tenth is certified in balls.  Of as
many again times `DAMPED` the damped modes are listed: those in the box must be the elements', as many, and zeros of the
determinant of transition matrices; every tenth is certified.  Timed on rigs of three segments (time of the CPU).
"""

import math
import time
from dataclasses import dataclass

import mpmath
import numpy as np

import tfarm
from tests import survey
from tests.chain_elements import eigenvalues, natural_frequencies
from tests.rigs import some_rig
from tests.survey import Finding
from tests.transition import determinant
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.frequencies import count_below

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


def finding(arm, verdict):
    """The finding of a verdict."""
    figures = {"distance from the other model": verdict.distance, "eigenvalues in the box": verdict.inside}
    figures |= {"list of three segments [ms]": verdict.listing} if verdict.segments == 3 else {}
    figures |= {"proof [ms]": verdict.proving} if verdict.proving else {}
    words = f"{verdict.reason} {arm}" if verdict.outcome != "right" else ""
    return Finding(verdict.outcome, words, verdict.outcome == "wrong", figures)


def frequencies(size, seed):
    """Rigs without damping; every tenth is certified."""
    for n in range(size):
        arm = some_rig(np.random.default_rng([seed, n]), damped=False)
        yield finding(arm, judge(arm, certify=n % 10 == 0))


def damped_rigs(size, seed):
    """Fewer rigs with damping, the same."""
    for n in range(math.ceil(DAMPED * size)):
        rng = np.random.default_rng([seed, n, 1])
        arm, count = some_rig(rng, damped=True), int(rng.integers(1, MOST_DAMPED + 1))
        yield finding(arm, judge_damped(arm, count, certify=n % 10 == 0))


if __name__ == "__main__":
    judge(some_rig(np.random.default_rng(0), damped=False), certify=True)  # compile and cache
    survey.main(frequencies, damped_rigs)
