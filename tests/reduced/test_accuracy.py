"""The printed error against errors known otherwise: planted ones, and random arms on grids of their own:

    python -m tests.reduced.test_accuracy SIZE SEED

Each arm is reduced to a random order for random outputs over a random band.  The true error is that of the matrices of
the state space, on a grid of its own: even, logarithmic and random frequencies, none chosen by the code under test.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests import survey
from tests.outputs import OF_ONE_LINK
from tests.reduced.test_modal import by_matrices
from tests.shared import thinned
from tests.strategies import some_arm
from tests.survey import Finding, each_of
from tfarm.reduced import modal_model, reduce
from tfarm.reduced.partial_fractions import EXACT_ROUNDING, Ruler, values_and_norm

# of a printed error over the largest one that the search finds
MARGIN = 1.02


def test_a_planted_error_is_found_whole(arm):
    """The static remainder moved by d: the error is |d|/(|G| + |w G'|), largest where that norm is smallest."""
    model = modal_model(arm, "root_moment", 60)
    planted = replace(model, static=model.static + 1e-3)
    worst, _ = Ruler(arm, "root_moment", (0.1, 1000.0)).measure(planted)
    w = np.linspace(0.1, 1000, 100_001)
    G = tfarm.transfer(arm, "root_moment")
    exact = G(1j * w)
    true = 1e-3 / (abs(exact) + abs(w * G.derivative(1j * w))).min()
    assert true <= worst[0] <= 1.03 * MARGIN * true


@pytest.mark.parametrize("moved", [1.3e-6, 2.7e-5])
def test_a_moved_pole_is_seen_between_the_samples(arm, moved):
    """Next to a pole that is moved by d the error is d^2/(w |w - p|): without bound, and as large as d at d from it."""
    model = modal_model(arm, "root_moment", 60)
    p = model.eigenvalues.copy()
    p[1] *= 1 + moved
    planted, ruler = replace(model, eigenvalues=p), Ruler(arm, "root_moment", (0.1, 1000.0))
    worst, at = ruler.measure(planted)
    assert worst[0] > max(moved, (10 if moved > 1e-5 else 1) * ruler.rough(planted))
    np.testing.assert_allclose(at[0], p[1, 0].imag, rtol=1e-4)


def test_the_margin_covers_a_peak_that_is_not_closed_in_on(arm):
    """Sixteen planted peaks on samples, and one a little higher midway between two, which they hide from the search.

    Each is a damped pair of poles p, so that the error is |r/(s - p) + conj|/(|G| + |w G'|), with signs that alternate.
    """
    model, ruler = modal_model(arm, "root_moment", 60), Ruler(arm, "root_moment", (0.1, 1000.0))
    at = np.array([abs(ruler.w - centre).argmin() for centre in np.linspace(620, 900, 17)])
    gap = ruler.w[at + 1] - ruler.w[at]
    width = np.where(np.arange(17) == 8, 1.0, 0.05) * gap
    centre, height = ruler.w[at].copy(), np.full(17, 1e-3)
    centre[8], height[8] = centre[8] + gap[8] / 2, 1.015e-3
    p = -width + 1j * centre
    r = height * width * values_and_norm(ruler.G, centre)[1][0] * (-1.0) ** np.arange(17)
    pair = [np.stack([each, each.conj()], axis=-1).astype(complex) for each in (p, r)]
    planted = model.with_pairs(pair[0], pair[1][None], model.static, np.ones(17))
    w = (centre[:, None] + width[:, None] * np.linspace(-1, 1, 401)).ravel()
    s = 1j * w[:, None]
    true = float((abs((r / (s - p) + r / (s - p.conj())).sum(axis=1)) / values_and_norm(ruler.G, w)[1][0]).max())
    printed = float(ruler.measure(planted)[0][0])
    assert printed / MARGIN < 0.998 * true, "the search found it after all: a test of nothing"
    assert true <= printed


def test_an_exact_model_has_the_error_of_rounding(arm):
    worst, _ = Ruler(arm, "hub_angle", (0.1, 100.0)).measure(modal_model(arm, "hub_angle", 100))
    assert worst.max() < 5 * EXACT_ROUNDING


@pytest.mark.parametrize("seed", thinned(range(5), 2))
def test_the_printed_error_contains_the_true_one(seed):
    """Two random arms a seed; `python -m tests.reduced.test_accuracy 500` does more of the same."""
    rng = np.random.default_rng([1, seed])
    for _ in range(2):
        reduced, found, _ = measure(rng, 6000, damping=float(rng.choice([0.0, 10 ** rng.uniform(-7, -4)])))
        assert found <= reduced.worst_error


ALONG = [name for name, each in OF_ONE_LINK.items() if each.place == "x"]
AT_ENDS = [name for name, each in OF_ONE_LINK.items() if each.place != "x"]


def measure(rng, points, *, damping=0.0):
    """One random arm reduced, and the largest error at `points` frequencies, with its place."""
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
    # a third even, a third logarithmic, a third random
    third = points // 3
    w = np.r_[np.linspace(*band, third), np.geomspace(*band, third), rng.uniform(*band, third)]
    found, at = true_error(reduced, np.clip(w, *band))
    if found > reduced.worst_error:  # rounding of the exact values, or a real miss: proven digits decide
        found, at = true_error(reduced, np.array([at]), proven=True)
    return reduced, found, at


def true_error(reduced, w, *, proven=False):
    """The largest |dG| / (|G| + |w G'|) on the grid, and where; G to proven digits if requested."""
    G = tfarm.transfer(reduced.arm, reduced.outputs, x=reduced.model.x)
    exact = G(1j * w)
    if proven:
        exact = np.array([[complex(float(re), float(im)) for re, im in G.digits(1j * each, 17)] for each in w]).T
    size = abs(exact) + abs(w * G.derivative(1j * w))
    gap = abs(by_matrices(reduced, 1j * w) - exact)
    error = np.divide(gap, size, out=np.where(gap > 0, math.inf, 0.0), where=size > 0).max(axis=0)
    return float(error.max()), float(w[error.argmax()])


def reductions(rng):
    """The finding on one reduction: the true error over the printed one, of which 1 is the limit."""
    reduced, found, at = measure(rng, 30_000, damping=float(rng.choice([0.0, 10 ** rng.uniform(-7, -3)])))
    share = found / reduced.worst_error
    words = f"{reduced.name} {reduced.outputs} {reduced.worst_error} {found} {at} {reduced.arm}"
    return Finding("above" if share > 1 else "within", words * (share > 1), share > 1, {"true/printed": share})


if __name__ == "__main__":
    survey.main(each_of(reductions), seed=0)
