"""The style of all pictures (tfarm.mplstyle), whatever the user's matplotlib settings are; figures, and files.

The figure of a page does not touch pyplot: nothing global, nothing on a screen.  A picture drawn without `ax` is a
figure of pyplot, so that a notebook shows it.  The same figure gives the same bytes on every run: fixed fonts, a fixed
salt, no dates.
"""

import io
import re
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, partial, wraps
from inspect import signature
from itertools import count, product
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
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from tfarm.arm import GAINS, LISTED, Arm, Law, shown_unit
from tfarm.arm.law import NUMBER
from tfarm.digits import plain
from tfarm.errors import require
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.files import write_file
from tfarm.loop.varied import ARM_PARAMETERS

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
# of numbers that vary
OTHER_UNITS = ARM_PARAMETERS | {"delay": "s"}

METADATA: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None, "Creator": "tfarm"},
    "png": {"Software": "tfarm"},
    "pdf": {"Creator": "tfarm", "Producer": None, "CreationDate": None},
}
# an inch, of a PNG: lines of 0.6 points are more than a pixel wide
PICTURE_DOTS = 160
# inches at 96 pixels: half a page that is 1280 wide, and one that is 400
HALF_WIDTH = 6.2
PHONE_WIDTH = 3.83
# largest letters inside axes
SMALL_POINTS = 6.5
_place: ContextVar[str] = ContextVar("_place", default="")


def style() -> AbstractContextManager[None]:
    """The style of pictures, whatever the user's own settings are."""
    names = ("tfarm", _place.get()) if _place.get() in ("column", "phone") else ("tfarm",)
    return matplotlib.style.context(
        ["default", *(Path(__file__).with_name(f"{name}.mplstyle") for name in names)]
    )


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
        values = list(value.values()) if isinstance(value, Mapping) else value
        values = values if isinstance(values, list | tuple) else [values]
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
        return axes[0] if self.grid is None and len(self.rows) == 1 else tuple(axes)

    def figure(self, *found: Any, new: Callable[..., Figure] = Figure, **how: Any) -> Figure:
        """Return a figure of its own, for its place."""
        # what is named counts for size, axes and headline too
        bound = signature(self.draw).bind_partial(*found, **how)
        found = bound.args
        with style():
            inches = self.size(*found) if callable(self.size) else self.size
            # no label clipped
            drawn = new(figsize=placed_size(inches, self.grid is not None), layout="constrained")
            if new is Figure:
                Measuring(drawn)
            if self.grid is None:
                drawn.subplots(len(self.rows), sharex=True, height_ratios=self.rows)
            else:
                self.grid(drawn, *found)
                if _place.get() == "phone":
                    stack(drawn)
            self.draw(*found, ax=self.one_or_all(drawn.axes), **bound.kwargs)
            for ax in drawn.axes[: len(self.rows) - 1] if self.grid is None else []:
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
            return self.one_or_all(self.figure(*found, new=pyplot.figure, **how).axes)
        axes = list(np.ravel(np.asarray(ax, dtype=object)))
        remedy = "{0} axes, as figure.subplots({0}) makes them".format(len(self.rows))
        require(self.grid or len(self.rows) == len(axes), "ax", len(axes), remedy)
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

    def decorated(draw: Callable[..., None]) -> Any:
        drawing = Drawing(draw, of, title, size, rows, grid)

        @wraps(draw)
        def shown(*found: Any, ax: Any = None, **how: Any) -> Any:
            return drawing.show(ax, found, how)

        for kind in get_args(of[0][0]) or (of[0][0],) if len(of) == 1 else ():
            FIGURES.setdefault(kind, drawing.figure)
        shown.figure = drawing.figure  # type: ignore[attr-defined]
        return shown

    return decorated


