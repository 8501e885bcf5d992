"""Where gains keep a loop stable, continuous and sampled, over the plane of both, and the picture of that.

Each region is a list of intervals of one gain at each value of the other, with exact edges (D-decomposition in `loop`
and in `dsp`); nothing is read off a raster.  Edges are rounded as they are seen in a picture of that plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullFormatter

from tfarm.arm import PLANE, Arm, HubFeedback, shown_unit
from tfarm.arrays import Complex, Real
from tfarm.columns import Column, Table
from tfarm.digits import plain, scientific
from tfarm.dsp import Chain, GainMap, sampled_map, sampled_verdict
from tfarm.dsp.crossings import ends_of_K1, rounded_map, with_both_sides, with_more
from tfarm.errors import ConvergenceError
from tfarm.loop.plane import Axis, Plane, gain_map, rate_columns
from tfarm.spectrum.table import default_gains

from .plane import draw_region
from .style import BLUE, GREY, INK, ORANGE, picture
from .words import LYAPUNOV, gains_words, name_axes

K2_RANGE = (-1.0, 1.5)  # of what balances a torque: 1 where the input is one, less where it is a motor's current
CUT_RANGE = (-1.02, 1.52)  # of the same: where intervals are cut, just outside the picture: no cut is seen as an edge
OVERLAY_COLUMNS = 72  # values of the gain across, and either side of upright edges
LITTLE_DAMPINGS = (1e-4, 1e-6)  # s: what is drawn beside C = 0
OVERLAY_ASPECT = 1.8  # times as wide as high the picture is, about
BEYOND_STABLE = 1.7  # of the largest stable gain across: how far the picture goes
SEEN_AS_ONE = 1e-3  # ends as close as this are seen as one
BELOW_GAIN = 15.0  # so many times below the gain across of the law the picture begins, on its logarithmic axis
SAMPLED_COLUMNS = 120  # values of the gain across at which the sampled region is cut, besides its exact ends
MAP_ASPECT = 1.5  # times as wide as high the picture is, about
BEYOND_PICTURE = 0.1  # of the gain up the plane, beyond the picture: an edge there is none of the region


class StableRegions(NamedTuple):
    """Both regions of one arm.  `sampled` has the arm's own C; at C = 0 also what a little damping would give."""

    continuous: Plane
    sampled: tuple[GainMap, ...]  # most damping first, so that each lies on the one before


def stable_regions(arm: Arm, gains: HubFeedback, chain: Chain) -> StableRegions:
    """The regions around these gains.  Raises ParameterError where the arm has no loop."""
    dampings = (arm.damping,) if arm.damping else (*LITTLE_DAMPINGS, 0.0)
    loops = [sampled_verdict(arm.having(damping=C), gains, chain).full for C in dampings]
    ends = np.unique(np.concatenate([ends_of_K1(loop) for loop in loops]))
    ends = ends[ends > 0]
    ends = ends[np.diff(ends, prepend=0.0) > SEEN_AS_ONE * ends]
    own, _ = gains.point
    span, cut = (arm.input_per_torque * np.array(ends) for ends in (K2_RANGE, CUT_RANGE))
    low, furthest = own / BELOW_GAIN, BEYOND_STABLE * max([own, *ends])
    power = 10.0 ** math.floor(math.log10(furthest))
    top = next(step * power for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * power >= furthest)
    across = with_both_sides(np.geomspace(low, top, OVERLAY_COLUMNS), ends)
    across = across[(low <= across) & (top >= across)]

    def drawn(across: Real, up: Real) -> Complex:
        return np.asarray(
            OVERLAY_ASPECT * np.log(across / low) / np.log(top / low) + 1j * (up - span[0]) / np.ptp(span)
        )

    planes = [rounded_map(sampled_map(loop, across, cut), drawn) for loop in loops]
    every = np.unique(np.concatenate([plane.axes[0] for plane in planes]))
    return StableRegions(gain_map(arm, every, cut), tuple(with_more(plane, every) for plane in planes))


def regions_table(data: StableRegions, stem: str) -> Table:
    """The numbers of the picture: at each value of the gain across the ends of the stable intervals of the other."""
    own = data.continuous.arm.damping
    each = {"continuous_K2_intervals": data.continuous.stable_intervals}
    for plane in data.sampled:
        C = plane.loop.plant.arm.damping
        each["sampled_K2_intervals" if own == C else f"sampled_at_C_{C:g}_s"] = plane.stable_intervals
    columns = [
        Column(key, key, of=[tuple(float(end) for window in column for end in window) for column in intervals])
        for key, intervals in each.items()
    ]
    across, up = PLANE
    values = Column(across, across, shown_unit(across, data.continuous.arm), of=data.continuous.axes[0])
    title = f"Stable intervals of {up}, continuous and sampled"
    return Table(stem=stem, title=title, columns=(values, *columns))


