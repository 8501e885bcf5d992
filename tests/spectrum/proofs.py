"""Certified lists against an independent Ritz model on random arms:  python -m tests.spectrum.proofs SIZE SEED

Arms of slenderness L/h 5 to 500, hub, payload mass and inertia each 0, inf or anything between; twenty flexible modes.
For each arm that `certify` proves, the Legendre-Ritz model (tests.models) must have a frequency in every bracket, and
as many below each gap between brackets as the proof counts.  The model is as accurate as its eigenvalue solver:
the flexibilities 1/w^2 come to ROUNDING x epsilon of the largest, so w_n to that times (w_n/w_1)^2 / 2.
"""

import time

import numpy as np

import tfarm
from tests import survey
from tests.models import Ritz
from tests.strategies import some_arm
from tests.survey import Finding, each_of
from tfarm import CertificationError

MODES = 20
TERMS = 64  # j_64(w L/c / 2)^2 is below rounding for the waves of twenty modes
ROUNDING = 256
EPS = np.finfo(float).eps


def judge(arm):
    """The finding on one arm, certified and compared; gaps are those in which the model can count."""
    start = time.perf_counter()
    try:
        proof = tfarm.modes(arm, MODES).certify()
    except CertificationError as error:
        return Finding("refused", f"{str(error).partition(' near ')[2] or error} {arm}")
    spent = 1e3 * (time.perf_counter() - start)
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
    if wrong:
        return Finding("wrong", f"{', '.join(wrong)} {arm}", is_wrong=True)
    figures = {"model's distance over its tolerance": float(outside.max()), "tolerance": float(relative[-1])}
    return Finding(
        "proven", figures=figures | {f"gaps counted, of {MODES - 1}": int(clear[:-1].sum()), "milliseconds": spent}
    )


def arms(rng):
    return judge(some_arm(rng, damping=0.0))


if __name__ == "__main__":
    judge(some_arm(np.random.default_rng(0), damping=0.0))  # compile and cache
    survey.main(each_of(arms), size=1000, seed=2012)
