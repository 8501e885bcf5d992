"""The small pictures that the project's README shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import tfarm
from tfarm.digits import plain
from tfarm.dsp import load_chain
from tfarm.plots.files import save
from tfarm.plots.frequency import draw_compared
from tfarm.plots.shapes import draw_shapes, shapes_of
from tfarm.report.overlay import draw_overlay, overlay
from tfarm.response.frequency import band_of, bode
from tfarm.spectrum.scales import default_gains

if TYPE_CHECKING:
    from tfarm.plots.style import Figure

DOTS_PER_INCH = 100
SHOWN = 4


def readme_pictures(out: Path) -> tuple[Path, ...]:
    """Write bode-root-moment.png, gains.png and mode-shapes.png to the folder `out`; their paths."""
    out.mkdir(parents=True, exist_ok=True)
    figures = {"bode-root-moment": _bode(), "gains": _gains(), "mode-shapes": _shapes()}
    for stem, figure in figures.items():
        save(figure, out, stem, formats=("png",), dpi=DOTS_PER_INCH)
    return tuple(out / f"{stem}.png" for stem in figures)


def _bode() -> Figure:
    """Torque to root moment, with and without damping."""
    damped, undamped = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
    band = band_of(damped, 6)
    labels = "exact, no damping", f"exact, damping C = {plain(damped.link.damping)} s"
    return draw_compared(bode(undamped, "root_moment", band), bode(damped, "root_moment", band), labels)


def _gains() -> Figure:
    """The gains that keep the loop stable, continuous and sampled."""
    arm = tfarm.load("sasaki2012-lab")
    return draw_overlay(overlay(arm, default_gains(arm), load_chain(arm.name)))


def _shapes() -> Figure:
    arm = tfarm.load("sasaki2012-lab")
    return draw_shapes(arm.name, shapes_of(tfarm.modes(arm, count=SHOWN), SHOWN))
