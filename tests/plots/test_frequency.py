"""Responses and mode shapes: what is drawn is what was computed."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import tfarm
from tfarm.plots.frequency import draw_magnitude, draw_phase
from tfarm.plots.style import style
from tfarm.response.frequency import bode, resonant_band


@pytest.fixture(scope="module")
def data():
    arm = tfarm.load("sasaki2012")
    return bode(arm, "root_moment", resonant_band(arm, 4))


@pytest.fixture
def ax():
    with style():
        yield Figure().subplots()


def line(ax, label):
    return next(line for line in ax.get_lines() if line.get_label() == label)


def test_the_curve_is_broken_at_every_infinity_and_runs_off_the_picture(data, ax):
    draw_magnitude(data, ax=ax)
    x, y = line(ax, "flexible arm, exact").get_data()
    gaps = np.flatnonzero(np.isnan(x))
    assert gaps.size == data.infinite.size + data.vanishing.size
    for i in gaps:
        assert x[i - 1] == x[i + 1]
        assert y[i - 1] == y[i + 1]
        is_infinite = x[i - 1] in data.infinite
        assert y[i - 1] > ax.get_ylim()[1] if is_infinite else y[i - 1] < ax.get_ylim()[0]
    drawn = ~np.isnan(x) & ~np.isin(x, np.r_[data.infinite, data.vanishing])
    assert np.array_equal(x[drawn], data.omega)
    assert y[drawn] == pytest.approx(20 * np.log10(abs(data.value)), rel=1e-13, abs=1e-12)


def test_open_triangles_sit_on_the_edges(data, ax):
    draw_magnitude(data, ax=ax)
    for label, roots, height in (
        ("pole on the imaginary axis", data.infinite, 1.0),
        ("zero on the imaginary axis", data.vanishing, 0.0),
    ):
        marks = next(line for line in ax.get_lines() if str(line.get_label()).startswith(label))
        assert np.array_equal(marks.get_xdata(), roots)
        assert set(marks.get_ydata()) == {height}
        assert marks.get_markerfacecolor() == "white"


def test_hertz_are_above(data, ax):
    draw_magnitude(data, ax=ax)
    assert "[dB re 1 N m/(N m)]" in ax.get_ylabel()
    (hertz,) = ax.child_axes
    assert "[Hz]" in hertz.get_xlabel()
    ax.figure.draw_without_rendering()
    assert np.array(hertz.get_xlim()) * 2 * np.pi == pytest.approx(ax.get_xlim())


def test_the_phase_steps_at_every_root(data, ax):
    draw_phase(data, ax=ax)
    x, y = ax.get_lines()[-1].get_data()
    assert np.array_equal(y[~np.isnan(y)], data.phase)
    assert np.isnan(x).sum() == data.infinite.size + data.vanishing.size
