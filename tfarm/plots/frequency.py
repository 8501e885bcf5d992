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
from tfarm.plots.style import (
    BLUE,
    COLOURS,
    FAINT,
    GREY,
    INK,
    ORANGE,
    Axes,
    by_name,
    name_axes,
    note,
    picture,
    plain_ticks,
    safe,
)
from tfarm.response.frequency import Bode

# rad/s of 1 Hz
RAD_PER_CYCLE = 2 * np.pi
# where a measurement covers few of them
TICKS_A_DECADE = (1.0, 2.0, 5.0)
FREQUENCY = "angular frequency [rad/s]"
FREQUENCY_HZ = "frequency [Hz]"
PHASE = "phase [deg]"
POINTS: dict[str, Any] = {"ls": "none", "marker": ".", "ms": 3.5, "color": ORANGE, "zorder": 3}
EXACT = "flexible arm, exact"
# a curve over x: its values and looks
Drawn = tuple[Real, Complex, dict[str, Any]]


@picture(
    (Bode, "tfarm.bode returns"),
    size=(9.0, 6.2),
    rows=(1.75, 1.0),
    title=lambda data: "{0.arm.name}: {0.input_label} to {0.label}".format(
        next(iter(by_name(data).values()))
    ),
)
def bode(data: Bode | Mapping[str, Bode], *, ax: Sequence[Axes]) -> None:
    """Magnitude over phase of a response (from `tfarm.bode`), in two axes, those given or new ones: these axes.

    Several are given by name.  Magnitudes in decibels of the response's SI unit, phases in degrees; an infinite
    resonance is broken, a triangle at its place.
    """
    draw_magnitude(data, ax=ax[0])
    draw_phase(data, ax=ax[1])


@picture(size=(4.4, 2.5), title=lambda _: "")
def draw_card(data: Bode, *, ax: Axes) -> None:
    """The magnitude alone, small, for the index."""
    draw_magnitude(data, ax=ax)
    ax.set_ylabel(f"|{data.label}| [dB]", fontsize=8.5)
    for each in (ax.legend(), *ax.texts, *ax.child_axes):
        each.set_visible(False)


def draw_magnitude(data: Bode | Mapping[str, Bode], *, ax: Axes) -> None:
    """|G| [dB]: rad/s below, Hz above; roots on the axis, modes and cut-off are those of the first."""
    each = by_name(data, EXACT)
    first = next(iter(each.values()))
    limits = np.array([magnitude_limits(one) for one in each.values()])
    low = float(limits[:, 0].min())
    high = float(limits[:, 1].max())
    label = f"|{first.label} / {first.input_label}|\nmagnitude [dB re 1 {first.gain_unit}]".replace(
        "1 −", "1"
    )
    # above them a line of mode numbers
    over_frequency(ax, label, 1.085)
    ax.set(xlim=first.band, ylim=(low, high))
    for (name, one), colour in zip(each.items(), cycle(COLOURS), strict=False):
        # off the picture
        edges = np.repeat([high + 20.0, low - 20.0], [one.infinite.size, one.vanishing.size])
        jumps = np.r_[one.infinite, one.vanishing]
        ax.plot(*broken(one.omega, decibels(one.value), jumps, edges), color=colour, label=safe(name))
    if np.any(first.rigid):
        ax.plot(
            first.omega,
            decibels(first.rigid),
            color=GREY,
            lw=1.0,
            ls=(0, (4, 3)),
            zorder=1.5,
            label="rigid arm",
        )
    _mark_roots(first, ax)
    if first.arm.has_cutoff and first.band[0] < first.arm.shear_cutoff < first.band[1]:
        ax.axvline(first.arm.shear_cutoff, color=ORANGE, lw=1.0, ls="-.", label="shear cut-off")
    if first.is_zero:
        ax.text(0.5, 0.5, "zero at every frequency", ha="center", va="center", transform=ax.transAxes)


def draw_phase(data: Bode | Mapping[str, Bode], *, ax: Axes) -> None:
    """The phase in degrees; at C = 0 it steps by 180 degrees at every root on the axis."""
    each = by_name(data, EXACT)
    for one, colour in zip(each.values(), cycle(COLOURS), strict=False):
        if (jumps := np.r_[one.infinite, one.vanishing]).size:
            ax.plot(one.omega, one.phase, color=colour, lw=0.7, ls=(0, (1, 1.5)))
        ax.plot(*broken(one.omega, one.phase, jumps, np.full(jumps.size, np.nan)), color=colour)
    ax.set(xscale="log", xlim=one.band, xlabel=FREQUENCY, ylabel=PHASE)
    ax.margins(y=0.1)
    # right angles and parts of them
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=(1, 1.8, 4.5, 9, 10)))


