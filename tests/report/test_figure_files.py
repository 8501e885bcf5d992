"""Files of the figures of pages: PDF for a paper, and the line of Python that draws each."""

import re

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot

import tfarm
from tests.report.written import coarsen
from tfarm.dsp import Chain
from tfarm.report.arm_file import command_of
from tfarm.report.blocks import PICTURES, save_section
from tfarm.report.loop_section import locus_section, nyquist_section
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import arm_section, bode_section, modes_section

mpl.use("Agg")

LAB = tfarm.load("sasaki2012-lab")
OWN = LAB.with_numbers(hub_inertia=0.12)
DRAWN = {  # by the kind of picture the section that has it, and what its line of Python draws of the same
    "arm": arm_section,
    "bode-root-moment": lambda case: bode_section(case, "root_moment"),
    "mode-shapes": modes_section,
    "default-nyquist": nyquist_section,
    "locus-K2": locus_section,
}


@pytest.fixture(scope="module")
def pictures():
    """The pictures of an arm's page by stem, on coarse grids."""
    with pytest.MonkeyPatch.context() as patch:
        coarsen(patch.setattr)
        sections = [make(ArmReport(LAB, Chain())) for make in DRAWN.values()]
    return {block.stem: block for section in sections for block in section.blocks if hasattr(block, "figure")}


@pytest.mark.parametrize("stem", DRAWN)
def test_the_line_of_python_draws_the_picture(stem, pictures):
    """Each of its curves is one of the page's picture, point by point."""
    python = pictures[stem].python
    assert python.startswith("tfarm.plots.")
    assert 'tfarm.load("sasaki2012-lab")' in python
    assert "\n" not in python
    axes = np.ravel(eval(python, {"tfarm": tfarm}))
    pyplot.close(axes[0].figure)
    there = [line.get_xydata() for ax in pictures[stem].figure.axes for line in ax.lines]
    curves = [line.get_xydata() for ax in axes for line in ax.lines if len(line.get_xydata()) > 2]
    assert curves or stem == "arm"
    for curve in curves or [line.get_xydata() for line in axes[0].lines]:
        assert any(curve.shape == each.shape and np.array_equal(curve, each, equal_nan=True) for each in there)


def test_of_an_arm_that_is_no_preset_the_line_reads_the_file_of_its_page(tmp_path):
    picture = arm_section(ArmReport(OWN, Chain())).blocks[0]
    assert picture.python == 'tfarm.plots.sketch(tfarm.load("arm.toml"))'


def test_figures_for_a_paper_are_saved_and_linked_where_they_are_wanted(tmp_path):
    """A PDF of one column, 252 points, with SVGs of the page's own size and of a phone's; by default these alone."""
    section = bode_section(ArmReport(LAB, Chain()), "root_moment")
    for is_paper, kinds in ((False, ["svg", "svg"]), (True, ["pdf", "svg", "svg"])):
        folder = tmp_path / str(is_paper)
        folder.mkdir()
        first, _ = save_section(section, folder, is_paper).blocks
        files = sorted((folder / PICTURES).iterdir(), key=lambda file: file.suffix)
        assert [file.suffix[1:] for file in files] == kinds
        links = re.findall(r'href="pictures/[^"]+\.(\w+)"', first.html)
        assert sorted(links) == sorted(set(kinds))
        assert "<code>tfarm.plots.bode(" in first.html
    assert re.search(rb"/MediaBox \[ 0 0 252 ", files[0].read_bytes())
    assert "--paper" in command_of(ArmReport(LAB, Chain(), is_paper=True), "")
