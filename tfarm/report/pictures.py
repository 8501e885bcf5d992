"""The small pictures that the project's README shows."""

from __future__ import annotations

from pathlib import Path

import tfarm
from tfarm.digits import plain
from tfarm.dsp import load_chain
from tfarm.plots.frequency import draw_compared
from tfarm.plots.regions import draw_overlay, stable_regions
from tfarm.plots.shapes import modes
from tfarm.plots.style import save_figure
from tfarm.response.frequency import bode, resonant_band
from tfarm.spectrum.table import default_gains

README_DOTS = 100  # an inch: pictures of a README are shown at their own size
README_MODES = 4  # shapes: two rows


def readme_pictures(out: Path) -> tuple[Path, ...]:
    """Write bode-root-moment.png, gains.png and mode-shapes.png to the folder `out`; their paths.

    Torque to root moment with and without damping, the gains that keep the loop stable, and the first mode shapes.
    """
    out.mkdir(parents=True, exist_ok=True)
    lab, undamped = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
    band, labels = resonant_band(lab, 6), ("exact, no damping", f"exact, damping C = {plain(lab.damping)} s")
    main, other = (bode(arm, "root_moment", band) for arm in (undamped, lab))
    figures = {
        "bode-root-moment": draw_compared(main, other, labels),
        "gains": draw_overlay(stable_regions(lab, default_gains(lab), load_chain(lab.name))),
        "mode-shapes": modes.figure(tfarm.modes(lab, count=README_MODES)),
    }
    for stem, figure in figures.items():
        save_figure(figure, out, stem, formats=("png",), dpi=README_DOTS)
    return tuple(out / f"{stem}.png" for stem in figures)