def over_frequency(ax: Axes, label: str, height: float = 1.0) -> None:
    """Decibels, with ticks at tens and twenties, over rad/s and, at that height above the axes, Hz."""
    ax.set(xscale="log", xlabel=FREQUENCY, ylabel=label, xmargin=0)
    ax.yaxis.set_major_locator(MaxNLocator(7, steps=(1, 2, 4, 5, 10)))
    ratios = (lambda omega: np.divide(omega, RAD_PER_CYCLE), lambda hertz: np.multiply(hertz, RAD_PER_CYCLE))
    upper = ax.secondary_xaxis(height, functions=ratios)
    upper.set_xlabel(FREQUENCY_HZ, labelpad=5.0)
    plain_ticks(upper.xaxis)


def draw_curves(curves: Iterable[Drawn], size: Callable[[Complex], Real], upper: Axes, lower: Axes) -> None:
    """The size of each curve over its angle between -180 and 180 degrees."""
    for x, values, looks in curves:
        upper.plot(x, size(values), **looks)
        lower.plot(*parted(np.degrees(np.angle(values)), x)[::-1], **looks)
    lower.set(ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180], ylabel=PHASE)


def parted(angle: Real, other: Real) -> tuple[Real, Real]:
    """Both coordinates of a curve with a gap where its angle [deg] passes half a turn."""
    jump = np.flatnonzero(abs(np.diff(angle)) > 180) + 1
    return np.insert(angle, jump, np.nan), np.insert(other, jump, np.nan)


def broken(x: Real, y: Real, at: Real, limit: Real) -> tuple[Real, Real]:
    """The curve broken at each of the places, where it runs to its `limit` from both sides (nan: it just ends)."""
    order = np.argsort(at)
    at = at[order]
    limit = limit[order]
    where = np.repeat(np.searchsorted(x, at), 3)
    gap = np.full(at.size, np.nan)
    return np.insert(x, where, np.c_[at, gap, at].ravel()), np.insert(
        y, where, np.c_[limit, gap, limit].ravel()
    )


def magnitude_limits(data: Bode) -> tuple[float, float]:
    """Everything finite, with a margin [dB]; roots on the axis leave the picture."""
    if data.is_zero:
        return -20.0, 20.0
    roots = np.r_[data.infinite, data.vanishing]
    # nearer ones set no limit of the picture
    away = (abs(data.omega[:, None] / roots - 1) > 0.004).all(axis=1)
    size = decibels(np.array([each for each in (*abs(data.value[away]), *abs(data.rigid[:1])) if each > 0]))
    margin = max(5.0, 0.06 * np.ptp(size))
    return size.min() - margin, size.max() + margin


def _mark_roots(data: Bode, ax: Axes) -> None:
    """Triangles at the top edge where |G| is infinite, at the bottom edge where it is 0; numbers above resonances."""
    every = np.r_[data.infinite, data.vanishing, data.resonances.imag]
    ax.vlines(every, 0, 1, color=FAINT, lw=0.8, zorder=0.5, transform=ax.get_xaxis_transform())
    for roots, height, marker, label in (
        (data.infinite, 1.0, "^", "pole on the imaginary axis: infinite"),
        (data.vanishing, 0.0, "v", "zero on the imaginary axis: 0"),
    ):
        if roots.size:
            ax.plot(
                roots,
                np.full(roots.size, height),
                marker,
                transform=ax.get_xaxis_transform(),
                clip_on=False,
                mfc="white",
                mec=INK,
                ms=6.0,
                mew=1.0,
                zorder=5,
                label=label,
            )
    # that far apart two digits do not touch
    for number, omega in enumerate(data.resonances.imag, 1):
        note(
            str(number),
            (omega, ax.get_ylim()[1]),
            ax,
            (0.019, 1.0),
            xytext=(0, 5),
            ha="center",
            va="baseline",
            color=GREY,
        )


# ------------------------------------------------------------ measured responses


def _over_measured(one: Measured, curves: Sequence[Drawn], upper: Axes, lower: Axes) -> None:
    """Magnitude over phase [Hz, deg]: measured points, and curves (omega [rad/s], values, looks).

    An infinite peak of a curve leaves the picture.
    """
    hertz = one.omega / RAD_PER_CYCLE
    size = abs(one.values)
    upper.plot(hertz, size, label="measured", **POINTS)
    lower.plot(hertz, np.degrees(np.angle(one.values)), **POINTS)
    draw_curves(
        [(omega / RAD_PER_CYCLE, values, looks) for omega, values, looks in curves], np.abs, upper, lower
    )
    within = np.log10(
        [each for each in (*size, *(np.median(abs(values)) for _, values, _ in curves)) if each > 0]
    )
    # an infinite peak of the exact curve leaves the picture
    margin = 0.15 + 0.125 * np.ptp(within)
    upper.set(yscale="log", ylim=10 ** np.array([within.min() - margin, within.max() + margin]))
    upper.yaxis.set_minor_formatter(NullFormatter())
    for ax in (upper, lower):
        ax.set(
            xscale="log" if hertz[-1] > 5 * hertz[0] else "linear", xlim=hertz[[0, -1]], xlabel=FREQUENCY_HZ
        )
        plain_ticks(ax.xaxis, 4, TICKS_A_DECADE)


