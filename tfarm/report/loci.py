"""Root loci drawn: exact branches, those of python-control on a reduced model, and where they cross the axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

import tfarm
from tfarm.arm import Arm, HubFeedback
from tfarm.columns import Column, Table
from tfarm.digits import held, plain, scientific, significant, singly
from tfarm.errors import ConvergenceError
from tfarm.loop.answers import UNITS
from tfarm.loop.locus import Locus, locus
from tfarm.loop.reduced_locus import ReducedLocus, reduced_locus
from tfarm.plots.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, blank, headline, style
from tfarm.records import record

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

POINTS = 300
TRIES = ((7, 1.0), (4, 1.0), (4, 0.75), (2, 0.5))  # branches, and the share of the range that they are followed over
ZOOMED = 4  # modes drawn on their own
COLORS = (INK, BLUE, GREEN, PURPLE, "#7a5a00", GREY)  # by mode
ROOM = 0.12  # around a branch, as a share of its extent
MARKED = 5  # gains marked along each branch
HELD = 10  # digits of |s| that are drawn and written: poles differ from processor to processor by 1e-14 at most
GAPS_HELD = 5  # digits of a gap, 1e-5 of |s| or less between two such poles


@dataclass(frozen=True)
@record
class Loci:
    """The exact locus, the reduced one beside it, the gains marked on both, and the gain that was to be reached."""

    exact: Locus
    reduced: ReducedLocus
    marked: Real
    wanted: float

    @property
    def is_cut(self) -> bool:
        """Whether the branches could not be followed to the end of the range."""
        return float(self.exact.gain[-1]) != self.wanted

    @property
    def first(self) -> float:
        """The first natural frequency [rad/s], of which a gap is a share where |s| is less."""
        return float(tfarm.modes(self.exact.arm, count=1).natural_frequency[-1])

    @property
    def name(self) -> str:
        """What varies."""
        return self.exact.vary

    @property
    def unit(self) -> str:
        """Of what varies."""
        return UNITS[self.exact.vary]


def shown(branches: Complex) -> Complex:
    """Branches to the digits that hold on every processor: as shares of |s|, so that a small Re s keeps its place."""
    size = np.maximum(abs(branches), np.finfo(float).tiny)
    unit = 10.0 ** (np.floor(np.log10(size)) + 1 - HELD)
    return np.round(branches.real / unit) * unit + 1j * (np.round(branches.imag / unit) * unit)


def loci(arm: Arm, law: HubFeedback, vary: str, start: float, stop: float) -> Loci:
    """Both loci of one gain: fewer branches, or less of the range, where more cannot be followed.

    Raises ConvergenceError where none can, and what `reduced_locus` raises.
    """
    lost: ConvergenceError | None = None
    for branches, share in TRIES:
        end = start + share * (stop - start)
        try:
            exact = locus(arm, law, vary, start, end, POINTS, branches)
        except ConvergenceError as error:
            lost = error
            continue
        return Loci(exact, reduced_locus(exact), np.linspace(start, end, MARKED), stop)
    assert lost is not None
    raise lost


def zoomed(data: Loci) -> list[int]:
    """The branches drawn on their own: the first that swings of each mode."""
    imag, mode = data.exact.branches.imag, data.exact.mode
    first = {int(mode[n]): n for n in reversed(range(mode.size)) if imag[n].max() > 0}
    return [first[number] for number in sorted(first)][:ZOOMED]


def color_of(data: Loci, branch: int) -> str:
    """One colour a mode."""
    return COLORS[int(data.exact.mode[branch]) % len(COLORS)]


def draw_loci(data: Loci) -> Figure:
    """All branches in one panel, and each mode enlarged beside it."""
    exact = data.exact
    with style():
        figure = blank(9.0, 5.6)
        grid = figure.add_gridspec(2, 4, width_ratios=[1.7, 1.7, 1.3, 1.3])
        whole = figure.add_subplot(grid[:, :2])
        numbers = range(len(exact.branches))
        _panel(data, numbers, whole, named=sorted(set(numbers) - set(zoomed(data))))
        _frame(shown(exact.branches), whole)
        whole.set_title("all of them", fontsize=9.0)
        whole.set_xlabel("Re s [1/s]")
        whole.set_ylabel("Im s [rad/s]")
        for place, n in enumerate(zoomed(data)):
            ax = figure.add_subplot(grid[place // 2, 2 + place % 2])
            _panel(data, [n], ax, named=[n])
            ax.xaxis.set_major_locator(MaxNLocator(3))
            branch = shown(exact.branches[n])
            upper = branch[branch.imag >= 0]
            _frame(upper, ax)
            ax.set_title(
                f"mode {exact.mode[n]}" if exact.mode[n] else "rigid body", fontsize=9.0, color=color_of(data, n)
            )
            ax.tick_params(labelsize=7.5)
        figure.legend(*_legend(data), loc="outside lower left", ncols=5, fontsize=8.2, columnspacing=1.2)
        headline(figure, f"{exact.arm.name}: closed-loop poles as {_range(data)}")
    return figure


def _range(data: Loci) -> str:
    gain, law = data.exact.gain, data.exact.law
    other = f"K2 = {plain(law.K2, 4)}" if data.name == "K1" else f"K1 = {plain(law.K1, 4)}"
    return f"{data.name} goes from {plain(float(gain[0]), 4)} to {plain(float(gain[-1]), 4)}, {other} held"


def _panel(data: Loci, numbers: Sequence[int], ax: Axes, named: Sequence[int]) -> None:
    """Some branches, exact and reduced, with their crossings; gain and frequency beside those of the named ones."""
    exact, reduced = shown(data.exact.branches), shown(data.reduced.branches)
    ax.axvline(0, color=INK, lw=0.9, zorder=1)
    gain = data.exact.gain
    at = [int(np.argmin(abs(gain - value))) for value in data.marked]
    for n in numbers:
        color = color_of(data, n)
        ax.plot(exact[n].real, exact[n].imag, color=color, lw=2.6, alpha=0.4, zorder=2, solid_capstyle="round")
        _band(reduced[n], held(data.reduced.gap, GAPS_HELD)[n] * np.maximum(abs(exact[n]), data.first), color, ax)
        ax.plot(reduced[n].real, reduced[n].imag, color=color, lw=0.9, ls=(0, (2, 1.5)), zorder=3)
        ax.plot(exact[n, 0].real, exact[n, 0].imag, "x", color=color, ms=6, mew=1.4, zorder=4)
        ax.plot(exact[n, at[1:]].real, exact[n, at[1:]].imag, "o", color=color, ms=3.2, zorder=4)
    for each in data.exact.crossings:
        if each.branch in numbers:
            omega = held([each.omega], HELD)[0]
            ax.plot([0], [omega], "D", ms=6, mfc=ORANGE, mec="white", mew=0.8, zorder=6)
            if each.branch not in named:
                continue
            text = f"{data.name} = {plain(each.gain, 5)}\n{significant(each.omega, 4)} rad/s"
            ax.annotate(
                text, (0, omega), textcoords="offset points", xytext=(7, 0), fontsize=7.5, va="center", zorder=6,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8},
            )  # fmt: skip


def _band(curve: Complex, width: Real, color: str, ax: Axes) -> None:
    """The strip around a reduced branch that its printed gap allows."""
    along = np.gradient(curve)
    normal = 1j * along / np.where(along == 0, 1, abs(along))
    edge = np.r_[curve + width * normal, (curve - width * normal)[::-1]]
    ax.fill(edge.real, edge.imag, facecolor=color, alpha=0.15, lw=0, zorder=1.5)


def _frame(points: Complex, ax: Axes) -> None:
    """Limits with all of the branch, the axis and some room: nothing is cut off."""
    real, imag = points.real, points.imag
    left, right = min(float(real.min()), 0.0), max(float(real.max()), 0.0)
    low, high = float(imag.min()), float(imag.max())
    wide, tall = max(right - left, 1e-12 * abs(points).max()), max(high - low, 1e-9 * high)
    ax.set_xlim(left - ROOM * wide, right + 2 * ROOM * wide)
    ax.set_ylim(low - ROOM * tall, high + ROOM * tall)


def _legend(data: Loci) -> tuple[list[Line2D], list[str]]:
    values = ", ".join(plain(float(x), 3) for x in data.marked[1:])
    handles = [
        Line2D([], [], color=GREY, lw=2.6, alpha=0.4),
        Line2D([], [], color=GREY, lw=0.9, ls=(0, (2, 1.5))),
        Line2D([], [], color=GREY, ls="none", marker="x"),
        Line2D([], [], color=GREY, ls="none", marker="o", ms=3.2),
    ]
    start = plain(float(data.marked[0]), 3)
    reduced = f"python-control, order {data.reduced.order}"
    labels = ["exact", reduced, f"{data.name} = {start}", f"{data.name} = {values}"]
    if data.exact.crossings:
        handles.append(Line2D([], [], color=ORANGE, ls="none", marker="D"))
        labels.append("crosses the axis")
    return handles, labels


# ------------------------------------------------------------ tables


def crossing_table(data: Loci, stem: str) -> Table:
    """Where the branches cross the imaginary axis."""
    found = list(data.exact.crossings)
    gain, omega = (held([getattr(each, key) for each in found], HELD) for key in ("gain", "omega"))
    return Table(
        stem=stem,
        title=f"Crossings of the imaginary axis along {data.name}",
        caption="Solved for gain and frequency together on the exact characteristic function, to the digits shown.",
        record=found,
        columns=(
            Column(data.name, data.name, data.unit, of=gain, digits=singly(significant, 8)),
            Column("omega_rad_s", "frequency", "rad/s", of=omega, digits=singly(significant, 7)),
            Column("frequency_hz", "", "Hz", of=[w / (2 * math.pi) for w in omega], digits=singly(significant, 7)),
            Column("mode", "mode", of=lambda each: int(data.exact.mode[each.branch])),
            Column("becomes", "becomes", of="direction"),
        ),
    )


def gap_table(data: Loci, stem: str) -> Table:
    """How far each reduced branch is from the exact one."""
    gap, names = held(data.reduced.gap, GAPS_HELD), [f"mode {n}" if n else "rigid body" for n in data.exact.mode]
    return Table(
        stem=stem,
        title=f"How far python-control's locus is from the exact one, along {data.name}",
        caption=f"Largest distance over the whole range, as a share of |s| (or of the first natural frequency, where "
        f"that is more). The reduced model has order {data.reduced.order}; its poles are those of "
        "control.root_locus_map, taken to their last digits by Newton's method.",
        columns=(
            Column("branch", "branch from", of=names),
            Column("gap", "largest gap", "of |s|", of=gap, digits=singly(scientific, 3)),
        ),
    )


def loci_data(data: Loci, stem: str) -> Table:
    """The exact and the reduced branches."""
    columns = [Column(data.name, data.name, data.unit, of=data.exact.gain)]
    for kind, branches in (("exact", data.exact.branches), ("reduced", data.reduced.branches)):
        for n, row in enumerate(shown(branches)):
            columns.append(Column(f"{kind}_{n}_re", f"{kind} branch {n}, Re s", "1/s", of=row.real))
            columns.append(Column(f"{kind}_{n}_im", f"{kind} branch {n}, Im s", "rad/s", of=row.imag))
    return Table(stem=stem, title=f"Loci along {data.name}", is_data=True, columns=tuple(columns))
