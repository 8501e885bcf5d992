"""The list of damped modes: each disc in the row of its eigenvalue, and rows of modes without one."""

from dataclasses import replace

import pytest

import tfarm
from tests.shared import thinned
from tfarm.schema import to_dict
from tfarm.spectrum.listing import listed_modes

LAB, RIG = tfarm.load("sasaki2012-lab"), tfarm.load("quanser-2dsfl")
RUBBED = replace(LAB, name="rubbed", hub=replace(LAB.hub, friction=0.4))


@pytest.mark.parametrize(("arm", "count"), thinned([(LAB.having(damping=1e-3), 8), (LAB, 4), (RUBBED, 3)], 2))
def test_each_disc_is_in_the_row_of_its_eigenvalue(arm, count):
    rows = listed_modes(tfarm.modes(arm, count), 15, certify=True).modes
    assert [row.index for row in rows] == list(range(count + 1))
    compared = 0
    for row in rows:
        if row.discs is None:
            assert row.eigenvalue in (None, 0) or row.second_eigenvalue is not None
            continue
        values = [each for each in (row.eigenvalue, row.second_eigenvalue) if each]
        assert len(values) == len(row.discs)
        for disc in row.discs:
            middle = complex(float(disc.re), float(disc.im))
            assert min(abs(middle - each) for each in values) <= 1e-9 * abs(middle)
            compared += 1
    assert compared >= count - 3


def test_a_disc_is_written_with_every_digit():
    found = to_dict(listed_modes(tfarm.modes(LAB, 1), 15, certify=True))
    (disc,) = found["modes"][1]["discs"]
    assert found["proven_complete_in_box"]
    assert disc.keys() == {"re", "im", "radius"}
    assert complex(float(disc["re"]), float(disc["im"])) == pytest.approx(complex(*found["modes"][1]["eigenvalue"]))


def test_modes_that_are_not_followed_have_their_rows(monkeypatch):
    """They keep their frequency; their damping is not determined."""
    monkeypatch.setattr("tfarm.spectrum.damped.MOST_MODES", 2)
    modes = tfarm.modes(RIG, 4)
    followed = len(tfarm.damped_modes(modes).index)
    assert followed < len(modes)
    rows = listed_modes(modes).modes
    assert len(rows) == len(modes)
    assert [row.eigenvalue is None for row in rows] == [n >= followed for n in range(len(modes))]
    assert all(row.damping_ratio is None for row in rows[followed:])
