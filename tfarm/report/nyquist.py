"""Nyquist plots of the exact loop function that hide nothing: infinity is drawn on the rim, poles on the axis by arcs.

The contour runs up the imaginary axis, passes each pole of L on it by a small semicircle on the right, and closes along
the edges of the box in which the verdict's poles were counted.  L is evaluated on all of it, so the encirclements of -1
are counted, not read off: clockwise ones are closed-loop poles inside the contour, as no pole of L is in there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from tfarm.errors import ConvergenceError
from tfarm.loop.frequencies import band_of, grid, natural_frequencies
from tfarm.loop.plant import Loop
from tfarm.loop.poles import ON_AXIS
from tfarm.loop.stability import Stability
from tfarm.records import record
from tfarm.report.digits import plain, significant
from tfarm.report.figures import BLUE, FAINT, GREY, ORANGE, blank, headline, style
from tfarm.report.loop_laws import NamedLaw
from tfarm.report.tables import Column, Table, data_column, number_column, text_column

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

INDENT = 0.05  # radius of a semicircle around a pole of L, in units of its residue: |L| is about 20 on it
NEARER = 0.1  # of the way to the nearest closed-loop pole: no step past a pole of L leaves an unstable one out
SLOW = 200  # points between that and the arm's own grid
EDGE = 750  # points along an edge of the box, to begin with
ARC = np.linspace(-math.pi / 2, math.pi / 2, 41)
FAST = 0.7  # radians: where the argument of 1 + L turns by more between neighbours of the contour it is halved
FINE = 0.02  # of the rim's radius: the longest straight piece of a drawn curve
ROUNDS = 24  # of halving where it turns more
RINGS = (0.1, 0.3, 1.0, 3.0, 10.0)  # |L| of the rings
RING, LAST, STEP = 1.04, 1.2, 0.03  # radius of the first arc at infinity, of the last at most, from one to the next

COUNTS = (
    "L has no pole right of the contour, so each clockwise turn around −1 (counted negative) is one unstable "
    "closed-loop pole. The count in a box was made without Nyquist, by finding every pole; poles whose real part is "
    "less than 10⁻¹² of their size are not told apart from the axis there (undecided), though their turns around −1 "
    "are counted.{last}"
)
COMPARED = "to compare"
COUNTED = " The last law is there to show that the count is not always 0."


@dataclass(frozen=True)
@record
class Nyquist:
    """L on the contour for Im s >= 0: `s` (n,), `L` (n,), `is_arc` where the contour passes a pole on the axis.

    `poles` [rad/s] are those of L on the axis, `encirclements` of -1 by the whole contour, counter-clockwise positive,
    `verdict` what the poles say, counted in a box without this contour.
    """

    named: NamedLaw
    s: Complex
    L: Complex
    is_arc: NDArray[np.bool_]
    poles: Real
    encirclements: int
    verdict: Stability

    @property
    def on_axis(self) -> int:
        """Poles of the box that lie on the axis to working precision, apart from that at 0."""
        moving = self.verdict.poles.moving
        near = abs(moving.real) <= ON_AXIS * abs(moving)
        return int((near * np.where(moving.imag > 0, 2, 1)).sum())

    @property
    def expected(self) -> int:
        """Unstable closed-loop poles by Nyquist's criterion."""
        return -self.encirclements


def nyquist(named: NamedLaw, verdict: Stability) -> Nyquist:
    """The plot of one law, its encirclements counted up to the verdict's band.

    The contour goes around the right part of the verdict's box, so both counts are of one region.  Raises
    ConvergenceError where a curve passes -1 so close that its turns cannot be counted, or the two counts differ.
    """
    loop, band = verdict.loop, verdict.band
    poles = poles_on_axis(loop, band)
    s, is_arc = smooth(loop, *upper_contour(loop, poles, band, verdict.poles.moving))
    corner = complex(verdict.poles.box.re_max, band)
    across, down = np.linspace(1j * band, corner, EDGE), np.linspace(corner, corner.real, EDGE)
    turned = turning(loop, np.r_[s, across[1:], down[1:]])
    plot = Nyquist(named, s, loop.loop_function(s), is_arc, poles, round(turned / math.pi), verdict)
    if not verdict.unstable_roots <= plot.expected <= verdict.unstable_roots + plot.on_axis:
        text = (
            f"{plot.expected} unstable poles by the turns around -1, {verdict.unstable_roots} by finding all in a box"
        )
        raise ConvergenceError(text, plot, plot.expected - verdict.unstable_roots)
    return plot


