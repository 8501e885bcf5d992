"""Figures as files: an SVG on a dark page, and figures for the column of a paper."""

import colorsys
import re
from contextlib import nullcontext
from itertools import pairwise
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

import tfarm
from tests.plots.labels import linear_rgb
from tests.shell import refused, run
from tfarm.plots import column, files, frequency, style
from tfarm.plots.files import save_figure
from tfarm.plots.regions import contours
from tfarm.plots.style import (
    BLUE,
    GOOD,
    GREEN,
    GREY,
    INK,
    LOW,
    MARGINAL,
    ORANGE,
    POOR,
    PURPLE,
    REGIONS,
    UNSTABLE,
)
from tfarm.report.blocks import TEMPLATES
from tfarm.response.frequency import bode

mpl.use("Agg")

LAB = tfarm.load("sasaki2012-lab")
SVG = "{http://www.w3.org/2000/svg}"
TEXT, LINES = 4.5, 3.0  # least contrast of letters and of lines by WCAG 2, 1.4.3 and 1.4.11
INCHES = 3.5, 7.16  # IEEE: one and both columns


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The picture of an arm as an SVG."""
    folder = tmp_path_factory.mktemp("saved")
    save_figure(tfarm.plots.sketch.figure(LAB), folder / "arm.svg")
    return folder / "arm.svg"


@pytest.fixture(scope="module")
def dark(saved):
    """The colours (n, 3) of a dark page: the filter of the file as the standard Filter Effects defines it."""
    root = ElementTree.parse(saved).getroot()
    (style, figure) = root.find(f"{SVG}defs/{SVG}style").text, root.find(f"{SVG}g").get("id")
    assert f"(prefers-color-scheme: dark) {{#{figure} {{filter: url(#dark)}}}}" in style
    first = root.find(f"{SVG}defs/{SVG}filter[@id='dark']")
    assert first.get("color-interpolation-filters") == "sRGB"
    matrix = np.reshape([float(x) for x in first.find(f"{SVG}feColorMatrix").get("values").split()], (4, 5))
    transfers = [each.attrib for each in first.find(f"{SVG}feComponentTransfer")]

    def mapped(colours):
        rgb = np.clip(np.asarray(colours) @ matrix[:3, :3].T + matrix[:3, 4] + matrix[:3, 3], 0, 1)
        factor, power, base = ([float(each[key]) for each in transfers] for key in ("amplitude", "exponent", "offset"))
        return np.clip(np.array(factor) * rgb**power + base, 0, 1)

    return mapped


def rgb(colour):
    return np.array(mpl.colors.to_rgb(colour))


def luminance(colour):
    """Relative luminance of sRGB colours, by WCAG 2."""
    return linear_rgb(colour) @ [0.2126, 0.7152, 0.0722]


def contrast(one, other):
    low, high = np.sort([luminance(one), luminance(other)])
    return (high + 0.05) / (low + 0.05)


def test_the_ground_of_a_dark_picture_is_that_of_its_page(dark):
    css = (TEMPLATES / "style.css").read_text()
    _, own = re.findall(r"--paper: (#\w+);", css)[:2]
    assert dark(rgb("white")) == pytest.approx(rgb(own), abs=1e-5)
    assert dark(rgb("black")) == pytest.approx([1, 1, 1])
    assert not re.search(r"img \{[^}]*background", css)


@pytest.mark.parametrize("colour", [INK, GREY, BLUE, ORANGE, GREEN, PURPLE, MARGINAL, GOOD, LOW, POOR, UNSTABLE])
def test_the_palette_can_be_read_on_both_grounds(colour, dark):
    """Letters in any of its colours; in the dark each has the hue that it has in light, to 12 degrees."""
    light, other = rgb(colour), dark(rgb(colour))
    assert contrast(light, rgb("white")) >= TEXT
    assert contrast(other, dark(rgb("white"))) >= TEXT
    hues = [colorsys.rgb_to_hsv(*each) for each in (light, other)]
    if hues[0][1] > 0.1:
        assert abs((hues[0][0] - hues[1][0] + 0.5) % 1 - 0.5) < 12 / 360


def test_regions_are_in_order_and_their_counts_can_be_read_on_both_grounds(dark):
    """By luminance ever farther from the ground; the most unstable one is a tint for large letters alone."""
    regions = [rgb(colour) for colour in REGIONS]
    assert np.all(np.diff([luminance(each) for each in regions]) < 0)
    assert np.all(np.diff([luminance(each) for each in map(dark, regions)]) > 0)
    for ink, tints in ((rgb(INK), regions), (dark(rgb(INK)), list(map(dark, regions)))):
        assert min(contrast(ink, tint) for tint in tints[:-1]) >= TEXT
        assert contrast(ink, tints[-1]) >= LINES


def test_contours_of_damping_can_be_read_on_the_stable_region(dark):
    """Their lines as letters: they are a point thin."""
    ax = Figure().subplots()
    contours(np.arange(3.0), np.arange(3.0), np.array([[0.01, 0.02, 0.03]] * 3), ax)
    ground = rgb(REGIONS[0])
    (line,) = {mpl.colors.to_rgb(line.get_color()) for line in ax.lines}
    assert ax.collections[0].get_edgecolor()[0, :3] == pytest.approx(line)
    line = np.array(line)
    assert contrast(line, ground) >= TEXT
    assert contrast(dark(line), dark(ground)) >= TEXT


def test_a_colour_that_can_be_read_on_paper_can_be_read_in_the_dark(dark):
    """Computed tints are no names in a list: 4,096 colours even in the cube, with an eighth less contrast at most."""
    ends = np.linspace(0, 1, 16)
    cube = np.stack(np.meshgrid(ends, ends, ends), axis=-1).reshape(-1, 3)
    for least in (TEXT, LINES):
        seen = [each for each in cube if contrast(each, rgb("white")) >= least]
        assert len(seen) > 500
        assert min(contrast(dark(each), dark(rgb("white"))) for each in seen) >= 0.875 * least


# ------------------------------------------------------------ the column of a paper


@pytest.fixture(scope="module")
def drawn():
    """Pictures of one axes, of several above each other and of several side by side, for a paper."""
    with column():
        return {
            "sketch": tfarm.plots.sketch.figure(LAB),
            "bode": tfarm.plots.bode.figure(tfarm.bode(LAB, "root_moment", (1.0, 300.0))),
            "modes": tfarm.plots.modes.figure(tfarm.modes(LAB, count=2)),
        }


@pytest.mark.parametrize(("name", "width"), [("sketch", INCHES[0]), ("bode", INCHES[0]), ("modes", INCHES[1])])
def test_a_figure_for_a_column_has_its_width_its_letters_and_no_headline(name, width, drawn):
    figure = drawn[name]
    assert figure.get_figwidth() == width
    assert figure.get_suptitle() == ""
    with column():
        figure.draw_without_rendering()
        seen = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
        right = figure.get_tightbbox().x1
        assert {text.get_fontname() for text in seen} == {"STIXGeneral"}
    assert 6 <= min(text.get_fontsize() for text in seen) <= max(text.get_fontsize() for text in seen) <= 8
    assert right <= width + 0.01
    upright = sorted((ax.yaxis.label.get_window_extent() for ax in figure.axes), key=lambda box: box.y0)
    if name == "bode":
        assert all(low.y1 <= high.y0 for low, high in pairwise(upright))
    assert tfarm.plots.sketch.figure(LAB).get_suptitle() == ""
    assert figure.again().get_figwidth() > width


def test_a_long_legend_makes_a_figure_of_a_column_higher_and_leaves_its_axes_their_height():
    """Of one response, and of the same under two dozen names."""
    data = tfarm.bode(LAB, "root_moment", (1.0, 300.0))
    with column():
        few, many = (tfarm.plots.bode.figure({f"{n} of a long name": data for n in range(count)}) for count in (1, 24))
        for figure in (few, many):
            figure.draw_without_rendering()
    assert many.get_figheight() > few.get_figheight() + 0.5
    heights = [figure.axes[0].get_position().height * figure.get_figheight() for figure in (few, many)]
    assert heights[1] == pytest.approx(heights[0], rel=0.1)


@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_a_file_for_a_paper_is_the_same_on_every_run_and_has_letters_for_latex(kind, tmp_path, capsys):
    """Widths in points of 1/72 inch; TrueType in a PDF, and no date."""
    files = [tmp_path / f"{number}.{kind}" for number in range(2)]
    for file in files:
        options = ("--to", "100", "--figure", str(file))
        assert run(capsys, "bode", "sasaki2012-lab", *options)[0::2] == (0, f"written: {file}\n")
    first, second = (file.read_bytes() for file in files)
    assert first == second
    if kind == "pdf":
        (box,) = re.findall(rb"/MediaBox \[ 0 0 (\S+) \S+ \]", first)
        assert float(box) == pytest.approx(72 * INCHES[0])
        assert b"STIXGeneral" in first
        assert b"/Subtype /TrueType" in first or b"/CIDFontType2" in first
        assert b"CreationDate" not in first
    else:
        assert b'width="252pt"' in first


def test_python_makes_the_figure_of_a_column_as_the_command_does(tmp_path, capsys):
    """By matplotlib's own savefig, as the docstring of `tfarm.plots.column` has it; later figures are as before."""
    from matplotlib import pyplot

    with column():
        upper, _ = tfarm.plots.bode(tfarm.bode(LAB, "root_moment", (1.0, 300.0)))
        upper.figure.savefig(tmp_path / "own.pdf")
    pyplot.close(upper.figure)
    (box,) = re.findall(rb"/MediaBox \[ 0 0 (\S+) \S+ \]", (tmp_path / "own.pdf").read_bytes())
    assert float(box) == pytest.approx(72 * INCHES[0])
    assert tfarm.plots.sketch.figure(LAB).get_figwidth() == 9


