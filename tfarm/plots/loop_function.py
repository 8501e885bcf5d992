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
from tfarm.plots.frequency import FREQUENCY, Drawn, draw_curves, over_frequency, parted
from tfarm.plots.style import BLUE, FAINT, GREY, INK, UNSTABLE, Axes, gains_words, note, picture, safe

# dB of L that are drawn: so that the part near 0 dB shows
LOWEST = -80.0
# Ms that is usual at most
USUAL_PEAK = 2.0
# dB: |T| of the contours of a Nichols chart
CLOSED_LOOP = (-20.0, -12.0, -6.0, -3.0, -1.0, 0.25, 0.5, 1.0, 3.0, 6.0)
# a circle, dense at 1, where T/(1 - T) is steep
AROUND: Complex = np.exp(1j * math.pi * np.linspace(-1, 1, 721) ** 3)
# of L around -1: Re from and to, Im from and to
ZOOM = (-2.2, 0.4, -1.3, 1.3)
# of the first arc at infinity, and of the picture
# marks of margins
GAIN = "o"
PHASE_MARGIN = "D"
# of a margin, as on a card
DIGITS = 4
Looks = dict[str, Any]


def decisive(band: LoopMargins) -> Iterator[tuple[float, complex, str, str]]:
    """The gain margins upwards, and downwards where there is a limit, and the phase margin of least size.

    Of each its frequency [rad/s], nan without one, L there, label and marker.
    """
    for factor, name in zip(
        band.gain[::-1] if band.gain[0] else band.gain[1:], ("GM", "GM downwards"), strict=False
    ):
        size, omega = gain_margin(band, factor)
        yield omega or math.nan, -1 / factor, f"{name} {_at(size, 'dB', omega)}", GAIN
    angle, omega = band.phase_margin
    yield (
        omega or math.nan,
        -cmath.exp(1j * math.radians(angle)),
        f"PM {_at(abs(angle), 'deg', omega)}",
        PHASE_MARGIN,
    )


def _at(size: float, unit: str, omega: float | None) -> str:
    """A margin with its frequency."""
    where = f" at {general(omega, DIGITS)} rad/s" if omega else ""
    if math.isfinite(size):
        return f"{general(size, DIGITS)}{unit and f' {unit}'}{where}"
    return "no limit"


def _looks(curve: LoopCurve, of: str = "", color: str = BLUE) -> Looks:
    """Solid lines of a continuous-time loop, dashed ones of a sampled loop."""
    kind = "continuous-time" if curve.period is None else f"sampled, {general(1e3 * curve.period, DIGITS)} ms"
    ls = "-" if curve.period is None else (0, (5, 2))
    return {"color": color, "ls": ls, "label": f"{of}{kind}: {curve.stability}"}


def _marked(curve: LoopCurve, label: str, marker: str, size: float = 6.5) -> Looks:
    """A filled mark of a continuous-time loop, an open one of a sampled loop."""
    inside, edge, words = (INK, "white", "") if curve.period is None else ("white", INK, ", sampled")
    return {
        "ls": "none",
        "marker": marker,
        "mfc": inside,
        "mec": edge,
        "ms": size,
        "zorder": 5,
        "label": label + words,
    }


def _of_loop(words: str, **how: Any) -> Callable[[Callable[..., None]], Any]:
    """A picture of the loop function, by its margins or as a curve."""

    def title(found: Any) -> str:
        curve = found.curve
        return f"{curve.arm.name}: {words}; {gains_words(curve.law)}\n{curve.note}".rstrip()

    return picture((Margins | LoopCurve, "tfarm.margins or tfarm.loop_function returns"), title=title, **how)


def draw_loops(curves: Iterable[Drawn], label: str, upper: Axes, lower: Axes) -> None:
    """|L| [dB] of loops over their frequencies with the line 0 dB, and its angle from -180 to 180 degrees."""
    # dB of L that are drawn: so that the part near 0 dB shows
    highest = 60.0
    draw_curves(curves, decibels, upper, lower)
    upper.axhline(0.0, color=GREY, lw=0.9)
    lower.hlines([-180, 180], 0, 1, color=GREY, lw=0.9, transform=lower.get_yaxis_transform())
    over_frequency(upper, label)
    low, high = upper.get_ylim()
    upper.set_ylim(max(low, LOWEST + min(0.0, high)), np.clip(high, 5.0, highest + max(0.0, low)))
    lower.set(xscale="log", xlim=upper.get_xlim(), xlabel=FREQUENCY)