def poles_on_axis(loop: Loop, band: float) -> Real:
    """Poles of L on the imaginary axis [rad/s], from 0 up: the rigid body's, and at C = 0 every natural frequency."""
    arm, law = loop.arm, loop.law
    zero = [0.0] if arm.has_rigid_mode and (law.K1 or law.Kp) else []
    return np.r_[zero, natural_frequencies(arm, band)] if arm.link.damping == 0 else np.array(zero)


def upper_contour(loop: Loop, poles: Real, band: float, closed: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """From s = 0 (or right of it, where a pole is) up the axis to the band, past each pole on its right.

    `closed` are the closed loop's poles: each step past a pole of L goes nearer to it than the nearest of them.
    """
    omega = np.asarray(grid(loop.arm, band))
    s, is_arc = 1j * omega, np.zeros(omega.size, bool)
    for pole in poles:
        radius = indentation(loop, float(pole))
        away = abs(closed - 1j * pole)
        radius = min(radius, NEARER * float(away[away > ON_AXIS * pole].min(initial=math.inf)))
        if pole == 0:
            slow = 1j * np.geomspace(radius, omega[0], SLOW)[1:-1]
            s, is_arc = np.r_[s, slow], np.r_[is_arc, np.zeros(slow.size, bool)]
        clear = abs(s - 1j * pole) > radius
        arc = 1j * pole + radius * np.exp(1j * (ARC[ARC >= 0] if pole == 0 else ARC))
        approach = 1j * (pole + np.outer([-1.0, 1.0], radius * np.geomspace(1.05, 1e3, 40)).ravel())
        approach = approach[(approach.imag > 0) & (approach.imag < band)]
        s = np.r_[s[clear], arc, approach]
        is_arc = np.r_[is_arc[clear], np.ones(arc.size, bool), np.zeros(approach.size, bool)]
    order = np.argsort(s.imag, kind="stable")
    return s[order], is_arc[order]


def smooth(loop: Loop, s: Complex, is_arc: NDArray[np.bool_]) -> tuple[Complex, NDArray[np.bool_]]:
    """More points on the axis wherever the drawn curve would have corners."""
    for _ in range(ROUNDS):
        length = abs(np.diff(compressed(loop.loop_function(s))))
        (coarse,) = np.nonzero((length > FINE) & ~is_arc[1:] & ~is_arc[:-1])
        if not coarse.size:
            break
        s = np.insert(s, coarse + 1, (s[coarse] + s[coarse + 1]) / 2)
        is_arc = np.insert(is_arc, coarse + 1, False)
    return s, is_arc


def indentation(loop: Loop, pole: float) -> float:
    """The radius at which |L| is about 20, and at most a thousandth of the pole's frequency (at 0: of the first)."""
    scale = pole or band_of(loop.arm, 1)
    step = 1e-6 * scale
    near = np.array([step + 0j if pole == 0 else 1j * (pole + step)])
    return min(INDENT * float(abs(loop.loop_function(near)[0])) * step, 1e-3 * scale)


def turning(loop: Loop, path: Complex) -> float:
    """By how much [rad] the argument of 1 + L grows along a path, halved where it turns fast."""
    value = 1 + loop.loop_function(path)
    for _ in range(ROUNDS):
        step = np.angle(value[1:] / value[:-1])
        (fast,) = np.nonzero(abs(step) > FAST)
        if not fast.size:
            return float(step.sum())
        middle = (path[fast] + path[fast + 1]) / 2
        path, value = np.insert(path, fast + 1, middle), np.insert(value, fast + 1, 1 + loop.loop_function(middle))
    raise ConvergenceError("the curve passes -1 too close for its encirclements to be counted", path[fast], step[fast])


def compressed(L: Complex) -> Complex:
    """L with its size r drawn as r/(1 + r): 0 stays, 1 is half-way, infinity is the rim."""
    return np.asarray(L / (1 + abs(L)))


# ------------------------------------------------------------ pictures


def draw_nyquist(name: str, plots: Sequence[Nyquist]) -> Figure:
    """One disc a law."""
    with style():
        figure = blank(9.0, 5.3)
        axes = np.atleast_1d(figure.subplots(1, 2))
        for ax in axes[len(plots) :]:
            ax.set_visible(False)
        for ax, plot in zip(axes, plots, strict=False):
            _disc(ax)
            _curve(plot, ax)
            _headings(plot, ax)
        figure.legend(*_legend(), loc="outside lower left", ncols=4, fontsize=8.5)
        band = significant(max(plot.verdict.band for plot in plots), 5)
        headline(figure, f"{name}: the loop function L(iω) up to {band} rad/s")
    return figure


def _disc(ax: Axes) -> None:
    """Rings of equal |L|, the axes, the rim at infinity, and -1."""
    turn = np.exp(1j * np.linspace(0, 2 * math.pi, 361))
    for size in (*RINGS, math.inf):
        ring = turn * (1.0 if math.isinf(size) else size / (1 + size))
        ax.plot(ring.real, ring.imag, color=GREY if size in (1.0, math.inf) else FAINT, lw=0.7, zorder=0.6)
        at = ring[56 if math.isfinite(size) else 124]
        text = "|L| = ∞" if math.isinf(size) else plain(size)
        ax.text(at.real, at.imag, text, fontsize=7.5, color=GREY, ha="center", va="center", zorder=0.7,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip
    ax.plot([-1, 1], [0, 0], color=FAINT, lw=0.7, zorder=0.5)
    ax.plot([0, 0], [-1, 1], color=FAINT, lw=0.7, zorder=0.5)
    ax.plot([-0.5], [0], "+", color=ORANGE, ms=11, mew=2.2, zorder=6)
    ax.annotate("−1", (-0.5, 0), textcoords="offset points", xytext=(-4, 6), ha="right", color=ORANGE, weight="bold",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4}, zorder=5)  # fmt: skip
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    ax.spines[:].set_visible(False)


def _curve(plot: Nyquist, ax: Axes) -> None:
    """Along the axis as a line, past each pole as an arc beyond the rim, arrows with rising frequency."""
    z = compressed(plot.L)
    turn = np.flatnonzero(np.diff(plot.is_arc.astype(int))) + 1
    step = min(STEP, (LAST - RING) / max(1, plot.poles.size - 1))
    number = 0
    for piece in np.split(np.arange(z.size), turn):
        if not plot.is_arc[piece[0]]:
            ax.plot(z[piece].real, z[piece].imag, color=BLUE, lw=1.3, zorder=3)
            ax.plot(z[piece].real, -z[piece].imag, color=BLUE, lw=0.6, alpha=0.55, zorder=2)
            continue
        ring = arc_on_ring(plot.L[piece], RING + step * number)
        ends = np.r_[z[max(0, piece[0] - 1)], ring, z[min(z.size - 1, piece[-1] + 1)]]
        ends = ends[1:] if piece[0] == 0 else ends
        ax.plot(ends.real, ends.imag, color=BLUE, lw=0.8, ls=(0, (3, 1.5)), zorder=3)
        _arrow(ring, ax)
        number += 1
    for at in _arrows(plot, z):
        _arrow(z[at], ax)
    ax.set_xlim(-LAST - STEP, LAST + STEP)
    ax.set_ylim(-LAST - STEP, LAST + STEP)


def arc_on_ring(L: Complex, radius: float) -> Complex:
    """The directions of L on an arc around a pole, drawn at one radius beyond the rim."""
    angle = np.unwrap(np.angle(L))
    fine = np.interp(np.linspace(0, 1, 61), np.linspace(0, 1, angle.size), angle)
    return np.asarray(radius * np.exp(1j * fine))


def _arrows(plot: Nyquist, z: Complex) -> list[NDArray[np.int64]]:
    """Short pieces of the curve to bear arrows: a third and two thirds of its drawn length on."""
    (along,) = np.nonzero(~plot.is_arc)
    length = np.r_[0.0, np.cumsum(abs(np.diff(z[along])))]
    places = np.searchsorted(length, length[-1] * np.array([0.12, 0.4, 0.75]))
    return [along[max(0, n - 1) : n + 1] for n in places]


def _arrow(piece: Complex, ax: Axes) -> None:
    half = piece.size // 2 if piece.size > 2 else 1
    start, stop = piece[half - 1], piece[half]
    if start == stop:
        return
    way = (stop - start) / abs(stop - start)
    ax.annotate(
        "", (stop.real + 0.012 * way.real, stop.imag + 0.012 * way.imag), (stop.real, stop.imag), zorder=4,
        arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 0.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9},
    )  # fmt: skip


