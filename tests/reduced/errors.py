"""The printed worst error against the true one on random arms:  python -m tests.reduced.errors SIZE SEED

Each arm is reduced to a random order for random outputs over a random band.  The true error is that of the matrices of
the state space, on a grid of its own: even, logarithmic and random frequencies, none chosen by the code under test.
"""

import math
from dataclasses import dataclass

import numpy as np

import tfarm
from tests import survey
from tests.outputs import OF_ONE_LINK
from tests.strategies import some_arm
from tests.survey import Finding, each_of
from tfarm.reduced import reduce

ALONG = [name for name, each in OF_ONE_LINK.items() if each.place == "x"]
AT_ENDS = [name for name, each in OF_ONE_LINK.items() if each.place != "x"]


@dataclass(frozen=True)
class Case:
    """A reduction, the error printed with it, and the largest one found."""

    reduced: object
    printed: float
    found: float
    at: float


def measure(rng, points, *, damping=0.0):
    """One random arm reduced, and its error looked for at so many frequencies."""
    arm = some_arm(rng, damping=damping)
    first = tfarm.modes(arm, 1).natural_frequency[-1]
    high = float(first * 10 ** rng.uniform(-0.5, 1.2))
    band = (high * float(10 ** rng.uniform(-4, -0.5)), high)
    along = rng.random() < 0.2
    names = [str(name) for name in rng.choice(ALONG if along else AT_ENDS, size=2, replace=False)]
    if arm.is_locked:
        names = [name for name in names if name != "hub_rate"]
    x = arm.link.length * float(rng.uniform(0.05, 0.95)) if along else None
    method = [None, "modal"][rng.integers(2)] if damping == 0 else None
    order = 2 * int(rng.integers(2, 12)) + (int(rng.integers(2)) if damping else 0)
    reduced = reduce(arm, names, order=order, method=method, band=band, x=x)
    w = grid(rng, band, points)
    found, at = true_error(reduced, w)
    if found > reduced.worst_error:  # rounding of the exact values, or a real miss: proven digits tell
        found, at = true_error(reduced, np.array([at]), proven=True)
    return Case(reduced, reduced.worst_error, found, at)


def grid(rng, band, points):
    """A third of the frequencies even, a third logarithmic, a third random."""
    third = points // 3
    low, high = band
    w = np.r_[np.linspace(low, high, third), np.geomspace(low, high, third), rng.uniform(low, high, third)]
    return np.clip(w, low, high)


def true_error(reduced, w, *, proven=False):
    """The largest |dG| / (|G| + |w G'|) on the grid, and where; G to proven digits if asked."""
    G = tfarm.transfer(reduced.arm, reduced.outputs, x=reduced.model.x)
    exact = G(1j * w)
    if proven:
        exact = np.array([[complex(float(re), float(im)) for re, im in G.digits(1j * each, 17)] for each in w]).T
    if G.x is None:
        slope = G.derivative(1j * w)
    else:
        step = 1e-7 * w
        slope = (G(1j * w + step) - G(1j * w - step)) / (2 * step)
    size = abs(exact) + abs(w * slope)
    gap = abs(by_matrices(reduced, w) - exact)
    error = np.where(size > 0, gap / np.where(size > 0, size, 1.0), np.where(gap > 0, math.inf, 0.0)).max(axis=0)
    return float(error.max()), float(w[error.argmax()])


def by_matrices(reduced, w):
    """C (i w - A)^-1 B + D, blocks of two states at a time by Cramer's rule, as no function of the model has it."""
    A, B, C, D = reduced.matrices()
    s, value = 1j * w, np.zeros((len(C), w.size), complex) + D
    if len(A) % 2:
        value += C[:, -1:] * B[-1, 0] / (s - A[-1, -1])
    for i in range(0, len(A) - 1, 2):
        (a, b), (c, d) = A[i : i + 2, i : i + 2]
        determinant = (s - a) * (s - d) - b * c
        x1 = ((s - d) * B[i, 0] + b * B[i + 1, 0]) / determinant
        x2 = (c * B[i, 0] + (s - a) * B[i + 1, 0]) / determinant
        value += C[:, i, None] * x1 + C[:, i + 1, None] * x2
    return value


def reductions(rng):
    """The finding on one reduction: the true error over the printed one, of which 1 is the limit."""
    case = measure(rng, 30_000, damping=float(rng.choice([0.0, 10 ** rng.uniform(-7, -3)])))
    share = case.found / case.printed
    words = f"{case.reduced.name} {case.reduced.outputs} {case.printed} {case.found} {case.at} {case.reduced.arm}"
    return Finding("above" if share > 1 else "within", words * (share > 1), share > 1, {"true/printed": share})


if __name__ == "__main__":
    survey.main(each_of(reductions), seed=0)
