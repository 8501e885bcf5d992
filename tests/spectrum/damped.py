"""Damped modes of random arms, counted by four methods:  python -m tests.spectrum.damped SIZE SEED

Arms of slenderness L/h 5 to 500 with C = 1e-7 to 1e-3 s, hub, payload mass and inertia each 0, inf or anything between;
1 to 24 flexible modes.  In the printed box there must be as many eigenvalues by the list, by the winding number in
float64, by the proof in ball arithmetic and by a Galerkin model (`independent`), whose own must be the listed ones.

As many damped rigs (`tests.rigs`) with 1 to 8 modes: every eigenvalue that finite elements (`tests.chain_elements`)
have in the box is listed, assigned to a mode or not, and there are no others; a list of fewer modes than were asked for
is "short".
"""

import numpy as np

import tfarm
from tests import survey
from tests.chain_elements import eigenvalues
from tests.rigs import some_rig
from tests.spectrum.independent import ritz_eigenvalues
from tests.strategies import some_arm
from tests.survey import Finding, each_of
from tfarm.errors import CertificationError, ConvergenceError
from tfarm.spectrum.damped import damped_modes

MOST_MODES = 24
MOST_RIG_MODES = 8
TERMS = 56
OF_ELEMENTS = 1e-5  # of an eigenvalue: how far the one of finite elements may be: it is a matter of which
NEXT_TO_REST = {0: 0.0, 1: 1e-10, 2: 1e-7}  # of the box: what one zero at 0, or two, are to finite elements
LEAST_OF_MODEL = 1e-7  # of the largest: one nearer to 0 is rounding of the model's stiffness
AGREED = 1e-6  # of the model with the listed eigenvalues: it is a matter of which, not of digits
ROUNDING = 64 * np.finfo(float).eps  # of the model's flexibilities 1/w^2, in units of the largest


def some_damped_arm(rng):
    """A random arm with C = 1e-7..1e-3 s, and a number of modes."""
    arm = some_arm(rng, damping=float(10 ** rng.uniform(-7, -3)))
    return arm, int(rng.integers(1, MOST_MODES + 1))


def judge(arm, count, *, certify=True, model=True):
    """The finding on the damped modes of one arm, listed and counted again."""
    try:
        damped = damped_modes(tfarm.modes(arm, count))
        proof = damped.certify() if certify else None
    except (ConvergenceError, CertificationError) as error:
        return refused(error, count, arm)
    flexible = damped.eigenvalues[damped.index > 0].ravel()
    inside = flexible[damped.box.holds(flexible)]
    wrong = []
    if inside.size + damped.undamped.system.at_rest != damped.count:
        wrong.append(f"{inside.size} flexible eigenvalues listed in the box of {damped.count}")
    if (flexible.real > 0).any():
        wrong.append("an eigenvalue right of the axis, of an arm that dissipates")
    if model:
        wrong += compared(arm, damped, inside)
    if proof is not None and [len(discs) for discs in proof] != [
        1 if pair[0].imag > 0 else int(np.isfinite(pair).sum()) for pair in pairs(damped)
    ]:
        wrong.append("not a disc for each eigenvalue")
    return finding("wrong" if wrong else "right", wrong, count, damped, inside)


def refused(error, count, arm):
    """The finding where there is no list, or no proof of it."""
    return Finding("refused", f"{type(error).__name__}: {str(error).partition(' near ')[0]} {count} {arm}")


def finding(outcome, wrong, count, damped, inside):
    """The finding on a list of damped modes."""
    words = f"{', '.join(wrong)} {count} {damped.undamped.arm}" if outcome in ("wrong", "short") else ""
    return Finding(outcome, words, outcome == "wrong", {"eigenvalues in the box": inside.size})


def pairs(damped):
    """Eigenvalues of the flexible modes."""
    return damped.eigenvalues[damped.index > 0]


def some_damped_rig(rng):
    """A random rig with losses, and a number of modes."""
    while (arm := some_rig(rng)).is_undamped:
        pass
    return arm, int(rng.integers(1, MOST_RIG_MODES + 1))


def judge_rig(arm, count, *, certify=True):
    """List the damped modes of one rig, and compare all that is listed in the box with finite elements."""
    try:
        damped = damped_modes(tfarm.modes(arm, count))
        proof = damped.certify() if certify else None
    except (ConvergenceError, CertificationError) as error:
        return refused(error, count, arm)
    every = np.r_[damped.eigenvalues.ravel(), damped.single, damped.unassigned_pairs.ravel()]
    every = np.unique(every[np.isfinite(every) & (every != 0)])
    inside = every[damped.box.holds(every)]
    at_rest = damped.undamped.system.at_rest
    wrong = [] if inside.size + at_rest == damped.count else ["another number is listed"]
    largest = abs(damped.box.corners).max()
    mine, theirs = inside[inside.imag >= 0], eigenvalues(arm, largest)
    rounding = NEXT_TO_REST[at_rest] * largest
    theirs = theirs[damped.box.holds(theirs) & (abs(theirs) > rounding)]
    if mine.size != theirs.size:
        wrong.append(f"{theirs.size} eigenvalues of finite elements in the box, {mine.size} listed")
    wrong += [f"{s:.6g} is no eigenvalue of finite elements" for s in mine
              if _away(s, theirs) > OF_ELEMENTS + rounding / abs(s)]  # fmt: skip
    if proof is not None and sum(map(len, proof)) < mine.size:
        wrong.append("not a disc for each eigenvalue")
    outcome = "wrong" if wrong else "short" if damped.left_out else "unassigned" if damped.unassigned else "right"
    return finding(outcome, wrong, count, damped, inside)


def _away(zero, others):
    """Distance to the nearest of the others, of its size."""
    return abs(others / zero - 1).min(initial=np.inf)


def compared(arm, damped, inside):
    """What the Galerkin model has against the list."""
    theirs = ritz_eigenvalues(arm, TERMS)
    largest = abs(inside).max(initial=0.0)
    theirs, inside = (each[abs(each) > LEAST_OF_MODEL * largest] for each in (theirs[damped.box.holds(theirs)], inside))
    if theirs.size != inside.size:
        return [f"{theirs.size} eigenvalues of the model in the box, {inside.size} listed"]
    lowest = abs(theirs).min(initial=np.inf)
    far = [abs(theirs / zero - 1).min() / max(AGREED, ROUNDING * abs(zero / lowest) ** 2) for zero in inside]
    return [f"eigenvalue {inside[int(np.argmax(far))]:.6g} not in the model"] if max(far, default=0) > 1 else []


def arms(rng):
    return judge(*some_damped_arm(rng))


def rigs(rng):
    return judge_rig(*some_damped_rig(rng))


if __name__ == "__main__":
    survey.main(each_of(arms), each_of(rigs), size=200)