def _headings(plot: Nyquist, ax: Axes) -> None:
    """The verdict and the count above each disc."""
    verdict = plot.verdict
    ax.set_title(
        f"{plot.named.name}: {verdict.verdict.upper()}\n{plot.named.gains}\n"
        f"encirclements of −1: {plot.encirclements:d};  unstable poles: {verdict.unstable_roots}",
        fontsize=9.0, loc="center",
    )  # fmt: skip


def _legend() -> tuple[list[Line2D], list[str]]:
    handles = [
        Line2D([], [], color=BLUE, lw=1.3),
        Line2D([], [], color=BLUE, lw=0.6, alpha=0.55),
        Line2D([], [], color=BLUE, lw=0.8, ls=(0, (3, 1.5))),
        Line2D([], [], color=ORANGE, ls="none", marker="+", ms=9, mew=2.0),
    ]
    return handles, ["ω > 0, arrows as it rises", "ω < 0", "past a pole on the axis", "the point −1"]


# ------------------------------------------------------------ tables


def count_table(plots: Sequence[Nyquist], names: Sequence[str]) -> Table:
    """Verdict, encirclements and unstable poles of each law."""
    verdicts = [plot.verdict for plot in plots]
    counts = np.array([[p.encirclements, p.expected, p.verdict.unstable_roots, p.on_axis] for p in plots])
    bands = np.array([verdict.band for verdict in verdicts])
    words = [f"{it.verdict}{', infinitely many in all' * it.unstable_roots_infinite}" for it in verdicts]
    titles = ("turns around −1", "by Nyquist", "in a box", "undecided")
    keys = ("encirclements", "unstable_by_nyquist", "unstable_in_box", "on_axis_in_box")
    return Table(
        stem="nyquist-count",
        title="Encirclements beside unstable poles",
        caption=COUNTS.format(last=COUNTED if plots[-1].named.name == COMPARED and plots[-1].expected else ""),
        columns=(
            text_column("law", "law", names),
            text_column("verdict", "verdict", words),
            *(
                Column(
                    key=key,
                    title=title,
                    values=column.tolist(),
                    cells=[str(n).replace("-", "−") for n in column],
                    group="" if key == "encirclements" else "unstable poles",
                )
                for key, title, column in zip(keys, titles, counts.T, strict=True)
            ),
            number_column("band_rad_s", "up to", "rad/s", bands, [significant(float(band), 6) for band in bands]),
        ),
    )


def curve_data(plots: Sequence[Nyquist]) -> Table:
    """L on the contour of every law."""
    L, s = np.concatenate([plot.L for plot in plots]), np.concatenate([plot.s for plot in plots])
    law = [plot.named.key for plot in plots for _ in plot.s]
    return Table(
        stem="nyquist-data",
        title="The loop function on the contour",
        caption="",
        is_data=True,
        columns=(
            Column(key="law", title="law", values=law, cells=()),
            data_column("re_s", "Re s", "1/s", s.real),
            data_column("im_s", "Im s", "rad/s", s.imag),
            data_column("re_L", "Re L", "", L.real),
            data_column("im_L", "Im L", "", L.imag),
        ),
    )
