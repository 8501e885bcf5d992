"""Columns that refine the outline of a sampled region, against counts by eigenvalues."""

import numpy as np

import tfarm
from tfarm.loop.circle_crossings import rounded_map, sampled_map
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.spectrum.table import default_gains


def test_every_column_that_refines_an_outline_counts_as_eigenvalues_do():
    arm = tfarm.load("sasaki2012-lab")
    loop = sampled_verdict(arm, default_gains(arm)).full
    plane = sampled_map(loop, np.linspace(1.0, 40.0, 5), np.linspace(-1.0, 1.5, 4))
    fine = rounded_map(plane, lambda x, y: np.asarray(x / 40.0 + 1j * y / 2.5))
    fresh = np.flatnonzero(~np.isin(fine.x, plane.x))
    assert fresh.size > 10
    for i in fresh[:: fresh.size // 5]:
        for j, K2 in enumerate(fine.y):
            assert fine.unstable[i, j] == loop.having("K1", float(fine.x[i])).having("K2", float(K2)).poles.unstable
    assert len(np.unique(fine.unstable[fresh])) > 1
