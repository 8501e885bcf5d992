"""Root loci: exact branches, those of python-control on a reduced model beside them, and where they cross the axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from tfarm.arrays import Complex
from tfarm.digits import kept_digits, plain, significant
from tfarm.dsp.modes import DRAWN_RADIUS, RIM, SampledLoci, SampledLocus
from tfarm.errors import one_line
from tfarm.loop.loci import GAPS_HELD, POLE_DIGITS, Loci, ReducedLocus, held_branches
from tfarm.loop.locus import Locus, frame, rounded
from tfarm.spectrum import modes

from .labels import OFFSETS_BESIDE, Label
from .style import BLUE, FIGURES, GREEN, GREY, INK, ORANGE, PURPLE, Keys, legend_below, page, picture
from .words import gains_words

ZOOMED = 4  # modes drawn on their own
MODE_COLOURS = (INK, BLUE, GREEN, PURPLE, "#7a5a00", GREY)  # by mode
ROOM_AROUND = 0.12  # around a branch, as a share of its extent
CROSS_AT_ZERO: dict[str, Any] = {"ls": "none", "marker": "x", "ms": 6, "mew": 1.4}  # poles without what varies
CIRCLE_AT_FIRST: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 6, "mfc": "white", "mew": 1.2}  # at the start
LONGEST_LAW = 40  # characters of what is said of a law in a title
QUARTERS = (0.25, 0.5, 0.75)  # of the way that the modes go, on average: where a value is marked along each branch


def zoomed(exact: Locus) -> list[int]:
    """The branches drawn on their own: the first that swings of each mode."""
    imag, mode = exact.branches.imag, exact.mode
    first = {int(mode[n]): n for n in reversed(range(mode.size)) if (imag[n] > 0).any()}
    return [first[number] for number in sorted(first)][:ZOOMED]


def color_of(exact: Locus, branch: int) -> str:
    """One colour a mode."""
    return MODE_COLOURS[int(exact.mode[branch]) % len(MODE_COLOURS)]


def draw_loci(data: Loci) -> Figure:
    """All branches in one panel, and each mode enlarged beside it."""
    exact, fine, chosen = data.exact, rounded(data.exact), zoomed(data.exact)
    with page(9.0, 5.6, _title(exact), mosaic="AABC;AADE", width_ratios=[1.7, 1.7, 1.3, 1.3]) as (figure, axes):
        whole, numbers = axes["A"], range(len(exact.branches))
        _panel(fine, exact, data.reduced, numbers, whole, named=sorted(set(numbers) - set(chosen)))
        whole.set_title("all of them", fontsize=9.0)
        whole.xaxis.set_major_locator(MaxNLocator(5))
        whole.set(xlabel="Re s [1/s]", ylabel="Im s [rad/s]")
        for n, ax in zip(chosen, list(axes.values())[1:], strict=False):
            _panel(fine, exact, data.reduced, [n], ax, named=[n])
            ax.xaxis.set_major_locator(MaxNLocator(3))
            name = f"mode {exact.mode[n]}" if exact.mode[n] else "rigid body"
            ax.set_title(name, fontsize=9.0, color=color_of(exact, n))
            ax.tick_params(labelsize=7.5)
        for ax in list(axes.values())[1 + len(chosen) :]:
            ax.remove()
        legend_below(figure, _legend(fine, data.reduced))
    return figure


def _title(exact: Locus, *_: object) -> str:
    first, last = (plain(float(exact.gain[i]), 4) for i in (0, -1))
    law = one_line(gains_words(exact.law, but=exact.vary).partition(", of ")[0], LONGEST_LAW)
    return f"{exact.arm.name}: closed-loop poles as {exact.vary} goes from {first} to {last} with {law}"


def _marked(exact: Locus) -> tuple[float, list[float]]:
    """The value whose poles bear a cross or a circle, the gain 0 where that is on the way; and those that bear dots.

    Dots are where the modes have gone a quarter, a half, three quarters and all of their way on average, at two digits;
    the one of these next to the value that damps the first mode best is at that, at three.
    """
    gain, last = exact.gain, float(exact.gain[-1])
    is_factor = not exact.varied.is_of_arm and exact.vary != "delay"
    begins = 0.0 if is_factor and min(gain[0], last) <= 0 <= max(gain[0], last) else float(gain[0])
    gone = np.zeros(gain.size)
    for row in exact.branches[zoomed(exact)]:
        left, right, low, high = frame(row)
        step = np.nan_to_num(abs(np.diff(row.real / (right - left) + 1j * row.imag / (high - low))))
        gone[1:] += np.cumsum(step) / (step.sum() or 1.0)
    places = [float(f"{value:.2g}") for value in np.interp(QUARTERS, gone / (gone[-1] or 1.0), gain)]
    if (best := _best(exact)) is not None:
        places[int(np.argmin([abs(place - best) for place in places]))] = float(f"{best:.3g}")
    return begins, sorted({*places, last} - {begins}, reverse=bool(last < gain[0]))


def _best(exact: Locus) -> float | None:
    """The value at which the first mode is damped best; None where that is an end, or it no longer swings."""
    rows = exact.branches[exact.mode == 1]
    if not rows.size or np.isnan(rows[0]).any() or not (rows[0].imag > 0).all():
        return None
    at = int(np.argmax(-rows[0].real / abs(rows[0])))
    return float(exact.gain[at]) if 0 < at < exact.gain.size - 1 else None


def _at(exact: Locus, branch: int, values: Sequence[float]) -> Complex:
    """Where a branch is at these values, on the line that is drawn."""
    way = 1.0 if exact.gain[-1] > exact.gain[0] else -1.0
    return np.asarray(np.interp(way * np.asarray(values), way * exact.gain, held_branches(exact.branches[branch])))


def _panel(
    fine: Locus, exact: Locus, reduced: ReducedLocus | None, numbers: Sequence[int], ax: Axes,
    named: Sequence[int | None],
) -> None:  # fmt: skip
    """Some branches, exact and reduced, with their crossings; gain and frequency beside those of the named ones.

    `fine` is `exact` with the values between that a round line takes, `reduced` stands beside `exact`.  None names
    crossings that lie on no branch that is drawn.
    """
    branches, (begins, others) = held_branches(fine.branches), _marked(fine)
    ax.axvline(0, color=INK, lw=0.9, zorder=1)
    for n in numbers:
        color, s = color_of(fine, n), branches[n]
        ax.plot(s.real, s.imag, color=color, lw=2.6, alpha=0.4, zorder=2, solid_capstyle="round")
        if reduced is not None:
            _reduced_branch(exact, reduced, n, color, ax)
        (start,), dots = _at(fine, n, [begins]), _at(fine, n, others)
        ax.plot(start.real, start.imag, color=color, zorder=4, **(CROSS_AT_ZERO if begins == 0 else CIRCLE_AT_FIRST))
        ax.plot(dots.real, dots.imag, "o", color=color, ms=3.2, zorder=4)
    everything = len(numbers) == len(branches)
    for each in exact.crossings:
        if each.branch in numbers or (each.branch is None and everything):
            omega = kept_digits([each.omega], POLE_DIGITS)[0]
            ax.plot([0], [omega], "D", ms=6, mfc=ORANGE, mec="white", mew=0.8, zorder=6)
            if each.branch not in named:
                continue
            text = f"{exact.vary} = {plain(each.gain, 5)}\n{significant(each.omega, 4)} rad/s"
            ax.add_artist(Label(text, [(0, omega)], OFFSETS_BESIDE, fontsize=7.5))
    shown = branches[list(numbers)]
    left, right, low, high = frame(shown if everything else shown[shown.imag >= 0])
    ax.set_xlim(left - ROOM_AROUND * (right - left), right + 2 * ROOM_AROUND * (right - left))
    ax.set_ylim(low - ROOM_AROUND * (high - low), high + ROOM_AROUND * (high - low))


def _reduced_branch(exact: Locus, reduced: ReducedLocus, n: int, color: str, ax: Axes) -> None:
    """A branch of the reduced model, and the strip around it that its printed gap allows."""
    lives = ~np.isnan(reduced.branches[n])
    if lives.sum() < 2:
        return
    curve, first = held_branches(reduced.branches[n][lives]), float(modes(exact.arm, 1).natural_frequency[-1])
    there = abs(exact.gain - reduced.gain[lives, None]).argmin(axis=1)  # the reduced one may have fewer values
    size = abs(held_branches(exact.branches[n, there]))
    width = kept_digits(reduced.gap, GAPS_HELD)[n] * np.maximum(size, first)
    along = np.gradient(curve)
    normal = 1j * along / np.where(along == 0, 1, abs(along))
    edge = np.r_[curve + width * normal, (curve - width * normal)[::-1]]
    ax.fill(edge.real, edge.imag, facecolor=color, alpha=0.15, lw=0, zorder=1.5)
    meets = np.flatnonzero(np.diff((curve.imag == 0).astype(int))) + 1  # between two values: no corner is cut off
    ax.plot(*(np.insert(part, meets, np.nan) for part in (curve.real, curve.imag)), color=color, lw=0.9,
            ls=(0, (2, 1.5)), zorder=3)  # fmt: skip


def _legend(exact: Locus, reduced: ReducedLocus | None) -> Keys:
    begins, others = _marked(exact)
    keys = {"exact": Line2D([], [], color=GREY, lw=2.6, alpha=0.4)}
    if reduced is not None:
        keys[f"python-control, order {reduced.order}"] = Line2D([], [], color=GREY, lw=0.9, ls=(0, (2, 1.5)))
    mark = CROSS_AT_ZERO if begins == 0 else CIRCLE_AT_FIRST
    keys[f"{exact.vary} = {plain(begins, 3)}"] = Line2D([], [], color=GREY, **mark)
    keys[f"{exact.vary} = {', '.join(plain(value, 3) for value in others)}"] = Line2D(
        [], [], color=GREY, ls="none", marker="o", ms=3.2
    )
    if exact.crossings:
        keys["crosses the axis"] = Line2D([], [], color=ORANGE, ls="none", marker="D")
    return list(keys.values()), list(keys)


@picture((Locus, "tfarm.locus returns"), size=(7.0, 5.6), title=_title, keys=True)
def locus(exact: Locus, reduced: ReducedLocus | None = None, *, ax: Axes) -> Keys:
    """Closed-loop poles as one number varies (what `tfarm.locus` returns), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], a colour a mode, with values between those of `exact` where they bend; a cross
    where the gain is 0, an open circle at another beginning, dots at a few values, one of them that which damps the
    first mode best, and a diamond where one crosses the axis.  Thin: those of `reduced` (`tfarm.loop.loci`),
    which a locus of gains at the hub has.
    """
    fine, every = rounded(exact), range(len(exact.branches))
    _panel(fine, exact, reduced, every, ax, named=[*every, None])
    ax.set(xlabel="Re s [1/s]", ylabel="Im s [rad/s]")
    return _legend(fine, reduced)


FIGURES[Loci] = lambda data: locus.figure(data.exact, data.reduced)


def draw_sampled_loci(data: SampledLoci) -> Figure:
    """The z-plane with the locus along each gain."""
    arm, ms = data.loop.plant.arm.name, plain(1e3 * data.loop.chain.sampling.period)
    with page(9.0, 3.4, f"{arm}: poles of the loop sampled every {ms} ms", ncols=2) as (figure, axes):
        for along, ax in zip(data.by.values(), axes, strict=True):
            _z_plane(data, along, ax)
    return figure


def _z_plane(data: SampledLoci, along: SampledLocus, ax: Axes) -> None:
    """The upper half of the z-plane with one gain's locus; open circles at its start, dots at the loop's gains."""
    angle = np.linspace(0.0, math.pi, 181)
    ax.fill_between(DRAWN_RADIUS * np.cos(angle), 0, DRAWN_RADIUS * np.sin(angle), color="#f7e9de", zorder=0)
    ax.fill_between(np.cos(angle), 0, np.sin(angle), color="white", zorder=0.2)
    ax.plot(np.cos(angle), np.sin(angle), color=INK, lw=0.9, zorder=1)
    here = int(abs(along.values - data.loop.number(along.gain)).argmin())
    for branch in np.argsort(along.mode):
        z, mode = along.z[:, branch], int(along.mode[branch])
        visible = np.where((z.imag >= -1e-12) & (abs(z) < DRAWN_RADIUS), z, np.nan)
        if not np.isfinite(visible).any():
            continue
        colour = GREY if not mode else ORANGE if data.is_aliased(mode) else BLUE
        ax.plot(visible.real, visible.imag, color=colour, lw=1.4, zorder=3)
        if np.isfinite(visible[0]):
            ax.plot(z[0].real, z[0].imag, "o", mfc="white", mec=colour, mew=1.1, ms=4.5, zorder=4)
        if np.isfinite(visible[here]):
            ax.plot(z[here].real, z[here].imag, "o", color=colour, ms=4.5, zorder=5)
    span = f"{plain(along.values[0], 2)} to {plain(along.values[-1], 3)}"
    held = gains_words(data.loop.gains, 10, but=along.gain)
    ax.set(xlim=(-RIM, RIM), xticks=[-1.0, -0.5, 0.0, 0.5, 1.0], ylim=(0.0, RIM), aspect="equal")
    ax.set(xlabel="Re z", ylabel="Im z")
    ax.grid(False)
    ax.set_title(f"z-plane, {along.gain} from {span} ({held})", fontsize=9.5)
