"""Window ends that are those of a band alone say so, and rightly: a higher band has nearer ones."""

import math

import pytest

import tfarm
from tests.shell import run
from tfarm.loop.loop import Loop
from tfarm.loop.margins import margins
from tfarm.loop.windows import line_crossings
from tfarm.spectrum.table import default_gains


def test_behind_an_inductance_the_lowest_K2_is_that_of_its_band():
    """Elastic links: each higher mode is driven by less; the answer names the band, which a higher one undercuts."""
    arm = tfarm.load("quanser-flexlink")
    law = default_gains(arm)
    found = margins(arm, law)
    assert "some may cross inside them" in found.intervals_note
    band = found.windows["K2"].band
    assert math.isfinite(band)
    low = found.windows["K2"].around[0]
    higher = line_crossings(Loop(arm, law), "K2", 2 * low, 0.0, 4 * band).gain
    assert 0.5 * low < higher[higher < 0].max() < 0


def test_the_table_says_so_too(capsys):
    _, out, _ = run(capsys, "margins", "quanser-flexlink")
    assert "window ends are those of poles up to" in out


@pytest.mark.parametrize(("name", "reach"), [("sasaki2012", math.inf), ("sasaki2012-lab", None)])
def test_where_all_is_known_nothing_is_said(name, reach):
    arm = tfarm.load(name)
    found = margins(arm, default_gains(arm))
    assert found.intervals_note is None
    assert reach in (None, found.windows["K2"].band)
