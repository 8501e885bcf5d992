"""Pictures from Python: what is drawn are the record's own numbers, in the axes that are given and in no other."""

import importlib
import inspect
import pkgutil
import re

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

import tfarm
from tests.plots.labels import complaints, drawn
from tests.shared import thinned
from tfarm import Law
from tfarm.dsp import sampled_map
from tfarm.fitting.data import Measured
from tfarm.loop.loci import reduced_locus
from tfarm.loop.nyquist import compressed
from tfarm.plots.plane import colours
from tfarm.plots.style import number_label
from tfarm.spectrum.table import default_gains
from tfarm.tuner import Plan

mpl.use("Agg")

LAB = tfarm.load("sasaki2012-lab")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)


@pytest.fixture(autouse=True)
def no_figure_left_open():
    """What a test asks pyplot for it closes again."""
    pyplot.close("all")
    yield
    left = pyplot.get_fignums()
    pyplot.close("all")
    assert left == []


@pytest.fixture(scope="module")
def records():
    """By the name of the plot: what it takes, and how many axes it draws in (0: one that is no sequence)."""
    K1, K2 = np.linspace(0.05, 2.0, 40), np.linspace(-1.0, 1.5, 41)
    plane, analysis = tfarm.map(LAB, K1, K2), tfarm.sampled(LAB, LAW, count=8)
    return {
        "comparison": ([tfarm.compare([LAB, LAB.having(hub_inertia=0.2)], modes=2)], 3),
        "bode": ([tfarm.bode(LAB, "root_moment", (1.0, 300.0))], 2),
        "gain_map": ([plane], 0),
        "locus": ([tfarm.locus(LAB, LAW, "K2", -1.0, 1.6, points=60, branches=3)], 0),
        "measured": ([tfarm.overlay(LAB, sweep())], 3),
        "modes": ([tfarm.modes(LAB, count=3)], 3),
        "nyquist": ([tfarm.nyquist(LAB, LAW)], 0),
        "overlay": ([plane, sampled_map(analysis.verdict.loop, K1, K2)], 0),
        "sketch": ([LAB], 0),
        "tuned_gain": ([tfarm.tune(LAB, Plan(trials=1))], 0),
        "slew": ([LAB, tfarm.simulate(LAB, LAW, duration=2.0, count=8, between=4)], 3),
    }


def sweep():
    """The lab arm's own response, half as high and with a coherence that falls."""
    omega = np.linspace(5.0, 250.0, 120)
    values = tfarm.transfer(LAB, "root_moment")(1j * omega) / 2
    return Measured(
        output="root_moment", input="hub_torque", omega=omega, values=values, coherence=np.linspace(1.0, 0.5, 120)
    )


def axes_for(count):
    axes = Figure().subplots(max(1, count), 1)
    return axes if count else axes.item() if isinstance(axes, np.ndarray) else axes


def as_tuple(axes):
    return tuple(np.ravel(np.asarray(axes, dtype=object)))


@pytest.mark.parametrize("name", thinned(tfarm.plots.__all__, 2))
def test_axes_given_are_the_axes_returned_and_nothing_else_is_opened(name, records):
    record, count = records[name]
    given = axes_for(count)
    returned = getattr(tfarm.plots, name)(*record, ax=given)
    assert as_tuple(returned) == as_tuple(given)
    assert all(ax.lines or ax.images or ax.collections for ax in as_tuple(returned))
    axes = [axis for ax in as_tuple(given) if ax.axison for axis in (ax.xaxis, ax.yaxis)]
    named = [axis for axis in axes if axis.get_ticklocs().size and axis.get_tick_params().get("labelbottom", True)]
    assert [axis for axis in named if not re.search(r"\w.* \[.+\]", axis.get_label_text())] == []  # quantity, unit
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize("name", thinned(tfarm.plots.__all__[2:] + tfarm.plots.__all__[:2], 3))
def test_without_axes_a_figure_is_made_in_the_look_of_the_pages(name, records):
    """Whatever the user's settings are, and though matplotlib makes ticks only when it draws."""
    record, count = records[name]
    theirs = ("xtick.labelsize", "ytick.labelsize", "axes.labelsize", "font.size")
    with mpl.rc_context(dict.fromkeys(theirs, 31.0)):
        axes = as_tuple(getattr(tfarm.plots, name)(*record))
        (number,) = pyplot.get_fignums()
        figure = pyplot.figure(number)
        assert {ax.get_figure() for ax in axes} == {figure}
        assert len(axes) == max(1, count)
        figure.draw_without_rendering()
        each = [axis for ax in axes for axis in (ax.xaxis, ax.yaxis)]
        sizes = {
            tick.label1.get_fontsize() for axis in each for tick in axis.get_major_ticks() + axis.get_minor_ticks()
        }
        sizes |= {axis.label.get_fontsize() for axis in each}
    assert max(sizes) < 12
    pyplot.close(figure)


