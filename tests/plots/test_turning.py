"""Loci as they are drawn: on no piece of a line is a corner to be seen that the poles have not."""

import numpy as np
import pytest

import tfarm
from tfarm.case import Case
from tfarm.crossing import pieces
from tfarm.dsp import load_chain
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.locus import locus, refine_branches
from tfarm.loop.plane import moment_axis
from tfarm.loop.plane_axes import rate_axis
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_modes import sampled_loci
from tfarm.plots import locus as locus_plot
from tfarm.plots.roots import draw_sampled_loci
from tfarm.spectrum.gains import default_gains, rate_unit
from tfarm.synthesis.stability_map import sampled_region

LAB, STOCKY = tfarm.load("sasaki2012-lab"), tfarm.load("stocky-steel")
MOST = 5.0  # degrees from one piece of a line to the next
PIXEL = 2.0  # as wide as the thinnest line: a corner between pieces that are shorter is not seen


def seen_turns(line):
    """How far [deg] a line turns at each point between pieces longer than a pixel, where it does not leave or meet the
    real axis."""
    x, y = line.get_data()
    pixels = line.axes.transData.transform(np.c_[x, y]) @ [1, 1j]
    pieces, is_real = np.diff(pixels), np.asarray(y) == 0
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = abs(np.degrees(np.angle(pieces[1:] / pieces[:-1])))
    corner = (is_real[1:-1] != is_real[:-2]) | (is_real[1:-1] != is_real[2:])
    seen = (abs(pieces) > PIXEL)[1:] | (abs(pieces) > PIXEL)[:-1]
    parted = is_real[:-1] != is_real[1:]
    assert not (abs(pieces[parted & np.isfinite(pieces)]) > PIXEL).any()  # a true corner, and nothing of it cut off
    along = is_real[:-2] & is_real[1:-1] & is_real[2:]
    return turn[np.isfinite(turn) & seen & ~corner & ~along], int((parted & np.isfinite(pieces)).sum())


LEAD = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)


def of_gains(arm, vary, start, stop):
    return locus_plot.figure(locus(arm, default_gains(arm), vary, start, stop, points=60, branches=5))


def sampled():
    return draw_sampled_loci.figure(
        sampled_loci(sampled_loop(Case(LAB, default_gains(LAB)), count=3), 25.0, (-0.5, 1.5))
    )


@pytest.mark.parametrize(
    ("make", "width", "corners"),
    [
        (lambda: of_gains(LAB, "K2", -1.0, 1.6), 2.6, 2),  # through a breakaway
        (lambda: of_gains(STOCKY, "K1", 0.0, 2 * rate_unit(STOCKY)), 2.6, 0),
        (lambda: locus_plot.figure(locus(LAB, LEAD, "gain", 1.0, 8.0, points=8, branches=1)), 2.6, None),
        (sampled, 1.4, None),
    ],
    ids=["through a breakaway", "without", "of any law", "sampled"],
)
def test_no_branch_turns_by_more_than_five_degrees(make, width, corners):
    """Two roots that meet on the real axis part at a right angle: a true corner, once on either branch."""
    figure = make()
    figure.draw_without_rendering()
    for ax in figure.axes:
        turns = [seen_turns(line) for line in ax.lines if line.get_linewidth() == width and len(line.get_xdata()) > 1]
        assert corners is None or sum(count for _, count in turns) == corners
        assert corners == 0 or sum(turn.size for turn, _ in turns) > 5
        assert max(turn.max(initial=0.0) for turn, _ in turns) <= MOST


def test_the_outline_of_a_sampled_region_is_that_of_its_poles():
    """By eigenvalues a little inside and outside the middle of each piece of the outline that is drawn, and no turn
    beyond 5 degrees but where it is no longer than a pixel."""
    x = rate_axis(LAB)
    y = moment_axis(LAB, x)
    plane = sampled_region(LAB, x, y, load_chain(LAB.name))
    aside, checked = 0.004, 0
    for piece in pieces(plane.K1, plane.stable_intervals):
        K1, low, high = np.array(piece.points).T
        line = x.place(np.r_[K1, K1[::-1]]) * 1.5 + 1j * y.place(np.r_[low, high[::-1]])
        line = line[np.abs(np.diff(line, prepend=np.nan)) != 0]
        step = np.diff(line)
        turn = abs(np.degrees(np.angle(step[1:] / step[:-1])))
        seen = (np.maximum(abs(step[1:]), abs(step[:-1])) > 2e-3) & (line[1:-1].imag > 0) & (line[1:-1].real < 1.5)
        assert turn[seen].max() <= MOST
        for n in np.flatnonzero(line[:-1].real > 0.9)[::4]:
            middle, normal = (line[n] + line[n + 1]) / 2, 1j * step[n] / abs(step[n])
            for side in (1, -1):  # the outline runs with its inside on the left
                place = middle + side * aside * normal
                K = [
                    np.interp(each, axis.place(g), g)
                    for each, axis, g in zip(
                        (place.real / 1.5, place.imag), (x, y), (x.grid(4000), y.grid(4000)), strict=True
                    )
                ]
                inside = plane.loop.with_number("K1", K[0]).with_number("K2", K[1]).poles.is_stable
                checked += inside == (side > 0)
                assert inside == (side > 0) or _near_a_corner(line, n)
    assert checked > 40


def _near_a_corner(line, n):
    """Whether another piece of the outline is as near as the points at the side of this one."""
    middle = (line[n] + line[n + 1]) / 2
    away = abs(line - middle)
    away[max(0, n - 3) : n + 5] = np.inf
    return away.min() < 0.02


def test_a_locus_under_any_law_keeps_its_poles():
    """The poles of the record stay, those between are zeros of 1 + L."""
    found = locus(LAB, LEAD, "gain", 1.0, 8.0, points=8, branches=1)
    fine = refine_branches(found)
    more = np.nonzero(~np.isin(fine.gain, found.gain))[0]
    assert more.size
    for value, poles in zip(found.gain, found.branches.T, strict=True):
        kept = fine.branches[:, fine.gain == value]
        assert set(poles[np.isfinite(poles)]) == set(kept[np.isfinite(kept)])
    for n in more[::3]:
        branches = fine.branches[np.isfinite(fine.branches[:, n]), n]
        assert (
            abs(
                1 + ContinuousLoop(Case(LAB, LEAD.with_number("gain", float(fine.gain[n])))).loop_function(branches)
            ).max()
            < 1e-6
        )
