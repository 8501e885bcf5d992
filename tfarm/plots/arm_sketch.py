"""The arm from its record: each part at its place along the arm, to scale, with the signs of angle, torque and tip.

Lengths along the arm are to scale.  Depths are, too, where they can be seen; else all are drawn larger by one factor,
which the picture states.  Hub, bodies, springs and gauge are symbols.  Each artist has the key of its part as gid.
"""

import math
import re
from itertools import cycle, pairwise
from typing import Any

import numpy as np
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle
from matplotlib.path import Path

from tfarm.arm import Arm, Attachment
from tfarm.digits import how_many, plain, unit
from tfarm.plots.style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PURPLE, Axes, picture


def _spiral() -> Path:
    """Return the mark of a rotary spring: two turns around its place."""
    angle = np.linspace(0.0, 4 * math.pi, 60)
    return Path(np.column_stack([angle * np.cos(angle), angle * np.sin(angle)]))


SPIRAL = _spiral()
# a spring hung below its place, and the ground under it; half of a mark's size is its height
_ZIGZAG = [(0, 0), (0, -0.2), (0.2, -0.3), (-0.2, -0.45), (0.2, -0.6), (-0.2, -0.75), (0, -0.85), (0, -1)]
GROUNDED = Path(
    [*_ZIGZAG, (-0.4, -1), (0.4, -1)], [Path.MOVETO, *[Path.LINETO] * 7, Path.MOVETO, Path.LINETO]
)


class _Scale:
    """Measures of a picture [m]: its ends, a hundredth of the distance between its outer parts, half its height."""

    def __init__(self, arm: Arm) -> None:
        low = min(0.0, arm.centre_distance)
        high = max(arm.reach, arm.centre_distance)
        self.hundredth = (high - low) / 100
        self.left = low - 13 * self.hundredth
        self.right = high + 9 * self.hundredth
        true = np.array([_depth(link.section) for link in arm.links])
        # the deepest segment has at least 3 hundredths
        factor = max(1.0, 3 * self.hundredth / true.max())
        self.factor = float(f"{factor:.2g}")
        self.depths = np.clip(self.factor * true, 0.8 * self.hundredth, 30 * self.hundredth)
        self.is_even = bool(np.allclose(self.depths, self.factor * true))
        self.half = max(13 * self.hundredth, self.depths.max() / 2 + 9 * self.hundredth)


def _depth(section: Any) -> float:
    """Return the depth [m] in the plane of bending; of a general section that of a rectangle with its I/A."""
    if section.half_depth is None:
        return math.sqrt(12) * section.radius_of_gyration
    return 2 * section.half_depth


def _size(arm: Arm) -> tuple[float, float]:
    scale = _Scale(arm)
    springs = (arm.clamp.is_rigid, arm.joint.is_rigid, not arm.hub.stiffness).count(False)
    more = springs + 2 * bool(arm.attachments) + bool(arm.outer) + bool(arm.motor)
    # with the axis, and below it the legend of these parts and of those of every arm
    return 9.0, 1.1 + 0.12 * more + 8.6 * 2 * scale.half / (scale.right - scale.left)


@picture((Arm, "tfarm.load returns"), size=_size, title=lambda _: "")
def sketch(arm: Arm, *, ax: Axes) -> None:
    """Draw the parts of an arm along its length, to scale [m], in the axes given or in new ones; the axes.

    Arrows show the positive hub angle theta, input u, root moment M and tip displacement w.
    """
    scale = _Scale(arm)
    ax.set(aspect="equal", xlim=(scale.left, scale.right), ylim=(-scale.half, scale.half), yticks=[])
    ax.set_xlabel("distance from the hub's axis [m]")
    ax.grid(visible=False)
    ax.spines[["left", "right", "top"]].set_visible(False)
    ax.axhline(0.0, color=FAINT, lw=0.8, ls=(0, (6, 3, 1, 3)), zorder=0)
    _draw_hub(arm, scale, ax)
    _draw_link(arm, scale, ax)
    _draw_attachments(arm, ax)
    _draw_payload(arm, ax)
    _draw_springs(arm, ax)
    _draw_gauge(arm, scale, ax)
    _draw_signs(arm, scale, ax)


def _mark(ax: Axes, gid: str, x: float, label: str | None, *, y: float = 0.0, **looks: Any) -> None:
    """Draw the mark of a part at its place; the legend has one of at most 12 points."""
    looks.setdefault("zorder", 5)
    ax.plot(x, y, gid=gid, ls="none", **looks)
    if label:
        ax.plot([], [], label=label, ls="none", **looks | {"ms": min(looks["ms"], 12.0)})


