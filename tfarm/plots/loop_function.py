"""Pictures of the loop function L: Bode and Nichols plots with its margins, sensitivities, and Nyquist plots.

Continuous-time loops are solid, sampled ones dashed.  A Nyquist plot is linear, with a zoom at -1, or a disc: infinity
is the rim, poles on the axis are arcs beyond it.
"""

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import MaxNLocator

from tfarm.arrays import Complex, Real, Whole
from tfarm.digits import general, plain
from tfarm.loop.curve import LoopCurve, decibels, gain_margin
from tfarm.loop.loop_margins import LoopMargins
from tfarm.loop.margins import Margins
from tfarm.loop.nyquist import Nyquist, compress_radius
from tfarm.plots.frequency import (
    Drawn,
    along_omega,
    degrees_of,
    draw_size_and_angle,
    over_frequency,
    split_at_wraps,
)
from tfarm.plots.labels import gains_words
from tfarm.plots.style import (
    BLUE,
    FAINT,
    GREY,
    INK,
    UNSTABLE,
    Axes,
    note,
    picture,
    plot_complex,
    safe,
    zero_line,
)

# dB of L that are drawn: so that the part near 0 dB shows
LOWEST = -80.0
# Ms that is usual at most
USUAL_PEAK = 2.0
# marks of margins
GAIN = "o"
PHASE_MARGIN = "D"
Looks = dict[str, Any]


def circle_around(centre: complex, radius: float) -> Complex:
    """Return a circle, dense at its right end, where T/(1 - T) is steep for |T| near 1."""
    angle = math.pi * np.linspace(-1, 1, 721) ** 3
    return centre + radius * np.exp(1j * angle)


def decisive(band: LoopMargins) -> Iterator[tuple[float, complex, str, str]]:
    """Yield the gain margins upwards, and downwards where there is a limit, and the phase margin of least size.

    Of each its frequency [rad/s], nan without one, L there, label and marker.
    """
    down, up = band.gain
    factors = {"GM": up}
    if down:
        factors["GM downwards"] = down
    for name, factor in factors.items():
        size, omega = gain_margin(band, factor)
        yield omega or math.nan, -1 / factor, f"{name} {_margin_words(size, 'dB', omega)}", GAIN
    angle, omega = band.phase_margin
    L = -cmath.exp(1j * math.radians(angle))
    yield omega or math.nan, L, f"PM {_margin_words(abs(angle), 'deg', omega)}", PHASE_MARGIN


def _margin_words(size: float, unit: str, omega: float | None) -> str:
    """Return a margin with its frequency, at the digits of a card."""
    if not math.isfinite(size):
        return "no limit"
    words = f"{general(size, 4)} {unit}".rstrip()
    if omega:
        words += f" at {general(omega, 4)} rad/s"
    return words


def _looks(curve: LoopCurve, of: str = "", color: str = BLUE) -> Looks:
    """Return solid lines of a continuous-time loop, dashed ones of a sampled loop."""
    kind = "continuous-time"
    ls: Any = "-"
    if curve.period is not None:
        kind = f"sampled, {general(1e3 * curve.period, 4)} ms"
        ls = (0, (5, 2))
    return {"color": color, "ls": ls, "label": f"{of}{kind}: {curve.stability}"}


def _mark(
    curve: LoopCurve, label: str, marker: str, omega: float, value: Any, ax: Axes, size: float = 6.5
) -> None:
    """Draw a filled mark of a continuous-time loop, an open one of a sampled loop."""
    inside = INK
    edge = "white"
    if curve.period is not None:
        inside, edge = edge, inside
        label += ", sampled"
    ax.plot([omega], [value], marker, mfc=inside, mec=edge, ms=size, zorder=5, label=label)


def _of_loop(words: str, **how: Any) -> Callable[[Callable[..., None]], Any]:
    """Return the decorator of a picture of the loop function, by its margins or as a curve."""

    def title(found: Any) -> str:
        curve = found.curve
        return f"{curve.arm.name}: {words}; {gains_words(curve.law)}\n{curve.note}".rstrip()

    return picture((Margins | LoopCurve, "tfarm.margins or tfarm.loop_function returns"), title=title, **how)


