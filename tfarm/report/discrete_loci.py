"""Where the poles of the sampled loop go as a gain grows, and the strips of the s-plane that the samples fold on one.

Left the s-plane: a mode above half the sample rate (in a shaded strip) is seen, and moved, at its mirror image in the
lowest strip, s = ln(z)/T; the locus is that of K1 alone.  Right the z-plane.  Branches are followed by
`dsp.law.root_locus`; each is named after the mode that it comes from at zero gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from tfarm.columns import Column, Table
from tfarm.digits import plain
from tfarm.dsp.law import origins, root_locus
from tfarm.dsp.loop import SampledLoop
from tfarm.plots.style import BLUE, GREY, INK, ORANGE, blank, headline, style
from tfarm.records import record

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

VALUES = 91  # of a gain along its locus
DECADES = 3  # of K1
STRIPS = 2.0  # how many strips are shown at least
ALIASED = "#eef0f3"
NEAR_AXIS = 0.01  # 1/s: the real axis is linear up to here, logarithmic beyond
TICKS = (-100.0, -10.0, -1.0, -0.1, 0.0, 0.1, 1.0)
STRONGER = 10.0  # how many times its own K1 the locus of K1 alone goes
RIM = 1.12  # radius up to which the z-plane is shown


@dataclass(frozen=True)
@record
class Locus:
    """One gain's locus: `z` (values, branches), and the flexible mode of each branch (0: hub, filter or delay)."""

    gain: str
    values: Real
    z: Complex
    mode: NDArray[np.int64]


@dataclass(frozen=True)
@record
class Loci:
    """Loci of K1 alone (K2 = 0), and of both gains through those of the loop; `poles` [1/s] are the arm's own,
    one a flexible mode, `mode` their numbers.
    """

    loop: SampledLoop
    alone: Locus
    by_K1: Locus
    by_K2: Locus
    poles: Complex
    mode: NDArray[np.int64]

    @property
    def half_rate(self) -> float:
        """1/(2T) [Hz]: what lies above is aliased."""
        return 0.5 / self.loop.chain.sampling.period

    def is_aliased(self, mode: int) -> bool:
        """Whether a flexible mode lies above half the sample rate."""
        at = np.nonzero(self.mode == mode)[0]
        return bool(at.size and self.poles[at[0]].imag > 2 * math.pi * self.half_rate)


def loci(loop: SampledLoop, K1_top: float, K2_range: tuple[float, float]) -> Loci:
    """The loci of K1 from nearly 0 to `K1_top` and of K2 over `K2_range`, the other gain as it is.

    Both begin below the gains of the loop.
    """
    K1 = np.geomspace(min(K1_top / 10**DECADES, loop.gains.K1 / STRONGER), K1_top, VALUES)
    K2 = np.linspace(*K2_range, VALUES)
    upper = np.nonzero((loop.pulse.poles.imag > 0) & (loop.pulse.mode > 0))[0]
    upper = upper[np.argsort(loop.pulse.mode[upper])]
    small = np.geomspace(1e-3, STRONGER, VALUES) * loop.gains.K1
    alone = _locus(loop.having(K2=0.0), "K1", small)
    by_K1, by_K2 = _locus(loop, "K1", K1), _locus(loop, "K2", K2)
    return Loci(loop, alone, by_K1, by_K2, loop.pulse.poles[upper], loop.pulse.mode[upper])


def _locus(loop: SampledLoop, gain: str, values: Real) -> Locus:
    z = root_locus(loop, gain, values)
    first = loop.having(**{gain: float(values[0])})
    origin = origins(first)
    mode = np.where(origin < 0, 0, loop.pulse.mode[origin])
    return Locus(gain, values, z, mode[[abs(first.poles.z - start).argmin() for start in z[0]]])


# ------------------------------------------------------------ the picture


def draw_loci(data: Loci) -> Figure:
    """The folded s-plane, then the z-plane for either gain."""
    with style():
        figure = blank(9.0, 5.4)
        places = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.25])
        folded(data, ax=figure.add_subplot(places[:, 0]))
        upper, lower = figure.add_subplot(places[0, 1]), figure.add_subplot(places[1, 1])
        z_plane(data, data.by_K1, ax=upper)
        z_plane(data, data.by_K2, ax=lower)
        upper.set_xlabel("")
        arm, ms = data.loop.plant.arm.name, plain(1e3 * data.loop.chain.sampling.period)
        headline(figure, f"{arm}: poles of the loop sampled every {ms} ms")
    return figure


