"""The style of all pictures (tfarm.mplstyle), whatever the user's matplotlib settings are; figures, notes and ticks.

The figure of a page does not touch pyplot: nothing global, nothing on a screen.  A picture drawn without `ax` is a
figure of pyplot, so that a notebook shows it.
"""

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, partial, wraps
from inspect import signature
from itertools import product
from pathlib import Path
from typing import Any, get_args

import matplotlib as mpl
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes as Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.backends.backend_agg import RendererAgg

# which pages name too
from matplotlib.figure import Figure as Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from tfarm.arrays import Complex
from tfarm.digits import plain
from tfarm.errors import require

INK = "#1a1a1a"
GREY = "#6b6b6b"
FAINT = "#d4d4d4"
# distinct for the colour-blind too
BLUE = "#0060a8"
ORANGE = "#c4500a"
GREEN = "#00795a"
PURPLE = "#8a3b8f"
# of several records in one picture
COLOURS = (BLUE, ORANGE, GREEN, PURPLE)
# stability, the same in every picture, page and live view; each has a mark of its own too, for grey print
STABLE = BLUE
MARGINAL = PURPLE
UNSTABLE = "#a81e2b"
# regions of a map by the number of unstable poles, 0 first: ever darker in grey; green is kept for good margins
REGIONS = ("#dcecf9", "#f9cfc0", "#f2ad9b", "#e58a76", "#d46c5a")
# grades of margins, amber before red, which is kept for what is unstable; with those of a page's dark mode in style.css
GOOD = GREEN
LOW = "#735200"
POOR = ORANGE
# patterns of lines
DASHED = (0, (4, 3))
LONG_DASHED = (0, (5, 3))
DOTTED = (0, (1, 2))

# inches at 96 pixels: half a page that is 1280 wide
HALF_WIDTH = 6.2
# largest letters inside axes of a narrow picture
SMALL_POINTS = 6.5
_place: ContextVar[str] = ContextVar("_place", default="")


def style() -> AbstractContextManager[None]:
    """Return the style of pictures, whatever the user's own settings are."""
    names = ["tfarm"]
    if _place.get() in ("column", "phone"):
        names.append(_place.get())
    files = [Path(__file__).with_name(f"{name}.mplstyle") for name in names]
    return matplotlib.style.context(["default", *files])


@contextmanager
def drawn_for(place: str) -> Iterator[None]:
    """Draw pictures for the "column" of a paper, for half a "page" or for a "phone": no letter is scaled down there."""
    before = _place.set(place)
    try:
        with style():
            yield
    finally:
        _place.reset(before)


def column() -> AbstractContextManager[None]:
    """Draw pictures for a paper: at the width of its column, with letters that suit LaTeX, without a headline.

    In this context a new figure is 3.5 inches wide, one column of an IEEE paper, or 7.16 inches, both columns, where
    axes are side by side.  Letters are STIX, of 8 points at most; a PDF embeds them as TrueType.  The caption of the
    paper takes the place of the headline.  Figures that are there already stay as they are.

    Examples
    --------
    >>> arm = tfarm.load("sasaki2012-lab")
    >>> with tfarm.plots.column():
    ...     upper, lower = tfarm.plots.bode(tfarm.bode(arm, "root_moment"))
    ...     upper.figure.savefig("bode.pdf")
    """
    return drawn_for("column")


class Measuring(FigureCanvasBase):
    """A canvas on which nothing is drawn: one renderer measures the letters of all figures, and keeps their sizes."""

    def get_renderer(self) -> RendererAgg:
        """Return the renderer of this number of dots an inch."""
        return renderer_of(self.figure.dpi)


@cache
def renderer_of(dpi: float) -> RendererAgg:
    """Return the renderer that measures letters, for which its width and height do not count."""
    return RendererAgg(1.0, 1.0, dpi)  # type: ignore[no-untyped-call]


# by the class of a record its first picture as a figure of its own
FIGURES: dict[Any, Callable[..., Figure]] = {}


