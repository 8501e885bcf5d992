"""Root loci of random plausible arms:  python -m tests.loop.loci SIZE SEED

Along gains, all gains together and parameters of the arm.  At both ends and in the middle every listed pole is compared
with those of a box that a winding number completes; how many loci were refused, how many branches end on the way, and
how many crossings are on no branch.
"""

import numpy as np

import tfarm
from tests import survey
from tests.plausible.arms import draw
from tests.survey import Finding
from tfarm.errors import ConvergenceError
from tfarm.loop.locus import locus
from tfarm.loop.poles import poles_below

SHARES = {"K1": 0.35, "K2": 0.25, "Kp": 0.05, "all": 0.1, "damping": 0.1, "length": 0.05, "hub_inertia": 0.05,
          "payload_mass": 0.05}  # fmt: skip
SAME = 1e-7  # of its size: a pole by two methods, where no other is near
CLOSE = 1e-4  # of its size: poles so near to each other are not compared, nor those nearer to 0 than that of the first


def some_locus(number, seed):
    """Arm, law, what varies and the range."""
    case, rng = draw(number, seed), np.random.default_rng([seed, number])
    arm = case.arm
    law = tfarm.HubFeedback(K1=case.law.K1, K2=case.law.K2, Kp=case.law.Kp)
    vary = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    beam = arm.link.rhoA * arm.link.length
    ranges = {
        "K1": (0.0, 2 * abs(law.K1)), "K2": (0.0, 2.0) if rng.random() < 0.5 else (-1.0, 3.0),
        "Kp": (0.0, 2 * law.Kp or abs(law.K1)), "all": (0.0, 2.0),
        "damping": (arm.damping, 4 * arm.damping or 1e-5 / case.first), "length": (arm.length, 1.5 * arm.length),
        "hub_inertia": (arm.hub.inertia, 3 * arm.hub.inertia),
        "payload_mass": (arm.payload.mass, 2 * arm.payload.mass + 0.1 * beam),
    }  # fmt: skip
    return arm, law, vary, *ranges[vary]


def wrong_points(found):
    """Listed poles that are none of a complete box, at three of the values."""
    wrong = 0
    for n in (0, found.gain.size // 2, found.gain.size - 1):
        here = found.branches[:, n]
        here, lowest = here[~np.isnan(here) & (here.imag >= 0)], abs(found.branches[found.mode == 1, n]).max()
        complete = poles_below(found.varied.at(float(found.gain[n])), 1.01 * here.imag.max())
        poles, inside = complete.values, here[(abs(here) > CLOSE * lowest) & complete.box.holds(here)]
        for zero in inside:
            away = np.sort(abs(poles - zero)) / abs(zero)
            wrong += bool(away.size and away[0] > SAME and (away.size < 2 or away[1] - away[0] > CLOSE))
    return wrong


def loci(size, seed):
    """The finding on each locus."""
    for number in range(1, size + 1):
        arm, law, vary, start, stop = some_locus(number, seed)
        name = f"arm {number} of seed {seed}, {vary} from {start:g} to {stop:g}"
        try:
            found = locus(arm, law, vary, start, stop, 60, 10)
            wrong = wrong_points(found)
        except ConvergenceError as error:
            yield Finding("refused", f"{name}: {error}")
            continue
        figures = {
            "with a branch that ends": bool(found.ends),
            "with crossings on no branch": any(each.branch is None for each in found.crossings),
        }
        words = f"{name}: {wrong} listed poles are none" if wrong else ""
        yield Finding("wrong" if wrong else "right", words, bool(wrong), figures)


if __name__ == "__main__":
    survey.main(loci, size=500, seed=2026)