@pytest.mark.parametrize("name", thinned(tfarm.plots.__all__[1:] + tfarm.plots.__all__[:1], 3))
def test_words_overlap_nothing(name, records):
    """Neither each other, nor a frame or the edge of the picture, nor a curve."""
    figure = as_tuple(getattr(tfarm.plots, name)(*records[name][0]))[0].get_figure()
    assert complaints(figure) == []
    assert len(drawn(figure)) > 3
    pyplot.close(figure)


@pytest.mark.parametrize("name", thinned(["quanser-flexlink", "sasaki2012"], 2))
def test_words_overlap_nothing_without_damping_or_torque(name):
    """Curves that run to infinity, poles on the axis, a rig driven by voltage."""
    arm = tfarm.load(name)
    law, unit = default_gains(arm), arm.input_per_torque
    found = tfarm.locus(arm, law, "K2", -unit, 1.6 * unit, points=40, branches=4)
    axes = {
        "bode": tfarm.plots.bode(tfarm.bode(arm, "root_moment", (1.0, 1000.0)))[0],
        "nyquist": tfarm.plots.nyquist(tfarm.nyquist(arm, law)),
        "locus": tfarm.plots.locus(found),
        "map": tfarm.plots.gain_map(tfarm.map(arm, np.linspace(-1, 4, 40) * law.K1, np.linspace(-1, 1.5, 41) * unit)),
    }
    told = {name: complaints(each.get_figure()) for name, each in axes.items()}
    pyplot.close("all")
    assert told == {name: [] for name in axes}


@pytest.mark.parametrize(
    ("number", "label"),
    [
        ("K2", "K2, gain on the root moment [−]"),
        ("delay", "delay [s]"),
        ("payload_mass", "payload mass [kg]"),
        ("gain", "gain, factor on the controller [−]"),
        ("hub_angle.gain", "hub_angle.gain, factor on the hub angle [−]"),
        ("hub_rate", "hub_rate [N m/(rad/s)]"),
        ("hub_angle.num.0", "hub_angle.num.0 [(N m/rad) s]"),
        ("hub_angle.num.1", "hub_angle.num.1 [N m/rad]"),
        ("hub_angle.den.0", "hub_angle.den.0 [s]"),
        ("strain@0.05.den.0", "strain@0.05.den.0 [s^2]"),
        ("strain@0.05.den.2", "strain@0.05.den.2 [−]"),
    ],
)
def test_a_number_of_a_law_has_its_unit(number, label):
    """Of num.0 s + num.1 over den.0 s + 1, from an angle to a torque; checked by hand."""
    law = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "hub_rate": 0.4, "strain@0.05": ([1.0], [1e-4, 0.02, 1.0])})
    assert number_label(number, LAB, law) == label


LEAD = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_deflection": ([0.5], [0.02, 1.0])})


@pytest.mark.parametrize("plot", ["locus", "gain_map"])
def test_what_is_found_of_any_law_has_the_same_face(plot):
    """In axes that are given there is what the picture of its own has, and no words overlap there."""
    if plot == "locus":
        found = tfarm.locus(LAB, LEAD, "gain", 0.0, 2.0, 10, 3)
    else:
        found = tfarm.map(LAB, np.linspace(0.1, 3.0, 8), np.linspace(0.0, 0.03, 9), law=LEAD, vary=("gain", "delay"))
    own, given = getattr(tfarm.plots, plot)(found), axes_for(0)
    assert getattr(tfarm.plots, plot)(found, ax=given) is given
    for mine, theirs in zip(given.lines, own.lines, strict=True):
        np.testing.assert_array_equal(mine.get_xydata(), theirs.get_xydata())
    assert (own.get_xlabel(), own.get_ylabel()) == (given.get_xlabel(), given.get_ylabel())
    assert complaints(own.get_figure()) == []
    pyplot.close(own.get_figure())


