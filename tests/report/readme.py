"""Write the pictures of the README: python -m tests.report.readme [FOLDER]."""

import sys
from pathlib import Path

import tfarm
from tfarm.case import Case
from tfarm.digits import plain
from tfarm.dsp import load_chain
from tfarm.plots.arm_sketch import sketch
from tfarm.plots.files import save_figure
from tfarm.plots.frequency import bode as bode_plot
from tfarm.plots.motion import modes
from tfarm.plots.regions import gain_regions
from tfarm.response.frequency import bode, resonant_band
from tfarm.spectrum.gains import default_gains
from tfarm.synthesis.stability_map import stable_regions

PICTURES = Path(__file__).parents[2] / "reports" / "pictures"
DOTS = 100  # an inch: pictures of a README are shown at their own size


def write_pictures(out: Path) -> None:
    """Write arm.svg, bode-root-moment.png, gains.png and mode-shapes.png to a folder."""
    lab, undamped = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
    band, labels = resonant_band(lab, 6), ("exact, no damping", f"exact, damping C = {plain(lab.damping)} s")
    both = {label: bode(arm, "root_moment", band) for label, arm in zip(labels, (undamped, lab), strict=True)}
    figures = {
        "bode-root-moment": bode_plot.figure(both),
        "gains": gain_regions.figure(*stable_regions(Case(lab, default_gains(lab), load_chain(lab.name)))),
        "mode-shapes": modes.figure(tfarm.modes(lab, count=4)),  # two rows
    }
    for stem, figure in figures.items():
        save_figure(figure, out / f"{stem}.png", DOTS)
    save_figure(sketch.figure(tfarm.load("quanser-2dsfl")), out / "arm.svg")  # of lines: as sharp at any width


if __name__ == "__main__":
    write_pictures(Path(*sys.argv[1:2]) if sys.argv[1:] else PICTURES)