def placed_size(inches: tuple[float, float], is_grid: bool) -> tuple[float, float]:
    """Width and height of a picture at its place, there without its legend; labels need more of a smaller height."""
    share = inches[1] / inches[0]
    # which needs both columns
    is_wide = is_grid or inches[0] > 9.5
    match _place.get():
        # one and both columns of an IEEE paper, less a line of a legend
        case "column" if is_wide:
            return 7.16, 7.16 * share
        case "column":
            return 3.5, 3.5 * share**0.4 - 0.2
        case "phone":
            return PHONE_WIDTH, PHONE_WIDTH * (0.36 + 0.75 * share)
        case "page" if not is_grid and inches[0] > HALF_WIDTH:
            return HALF_WIDTH, HALF_WIDTH * share**0.7 - 0.2
    return inches


def stack(figure: Figure) -> None:
    """Put axes that are side by side below each other, on a phone: each as wide as the picture."""
    boxes = [ax.get_position() for ax in figure.axes]
    shares = [
        min(0.7, box.height * figure.get_figheight() / (box.width * figure.get_figwidth())) for box in boxes
    ]
    figure.clear()
    figure.set_figheight(sum(PHONE_WIDTH * share + 0.3 for share in shares))
    figure.subplots(len(shares), height_ratios=shares, squeeze=False)


def make_thin(figure: Figure) -> None:
    """Letters that a picture made larger than those of a column, its lines and marks, made to fit one."""
    inside = [text for ax in figure.axes for text in ax.texts]
    for text in (each for each in figure.findobj() if isinstance(each, Text)):
        text.set_fontsize(min(text.get_fontsize(), SMALL_POINTS if text in inside else 8.0))
    for ax in figure.axes:
        sizes = product(ax.lines, ("linewidth", "markersize", "markeredgewidth"))
        for each, of in (*sizes, *product(ax.collections, ("linewidth",))):
            each.set(**{of: 0.7 * np.asarray(getattr(each, f"get_{of}")())})


def finish(drawn: Figure, words: str) -> None:
    """Legend and headline; at a place room for the legend and short lines of letters, and no headline if narrow."""
    place = _place.get()
    if place == "column":
        make_thin(drawn)
    for ax in drawn.axes if place else ():
        for text in (each for each in (*ax.get_children(), ax.xaxis.label) if isinstance(each, Text)):
            text.set_text(folded(text.get_text(), 46))
        # axes that share the height
        if len(drawn.axes) > 1 and len(label := ax.get_ylabel()) > 14:
            ax.set_ylabel(re.sub(r" +(?=\[)", "\n", label))
    for ax in drawn.axes if place == "phone" else ():
        for each in (ax, *ax.child_axes):
            each.minorticks_off()
        for text in ax.texts:
            text.set_fontsize(SMALL_POINTS)
    legend = legend_below(drawn)
    drawn.set_figheight(drawn.get_figheight() + legend * bool(place))
    if place in ("", "page"):
        lines = folded(words.replace(" = ", "\u00a0=\u00a0"), round(11.5 * drawn.get_figwidth()))
        drawn.suptitle(safe(lines), x=0.012, ha="left", fontsize=10.5, color=INK)


