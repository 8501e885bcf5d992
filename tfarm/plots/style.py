"""What all pictures share: one style, whatever the user's own matplotlib settings are, and figures to draw on.

A page's figure (`blank`) knows nothing of pyplot: nothing global, nothing on a screen.  One that is asked for without
`ax` (`window`) is pyplot's, so that a notebook shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import UnionType

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Figure  # which pages name too
from matplotlib.lines import Line2D

from tfarm.errors import ParameterError

INK, GREY, FAINT = "#1a1a1a", "#6b6b6b", "#d4d4d4"
BLUE, ORANGE, GREEN, PURPLE = "#0060a8", "#c4500a", "#00795a", "#8a3b8f"  # told apart by the colour-blind too

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "mathtext.fontset": "dejavusans",
    "axes.labelsize": 10.0,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.formatter.useoffset": False,  # ticks are read as they stand, with no "+3.322e4" to add
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "lines.linewidth": 1.5,
    "legend.fontsize": 9.0,
    "legend.frameon": False,
    "savefig.facecolor": "white",
    "svg.hashsalt": "tfarm",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "path.simplify": True,  # where a line strays less than a ninth of a pixel
}

WIDEST_LEGEND = 0.95  # of a figure's width: letters are a little wider or narrower in a file of other dots an inch
Keys = tuple[list[Line2D], list[str]]  # of a legend
New = Callable[[float, float], Figure]  # how a figure of that width and height [inches] is made


@contextmanager
def style() -> Iterator[None]:
    """The house style, whatever the user's own matplotlib settings are."""
    with matplotlib.style.context(["default", STYLE]):
        yield


def must_be(kind: type | UnionType, value: object, wanted: str) -> None:
    """Raise ParameterError for what is no record of that kind, saying which is `wanted`: "tfarm.bode returns"."""
    if not isinstance(value, kind):
        raise ParameterError(key="plot", value=value, remedy=f"give what {wanted}")


def blank(width: float, height: float) -> Figure:
    """An empty figure of that size [inches], its parts laid out so that no label is clipped."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08)  # type: ignore[union-attr, call-arg]
    return figure


def window(width: float, height: float) -> Figure:
    """The same as a figure of pyplot's, which a notebook or `pyplot.show` shows."""
    from matplotlib import pyplot  # not needed, and not loaded, for a page

    return pyplot.figure(figsize=(width, height), layout="constrained")


def on_own_figure(
    draw: Callable[[Axes], object], size: tuple[float, float], title: str, keys: Keys | None = None, new: New = blank
) -> Figure:
    """A picture in a figure of its own, of that size [inches], its axes the first; a legend of `keys` or labels."""
    with style():
        figure = new(*size)
        draw(figure.subplots())
        if keys is not None or any(ax.get_legend_handles_labels()[0] for ax in figure.axes):
            figure.legend(*(keys or ()), loc="outside lower left", ncols=2, fontsize=8.5)
        headline(figure, title)
    return figure


def legend_below(figure: Figure) -> None:
    """A legend of all labels below the axes, in as many columns, up to three, as fit into the figure."""
    for number in (3, 2, 1):
        legend = figure.legend(
            loc="outside lower left", ncols=number, fontsize=8.2, handlelength=1.8, columnspacing=1.2
        )
        width = legend.get_window_extent(figure.canvas.get_renderer()).width  # type: ignore[attr-defined]
        if number == 1 or width < WIDEST_LEGEND * figure.bbox.width:
            return
        legend.remove()


def taken(ax: Sequence[Axes], number: int) -> list[Axes]:
    """The axes given, in any shape that `subplots` returns.  Raises ParameterError where they are not so many."""
    axes = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(axes) != number:
        raise ParameterError(
            key="ax", value=len(axes), remedy=f"{number} axes, as figure.subplots({number}) makes them"
        )
    return axes


def headline(figure: Figure, text: str) -> None:
    """One line above everything, at the left."""
    figure.suptitle(safe(text), x=0.012, ha="left", fontsize=10.5, color=INK)


def safe(text: str) -> str:
    """A name that a person gave as a picture shows it: a dollar begins no formula."""
    return text.replace("$", r"\$")