def draw_loops(curves: Iterable[Drawn], label: str, upper: Axes, lower: Axes) -> None:
    """Draw |L| [dB] of loops over their frequencies with the line 0 dB, and its angle from -180 to 180 degrees."""
    draw_size_and_angle(curves, decibels, upper, lower)
    zero_line(upper, 0.9)
    lower.hlines([-180, 180], 0, 1, color=GREY, lw=0.9, transform=lower.get_yaxis_transform())
    over_frequency(upper, label)
    low, high = upper.get_ylim()
    # dB: so that the part near 0 dB shows
    highest = 60.0 + max(0.0, low)
    upper.set_ylim(max(low, LOWEST + min(0.0, high)), np.clip(high, 5.0, highest))
    along_omega(lower, xlim=upper.get_xlim())


@_of_loop("loop function L", size=(9.0, 6.4), rows=(1.5, 1.0))
def loop(found: Margins | LoopCurve, *, ax: Sequence[Axes]) -> None:
    """Draw the Bode plot of the loop function with its margins, in two axes, those given or new ones: these axes.

    `found` is what `tfarm.margins` or `tfarm.loop_function` returns.  |L| in dB above the phase from -180 to 180 deg.
    All gain and phase crossovers have a mark, the decisive ones a line of the size of the margin and a label.
    """
    upper, lower = ax
    sides = found.curve.sides
    draw_loops([(each.omega, each.L, _looks(each)) for each in sides], "|L| [dB]", upper, lower)
    for each in sides:
        if each.margins is not None:
            _draw_crossovers(each.margins, upper)
            for margin in decisive(each.margins):
                _draw_margin(each, margin, upper, lower)


def _draw_crossovers(band: LoopMargins, ax: Axes) -> None:
    """Draw a mark at each gain and phase crossover."""
    gain = [(w, 1.0) for w, _ in band.gain_crossovers]
    phase = [(w, 1 / t) for w, t in band.phase_crossovers if w and t]
    for marker, label, crossovers in (
        (PHASE_MARGIN, "gain crossovers, |L| = 1", gain),
        (GAIN, "phase crossovers, L < 0", phase),
    ):
        w, sizes = np.reshape(crossovers, (-1, 2)).T
        ax.plot(w, decibels(sizes), marker, ms=3.0, color=GREY, label=label)


def _draw_margin(curve: LoopCurve, margin: tuple[float, complex, str, str], upper: Axes, lower: Axes) -> None:
    """Draw a margin in both axes as a mark, and in one as a line of its size."""
    omega, L, label, marker = margin
    size = float(decibels(abs(L)))
    angle = math.degrees(cmath.phase(L))
    _mark(curve, label, marker, omega, size, upper)
    _mark(curve, label, marker, omega, angle, lower)
    place = upper
    ends = (size, 0.0)
    if marker != GAIN:
        place = lower
        ends = (math.copysign(180, angle), angle)
    place.plot([omega, omega], ends, color=INK, lw=1.6, ls=_looks(curve)["ls"], zorder=4)


def _chart(L: Complex) -> tuple[Real, Real]:
    """Return phase in (-360, 0] deg and size [dB] of points L, with a gap where the phase wraps."""
    phase = -np.mod(-degrees_of(L), 360.0)
    return split_at_wraps(phase, decibels(L))