@pytest.mark.parametrize("name", tfarm.plots.__all__)
def test_what_is_no_record_of_it_is_refused_by_the_name_of_what_returns_one(name, records):
    """The first and the last argument of each picture, one at a time; what is drawn beside is left alone."""
    right, _ = records[name]
    for place in {0, len(right) - 1}:
        for wrong in (3, LAW, tfarm.transfer(LAB, "root_moment")):
            given = [wrong if n == place else each for n, each in enumerate(right)]
            with pytest.raises(tfarm.ParameterError, match=r"give (what )?tfarm\.\w+"):
                getattr(tfarm.plots, name)(*given)
    assert pyplot.get_fignums() == []


def test_words_that_do_overlap_are_told():
    """Of which the tests above say that there are none."""
    figure = Figure(figsize=(4.0, 3.0))
    ax = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    ax.plot([0, 1, np.nan, 1, 1], [0, 1, np.nan, 0, 1], color="#0060a8")
    ax.set(xlim=(0, 1), ylim=(0, 1))
    for x, y, text in ((0.5, 0.5, "on the line"), (0.1, 0.8, "one"), (0.12, 0.81, "other"), (0.97, 0.3, "frame")):
        ax.text(x, y, text)
    told = complaints(figure)
    assert {"'on the line' on a curve", "'one' on 'other'", "'frame' across a frame"} <= set(told)
    assert "'one' on a curve" not in told


def test_bode_draws_the_response(records):
    (data,), _ = records["bode"]
    upper, lower = tfarm.plots.bode(data, ax=axes_for(2))
    (curve,) = (line for line in upper.lines if line.get_label() == "flexible arm, exact")
    assert curve.get_xdata().tolist() == data.omega.tolist()
    assert curve.get_ydata().tolist() == abs(data.value).tolist()
    assert lower.lines[-1].get_ydata().tolist() == data.phase.tolist()
    assert "[N m/(N m)]" in upper.get_ylabel()
    assert ("[rad/s]" in lower.get_xlabel(), lower.get_ylabel()) == (True, "phase [deg]")


def test_nyquist_draws_the_loop_function_with_its_verdict(records):
    """Off the arcs past poles every point of the contour is on a line, at r/(1 + r) for its size r."""
    (data,), _ = records["nyquist"]
    ax = tfarm.plots.nyquist(data, ax=axes_for(0), name="mine")
    drawn = {complex(x, y) for line in ax.lines for x, y in zip(*line.get_data(), strict=True)}
    upper = compressed(data.L)[~data.is_arc]
    assert set(upper.tolist()) | set(upper.conj().tolist()) <= drawn
    assert ax.get_title().split("\n") == [
        f"mine: {data.verdict.verdict.upper()}",
        "K1 = 0.3, K2 = 0.3",
        f"encirclements of −1: {data.encirclements};  unstable poles: {data.verdict.unstable_roots}",
    ]


def test_modes_draws_the_shapes_with_their_nodes(records):
    (found,), _ = records["modes"]
    axes = tfarm.plots.modes(found, ax=axes_for(3))
    shapes = found.shape(axes[0].lines[1].get_xdata())
    for ax, index in zip(axes, (1, 2, 3), strict=True):
        (at,) = np.nonzero(found.index == index)[0]
        w = shapes[at]
        assert ax.lines[1].get_ydata().tolist() == (w / abs(w).max()).tolist()
        (nodes,) = (line.get_xdata() for line in ax.lines if line.get_marker() == "o")
        assert nodes.tolist() == found.nodes[at].tolist()
        assert f"{found.natural_frequency[at]:.7g} rad/s" in ax.get_title("left")
        assert ("[m]" in ax.get_xlabel(), ax.get_ylabel()[-3:]) == (True, "[−]")


def test_gain_map_draws_the_boundary_and_the_counts(records):
    """Every point of the record's boundary that is in the picture is on the line, and each pixel is a count."""
    (found,), _ = records["gain_map"]
    ax = tfarm.plots.gain_map(found, ax=axes_for(0))
    (line,) = (line for line in ax.lines if "exact" in str(line.get_label()))
    K1, K2, _ = found.boundary.T
    inside = (K1 > 0.05) & (K1 < 2.0) & (K2 > -1.0) & (K2 < 1.5)
    drawn = set(zip(*(x.tolist() for x in line.get_data()), strict=True))
    assert inside.any()
    assert set(zip(K1[inside].tolist(), K2[inside].tolist(), strict=True)) <= drawn
    mesh = next(each for each in ax.collections if isinstance(each, QuadMesh))
    assert np.array_equal(mesh.get_array(), colours(found.unstable))
    assert ("[N m s/rad]" in ax.get_xlabel(), ax.get_ylabel()[-3:]) == (True, "[−]")
    labels = {"stable": 0, "1 unstable pole": 1, "2 unstable poles": 2}
    drawn = dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    for label, count in labels.items():
        if (here := found.unstable == count).any():
            assert drawn[label].get_facecolor()[0, :3] == pytest.approx(mesh.get_array()[here][0])
    assert {"stable", "2 unstable poles"} <= set(drawn)


