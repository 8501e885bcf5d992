"""Pictures of the modes: their shapes, and how far the simpler beam theories are off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator

from tfarm.arrays import Real
from tfarm.digits import plain, significant
from tfarm.records import record
from tfarm.spectrum import Modes

from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, New, blank, headline, must_be, style, window

SHAPE_POINTS = 401  # of a drawn mode: about one to a pixel of its picture
ALONG, DISPLACEMENT = "distance from the hub, x [m]", "displacement w(x), largest = 1 [-]"
HUB_WIDTH = 0.06  # width of the drawn hub, as a share of the length


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class DrawnMode:
    """One mode as drawn: w(x) over its largest value, x and nodes in m."""

    number: int
    natural_frequency: float
    x: Real
    w: Real
    nodes: Real
    has_payload: bool


def shapes_of(found: Modes, count: int) -> tuple[DrawnMode, ...]:
    """The first flexible modes, each scaled to a largest displacement of one, the tip's side positive."""
    x = np.linspace(0.0, found.arm.length, SHAPE_POINTS)
    payload = found.arm.payload
    shapes = []
    for i, w in enumerate(found.shape(x)):
        if found.index[i] == 0 or found.index[i] > count:
            continue
        largest = float(abs(w).max())
        shape = DrawnMode(
            number=int(found.index[i]),
            natural_frequency=float(found.natural_frequency[i]),
            x=x,
            w=w / largest if largest > 0 else w,
            nodes=found.nodes[i],
            has_payload=payload.mass > 0 or payload.inertia > 0,
        )
        shapes.append(shape)
    return tuple(shapes)


def modes(found: Modes, *, ax: Sequence[Axes] | None = None) -> tuple[Axes, ...]:
    """The shapes of flexible modes (what `tfarm.modes` returns), an axes each, in those given or in new ones; these.

    Displacement along the arm [m], largest 1, with the places of the nodes [m].  Of more modes than axes the first are
    drawn.
    """
    must_be(Modes, found, "tfarm.modes returns")
    shapes = shapes_of(found, int(found.index[-1]))
    with style():
        if ax is None:
            return tuple(draw_shapes(found.arm.name, shapes, window).axes)
        each = tuple(np.ravel(np.asarray(ax, dtype=object)))[: len(shapes)]
        for one, shape in zip(each, shapes, strict=False):
            draw_shape(shape, ax=one)
            one.set_xlabel(ALONG)
            one.set_ylabel(DISPLACEMENT)
    return each


def draw_shapes(name: str, shapes: tuple[DrawnMode, ...], new: New = blank) -> Figure:
    """Small pictures, two in a row, one a mode."""
    with style():
        rows = math.ceil(len(shapes) / 2)
        figure = new(9.0, 0.7 + 1.75 * rows)
        axes = np.atleast_1d(figure.subplots(rows, 2, sharex=True, sharey=True)).ravel()
        for ax, shape in zip(axes, shapes, strict=False):
            draw_shape(shape, ax=ax)
        for ax in axes[len(shapes) :]:
            ax.remove()
        for ax in axes[max(0, len(shapes) - 2) : len(shapes)]:
            ax.set_xlabel(ALONG)
            ax.tick_params(labelbottom=True)
        figure.supylabel(DISPLACEMENT, fontsize=10.0, color=INK)
        headline(figure, f"{name}: mode shapes")
    return figure


def draw_shape(shape: DrawnMode, *, ax: Axes) -> None:
    """One mode: its line, the arm at rest, hub, payload, and the nodes with their places."""
    length = float(shape.x[-1])
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.plot(shape.x, shape.w, color=BLUE, lw=1.8)
    ax.add_patch(Rectangle((-HUB_WIDTH * length, -0.25), HUB_WIDTH * length, 0.5, fc=GREY, ec="none", zorder=3))
    if shape.has_payload:
        ax.plot(length, shape.w[-1], "s", ms=8.0, mfc=GREY, mec="none", zorder=3)
    ax.plot(shape.nodes, np.zeros(len(shape.nodes)), "o", ms=5.5, mfc="white", mec=ORANGE, mew=1.3, zorder=4)
    decimals = max(0, 3 - round(math.log10(length)))
    for node in shape.nodes:  # its place [m] at its right, on the side of the line that the curve leaves free
        slope = np.interp(node + 0.01 * length, shape.x, shape.w) - np.interp(node - 0.01 * length, shape.x, shape.w)
        if round(float(node), decimals) > 0:
            ax.annotate(
                f"{node:.{decimals}f}", (node, 0.0), textcoords="offset points",
                xytext=(4, -6 if slope > 0 else 6), va="top" if slope > 0 else "bottom", fontsize=7.5, color=ORANGE,
            )  # fmt: skip
    ax.set_xlim(-0.085 * length, 1.11 * length)
    ax.set_ylim(-1.28, 1.28)
    ax.set_yticks([-1, 0, 1])
    w = significant(shape.natural_frequency, 7)
    f = significant(shape.natural_frequency / (2 * math.pi), 7)
    ax.set_title(f"Mode {shape.number}:  {w} rad/s  ({f} Hz)", fontsize=9.5)


def draw_differences(name: str, differences: Mapping[str, Real]) -> Figure:
    """How far each simpler theory's frequencies lie above the Timoshenko theory's [%], mode by mode."""
    looks = {"euler-bernoulli": (ORANGE, "s"), "rayleigh": (PURPLE, "D"), "shear": (GREEN, "o")}
    with style():
        figure = blank(9.0, 3.6)
        ax = figure.subplots()
        for theory, values in differences.items():
            color, marker = looks[theory]
            numbers = np.arange(1, len(values) + 1)
            ax.plot(numbers, values, marker=marker, ms=5, lw=1.2, color=color, label=theory_name(theory))
        if all((values > 0).all() for values in differences.values()):
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: plain(y, 3)))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set_xlabel("mode")
        ax.set_ylabel("frequency above Timoshenko's [%]")
        ax.legend(loc="upper left")
        headline(figure, f"{name}: simpler beam theories against the Timoshenko theory")
    return figure


def theory_name(theory: str) -> str:
    """As a person writes it: Euler-Bernoulli, Rayleigh, shear, Timoshenko."""
    names = {"timoshenko": "Timoshenko", "rayleigh": "Rayleigh", "euler-bernoulli": "Euler-Bernoulli"}
    return names.get(theory, theory)
