"""Curves over frequency: exact responses, in decibels, and measured ones.

At an infinite resonance a Bode plot is broken and leaves the picture.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator, NullFormatter

from tfarm.arm import PLANE, HubFeedback, Law
from tfarm.arrays import Complex, Real
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit, ResponseBand, ShareOfArms
from tfarm.fitting.overlay import Overlay
from tfarm.loop.curve import decibels
from tfarm.plots.labels import name_axes
from tfarm.plots.style import (
    BLUE,
    COLOURS,
    DASHED,
    FAINT,
    FIGURES,
    GREY,
    INK,
    ORANGE,
    Axes,
    by_name,
    first_of,
    note,
    picture,
    plain_ticks,
    safe,
)
from tfarm.response.frequency import Bode

PHASE = "phase [deg]"
# a curve over x: its values and looks
Drawn = tuple[Real, Complex, dict[str, Any]]


def in_hertz(omega: Any) -> Any:
    """Return frequencies [Hz] of those in rad/s."""
    return np.divide(omega, 2 * np.pi)


def along_omega(ax: Axes, **limits: Any) -> None:
    """Make the axis below one of angular frequencies."""
    ax.set(xscale="log", xlabel="angular frequency [rad/s]", **limits)


def along_hertz(ax: Axes, scale: str = "log", **limits: Any) -> None:
    """Make the axis below one of frequencies, of few decades."""
    ax.set(xscale=scale, xlabel="frequency [Hz]", **limits)


@picture(
    (Bode, "tfarm.bode returns"),
    size=(9.0, 6.2),
    rows=(1.75, 1.0),
    title=lambda data: "{0.arm.name}: {0.input_label} to {0.label}".format(first_of(data)),
)
def bode(data: Bode | Mapping[str, Bode], *, ax: Sequence[Axes]) -> None:
    """Draw magnitude over phase of a response (from `tfarm.bode`), in two axes, those given or new ones: these axes.

    Several are given by name.  Magnitudes in decibels of the response's SI unit, phases in degrees; an infinite
    resonance is broken, a triangle at its place.
    """
    draw_magnitude(data, ax=ax[0])
    draw_phase(data, ax=ax[1])


@picture(size=(4.4, 2.5), title=lambda _: "")
def draw_card(data: Bode, *, ax: Axes) -> None:
    """Draw the magnitude alone, small, for the index."""
    draw_magnitude(data, ax=ax)
    ax.set_ylabel(f"|{data.label}| [dB]", fontsize=8.5)
    for each in (ax.legend(), *ax.texts, *ax.child_axes):
        each.set_visible(False)


def draw_magnitude(data: Bode | Mapping[str, Bode], *, ax: Axes) -> None:
    """Draw |G| [dB]: rad/s below, Hz above; roots on the axis, modes and cut-off are those of the first."""
    each = by_name(data, "flexible arm, exact")
    first = first_of(each)
    lows, highs = zip(*map(magnitude_limits, each.values()), strict=True)
    low = min(lows)
    high = max(highs)
    unit = f"dB re 1 {first.gain_unit}".replace("1 −", "1")
    # above them a line of mode numbers
    over_frequency(ax, f"|{first.label} / {first.input_label}|\nmagnitude [{unit}]", 1.085)
    ax.set(xlim=first.band, ylim=(low, high))
    for (name, one), colour in zip(each.items(), cycle(COLOURS), strict=False):
        # off the picture
        edges = np.repeat([high + 20.0, low - 20.0], [one.infinite.size, one.vanishing.size])
        jumps = np.r_[one.infinite, one.vanishing]
        curve = break_at(jumps, edges, one.omega, decibels(one.value))
        ax.plot(*curve, color=colour, label=safe(name))
    if np.any(first.rigid):
        rigid = decibels(first.rigid)
        ax.plot(first.omega, rigid, color=GREY, lw=1.0, ls=DASHED, zorder=1.5, label="rigid arm")
    _mark_roots(first, ax)
    if first.arm.has_cutoff:
        left, right = first.band
        cutoff = first.arm.shear_cutoff
        if left < cutoff < right:
            ax.axvline(cutoff, color=ORANGE, lw=1.0, ls="-.", label="shear cut-off")
    if first.is_zero:
        ax.text(0.5, 0.5, "zero at every frequency", ha="center", va="center", transform=ax.transAxes)


def draw_phase(data: Bode | Mapping[str, Bode], *, ax: Axes) -> None:
    """Draw the phase in degrees; at C = 0 it steps by 180 degrees at every root on the axis."""
    for one, colour in zip(by_name(data).values(), cycle(COLOURS), strict=False):
        jumps = np.r_[one.infinite, one.vanishing]
        if jumps.size:
            ax.plot(one.omega, one.phase, color=colour, lw=0.7, ls=(0, (1, 1.5)))
        no_limits = np.full(jumps.size, np.nan)
        ax.plot(*break_at(jumps, no_limits, one.omega, one.phase), color=colour)
    along_omega(ax, xlim=one.band, ylabel=PHASE)
    ax.margins(y=0.1)
    # right angles and parts of them
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=(1, 1.8, 4.5, 9, 10)))


def over_frequency(ax: Axes, label: str, height: float = 1.0) -> None:
    """Make axes of decibels, with ticks at tens and twenties, over rad/s and, at that height above the axes, Hz."""
    along_omega(ax, ylabel=label, xmargin=0)
    ax.yaxis.set_major_locator(MaxNLocator(7, steps=(1, 2, 4, 5, 10)))
    upper = ax.secondary_xaxis(height, functions=(in_hertz, lambda hertz: np.multiply(hertz, 2 * np.pi)))
    upper.set_xlabel("frequency [Hz]", labelpad=5.0)
    plain_ticks(upper.xaxis)


def draw_size_and_angle(
    curves: Iterable[Drawn], size: Callable[[Complex], Real], upper: Axes, lower: Axes
) -> None:
    """Draw the size of each curve over its angle between -180 and 180 degrees."""
    for x, values, looks in curves:
        upper.plot(x, size(values), **looks)
        angle, at = split_at_wraps(degrees_of(values), x)
        lower.plot(at, angle, **looks)
    lower.set(ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180], ylabel=PHASE)


def degrees_of(values: Complex) -> Real:
    """Return angles between -180 and 180 degrees."""
    return np.degrees(np.angle(values))


def split_at_wraps(angle: Real, other: Real) -> tuple[Real, Real]:
    """Return both coordinates of a curve with a gap where its angle [deg] passes half a turn."""
    jump = np.flatnonzero(abs(np.diff(angle)) > 180) + 1
    return np.insert(angle, jump, np.nan), np.insert(other, jump, np.nan)


def break_at(places: Real, limits: Real, x: Real, y: Real) -> tuple[Real, Real]:
    """Return the curve broken at each place, where it runs to its limit from both sides (nan: it just ends)."""
    order = np.argsort(places)
    at = places[order]
    limit = limits[order]
    where = np.repeat(np.searchsorted(x, at), 3)
    gap = np.full(at.size, np.nan)
    across = np.c_[at, gap, at].ravel()
    up = np.c_[limit, gap, limit].ravel()
    return np.insert(x, where, across), np.insert(y, where, up)


def magnitude_limits(data: Bode) -> tuple[float, float]:
    """Return the limits of all that is finite, with a margin [dB]; roots on the axis leave the picture."""
    if data.is_zero:
        return -20.0, 20.0
    roots = np.r_[data.infinite, data.vanishing]
    # nearer ones set no limit of the picture
    away = (abs(data.omega[:, None] / roots - 1) > 0.004).all(axis=1)
    sizes = abs(np.r_[data.value[away], data.rigid[:1]])
    size = decibels(sizes[sizes > 0])
    margin = max(5.0, 0.06 * np.ptp(size))
    return size.min() - margin, size.max() + margin


def _mark_roots(data: Bode, ax: Axes) -> None:
    """Draw triangles at the upper edge where |G| is infinite, at the lower where it is 0, and numbers of resonances."""
    to_edges = ax.get_xaxis_transform()
    every = np.r_[data.infinite, data.vanishing, data.resonances.imag]
    ax.vlines(every, 0, 1, color=FAINT, lw=0.8, zorder=0.5, transform=to_edges)
    for roots, height, marker, label in (
        (data.infinite, 1.0, "^", "pole on the imaginary axis: infinite"),
        (data.vanishing, 0.0, "v", "zero on the imaginary axis: 0"),
    ):
        if roots.size:
            ax.plot(
                roots,
                np.full(roots.size, height),
                marker,
                transform=to_edges,
                clip_on=False,
                mfc="white",
                mec=INK,
                ms=6.0,
                mew=1.0,
                zorder=5,
                label=label,
            )
    _, top = ax.get_ylim()
    # that far apart two digits do not touch
    room = (0.019, 1.0)
    for number, omega in enumerate(data.resonances.imag, 1):
        at = (omega, top)
        note(str(number), at, ax, room, xytext=(0, 5), ha="center", va="baseline", color=GREY)


# ------------------------------------------------------------ measured responses


def _over_measured(one: Measured, curves: Sequence[Drawn], upper: Axes, lower: Axes) -> None:
    """Draw magnitude over phase [Hz, deg]: measured points, and curves (omega [rad/s], values, looks).

    An infinite peak of a curve leaves the picture.
    """
    hertz = in_hertz(one.omega)
    size = abs(one.values)
    upper.plot(hertz, size, ".", ms=3.5, color=ORANGE, zorder=3, label="measured")
    lower.plot(hertz, degrees_of(one.values), ".", ms=3.5, color=ORANGE, zorder=3)
    draw_size_and_angle(
        ((in_hertz(omega), values, looks) for omega, values, looks in curves), np.abs, upper, lower
    )
    sizes = np.array([*size, *(np.median(abs(values)) for _, values, _ in curves)])
    within = np.log10(sizes[sizes > 0])
    margin = 0.15 + 0.125 * np.ptp(within)
    upper.set(yscale="log", ylim=10 ** np.array([within.min() - margin, within.max() + margin]))
    upper.yaxis.set_minor_formatter(NullFormatter())
    scale = "log" if hertz[-1] > 5 * hertz[0] else "linear"
    for ax in (upper, lower):
        along_hertz(ax, scale, xlim=hertz[[0, -1]])
        plain_ticks(ax.xaxis, 4, is_dense=True)


@picture(
    (Fit, "tfarm.fit returns"),
    size=lambda fit: (max(7.0, 5.2 * len(fit.responses)), 6.0),
    title=lambda fit: f"{fit.before.name}: {fit.verdict}",
    grid=lambda figure, fit: figure.subplots(
        2, max(1, len(fit.responses)), sharex="col", height_ratios=(1.75, 1.0)
    ),
)
def fit_curves(fit: Fit, *, ax: Sequence[Axes]) -> None:
    """Draw each measured response with the arm's before and after: magnitude over phase, a column a response.

    Phases are broken where they wrap.
    """
    start = {"color": GREY, "lw": 1.0, "label": "start"}
    best = {"color": BLUE, "lw": 1.4, "label": "fitted, exact"}
    below = ax[len(fit.responses) :]
    for one, (omega, before, after), upper, lower in zip(fit.responses, fit.curves, ax, below, strict=False):
        _over_measured(one, [(omega, before, start), (omega, after, best)], upper, lower)
        upper.set(title=one.label, xlabel="", ylabel=f"magnitude [{one.unit}]")


def _most_signals(fit: Fit) -> int:
    return max(len(each.names) for each in fit.run_curves)


@picture(
    size=lambda fit: (max(7.0, 4.7 * len(fit.problem.runs)), 0.8 + 3.2 * _most_signals(fit)),
    title=lambda fit: f"{fit.before.name}: {fit.verdict}",
    grid=lambda figure, fit: figure.subplots(
        2 * _most_signals(fit),
        len(fit.problem.runs),
        sharex="col",
        height_ratios=(1.75, 1.0) * _most_signals(fit),
    ),
)
def fit_runs(fit: Fit, *, ax: Sequence[Axes]) -> None:
    """Draw the runs of a fit (from `tfarm.fit`): each signal as measured and computed, with its residual below."""
    rows = np.reshape(np.array(ax), (2 * _most_signals(fit), -1))
    for column, found in zip(rows.T, fit.run_curves, strict=True):
        signals = zip(found.names, found.measured, found.computed, strict=True)
        for place, (name, measured, computed) in enumerate(signals):
            label, unit = signal_words(name)
            upper, lower = column[2 * place : 2 * place + 2]
            upper.plot(found.t, measured, ".", ms=2.5, color=ORANGE, label="measured")
            upper.plot(found.t, computed, color=BLUE, lw=1.0, label="fitted, exact sampled plant")
            upper.set(ylabel=f"{label} [{unit}]")
            lower.plot(found.t, computed - measured, color=GREY, lw=0.7)
            lower.set(ylabel=f"residual [{unit}]")
        column[-1].set(xlabel="time [s]")


FIGURES.update({Fit: lambda fit: (fit_curves if fit.responses else fit_runs).figure(fit)})


@picture(
    size=(9.0, 4.6),
    title=lambda fit, _, output, __: (
        f"{fit.before.name}: {signal_words(output)[0]} of the arms that the data leave possible"
    ),
)
def draw_band(fit: Fit, band: ResponseBand, output: str, count: int, *, ax: Axes) -> None:
    """Draw the magnitude of a response of the arm that fits best, in the band of `count` possible arms."""
    hertz = in_hertz(band.omega)
    name, unit = signal_words(output)
    label = f"all of {count} arms that the data leave possible"
    ax.fill_between(hertz, band.low, band.high, color=BLUE, alpha=0.3, lw=0, label=label)
    ax.plot(hertz, band.best, color=BLUE, lw=1.3, label="the arm that fits best")
    along_hertz(ax, yscale="log", ylabel=f"|{name}| [{unit_over(unit, fit.arm.input_unit)}]")
    plain_ticks(ax.xaxis, is_dense=True)


@picture(
    size=(8.0, 5.0),
    title=lambda fit, *_: f"{fit.before.name}: stabilising gains for the arms that the data leave possible",
)
def draw_share(fit: Fit, found: ShareOfArms, *, ax: Axes) -> None:
    """Draw the share of the possible arms that each pair of gains stabilises in continuous time."""
    mesh = ax.pcolormesh(*found, cmap="Blues", vmin=0.0, vmax=1.0, shading="nearest", rasterized=True)
    ax.figure.colorbar(mesh, ax=ax).set_label("share of the arms with a stable loop [−]")
    name_axes(PLANE, fit.arm, Law.of_gains(HubFeedback()), ax)
    ax.grid(False)


@picture(
    (Overlay, "tfarm.overlay returns"),
    size=(9.0, 7.4),
    rows=(2.2, 1.2, 0.8),
    title=lambda data: f"{data.arm.name}: {data.measured.label}",
)
def measured_response(data: Overlay, *, ax: Sequence[Axes]) -> None:
    """Draw magnitude, phase and coherence (from `tfarm.overlay`), in three axes, those given or new ones: these.

    Phases lie between -180 and 180 degrees, broken where they wrap: a sign that differs is half a turn.  Where no
    coherence is known the third axes show the noise as a share of the measured value.  Upright lines: the arm's poles,
    their measured frequencies, and measured peaks far from every pole.
    """
    upper, middle, lower = ax
    one = data.measured
    _over_measured(one, [(data.omega, data.curve, {"color": BLUE, "label": "exact"})], upper, middle)
    upper.set_ylabel(f"magnitude [{data.ratio.unit}]")
    for row in data.modes:
        pole = in_hertz(abs(row.pole))
        upper.axvline(pole, zorder=0.6, color=FAINT, lw=0.8, label="pole of the arm")
    for row in data.modes:
        if row.frequency_ratio is not None:
            own = in_hertz(abs(row.pole)) * row.frequency_ratio
            upper.axvline(
                own, zorder=0.6, color=ORANGE, lw=0.7, ls=(0, (2, 3)), label="its measured frequency"
            )
    for peak in in_hertz(data.unmatched):
        upper.axvline(peak, zorder=0.6, color=INK, lw=0.8, ls=":", label="peak of no pole")
    if one.coherence is None:
        _draw_noise(data, lower)
    else:
        lower.plot(in_hertz(one.omega), one.coherence, color=GREY, lw=1.0)
        lower.set(ylim=(-0.05, 1.05), ylabel="coherence [−]")
    along_hertz(lower, upper.get_xscale(), xlim=upper.get_xlim())
    plain_ticks(lower.xaxis, 4, is_dense=True)


def _draw_noise(data: Overlay, ax: Axes) -> None:
    """Draw the noise as a share of the measured value."""
    one = data.measured
    size = abs(one.values)
    known = (size > 0) & np.isfinite(data.noise.sigma)
    share = data.noise.sigma[known] / size[known]
    ax.plot(in_hertz(one.omega[known]), share, color=GREY, lw=1.0)
    # two ticks at least
    ax.set(yscale="log", ylim=(share.min() / 2.5, share.max() * 2.5), ylabel="noise/value [−]")
    plain_ticks(ax.yaxis, 1, is_dense=np.ptp(np.log10(share)) < 1)