def test_locus_draws_the_branches_and_their_crossings(records):
    """To the ten digits of |s| that hold on every processor."""
    (found,), _ = records["locus"]
    ax = tfarm.plots.locus(found, ax=axes_for(0))
    drawn = [line.get_xdata() + 1j * line.get_ydata() for line in ax.lines if line.get_linewidth() == 2.6]
    for line, branch in zip(drawn, found.branches, strict=True):  # with more points between those of the record
        assert [line[abs(line - s).argmin()] for s in branch] == pytest.approx(branch, rel=1e-9, abs=0)
    (crossing,) = found.crossings
    (diamond,) = (line.get_data() for line in ax.lines if line.get_marker() == "D")
    assert diamond == ([0], [pytest.approx(crossing.omega, rel=1e-9)])
    label = f"crosses the axis at K2 = {crossing.gain:.4f}, {crossing.omega:.2f} rad/s"
    assert label in ax.get_legend_handles_labels()[1]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Re s [1/s]", "Im s [rad/s]")


@pytest.mark.parametrize(("vary", "stop"), [("K1", 0.6), ("payload_mass", 0.1)])
def test_a_reduced_locus_lies_beside_the_exact_one(vary, stop):
    """Dashed, at its own values: fewer where a parameter of the arm varies."""
    found = tfarm.locus(LAB, LAW, vary, 0.01, stop, points=30, branches=3)
    reduced = reduced_locus(found)
    ax = tfarm.plots.locus(found, reduced=reduced, ax=axes_for(0))
    dashed = (line for line in ax.lines if line.get_linestyle() == "--" and len(line.get_xdata()))
    drawn = [line.get_xdata() + 1j * line.get_ydata() for line in dashed]
    assert np.array(drawn) == pytest.approx(reduced.branches, rel=1e-9, abs=0)
    assert reduced.gain.size == 30 if vary == "K1" else reduced.gain.size < 30


def test_measured_draws_both_curves_and_the_coherence(records):
    (found,), _ = records["measured"]
    upper, middle, lower = tfarm.plots.measured(found, ax=axes_for(3))
    drawn = {line.get_label(): line.get_data() for line in upper.lines}
    data = found.measured
    assert drawn["measured"][0].tolist() == (data.omega / (2 * np.pi)).tolist()
    assert drawn["measured"][1].tolist() == abs(data.values).tolist()
    assert drawn["exact"][1].tolist() == abs(found.curve).tolist()
    assert middle.lines[0].get_ydata().tolist() == np.degrees(np.angle(data.values)).tolist()
    assert lower.lines[0].get_ydata().tolist() == data.coherence.tolist()
    assert [ax.get_ylabel() for ax in (middle, lower)] == ["phase [deg]", "coherence [−]"]
    assert ("[Hz]" in lower.get_xlabel(), upper.get_ylabel()) == (True, "magnitude [N m/(N m)]")


def test_a_comparison_draws_both_responses_and_both_regions(records):
    (found,), _ = records["comparison"]
    upper, lower, plane = tfarm.plots.comparison(found, ax=axes_for(3))
    for data, above, below in zip(found.responses, upper.lines, lower.lines, strict=False):
        assert above.get_xdata().tolist() == data.omega.tolist()
        assert above.get_ydata().tolist() == abs(data.value).tolist()
        assert below.get_ydata().tolist() == data.phase.tolist()
    drawn = {(float(x), float(y)) for line in plane.lines for x, y in zip(*line.get_data(), strict=True)}
    for region, side in zip(found.regions, found.sides, strict=True):
        columns = zip(region.K1.tolist(), region.stable_intervals, strict=True)
        assert {(K1, end) for K1, column in columns for window in column for end in window} <= drawn
        assert (side.law.K1, side.law.K2) in drawn


