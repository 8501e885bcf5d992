"""Where gains keep a loop stable, continuous and sampled, over the plane of both, and the picture of that.

Each region is a list of intervals of one gain at each value of the other, with exact edges (D-decomposition in `loop`
and in `dsp`); nothing is read off a raster.  Edges are rounded as they are seen in a picture of that plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arm import PLANE, Arm, HubFeedback, shown_unit
from tfarm.case import Comparison
from tfarm.digits import plain, scientific
from tfarm.dsp import Chain, GainMap, sampled_map, sampled_verdict
from tfarm.dsp.crossings import ends_of_K1, rounded_map, with_both_sides, with_more
from tfarm.errors import ConvergenceError
from tfarm.loop.plane import Axis, Plane, gain_map, rate_columns
from tfarm.schema import Column, Table
from tfarm.spectrum.table import default_gains

from .frequency import MOST_DRAWN, bode, draw_loops
from .plane import draw_region
from .style import BLUE, COLOURS, GREEN, GREY, INK, LYAPUNOV, ORANGE, gains_words, name_axes, picture, plain_ticks

K2_RANGE = (
    -1.0,
    1.5,
)  # of the gain that balances a torque: 1 where the input is one, less where it is a motor's current
CUT_RANGE = (-1.02, 1.52)  # of the same: where intervals are cut, just outside the picture: no cut is seen as an edge
OVERLAY_COLUMNS = 72  # values of the gain across, and either side of upright edges
LITTLE_DAMPINGS = (1e-4, 1e-6)  # s: drawn too at C = 0
OVERLAY_ASPECT = 1.8  # times as wide as high the picture is, about
BEYOND_STABLE = 1.7  # of the largest stable gain across: how far the picture goes
SEEN_AS_ONE = 1e-3  # ends as close as this are seen as one
BELOW_GAIN = 15.0  # divisor of the gain across of the controller: where the picture begins, on its logarithmic axis
SAMPLED_COLUMNS = 120  # values of the gain across at which the sampled region is cut, besides its exact ends
MAP_ASPECT = 1.5  # times as wide as high the picture is, about
BEYOND_PICTURE = 0.1  # of the gain up the plane, beyond the picture: an edge there is none of the region


class StableRegions(NamedTuple):
    """Both regions of one arm.  `sampled` has the arm's own C; at C = 0 also the regions with a little damping."""

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
    low, top = own / BELOW_GAIN, BEYOND_STABLE * max([own, *ends])
    across = with_both_sides(np.geomspace(low, top, OVERLAY_COLUMNS), ends)
    across = across[(low <= across) & (top >= across)]
    wide = OVERLAY_ASPECT / np.log(top / low)
    planes = [
        rounded_map(sampled_map(loop, across, cut), lambda x, y: np.asarray(wide * np.log(x) + 1j * y / np.ptp(span)))
        for loop in loops
    ]
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
    return Table(stem=stem, title=f"Stable intervals of {up}, continuous and sampled", columns=(values, *columns))


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


@picture(
    (Plane, "tfarm.map returns of gains at the hub"), (GainMap, "tfarm.dsp.sampled_map returns"), size=(9.0, 5.7),
    title=lambda continuous, _: f"{continuous.arm.name}: gains that keep the loop stable, continuous and sampled",
)  # fmt: skip
def overlay(continuous: Plane, sampled: GainMap | Sequence[GainMap], *, ax: Axes) -> None:
    """Both regions of the two gains, in the axes given or in new ones; the axes.

    `continuous` is from `tfarm.map`, `sampled` from `tfarm.dsp.sampled_map`: several, for arms with ever
    less damping, lie on each other.  The point is the controller of the sampled loop.
    """
    planes = sampled if isinstance(sampled, Sequence) else [sampled]
    ms = plain(1e3 * planes[0].loop.chain.sampling.period)
    (low, *_, high), (bottom, *_, top) = continuous.axes
    ax.set(xscale="log" if low > 0 else "linear", xlim=(low, high), ylim=(bottom, top))
    plain_ticks(ax.xaxis)
    ax.grid(False)
    ax.axhline(0.0, color=GREY, lw=0.7, zorder=3.5)
    name_axes(continuous.arm, ax)
    ax.set_title(CONVENTION, loc="right", fontsize=8.5, color=GREY)
    draw_region(
        continuous.x, continuous.stable_intervals, ORANGE, "stable, continuous: every mode", ax, width=0.9,
        facecolor=SAND,
    )  # fmt: skip
    for plane, colour in zip(planes, DAMPING_BLUES[len(planes) == 1 :], strict=False):
        C = plane.loop.plant.arm.damping
        hypothesis = "" if continuous.arm.damping == C else f", if C were {scientific(C, 1)} s"
        label = f"stable, sampled every {ms} ms{hypothesis if C else f', C = 0: the first {plane.modes_used} modes'}"
        draw_region(plane.x, plane.stable_intervals, BLUE, label, ax, width=0.9, facecolor=colour)
    if continuous.arm.is_uniform:  # of a rig the argument needs more: see `tfarm.loop.theorem`
        label = f"below it: proven by energy at C = 0 ({LYAPUNOV})"
        ax.axhline(1.0, color=INK, lw=1.1, ls=(0, (5, 3)), zorder=4, label=label)
    law = planes[0].loop.gains
    ax.plot(*law.point, "o", color="white", mec=INK, mew=1.4, ms=7, zorder=6, ls="none", label=gains_words(law))


