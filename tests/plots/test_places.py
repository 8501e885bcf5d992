"""Pictures for half a page and for a phone: as wide as their place, so that no letter is scaled down."""

import itertools

import matplotlib as mpl
import numpy as np
import pytest

import tfarm
from tests.plots.labels import complaints
from tfarm.loop.locus import locus
from tfarm.plots import files, style

mpl.use("Agg")

LAB = tfarm.load("sasaki2012-lab")
LAW = tfarm.default_gains(LAB)
PIXELS = 96.0  # an inch of a page
SCREEN = {"page": 600.0, "phone": 368.0}  # pixels: half of a page of 1280, all of one of 400, each less its margins
LEAST = 8.0  # points, of the letters of a legend
PICTURES = {
    "bode": lambda: tfarm.plots.bode.figure(tfarm.bode(LAB, "root_moment", (1.0, 300.0))),
    "loop": lambda: tfarm.plots.loop.figure(tfarm.loop_function(LAB, LAW)),
    "nyquist": lambda: tfarm.plots.nyquist.figure(tfarm.nyquist(LAB, LAW), name="default gains"),
    "disc": lambda: tfarm.plots.disc.figure(tfarm.nyquist(LAB, LAW)),
    "locus": lambda: tfarm.plots.locus.figure(locus(LAB, LAW, "K2", -1.0, 1.0, points=40, branches=3)),
    "modes": lambda: tfarm.plots.modes.figure(tfarm.modes(LAB, count=4)),
    "sketch": lambda: tfarm.plots.sketch.figure(LAB),
    "map": lambda: tfarm.plots.gain_map.figure(tfarm.map(LAB, np.linspace(-0.5, 2, 60), np.linspace(-1, 1.5, 61))),
}

CASES = [(place, name) for place in SCREEN for name in PICTURES if (place, name) != ("phone", "locus")]


@pytest.mark.parametrize(("place", "name"), CASES)
def test_a_picture_has_legends_of_eight_points_on_its_screen_and_no_words_overlap(place, name):
    with style.drawn_for(place):
        figure = PICTURES[name]()
        assert complaints(figure) == []
    scale = min(1.0, SCREEN[place] / (PIXELS * figure.get_figwidth()))
    is_whole_row = place == "page" and figure.get_figwidth() > style.HALF_WIDTH
    assert is_whole_row or scale > 0.99
    letters = [text.get_fontsize() for legend in figure.legends for text in legend.get_texts()]
    assert is_whole_row or scale * min(letters, default=LEAST) >= 0.99 * LEAST


def test_axes_side_by_side_are_below_each_other_on_a_phone():
    """Those of mode shapes; with as many axes, each as wide as the picture but for its labels."""
    with style.drawn_for("phone"):
        figure = PICTURES["modes"]()
        files.fix_layout(figure)
    boxes = [ax.get_position() for ax in figure.axes]
    assert len(boxes) == len(PICTURES["modes"]().axes) == 4
    assert all(upper.y0 > lower.y1 for upper, lower in itertools.pairwise(boxes))
    assert min(box.width for box in boxes) > 0.7


@pytest.mark.parametrize("letters", ["column", "page", "phone", ""])
def test_legends_have_eight_points_wherever_they_are_drawn(letters):
    with style.drawn_for(letters):
        figure = PICTURES["loop"]()
    assert min(text.get_fontsize() for legend in figure.legends for text in legend.get_texts()) >= LEAST


def test_a_place_ends_with_its_context():
    before = PICTURES["bode"]().get_figwidth()
    with style.drawn_for("phone"), style.drawn_for("page"):
        pass
    assert PICTURES["bode"]().get_figwidth() == before > style.HALF_WIDTH