@picture(
    (Fit, "tfarm.fit returns"),
    size=lambda fit: (max(7.0, 5.2 * len(fit.responses)), 6.0),
    title=lambda fit: f"{fit.before.name}: {fit.verdict}",
    grid=lambda figure, fit: figure.subplots(
        2, max(1, len(fit.responses)), sharex="col", height_ratios=(1.75, 1.0)
    ),
)
def fitted(fit: Fit, *, ax: Sequence[Axes]) -> None:
    """Draw each measured response with the arm's before and after: magnitude over phase, a column a response.

    Phases are broken where they wrap.
    """
    count = len(fit.responses)
    looks = {"color": GREY, "lw": 1.0, "label": "start"}, {"color": BLUE, "lw": 1.4, "label": "fitted, exact"}
    for one, (omega, *curves), upper, lower in zip(fit.responses, fit.curves, ax, ax[count:], strict=False):
        _over_measured(one, [(omega, *each) for each in zip(curves, looks, strict=True)], upper, lower)
        upper.set(title=one.label, xlabel="", ylabel=f"magnitude [{one.unit}]")


@picture(
    size=(9.0, 4.6),
    title=lambda fit, _, output, __: (
        f"{fit.before.name}: {signal_words(output)[0]} of the arms that the data leave possible"
    ),
)
def draw_band(fit: Fit, band: ResponseBand, output: str, count: int, *, ax: Axes) -> None:
    """Draw the magnitude of a response of the arm that fits best, in the band of `count` possible arms."""
    hertz = band.omega / RAD_PER_CYCLE
    name, unit = signal_words(output)
    label = f"all of {count} arms that the data leave possible"
    ax.fill_between(hertz, band.low, band.high, color=BLUE, alpha=0.3, lw=0, label=label)
    ax.plot(hertz, band.best, color=BLUE, lw=1.3, label="the arm that fits best")
    ax.set(xscale="log", yscale="log", xlabel=FREQUENCY_HZ)
    ax.set_ylabel(f"|{name}| [{unit_over(unit, fit.arm.input_unit)}]")
    plain_ticks(ax.xaxis, subs=TICKS_A_DECADE)


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
def measured(data: Overlay, *, ax: Sequence[Axes]) -> None:
    """Magnitude, phase and coherence (from `tfarm.overlay`), in three axes, those given or new ones: these.

    Phases lie between -180 and 180 degrees, broken where they wrap: a sign that differs is half a turn.  Where no
    coherence is known the third axes show the noise as a share of the measured value.  Upright lines: the arm's poles,
    their measured frequencies, and measured peaks far from every pole.
    """
    upper, middle, lower = ax
    one = data.measured
    hertz = data.measured.omega / RAD_PER_CYCLE
    size = abs(data.measured.values)
    _over_measured(one, [(data.omega, data.curve, {"color": BLUE, "label": "exact"})], upper, middle)
    paired = [(abs(row.pole) / RAD_PER_CYCLE, row.frequency_ratio) for row in data.modes]
    upper.set_ylabel(f"magnitude [{data.ratio.unit}]")
    guides: tuple[tuple[Any, dict[str, Any]], ...] = (
        ([pole for pole, _ in paired], {"color": FAINT, "lw": 0.8, "label": "pole of the arm"}),
        (
            [pole * ratio for pole, ratio in paired if ratio is not None],
            {"color": ORANGE, "lw": 0.7, "ls": (0, (2, 3)), "label": "its measured frequency"},
        ),
        (
            np.divide(data.unmatched, RAD_PER_CYCLE),
            {"color": INK, "lw": 0.8, "ls": ":", "label": "peak of no pole"},
        ),
    )
    for at, looks in guides:
        for frequency in at:
            upper.axvline(frequency, zorder=0.6, **looks)
    if one.coherence is not None:
        lower.plot(hertz, one.coherence, color=GREY, lw=1.0)
        lower.set(ylim=(-0.05, 1.05), ylabel="coherence [−]")
    else:
        known = (size > 0) & np.isfinite(data.noise.sigma)
        share = data.noise.sigma[known] / size[known]
        lower.plot(hertz[known], share, color=GREY, lw=1.0)
        # two ticks at least
        lower.set(yscale="log", ylim=(share.min() / 2.5, share.max() * 2.5), ylabel="noise/value [−]")
        plain_ticks(lower.yaxis, 1, TICKS_A_DECADE if np.ptp(np.log10(share)) < 1 else (1.0,))
    lower.set(xscale=upper.get_xscale(), xlim=upper.get_xlim(), xlabel=FREQUENCY_HZ)
    plain_ticks(lower.xaxis, 4, TICKS_A_DECADE)
