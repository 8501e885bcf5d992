"""Measured responses under the curves of a fitted arm, and what the data leave open: bands, and gains that hold.

A measured response over the exact one: magnitude, phase, and how coherent the measurement is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter

from tfarm.digits import plain
from tfarm.fitting.fit import Fit, Possible, response_band, share_stable
from tfarm.fitting.overlay import Overlay

from .drawn import drawn
from .frequency import RAD_PER_CYCLE, wrapped_phase
from .regions import LABEL
from .style import BLUE, FAINT, GREY, INK, ORANGE, New, blank, headline, must_be, style, taken, window
from .words import name_axes

FITTED_POINTS = 1200  # of a computed curve, beside the measured frequencies: more than a column has pixels
POINTS_OF_BAND = 800  # of a band of responses, about one to a pixel: each is computed for every possible arm
MAP_MESH = 60  # gains of each axis of a map, each pair counted for every possible arm
SHARE_COLOURS = "Blues"  # of matplotlib: the more arms, the darker
SPAN = 1.25  # of the decades that are measured: an infinite peak of the exact curve runs off the picture


@drawn.register
def draw_fit(fit: Fit) -> Figure:
    """Each measured response with the arm's before and after: magnitude over phase, a column a response.

    Phases are broken where they wrap.
    """
    count, problem = max(1, len(fit.responses)), fit.solution.problem
    curves = ((fit.solution.point * 0, GREY, "start", 1.0), (fit.solution.point, BLUE, "fitted, exact", 1.4))
    with style():
        figure = blank(max(7.0, 5.2 * count), 6.0)
        axes = figure.subplots(2, count, sharex="col", height_ratios=[1.75, 1.0], squeeze=False)
        for number, one in enumerate(fit.responses):
            upper, lower = axes[:, number]
            measured, omega = one.omega, np.geomspace(one.omega[0], one.omega[-1], FITTED_POINTS)
            omega = np.unique(np.r_[omega, measured])
            hertz = omega / (2 * math.pi)
            upper.plot(measured / (2 * math.pi), abs(one.values), ".", ms=3.0, color=ORANGE, label="measured", zorder=3)
            phase = np.degrees(np.angle(one.values))
            lower.plot(measured / (2 * math.pi), phase, ".", ms=3.0, color=ORANGE, zorder=3)
            for point, colour, label, width in curves:
                H = problem.at(number, omega).computed(point)[0]
                degrees = np.degrees(np.angle(H))
                degrees[abs(np.diff(degrees, prepend=degrees[:1])) > 180] = np.nan
                upper.plot(hertz, abs(H), color=colour, lw=width, label=label)
                lower.plot(hertz, degrees, color=colour, lw=width)
            upper.set(xscale="log", yscale="log", title=one.name)
            lower.set(xlabel="frequency [Hz]", ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
        if fit.responses:
            axes[0, 0].set_ylabel("magnitude, SI")
            axes[1, 0].set_ylabel("phase [deg]")
            axes[0, 0].legend(loc="best")
        headline(figure, f"{fit.before.name}: {fit.verdict}")
    return figure


def draw_band(those: Possible, output: str) -> Figure:
    """Magnitude of a response of the arm that fits best, in the band of all that the data leave possible."""
    omegas = [each.omega for each in those.fit.responses]
    low, high = min(w[0] for w in omegas), max(w[-1] for w in omegas)
    omega = np.geomspace(low, high, POINTS_OF_BAND)
    least, most, best = response_band(those, output, omega)
    with style():
        figure = blank(9.0, 4.6)
        ax = figure.subplots()
        label = f"all of {len(those.arms)} arms that the data leave possible"
        ax.fill_between(omega / 2 / math.pi, least, most, color=BLUE, alpha=0.3, lw=0, label=label)
        ax.plot(omega / 2 / math.pi, best, color=BLUE, lw=1.3, label="the arm that fits best")
        ax.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel=f"|{output.replace('_', ' ')}|, SI")
        ax.legend(loc="best")
        headline(figure, f"{those.fit.before.name}: what the data leave of {output.replace('_', ' ')}")
    return figure


def draw_share(those: Possible, ranges: Sequence[tuple[float, float]]) -> Figure:
    """The share of the possible arms on which each pair of gains holds, without a clock; `ranges` of both gains."""
    grid = [np.linspace(*ends, MAP_MESH) for ends in ranges]
    with style():
        figure = blank(8.0, 5.0)
        share_map(those, *grid, ax=figure.subplots())
        headline(figure, f"{those.fit.before.name}: gains that hold on the arms that the data leave possible")
    return figure


def share_map(those: Possible, across: np.ndarray, up: np.ndarray, *, ax: Axes) -> Axes:
    """The same on axes of your own."""
    share = share_stable(those, across, up)
    picture = ax.pcolormesh(
        across, up, share, cmap=SHARE_COLOURS, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True
    )
    ax.figure.colorbar(picture, ax=ax).set_label("share of the arms that the gains hold")
    name_axes(those.fit.arm, ax, LABEL, "-")
    ax.grid(False)
    return ax


def measured(data: Overlay, *, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes, Axes]:
    """Magnitude, phase and coherence (what `tfarm.overlay` returns), in three axes, those given or new ones: these.

    Phases lie between -180 and 180 degrees, broken where they wrap: a sign that differs is half a turn.  Where no
    coherence is known the third axes show the noise as a share of the measured value.
    """
    must_be(Overlay, data, "tfarm.overlay returns")
    with style():
        if ax is None:
            upper, middle, lower = draw_measured(data, window).axes
        else:
            upper, middle, lower = taken(ax, 3)
            for each in (upper, middle, lower):
                _frequencies(data, each)
            _magnitude(data, upper)
            one = data.measured
            middle.plot(
                one.omega / RAD_PER_CYCLE, np.degrees(np.angle(one.values)), "o", ms=2.2, color=ORANGE, zorder=3
            )
            middle.plot(*wrapped_phase(data.omega / RAD_PER_CYCLE, data.curve), color=BLUE)
            middle.set_ylim(-190.0, 190.0)
            middle.yaxis.set_major_locator(MultipleLocator(90))
            middle.set_ylabel("phase [deg]")
            _coherence(data, lower)
    return upper, middle, lower


@drawn.register
def draw_measured(data: Overlay, new: New = blank) -> Figure:
    """The three on a figure of their own."""
    with style():
        figure = new(9.0, 7.2)
        axes = figure.subplots(3, 1, sharex=True, height_ratios=[2.2, 1.2, 0.8])
        for each in measured(data, ax=axes)[:2]:
            each.set_xlabel("")
            each.tick_params(labelbottom=False)
        headline(figure, f"{data.arm.name}: {_words(data.measured.output)} over {_words(data.measured.input)}")
    return figure


def _magnitude(data: Overlay, ax: Axes) -> None:
    """Both sizes; grey where the arm has a resonance, orange where that is measured, black where none is near."""
    ax.set_yscale("log")
    one, size = data.measured, abs(data.curve)
    ax.plot(one.omega / RAD_PER_CYCLE, abs(one.values), "o", ms=2.2, color=ORANGE, zorder=3, label="measured")
    ax.plot(data.omega / RAD_PER_CYCLE, size, color=BLUE, label="exact")
    seen = abs(one.values[one.values != 0])
    if seen.size:
        low, high = math.log10(seen.min()), math.log10(seen.max())
        usual = np.log10(np.median(size[size > 0])) if (size > 0).any() else low
        low, high, margin = min(low, usual), max(high, usual), 0.15 + (SPAN - 1) / 2 * (high - low)
        ax.set_ylim(10 ** (low - margin), 10 ** (high + margin))
    for row in data.beside:
        ax.axvline(abs(row.pole) / RAD_PER_CYCLE, color=FAINT, lw=0.8, zorder=0.5)
        if row.frequency_ratio is not None:
            ax.axvline(
                row.frequency_ratio * abs(row.pole) / RAD_PER_CYCLE, color=ORANGE, lw=0.7, ls=(0, (2, 3)), zorder=0.6
            )
    for peak in data.unmatched:
        ax.axvline(peak / RAD_PER_CYCLE, color=INK, lw=0.8, ls=":", zorder=0.6)
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylabel(f"magnitude [{data.ratio.unit}]")
    ax.legend(loc="best")


def _coherence(data: Overlay, ax: Axes) -> None:
    """How coherent the measurement is, or the noise as a share of the value."""
    one = data.measured
    if one.coherence is not None:
        ax.plot(one.omega / RAD_PER_CYCLE, one.coherence, color=GREY, lw=1.0)
        ax.set_ylim(-0.05, 1.05)
        ax.set_ylabel("coherence [-]")
        return
    size = abs(one.values)
    told = (size > 0) & np.isfinite(data.noise.sigma)
    ax.plot(one.omega[told] / RAD_PER_CYCLE, data.noise.sigma[told] / size[told], color=GREY, lw=1.0)
    ax.set_yscale("log")
    ax.set_ylabel("noise/value [-]")


def _frequencies(data: Overlay, ax: Axes) -> None:
    low, high = data.measured.omega[0] / RAD_PER_CYCLE, data.measured.omega[-1] / RAD_PER_CYCLE
    if high > 5 * low:
        ax.set_xscale("log")
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 4)))
    if low < high:
        ax.set_xlim(float(low), float(high))
    ax.set_xlabel("frequency [Hz]")


def _words(name: str) -> str:
    """A signal as a person says it."""
    plain_name, at, place = name.partition("@")
    return plain_name.replace("_", " ") + (f" at {place} m" if at else "")
