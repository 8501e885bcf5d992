"""The table of damped modes: each disc in the row of its eigenvalue, and rows of modes that were not followed."""

from dataclasses import replace

import pytest

import tfarm
from tests.shared import thinned
from tfarm.columns import JSON, TERMINAL
from tfarm.errors import MISSING
from tfarm.spectrum.answers import modes_answer

LAB, RIG = tfarm.load("sasaki2012-lab"), tfarm.load("quanser-2dsfl")
RUBBED = replace(LAB, name="rubbed", hub=replace(LAB.hub, friction=0.4))


def column(answer, key, output=JSON):
    (found,) = (each for each in answer["modes"].columns if each.key == key and output in each.on)
    return found.of


@pytest.mark.parametrize(("arm", "count"), thinned([(LAB.having(damping=1e-3), 8), (LAB, 4), (RUBBED, 3)], 2))
def test_each_disc_is_in_the_row_of_its_eigenvalue(arm, count):
    answer = modes_answer(tfarm.modes(arm, count), 15, certify=True)
    single, double, discs = (column(answer, key) for key in ("eigenvalue", "eigenvalues", "discs"))
    assert len(single) == len(double) == len(discs) == count + 1
    compared = 0
    for one, two, found in zip(single, double, discs, strict=True):
        if found is MISSING:
            assert one is MISSING or one == [0.0, 0.0] or two is not MISSING
            continue
        values = [complex(*one)] if two is MISSING else [complex(each) for each in two if each]
        assert len(values) == len(found)
        for disc in found:
            middle = complex(float(disc["re"]), float(disc["im"]))
            assert min(abs(middle - each) for each in values) <= 1e-9 * abs(middle)
            compared += 1
    assert compared >= count - 3


def test_modes_that_are_not_followed_have_their_rows(monkeypatch):
    """They keep their frequency; nothing is said of their damping."""
    monkeypatch.setattr("tfarm.spectrum.damped.MOST_MODES", 2)
    modes = tfarm.modes(RIG, 4)
    followed = len(tfarm.damped_modes(modes).index)
    assert followed < len(modes)
    answer = modes_answer(modes, None)
    texts = column(answer, "eigenvalue", TERMINAL)
    assert texts[followed:] == ["not followed"] * (len(modes) - followed)
    assert "not followed" not in texts[:followed]
    for key in ("eigenvalue", "eigenvalues", "damping_ratio"):
        assert column(answer, key)[followed:] == [MISSING] * (len(modes) - followed)
    assert len(column(answer, "natural_frequency_rad_s")) == len(modes)
