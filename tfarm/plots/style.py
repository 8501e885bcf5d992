"""What all pictures share: one style, whatever the user's own matplotlib settings are, and figures to draw on.

A page's figure (`blank`) knows nothing of pyplot: nothing global, nothing on a screen.  One that is asked for without
`ax` (`window`) is pyplot's, so that a notebook shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from typing import Any, Protocol, cast

import matplotlib.style
import numpy as np
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


def must_be(kind: Any, value: object, wanted: str) -> None:
    """Raise ParameterError for what is no record of that kind, or several, saying which is `wanted`."""
    values = list(value.values()) if isinstance(value, Mapping) else value
    for each in (values or [None]) if isinstance(values, list | tuple) else [values]:
        if not isinstance(each, kind):
            raise ParameterError(key="plot", value=each, remedy=f"give what {wanted}")


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


@contextmanager
def page(width: float, height: float, title: str, **grid: Any) -> Iterator[tuple[Figure, Any]]:
    """A figure of that size [inches] with axes as `subplots` makes them of `grid`, to draw on; then its headline."""
    with style():
        figure = blank(width, height)
        yield figure, figure.subplot_mosaic(**grid) if "mosaic" in grid else figure.subplots(**grid)
        headline(figure, title)


class Drawing(Protocol):
    """A picture of a record: in the axes given, which it returns, or in new ones; `figure` makes one to be saved."""

    figure: Callable[..., Figure]

    def __call__(self, *found: Any, ax: Any = None, **how: Any) -> Any:
        """Draw it."""


FIGURES: dict[Any, Callable[..., Figure]] = {}  # by the kind of a record what draws it on a figure of its own


def picture(
    *of: tuple[Any, str], size: Any = (7.0, 5.4), title: Callable[..., str], rows: Sequence[float] = (1.0,),
    grid: Callable[..., Any] | None = None, keys: bool = False,
) -> Callable[[Callable[..., Keys | None]], Drawing]:  # fmt: skip
    """Make of a function that draws records in `ax` (its axes, or a list of several) a `Drawing`.

    Parameters
    ----------
    of
        Kind of each record, and what returns one ("tfarm.bode returns"): others are refused by ParameterError.
    size
        Width and height [inches] of a figure of its own, or a function of the records.
    title
        A function of the records: the headline of that figure.
    rows
        Relative heights of axes above each other; a `grid` of axes is a function of the figure and the records.
    keys
        Whether that figure has a legend: of all labels, or of what the function returns.
    """

    def decorated(draw: Callable[..., Keys | None]) -> Drawing:
        is_one = grid is None and len(rows) == 1

        def figure(*found: Any, new: New = blank, **how: Any) -> Figure:
            with style():
                drawn = new(*(size(*found) if callable(size) else size))
                if grid is None:
                    drawn.subplots(len(rows), 1, sharex=True, height_ratios=rows)
                else:
                    grid(drawn, *found)
                told = draw(*found, ax=drawn.axes[0] if is_one else drawn.axes, **how)
                for ax in drawn.axes[:-1] if grid is None else []:
                    ax.set_xlabel("")
                if told or (keys and any(ax.get_legend_handles_labels()[0] for ax in drawn.axes)):
                    legend_below(drawn, told)
                headline(drawn, title(*found))
            return drawn

        @wraps(draw)
        def shown(*found: Any, ax: Any = None, **how: Any) -> Any:
            for (kind, wanted), value in zip(of, found, strict=False):
                must_be(kind, value, wanted)
            if ax is None:
                axes = figure(*found, new=window, **how).axes
                return axes[0] if is_one else tuple(axes)
            axes = list(np.ravel(np.asarray(ax, dtype=object)))
            if grid is None and len(axes) != len(rows):
                remedy = f"{len(rows)} axes, as figure.subplots({len(rows)}) makes them"
                raise ParameterError(key="ax", value=len(axes), remedy=remedy)
            with style():
                draw(*found, ax=axes[0] if is_one else axes, **how)
            return axes[0] if is_one else tuple(axes)

        if len(of) == 1:
            FIGURES[of[0][0]] = figure
        shown.figure = figure  # type: ignore[attr-defined]
        return cast("Drawing", shown)

    return decorated


def legend_below(figure: Figure, keys: Keys | None = None) -> None:
    """A legend of all labels, or of `keys`, below the axes, in as many columns, up to five, as fit into the figure."""
    for number in (5, 3, 2, 1):
        legend = figure.legend(
            *(keys or ()), loc="outside lower left", ncols=number, fontsize=8.2, handlelength=1.8, columnspacing=1.2
        )
        width = legend.get_window_extent().width
        if number == 1 or width < WIDEST_LEGEND * figure.bbox.width:
            return
        legend.remove()


def headline(figure: Figure, text: str) -> None:
    """One line above everything, at the left."""
    figure.suptitle(safe(text), x=0.012, ha="left", fontsize=10.5, color=INK)


def safe(text: str) -> str:
    """A name that a person gave as a picture shows it: a dollar begins no formula."""
    return text.replace("$", r"\$")