def check_records(of: Sequence[tuple[Any, str]], found: Sequence[Any]) -> None:
    """Raise ParameterError where a record, or one of several in a list or by name, is not of its class."""
    for (kind, origin), value in zip(of, found, strict=False):
        values = value
        if isinstance(value, Mapping):
            values = list(value.values())
        if not isinstance(values, list | tuple):
            values = [values]
        is_right = bool(values) and all(isinstance(each, kind) for each in values)
        require(is_right, "plot", value, f"give what {origin}")


@dataclass(frozen=True)
class Drawing:
    """A function that draws records in axes, with what `picture` is given for a figure of its own."""

    draw: Callable[..., None]
    of: Sequence[tuple[Any, str]]
    title: Callable[..., str]
    size: Any
    rows: Sequence[float]
    grid: Callable[..., Any] | None

    def one_or_all(self, axes: Sequence[Axes]) -> Any:
        """Return the only axes, or all."""
        if self.grid is None and len(self.rows) == 1:
            return axes[0]
        return tuple(axes)

    def figure(self, *found: Any, new: Callable[..., Figure] = Figure, **how: Any) -> Figure:
        """Return a figure of its own, for its place."""
        # what is named counts for size, axes and headline too
        bound = signature(self.draw).bind_partial(*found, **how)
        found = bound.args
        with style():
            inches = self.size
            if callable(self.size):
                inches = self.size(*found)
            # no label clipped
            drawn = new(figsize=placed_size(inches, self.grid is not None), layout="constrained")
            if new is Figure:
                Measuring(drawn)
            upper: Sequence[Axes] = ()
            if self.grid is None:
                drawn.subplots(len(self.rows), sharex=True, height_ratios=self.rows)
                upper = drawn.axes[:-1]
            else:
                self.grid(drawn, *found)
                if _place.get() == "phone":
                    stack(drawn)
            self.draw(*found, ax=self.one_or_all(drawn.axes), **bound.kwargs)
            # the axes below have the label
            for ax in upper:
                ax.set_xlabel("")
            finish(drawn, self.title(*found))
        drawn.again = partial(self.figure, *found, **bound.kwargs)  # type: ignore[attr-defined]  # in another style
        return drawn

    def show(self, ax: Any, found: Sequence[Any], how: Mapping[str, Any]) -> Any:
        """Draw checked records in the axes given, or in a figure of pyplot; return the axes."""
        check_records(self.of, found)
        if ax is None:
            # not needed, and not loaded, for a page
            from matplotlib import pyplot

            # loads the backend here: inside a style, the mode of a notebook's would be reset
            pyplot.draw_if_interactive()  # type: ignore[no-untyped-call]
            drawn = self.figure(*found, new=pyplot.figure, **how)
            return self.one_or_all(drawn.axes)
        axes = list(np.ravel(np.asarray(ax, dtype=object)))
        needed = len(self.rows)
        remedy = f"{needed} axes, as figure.subplots({needed}) makes them"
        require(self.grid or needed == len(axes), "ax", len(axes), remedy)
        with style():
            self.draw(*found, ax=self.one_or_all(axes), **how)
        return self.one_or_all(axes)


def picture(
    *of: tuple[Any, str],
    title: Callable[..., str],
    size: Any = (7.0, 5.4),
    rows: Sequence[float] = (1.0,),
    grid: Callable[..., Any] | None = None,
) -> Callable[[Callable[..., None]], Any]:
    """Make of a function that draws records in `ax` (its axes, or a list of several) one that also makes new axes.

    It returns the axes, those given or new ones; its attribute `figure` makes a figure to be saved.

    Parameters
    ----------
    of
        Class of each record, and its origin ("tfarm.bode returns"): other objects are refused by ParameterError.  Of
        several records, in a list or by name, each is checked.  A picture of a page alone has none.
    title
        A function of the records: the headline of that figure.
    size
        Width and height [inches] of a figure of its own, or a function of the records.
    rows
        Relative heights of axes above each other; a `grid` of axes is a function of the figure and the records.
    """

    def decorate(draw: Callable[..., None]) -> Any:
        drawing = Drawing(draw, of, title, size, rows, grid)

        @wraps(draw)
        def show(*found: Any, ax: Any = None, **how: Any) -> Any:
            return drawing.show(ax, found, how)

        if len(of) == 1:
            ((kind, _),) = of
            for each in get_args(kind) or (kind,):
                FIGURES.setdefault(each, drawing.figure)
        show.figure = drawing.figure  # type: ignore[attr-defined]
        return show

    return decorate


