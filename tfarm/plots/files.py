"""Pictures as files.  The same figure gives the same bytes on every run: fixed fonts, a fixed salt, no dates."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib.figure import Figure

from tfarm.files import write_file

from .style import style

METADATA: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None, "Creator": "tfarm"},
    "png": {"Software": "tfarm"},
}
PICTURE_DOTS = 160  # an inch, of a PNG: lines of 0.6 points are more than a pixel wide
DRAWN = 2  # decimals of a point (1/72 inch) in an SVG: a 60th of a pixel, where matplotlib writes six


def save_figure(figure: Figure, folder: Path, stem: str, formats: tuple[str, ...], dpi: int = PICTURE_DOTS) -> None:
    """The figure as folder/stem.svg and .png, or as one of these."""
    with _laid_out(figure):
        for kind in formats:
            content = _written(figure, kind, dpi)
            (folder / f"{stem}.{kind}").write_bytes(_shorter(content) if kind == "svg" else content)


def _shorter(svg: bytes) -> bytes:
    """The drawing with the coordinates of paths and marks at so many decimals, and no space where none is needed."""

    def decimals(number: re.Match[bytes]) -> bytes:
        return f"{float(number[0]):.{DRAWN}f}".rstrip("0").rstrip(".").encode()

    def rounded(found: re.Match[bytes]) -> bytes:
        return re.sub(rb"-?\d+\.\d{4,}", decimals, found[0])

    def path(found: re.Match[bytes]) -> bytes:
        return re.sub(rb"\s*([MLQCz])\s*", rb"\1", rounded(found))

    return re.sub(rb'(?<= d=")M[^"]*', path, re.sub(rb'<use xlink:href="[^"]*" x="[^"]*" y="[^"]*"', rounded, svg))


def save_png(figure: Figure, path: Path) -> None:
    """The figure as one PNG file, written beside and renamed.  Raises ParameterError, naming --png, where it cannot."""
    with _laid_out(figure):
        write_file(path, _written(figure, "png", PICTURE_DOTS), key="--png")


def _written(figure: Figure, kind: str, dpi: int) -> bytes:
    picture = io.BytesIO()
    figure.savefig(picture, format=kind, dpi=dpi, metadata=METADATA[kind])
    return picture.getvalue()


@contextmanager
def _laid_out(figure: Figure) -> Iterator[None]:
    """The figure with its layout made once for all formats, in the house style."""
    with style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # an arm's name may hold any letter
        if (layout := figure.get_layout_engine()) is not None:
            layout.execute(figure)
            figure.set_layout_engine(None)
        for ax in figure.axes:  # at ten digits: the layout's solver orders by address, so its last bit differs
            left, bottom, width, height = (round(float(x), 10) for x in ax.get_position(original=True).bounds)
            ax.set_position((left, bottom, width, height))
        yield