def folded(data: Loci, *, ax: Axes) -> None:
    """The s-plane up to the first aliased mode: strips, the arm's poles, their images, and the locus of K1 alone."""
    half = data.half_rate
    hertz = data.poles.imag / (2 * math.pi)
    above = hertz[hertz > half]
    top = STRIPS * half if not above.size else max(STRIPS * half, 1.12 * float(above.min()))
    shown = hertz < top
    ax.set_xscale("symlog", linthresh=NEAR_AXIS, linscale=0.6)
    ax.axhspan(half, top, color=ALIASED, zorder=0)
    for k in range(2, math.ceil(top / half)):
        ax.axhline(k * half, color="white", lw=1.2, zorder=0.5)
    place = ax.get_yaxis_transform()
    ax.text(0.97, half + 0.015 * top, "aliased strips", fontsize=8.5, color=GREY, ha="right", transform=place)
    ends = [*data.poles[shown].real, *_branches(data, data.mode[shown], ax)]
    for pole, mode, f in zip(data.poles[shown], data.mode[shown], hertz[shown], strict=True):
        image, colour = abs(f - 2 * half * round(f / (2 * half))), _colour(data, int(mode))
        if f > half:
            ax.annotate(
                "", (pole.real, image), (pole.real, f), zorder=3,
                arrowprops={"arrowstyle": "->", "color": colour, "lw": 0.9, "linestyle": (0, (4, 3))},
            )  # fmt: skip
        ax.plot(pole.real, f, "o", mfc="white", mec=colour, mew=1.3, ms=6, zorder=5)
        below = (7, 4 if f > half else -12)
        ax.annotate(f"mode {mode}", (pole.real, f), xytext=below, textcoords="offset points", fontsize=8.5)
    ax.axvline(0.0, color=INK, lw=0.9)
    ax.set_xlim(3.0 * min(*ends, -1.0), 3.0 * max(*ends, 0.1))
    ax.set_ylim(0.0, top)
    ax.set_xticks([x for x in TICKS if ax.get_xlim()[0] < x < ax.get_xlim()[1]])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    ax.set_xlabel("real part  [1/s]: decays | grows")
    ax.set_ylabel("frequency  [Hz]")
    ax.grid(False)
    ax.set_title(f"s = ln(z)/T, K1 alone, up to {plain(data.alone.values[-1], 3)}", fontsize=9.5)


def _branches(data: Loci, modes: NDArray[np.int64], ax: Axes) -> list[float]:
    """The locus of K1 alone of these modes in the lowest strip; real parts of what was drawn."""
    ends: list[float] = []
    for branch in np.nonzero(np.isin(data.alone.mode, modes))[0]:
        z = data.alone.z[:, branch]
        if z[0].imag < 0:
            continue
        oscillating = z[z.imag > 1e-9]
        s = np.log(oscillating) / data.loop.chain.sampling.period
        colour = _colour(data, int(data.alone.mode[branch]))
        ax.plot(s.real, s.imag / (2 * math.pi), color=colour, lw=1.6, zorder=4)
        ax.plot(s[-1].real, s[-1].imag / (2 * math.pi), "o", color=colour, ms=4.5, zorder=5)
        ends += [float(s.real.min()), float(s.real.max())]
    return ends


def z_plane(data: Loci, locus: Locus, *, ax: Axes) -> None:
    """The upper half of the z-plane with one gain's locus; open circles at its start, dots at the loop's gains."""
    angle = np.linspace(0.0, math.pi, 181)
    ax.fill_between(RIM * 1.2 * np.cos(angle), 0, RIM * 1.2 * np.sin(angle), color="#f7e9de", zorder=0)
    ax.fill_between(np.cos(angle), 0, np.sin(angle), color="white", zorder=0.2)
    ax.plot(np.cos(angle), np.sin(angle), color=INK, lw=0.9, zorder=1)
    own = data.loop.gains.K1 if locus.gain == "K1" else data.loop.gains.K2
    here = int(abs(locus.values - own).argmin())
    for branch in np.argsort(locus.mode):
        z, mode = locus.z[:, branch], int(locus.mode[branch])
        visible = np.where((z.imag >= -1e-12) & (abs(z) < RIM * 1.2), z, np.nan)
        if not np.isfinite(visible).any():
            continue
        colour = _colour(data, mode) if mode else GREY
        ax.plot(visible.real, visible.imag, color=colour, lw=1.4, zorder=3)
        if np.isfinite(visible[0]):
            ax.plot(z[0].real, z[0].imag, "o", mfc="white", mec=colour, mew=1.1, ms=4.5, zorder=4)
        if np.isfinite(visible[here]):
            ax.plot(z[here].real, z[here].imag, "o", color=colour, ms=4.5, zorder=5)
    ax.set_xlim(-RIM, RIM)
    ax.set_ylim(0.0, RIM)
    ax.set_aspect("equal")
    ax.grid(False)
    span = f"{plain(locus.values[0], 2)} to {plain(locus.values[-1], 3)}"
    other = f"K2 = {plain(data.loop.gains.K2)}" if locus.gain == "K1" else f"K1 = {plain(data.loop.gains.K1)}"
    ax.set_title(f"z-plane, {locus.gain} from {span} ({other})", fontsize=9.5)
    ax.set_xlabel("Re z")
    ax.set_ylabel("Im z")


def _colour(data: Loci, mode: int) -> str:
    return ORANGE if data.is_aliased(mode) else BLUE


def loci_table(data: Loci, stem: str) -> Table:
    """Every pole of the three loci with Im z >= 0: a row a gain and a branch."""
    keys: dict[str, list[float | int | str]] = {"locus": [], "K1": [], "K2": [], "mode": []}
    points = []
    for name, locus, held in (
        ("K1 alone", data.alone, 0.0),
        ("K1", data.by_K1, data.loop.gains.K2),
        ("K2", data.by_K2, data.loop.gains.K1),
    ):
        for value, row in zip(locus.values.tolist(), locus.z, strict=True):
            K1, K2 = (value, held) if locus.gain == "K1" else (held, value)
            for mode, z in zip(locus.mode.tolist(), row, strict=True):
                if z.imag < 0:
                    continue
                for key, cell in zip(keys, (name, K1, K2, mode), strict=True):
                    keys[key].append(cell)
                points.append(z)
    z_all = np.array(points)
    columns = [Column(key, key, of=cells) for key, cells in keys.items()]
    columns += [Column("real", "Re z", of=z_all.real), Column("imaginary", "Im z", of=z_all.imag)]
    return Table(stem=stem, title="Poles of the sampled loop", is_data=True, columns=tuple(columns))
