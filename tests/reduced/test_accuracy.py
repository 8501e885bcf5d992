"""The printed error against errors known otherwise: planted ones, and random arms on grids of their own."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.reduced.errors import measure
from tests.shared import thinned
from tfarm.reduced import modal_model
from tfarm.reduced.partial_fractions import (
    EXACT_ROUNDING,
    FOUND_TO_WORST,
    Ruler,
)


@pytest.fixture(scope="module")
def arm():
    return tfarm.load("sasaki2012")


def test_a_planted_error_is_found_whole(arm):
    """The static remainder moved by d: the error is |d|/(|G| + |w G'|), largest where that norm is smallest."""
    model = modal_model(arm, "root_moment", 60)
    planted = replace(model, static=model.static + 1e-3)
    worst, _ = Ruler(arm, "root_moment", (0.1, 1000.0)).measure(planted)
    w = np.linspace(0.1, 1000, 100_001)
    G = tfarm.transfer(arm, "root_moment")
    exact = G(1j * w)
    true = 1e-3 / (abs(exact) + abs(w * G.derivative(1j * w))).min()
    assert true <= worst[0] <= 1.03 * FOUND_TO_WORST * true


def test_a_moved_pole_is_seen(arm):
    """A mode of the band 1e-6 too high: next to it the error is without bound, and 1e-6 wide of it that large."""
    model = modal_model(arm, "root_moment", 60)
    p = model.eigenvalues.copy()
    p[1] *= 1 + 1.3e-6
    worst, at = Ruler(arm, "root_moment", (0.1, 1000.0)).measure(replace(model, eigenvalues=p))
    assert worst[0] > 1e-6
    np.testing.assert_allclose(at[0], p[1, 0].imag, rtol=1e-4)


def test_peaks_between_the_samples_are_closed_in_on(arm):
    """Next to a pole that is moved by d the error is d^2/(w |w - p|): the nearer the look, the larger."""
    model = modal_model(arm, "root_moment", 60)
    p = model.eigenvalues.copy()
    p[1] *= 1 + 2.7e-5
    planted, ruler = replace(model, eigenvalues=p), Ruler(arm, "root_moment", (0.1, 1000.0))
    assert ruler.measure(planted)[0][0] > 10 * ruler.rough(planted)


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
    r = height * width * ruler.norm(centre)[0] * (-1.0) ** np.arange(17)
    pair = [np.stack([each, each.conj()], axis=-1).astype(complex) for each in (p, r)]
    planted = replace(
        model,
        index=np.r_[model.index, np.zeros(17, dtype=np.int64)],
        natural_frequency=np.r_[model.natural_frequency, abs(p)],
        eigenvalues=np.concatenate([model.eigenvalues, pair[0]]),
        residues=np.concatenate([model.residues, pair[1][None]], axis=1),
        participation=np.r_[model.participation, np.ones(17)],
    )
    w = (centre[:, None] + width[:, None] * np.linspace(-1, 1, 401)).ravel()
    s = 1j * w[:, None]
    true = float((abs((r / (s - p) + r / (s - p.conj())).sum(axis=1)) / ruler.norm(w)[0]).max())
    printed = float(ruler.measure(planted)[0][0])
    assert printed / FOUND_TO_WORST < 0.998 * true, "the search found it after all: a test of nothing"
    assert true <= printed


def test_an_exact_model_has_the_error_of_rounding(arm):
    worst, _ = Ruler(arm, "hub_angle", (0.1, 100.0)).measure(modal_model(arm, "hub_angle", 100))
    assert worst.max() < 5 * EXACT_ROUNDING


@pytest.mark.parametrize("seed", thinned(range(5), 2))
def test_the_printed_error_contains_the_true_one(seed):
    """Two random arms a seed; `python -m tests.reduced.errors 500` does more of the same."""
    rng = np.random.default_rng([1, seed])
    for _ in range(2):
        case = measure(rng, 6000, damping=float(rng.choice([0.0, 10 ** rng.uniform(-7, -4)])))
        assert case.found <= case.printed