def test_overlay_draws_both_regions_edges(records):
    (plane, sampled), _ = records["overlay"]
    ax = tfarm.plots.overlay(plane, sampled, ax=axes_for(0))
    drawn = {(float(x), float(y)) for line in ax.lines for x, y in zip(*line.get_data(), strict=True)}
    for region in (plane, sampled):
        columns = zip(region.K1.tolist(), region.stable_intervals, strict=True)
        ends = {(K1, end) for K1, column in columns for window in column for end in window}
        assert len(ends) > 40
        assert ends <= drawn
    assert (LAW.K1, LAW.K2) in drawn
    labels = {"K1 = 0.3, K2 = 0.3", "stable, continuous: every mode", "stable, sampled every 10 ms"}
    assert labels <= set(ax.get_legend_handles_labels()[1])


def test_slew_draws_the_records_at_the_samples_and_between(records):
    (arm, run), _ = records["slew"]
    moment, tip, torque = tfarm.plots.slew(arm, run, ax=axes_for(3))
    (drawn,) = (line for line in moment.lines if line.get_linewidth() == 1.3)
    t, y = (x.tolist() for x in drawn.get_data())
    both = {*zip(run.t.tolist(), run.at_samples.root_moment.tolist(), strict=True)}
    both |= {*zip(run.between.t.tolist(), run.between.root_moment.tolist(), strict=True)}
    assert len(t) == len(both)
    assert set(zip(t, y, strict=True)) == both
    assert t == sorted(t)
    at_samples = dict(zip(*(x.tolist() for x in tip.lines[0].get_data()), strict=True))
    reference = run.at_samples.tip_displacement - arm.length * run.scenario.hub_angle
    assert [at_samples[t] for t in run.t.tolist()] == pytest.approx(1e3 * reference, abs=1e-9)
    assert torque.lines[0].get_ydata().tolist() == run.torque.tolist()
    assert [ax.get_ylabel().split("[")[1] for ax in (moment, tip, torque)] == ["N m]", "mm]", "N m]"]


def test_tuned_gain_draws_the_gain_in_its_guard(records):
    (found,), _ = records["tuned_gain"]
    ax = tfarm.plots.tuned_gain(found, ax=axes_for(0))
    (line,) = (line for line in ax.lines if "K(t)" in str(line.get_label()))
    assert line.get_xdata().tolist() == found.training.result.t.tolist()
    assert line.get_ydata().tolist() == found.training.result.K.tolist()
    (guard,) = ax.patches
    assert (guard.get_y(), guard.get_y() + guard.get_height()) == (found.training.guard.lo, found.training.guard.hi)
    assert ("[s]" in ax.get_xlabel(), ax.get_ylabel()[-3:]) == (True, "[−]")


def test_several_slews_are_told_apart_by_their_names():
    runs = {str(K2): tfarm.simulate(LAB, LAW.having("K2", K2), duration=1.5, count=6) for K2 in (0.0, 0.3, 0.6)}
    moment, *_ = tfarm.plots.slew(LAB, runs, ax=axes_for(3))
    lines = {line.get_label(): line for line in moment.lines if line.get_label() in runs}
    assert lines.keys() == runs.keys()
    assert len({line.get_color() for line in lines.values()}) == 3
    for name, run in runs.items():
        assert lines[name].get_ydata().tolist() == run.at_samples.root_moment.tolist()


def test_of_more_modes_than_axes_the_first_are_drawn():
    axes = axes_for(2)
    assert tfarm.plots.modes(tfarm.modes(LAB, count=5), ax=axes) == tuple(axes)


@pytest.mark.parametrize(("name", "number"), [("bode", 2), ("slew", 3)])
def test_too_few_axes_are_refused_with_how_many_it_takes(name, number, records):
    with pytest.raises(tfarm.ParameterError, match=rf"ax = 1: {number} axes, as figure.subplots\({number}\)"):
        getattr(tfarm.plots, name)(*records[name][0], ax=axes_for(0))


def test_no_file_takes_the_name_of_a_picture_away():
    """A submodule that is imported becomes an attribute of the room, in the place of a function of that name."""
    for module in pkgutil.iter_modules(tfarm.plots.__path__):
        importlib.import_module(f"tfarm.plots.{module.name}")
    assert [name for name in tfarm.plots.__all__ if inspect.ismodule(getattr(tfarm.plots, name))] == []
