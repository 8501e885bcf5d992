"""The arm itself, drawn: the link to scale, hub and payload as symbols with their numbers."""

from __future__ import annotations

import math
from itertools import cycle

from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Rectangle

from tfarm.arm import Arm, Link
from tfarm.digits import plain, unit

from .style import BLUE, FAINT, GREY, INK, ORANGE, picture

HUB_RADIUS = 0.055  # radius of the drawn hub, and half the payload's side, as shares of the length
SEGMENT_COLOURS = ("#cfe0ee", "#e3ecd5")  # colours of neighbours
SHOWN_BELOW, SHOWN_ABOVE = -0.15, 0.16  # what is shown below and above the arm at least, as shares of its length
SHOWN_LEFT, SHOWN_RIGHT = -0.2, 1.2  # and left of the hub and right of it, with room for the words at the tip


def _size(arm: Arm) -> tuple[float, float]:
    """As high as the arm takes."""
    low, high = _heights(arm)
    return 9.0, 0.2 + 9.0 * (high - low) / (_right_of(arm) - SHOWN_LEFT)


@picture((Arm, "tfarm.load returns"), size=_size, title=lambda _: "")
def sketch(arm: Arm, *, ax: Axes) -> None:
    """Hub, link and payload from the side, lengths in shares of the link's, in the axes given or new ones; the axes."""
    ax.set(aspect="equal", xlim=(SHOWN_LEFT, _right_of(arm)), ylim=_heights(arm))
    ax.set_axis_off()
    top = max(0.12, _depth_of(arm) / 2 + 0.03)
    _link(arm, ax)
    _hub(arm, top, ax)
    _payload(arm, top, ax)


def _right_of(arm: Arm) -> float:
    """Where the picture ends, in lengths of the link: so far beyond the tip, or beyond a payload's centre."""
    return SHOWN_RIGHT + arm.hub.radius / arm.length + max(0.0, arm.payload.offset) / arm.length


def _heights(arm: Arm) -> tuple[float, float]:
    """What is shown below and above the arm, as shares of its length."""
    half = _depth_of(arm) / 2
    return min(SHOWN_BELOW, -half - 0.09), max(SHOWN_ABOVE, half + 0.09)


def _depth_of(arm: Arm) -> float:
    """Depth over length of a rectangle of the radius of gyration, sqrt(12) r/L; a named shape's own: the deepest."""
    return max(_depth(link) for link in arm.links) / arm.length


def _depth(link: Link) -> float:
    """The depth [m] of one segment."""
    given = dict(link.section.dimensions)
    own = given.get("depth") or given.get("diameter") or given.get("outer_diameter")
    return own if own else math.sqrt(12) / link.slenderness * link.length


def _link(arm: Arm, ax: Axes) -> None:
    depth = _depth_of(arm)
    ax.plot([-0.2, _right_of(arm)], [0, 0], color=FAINT, lw=0.8, ls=(0, (6, 3, 1, 3)), zorder=0)
    root = start = arm.hub.radius / arm.length
    for link, colour in zip(arm.links, cycle(SEGMENT_COLOURS), strict=False):
        share, high = (link.length / arm.length if arm.outer else 1.0), _depth(link) / arm.length
        ax.add_patch(Rectangle((start, -high / 2), share, high, fc=colour, ec=BLUE, lw=1.0, zorder=2))
        start += share
    if root:
        ax.plot([0, root], [0, 0], color=INK, lw=4.0, solid_capstyle="butt", zorder=1.5)
    if not arm.clamp.is_rigid:
        ax.plot([root], [0], "o", ms=7.0, mfc="white", mec=ORANGE, mew=1.4, zorder=5)
    for each in arm.attachments:
        ax.plot([root + each.x / arm.length], [0], "o", ms=5.0, color=INK, zorder=5)
    below = -max(depth / 2, HUB_RADIUS) - 0.035
    ax.annotate("", (root, below), (root + 1, below), arrowprops={"arrowstyle": "<->", "color": GREY, "lw": 0.8})
    deepest = plain(depth * arm.length, 4)
    depths = f"{len(arm.links)} segments, at most {deepest} m deep" if arm.outer else f"depth {deepest} m"
    text = f"L = {plain(arm.length, 6)} m,  {depths} (to scale)"
    if root:
        text += f",  r = {plain(arm.hub.radius, 6)} m"
    ax.text(root + 0.5, below - 0.012, text, ha="center", va="top", fontsize=9.0, color=INK)


def _hub(arm: Arm, top: float, ax: Axes) -> None:
    inertia = arm.hub.inertia
    ax.add_patch(Circle((0, 0), HUB_RADIUS, fc="white" if inertia == 0 else "#e9e9e9", ec=INK, lw=1.2, zorder=3))
    ax.plot(0, 0, "o", ms=3.5, color=INK, zorder=4)
    if arm.is_locked:
        text = "hub locked: driven by its angle"
    else:
        text = "free pin, no hub inertia" if inertia == 0 else f"hub  $I_h$ = {plain(inertia, 6)} {unit('kg m^2')}"
    ax.add_patch(
        FancyArrowPatch(
            (0.085, -0.055), (-0.055, 0.085), connectionstyle="arc3,rad=0.75", arrowstyle="-|>", mutation_scale=11,
            color=ORANGE, lw=1.3, zorder=4,
        )
    )  # fmt: skip
    ax.text(-0.07, 0.08, "θ" if arm.is_locked else "u", color=ORANGE, ha="right", va="bottom", fontsize=11)
    ax.text(0.13, top, text, ha="left", va="bottom", fontsize=9.0, color=INK)


def _payload(arm: Arm, top: float, ax: Axes) -> None:
    mass, inertia = arm.payload.mass, arm.payload.inertia
    tip = 1 + arm.hub.radius / arm.length
    at = tip + arm.payload.offset / arm.length
    if mass == 0 and inertia == 0:
        text = "free tip, no payload"
    else:
        words = (
            "tip pinned" if math.isinf(mass) else f"m = {plain(mass, 6)} kg",
            "tip cannot rotate" if math.isinf(inertia) else f"$I_c$ = {plain(inertia, 6)} {unit('kg m^2')}",
        )
        text = "payload  " + ",  ".join(words)
        side = max(0.03, min(HUB_RADIUS, _depth_of(arm) * 0.75))
        if at != tip:
            text += f",  e = {plain(arm.payload.offset, 6)} m"
            ax.plot([tip, at], [0, 0], color=INK, lw=2.0, zorder=2.5)
        ax.add_patch(Rectangle((at - side, -side), 2 * side, 2 * side, fc="#8c8c8c", ec=INK, lw=1.0, zorder=3))
    if math.isinf(mass):
        foot = ((at, 0), (at - 0.03, -0.07), (at + 0.03, -0.07))
        ax.add_patch(Polygon(foot, closed=True, fc="white", ec=INK, lw=1.0, zorder=4))
    ax.text(_right_of(arm) - 0.15, top, text, ha="right", va="bottom", fontsize=9.0, color=INK)
