"""Root loci: exact branches, those of python-control on a reduced model, and where they cross the axis."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from tfarm.digits import kept_digits, plain, significant
from tfarm.dsp.modes import DRAWN_RADIUS, RIM, SampledLoci, SampledLocus
from tfarm.errors import one_line
from tfarm.loop.loci import POLE_DIGITS, Loci, ReducedLocus, held_branches
from tfarm.loop.locus import CONTROLLER, OTHER, Locus, frame, origin_name, rounded

from .style import BLUE, FIGURES, GREEN, GREY, INK, ORANGE, PURPLE, gains_words, picture

MODE_COLOURS = (INK, BLUE, GREEN, PURPLE, "#7a5a00", "#d81b60", "#1a9ec0", "#6d9b1f")  # one a mode, none twice
OTHER_COLOURS = {CONTROLLER: "#5b7083", OTHER: "#c48a9a"}
ROOM_AROUND = 0.12  # around a branch, as a share of its extent
CROSS_AT_ZERO: dict[str, Any] = {"ls": "none", "marker": "x", "ms": 6, "mew": 1.4}  # without the varying feedback
CIRCLE_AT_FIRST: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 6, "mfc": "white", "mew": 1.2}  # at the start
DOT: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 3.2}
THIN: dict[str, Any] = {"lw": 0.9, "ls": (0, (2, 1.5)), "zorder": 3}  # of the reduced model


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
        one.set_title(_mode_looks(exact, n)["label"], fontsize=9.0)
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


def _mode_looks(exact: Locus, branch: int) -> dict[str, Any]:
    """Colour and name of a branch: of the mode that it starts from, or of none."""
    origin = int(exact.origin[branch])
    if origin in OTHER_COLOURS:
        return {"color": OTHER_COLOURS[origin], "label": origin_name(origin)}
    if origin >= len(MODE_COLOURS):
        return {"color": "#9a9a9a", "label": f"modes {len(MODE_COLOURS)} and higher"}
    return {"color": MODE_COLOURS[origin], "label": origin_name(origin)}


def _panel(fine: Locus, exact: Locus, reduced: ReducedLocus | None, numbers: Sequence[int], ax: Axes) -> None:
    """Some branches, exact and reduced, with marks at a few values and their crossings.

    `fine` is `exact` with the values between that a round line takes.
    """
    branches, gain, last = held_branches(fine.branches), exact.gain, float(exact.gain[-1])
    is_factor = not exact.varied.is_of_arm and exact.vary != "delay"
    begins = 0.0 if is_factor and min(gain[0], last) <= 0 <= max(gain[0], last) else float(gain[0])
    values = [float(f"{value:.3g}") for value in np.linspace(begins, last, 5)]
    first, *others = (plain(value, 3) for value in values)
    way = np.sign(last - gain[0])
    ax.axvline(0, color=INK, lw=0.9, zorder=1)
    mark = CROSS_AT_ZERO if begins == 0 else CIRCLE_AT_FIRST
    for n in numbers:
        s, colour = branches[n], _mode_looks(exact, n)["color"]
        ax.plot(s.real, s.imag, lw=2.6, alpha=0.4, zorder=2, solid_capstyle="round", **_mode_looks(exact, n))
        if reduced is not None:
            r = held_branches(reduced.branches[n])
            meets = np.flatnonzero(np.diff((r.imag == 0).astype(int))) + 1  # between two values: no corner is cut off
            ax.plot(*(np.insert(part, meets, np.nan) for part in (r.real, r.imag)), color=colour, **THIN)
        start, *dots = np.interp(way * np.array(values), way * gain, held_branches(exact.branches[n]))
        ax.plot(start.real, start.imag, color=colour, zorder=4, **mark)
        ax.plot(np.real(dots), np.imag(dots), color=colour, zorder=4, **DOT)
    entries = [(mark, f"{exact.vary} = {first}"), (DOT, f"{exact.vary} = {', '.join(others)}")]
    entries += [] if reduced is None else [(THIN, f"python-control, order {reduced.order}")]
    for which, name in entries:  # of the legend, in no mode's colour
        ax.plot([], [], color=GREY, label=name, **which)
    everything = len(numbers) == len(branches)
    seen = [each for each in exact.crossings if each.branch in numbers or (each.branch is None and everything)]
    for number, each in enumerate(seen):
        label = f"crosses the axis at {exact.vary} = {plain(each.gain, 5)}, {significant(each.omega, 4)} rad/s"
        (omega,) = kept_digits([each.omega], POLE_DIGITS)
        ax.plot([0], [omega], "D", ls="none", ms=6, mfc=ORANGE, mec="white", mew=0.8, zorder=6,
                label=label if number < 6 else "further crossings of the axis")  # fmt: skip
    shown = branches[list(numbers)]
    left, right, low, high = frame(shown if everything else shown[shown.imag >= 0])
    wide, tall = ROOM_AROUND * (right - left), ROOM_AROUND * (high - low)
    ax.set(xlim=(left - wide, right + 2 * wide), ylim=(low - tall, high + tall))
    ax.set(xlabel="Re s [1/s]", ylabel="Im s [rad/s]")
    ax.xaxis.set_major_locator(MaxNLocator(4))


@picture((Locus, "tfarm.locus returns"), size=(7.0, 5.8), title=_title)
def locus(exact: Locus, reduced: ReducedLocus | None = None, *, ax: Axes) -> None:
    """Closed-loop poles as one number varies (from `tfarm.locus`), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], a colour a mode, with values between those of `exact` where they bend; a cross
    where the gain is 0, an open circle at another beginning, dots at equal steps from there to the end, and a diamond
    where one crosses the axis.  Thin: those of `reduced` (`tfarm.loop.loci`), which a locus of gains at the hub has.
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
    """The upper half of the z-plane with one gain's locus; open circles at its start, dots at the loop's gains."""
    ax.set_facecolor("#f7e9de")
    ax.add_patch(Circle((0, 0), 1.0, fc="white", ec=INK, lw=0.9, zorder=0.5))
    here = int(abs(along.values - data.loop.number(along.gain)).argmin())
    z = np.where((along.z.imag >= -1e-12) & (abs(along.z) < DRAWN_RADIUS), along.z, np.nan)
    looks: dict[str, Any] = {"mew": 1.1, "ms": 4.5, "zorder": 4}
    is_aliased = np.array([bool(mode) and data.is_aliased(int(mode)) for mode in along.mode])
    for columns, colour, label in (
        (along.mode == 0, GREY, "rigid body"),
        ((along.mode > 0) & ~is_aliased, BLUE, "mode"),
        (is_aliased, ORANGE, "mode beyond the Nyquist frequency"),
    ):
        each = z[:, columns]
        ax.plot(each.real, each.imag, color=colour, lw=1.4, zorder=3, label=label)
        for at, face in ((0, "white"), (here, colour)):
            ax.plot(each[[at]].real, each[[at]].imag, "o", mfc=face, mec=colour, **looks)
    for face, name in (("white", "start"), (GREY, "gains of the loop")):  # in no mode's colour
        ax.plot([], [], "o", mfc=face, mec=GREY, label=name, **looks)
    span = f"{plain(along.values[0], 2)} to {plain(along.values[-1], 3)}"
    held = gains_words(data.loop.gains, 10, but=along.gain)
    ax.set(xlim=(-RIM, RIM), xticks=[-1.0, -0.5, 0.0, 0.5, 1.0], ylim=(0.0, RIM), aspect="equal")
    ax.set(xlabel="Re z [−]", ylabel="Im z [−]")
    ax.grid(False)
    ax.set_title(f"z-plane, {along.gain} from {span} ({held})", fontsize=9.5)
