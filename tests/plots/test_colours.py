"""The one colour code: what a map and a locus show at a point, by their pixels, distinct in grey print.

Red is what is unstable, amber what is stable with a poor margin, on pages and in their dark mode too.
"""

import colorsys
import re

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb

import tfarm
from tests.plots.labels import linear_rgb
from tfarm.case import Case
from tfarm.loop.circle_crossings import sampled_map
from tfarm.loop.locus import locus
from tfarm.loop.stability import stability
from tfarm.plots import gain_map, gain_regions, style
from tfarm.plots import locus as locus_plot
from tfarm.report.blocks import TEMPLATES
from tfarm.spectrum.gains import default_gains

LAB = tfarm.load("sasaki2012-lab")
LAW = default_gains(LAB)
K1, K2 = np.linspace(-0.5, 2.0, 60), np.linspace(-1.0, 1.5, 61)
STEP = 4.0  # of CIELAB lightness, of 100: two distinct greys
APART = 8.0  # of CIELAB, between two colours: several times what is just seen
BLIND = {  # of linear sRGB: Machado, Oliveira and Fernandes (2009), severity 1
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lightness(colour):
    """CIE 1976 L* of an sRGB colour."""
    return 116 * np.cbrt(np.dot((0.2126, 0.7152, 0.0722), linear_rgb(to_rgb(colour)))) - 16


def seen(colour, eyes):
    """CIE 1976 L*, a* and b* of a colour to eyes without one kind of cones, each above 0.009 of white."""
    x, y, z = np.cbrt(XYZ @ np.clip(BLIND[eyes] @ linear_rgb(to_rgb(colour)), 0.009, 1) / XYZ.sum(axis=1))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def palettes():
    """Colours of stability and grades by name: of pictures, of pages in the dark, and of the live page in the dark."""
    dark = [(TEMPLATES / name).read_text("utf-8").partition("color-scheme: dark")[2] for name in SHEETS]
    named = [dict(re.findall(r"--(\w+): (#\w+);", text.partition("}")[0])) for text in dark]
    return [{name: getattr(style, name.upper()) for name in ("good", "low", "poor", "marginal", "unstable")}, *named]


SHEETS = ("style.css", "live.css")


def colour_at(figure, places):
    """The colours of the picture's pixels at places (x, y) of its first axes."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())
    columns, rows = figure.axes[0].transData.transform(places).round().astype(int).T
    return [to_hex(pixel / 255) for pixel in pixels[pixels.shape[0] - 1 - rows, columns, :3]]


def test_regions_are_ever_darker_and_distinct_in_grey():
    light = np.array([lightness(colour) for colour in style.REGIONS])
    assert (np.diff(light) < -STEP).all()
    assert lightness("#ffffff") == pytest.approx(100.0)
    assert lightness("#777777") == pytest.approx(50.0, abs=0.2)  # the middle grey


@pytest.mark.parametrize("of", range(3), ids=["pictures", *SHEETS])
def test_unstable_is_red_and_a_stable_poor_loop_amber(of):
    """By the hue in degrees from red: never the reverse, and apart for the colour-blind too."""
    colours = palettes()[of]
    hue = {name: (360 * colorsys.rgb_to_hsv(*to_rgb(colour))[0] + 180) % 360 - 180 for name, colour in colours.items()}
    assert abs(hue["unstable"]) < 12 < hue["poor"] < 32 < hue["low"] < 60 < hue["good"]
    for eyes in BLIND:
        for one, other in (("unstable", "poor"), ("poor", "low"), ("unstable", "good")):
            assert np.linalg.norm(seen(colours[one], eyes) - seen(colours[other], eyes)) > APART, (one, other, eyes)


@pytest.mark.parametrize("eyes", BLIND)
def test_unstable_regions_are_red_and_none_is_the_stable_one_for_the_colour_blind(eyes):
    hues = [360 * colorsys.rgb_to_hsv(*to_rgb(colour))[0] for colour in style.REGIONS[1:]]
    assert max(hues) < 20
    assert np.linalg.norm(seen(style.REGIONS[1], eyes) - seen(style.REGIONS[0], eyes)) > 2 * APART


def test_a_map_has_the_colour_of_the_number_of_unstable_poles_of_the_loop():
    figure = gain_map.figure(tfarm.map(LAB, K1, K2))
    places = [(0.5, 0.5), (-0.05, 0.5), (1.5, 1.35), (-0.3, 0.55)]
    counts = [stability(Case(LAB, tfarm.HubFeedback(K1=x, K2=y))).unstable_roots for x, y in places]
    assert counts == [0, 1, 2, 3]
    assert colour_at(figure, places) == [style.REGIONS[count] for count in counts]


def test_a_sampled_region_is_hatched_with_a_dashed_edge_in_the_colour_of_what_is_stable():
    ax = gain_regions.figure(tfarm.map(LAB, K1, K2), sampled_map(tfarm.sampled(LAB, LAW).verdict.loop, K1, K2)).axes[0]
    looks = dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    one, other = (next(each for label, each in looks.items() if word in label) for word in ("every mode", "sampled"))
    assert (to_hex(one.get_facecolor()[0]), one.get_hatch()) == (style.REGIONS[0], None)
    assert other.get_facecolor().size == 0
    assert other.get_hatch()
    edges = [line for line in ax.lines if line.is_dashed() and to_hex(line.get_color()) == style.STABLE]
    assert edges
    assert to_hex(ax.get_facecolor()) == style.REGIONS[1]


@pytest.mark.parametrize("start", [-1.0, 1.6])
def test_a_branch_is_blue_left_of_the_axis_and_red_right_of_it(start):
    """By the pixels in the middle of two pieces of the real axis, on branches that have a pole there."""
    figure = locus_plot.figure(locus(LAB, LAW, "K2", start, 0.6 - start, points=60, branches=5))
    assert colour_at(figure, [(-3.2, 0.0), (3.0, 0.0), (3.0, 150.0)]) == [
        style.STABLE,
        style.UNSTABLE,
        style.REGIONS[1],
    ]
