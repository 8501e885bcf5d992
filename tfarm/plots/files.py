"""Pictures as files.  The same figure gives the same bytes on every run: fixed fonts, a fixed salt, no dates."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib.figure import Figure

from tfarm.files import write_file

from .style import style

FORMATS = ("svg", "png", "pdf")
METADATA: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None, "Creator": "tfarm"},
    "png": {"Software": "tfarm"},
    "pdf": {"CreationDate": None, "Creator": "tfarm", "Producer": None},
}
DOTS_PER_INCH = 160


def save(figure: Figure, folder: Path, stem: str, formats: tuple[str, ...] = FORMATS, dpi: int = DOTS_PER_INCH) -> None:
    """The figure as folder/stem.svg, .png and .pdf."""
    with _laid_out(figure):
        for kind in formats:
            figure.savefig(folder / f"{stem}.{kind}", format=kind, dpi=dpi, metadata=METADATA[kind])


def save_png(figure: Figure, path: Path, *, key: str = "--png") -> None:
    """The figure as one PNG file, written beside and renamed.  Raises ParameterError, naming `key`, where it cannot."""
    picture = io.BytesIO()
    with _laid_out(figure):
        figure.savefig(picture, format="png", dpi=DOTS_PER_INCH, metadata=METADATA["png"])
    write_file(path, picture.getvalue(), key=key)


@contextmanager
def _laid_out(figure: Figure) -> Iterator[None]:
    """The figure with its layout made once for all formats, in the house style."""
    with style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # an arm's name may hold any letter
        if (layout := figure.get_layout_engine()) is not None:
            layout.execute(figure)
            figure.set_layout_engine(None)
        _settle(figure)
        yield


def _settle(figure: Figure) -> None:
    """Axes at ten digits: the layout's solver orders by address, so its last bit differs from run to run."""
    for ax in figure.axes:
        left, bottom, width, height = (round(float(x), 10) for x in ax.get_position(original=True).bounds)
        ax.set_position((left, bottom, width, height))