@pytest.mark.parametrize("option", ["--figure", "--png"])
def test_a_figure_of_an_unknown_kind_is_refused_in_one_line(option, tmp_path, capsys):
    words = refused(capsys, "bode", "sasaki2012-lab", option, str(tmp_path / "a.jpg"))
    assert "give a name that ends in .png, .svg or .pdf" in words
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["page", "phone"])
def test_a_layout_leaves_axes_where_matplotlib_does_and_writes_its_file(place, tmp_path, monkeypatch):
    """Against its own layout, by letters of a renderer of its own; with ticks found at every use the same bytes."""
    with style.drawn_for(place):
        here, there = (frequency.bode.figure(bode(LAB, "root_moment")) for _ in range(2))
        files.fix_layout(here)
        FigureCanvasAgg(there)
        there.get_layout_engine().execute(there)
        for own, other in zip(here.axes, there.axes, strict=True):
            ends = [ax.get_position().extents * np.tile(here.get_size_inches(), 2) for ax in (own, other)]
            assert ends[0] == pytest.approx(ends[1], abs=0.01)  # inches
            sizes = [ax.yaxis.label.get_window_extent().size for ax in (own, other)]
            assert sizes[0] == pytest.approx(sizes[1])
        save_figure(here, tmp_path / "kept.svg")
        monkeypatch.setattr(files, "ticks_kept", lambda _: nullcontext())
        save_figure(here, tmp_path / "anew.svg")
    assert (tmp_path / "kept.svg").read_bytes() == (tmp_path / "anew.svg").read_bytes()
