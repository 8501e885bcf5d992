"""Root loci: exact branches, those of python-control on a reduced model, and where they cross the axis."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from tfarm.arrays import Complex, Real
from tfarm.digits import kept_digits, plain, significant
from tfarm.dsp.modes import DRAWN_RADIUS, RIM, SampledLoci, SampledLocus
from tfarm.errors import one_line
from tfarm.loop.loci import POLE_DIGITS, Loci, ReducedLocus, held_branches
from tfarm.loop.locus import BranchCrossing, Locus, frame, origin_name, rounded, view
from tfarm.response.frequency import AXIS_SHARE

from .regions import HALO, NUMBER_ROOM, is_free
from .style import FAINT, FIGURES, GREY, INK, MARGINAL, REGIONS, STABLE, UNSTABLE, gains_words, picture

ROOM_AROUND = 0.12  # around a branch, as a share of its extent
CROSS_AT_ZERO: dict[str, Any] = {"ls": "none", "marker": "x", "ms": 6, "mew": 1.4}  # without the varying feedback
CIRCLE_AT_FIRST: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 6, "mfc": "white", "mew": 1.2}  # at the start
DOT: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 3.2}
THIN: dict[str, Any] = {"lw": 0.9, "ls": (0, (2, 1.5)), "zorder": 3}  # of the reduced model
GRID: dict[str, Any] = {"color": FAINT, "lw": 0.7, "zorder": 0.6}
NOTE: dict[str, Any] = {"fontsize": 7.0, "color": GREY, "path_effects": HALO, "textcoords": "offset points"}
RATIOS = (*(m * 10.0**k for k in range(-6, 0) for m in (1, 2, 5)), 0.8)  # of damping, of which as many as fit
Z_RATIOS, Z_FREQUENCIES = (0.1, 0.3, 0.5, 0.7, 0.9), range(1, 10)  # the latter in tenths of pi/T
RATIO_APART = 0.17  # of a side of the picture: between the ends of two lines of constant damping ratio
NAME_ROOM = (0.15, 0.06)  # of the width and the height: around the beginning of a name
ARROW_ROOM, ARROW = 0.05, 0.015  # of a side: a branch that is shorter has no arrow; half the length of one


def zoomed(exact: Locus) -> list[int]:
    """The branches drawn on their own: the first that swings of each mode."""
    imag, mode = exact.branches.imag, exact.mode
    first = {int(mode[n]): n for n in reversed(range(mode.size)) if (imag[n] > 0).any()}
    return [first[number] for number in sorted(first)][:4]


@picture(
    size=(9.0, 5.8), title=lambda data: _title(data.exact),
    grid=lambda figure, _: figure.subplot_mosaic("AABC;AADE", width_ratios=[1.7, 1.7, 1.3, 1.3]),
)  # fmt: skip
def draw_loci(data: Loci, *, ax: Sequence[Axes]) -> None:
    """All branches in one panel, and each mode enlarged in one of its own."""
    exact, fine, chosen = data.exact, rounded(data.exact), zoomed(data.exact)
    whole, *panels = ax
    _panel(fine, exact, data.reduced, range(len(exact.branches)), whole)
    whole.set_title("all branches", fontsize=9.0)
    for n, one in zip(chosen, panels, strict=False):
        _panel(fine, exact, data.reduced, [n], one)
        one.set_title(origin_name(int(exact.origin[n])), fontsize=9.0)
        one.tick_params(labelsize=7.0)
        one.xaxis.label.set_fontsize(8.0)
        one.yaxis.label.set_fontsize(8.0)
    for one in panels[len(chosen) :]:
        one.remove()


def _title(exact: Locus, *_: object) -> str:
    first, last = (plain(float(exact.gain[i]), 4) for i in (0, -1))
    law = one_line(gains_words(exact.law, but=exact.vary).partition(", of ")[0], 40)
    values = f"{exact.vary} goes from {first} to {last} {exact.varied.title[1]}".rstrip()
    return f"{exact.arm.name}: closed-loop poles as {values} with {law}"


def _panel(fine: Locus, exact: Locus, reduced: ReducedLocus | None, numbers: Sequence[int], ax: Axes) -> None:
    """Some branches, exact and reduced, with marks at a few values and their crossings.

    `fine` is `exact` with the values between that a round line takes.
    """
    branches, gain = held_branches(fine.branches), exact.gain
    shown, everything = branches[list(numbers)], len(numbers) == len(branches)
    left, right, low, high = view(shown, exact.origin) if everything else frame(shown[shown.imag >= 0])
    wide, tall = ROOM_AROUND * (right - left), ROOM_AROUND * (high - low)
    ax.set(xlim=(left - wide, right + 2 * wide), ylim=(low - tall, high + tall))
    ax.set(xlabel="Re s [1/s]", ylabel="Im s [rad/s]")
    ax.xaxis.set_major_locator(MaxNLocator(4))
    places = s_grid(ax, is_named=everything)
    _draw_branches(shown, ax)
    for r in () if reduced is None else held_branches(reduced.branches[list(numbers)]):
        meets = np.flatnonzero(np.diff((r.imag == 0).astype(int))) + 1  # between two values: no corner is cut off
        ax.plot(*(np.insert(part, meets, np.nan) for part in (r.real, r.imag)), color=INK, **THIN)
    way, last = int(np.sign(gain[-1] - gain[0])), float(gain[-1])
    is_factor = not exact.varied.is_of_arm and exact.vary != "delay"
    begins = 0.0 if is_factor and min(gain[0], last) <= 0 <= max(gain[0], last) else float(gain[0])
    values = [float(f"{value:.3g}") for value in np.linspace(begins, last, 5)]
    mark = CROSS_AT_ZERO if begins == 0 else CIRCLE_AT_FIRST
    for s in held_branches(exact.branches[list(numbers)]):
        start, *dots = np.interp(way * np.array(values), way * gain, s)
        ax.plot(start.real, start.imag, color=INK, zorder=4, **mark)
        ax.plot(np.real(dots), np.imag(dots), color=INK, zorder=4, **DOT)
    for s in shown:
        arrow(s[::way], ax)
    edge_marks(shown[:, -1], ax, places)
    for origin in dict.fromkeys(exact.origin.tolist()) if everything else ():
        _name_branch(origin_name(origin), branches[exact.origin == origin].ravel(), ax, places)
    first, *others = (plain(value, 3) for value in values)
    entries = [(mark, f"{exact.vary} = {first}"), (DOT, f"{exact.vary} = {', '.join(others)}")]
    entries += [] if reduced is None else [(THIN, f"python-control, reduced model of order {reduced.order}")]
    for which, name in entries:
        ax.plot([], [], color=INK, label=name, **which)
    _draw_crossings([each for each in exact.crossings if each.branch in (*numbers, *[None] * everything)], exact, ax)


def _draw_branches(shown: Complex, ax: Axes) -> None:
    """The branches, their parts left and right of the axis in the colours of stability, and those on it."""
    left, right = ax.get_xlim()
    ax.axvline(0, color=INK, lw=0.9, zorder=1)
    parts = ax.axvspan(left, 0.0, fc="none"), ax.axvspan(0.0, right, fc=REGIONS[1], zorder=0.1)
    for width, colour, part, name in zip((2.6, 2.61), (STABLE, UNSTABLE), parts, ("stable", "unstable"), strict=True):
        for s in shown:
            ax.plot(s.real, s.imag, lw=width, color=colour, zorder=2)[0].set_clip_path(part)
        ax.plot([], [], lw=2.5, color=colour, label=f"{name}, exact")
    resting = np.where(abs(shown.real) <= AXIS_SHARE * abs(shown), shown, np.nan)
    ax.plot(0 * resting.real.T, resting.imag.T, lw=2.8, color=MARGINAL, zorder=2.1)


def _draw_crossings(seen: Sequence[BranchCrossing], exact: Locus, ax: Axes) -> None:
    """A diamond at each, the first few with their values in the legend."""
    for number, each in enumerate(seen):
        label = f"crosses the axis at {exact.vary} = {plain(each.gain, 5)}, {significant(each.omega, 4)} rad/s"
        (omega,) = kept_digits([each.omega], POLE_DIGITS)
        ax.plot([0], [omega], "D", ls="none", ms=6, mfc=MARGINAL, mec="white", mew=0.8, zorder=6,
                label=label if number < 6 else "further crossings of the axis")  # fmt: skip


def arrow(s: Complex, ax: Axes) -> None:
    """An arrow in the middle of a line, in the direction in which it runs, where its part in view is long enough."""
    to_view = ax.transData - ax.transAxes
    at = to_view.transform(np.c_[s.real, s.imag])
    at = at[((at > 0) & (at < 1)).all(axis=1)]
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(at, axis=0).T))]
    if along[-1] > ARROW_ROOM:
        middle = along[-1] / 2 + np.array([-ARROW, ARROW])
        tail, head = to_view.inverted().transform(np.c_[[np.interp(middle, along, part) for part in at.T]].T).tolist()
        looks = {"arrowstyle": "-|>", "color": INK, "lw": 0.0, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 12}
        ax.annotate("", head, tail, arrowprops=looks, zorder=3.5)


def edge_marks(poles: Complex, ax: Axes, places: list[Real]) -> None:
    """A triangle at the edge for each pole out of view with Im >= 0, with its value where there is room."""
    (left, right), (_, high) = ax.get_xlim(), ax.get_ylim()
    far: dict[tuple[float, float], list[str]] = {}
    for p in poles[(poles.imag >= 0) & ((poles.real < left) | (poles.real > right) | (poles.imag > high))]:
        value = plain(p.real, 3) + (f" + {plain(p.imag, 3)}i" if p.imag else "")
        far.setdefault((min(max(p.real, left), right), min(p.imag, high)), []).append(value)
    for (x, y), values in far.items():
        mark, side, ha = ("<", 7, "left") if x == left else (">", -7, "right") if x == right else ("^", 7, "left")
        ax.plot(x, y, mark, color=GREY, ms=6.5, mec="white", zorder=5, clip_on=False)
        _note(", ".join(values), (x, y), places, ax, xytext=(side, 4), ha=ha)


def _name_branch(name: str, s: Complex, ax: Axes, places: list[Real]) -> None:
    """The name at the first of a few places along a branch, in view and with Im s >= 0, that is free."""
    s = s[(s.imag >= 0) & (s.real > ax.get_xlim()[0]) & (s.real < ax.get_xlim()[1]) & (s.imag < ax.get_ylim()[1])]
    few = s[[int(share * s.size) for share in (0.0, 0.5, 0.99)]] if s.size else s
    any(_note(name, (at.real, at.imag), places, ax, NAME_ROOM, xytext=(6, 5), fontsize=8.0, color=INK) for at in few)


def _note(text: str, at: Any, places: list[Real], ax: Axes, room: Any = NUMBER_ROOM, **looks: Any) -> bool:
    """A text at a place that is free of those at the others, which it then joins; whether it is."""
    free = is_free(np.array(at), places, ax, room)
    if free:
        places.append(np.array([at]))
        ax.annotate(text, at, **NOTE | looks)
    return free


# ------------------------------------------------------------ grids of damping ratio and natural frequency


def s_grid(ax: Axes, *, is_named: bool = True) -> list[Real]:
    """Faint lines of constant damping ratio, with their values, and of constant natural frequency, left of the axis.

    Of as many ratios as fit the view; the frequencies, those of the ticks, have their values at the right where they
    are named.  Returns the places of the values in the view.
    """
    (left, right), (low, high), places = ax.get_xlim(), ax.get_ylim(), list[Real]()
    bottom, last, share = max(low, 0.0), 0.0, -left / (right - left)
    apart = RATIO_APART if is_named else 2 * RATIO_APART
    ax.grid(False)
    for ratio in RATIOS if left < 0 < high else ():
        slope = ratio / math.sqrt(1 - ratio**2)
        x, y = max(left, -high * slope), min(high, -left / slope)
        place = share * x / left + (high - y) / (high - bottom)
        if place < last + apart or y < bottom + 0.1 * (high - bottom):
            continue
        last = place
        ax.plot([0.0, x], [0.0, y], **GRID)
        _note(f"ζ {plain(ratio)}", (x, y), places, ax, xytext=(3, -3), va="top" if x > left else "center")
    for omega in MaxNLocator(6).tick_values(bottom, high) if left < 0 else ():
        if bottom < omega < high:
            angle = np.linspace(0.0, math.asin(min(1.0, -left / omega)), 61)
            ax.plot(-omega * np.sin(angle), omega * np.cos(angle), **GRID)
            if is_named:
                ax.annotate(plain(omega, 4), (1.0, omega), xytext=(3, 0), va="center",
                            xycoords=ax.get_yaxis_transform(), **NOTE)  # fmt: skip
    if is_named:
        ax.plot([], [], **GRID, label="damping ratio ζ; natural frequency, at the right [rad/s]")
    return places


def z_grid(ax: Axes) -> None:
    """The same at the samples, z = exp(s T): spirals of constant damping ratio, and frequencies in parts of π/T."""
    for ratio in Z_RATIOS:
        angle = np.linspace(0.0, math.pi, 181)
        z = np.exp((1j - ratio / math.sqrt(1 - ratio**2)) * angle)
        ax.plot(z.real, z.imag, **GRID)
        if ratio < 0.8:
            middle = z[angle.size // 2]
            ax.annotate(f"ζ {ratio}", (middle.real, middle.imag), xytext=(0, 0), ha="center", va="center", **NOTE)
    for tenths in Z_FREQUENCIES:
        angle = np.linspace(0.0, math.pi / 2, 91)  # from the real axis of s to the imaginary one
        z = np.exp(math.pi * tenths / 10 * (1j * np.sin(angle) - np.cos(angle)))
        ax.plot(z.real, z.imag, **GRID)
        if tenths % 2 == 0:
            at = 0.9 * z[-1]
            ax.annotate(f"0.{tenths}π/T", (at.real, at.imag), xytext=(0, 0), ha="center", va="center", **NOTE)
    ax.plot([], [], **GRID, label="damping ratio ζ; natural frequency in π/T")


# ------------------------------------------------------------ the pictures


@picture((Locus, "tfarm.locus returns"), size=(7.0, 5.8), title=_title)
def locus(exact: Locus, reduced: ReducedLocus | None = None, *, ax: Axes) -> None:
    """Closed-loop poles as one number varies (from `tfarm.locus`), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], named after their modes, stable and unstable parts in their colours, with values
    between those of `exact` where they bend; a cross where the gain is 0, an open circle at another beginning, dots at
    equal steps from there to the end, a diamond where one crosses the axis, and arrows in the direction of growing
    values.  The axes are scaled to the modes: a triangle at the edge is a pole beyond, at the last value.  Thin: the
    branches of `reduced` (`tfarm.loop.loci`), which a locus of gains at the hub has.  Faint: lines of constant damping
    ratio and natural frequency.
    """
    _panel(rounded(exact), exact, reduced, range(len(exact.branches)), ax)


FIGURES[Loci] = lambda data: locus.figure(data.exact, data.reduced)


def _z_title(data: SampledLoci) -> str:
    ms = plain(1e3 * data.loop.chain.sampling.period)
    return f"{data.loop.plant.arm.name}: poles of the loop sampled every {ms} ms"


@picture(size=(9.0, 3.6), title=_z_title, grid=lambda figure, _: figure.subplots(1, 2))
def draw_sampled_loci(data: SampledLoci, *, ax: Sequence[Axes]) -> None:
    """The z-plane with the locus along each gain."""
    for along, one in zip(data.by.values(), ax, strict=True):
        _z_plane(data, along, one)


def _z_plane(data: SampledLoci, along: SampledLocus, ax: Axes) -> None:
    """The upper half of the z-plane with one gain's locus; open marks at its start, full ones at the loop's gains."""
    ax.set(xlim=(-RIM, RIM), xticks=[-1.0, -0.5, 0.0, 0.5, 1.0], ylim=(0.0, RIM), aspect="equal")
    ax.set(xlabel="Re z [−]", ylabel="Im z [−]", facecolor=REGIONS[1])
    circle = ax.add_patch(Circle((0, 0), 1.0, fc="white", ec=INK, lw=0.9, zorder=0.5))
    ax.grid(False)
    z_grid(ax)
    here = int(abs(along.values - data.loop.number(along.gain)).argmin())
    z = np.where((along.z.imag >= -1e-12) & (abs(along.z) < DRAWN_RADIUS), along.z, np.nan)
    is_aliased = np.array([bool(mode) and data.is_aliased(int(mode)) for mode in along.mode])
    for columns, mark, label in (
        ((along.mode > 0) & ~is_aliased, "o", "mode"),
        (is_aliased, "s", "mode beyond the Nyquist frequency"),
        (along.mode == 0, "D", "hub, filters, delay"),
    ):
        each = z[:, columns]
        ax.plot(each.real, each.imag, color=UNSTABLE, lw=1.5, zorder=3)
        for line in ax.plot(each.real, each.imag, color=STABLE, lw=1.4, zorder=3.1):
            line.set_clip_path(circle)
        for at, face in ((0, "white"), (here, INK)):
            ax.plot(each[[at]].real, each[[at]].imag, mark, mfc=face, mec=INK, ms=4.0, mew=0.9, zorder=4)
        ax.plot([], [], mark, color=INK, ms=4.0, label=f"{label}, gains of the loop")
        for branch in each.T:
            arrow(branch, ax)
    edge_marks(along.z[here], ax, [])
    for looks, name in (
        ({"color": STABLE}, "stable"), ({"color": UNSTABLE}, "unstable"),
        ({"marker": "o", "ls": "none", "mfc": "white", "mec": INK, "ms": 4.0}, "start of the range"),
    ):  # fmt: skip
        ax.plot([], [], label=name, **looks)
    span = f"{plain(along.values[0], 2)} to {plain(along.values[-1], 3)}"
    held = gains_words(data.loop.gains, 10, but=along.gain)
    ax.set_title(f"z-plane, {along.gain} from {span} ({held})", fontsize=9.5)
