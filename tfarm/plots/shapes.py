"""Pictures of the arm itself, to scale with its numbers, of its modes, and of the error of simpler beam theories."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle
from matplotlib.ticker import MaxNLocator

from tfarm.arm import Arm, Link
from tfarm.arrays import Real
from tfarm.digits import plain, significant, unit
from tfarm.spectrum import Modes

from .style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PURPLE, page, picture, plain_ticks

SHAPE_POINTS = 401  # of a drawn mode: about one to a pixel of its picture
ALONG, DISPLACEMENT = "distance from the hub, x [m]", "displacement w(x), largest = 1 [−]"
HUB_RADIUS = 0.055  # radius of the drawn hub, and half the payload's side, as shares of the length
SEGMENT_COLOURS = ("#cfe0ee", "#e3ecd5")  # colours of neighbours
BESIDE_ARM, HALF_HEIGHT = 0.2, 0.12  # shares of the length left of the hub and right of the tip; above, at least
AROUND_SKETCH = 1.15  # inches above and below it: three lines, and the axis
HUB_WIDTH = 0.06  # width of the drawn hub, as a share of the length


def scaled(found: Modes, count: int) -> dict[int, Real]:
    """w(x) of the first `count` flexible modes by their number, at `SHAPE_POINTS` places even along the arm.

    Each is scaled to a largest displacement of one, the tip's side positive.
    """
    x = np.linspace(0.0, found.arm.length, SHAPE_POINTS)
    rows = zip(found.index.tolist(), found.shape(x), strict=True)
    return {number: w / (float(abs(w).max()) or 1.0) for number, w in rows if 0 < number <= count}


def _rows(found: Modes) -> int:
    return math.ceil((found.index > 0).sum() / 2)


def _grid(figure: Figure, found: Modes) -> None:
    for ax in figure.subplots(_rows(found), 2, sharey=True).ravel()[(found.index > 0).sum() :]:
        ax.remove()
    figure.supxlabel(ALONG, fontsize=10.0, color=INK)
    figure.supylabel(DISPLACEMENT, fontsize=10.0, color=INK)


@picture(
    (Modes, "tfarm.modes returns"), size=lambda found: (9.0, 0.8 + 1.9 * _rows(found)),
    grid=_grid, title=lambda found: f"{found.arm.name}: mode shapes",
)  # fmt: skip
def modes(found: Modes, *, ax: Sequence[Axes]) -> None:
    """The shapes of flexible modes (from `tfarm.modes`), an axes each, in those given or in new ones; these.

    Displacement along the arm [m], largest 1, with the places of the nodes [m].  Of more modes than axes the first are
    drawn.
    """
    payload, length = found.arm.payload, found.arm.length
    for one, (number, w) in zip(ax, scaled(found, len(ax)).items(), strict=False):
        row = int(np.flatnonzero(found.index == number)[0])
        one.axhline(0.0, color=GREY, lw=0.8)
        one.plot(np.linspace(0.0, length, w.size), w, color=BLUE, lw=1.8)
        one.add_patch(Rectangle((-HUB_WIDTH * length, -0.25), HUB_WIDTH * length, 0.5, fc=GREY, ec="none", zorder=3))
        if payload.mass > 0 or payload.inertia > 0:
            one.plot(length, w[-1], "s", ms=8.0, mfc=GREY, mec="none", zorder=3)
        one.plot(found.nodes[row], 0 * found.nodes[row], "o", ms=5.5, mfc="white", mec=ORANGE, mew=1.3, zorder=4)
        one.set(xlim=(-0.085 * length, 1.11 * length), ylim=(-1.28, 1.28), yticks=[-1, 0, 1])
        one.xaxis.set_major_locator(MaxNLocator(5))
        omega, hertz = (significant(float(of[row]), 7) for of in (found.natural_frequency, found.natural_frequency_hz))
        places = ", ".join(plain(float(node), 3) for node in found.nodes[row]) or "none"
        one.set_title(f"Mode {number}:  {omega} rad/s  ({hertz} Hz)\nnodes [m]: {places}", fontsize=9.5)
        if not one.figure.get_supylabel():
            one.set(xlabel=ALONG, ylabel=DISPLACEMENT)


def draw_differences(name: str, differences: Mapping[str, Real]) -> Figure:
    """How far each simpler theory's frequencies lie above the Timoshenko theory's [%], mode by mode."""
    looks = {"euler-bernoulli": (ORANGE, "s"), "rayleigh": (PURPLE, "D"), "shear": (GREEN, "o")}
    with page(9.0, 3.6, f"{name}: simpler beam theories against the Timoshenko theory") as (figure, ax):
        for theory, values in differences.items():
            color, marker = looks[theory]
            ax.plot(
                np.arange(1, len(values) + 1), values, marker=marker, ms=5, lw=1.2, color=color,
                label=theory_name(theory),
            )  # fmt: skip
        if all((values > 0).all() for values in differences.values()):
            ax.set_yscale("log")
            plain_ticks(ax.yaxis)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set(xlabel="mode number", ylabel="frequency above Timoshenko's [%]")
    return figure


def theory_name(theory: str) -> str:
    """As a person writes it: Euler-Bernoulli, Rayleigh, shear, Timoshenko."""
    return theory if theory == "shear" else theory.title()


# ------------------------------------------------------------ the arm


def _depth(link: Link) -> float:
    """The depth [m] of one segment: that of its shape, or sqrt(12) times the radius of gyration, as of a rectangle."""
    sizes = dict(link.section.dimensions)
    own = sizes.get("depth") or sizes.get("diameter") or sizes.get("outer_diameter")
    return own or math.sqrt(12) / link.slenderness * link.length


def _frame(arm: Arm) -> tuple[float, float, float]:
    """Left end, right end and half the height [m] of the picture."""
    tip = arm.length + arm.hub.radius + max(0.0, arm.payload.offset)
    return -BESIDE_ARM * arm.length, tip + BESIDE_ARM * arm.length, max(HALF_HEIGHT * arm.length, 0.6 * _deepest(arm))


def _deepest(arm: Arm) -> float:
    return max(map(_depth, arm.links))


def _sketch_size(arm: Arm) -> tuple[float, float]:
    left, right, half = _frame(arm)
    return 9.0, AROUND_SKETCH + 8.6 * 2 * half / (right - left)


@picture((Arm, "tfarm.load returns"), size=_sketch_size, title=lambda _: "")
def sketch(arm: Arm, *, ax: Axes) -> None:
    """Hub, link and payload from the side, to scale [m], in the axes given or in new ones; the axes."""
    left, right, half = _frame(arm)
    root = arm.hub.radius
    bore = HUB_RADIUS * arm.length
    ax.set(aspect="equal", xlim=(left, right), ylim=(-half, half), yticks=[], xlabel="distance from the hub's axis [m]")
    ax.spines[["left", "right", "top"]].set_visible(False)
    ax.axhline(0, color=FAINT, lw=0.8, ls=(0, (6, 3, 1, 3)), zorder=0)
    start = root
    for link, colour in zip(arm.links, cycle(SEGMENT_COLOURS), strict=False):
        deep = _depth(link)
        ax.add_patch(Rectangle((start, -deep / 2), link.length, deep, fc=colour, ec=BLUE, lw=1.0, zorder=2))
        start += link.length
    ax.plot([0, root], [0, 0], color=INK, lw=4.0, solid_capstyle="butt", zorder=1.5)
    if not arm.clamp.is_rigid:
        ax.plot(root, 0, "o", ms=7.0, mfc="white", mec=ORANGE, mew=1.4, zorder=5)
    for each in arm.attachments:
        ax.plot(root + each.x, 0, "o", ms=5.0, color=INK, zorder=5)
    if arm.payload.mass or arm.payload.inertia:
        at = root + arm.length + arm.payload.offset
        side = max(0.03 * arm.length, min(bore, 0.75 * _deepest(arm)))
        ax.plot([root + arm.length, at], [0, 0], color=INK, lw=2.0, zorder=2.5)
        ax.add_patch(Rectangle((at - side, -side), 2 * side, 2 * side, fc="#8c8c8c", ec=INK, lw=1.0, zorder=3))
    ax.add_patch(Circle((0, 0), bore, fc="#e9e9e9" if arm.hub.inertia else "white", ec=INK, lw=1.2, zorder=3))
    ax.plot(0, 0, "o", ms=3.5, color=INK, zorder=4)
    ends = np.array([[1.5, -1.0], [-1.0, 1.5]]) * bore
    ax.add_patch(FancyArrowPatch(*ends, zorder=4, connectionstyle="arc3,rad=0.75", arrowstyle="-|>", mutation_scale=11,
                                 color=ORANGE, lw=1.3))  # fmt: skip
    ax.text(ends[1, 0], ends[1, 1], "θ" if arm.is_locked else "u", color=ORANGE, ha="right", va="bottom", fontsize=11)
    ax.set_title("\n".join(_numbers(arm)), fontsize=9.0, color=INK)


def _numbers(arm: Arm) -> Iterator[str]:
    """Hub, link and payload in numbers, a line each."""
    payload, inertia = arm.payload, unit("kg m^2")
    free = f"hub  $I_h$ = {plain(arm.hub.inertia, 6)} {inertia}" if arm.hub.inertia else "free pin, no hub inertia"
    hub = "hub locked: driven by its angle" if arm.is_locked else free
    yield hub + (f",  r = {plain(arm.hub.radius, 6)} m" if arm.hub.radius else "")
    depths = f"{len(arm.links)} segments, at most" if arm.outer else "depth"
    yield f"link  L = {plain(arm.length, 6)} m,  {depths} {plain(_deepest(arm), 4)} m{' deep' if arm.outer else ''}"
    if not (payload.mass or payload.inertia):
        yield "free tip, no payload"
        return
    masses = "tip pinned" if math.isinf(payload.mass) else f"m = {plain(payload.mass, 6)} kg"
    turns = "tip cannot rotate" if math.isinf(payload.inertia) else f"$I_c$ = {plain(payload.inertia, 6)} {inertia}"
    yield f"payload  {masses},  {turns}" + (f",  e = {plain(payload.offset, 6)} m" if payload.offset else "")