@_of_loop("Nichols chart", size=(7.6, 6.8))
def nichols(found: Margins | LoopCurve, *, ax: Axes) -> None:
    """Draw the Nichols chart of the loop function: |L| in dB over phase, with contours of the closed loop; the axes.

    `found` is what `tfarm.margins` or `tfarm.loop_function` returns.  Phases are from -360 to 0 deg.  Contours: |T| in
    dB, and Ms = 2.
    """
    sides = found.curve.sides
    sizes = np.concatenate([each.magnitude for each in sides])
    low = max(min(*sizes, -7) - 3, -40.0)
    high = min(max(*sizes, 7) + 3, 40.0)
    ax.set(
        xticks=range(-360, 1, 45),
        yticks=range(-40, 41, 10),
        xlim=(-360, 0),
        ylim=(low, high),
        xlabel="phase of L [deg]",
        ylabel="|L| [dB]",
    )
    ax.grid(False)
    _draw_contours(ax)
    _mark_critical(-180.0, ax)
    for each in sides:
        ax.plot(*_chart(each.L), zorder=3, **_looks(each))
        if each.margins is not None:
            for _, L, words, marker in decisive(each.margins):
                (phase,), (size,) = _chart(np.array([L]))
                _mark(each, words, marker, phase, size, ax)


def _mark_critical(at: float, ax: Axes, ms: float = 12) -> None:
    """Draw the point -1."""
    ax.plot([at], [0], "+", color=UNSTABLE, ms=ms, mew=2.2, zorder=6, label="the point −1")


def _draw_contours(ax: Axes) -> None:
    """Draw contours of the closed loop on a Nichols chart: |T| in dB, and the usual Ms."""
    closed_loop = (-20.0, -12.0, -6.0, -3.0, -1.0, 0.25, 0.5, 1.0, 3.0, 6.0)
    inside = ", ".join(f"{size:g}" for size in closed_loop if size > 0)
    label = f"|T| = |L/(1 + L)|: {inside} dB, the larger the nearer to −1"
    for size in closed_loop:
        T = circle_around(0.0, 10 ** (size / 20))
        ax.plot(*_chart(T / (1 - T)), color=GREY, lw=0.6, zorder=1, label=label)
    low, high = ax.get_ylim()
    for size in closed_loop:
        height = -float(decibels(10 ** (-size / 20) - 1))
        if size < 0 and low <= height <= high:
            note(f"|T| = {plain(size)} dB", (0, height), ax, xytext=(4, 0), fontsize=7.5)
    usual = circle_around(-1.0, 1 / USUAL_PEAK)
    ax.plot(*_chart(usual), color=INK, lw=1.0, ls=":", zorder=2, label=f"Ms = {USUAL_PEAK:g}")


@_of_loop("sensitivity S and complementary sensitivity T", size=(9.0, 4.8))
def sensitivity(found: Margins | LoopCurve, *, ax: Axes) -> None:
    """Draw |S| = |1/(1 + L)| and |T| = |L/(1 + L)| in dB over frequency, with their peaks Ms and Mt; the axes.

    `found` is what `tfarm.margins` or `tfarm.loop_function` returns.
    """
    for each in found.curve.sides:
        ax.plot(each.omega, each.sensitivity, lw=1.5, **_looks(each, "|S|, "))
        if each.margins is not None:
            _draw_peak(each, "Ms", each.margins.sensitivity_peak, "o", 9.0, ax)
        ax.plot(each.omega, each.complementary, lw=1.0, **_looks(each, "|T|, ", INK))
        if each.margins is not None:
            _draw_peak(each, "Mt", each.margins.complementary_peak, "s", 5.0, ax)
    zero_line(ax, 0.9)
    ax.axhline(float(decibels(USUAL_PEAK)), color=GREY, lw=0.9, ls=":", label=f"Ms = {USUAL_PEAK:g}")
    over_frequency(ax, "|S|, |T| [dB]")
    low, _ = ax.get_ylim()
    ax.set_ylim(bottom=max(low, LOWEST))


def _draw_peak(
    curve: LoopCurve, name: str, peak: tuple[float, float | None], marker: str, size: float, ax: Axes
) -> None:
    """Draw the mark of a peak, by its value and frequency."""
    value, omega = peak
    label = f"{name} {_margin_words(value, '', omega)}"
    _mark(curve, label, marker, omega or math.nan, decibels(value), ax, size)


# ------------------------------------------------------------ Nyquist


