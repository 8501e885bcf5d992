"""Grids on loci against the definitions of damping ratio and natural frequency; arrows and marks against the poles."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import tfarm
from tfarm.digits import plain
from tfarm.loop.locus import locus
from tfarm.plots import locus as locus_plot
from tfarm.plots.roots import s_grid, z_grid
from tfarm.spectrum.gains import default_gains

LAB = tfarm.load("sasaki2012-lab")
LAW = default_gains(LAB)


def lines_of(ax):
    return [line.get_xdata() + 1j * line.get_ydata() for line in ax.lines if len(line.get_xdata())]


@pytest.mark.parametrize("limits", [(-160.0, 40.0, -100.0, 1900.0), (-3.0, 0.5, 180.0, 220.0), (-50.0, 1.0, 0.0, 30.0)])
def test_lines_of_the_s_plane_have_the_damping_ratio_and_the_frequency_at_them(limits):
    left, right, low, high = limits
    ax = Figure().subplots()
    ax.set(xlim=(left, right), ylim=(low, high))
    s_grid(ax)
    ratios, frequencies = [], []
    for s in lines_of(ax):
        s = s[s != 0]
        if s.size == 1:
            ratios.append(-np.cos(np.angle(s[0])))
        else:
            assert abs(s) == pytest.approx(abs(s[0]), rel=1e-12)
            frequencies.append(abs(s[0]))
        assert (s.real >= left * (1 + 1e-12)).all()
    named = [text.get_text() for text in ax.texts]
    assert [f"ζ {plain(float(ratio))}" for ratio in ratios] == [text for text in named if "ζ" in text]
    assert [plain(float(omega), 4) for omega in frequencies] == [text for text in named if "ζ" not in text]
    assert len(ratios) > 1
    assert len(frequencies) > 2


def test_lines_of_the_z_plane_are_those_of_the_s_plane_sampled():
    """ln z = s T: its damping ratio, and its size in parts of pi."""
    ax, given = Figure().subplots(), (0.05, 0.2, 0.6)
    z_grid(ax, given)
    found = [np.log(z[(abs(z.imag) > 1e-12) & (abs(z) < 1)]) for z in lines_of(ax)]
    ratios, frequencies = found[: len(given)], found[len(given) :]
    for ratio, s in zip(given, ratios, strict=True):
        assert -np.cos(np.angle(s)) == pytest.approx(ratio, rel=1e-12)
    for tenths, s in zip(range(1, 10), frequencies, strict=True):
        assert abs(s) / np.pi == pytest.approx(tenths / 10, rel=1e-12)


@pytest.mark.parametrize(("start", "stop"), [(-1.0, 1.6), (1.6, -1.0)])
def test_arrows_point_to_growing_gain(start, stop):
    """The branch below an arrow has a larger gain at its head than at its tail, whichever way the record runs."""
    found = locus(LAB, LAW, "K2", start, stop, points=400, branches=5)
    ax = locus_plot.figure(found).axes[0]
    arrows = [each for each in ax.texts if each.arrow_patch is not None]
    assert len(arrows) > 2
    for arrow in arrows:
        head, tail = (complex(*place) for place in (arrow.xy, arrow.get_position()))
        away = [abs(found.branches - place) for place in (head, tail)]
        branch = np.nanargmin(np.nanmin(away[0] + away[1], axis=1))
        at_head, at_tail = (found.gain[np.nanargmin(each[branch])] for each in away)
        assert at_head > at_tail


def test_a_pole_beyond_the_frame_has_a_triangle_at_its_edge_with_its_value():
    found = locus(LAB, LAW, "K1", 0.0, 93.0, points=100, branches=7)
    figure = locus_plot.figure(found)
    ax = figure.axes[0]
    (left, right), (_, high) = ax.get_xlim(), ax.get_ylim()
    last = found.branches[:, -1]
    (far,) = last[last.real < left]
    assert far.real < 3 * left
    (mark,) = (line for line in ax.lines if line.get_marker() == "<")
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (left, far.imag)
    assert plain(float(far.real), 3) in [text.get_text() for text in ax.texts]
    modes = found.branches[found.origin > 0]
    modes = modes[modes.imag > 0]
    assert ((left < modes.real) & (modes.real < right) & (modes.imag < high)).all()