def legend_below(figure: Figure) -> float:
    """A legend, below the axes, of all labels that no axes has in a legend of its own: its height [inches].

    It has as many columns as fit.
    """
    each = (ax.get_legend_handles_labels() for ax in figure.axes if ax.get_legend() is None)
    keys = {label: handle for own in each for handle, label in zip(*own, strict=True)}
    # two columns of a legend fit half a page
    labels = [folded(label, 40 if figure.get_figwidth() <= HALF_WIDTH else 100) for label in keys]
    for number in (5, 3, 2, 1)[2 * (_place.get() == "phone") :] if keys else ():
        legend = figure.legend(
            keys.values(),
            labels,
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


def folded(text: str, letters: int) -> str:
    """A text with its lines folded where they are longer."""
    return "\n".join(textwrap.fill(line, letters) for line in text.splitlines())


def note(
    text: str, at: tuple[float, float], ax: Axes, room: tuple[float, float] = (0.08, 0.045), **looks: Any
) -> bool:
    """Write a text with a halo where the room around it, of the width and the height, is free of other notes.

    Return whether it is.
    """
    to_view = ax.transData - ax.transAxes
    others = [
        to_view.transform(each.xy) for each in ax.texts if isinstance(each, Annotation) and each.get_text()
    ]
    needed = np.multiply(1.6 if _place.get() == "phone" else 1.0, room)
    is_free = bool((abs(np.reshape(others, (-1, 2)) - to_view.transform(at)) > needed).any(axis=1).all())
    if is_free:
        own: Any = {
            "fontsize": 8.0,
            "textcoords": "offset points",
            "xytext": (0, 0),
            "va": "center",
            "zorder": 5,
        }
        halo = [withStroke(linewidth=3.0, foreground="white")]
        ax.annotate(text, at, annotation_clip=False, path_effects=halo, **own | looks)
    return is_free


def by_name(records: Any, name: str = "") -> Mapping[str, Any]:
    """Several records as they are, or one under this name."""
    return records if isinstance(records, Mapping) else {name: records}


def safe(text: str) -> str:
    """A name that a person gave as a picture shows it: a dollar begins no formula."""
    return text.replace("$", r"\$")


def plain_ticks(axis: Axis, digits: int = 3, subs: Sequence[float] = (1.0,)) -> None:
    """Numbers at the major ticks without powers of ten, none at the minor ones; `subs` of each decade on a log axis."""
    if axis.get_scale() == "log":
        axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, digits)))
    axis.set_minor_formatter(NullFormatter())


def law_words(law: Law) -> str:
    """A controller by its name, where it has one of its own."""
    # which is that of one without a name
    return "the controller" if law.name == "law" else law.name


def gains_words(law: Law, digits: int = 4, but: str = "") -> str:
    """Each gain with its value, for reading; `but` names one that varies and is left out.  Another law by its name."""
    gains = law.gains
    if gains is None:
        return f"{law_words(law)}, of {', '.join(law.signals)}"
    # beyond the paper's law
    named = [gain.name for gain in LISTED if gains[gain.name] or gain.output != "hub_angle"]
    return ", ".join(f"{name} = {plain(gains[name], digits)}" for name in named if name != but)


def number_label(name: str, arm: Arm, law: Law) -> str:
    """A number of a controller or of the arm with its SI unit, for an axis.

    The coefficient of s^k in the denominator counts as s^k, in the numerator as the unit of a gain times s^k.
    """
    for gain in GAINS:
        if gain.name == name:
            return f"{name}, gain on the {signal_words(gain.output)[0]} [{shown_unit(name, arm) or '−'}]"
    if name in OTHER_UNITS:
        return f"{name.replace('_', ' ')} [{OTHER_UNITS[name]}]"
    signal, of, place = NUMBER.fullmatch(name).groups("")  # type: ignore[union-attr]
    if not place and signal not in law.part_gains:
        return f"{name}, factor on the {'controller' if signal in ('gain', 'all') else signal_words(signal)[0]} [−]"
    (block,) = (part.block for part in law.parts if part.signals == (signal,))
    power = len(getattr(block, of)) - 1 - int(place) if place and not law.is_discrete else 0
    unit = "" if of == "den" else unit_over(arm.input_unit, signal_words(signal)[1])
    time = {0: "", 1: "s"}.get(power, f"s^{power}")
    return f"{name} [{f'({unit}) {time}' if unit and time else unit or time or '−'}]"


def name_axes(vary: Sequence[str], arm: Arm, law: Law, ax: Axes) -> None:
    """Along the axes of a plane of two numbers: their names and units."""
    across, up = (safe(number_label(name, arm, law)) for name in vary)
    ax.set(xlabel=across, ylabel=up)


# ------------------------------------------------------------ files


def save_figure(figure: Figure, file: Path, dpi: int = PICTURE_DOTS) -> None:
    """Write a figure to a file of the kind that its name ends in."""
    file.write_bytes(content_of(figure, file.suffix.removeprefix("."), dpi))