@_of_loop("loop function L", size=(9.0, 6.4), rows=(1.5, 1.0))
def loop(found: Margins | LoopCurve, *, ax: Sequence[Axes]) -> None:
    """Bode plot of the loop function with its margins, in two axes, those given or new ones: these axes.

    `found` is what `tfarm.margins` or `tfarm.loop_function` returns.  |L| in dB above the phase from -180 to 180 deg.
    All gain and phase crossovers have a mark, the decisive ones a line of the size of the margin and a label.
    """
    upper, lower = ax
    sides = found.curve.sides
    draw_loops([(each.omega, each.L, _looks(each)) for each in sides], "|L| [dB]", upper, lower)
    for each in sides:
        if each.margins is not None:
            gain = [(w, 1.0) for w, _ in each.margins.gain_crossovers]
            phase = [(w, 1 / t) for w, t in each.margins.phase_crossovers if w and t]
            for marker, label, crossed in (
                (PHASE_MARGIN, "gain crossovers, |L| = 1", gain),
                (GAIN, "phase crossovers, L < 0", phase),
            ):
                w, sizes = np.reshape(crossed, (-1, 2)).T
                upper.plot(w, decibels(sizes), marker, ms=3.0, color=GREY, label=label)
            for omega, L, label, marker in decisive(each.margins):
                size = float(decibels(abs(L)))
                angle = math.degrees(float(np.angle(L)))
                upper.plot([omega], [size], **_marked(each, label, marker))
                lower.plot([omega], [angle], **_marked(each, label, marker))
                place, ends = (
                    (upper, (size, 0)) if marker == GAIN else (lower, (math.copysign(180, angle), angle))
                )
                place.plot([omega, omega], ends, color=INK, lw=1.6, ls=_looks(each)["ls"], zorder=4)


def _chart(L: Complex) -> tuple[Real, Real]:
    """Phase in (-360, 0] deg and size [dB] of points L, with a gap where the phase wraps."""
    return parted(-np.mod(-np.degrees(np.angle(L)), 360.0), decibels(L))


@_of_loop("Nichols chart", size=(7.6, 6.8))
def nichols(found: Margins | LoopCurve, *, ax: Axes) -> None:
    """Nichols chart of the loop function: |L| in dB over its phase, with contours of the closed loop; the axes.

    `found` is what `tfarm.margins` or `tfarm.loop_function` returns.  Phases are from -360 to 0 deg.  Contours: |T| in
    dB, and Ms = 2.
    """
    sides = found.curve.sides
    sizes = np.concatenate([each.magnitude for each in sides])
    low, high = np.clip((min(*sizes, -7) - 3, max(*sizes, 7) + 3), -40.0, 40.0)
    ax.set(
        xticks=range(-360, 1, 45),
        yticks=range(-40, 41, 10),
        xlim=(-360, 0),
        ylim=(low, high),
        xlabel="phase of L [deg]",
        ylabel="|L| [dB]",
    )
    ax.grid(False)
    inside = ", ".join(f"{size:g}" for size in CLOSED_LOOP if size > 0)
    label = f"|T| = |L/(1 + L)|: {inside} dB, the larger the nearer to −1"
    for size in CLOSED_LOOP:
        T = 10 ** (size / 20) * AROUND
        ax.plot(*_chart(T / (1 - T)), color=GREY, lw=0.6, zorder=1, label=label)
    for size in CLOSED_LOOP:
        height = -float(decibels(10 ** (-size / 20) - 1))
        if size < 0 and low <= height <= high:
            note(f"|T| = {plain(size)} dB", (0, height), ax, xytext=(4, 0), fontsize=7.5)
    label = f"Ms = {USUAL_PEAK:g}"
    ax.plot(*_chart(-1 + AROUND / USUAL_PEAK), color=INK, lw=1.0, ls=":", zorder=2, label=label)
    ax.plot([-180], [0], "+", color=UNSTABLE, ms=12, mew=2.2, zorder=6, label="the point −1")
    for each in sides:
        ax.plot(*_chart(each.L), zorder=3, **_looks(each))
        for _, L, words, marker in decisive(each.margins) if each.margins is not None else ():
            ax.plot(*_chart(np.array([L])), **_marked(each, words, marker))


