"""The arm from its record: each part at its place along the arm, to scale, with the signs of angle, torque and tip.

Lengths along the arm are to scale.  Depths are, too, where they can be seen; else all are drawn larger by one factor,
which the picture states.  Hub, bodies, springs and gauge are symbols.  Each artist has the key of its part as gid.
"""

import math
import re
from functools import partial
from itertools import cycle, pairwise
from typing import Any

import numpy as np
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle
from matplotlib.path import Path

from tfarm.arm import Arm, Attachment
from tfarm.digits import how_many, plain, unit
from tfarm.plots.style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PURPLE, Axes, key_line, picture


def _path(z: Any) -> Path:
    """Return a line through complex numbers."""
    return Path(np.column_stack([z.real, z.imag]))


def _spiral() -> Path:
    """Return the mark of a rotary spring: two turns around its place."""
    angle = np.linspace(0.0, 4 * math.pi, 60)
    return _path(angle * np.exp(1j * angle))


def _zigzag() -> Path:
    """Return the mark of a spring hung below its place, and the ground under it; half of its size is its height."""
    x = (0, 0, 0.2, -0.2, 0.2, -0.2, 0, 0, -0.4, 0.4)
    y = (0, -0.2, -0.3, -0.45, -0.6, -0.75, -0.85, -1, -1, -1)
    codes = np.full(len(x), Path.LINETO)
    codes[[0, -2]] = Path.MOVETO
    return Path(np.column_stack([x, y]), codes)


class _Scale:
    """Measures of a picture [m]: its ends, a hundredth of the distance between its outer parts, half its height."""

    def __init__(self, arm: Arm) -> None:
        low = min(0.0, arm.centre_distance)
        high = max(arm.reach, arm.centre_distance)
        hundredth = (high - low) / 100
        true = np.array([_depth(link.section) for link in arm.links])
        # the deepest segment has at least 3 hundredths
        factor = float(f"{max(1.0, 3 * hundredth / true.max()):.2g}")
        depths = np.clip(factor * true, 0.8 * hundredth, 30 * hundredth)
        self.hundredth = hundredth
        self.left = low - 13 * hundredth
        self.right = high + 9 * hundredth
        self.half = max(13 * hundredth, depths.max() / 2 + 9 * hundredth)
        self.factor = factor
        self.depths = depths
        self.is_even = bool(np.allclose(depths, factor * true))


def _depth(section: Any) -> float:
    """Return the depth [m] in the plane of bending; of a general section that of a rectangle with its I/A."""
    if section.half_depth is None:
        return math.sqrt(12) * section.radius_of_gyration
    return 2 * section.half_depth


def _size(arm: Arm) -> tuple[float, float]:
    scale = _Scale(arm)
    springs = (arm.clamp.is_rigid, arm.joint.is_rigid, not arm.hub.stiffness).count(False)
    more = springs + 2 * bool(arm.attachments) + bool(arm.outer) + bool(arm.motor)
    width = scale.right - scale.left
    # with the axis, and below it the legend of these parts and of those of every arm
    return 9.0, 1.1 + 0.12 * more + 8.6 * 2 * scale.half / width


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
        looks["ms"] = min(looks["ms"], 12.0)
        key_line(label, ax, ls="none", **looks)


def _number(x: float, digits: int = 4) -> str:
    """Return a number with its power of ten in letters that every font has."""
    powers = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    return re.sub("[⁻⁰¹²³⁴-⁹]+", lambda power: f"$^{{{power[0].translate(powers)}}}$", plain(x, digits))


def _value(letter: str, number: float, of: str) -> str:
    """Return a number with letter and unit, within which no line is folded."""
    return f"{letter} = {_number(number)} {unit(of)}".replace(" ", "\u00a0")


