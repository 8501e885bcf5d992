"""Tables that commands and pages share say what the records hold, read here from the records' own arrays."""

import csv
import io
import math

import numpy as np
import pytest
from tfarm.loop.answers import plane_table
from tfarm.response.answers import bode_answer, roots_table

import tfarm
from tfarm.columns import Table
from tfarm.loop.loci import branch_columns
from tfarm.loop.nyquist import nyquist_table
from tfarm.loop.plane import INFINITE
from tfarm.tables.files import as_csv, to_json

LAB, PURE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)


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


def test_the_contour_of_several_laws_is_that_of_each_after_the_other():
    laws = {"one": tfarm.nyquist(LAB, LAW), "two": tfarm.nyquist(LAB, LAW.having("K2", 1.5))}
    page = read(nyquist_table(*laws.values(), laws=list(laws)))
    assert page["law"] == ["one"] * laws["one"].s.size + ["two"] * laws["two"].s.size
    s, L = (np.concatenate([getattr(each, name) for each in laws.values()]) for name in ("s", "L"))
    for name, values in (("s", s), ("L", L)):
        assert (page[f"re_{name}"], page[f"im_{name}"]) == (values.real.tolist(), values.imag.tolist())


def test_a_plane_has_its_counts_where_they_are():
    """Each row of the file, looked up in the record: rows of counts go along the second gain."""
    K1, K2 = np.linspace(-1.0, 1.0, 5), np.linspace(0.25, 1.75, 3)
    found = tfarm.map(PURE, K1, K2)
    page = read(plane_table(("K1", "K2"), *found.axes, found.unstable))
    assert len(page["K1"]) == K1.size * K2.size
    for x, y, count in zip(*page.values(), strict=True):
        there = found.unstable[int(abs(K2 - y).argmin()), int(abs(K1 - x).argmin())]
        assert count == (math.inf if there == INFINITE else there)
    assert {math.inf, 0.0} < set(page["unstable_roots"])


def test_a_branch_that_ends_is_empty_beyond():
    branches = np.array([[-1 + 2j, -1.5 + 2.5j, -2 + 3j], [-4 + 0j, np.nan, np.nan]])
    page = read(Table(columns=tuple(branch_columns(branches, "{part}_{n}"))))
    assert list(page) == ["re_0", "im_0", "re_1", "im_1"]
    assert (page["re_0"], page["im_0"]) == (branches[0].real.tolist(), branches[0].imag.tolist())
    assert (page["re_1"], page["im_1"]) == ([-4.0, "", ""], [0.0, "", ""])
