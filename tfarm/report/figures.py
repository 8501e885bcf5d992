"""What all pictures share: one style, one way to save.  No pyplot: nothing global, nothing on a screen.

The same figure gives the same bytes on every run: fixed fonts, a fixed salt for SVG's ids and no dates.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tfarm.columns import Table

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
    "path.simplify": False,
}
FORMATS = ("svg", "png", "pdf")
METADATA: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None, "Creator": "tfarm"},
    "png": {"Software": "tfarm"},
    "pdf": {"CreationDate": None, "Creator": "tfarm", "Producer": None},
}
DOTS_PER_INCH = 160


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A finished figure with its words.  `stem` names its files; `data` are the numbers that it draws."""

    stem: str
    title: str
    caption: str
    alt: str
    figure: Figure
    data: Table | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height on the page [CSS pixels], at 96 an inch."""
        width, height = self.figure.get_size_inches() * 96
        return round(width), round(height)


@contextmanager
def style() -> Iterator[None]:
    """The house style, whatever the user's own matplotlib settings are."""
    with matplotlib.style.context(["default", STYLE]):
        yield


def blank(width: float, height: float) -> Figure:
    """An empty figure of that size [inches], its parts laid out so that no label is clipped."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08)  # type: ignore[union-attr, call-arg]
    return figure


def headline(figure: Figure, text: str) -> None:
    """One line above everything, at the left."""
    figure.suptitle(text.replace("$", r"\$"), x=0.012, ha="left", fontsize=10.5, color=INK)


def figure_of(ax: Axes) -> Figure:
    """The figure that an axes belongs to."""
    figure = ax.get_figure()
    assert isinstance(figure, Figure)
    return figure


def save(figure: Figure, folder: Path, stem: str, formats: tuple[str, ...] = FORMATS, dpi: int = DOTS_PER_INCH) -> None:
    """The figure as folder/stem.svg, .png and .pdf."""
    with style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # an arm's name may hold any letter
        figure.draw_without_rendering()  # lays it out; once is enough for all formats
        figure.set_layout_engine(None)
        _settle(figure)
        for kind in formats:
            figure.savefig(folder / f"{stem}.{kind}", format=kind, dpi=dpi, metadata=METADATA[kind])


def _settle(figure: Figure) -> None:
    """Axes at ten digits: the layout's solver orders by address, so its last bit differs from run to run."""
    for ax in figure.axes:
        left, bottom, width, height = (round(float(x), 10) for x in ax.get_position(original=True).bounds)
        ax.set_position((left, bottom, width, height))
