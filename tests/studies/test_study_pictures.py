"""Pictures of a study: what is drawn are the numbers of its table, and curves of the exact solution."""

import re
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

import tfarm
from tests.hostile import check_drawing
from tests.plots.labels import complaints
from tests.studies.pictured import DRAWS, LAB, planted_study
from tfarm.plots.motion import OF_STABILITY
from tfarm.plots.studies import distributions, study, study_band, study_scatter
from tfarm.plots.style import GREY, column, save_figure
from tfarm.response.transfer import transfer


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return planted_study(tmp_path_factory.mktemp("planted"))


def test_the_study_has_every_kind_of_value(found):
    """Otherwise the tests below are of less than they say."""
    table = found.table()
    assert {*table["sampled.stability"]} == {"stable", "unstable", ""}
    assert all(check(table["sampled.gain_margin_db"]).any() for check in (np.isinf, np.isnan, np.isfinite))
    assert len(found.failures) == 1


def test_each_histogram_counts_the_arms(found):
    figure = study.figure(found)
    table, shown = found.table(), distributions(found)
    assert len(figure.axes) == len(shown) == 4
    for ax, both in zip(figure.axes, shown, strict=True):
        for n, of in enumerate(both):
            counts, edges, _ = ax.patches[n].get_data()
            values = table[of.name][np.isfinite(table[of.name])]
            inside = [((values >= low) & (values < high)).sum() for low, high in pairwise(edges)]
            inside[-1] += (values == edges[-1]).sum()
            assert counts.tolist() == inside
            assert counts.sum() == of.arms == values.size
            assert ax.lines[n].get_xdata() == pytest.approx(np.percentile(values, [5, 50, 95]), rel=1e-12)
        assert re.fullmatch(r"[\w ,\n]+ ?\[(dB|deg|ms|−)\]", ax.get_xlabel()), ax.get_xlabel()
        assert ax.get_ylabel() == "arms [−]"
    titles = [ax.get_title("left") for ax in figure.axes]
    assert all(f"of {DRAWS} arms" in each for each in titles)  # some failed in each


def test_a_quantity_has_one_name(found):
    by_place, by_name = study.figure(found, "phase_margin_deg"), study.figure(found, quantity="phase_margin_deg")
    assert [ax.get_xlabel() for ax in by_place.axes] == [ax.get_xlabel() for ax in by_name.axes]
    assert len(by_name.axes) == 1
    assert len(study.figure(found, "sampled.phase_margin_deg").axes[0].patches) == 1
    ax = Figure().subplots()
    assert tfarm.plots.study(found, quantity="phase_margin_deg", ax=ax) == (ax,)
    assert ax.get_xlabel() == by_name.axes[0].get_xlabel()


@pytest.mark.parametrize("draw", [study, study_scatter])
def test_a_quantity_that_is_not_there_is_refused(draw, found):
    with pytest.raises(tfarm.ParameterError, match=r"quantity = 'natural_frequency_rad_s': .*name it in `ask`"):
        draw.figure(found, "natural_frequency_rad_s")
    with pytest.raises(tfarm.ParameterError, match="phase_margin"):
        draw.figure(found, "phase_margine")


def test_each_arm_is_one_mark_in_the_colour_of_its_loop(found):
    """With a value at its height; without a limit at the upper edge, without a value at the lower one."""
    table, figure = found.table(), study_scatter.figure(found)
    shown = [both[-1].name for both in distributions(found)][:3]
    keys = [re.match(r"[\w.]+", ax.get_xlabel())[0] for ax in figure.axes[-2:]]
    assert len(figure.axes) == 6
    for n, ax in enumerate(figure.axes):
        y = table[shown[n // 2]]
        x = table[{"K2": "law.K2"}.get(keys[n % 2], keys[n % 2])]
        height = np.where(np.isnan(y), 0.02, np.where(np.isinf(y), 0.98, y))
        wanted = {}
        for word in ("stable", "unstable", ""):
            colour = OF_STABILITY[word][0] if word else GREY
            wanted[colour] = sorted(zip(x[own := table["sampled.stability"] == word], height[own], strict=True))
        drawn = {
            colour: sorted(
                p for line in ax.lines if same_color(line.get_color(), colour) for p in map(tuple, line.get_xydata())
            )
            for colour in wanted
        }
        assert drawn == wanted
        assert sum(map(len, drawn.values())) == DRAWS
        edge = [line for line in ax.lines if line.get_transform() is not ax.transData]
        assert sum(len(line.get_xdata()) for line in edge) == (~np.isfinite(y)).sum()


def test_of_many_arms_some_are_drawn(found, monkeypatch):
    monkeypatch.setattr("tfarm.plots.studies.MOST_MARKS", 10)
    ax = study_scatter.figure(found, "least_damping").axes[0]
    assert sum(len(line.get_xdata()) for line in ax.lines) == 10


def test_a_band_has_the_curves_of_the_arms(found):
    """By arms made in another way than the study makes them."""
    masses = found.table()["payload.mass"]
    ax = study_band.figure(found).axes[0]
    lines = {line.get_label(): line for line in ax.lines}
    omega, median = lines["median, at each frequency"].get_data()
    exact = 20 * np.log10([abs(tfarm.transfer(LAB.having(payload_mass=m), "root_moment")(1j * omega)) for m in masses])
    assert lines["single arms"].get_ydata() == pytest.approx(exact[0], abs=1e-9)
    below, above = np.sort(exact, axis=0)[[DRAWS // 2 - 1, DRAWS // 2]]  # of an even number of arms
    assert np.all((median > below - 1e-9) & (median < above + 1e-9))
    (area,) = (each.get_paths()[0].vertices for each in ax.collections)
    for end in np.percentile(exact, [5, 95], axis=0):
        assert all(np.min(abs(area[area[:, 0] == w, 1] - y)) < 1e-9 for w, y in zip(omega, end, strict=True))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("angular frequency [rad/s]", "root moment [dB re 1 N m/(N m)]")


def test_an_arm_without_a_response_is_left_out_and_none_at_all_is_an_error(found):
    refused, place = tfarm.ConvergenceError("no", None, None), "tfarm.studies.bands.transfer"
    ready = transfer(found.parts.plan.case.arm, "root_moment")
    with mock.patch(place, side_effect=[ready, *[refused] * (DRAWS - 1), lambda s: 0 * s + 10]):
        (line, *_) = study_band.figure(found).axes[0].lines
    assert line.get_ydata().tolist() == [20.0] * 1200
    with (
        mock.patch(place, side_effect=[ready, *[refused] * DRAWS]),
        pytest.raises(tfarm.ParameterError, match="no arm of the study has"),
    ):
        study_band.figure(found)
    with pytest.raises(tfarm.ParameterError, match="output"):
        study_band.figure(found, "root_momentum")


def test_no_words_of_a_picture_overlap_in_any_size(found):
    drawn = [(study, found), (study_scatter, found), (study_band, found)]
    figures = [picture.figure(record) for picture, record in drawn]
    with column():
        figures += [picture.figure(record) for picture, record in drawn]
    assert [line for figure in figures for line in complaints(figure)] == []


def test_the_same_study_is_the_same_drawing_and_names_are_text(found, tmp_path):
    for place in ("one", "other"):
        save_figure(study_scatter.figure(found), tmp_path / f"{place}.svg")
    one, other = ((tmp_path / f"{place}.svg").read_bytes() for place in ("one", "other"))
    assert one == other
    check_drawing(one.decode())