def _words(data: Nyquist, name: str) -> str:
    """Return controller and verdict, gains, and both counts."""
    verdict = data.verdict
    gains = gains_words(verdict.full.law).removeprefix(f"{name}, ")
    counts = f"encirclements of −1: {data.encirclements:d};  unstable poles: {verdict.contour.unstable}"
    word = verdict.word.upper()
    if name:
        word = f"{safe(name)}: {word}"
    return f"{word}\n{safe(gains)}\n{counts}"


@picture(
    (Nyquist, "tfarm.nyquist returns"),
    size=(9.6, 5.6),
    title=lambda data: f"{data.verdict.full.arm.name}: the loop function L(iω)",
)
def nyquist(data: Nyquist, *, ax: Axes, name: str = "") -> None:
    """Draw L on the imaginary axis (from `tfarm.nyquist`), linear, and next to it a zoom at -1; the axes of the whole.

    With the unit circle, the circle of Ms = 2 and that of the loop's own Ms, which touches L.  `name`: that of the
    controller.  Larger L is cut off; `disc` shows all of it.
    """
    L = np.where(data.is_arc | ~np.isfinite(data.L), np.nan, data.L)
    # at least as far as the zoom
    edge = float(np.clip(1.1 * np.nanmax(abs(L)), 2.2, 20.0))
    # as wide as the plot, a quarter of that between both
    zoom = ax.inset_axes((5 / 9, 0, 4 / 9, 1))
    found: Any = MaxNLocator(5, steps=(1, 2, 5, 10)).tick_values(-edge, edge)
    ticks = found[abs(found) <= edge]
    ax.set(
        aspect="equal",
        frame_on=False,
        xticks=ticks,
        yticks=ticks,
        xlim=(-edge, 3.5 * edge),
        ylim=(-edge, edge),
        ylabel="Im L [−]",
    )
    ax.set_xlabel("Re L [−]", loc="left")
    frame = ax.add_patch(
        Rectangle((-edge, -edge), 2 * edge, 2 * edge, fill=False, ec=GREY, lw=0.8, clip_on=False)
    )
    zoom.set(xlim=(-2.2, 0.4), ylim=(-1.3, 1.3), xlabel="Re L [−], zoom at −1")
    circles = [
        (circle_around(0.0, 1.0), GREY, "-", "|L| = 1"),
        (circle_around(-1.0, 1 / USUAL_PEAK), INK, ":", f"Ms = {USUAL_PEAK:g}"),
    ]
    peak = data.sensitivity_peak
    if peak is not None:
        label = f"radius 1/Ms, Ms {_margin_words(peak.value, '', peak.omega)}"
        circles.append((circle_around(-1.0, 1 / peak.value), INK, "--", label))
    for place in (ax, zoom):
        for circle, colour, ls, label in circles:
            plot_complex(circle, place, lw=0.9, zorder=2, color=colour, ls=ls, label=label)
        _curve(L, -1.0, edge, place)
    for line in ax.lines:
        line.set_clip_path(frame)
    ax.set_title(_words(data, name), fontsize=9.0, loc="left")


@picture(
    (Nyquist, "tfarm.nyquist returns"),
    size=(5.0, 6.1),
    title=lambda data: f"{data.verdict.full.arm.name}: the loop function L(iω)",
)
def disc(data: Nyquist, *, ax: Axes, name: str = "") -> None:
    """Draw L on all of Nyquist's contour (from `tfarm.nyquist`), stability and encirclements above it; the axes.

    A size r of L is drawn as r/(1 + r): the rim is infinity, -1 lies half way.  `name`: that of the controller.
    """
    # |L| of the rings
    ring_sizes = (0.2, 0.5, 1.0, 2.0, 5.0, math.inf)
    reach = 1.35
    radii = [1.0 if math.isinf(size) else size / (1 + size) for size in ring_sizes]
    ax.set(aspect="equal", yticks=[], xlim=(-reach, reach), ylim=(-reach, reach), frame_on=False)
    for radius in radii:
        colour = GREY if radius in (0.5, 1.0) else FAINT
        ax.add_patch(Circle((0, 0), radius, fill=False, ec=colour, lw=0.7, zorder=0.6))
    _curve(np.where(data.is_arc, np.nan, compress_radius(data.L)), -0.5, 1.0, ax)
    _arcs(data, ax)
    ax.set_xlabel("|L| at the rings [−]", loc="right")
    ax.set_xticks(radii, [plain(size).replace("inf", "∞") for size in ring_sizes], fontsize=7.5)
    ax.set_title(_words(data, name), fontsize=9.0, loc="center")