def placed_size(inches: tuple[float, float], is_grid: bool) -> tuple[float, float]:
    """Return width and height of a picture at its place, without its legend; labels need more of a smaller height."""
    width, height = inches
    share = height / width
    # which needs both columns
    is_wide = is_grid or width > 9.5
    match _place.get():
        # one and both columns of an IEEE paper, less a line of a legend
        case "column" if is_wide:
            return 7.16, 7.16 * share
        case "column":
            return 3.5, 3.5 * share**0.4 - 0.2
        case "phone":
            return phone_size(0.36 + 0.75 * share)
        case "page" if not is_grid and width > HALF_WIDTH:
            return HALF_WIDTH, HALF_WIDTH * share**0.7 - 0.2
    return inches


def phone_size(share: float) -> tuple[float, float]:
    """Return width and height [inches at 96 pixels] of axes on a page that is 400 wide, of this share of height."""
    width = 3.83
    return width, width * share


def stack(figure: Figure) -> None:
    """Put axes that are side by side below each other, on a phone: each as wide as the picture."""
    boxes = [ax.get_position() for ax in figure.axes]
    across, up = figure.get_size_inches()
    shares = [min(0.7, box.height * up / (box.width * across)) for box in boxes]
    figure.clear()
    figure.set_figheight(sum(phone_size(share)[1] + 0.3 for share in shares))
    figure.subplots(len(shares), height_ratios=shares, squeeze=False)


def make_thin(figure: Figure) -> None:
    """Make letters that a picture made larger than those of a column, its lines and marks, fit one."""
    shrink(figure.findobj(Text), 8.0)
    for ax in figure.axes:
        shrink(ax.texts, SMALL_POINTS)
        sizes = product(ax.lines, ("linewidth", "markersize", "markeredgewidth"))
        for each, of in (*sizes, *product(ax.collections, ("linewidth",))):
            size = np.asarray(getattr(each, f"get_{of}")())
            each.set(**{of: 0.7 * size})


def shrink(texts: Iterable[Any], points: float) -> None:
    """Give larger letters this size."""
    for text in texts:
        text.set_fontsize(min(text.get_fontsize(), points))


def finish(drawn: Figure, words: str) -> None:
    """Draw legend and headline; at a place make room for the legend, short lines, and no headline if narrow."""
    place = _place.get()
    if place == "column":
        make_thin(drawn)
    if place:
        for ax in drawn.axes:
            fold_words(ax, is_alone=len(drawn.axes) == 1)
    if place == "phone":
        for ax in drawn.axes:
            for each in (ax, *ax.child_axes):
                each.minorticks_off()
            for text in ax.texts:
                text.set_fontsize(SMALL_POINTS)
    legend = legend_below(drawn)
    if place:
        drawn.set_figheight(drawn.get_figheight() + legend)
    if place in ("", "page"):
        headline = words.replace(" = ", "\u00a0=\u00a0")
        lines = fold(headline, round(11.5 * drawn.get_figwidth()))
        drawn.suptitle(safe(lines), x=0.012, ha="left", fontsize=10.5, color=INK)


def fold_words(ax: Axes, *, is_alone: bool) -> None:
    """Fold long lines of axes, and of axes that share the height the label at the left before its unit."""
    for text in (*ax.get_children(), ax.xaxis.label):
        if isinstance(text, Text):
            text.set_text(fold(text.get_text(), 46))
    label = ax.get_ylabel()
    if not is_alone and len(label) > 14:
        ax.set_ylabel(re.sub(r" +(?=\[)", "\n", label))