def save_picture(draw: Callable[[Any], Figure], record: Any, path: Path) -> None:
    """Write the picture of a record as one file, whole: an SVG or a PDF for a column, else a PNG.

    Raises ParameterError, naming --figure, where it cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".") or "png"
    with nullcontext() if kind == "png" else column():
        content = content_of(draw(record), kind)
    write_file(path, content, key="--figure")


def content_of(figure: Figure, kind: str, dpi: int = PICTURE_DOTS) -> bytes:
    """Return the file of a figure.

    In an SVG coordinates have two decimals of a point, a 60th of a pixel, where matplotlib writes six.
    """
    content = io.BytesIO()
    with style(), warnings.catch_warnings():
        # an arm's name may hold any letter
        warnings.filterwarnings("ignore", "Glyph .* missing")
        settled(figure)
        with ticks_kept(figure.axes):
            figure.savefig(content, format=kind, dpi=dpi, metadata=METADATA[kind])
    drawn = content.getvalue()
    if kind != "svg":
        return drawn
    # with its colours on a dark page
    dark = Path(__file__).with_name("dark.svg").read_bytes()
    return re.sub(rb'(?<= [dxy]=")[^"]+', _short, drawn).replace(b"<defs>", dark, 1)


def _short(part: re.Match[bytes]) -> bytes:
    """Return two decimals, and no space around the letters of a path."""
    short = re.sub(rb"-?\d+\.\d{3,}", lambda number: b"%.2f" % float(number[0]), part[0])
    return re.sub(rb"\s*([MLQCz])\s*", rb"\1", short)


def settled(figure: Figure) -> None:
    """Make the layout of a figure once, for all that is drawn of it."""
    if (layout := figure.get_layout_engine()) is not None:
        for ax in figure.axes:
            measure_once(ax)
        layout.execute(figure)
        figure.set_layout_engine(None)
    # at ten digits: the layout's solver orders by address, so its last bit differs
    for ax in figure.axes:
        ax.set_position(tuple(np.round(ax.get_position(original=True).bounds, 10).tolist()))


def measure_once(ax: Axes) -> None:
    """Guess the room of ticks and labels around axes in the first of two rounds of a layout, and measure in the second.

    Both would measure; the first has to be near enough for the ticks of the second to be those that are drawn.  Axes of
    a shape of their own are measured in both.
    """
    place = ax.get_subplotspec()
    rounds = count(start=int(ax.get_aspect() != "auto"))

    def around(*how: Any, **more: Any) -> Any:
        if place is None or next(rounds):
            with ticks_kept([ax]):
                return type(ax).get_tightbbox(ax, *how, **more)
        # inches
        guess = [-0.65, -0.5 if place.is_last_row() else -0.05, 0.1, 0.25]
        inner = ax.get_position(original=True).transformed(ax.figure.transSubfigure)
        return Bbox.from_extents(*(inner.extents + ax.figure.dpi * np.array(guess)))

    ax.get_tightbbox = around  # type: ignore[method-assign]


@contextmanager
def ticks_kept(axes: Sequence[Axes]) -> Iterator[None]:
    """Find the ticks of axes and the room of their labels once, while limits and places stay as they are.

    matplotlib finds them anew for each spine, label and title, ten times in a drawing.
    """
    both = [axis for ax in axes for each in (ax, *ax.child_axes) for axis in (each.xaxis, each.yaxis)]
    # names of matplotlib's own
    kept = [*product(both, ("_update_ticks", "_get_ticklabel_bboxes"))]
    for axis, name in kept:
        setattr(axis, name, once(getattr(axis, name)))
    try:
        yield
    finally:
        for axis, name in kept:
            delattr(axis, name)


def once(call: Callable[..., Any]) -> Callable[..., Any]:
    """The same call, which returns its first result whatever it is given later."""
    found: list[Any] = []

    def kept(*given: Any) -> Any:
        if not found:
            found.append(call(*given))
        return found[0]

    return kept
