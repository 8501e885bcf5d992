"""Files of figures: the same figure gives the same bytes on every run, by fixed fonts, a fixed salt and no dates."""

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from itertools import count, product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.transforms import Bbox

from tfarm.files import write_file
from tfarm.plots.style import Axes, Figure, column, style


def save_figure(figure: Figure, file: Path, dpi: int = 160) -> None:
    """Write a figure to a file of the kind that its name ends in; `dpi` are dots an inch of a PNG."""
    file.write_bytes(content_of(figure, file.suffix.removeprefix("."), dpi))


def save_picture(draw: Callable[[Any], Figure], record: Any, path: Path) -> None:
    """Write the picture of a record as one file, whole: an SVG or a PDF for a column, else a PNG.

    Raises ParameterError, naming --figure, where it cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".") or "png"
    with nullcontext() if kind == "png" else column():
        content = content_of(draw(record), kind)
    write_file(path, content, key="--figure")


def content_of(figure: Figure, kind: str, dpi: int = 160) -> bytes:
    """Return the file of a figure.

    In an SVG coordinates have two decimals of a point, a 60th of a pixel, where matplotlib writes six.  In a PNG of
    160 dots an inch lines of 0.6 points are more than a pixel wide.
    """
    metadata: dict[str, dict[str, str | None]] = {
        "svg": {"Date": None, "Creator": "tfarm"},
        "png": {"Software": "tfarm"},
        "pdf": {"Creator": "tfarm", "Producer": None, "CreationDate": None},
    }
    content = io.BytesIO()
    with style(), warnings.catch_warnings():
        # an arm's name may hold any letter
        warnings.filterwarnings("ignore", "Glyph .* missing")
        fix_layout(figure)
        with ticks_kept(figure.axes):
            figure.savefig(content, format=kind, dpi=dpi, metadata=metadata[kind])
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


def fix_layout(figure: Figure) -> None:
    """Make the layout of a figure once, for all that is drawn of it."""
    layout = figure.get_layout_engine()
    if layout is not None:
        for ax in figure.axes:
            measure_once(ax)
        layout.execute(figure)
        figure.set_layout_engine(None)
    # at ten digits: the layout's solver orders by address, so its last bit differs
    for ax in figure.axes:
        bounds = np.round(ax.get_position(original=True).bounds, 10)
        ax.set_position(tuple(bounds.tolist()))


def measure_once(ax: Axes) -> None:
    """Guess the room of ticks and labels around axes in the first of two rounds of a layout, and measure in the second.

    Both would measure; the first has to be near enough for the ticks of the second to be those that are drawn.  Axes of
    a shape of their own are measured in both.
    """
    place = ax.get_subplotspec()
    rounds = count(start=int(ax.get_aspect() != "auto"))

    def box(*how: Any, **more: Any) -> Any:
        if place is None or next(rounds):
            with ticks_kept([ax]):
                return type(ax).get_tightbbox(ax, *how, **more)
        # inches
        below = 0.5 if place.is_last_row() else 0.05
        guess = [-0.65, -below, 0.1, 0.25]
        inner = ax.get_position(original=True).transformed(ax.figure.transSubfigure)
        return Bbox.from_extents(*(inner.extents + ax.figure.dpi * np.array(guess)))

    ax.get_tightbbox = box  # type: ignore[method-assign]


@contextmanager
def ticks_kept(axes: Sequence[Axes]) -> Iterator[None]:
    """Find the ticks of axes and the room of their labels once, while limits and places stay as they are.

    matplotlib finds them anew for each spine, label and title, ten times in a drawing.
    """
    both: list[Any] = []
    for ax in axes:
        for each in (ax, *ax.child_axes):
            both += [each.xaxis, each.yaxis]
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
    """Return the same call, which returns its first result whatever its arguments are later."""
    found: list[Any] = []

    def first_result(*given: Any) -> Any:
        if not found:
            found.append(call(*given))
        return found[0]

    return first_result