def _curve(z: Complex, critical: float, edge: float, ax: Axes) -> None:
    """Draw the curve of rising w with arrows, its mirror image, the point -1, and both axes out to the edge."""
    ax.grid(False)
    ax.plot([-edge, edge, math.nan, 0, 0], [0, 0, math.nan, -edge, edge], color=FAINT, lw=0.7, zorder=0.5)
    plot_complex(z, ax, color=BLUE, lw=1.3, zorder=3, label="ω > 0, arrows as it rises")
    plot_complex(z.conj(), ax, color=BLUE, lw=0.6, alpha=0.55, zorder=2, label="ω < 0")
    arrows(np.where(z.real < edge, z, np.nan), ax, (0.12, 0.4, 0.75), BLUE)
    _mark_critical(critical, ax, 11)


def arrows(z: Complex, ax: Axes, shares: Sequence[float] = (0.5,), color: str = INK) -> None:
    """Draw heads along the direction of a curve, at these shares of its length in view, where that is enough."""
    to_view = ax.transData - ax.transAxes
    at = to_view.transform(np.c_[z.real, z.imag])
    seen = np.flatnonzero(((at > 0) & (at < 1)).all(axis=1))
    # none from where it leaves the view to its return
    way = np.diff(at[seen], axis=0) * (np.diff(seen) == 1)[:, None]
    along = np.cumsum(np.hypot(*way.T))
    if along.max(initial=0.0) <= 0.05:
        return
    looks = {"arrowstyle": "-|>", "color": color, "lw": 0.0, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 15}
    for n in np.searchsorted(along, along[-1] * np.array(shares)):
        step = way[n]
        half = 0.015 * step / np.hypot(*step)
        ends = at[seen[n]] + step / 2 + [-half, half]
        tail, head = to_view.inverted().transform(ends).tolist()
        ax.annotate("", head, tail, arrowprops=looks, zorder=3.5)


def _arcs(data: Nyquist, ax: Axes) -> None:
    """Draw arcs past poles beyond the rim, one for all that turn alike."""
    # arcs whose ends are as near as that turn alike
    near = math.radians(20.0)
    alike: dict[tuple[int, int], list[tuple[Whole, float, float]]] = {}
    changes = np.flatnonzero(np.diff(data.is_arc.astype(int))) + 1
    for piece in np.split(np.arange(data.L.size), changes):
        if data.is_arc[piece[0]]:
            first, *_, last = np.unwrap(np.angle(data.L[piece])).tolist()
            ends = (round(first / near), round(last / near))
            alike.setdefault(ends, []).append((piece, first, last))
    # of the first arc at infinity
    radius = 1.04
    # from one radius to the next, the last being 1.2
    step = min(0.03, (1.2 - radius) / max(1, len(alike) - 1))
    z = compress_radius(data.L)
    for same in alike.values():
        piece, first, last = same[0]
        ring = radius * np.exp(1j * np.linspace(first, last, 61))
        radius += step
        before = z[piece[0] - 1 : piece[0]]
        after = z[piece[-1] + 1 : piece[-1] + 2]
        whole = np.r_[before, ring, after]
        plot_complex(
            whole, ax, color=BLUE, lw=0.8, ls=(0, (3, 1.5)), zorder=3, label="past poles on the axis"
        )
        arrows(ring, ax, color=BLUE)
        if len(same) > 1:
            at = 1.28 * ring[30] / abs(ring[30])
            words = f"{len(same)} ×"
            ax.text(at.real, at.imag, words, fontsize=8.0, color=BLUE, ha="center", va="center")
