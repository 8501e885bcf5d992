"""Measured responses under the curves of a fitted arm, and what the data leave open: bands, and gains that hold.

A measured response over the exact one: magnitude, phase, and how coherent the measurement is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from tfarm.digits import plain
from tfarm.fitting.fit import Fit, Possible, response_band, share_stable
from tfarm.fitting.overlay import Overlay

from .frequency import RAD_PER_CYCLE, draw_wrapped
from .style import BLUE, FAINT, GREY, INK, ORANGE, page, picture
from .words import name_axes

FITTED_POINTS = 1200  # of a computed curve, beside the measured frequencies: more than a column has pixels
POINTS_OF_BAND = 800  # of a band of responses, about one to a pixel: each is computed for every possible arm
MAP_MESH = 60  # gains of each axis of a map, each pair counted for every possible arm
SHARE_COLOURS = "Blues"  # of matplotlib: the more arms, the darker
SPAN = 1.25  # of the decades that are measured: an infinite peak of the exact curve runs off the picture


def _fit_grid(figure: Figure, fit: Fit) -> Any:
    return figure.subplots(2, max(1, len(fit.responses)), sharex="col", height_ratios=[1.75, 1.0], squeeze=False)


@picture(
    (Fit, "tfarm.fit returns"), size=lambda fit: (max(7.0, 5.2 * len(fit.responses)), 6.0), grid=_fit_grid,
    title=lambda fit: f"{fit.before.name}: {fit.verdict}",
)  # fmt: skip
def fitted(fit: Fit, *, ax: Sequence[Axes]) -> None:
    """Each measured response with the arm's before and after: magnitude over phase, a column a response.

    Phases are broken where they wrap.
    """
    count, problem = len(fit.responses), fit.solution.problem
    curves = ((fit.solution.point * 0, GREY, "start", 1.0), (fit.solution.point, BLUE, "fitted, exact", 1.4))
    for number, (one, upper, lower) in enumerate(zip(fit.responses, ax[:count], ax[count:], strict=False)):
        hertz, omega = one.omega / RAD_PER_CYCLE, np.geomspace(one.omega[0], one.omega[-1], FITTED_POINTS)
        omega = np.unique(np.r_[omega, one.omega])
        upper.plot(hertz, abs(one.values), ".", ms=3.0, color=ORANGE, label="measured", zorder=3)
        lower.plot(hertz, np.degrees(np.angle(one.values)), ".", ms=3.0, color=ORANGE, zorder=3)
        for point, colour, label, width in curves:
            H = problem.at(number, omega).computed(point)[0]
            upper.plot(omega / RAD_PER_CYCLE, abs(H), color=colour, lw=width, label=label)
            draw_wrapped(omega / RAD_PER_CYCLE, H, lower, color=colour, lw=width)
        upper.set(xscale="log", yscale="log", title=one.name)
        lower.set(xlabel="frequency [Hz]", ylabel="" if number else "phase [deg]")
    if fit.responses:
        ax[0].set_ylabel("magnitude, SI")
        ax[0].legend(loc="best")


def draw_band(those: Possible, output: str) -> Figure:
    """Magnitude of a response of the arm that fits best, in the band of all that the data leave possible."""
    omegas = [each.omega for each in those.fit.responses]
    omega = np.geomspace(min(w[0] for w in omegas), max(w[-1] for w in omegas), POINTS_OF_BAND)
    least, most, best = response_band(those, output, omega)
    name = output.replace("_", " ")
    with page(9.0, 4.6, f"{those.fit.before.name}: what the data leave of {name}") as (figure, ax):
        label = f"all of {len(those.arms)} arms that the data leave possible"
        ax.fill_between(omega / RAD_PER_CYCLE, least, most, color=BLUE, alpha=0.3, lw=0, label=label)
        ax.plot(omega / RAD_PER_CYCLE, best, color=BLUE, lw=1.3, label="the arm that fits best")
        ax.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel=f"|{name}|, SI")
        ax.legend(loc="best")
    return figure


def draw_share(those: Possible, ranges: Sequence[tuple[float, float]]) -> Figure:
    """The share of the possible arms that each pair of gains stabilises in continuous time; `ranges` of both gains."""
    across, up = (np.linspace(*ends, MAP_MESH) for ends in ranges)
    title = f"{those.fit.before.name}: gains that hold on the arms that the data leave possible"
    with page(8.0, 5.0, title) as (figure, ax):
        share = share_stable(those, across, up)
        mesh = ax.pcolormesh(
            across, up, share, cmap=SHARE_COLOURS, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True
        )
        figure.colorbar(mesh, ax=ax).set_label("share of the arms that the gains hold")
        name_axes(those.fit.arm, ax)
        ax.grid(False)
    return figure


@picture(
    (Overlay, "tfarm.overlay returns"), size=(9.0, 7.2), rows=(2.2, 1.2, 0.8),
    title=lambda data: f"{data.arm.name}: {_words(data.measured.output)} over {_words(data.measured.input)}",
)  # fmt: skip
def measured(data: Overlay, *, ax: Sequence[Axes]) -> None:
    """Magnitude, phase and coherence (what `tfarm.overlay` returns), in three axes, those given or new ones: these.

    Phases lie between -180 and 180 degrees, broken where they wrap: a sign that differs is half a turn.  Where no
    coherence is known the third axes show the noise as a share of the measured value.
    """
    upper, middle, lower = ax
    for each in ax:
        _frequencies(data, each)
    _magnitude(data, upper)
    one = data.measured
    middle.plot(one.omega / RAD_PER_CYCLE, np.degrees(np.angle(one.values)), "o", ms=2.2, color=ORANGE, zorder=3)
    draw_wrapped(data.omega / RAD_PER_CYCLE, data.curve, middle, color=BLUE)
    _coherence(data, lower)


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
    for row in data.modes:
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
        ax.set(ylim=(-0.05, 1.05), ylabel="coherence [-]")
        return
    size = abs(one.values)
    told = (size > 0) & np.isfinite(data.noise.sigma)
    ax.plot(one.omega[told] / RAD_PER_CYCLE, data.noise.sigma[told] / size[told], color=GREY, lw=1.0)
    ax.set(yscale="log", ylabel="noise/value [-]")


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
