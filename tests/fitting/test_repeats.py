"""Several records of one response: their scatter is the noise's where nothing else differs, and more where it does."""

from dataclasses import replace

import numpy as np
import pytest

from tests.fitting.test_fit import LAB, PAIRS, measured
from tests.shared import thinned
from tfarm.fitting.fit import fit
from tfarm.fitting.possible import repeats

OMEGA = np.geomspace(8.0, 600.0, 60)


def records(moduli):
    """A record of each of these arms."""
    arms = [replace(LAB, link=replace(LAB.link, youngs_modulus=E)) for E in moduli]
    return [measured(arm, PAIRS[:1], seed=n, omega=OMEGA)[0] for n, arm in enumerate(arms)]


@pytest.mark.parametrize("scatter", thinned([0.01, 0.0], 2))
def test_the_scatter_between_records(scatter):
    """E that differs by 1 % from sweep to sweep: of its mean over eight records that leaves 1 %/sqrt(8)."""
    shares = np.array([-1.2, 0.7, 0.1, 1.4, -0.6, -1.1, 0.9, -0.2])
    moduli = LAB.link.youngs_modulus * (1 + scatter * shares)
    found = fit(LAB, records(moduli), free=["link.youngs_modulus"], profile=False)
    told = repeats(found, draws=12)
    assert told.keys == ("link.youngs_modulus",)
    assert told.each[:, 0] == pytest.approx(moduli, rel=5e-3 if scatter else 2e-3)
    (times,) = told.times_wider
    if not scatter:
        assert 0.4 < times < 1.8  # of eight records: a deviation is known to 1/sqrt(14)
        return
    spread = told.drawn.std(ddof=1) / LAB.link.youngs_modulus
    assert spread == pytest.approx(scatter * shares.std(ddof=0) / np.sqrt(8), rel=0.5)
    assert times > 5
    ((low, high),) = told.intervals
    assert low < LAB.link.youngs_modulus < high


def test_two_records_have_no_scatter():
    assert (
        repeats(fit(LAB, records([LAB.link.youngs_modulus] * 2), free=["link.youngs_modulus"], profile=False)) is None
    )