def draw_overlay(data: StableRegions) -> Figure:
    """Both regions of an arm on a figure of its own, as high as moment gains are of use."""
    figure = overlay.figure(*data)
    figure.axes[0].set_ylim(*(data.continuous.arm.input_per_torque * end for end in K2_RANGE))
    return figure


# ------------------------------------------------------------ two arms, or two laws on one arm


def _grid(figure: Figure, _: Comparison) -> list[Axes]:
    grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1.0], height_ratios=[1.6, 1.0])
    return [figure.add_subplot(place) for place in (grid[0, 0], grid[1, 0], grid[:, 1])]


@picture((Comparison, "tfarm.compare returns"), size=(12.0, 6.2), grid=_grid, title=lambda data: data.verdict)
def comparison(data: Comparison, *, ax: Sequence[Axes]) -> None:
    """Magnitude, phase and map of both (from `tfarm.compare`), in three axes, those given or new ones: these.

    Of two arms the exact responses, of two laws the loop functions L; the map is that of both gains, with exact edges,
    or, where a law is more than these gains, or one in z, of a factor on each law and its further delay.  With a law
    in z all is of the loops at their samples.
    """
    upper, lower, right = ax
    names = [side.name for side in data.sides]
    if data.is_of_arms:
        bode(dict(zip(names, data.responses, strict=True)), ax=(upper, lower))
    else:
        draw_loops(dict(zip(names, (side.loop_function for side in data.sides), strict=True)), upper, lower)
        upper.set_ylabel("|L| at the samples" if data.is_sampled else "|L|, loop opened at the input")
    upper.set_xlabel("")
    right.grid(False)
    if data.is_sampled or data.regions is None:
        _factors(data, right)
        return
    first, other = data.regions
    for found, side, colour in zip(data.regions, data.sides, COLOURS, strict=False):
        edge, label = (GREEN, "stable") if first == other else (colour, f"{side.name}: stable")
        draw_region(found.x, found.stable_intervals, edge, label, right)
        assert side.gains is not None
        right.plot(*side.gains.point, "o", mfc=colour, mec="white", ms=7.5, zorder=7)
    right.set(xlim=(first.x[0], first.x[-1]), ylim=(first.y[0], first.y[-1]))
    name_axes(data.one.arm, right)


def _factors(data: Comparison, ax: Axes) -> None:
    """Factors that keep each loop stable, over the further delay of its law."""
    for found, side, colour in zip(data.reaches, data.sides, COLOURS, strict=False):
        draw_region(1e3 * found.delay, found.stable_intervals, colour, f"{side.name}: stable", ax)
    ax.plot([0.0], [1.0], "o", mfc=INK, mec="white", ms=7.5, zorder=7, clip_on=False, label="the laws as they are")
    ax.axhline(1.0, color=INK, lw=0.6)
    limits = {"xlim": (0.0, 1e3 * data.reaches[0].delay[-1]), "ylim": (0.0, min(ax.get_ylim()[1], MOST_DRAWN))}
    ax.set(xlabel="further delay [ms]", ylabel="factor on the law", **limits)
