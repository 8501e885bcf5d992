"""Map and count of random loops against a model's eigenvalues:  python -m tests.loop.agreement SIZE SEED

A dozen random arms (slenderness 5 to 60, free or held tip, a third of them at C = 0), and for each a grid of random
gains: the region's number of unstable poles, that of `stability`, encirclements of -1, and the rightmost eigenvalue of
a Legendre-Ritz model of the loop, which shares nothing with tfarm.

Left out are gains within 1e-3 (of the hub's own unit) of the boundary, and loops that grow or decay by less than 1e-5
a sample of 10 ms.
"""

from dataclasses import replace

import numpy as np

from tests import survey
from tests.loop.arms import hub_units, verdict_of
from tests.loop.ritz_loop import RitzLoop
from tests.strategies import some_arm
from tests.survey import Finding
from tfarm import Hub, HubFeedback
from tfarm.errors import ConvergenceError
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.plane import INFINITE, gain_map

ARMS = 12
NEAR = 1e-3  # of the units of the gains, from the boundary
SLOW = 1e-5 / 0.01  # 1/s
TERMS = 24


def some_free_arm(rng, damped):
    """An arm whose hub has a fifth to five times the beam's inertia; damping 1e-3 to 0.1 of the critical one."""
    case = ["some", *rng.choice(["zero", "some", "infinite"], size=2, p=(0.4, 0.4, 0.2))]
    arm = some_arm(rng, case, damping=0.0, slenderness=(5, 60))
    beam = arm.link.rhoA * arm.link.length**3 / 3
    arm = replace(arm, hub=Hub(inertia=beam * float(5 ** rng.uniform(-1, 1))))
    return arm.with_numbers(damping=float(10 ** rng.uniform(-2.7, -0.7)) / hub_units(arm)[1]) if damped else arm


def some_gains(rng, arm, number):
    """Ascending K1 and K2 of any sign, and Kp: zero for most arms."""
    inertia, omega = hub_units(arm)
    K1 = inertia * omega * rng.choice([1.0, 1.0, -1.0], number) * 10 ** rng.uniform(-2, 1, number)
    K2 = np.where(rng.random(number) < 0.7, rng.uniform(-1, 1.5, number), -(10 ** rng.uniform(0, 1.5, number)))
    Kp = rng.choice([0.0, 1.0, -1.0], p=(0.6, 0.3, 0.1)) * inertia * omega**2 * 10 ** rng.uniform(-3, 0)
    return np.sort(K1), np.sort(K2), float(Kp)


def far_from_boundary(found, law, unit):
    """Whether the gains are further than NEAR from the boundary's points and from where it collapses to lines."""
    if abs(law.K1) < NEAR * unit or (found.arm.link.damping == 0 and abs(law.K2 - 1) < NEAR):
        return False
    away = np.hypot((found.boundary[:, 0] - law.K1) / unit, found.boundary[:, 1] - law.K2)
    return bool(away.min(initial=np.inf) > NEAR)


def loops(size, seed, arms=ARMS):
    """Of each loop whether map, count and model agree; gains too close to the boundary are left out."""
    rng = np.random.default_rng(seed)
    for n in range(arms):
        arm = some_free_arm(rng, damped=n % 3 != 0)
        number = max(2, int(np.ceil(np.sqrt(size / arms))))  # a map has two values of either gain at least
        K1, K2, Kp = some_gains(rng, arm, number)
        found, model = gain_map(arm, K1, K2, Kp), RitzLoop(arm, TERMS)
        for j, i in np.ndindex(number, number):
            law = HubFeedback(K1=float(K1[i]), K2=float(K2[j]), Kp=Kp)
            if far_from_boundary(found, law, np.prod(hub_units(arm))):
                finding = judge(model, law, int(found.unstable[j, i]))
                if finding is not None:
                    yield finding


def judge(model, law, of_map):
    """The finding on one loop, or None where it grows or decays too slowly."""
    rightmost = model.rightmost(law)
    if abs(rightmost) < SLOW:
        return None
    verdict = verdict_of(model.arm, law)
    try:
        nyquist_of(verdict)
        turns = ""
    except ConvergenceError as error:  # a plot that passes -1 too near is refused, and so are two counts that differ
        turns = str(error)
    if "by finding" in turns:
        outcome = "turns and count differ"
    elif of_map != (INFINITE if verdict.unstable_roots_infinite else verdict.unstable_roots):
        outcome = "map and count differ"
    elif verdict.word != ("stable" if of_map == 0 else "unstable"):
        outcome = "verdict and count differ"
    else:
        outcome = "agree" if (rightmost > 0) == (of_map != 0) else "model differs"
    words = "" if outcome == "agree" else f"{model.arm} {law} {of_map} {verdict.word} {rightmost}"
    return Finding(outcome, words, bool(words), {"unstable": of_map})


if __name__ == "__main__":
    survey.main(loops, size=2000, seed=2012)
