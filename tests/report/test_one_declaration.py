"""Tables that commands and pages share say what the records hold, read here from the records' own arrays."""

import csv
import io
import math

import numpy as np
import pytest

import tfarm
from tfarm.loop.plane import INFINITE
from tfarm.response.answers import bode_answer, roots_table
from tfarm.schema import curve_table
from tfarm.tables.files import as_csv, to_json

LAB, PURE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")


def read(table):
    """The columns of its CSV file, as numbers where they are some."""
    header, *rows = csv.reader(io.StringIO(as_csv(table)))
    return dict(zip(header, (list(map(value, column)) for column in zip(*rows, strict=True)), strict=True))


def value(text):
    try:
        return float(text)
    except ValueError:
        return text


@pytest.mark.parametrize("arm", [LAB, PURE], ids=lambda arm: arm.name)
def test_a_command_and_a_page_list_the_same_poles_and_zeros(arm):
    data = tfarm.bode(arm, "tip_displacement", (1.0, 900.0))
    roots, sizes = np.r_[data.poles, data.zeros], np.r_[data.at_poles, data.at_zeros]
    found, page = bode_answer(data), read(roots_table(data, "pole", "zero"))
    rows = [*found["poles"], *found["zeros"]]
    for given, key in ((roots.real, "re"), (roots.imag, "im"), (sizes, "magnitude")):
        assert [row[key] for row in rows] == given.tolist()
    assert page["kind"] == ["pole"] * data.poles.size + ["zero"] * data.zeros.size
    assert (page["imaginary_rad_s"], page["magnitude"]) == (roots.imag.tolist(), sizes.tolist())
    np.testing.assert_allclose(page["frequency_hz"], roots.imag / math.tau, rtol=1e-15)
    np.testing.assert_allclose(page["damping_percent"], -100 * np.cos(np.angle(roots)), atol=1e-12)
    assert '"inf"' in to_json(found) if arm is PURE else all(np.isfinite(sizes))


def test_of_a_zero_on_the_axis_a_page_leaves_the_rounding_out():
    """Of a rig that loses at its hub alone the zeros of the root moment are on the axis, of a damped link off it."""
    for arm in (LAB, tfarm.load("quanser-2dsfl")):
        data = tfarm.bode(arm, "root_moment")
        page = np.array(read(roots_table(data, "zero"))["real_1_s"])
        np.testing.assert_allclose(page, data.zeros.real, rtol=0, atol=1e-13 * abs(data.zeros).max())
        assert (page == 0.0).all() if arm.has_elastic_link else (page < 0.0).all()
    assert data.zeros.real.any()  # rounding, which a command shows


def test_a_plane_has_its_counts_where_they_are():
    """Each row of the file, looked up in the record: rows of counts go along the second gain."""
    K1, K2 = np.linspace(-1.0, 1.0, 5), np.linspace(0.25, 1.75, 3)
    found = tfarm.map(PURE, K1, K2)
    page = read(curve_table(found))
    assert len(page["K1"]) == K1.size * K2.size
    for x, y, count in zip(*page.values(), strict=True):
        there = found.unstable[int(abs(K2 - y).argmin()), int(abs(K1 - x).argmin())]
        assert count == (math.inf if there == INFINITE else there)
    assert {math.inf, 0.0} < set(page["unstable_roots"])


def test_a_branch_that_ends_is_empty_beyond():
    found = tfarm.locus(LAB, tfarm.HubFeedback(), "K1", 0.0, 2000.0, 41, 5)
    ((branch, last),) = found.ends
    page = read(curve_table(found))
    rows = [n for n, gain in enumerate(found.gain) if gain > last]
    assert rows
    for part in ("re", "im"):
        cells = page[next(key for key in page if key.startswith(f"{part}_") and key.endswith(f"_{branch}"))]
        assert [n for n, cell in enumerate(cells) if cell == ""] == rows