@_of_loop("sensitivity S and complementary sensitivity T", size=(9.0, 4.8))
def sensitivity(found: Margins | LoopCurve, *, ax: Axes) -> None:
    """|S| = |1/(1 + L)| and |T| = |L/(1 + L)| in dB over frequency, with their peaks Ms and Mt; the axes.

    `found` is what `tfarm.margins` or `tfarm.loop_function` returns.
    """
    sides = found.curve.sides
    for each in sides:
        for name, values, colour, width, marker, size in (
            ("S", each.sensitivity, BLUE, 1.5, "o", 9.0),
            ("T", each.complementary, INK, 1.0, "s", 5.0),
        ):
            ax.plot(each.omega, values, lw=width, **_looks(each, f"|{name}|, ", colour))
            if each.margins is not None:
                peak, omega = (
                    each.margins.sensitivity_peak if name == "S" else each.margins.complementary_peak
                )
                label = f"M{name.lower()} {_at(peak, '', omega)}"
                ax.plot([omega or math.nan], [decibels(peak)], **_marked(each, label, marker, size))
    ax.axhline(0.0, color=GREY, lw=0.9)
    ax.axhline(float(decibels(USUAL_PEAK)), color=GREY, lw=0.9, ls=":", label=f"Ms = {USUAL_PEAK:g}")
    over_frequency(ax, "|S|, |T| [dB]")
    ax.set_ylim(bottom=max(ax.get_ylim()[0], LOWEST))


# ------------------------------------------------------------ Nyquist


def _words(data: Nyquist, name: str) -> str:
    """Controller and verdict, gains, and both counts."""
    verdict = data.verdict
    gains = gains_words(verdict.full.law).removeprefix(f"{name}, ")
    counts = f"encirclements of −1: {data.encirclements:d};  unstable poles: {verdict.contour.unstable}"
    return f"{safe(name)}{': ' * bool(name)}{verdict.word.upper()}\n{safe(gains)}\n{counts}"


@picture(
    (Nyquist, "tfarm.nyquist returns"),
    size=(9.6, 5.6),
    title=lambda data: f"{data.verdict.full.arm.name}: the loop function L(iω)",
)
def nyquist(data: Nyquist, *, ax: Axes, name: str = "") -> None:
    """L on the imaginary axis (from `tfarm.nyquist`), linear, and next to it a zoom at -1; the axes of the whole.

    With the unit circle, the circle of Ms = 2 and that of the loop's own Ms, which touches L.  `name`: that of the
    controller.  Larger L is cut off; `disc` shows all of it.
    """
    L = np.where(data.is_arc | ~np.isfinite(data.L), np.nan, data.L)
    # at least as far as the zoom
    edge = float(np.clip(1.1 * np.nanmax(abs(L)), 2.2, 20.0))
    # as wide as the plot, a quarter of that between both
    zoom = ax.inset_axes((5 / 9, 0, 4 / 9, 1))
    ticks = [
        tick for tick in MaxNLocator(5, steps=(1, 2, 5, 10)).tick_values(-edge, edge) if abs(tick) <= edge
    ]
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
    zoom.set(xlim=ZOOM[:2], ylim=ZOOM[2:], xlabel="Re L [−], zoom at −1")
    circles: list[tuple[complex, float, Looks]] = [
        (0.0, 1.0, {"color": GREY, "ls": "-", "label": "|L| = 1"}),
        (-1.0, 1 / USUAL_PEAK, {"color": INK, "ls": ":", "label": f"Ms = {USUAL_PEAK:g}"}),
    ]
    if (peak := data.sensitivity_peak) is not None:
        label = f"radius 1/Ms, Ms {_at(peak.value, '', peak.omega)}"
        circles.append((-1.0, 1 / peak.value, {"color": INK, "ls": "--", "label": label}))
    for place in (ax, zoom):
        for centre, radius, looks in circles:
            circle = centre + radius * AROUND
            place.plot(circle.real, circle.imag, lw=0.9, zorder=2, **looks)
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
    """L on all of Nyquist's contour (from `tfarm.nyquist`), stability and encirclements above it; the axes.

    A size r of L is drawn as r/(1 + r): the rim is infinity, -1 lies half way.  `name`: that of the controller.
    """
    # |L| of the rings
    ring_sizes = (0.2, 0.5, 1.0, 2.0, 5.0, math.inf)
    reach = 1.35
    radii = [1.0 if math.isinf(size) else size / (1 + size) for size in ring_sizes]
    ax.set(aspect="equal", yticks=[], xlim=(-reach, reach), ylim=(-reach, reach), frame_on=False)
    for radius in radii:
        ax.add_patch(
            Circle((0, 0), radius, fill=False, ec=GREY if radius in (0.5, 1.0) else FAINT, lw=0.7, zorder=0.6)
        )
    _curve(np.where(data.is_arc, np.nan, compress_radius(data.L)), -0.5, 1.0, ax)
    _arcs(data, ax)
    ax.set_xlabel("|L| at the rings [−]", loc="right")
    ax.set_xticks(radii, [plain(size).replace("inf", "∞") for size in ring_sizes], fontsize=7.5)
    ax.set_title(_words(data, name), fontsize=9.0, loc="center")


