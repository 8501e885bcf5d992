"""The picture of a record as a command writes it into a file: on a figure of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

from tfarm.comparing import Comparison
from tfarm.fitting.fit import Fit
from tfarm.fitting.overlay import Overlay
from tfarm.loop.law_locus import LawLocus
from tfarm.loop.law_map import LawMap
from tfarm.loop.locus import Locus
from tfarm.loop.nyquist import Nyquist
from tfarm.loop.regions import Region
from tfarm.response.frequency import Bode

from .compared import draw_comparison
from .disc import draw_disc
from .fitted import draw_fit
from .frequency import draw_bode
from .laws import draw_law_map, draw_locus_of
from .overlaid import draw_measured
from .plane import draw_map

PICTURES: dict[type, Callable[..., Figure]] = {
    Bode: draw_bode,
    Comparison: draw_comparison,
    Fit: draw_fit,
    LawLocus: draw_locus_of,
    LawMap: draw_law_map,
    Locus: draw_locus_of,
    Nyquist: draw_disc,
    Overlay: draw_measured,
    Region: draw_map,
}


def drawn(found: object, *beside: Any) -> Figure:
    """The figure of what was found, with what its picture has beside it (of a locus the reduced one)."""
    return PICTURES[type(found)](found, *beside)
