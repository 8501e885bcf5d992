"""Root loci: exact branches, those of python-control on a reduced model, and where they cross the axis."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from tfarm.arrays import Complex
from tfarm.digits import kept_digits, plain, significant
from tfarm.errors import one_line
from tfarm.loop.loci import POLE_DIGITS, Loci, ReducedLocus, held_branches
from tfarm.loop.locus import BranchCrossing, Locus, frame, origin_name, rounded, view
from tfarm.loop.sampled_modes import DRAWN_RADIUS, RIM, SampledLoci, SampledLocus
from tfarm.response.frequency import AXIS_SHARE

from .style import (
    FAINT,
    FIGURES,
    GREY,
    HALF_WIDTH,
    INK,
    MARGINAL,
    REGIONS,
    STABLE,
    UNSTABLE,
    Axes,
    arrows,
    gains_words,
    note,
    picture,
)

ROOM_AROUND = 0.12  # around a branch, as a share of its extent
THIN: dict[str, Any] = {"lw": 0.9, "ls": (0, (2, 1.5)), "zorder": 3}  # of the reduced model
GRID: dict[str, Any] = {"color": FAINT, "lw": 0.7, "zorder": 0.6}
VALUE: dict[str, Any] = {"fontsize": 7.0, "color": GREY}
RATIOS = (*(m * 10.0**k for k in range(-6, 0) for m in (1, 2, 5)), 0.8)  # of damping, of which as many as fit
Z_RATIOS, Z_FREQUENCIES = (0.1, 0.3, 0.5, 0.7, 0.9), range(1, 10)  # the latter in tenths of pi/T


def zoomed(exact: Locus) -> list[int]:
    """The branches drawn on their own: the first that swings of each mode."""
    imag, mode = exact.branches.imag, exact.mode
    first = {int(mode[n]): n for n in reversed(range(mode.size)) if (imag[n] > 0).any()}
    return [first[number] for number in sorted(first)][:4]


@picture(
    size=(9.0, 5.8), title=lambda data: _title(data.exact),
    grid=lambda figure, data: figure.subplot_mosaic(
        # gaps beyond the last; on a phone the first alone
        "AABC;AADE".translate(
            dict.fromkeys(b"BCDE"[min(len(zoomed(data.exact)), 4 if figure.get_figwidth() > HALF_WIDTH else 1) :], ".")
        ),
        width_ratios=[1.7, 1.7, 1.3, 1.3],
    ),
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
    ax.set(
        xlim=(left - wide, right + 2 * wide), ylim=(low - tall, high + tall),
        xlabel="Re s [1/s]", ylabel="Im s [rad/s]",
    )  # fmt: skip
    ax.xaxis.set_major_locator(MaxNLocator(4))
    s_grid(ax, is_named=everything)
    _draw_branches(shown, ax)
    if reduced is not None:
        ax.plot([], [], color=INK, label=f"python-control, reduced model of order {reduced.order}", **THIN)
        for r in held_branches(reduced.branches[list(numbers)]):
            meets = np.flatnonzero(np.diff((r.imag == 0).astype(int))) + 1  # between two values: no corner is cut off
            ax.plot(*(np.insert(part, meets, np.nan) for part in (r.real, r.imag)), color=INK, **THIN)
    way, last = int(np.sign(gain[-1] - gain[0])), float(gain[-1])
    is_factor = not exact.varied.is_of_arm and exact.vary != "delay"
    begins = 0.0 if is_factor and min(gain[0], last) <= 0 <= max(gain[0], last) else float(gain[0])
    values = [float(f"{value:.3g}") for value in np.linspace(begins, last, 5)]
    first, *others = (plain(value, 3) for value in values)
    held = held_branches(exact.branches[list(numbers)])
    at = np.array([np.interp(way * np.array(values), way * gain, s) for s in held])
    marks: Any = ("x" if begins == 0 else "o", 6, "white", first), ("o", 3.2, INK, ", ".join(others))
    for own, (mark, size, face, name) in zip((at[:, 0], at[:, 1:].ravel()), marks, strict=True):
        looks: Any = {"ls": "none", "marker": mark, "ms": size, "mfc": face, "label": f"{exact.vary} = {name}"}
        ax.plot(own.real, own.imag, color=INK, mew=1.3, zorder=4, **looks)
    for s in shown:
        arrows(s[::way], ax)
    edge_marks(shown[:, -1], ax)
    for origin in dict.fromkeys(exact.origin.tolist()) if everything else ():
        _name_branch(origin_name(origin), branches[exact.origin == origin].ravel(), ax)
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


def edge_marks(poles: Complex, ax: Axes) -> None:
    """A triangle at the edge for each pole out of view with Im >= 0, with its value where there is room."""
    (left, right), (_, high) = ax.get_xlim(), ax.get_ylim()
    far: dict[tuple[float, float], list[str]] = {}
    for p in poles[(poles.imag >= 0) & ((poles.real < left) | (poles.real > right) | (poles.imag > high))]:
        value = plain(p.real, 3) + (f" + {plain(p.imag, 3)}i" if p.imag else "")
        far.setdefault((min(max(p.real, left), right), min(p.imag, high)), []).append(value)
    for (x, y), values in far.items():
        mark, side, ha = ("<", 7, "left") if x == left else (">", -7, "right") if x == right else ("^", 7, "left")
        ax.plot(x, y, mark, color=GREY, ms=6.5, mec="white", zorder=5, clip_on=False)
        note(", ".join(values), (x, y), ax, **VALUE, xytext=(side, 4), ha=ha, va="baseline")


def _name_branch(name: str, s: Complex, ax: Axes) -> None:
    """The name at the first of a few places along a branch, in view and with Im s >= 0, that is free."""
    s = s[(s.imag >= 0) & (s.real > ax.get_xlim()[0]) & (s.real < ax.get_xlim()[1]) & (s.imag < ax.get_ylim()[1])]
    few = s[[int(share * s.size) for share in (0.0, 0.5, 0.99)]] if s.size else s
    any(note(name, (at.real, at.imag), ax, (0.15, 0.06), xytext=(6, 5), va="baseline") for at in few)


# ------------------------------------------------------------ grids of damping ratio and natural frequency


def s_grid(ax: Axes, *, is_named: bool = True) -> None:
    """Faint lines of constant damping ratio, with their values, and of constant natural frequency, left of the axis.

    Of as many ratios as fit the view; the frequencies, those of the ticks, have their values at the right where they
    are named.
    """
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    bottom = max(low, 0.0)
    apart = 0.17 if is_named else 0.34  # of a side, from one ratio to the next
    ax.grid(False)
    for ratio in RATIOS if left < 0 < high else ():
        slope = ratio / np.sqrt(1 - ratio**2)
        x, y = max(left, -high * slope), min(high, -left / slope)
        looks = VALUE | {"xytext": (3, -3), "va": "top" if x > left else "center"}
        is_apart = (high - y) / (high - bottom) - x / (right - left) > apart and y > bottom + 0.1 * (high - bottom)
        if is_apart and note(f"ζ {plain(ratio)}", (x, y), ax, (apart, apart), **looks):
            ax.plot([0.0, x], [0.0, y], **GRID)
    for omega in MaxNLocator(6).tick_values(bottom, high) if left < 0 else ():
        if bottom < omega < high:
            angle = np.linspace(0.0, np.arcsin(min(1.0, -left / omega)), 61)
            name = plain(omega, 4) if is_named else ""
            _grid_line(1j * omega * np.exp(1j * angle), name, (right, omega), ax, xytext=(3, 0))
    ax.plot([], [], **GRID, label="damping ratio ζ; natural frequency, at the right [rad/s]")


def z_grid(ax: Axes) -> None:
    """The same at the samples, z = exp(s T): spirals of constant damping ratio, and frequencies in parts of π/T."""
    angle = np.linspace(0.0, np.pi, 181)
    for ratio in Z_RATIOS:
        z = np.exp((1j - ratio / np.sqrt(1 - ratio**2)) * angle)
        _grid_line(z, f"ζ {ratio}" if ratio < 0.8 else "", (z[90].real, z[90].imag), ax, ha="center")
    for tenths in Z_FREQUENCIES:
        z = np.exp(np.pi * tenths / 10 * np.exp(1j * (np.pi - angle / 2)))  # from the real axis of s to the other
        name = "" if tenths % 2 else f"0.{tenths}π/T"
        _grid_line(z, name, (0.9 * z[-1].real, 0.9 * z[-1].imag), ax, ha="center")
    ax.plot([], [], **GRID, label="damping ratio ζ; natural frequency in π/T")


def _grid_line(z: Complex, name: str, at: tuple[float, float], ax: Axes, **looks: Any) -> None:
    ax.plot(z.real, z.imag, **GRID)
    note(name, at, ax, **VALUE, **looks)


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


@picture(
    size=(9.0, 3.6), grid=lambda figure, _: figure.subplots(1, 2),
    title=lambda data: f"{data.loop.plant.arm.name}: poles of the loop sampled every "
                       f"{plain(1e3 * data.loop.chain.sampling.period)} ms",
)  # fmt: skip
def draw_sampled_loci(data: SampledLoci, *, ax: Sequence[Axes]) -> None:
    """The z-plane with the locus along each gain."""
    for along, one in zip(data.by.values(), ax, strict=True):
        _z_plane(data, along, one)


def _z_plane(data: SampledLoci, along: SampledLocus, ax: Axes) -> None:
    """The upper half of the z-plane with one gain's locus; open marks at its start, full ones at the loop's gains."""
    ax.set(
        xlim=(-RIM, RIM), xticks=[-1.0, -0.5, 0.0, 0.5, 1.0], ylim=(0.0, RIM), aspect="equal",
        xlabel="Re z [−]", ylabel="Im z [−]", facecolor=REGIONS[1],
    )  # fmt: skip
    circle = ax.add_patch(Circle((0, 0), 1.0, fc="white", ec=INK, lw=0.9, zorder=0.5))
    ax.grid(False)
    z_grid(ax)
    here = int(abs(along.values - data.loop.number(along.gain)).argmin())
    z = np.where((along.z.imag >= -1e-12) & (abs(along.z) < DRAWN_RADIUS), along.z, np.nan)
    is_aliased = np.array([bool(mode) and data.is_aliased(int(mode)) for mode in along.mode])
    for columns, mark, label in (
        (along.mode == 0, "D", "hub, filters, delay"),
        (is_aliased, "s", "mode beyond the Nyquist frequency"),
        ((along.mode > 0) & ~is_aliased, "o", "mode"),
    ):
        each = z[:, columns]
        ax.plot(each.real, each.imag, color=UNSTABLE, lw=1.5, zorder=3)
        for line in ax.plot(each.real, each.imag, color=STABLE, lw=1.4, zorder=3.1):
            line.set_clip_path(circle)
        for at, face, words in ((0, "white", "start of the range"), (here, INK, f"{label}, gains of the loop")):
            looks: Any = {"mfc": face, "mec": INK, "ms": 4.0, "mew": 0.9, "zorder": 4, "label": words}
            ax.plot(each[at].real, each[at].imag, mark, **looks)
        for branch in each.T:
            arrows(branch, ax)
    edge_marks(along.z[here], ax)
    for colour, name in ((STABLE, "stable"), (UNSTABLE, "unstable")):
        ax.plot([], [], color=colour, label=name)
    span = f"{plain(along.values[0], 2)} to {plain(along.values[-1], 3)}"
    held = gains_words(data.loop.gains, 10, but=along.gain)
    ax.set_title(f"z-plane, {along.gain} from {span} ({held})", fontsize=9.5)