def _curve(z: Complex, critical: float, edge: float, ax: Axes) -> None:
    """The curve of rising w with arrows, its mirror image for w < 0, the point -1, and both axes out to the edge."""
    ax.grid(False)
    ax.plot([-edge, edge, math.nan, 0, 0], [0, 0, math.nan, -edge, edge], color=FAINT, lw=0.7, zorder=0.5)
    ax.plot(z.real, z.imag, color=BLUE, lw=1.3, zorder=3, label="ω > 0, arrows as it rises")
    ax.plot(z.real, -z.imag, color=BLUE, lw=0.6, alpha=0.55, zorder=2, label="ω < 0")
    arrows(np.where(z.real < edge, z, np.nan), ax, (0.12, 0.4, 0.75), BLUE)
    ax.plot([critical], [0], "+", color=UNSTABLE, ms=11, mew=2.2, zorder=6, ls="none", label="the point −1")


def arrows(z: Complex, ax: Axes, shares: Sequence[float] = (0.5,), color: str = INK) -> None:
    """Heads in the direction in which a curve runs, at these shares of its length in view, where that is enough."""
    to_view = ax.transData - ax.transAxes
    at = to_view.transform(np.c_[z.real, z.imag])
    seen = np.flatnonzero(((at > 0) & (at < 1)).all(axis=1))
    # none from where it leaves the view to its return
    way = np.diff(at[seen], axis=0) * (np.diff(seen) == 1)[:, None]
    along = np.cumsum(np.hypot(*way.T))
    for n in np.searchsorted(along, along[-1] * np.array(shares)) if along.max(initial=0.0) > 0.05 else ():
        half = 0.015 * way[n] / np.hypot(*way[n])
        tail, head = to_view.inverted().transform(at[seen[n]] + way[n] / 2 + [-half, half]).tolist()
        looks = {
            "arrowstyle": "-|>",
            "color": color,
            "lw": 0.0,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 15,
        }
        ax.annotate("", head, tail, arrowprops=looks, zorder=3.5)


def _arcs(data: Nyquist, ax: Axes) -> None:
    """Past poles as arcs beyond the rim, one for all that turn alike."""
    # of the first arc at infinity, and of the picture
    arc_radius = 1.04
    # arcs whose ends are as near as that turn alike
    arcs_alike = math.radians(20.0)
    z = compress_radius(data.L)
    alike: dict[tuple[int, int], list[tuple[Whole, float, float]]] = {}
    for piece in np.split(np.arange(z.size), np.flatnonzero(np.diff(data.is_arc.astype(int))) + 1):
        if data.is_arc[piece[0]]:
            first, *_, last = np.unwrap(np.angle(data.L[piece])).tolist()
            alike.setdefault((round(first / arcs_alike), round(last / arcs_alike)), []).append(
                (piece, first, last)
            )
    # from one radius to the next, the last being 1.2
    step = min(0.03, (1.2 - arc_radius) / max(1, len(alike) - 1))
    for number, same in enumerate(alike.values()):
        piece, first, last = same[0]
        ring = (arc_radius + step * number) * np.exp(1j * np.linspace(first, last, 61))
        whole = np.r_[z[piece[0] - 1 : piece[0]], ring, z[piece[-1] + 1 : piece[-1] + 2]]
        ax.plot(
            whole.real,
            whole.imag,
            color=BLUE,
            lw=0.8,
            ls=(0, (3, 1.5)),
            zorder=3,
            label="past poles on the axis",
        )
        arrows(ring, ax, color=BLUE)
        if len(same) > 1:
            place = 1.28 * ring[30] / abs(ring[30])
            ax.text(
                place.real, place.imag, f"{len(same)} ×", fontsize=8.0, color=BLUE, ha="center", va="center"
            )