def _draw_hub(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Draw the hub with its radius, and the motor around it."""
    hub = arm.hub
    words = ["pin without inertia"]
    if math.isinf(hub.inertia):
        words = ["hub, locked"]
    elif hub.inertia:
        words = ["hub", _value("$I_h$", hub.inertia, "kg m^2")]
    if hub.radius:
        words.append(_value("r", hub.radius, "m"))
    if hub.friction:
        words.append(_value("b", hub.friction, "N m s/rad"))
    # its own radius, where a symbol can be of that size
    radius = min(max(hub.radius, 2.5 * scale.hundredth), 4 * scale.hundredth)
    if arm.motor is not None:
        side = 2.3 * radius
        label = f"motor, gear ratio N = {_number(arm.motor.gear_ratio)}"
        corner = -side / 2
        ax.add_patch(
            Rectangle((corner, corner), side, side, fc="white", ec=GREY, gid="motor", label=label, zorder=1)
        )
    colour = "#e9e9e9" if hub.inertia else "white"
    label = ", ".join(words)
    ax.add_patch(Circle((0, 0), radius, fc=colour, ec=INK, lw=1.2, gid="hub", label=label, zorder=1.2))
    if hub.radius:
        ends = [0, hub.radius]
        ax.plot(ends, [0, 0], color=INK, lw=3.5, solid_capstyle="butt", gid="hub.radius", zorder=1.5)
    _mark(ax, "axis", 0.0, None, marker="o", ms=3.5, color=INK)


def _draw_link(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Draw segments, and the joints between them."""
    ends = arm.hub.radius + np.cumsum([0.0, *(link.length for link in arm.links)])
    label: str | None = _link_words(arm, scale)
    colours = cycle(("#cfe0ee", "#e3ecd5"))
    for number, (start, end) in enumerate(pairwise(ends), 1):
        depth = scale.depths[number - 1]
        box = Rectangle((start, -depth / 2), end - start, depth, fc=next(colours), ec=BLUE, lw=1.0, zorder=2)
        box.set(gid=f"link.{number}", label=label)
        ax.add_patch(box)
        label = None
    # between the deeper of two segments and a little beyond
    label = "joint of segments"
    for number, x in enumerate(ends[1:-1], 1):
        half = max(scale.depths[number - 1 : number + 1]) / 2 + scale.hundredth
        gid = f"segment.joint.{number}"
        ax.plot([x, x], [-half, half], color=BLUE, lw=1.6, gid=gid, label=label, zorder=2.5)
        label = None


def _link_words(arm: Arm, scale: _Scale) -> str:
    """Return length and segments of a link, and the scale of its depth."""
    words = ["link", _value("L", arm.length, "m")]
    if arm.outer:
        words.append(how_many(len(arm.links), "segment"))
    if not scale.is_even:
        words.append("depth not to scale")
    elif scale.factor > 1:
        words.append(f"depth drawn × {_number(scale.factor, 2)}")
    else:
        words.append("to scale")
    return ", ".join(words)


def _draw_gauge(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Draw the strain gauge, on the surface of the segment on its side of a joint."""
    gauge = arm.gauge
    ends = np.cumsum([link.length for link in arm.links])
    side: Any = "left" if gauge.side == "inner" else "right"
    segment = min(int(np.searchsorted(ends, gauge.x, side)), len(ends) - 1)
    words = "strain gauge at the root"
    if gauge.x:
        words = f"strain gauge, {_value('x', gauge.x, 'm')}"
    place = arm.hub.radius + gauge.x
    y = scale.depths[segment] / 2
    _mark(ax, "gauge", place, words, y=y, marker="s", ms=6.0, mfc=GREEN, mec="white", mew=0.6)


def _draw_attachments(arm: Arm, ax: Axes) -> None:
    """Draw bodies on the link, and springs between link and ground."""
    kinds: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("body", "attached body", {"marker": "o", "ms": 6.0, "color": INK}),
        ("stiffness", "spring to ground", _line_mark(_zigzag(), 22.0, PURPLE)),
        ("rotational_stiffness", "rotary spring to ground", _spring_mark(PURPLE)),
    )
    for name, words, looks in kinds:
        places = {i: each.x for i, each in enumerate(arm.attachments, 1) if _has_part(each, name)}
        label: str | None = words + _places_words([*places.values()])
        for i, x in places.items():
            _mark(ax, f"attachment.{i}.{name}", arm.hub.radius + x, label, **looks)
            label = None


def _has_part(attachment: Attachment, name: str) -> bool:
    """Whether an attachment has a spring of this name, or a body."""
    if name == "body":
        return bool(attachment.mass or attachment.inertia)
    return bool(getattr(attachment, name))


def _places_words(places: list[float]) -> str:
    """Return the first of these places, in words."""
    most = 3
    words = ", ".join(_number(x).replace(" ", "\u00a0") for x in sorted(places)[:most])
    if len(places) > most:
        words += " ..."
    return f", x\u00a0=\u00a0{words}\u00a0m"


def _line_mark(path: Path, size: float, colour: str) -> dict[str, Any]:
    return {"marker": path, "ms": size, "mfc": "none", "mec": colour, "mew": 1.1}


def _spring_mark(colour: str, size: float = 13.0) -> dict[str, Any]:
    return _line_mark(_spiral(), size, colour)


def _draw_payload(arm: Arm, ax: Axes) -> None:
    payload = arm.payload
    if not (payload.mass or payload.inertia):
        return
    words = ["payload"]
    if math.isinf(payload.mass):
        words.append("tip pinned")
    elif payload.mass:
        words.append(_value("m", payload.mass, "kg"))
    if math.isinf(payload.inertia):
        words.append("cannot rotate")
    elif payload.inertia:
        words.append(_value("$I_c$", payload.inertia, "kg m^2"))
    centre = arm.centre_distance
    if payload.offset:
        words.append(_value("e", payload.offset, "m"))
        ax.plot([arm.reach, centre], [0, 0], color=INK, lw=2.0, gid="payload.offset", zorder=2.7)
    label = ", ".join(words)
    _mark(ax, "payload", centre, label, marker="s", ms=10.0, mfc="#8c8c8c", mec=INK, zorder=3)


def _draw_springs(arm: Arm, ax: Axes) -> None:
    """Draw rotary springs of clamp, joint and hub."""
    for name, x, spring in (("clamp", arm.hub.radius, arm.clamp), ("joint", 0.0, arm.joint)):
        if not spring.is_rigid:
            label = f"{name} spring, {_value('k', spring.stiffness, 'N m/rad')}"
            _mark(ax, name, x, label, **_spring_mark(ORANGE))
    if arm.hub.stiffness:
        label = f"spring from hub to ground, {_value('k', arm.hub.stiffness, 'N m/rad')}"
        _mark(ax, "hub.stiffness", 0.0, label, **_spring_mark(PURPLE, 18.0))


def _draw_signs(arm: Arm, scale: _Scale, ax: Axes) -> None:
    """Draw arrows of the positive directions, with a letter each: turns are anticlockwise."""
    radius = 7.5 * scale.hundredth
    root = arm.hub.radius + arm.gauge.x
    _draw_turn("theta", "θ", 0.0, radius, (20, 70), ax)
    _draw_turn("root_moment", "M", root, radius, (-75, -20), ax)
    words = "signs: angle θ, moment M, tip w"
    if not arm.is_locked:
        _draw_turn("u", "u", 0.0, radius, (130, 230), ax)
        words = "signs: angle θ, input u, moment M, tip w"
    low = scale.depths[-1] / 2 + 2.5 * scale.hundredth
    high = low + 6.5 * scale.hundredth
    _arrow(ax, "tip_displacement", posA=(arm.reach, low), posB=(arm.reach, high))
    _letter("w", "tip_displacement", arm.reach + 3 * scale.hundredth, high - scale.hundredth, ax)
    key_line(words, ax, color=ORANGE, lw=1.3, marker=">", ms=4.0)


def _draw_turn(
    gid: str, letter: str, centre: float, radius: float, ends: tuple[float, float], ax: Axes
) -> None:
    """Draw an arrow around a centre from angle to angle [deg], its letter beyond the middle."""
    angle = np.radians(np.linspace(*ends, 20))
    middle = centre + 1.4 * radius * np.exp(1j * np.radians(sum(ends) / 2))
    _arrow(ax, gid, path=_path(centre + radius * np.exp(1j * angle)))
    _letter(letter, gid, middle.real, middle.imag, ax)


def _letter(letter: str, gid: str, x: float, y: float, ax: Axes) -> None:
    ax.text(x, y, letter, color=ORANGE, ha="center", va="center", fontsize=11, gid=f"{gid}.letter")


def _arrow(ax: Axes, gid: str, **ends: Any) -> None:
    draw = partial(FancyArrowPatch, arrowstyle="-|>", mutation_scale=9, shrinkA=0, shrinkB=0)
    ax.add_patch(draw(**ends, color=ORANGE, lw=1.3, zorder=6, gid=gid))