@lru_cache(maxsize=8)
def sampled_region(arm: Arm, x: Axis, y: Axis, chain: Chain) -> GainMap | None:
    """Where in the picture the sampled loop is stable, with the modes of the verdict on the default gains."""
    try:
        loop = sampled_verdict(arm, default_gains(arm), chain).full
        across = with_both_sides(rate_columns(arm, x, SAMPLED_COLUMNS), ends_of_K1(loop))
        across = across[(x.low <= across) & (x.high > across)]
        plane = sampled_map(loop, across, [y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE])
        return rounded_map(plane, lambda across, up: np.asarray(MAP_ASPECT * x.place(across) + 1j * y.place(up)))
    except ConvergenceError:
        return None


SAND = "#f6dfcb"
DAMPING_BLUES = ("#c9dcef", "#7fb0da", "#2f7cbc")  # lightest: most damping
CONVENTION = "u = −{} dθ/dt − {} M;  a positive root moment M accelerates the hub".format(*PLANE)


def _planes(sampled: GainMap | Sequence[GainMap]) -> Sequence[GainMap]:
    return sampled if isinstance(sampled, Sequence) else [sampled]


def _title(continuous: Plane, sampled: GainMap | Sequence[GainMap]) -> str:
    ms = plain(1e3 * _planes(sampled)[0].loop.chain.sampling.period)
    return f"{continuous.arm.name}: gains that keep the loop stable, continuous and sampled every {ms} ms"


@picture(
    (Plane, "tfarm.map returns of gains at the hub"), (GainMap, "tfarm.dsp.sampled_map returns"), size=(9.0, 5.4),
    title=_title,
)  # fmt: skip
def overlay(continuous: Plane, sampled: GainMap | Sequence[GainMap], *, ax: Axes) -> None:
    """Both regions of the two gains, in the axes given or in new ones; the axes.

    `continuous` is what `tfarm.map` returns, `sampled` what `tfarm.dsp.sampled_map` does: several, for arms with ever
    less damping, lie on each other.  The point is the law of the sampled loop.
    """
    planes = _planes(sampled)
    (low, *_, high), (bottom, *_, top) = continuous.axes
    if low > 0:
        ax.set_xscale("log")
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    ax.set(xlim=(low, high), ylim=(bottom, top))
    ax.grid(False)
    ax.axhline(0.0, color=GREY, lw=0.7, zorder=3.5)
    name_axes(continuous.arm, ax)
    ax.set_title(CONVENTION, loc="right", fontsize=8.5, color=GREY)
    colours = DAMPING_BLUES[1:2] if len(planes) == 1 else DAMPING_BLUES
    regions: list[tuple[Plane | GainMap, str, str, str]] = [
        (continuous, SAND, ORANGE, "stable, continuous: every mode")
    ]
    regions += [(plane, colour, BLUE, _label(continuous, plane)) for plane, colour in zip(planes, colours, strict=True)]
    keys: list[Any] = []
    for region, colour, edge, label in regions:
        draw_region(region.x, region.stable_intervals, edge, 0.9, 2.5, ax, facecolor=colour, edgecolor="none")
        keys.append(Patch(facecolor=colour, edgecolor=edge, linewidth=0.9, label=label))
    if continuous.arm.is_uniform:  # of a rig the argument needs more: see `tfarm.loop.theorem`
        keys += ax.plot((low, high), (1.0, 1.0), color=INK, lw=1.1, ls=(0, (5, 3)), zorder=4)
        keys[-1].set_label(f"below it: proven by energy at C = 0 ({LYAPUNOV})")
    keys.append(Patch(facecolor="white", edgecolor=GREY, linewidth=0.9, label="stable in neither"))
    law = planes[0].loop.gains
    keys += ax.plot(*law.point, "o", color="white", mec=INK, mew=1.4, ms=7, zorder=6, ls="none", label=gains_words(law))
    ax.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.0, -0.13), ncols=2, borderaxespad=0.0)


def _label(continuous: Plane, plane: GainMap) -> str:
    """What a sampled region holds for: the modes at C = 0, the damping where it is not the arm's own."""
    C = plane.loop.plant.arm.damping
    if C == 0.0:
        return f"stable, sampled, C = 0: the first {plane.modes_used} modes"
    return "stable, sampled" + ("" if continuous.arm.damping == C else f", if C were {scientific(C, 1)} s")


def draw_overlay(data: StableRegions) -> Figure:
    """Both regions of an arm on a figure of its own, as high as moment gains are of use."""
    figure = overlay.figure(*data)
    unit = data.continuous.arm.input_per_torque
    figure.axes[0].set_ylim(*(unit * end for end in K2_RANGE))
    return figure
