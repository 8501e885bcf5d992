"""Listed frequencies against a Ritz model, the count and ball arithmetic:  python -m tests.spectrum.ritz SIZE SEED

Random arms with every combination of zero, finite and infinite inertias in turn.  Of each the first twelve flexible
frequencies are those of a Ritz model, and no others; thirty are those of the count under one of the four theories; and
between floats next to the first twelve, D changes sign in balls.
"""

import math

import flint
import numpy as np

from tests import survey
from tests.models import Ritz
from tests.strategies import BOUNDARY_CASES, some_arm
from tests.survey import Finding
from tfarm.arm import THEORIES
from tfarm.exact import balls
from tfarm.exact.layout import Layout
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import Counter, count_below, natural_frequencies

EPS = np.finfo(float).eps
UNITS = (1, 2, 4, 8)  # in the last place, between which a sign change is sought
SLENDERNESS = ((5, 500), (1, 10))  # of the second most frequencies are above the cut-off


def random_arms(seed, count):
    """Each boundary case in turn."""
    rng = np.random.default_rng(seed)
    return [some_arm(rng, BOUNDARY_CASES[(seed + i) % len(BOUNDARY_CASES)], damping=0.0) for i in range(count)]


def against_ritz(arm):
    """What a Ritz model has against the first twelve flexible frequencies, none missing and none made up.

    Eigenvalues 1/w^2 of the Ritz model are right to some eps of the largest; its own frequencies, converged with 40
    polynomials, come from no count and no search.
    """
    k, rigid = system_of(arm), arm.has_rigid_mode
    omega = natural_frequencies(k, rigid + 1, rigid + 13)
    flexibility = Ritz(arm).flexibilities()[0][:13]
    rounding = EPS * (2000 + 10 * flexibility[0] / flexibility)
    wrong = abs(omega * np.sqrt(flexibility) - 1) > rounding
    if wrong[:12].any():
        return f"mode {np.nonzero(wrong)[0] + 1} is not the model's"
    between = math.sqrt(omega[11] * omega[12])
    counts = count_below(k, between), rigid + 12, rigid + int((flexibility > between**-2).sum())
    return "" if len(set(counts)) == 1 else f"{counts} by count, list and model"


def against_count(arm, theory):
    """What the count has against thirty: below each lie as many as its number less one, just above it its number."""
    k, rigid = system_of(arm, theory), int(arm.has_rigid_mode)
    omega = natural_frequencies(k, rigid + 1, rigid + 30)
    if not ((np.diff(omega) >= 0).all() and (omega > 0).all()):
        return "frequencies do not ascend"
    clear = np.diff(omega) > 1e-8 * omega[1:]
    apart = np.r_[True, clear] & np.r_[clear, False]
    number, count = np.arange(rigid + 1, rigid + 31), Counter(k)
    below, above = count(omega * (1 - 1e-9)), count(omega * (1 + 1e-9))
    agreed = (below[apart] == number[apart] - 1).all() and (above[apart] == number[apart]).all()
    return "" if agreed else f"list and count differ in the theory {theory}"


def sign(k, omega):
    """The sign of the real D(i omega) at an exact point, proven; the precision is raised until it is."""
    bits = 128
    while True:
        with balls.precision(bits):
            drive = balls.Sweep(Layout(k), flint.acb(0, omega)).input.real
            if not drive.contains(0):
                return 1 if drive > 0 else -1
        bits *= 2


def brackets(k, omega, units):
    """Whether D changes sign between `units` units in the last place below and above omega."""
    with balls.precision(256):
        ulp = units * flint.arb(math.ulp(omega))
        ends = flint.arb(omega) - ulp, flint.arb(omega) + ulp
    return sign(k, ends[0]) != sign(k, ends[1])


def last_places(arm):
    """Within how many units in the last place each of the first twelve frequencies is right (inf: of none)."""
    k, rigid = system_of(arm), arm.has_rigid_mode
    omega = natural_frequencies(k, rigid + 1, rigid + 12)
    return [next(n for n in (*UNITS, math.inf) if brackets(k, float(each), n)) for each in omega]


def arms_for_places(slenderness, count, seed=5):
    """Arms of a slenderness L/h, each boundary case in turn."""
    rng = np.random.default_rng(seed)
    return [some_arm(rng, BOUNDARY_CASES[i % 27], damping=0.0, slenderness=slenderness) for i in range(count)]


def verdict(text, arm):
    """The finding of what is wrong with an arm; nothing where it is right."""
    return Finding("wrong" if text else "right", f"{text} {arm}" if text else "", bool(text))


def model(size, seed):
    return (verdict(against_ritz(arm), arm) for arm in random_arms(seed, size))


def count(size, seed):
    return (verdict(against_count(arm, THEORIES[n % 4]), arm) for n, arm in enumerate(random_arms(seed + 1, size)))


def places(size, seed):
    """Eight units in the last place at most, and one for nine frequencies of ten."""
    for slenderness in SLENDERNESS:
        every = []
        for arm in arms_for_places(slenderness, max(27, size // 4), seed):
            every += (units := last_places(arm))
            yield verdict("more than 8 units off" if max(units) > 8 else "", arm)
        yield verdict(
            "fewer than nine of ten within one unit" if np.mean(np.array(every) == 1) <= 0.9 else "", slenderness
        )


if __name__ == "__main__":
    survey.main(model, count, places, size=1000)