def legend_below(figure: Figure) -> float:
    """Draw a legend, below the axes, of all labels that no axes has in a legend of its own: its height [inches].

    It has as many columns as fit.
    """
    keys: dict[str, Any] = {}
    for ax in figure.axes:
        if ax.get_legend() is None:
            handles, labels = ax.get_legend_handles_labels()
            keys |= zip(labels, handles, strict=True)
    # two columns of a legend fit half a page
    letters = 40 if figure.get_figwidth() <= HALF_WIDTH else 100
    columns: Sequence[int] = (5, 3, 2, 1)
    if _place.get() == "phone":
        columns = columns[2:]
    for number in columns if keys else ():
        legend = figure.legend(
            keys.values(),
            [fold(label, letters) for label in keys],
            loc="outside lower left",
            ncols=number,
            fontsize=min(8.2, mpl.rcParams["legend.fontsize"]),
            handlelength=1.8,
            columnspacing=1.2,
        )
        box = legend.get_window_extent()
        # letters are a little wider or narrower in a file of other dots an inch
        if number == 1 or box.width < 0.95 * figure.bbox.width:
            return float(box.height / figure.dpi)
        legend.remove()
    return 0.0


def fold(text: str, letters: int) -> str:
    """Return a text with its lines folded where they are longer."""
    return "\n".join(textwrap.fill(line, letters) for line in text.splitlines())


def note(
    text: str,
    at: tuple[float, float],
    ax: Axes,
    room: tuple[float, float] = (0.08, 0.045),
    *,
    fontsize: float = 8.0,
    xytext: tuple[float, float] = (0, 0),
    va: str = "center",
    zorder: float = 5,
    **looks: Any,
) -> bool:
    """Write a text with a halo where the room around it, of the width and the height, is free of other notes.

    Return whether it is.
    """
    to_view = ax.transData - ax.transAxes
    notes = [each for each in ax.texts if isinstance(each, Annotation) and each.get_text()]
    others = np.reshape([to_view.transform(each.xy) for each in notes], (-1, 2))
    needed = np.array(room)
    if _place.get() == "phone":
        needed *= 1.6
    distances = abs(others - to_view.transform(at))
    is_free = bool((distances > needed).any(axis=1).all())
    if is_free:
        ax.annotate(
            text,
            at,
            xytext,
            textcoords="offset points",
            annotation_clip=False,
            path_effects=[withStroke(linewidth=3.0, foreground="white")],
            fontsize=fontsize,
            va=va,
            zorder=zorder,
            **looks,
        )
    return is_free


def by_name(records: Any, name: str = "") -> Mapping[str, Any]:
    """Return several records as they are, or one under this name."""
    return records if isinstance(records, Mapping) else {name: records}


def first_of(records: Any) -> Any:
    """Return the first of several records by name, or the only one."""
    return next(iter(by_name(records).values()))


def plot_complex(z: Complex, ax: Axes, *marks: str, **looks: Any) -> list[Line2D]:
    """Draw complex numbers as a curve, Im over Re."""
    return ax.plot(z.real, z.imag, *marks, **looks)


def key_line(label: str, ax: Axes, **looks: Any) -> None:
    """Give the legend one line for several."""
    ax.plot([], [], label=label, **looks)


def key_area(label: str, ax: Axes, **looks: Any) -> None:
    """Give the legend one area for several."""
    ax.fill_between([], [], [], label=label, **looks)


def zero_line(ax: Axes, lw: float = 0.6, **looks: Any) -> None:
    """Draw the level line at 0."""
    ax.axhline(0.0, color=GREY, lw=lw, **looks)


def safe(text: str) -> str:
    """Return a name that a person gave as a picture shows it: a dollar begins no formula."""
    return text.replace("$", r"\$")


def plain_ticks(axis: Axis, digits: int = 3, *, is_dense: bool = False) -> None:
    """Write numbers at the major ticks without powers of ten, none at the minor ones.

    On a logarithmic axis these are powers of ten, or, of few decades, 1, 2 and 5 of each: `is_dense`.
    """
    if axis.get_scale() == "log":
        subs = (1.0, 2.0, 5.0) if is_dense else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, digits)))
    axis.set_minor_formatter(NullFormatter())


def few_ticks(axis: Axis) -> None:
    """Write plain numbers at four ticks, as on small axes."""
    axis.set_major_locator(MaxNLocator(4))
    plain_ticks(axis)
