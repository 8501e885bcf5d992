"""Pictures of the modes: their shapes, and how far the simpler beam theories are off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, MaxNLocator

from tfarm.arrays import Real
from tfarm.digits import plain, significant
from tfarm.spectrum import Modes

from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, page, picture

SHAPE_POINTS = 401  # of a drawn mode: about one to a pixel of its picture
ALONG, DISPLACEMENT = "distance from the hub, x [m]", "displacement w(x), largest = 1 [-]"
HUB_WIDTH = 0.06  # width of the drawn hub, as a share of the length


def scaled(found: Modes, count: int) -> dict[int, Real]:
    """w(x) of the first `count` flexible modes by their number, at `SHAPE_POINTS` places even along the arm.

    Each is scaled to a largest displacement of one, the tip's side positive.
    """
    x = np.linspace(0.0, found.arm.length, SHAPE_POINTS)
    rows = zip(found.index.tolist(), found.shape(x), strict=True)
    return {number: w / (float(abs(w).max()) or 1.0) for number, w in rows if 0 < number <= count}


def _grid(figure: Figure, found: Modes) -> None:
    count = _flexible(found)
    axes = figure.subplots(math.ceil(count / 2), 2, sharex=True, sharey=True).ravel()
    for ax in axes[count:]:
        ax.remove()
    for ax in axes[max(0, count - 2) : count]:
        ax.tick_params(labelbottom=True)
    figure.supylabel(DISPLACEMENT, fontsize=10.0, color=INK)


def _flexible(found: Modes) -> int:
    return int((found.index > 0).sum())


@picture(
    (Modes, "tfarm.modes returns"), size=lambda found: (9.0, 0.7 + 1.75 * math.ceil(_flexible(found) / 2)),
    grid=_grid, title=lambda found: f"{found.arm.name}: mode shapes",
)  # fmt: skip
def modes(found: Modes, *, ax: Sequence[Axes]) -> None:
    """The shapes of flexible modes (what `tfarm.modes` returns), an axes each, in those given or in new ones; these.

    Displacement along the arm [m], largest 1, with the places of the nodes [m].  Of more modes than axes the first are
    drawn.
    """
    payload, length, count = found.arm.payload, found.arm.length, _flexible(found)
    for one, (number, w) in zip(ax, scaled(found, count).items(), strict=False):
        row = int(np.flatnonzero(found.index == number)[0])
        _draw_shape(w, found.nodes[row], length, payload.mass > 0 or payload.inertia > 0, one)
        omega, hertz = (significant(float(of[row]), 7) for of in (found.natural_frequency, found.natural_frequency_hz))
        one.set_title(f"Mode {number}:  {omega} rad/s  ({hertz} Hz)", fontsize=9.5)
        is_own = bool(one.figure.get_supylabel())
        one.set(xlabel=ALONG if not is_own or number > count - 2 else "", ylabel="" if is_own else DISPLACEMENT)


def _draw_shape(w: Real, nodes: Real, length: float, has_payload: bool, ax: Axes) -> None:
    """One mode: its line, the arm at rest, hub, payload, and the nodes with their places."""
    x = np.linspace(0.0, length, w.size)
    ax.axhline(0.0, color=GREY, lw=0.8)
    ax.plot(x, w, color=BLUE, lw=1.8)
    ax.add_patch(Rectangle((-HUB_WIDTH * length, -0.25), HUB_WIDTH * length, 0.5, fc=GREY, ec="none", zorder=3))
    if has_payload:
        ax.plot(length, w[-1], "s", ms=8.0, mfc=GREY, mec="none", zorder=3)
    ax.plot(nodes, np.zeros(len(nodes)), "o", ms=5.5, mfc="white", mec=ORANGE, mew=1.3, zorder=4)
    decimals = max(0, 3 - round(math.log10(length)))
    for node in nodes:  # its place [m] at its right, on the side of the line that the curve leaves free
        rises = np.interp(node + 0.01 * length, x, w) > np.interp(node - 0.01 * length, x, w)
        if round(float(node), decimals) > 0:
            ax.annotate(
                f"{node:.{decimals}f}", (node, 0.0), textcoords="offset points", xytext=(4, -6 if rises else 6),
                va="top" if rises else "bottom", fontsize=7.5, color=ORANGE,
            )  # fmt: skip
    ax.set(xlim=(-0.085 * length, 1.11 * length), ylim=(-1.28, 1.28), yticks=[-1, 0, 1])


def draw_differences(name: str, differences: Mapping[str, Real]) -> Figure:
    """How far each simpler theory's frequencies lie above the Timoshenko theory's [%], mode by mode."""
    looks = {"euler-bernoulli": (ORANGE, "s"), "rayleigh": (PURPLE, "D"), "shear": (GREEN, "o")}
    with page(9.0, 3.6, f"{name}: simpler beam theories against the Timoshenko theory") as (figure, ax):
        for theory, values in differences.items():
            color, marker = looks[theory]
            numbers = np.arange(1, len(values) + 1)
            ax.plot(numbers, values, marker=marker, ms=5, lw=1.2, color=color, label=theory_name(theory))
        if all((values > 0).all() for values in differences.values()):
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter(FuncFormatter(lambda y, _: plain(y, 3)))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set(xlabel="mode", ylabel="frequency above Timoshenko's [%]")
        ax.legend(loc="upper left")
    return figure


def theory_name(theory: str) -> str:
    """As a person writes it: Euler-Bernoulli, Rayleigh, shear, Timoshenko."""
    names = {"timoshenko": "Timoshenko", "rayleigh": "Rayleigh", "euler-bernoulli": "Euler-Bernoulli"}
    return names.get(theory, theory)
