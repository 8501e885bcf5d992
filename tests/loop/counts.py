"""Lists of closed-loop poles, counted by a second method:  python -m tests.loop.counts SIZE SEED

Random arms (slenderness L/h 5 to 100, any payload, C = 0 or up to a fifth of critical in the first mode) and gains of
any sign; three to fifteen poles each.  The number listed must be, by Nyquist, the winding number of 1 + L(s) around the
box, with L from the arm's public transfer functions, plus the arm's own poles inside: at C = 0 those that the count of
Wittrick and Williams gives, at C > 0 the winding number of the open arm.  Every `PROVEN`-th loop is counted in ball
arithmetic too.  The highest pole of each loop takes a Newton step on the paper's determinant with its hub row changed.
"""

import time
from itertools import pairwise

import numpy as np

import tfarm
from tests import survey
from tests.loop.arms import some_loop
from tests.spectrum.independent import newton_step
from tests.survey import Finding
from tfarm.errors import CertificationError, ConvergenceError, ParameterError
from tfarm.exact.system import system_of
from tfarm.loop.poles import closed_loop_poles
from tfarm.spectrum import modes_below
from tfarm.spectrum.box import winding_number
from tfarm.spectrum.naming import function_of
from tfarm.spectrum.proofs import proven_count

PROVEN = 20
STEP = 0.5  # rad: longer steps of the phase are halved


def judge(arm, law, count, *, balls=False) -> Finding:
    """List the poles of one loop and count them again."""
    start = time.perf_counter()
    try:
        poles = closed_loop_poles(arm, law, count)
    except (ConvergenceError, ParameterError) as error:
        return Finding("refused", f"{str(error).splitlines()[0]} {arm} {law} {count}")
    spent = 1e3 * (time.perf_counter() - start)
    listed = int(np.where(poles.values.imag > 0, 2, 1).sum())
    counts = [nyquist_count(poles.loop, poles.box)]
    if balls:
        try:
            counts.append(proven_count(poles.loop.k, poles.box, poles.loop.exact))
        except CertificationError as error:
            return Finding("refused", f"proof: {error} {arm} {law} {count}")
    step = max((newton_step(arm, complex(s), K1=law.K1, K2=law.K2, Kp=law.Kp) for s in poles.moving[-1:]), default=0.0)
    wrong = [f"{listed} listed, {there} counted" for there in counts if there != listed]
    if step > 1e-12:
        wrong.append(f"no zero of the determinant: {step:.0e} off")
    if wrong:
        return Finding("wrong", f"{', '.join(wrong)} {arm} {law} {count}", is_wrong=True)
    figures = {"poles": listed, "unstable": poles.unstable, "proven in balls": balls}
    return Finding("right", figures=figures | {"Newton's step": step, "milliseconds": spent})


def nyquist_count(loop, box) -> int:
    """Closed-loop poles in a box: turns of 1 + L around it, and the arm's own poles inside."""
    arm, law = loop.arm, loop.gains
    plant = tfarm.transfer(arm, ["hub_angle", "root_moment"])

    def returned(s):
        theta, moment = plant(s)
        return 1 + (law.Kp + law.K1 * s) * theta + law.K2 * moment

    path = np.append(np.concatenate([edge(a, b) for a, b in pairwise(box.corners)]), box.corners[0])
    return turns(returned, path) + own_poles(arm, box)


def turns(function, path) -> int:
    """How often a function turns around 0 along a closed path, whose steps are halved while it turns fast."""
    angle = np.angle(function(path))
    for _ in range(40):
        turn = np.angle(np.exp(1j * np.diff(angle)))
        (rough,) = np.nonzero(abs(turn) > STEP)
        if not rough.size:
            return round(float(turn.sum()) / (2 * np.pi))
        middle = (path[rough] + path[rough + 1]) / 2
        path, angle = np.insert(path, rough + 1, middle), np.insert(angle, rough + 1, np.angle(function(middle)))
    raise AssertionError("the phase does not settle on the contour")


def edge(a, b):
    """Points from a to b, ever denser towards the axis that the edge crosses, next to which poles lie."""
    fine = np.geomspace(1e-9, 1.0, 200)
    crossing = (a.real / (a.real - b.real)) if a.real != b.real else 0.5
    share = np.r_[np.linspace(0, 1, 200), crossing - crossing * fine, crossing + (1 - crossing) * fine]
    return a + (b - a) * np.unique(share.clip(0, 1))[:-1]


def own_poles(arm, box) -> int:
    """How many poles the arm itself has in a box."""
    if arm.link.damping:
        return winding_number(function_of(system_of(arm)), box, points=2000) + 2 * arm.has_rigid_mode
    return 2 * modes_below(arm, box.im_max) + 2 * arm.has_rigid_mode


def loops(size, seed):
    """The finding of each loop; every `PROVEN`-th is counted in balls too."""
    rng = np.random.default_rng(seed)
    drawn = [(*some_loop(rng), int(rng.integers(3, 16))) for _ in range(size)]
    yield from (judge(*case, balls=n % PROVEN == 0) for n, case in enumerate(drawn))


if __name__ == "__main__":
    survey.main(loops, size=500, seed=2012)