def _number(x: float, digits: int = 4) -> str:
    """Return a number with its power of ten in letters that every font has."""
    powers = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    return re.sub("[⁻⁰¹²³⁴-⁹]+", lambda power: f"$^{{{power[0].translate(powers)}}}$", plain(x, digits))


def _value(letter: str, number: float, of: str) -> str:
    """Return a number with letter and unit, within which no line is folded."""
    return f"{letter} = {_number(number)} {unit(of)}".replace(" ", "\u00a0")


def _draw_hub(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Hub with its radius, and the motor around it."""
    hub = arm.hub
    inertia = f"hub, {_value('$I_h$', hub.inertia, 'kg m^2')}" if hub.inertia else "pin without inertia"
    words = "hub, locked" if math.isinf(hub.inertia) else inertia
    words += f", {_value('r', hub.radius, 'm')}" if hub.radius else ""
    words += f", {_value('b', hub.friction, 'N m s/rad')}" if hub.friction else ""
    # its own radius, where a symbol can be of that size
    radius = min(max(hub.radius, 2.5 * scale.hundredth), 4 * scale.hundredth)
    if arm.motor is not None:
        side = 2.3 * radius
        label = f"motor, gear ratio N = {_number(arm.motor.gear_ratio)}"
        corner = (-side / 2, -side / 2)
        ax.add_patch(Rectangle(corner, side, side, fc="white", ec=GREY, gid="motor", label=label, zorder=1))
    colour = "#e9e9e9" if hub.inertia else "white"
    ax.add_patch(Circle((0, 0), radius, fc=colour, ec=INK, lw=1.2, gid="hub", label=words, zorder=1.2))
    if hub.radius:
        ax.plot(
            [0, hub.radius], [0, 0], color=INK, lw=3.5, solid_capstyle="butt", gid="hub.radius", zorder=1.5
        )
    _mark(ax, "axis", 0.0, None, marker="o", ms=3.5, color=INK)


def _draw_link(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Segments, and the joints between them."""
    ends = arm.hub.radius + np.cumsum([0.0, *(link.length for link in arm.links)])
    words = f"link, {_value('L', arm.length, 'm')}" + (
        f", {how_many(len(arm.links), 'segment')}" if arm.outer else ""
    )
    enlarged = f", depth drawn × {_number(scale.factor, 2)}" if scale.factor > 1 else ", to scale"
    words += enlarged if scale.is_even else ", depth not to scale"
    colours = cycle(("#cfe0ee", "#e3ecd5"))
    for number, (start, end) in enumerate(pairwise(ends), 1):
        depth = scale.depths[number - 1]
        box = Rectangle((start, -depth / 2), end - start, depth, fc=next(colours), ec=BLUE, lw=1.0, zorder=2)
        box.set(gid=f"link.{number}", label=words if number == 1 else None)
        ax.add_patch(box)
    # between the deeper of two segments and a little beyond
    for number, x in enumerate(ends[1:-1], 1):
        half = max(scale.depths[number - 1 : number + 1]) / 2 + scale.hundredth
        label = "joint of segments" if number == 1 else None
        ax.plot(
            [x, x], [-half, half], color=BLUE, lw=1.6, gid=f"segment.joint.{number}", label=label, zorder=2.5
        )


def _draw_gauge(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Strain gauge, on the surface of the segment on its side of a joint."""
    gauge = arm.gauge
    ends = np.cumsum([link.length for link in arm.links])
    segment = int(np.searchsorted(ends, gauge.x, side="left" if gauge.side == "inner" else "right"))
    y = scale.depths[min(segment, len(ends) - 1)] / 2
    words = "strain gauge" + (f", {_value('x', gauge.x, 'm')}" if gauge.x else " at the root")
    _mark(
        ax, "gauge", arm.hub.radius + gauge.x, words, y=y, marker="s", ms=6.0, mfc=GREEN, mec="white", mew=0.6
    )


def _draw_attachments(arm: Arm, ax: Axes) -> None:
    """Bodies on the link, and springs between link and ground."""
    kinds: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("body", "attached body", {"marker": "o", "ms": 6.0, "color": INK}),
        ("stiffness", "spring to ground", _line_mark(GROUNDED, 22.0)),
        ("rotational_stiffness", "rotary spring to ground", _spring(PURPLE)),
    )
    for name, words, looks in kinds:
        of_kind = {i: each for i, each in enumerate(arm.attachments, 1) if _has(each, name)}
        label: str | None = words + _places(list(of_kind.values()))
        for i, each in of_kind.items():
            _mark(ax, f"attachment.{i}.{name}", arm.hub.radius + each.x, label, **looks)
            label = None


def _has(attachment: Attachment, name: str) -> bool:
    """Whether an attachment has a spring of this name, or a body."""
    return bool(attachment.mass or attachment.inertia if name == "body" else getattr(attachment, name))


def _places(attachments: list[Attachment]) -> str:
    """Return the places of the first of these, in words."""
    most = 3
    listed = [_number(x).replace(" ", "\u00a0") for x in sorted(each.x for each in attachments)]
    words = ", ".join(listed[:most])
    return f", x\u00a0=\u00a0{words}{' ...' if len(listed) > most else ''}\u00a0m"


def _line_mark(path: Path, size: float, colour: str = PURPLE) -> dict[str, Any]:
    return {"marker": path, "ms": size, "mfc": "none", "mec": colour, "mew": 1.1}


def _spring(colour: str, size: float = 13.0) -> dict[str, Any]:
    return _line_mark(SPIRAL, size, colour)


def _draw_payload(arm: Arm, ax: Axes) -> None:
    payload = arm.payload
    if not (payload.mass or payload.inertia):
        return
    mass = "tip pinned" if math.isinf(payload.mass) else _value("m", payload.mass, "kg")
    inertia = "cannot rotate" if math.isinf(payload.inertia) else _value("$I_c$", payload.inertia, "kg m^2")
    words = ["payload", mass] if payload.mass else ["payload"]
    words += [inertia] if payload.inertia else []
    words += [_value("e", payload.offset, "m")] if payload.offset else []
    if payload.offset:
        ends = [arm.reach, arm.centre_distance]
        ax.plot(ends, [0, 0], color=INK, lw=2.0, gid="payload.offset", zorder=2.7)
    looks: dict[str, Any] = {"marker": "s", "ms": 10.0, "mfc": "#8c8c8c", "mec": INK, "zorder": 3}
    _mark(ax, "payload", arm.centre_distance, ", ".join(words), **looks)


def _draw_springs(arm: Arm, ax: Axes) -> None:
    """Rotary springs of clamp, joint and hub."""
    for name, x, spring in (("clamp", arm.hub.radius, arm.clamp), ("joint", 0.0, arm.joint)):
        if not spring.is_rigid:
            _mark(
                ax, name, x, f"{name} spring, {_value('k', spring.stiffness, 'N m/rad')}", **_spring(ORANGE)
            )
    if arm.hub.stiffness:
        label = f"spring from hub to ground, {_value('k', arm.hub.stiffness, 'N m/rad')}"
        _mark(ax, "hub.stiffness", 0.0, label, **_spring(PURPLE, 18.0))


def _draw_signs(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Arrows of the positive directions, with a letter each: turns are anticlockwise."""
    around = 7.5 * scale.hundredth
    root = arm.hub.radius + arm.gauge.x
    turns = [("theta", "θ", 0.0, (20, 70)), ("root_moment", "M", root, (-75, -20))]
    words = "signs: angle θ, moment M, tip w" if arm.is_locked else "signs: angle θ, input u, moment M, tip w"
    if not arm.is_locked:
        turns.append(("u", "u", 0.0, (130, 230)))
    for gid, letter, centre, (first, last) in turns:
        angle = np.radians(np.linspace(first, last, 20))
        middle = np.radians((first + last) / 2)
        arc = Path(np.column_stack([centre + around * np.cos(angle), around * np.sin(angle)]))
        _arrow(ax, gid, path=arc)
        at = (centre + 1.4 * around * np.cos(middle), 1.4 * around * np.sin(middle))
        ax.text(*at, letter, color=ORANGE, ha="center", va="center", fontsize=11, gid=f"{gid}.letter")
    low = scale.depths[-1] / 2 + 2.5 * scale.hundredth
    high = low + 6.5 * scale.hundredth
    _arrow(ax, "tip_displacement", posA=(arm.reach, low), posB=(arm.reach, high))
    at = (arm.reach + 3 * scale.hundredth, high - scale.hundredth)
    ax.text(*at, "w", color=ORANGE, ha="center", va="center", fontsize=11, gid="tip_displacement.letter")
    ax.plot([], [], color=ORANGE, lw=1.3, marker=">", ms=4.0, label=words)


def _arrow(ax: Axes, gid: str, **ends: Any) -> None:
    looks: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}
    ax.add_patch(FancyArrowPatch(**ends, color=ORANGE, lw=1.3, zorder=6, gid=gid, **looks))
