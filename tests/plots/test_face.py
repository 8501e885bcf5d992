"""Pictures from Python: what is drawn are the record's own numbers, in the axes that are given and in no other."""

import importlib
import inspect
import pkgutil
import re
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

import tfarm
from tests.plots.labels import complaints, drawn
from tests.shared import thinned
from tests.studies.pictured import planted_study
from tfarm import Law
from tfarm.digits import plain
from tfarm.dsp import Chain, ReferenceShaping
from tfarm.fitting.data import Measured
from tfarm.fitting.runs import RigRun
from tfarm.loop.circle_crossings import sampled_map
from tfarm.loop.loci import reduced_locus
from tfarm.loop.nyquist import compress_radius
from tfarm.plots.labels import number_label
from tfarm.plots.regions import colours, contours
from tfarm.spectrum.gains import default_gains
from tfarm.synthesis.trade_off import FrontPoint, TradeOff
from tfarm.tuner import Plan

mpl.use("Agg")

LAB = tfarm.load("sasaki2012-lab")
MICRO = Path(__file__).parents[1] / "data" / "reproductions" / "micro2.toml"
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)
LEAD = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_deflection": ([0.5], [0.02, 1.0])})
# from lax to strict limits: value, time constant and margins of the law of each, and whether it meets them
FRONT = (
    FrontPoint(0.4, 0.0, 0.09, 9.0, 50.0, 1.1, 1.9, True, {"K1": 4.0, "K2": 0.1}),
    FrontPoint(1.0, 0.0, 0.16, 12.0, 55.0, 1.2, 1.8, True, {"K1": 3.0, "K2": 0.2}),
    FrontPoint(1.9, 0.5, 0.4, 13.0, 60.0, 1.3, 1.7, False, {"K1": 2.0, "K2": 0.3}),
)
AXES = {
    "comparison": 3,
    "bode": 2,
    "loop": 2,
    "measured_response": 3,
    "modes": 3,
    "prediction": 2,
    "reference": 2,
    "slew": 3,
    "step": 4,
    "study": 4,
}
AXES |= {"study_scatter": 6}  # of a plot that has several
PICTURES = sorted({*tfarm.plots.__all__} - {"animate", "column"})
OTHERS = [f"{name} of a rig" for name in ("gain_map", "nyquist", "disc", "bode", "locus", "loop", "nichols")]
OTHERS += ["locus of a law", "gain_map of a law"]


@pytest.fixture(autouse=True)
def no_figure_left_open():
    """What a test asks pyplot for it closes again."""
    pyplot.close("all")
    yield
    left = pyplot.get_fignums()
    pyplot.close("all")
    assert left == []


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """What a plot takes, by its name and further words: of any law, and of a rig without damping, driven by voltage.

    Each is made when a test first wants it.
    """
    K1, K2 = np.linspace(0.05, 2.0, 40), np.linspace(-1.0, 1.5, 41)
    plane = cache(lambda: tfarm.map(LAB, K1, K2))
    rig = tfarm.load("quanser-flexlink")
    study = cache(lambda: planted_study(tmp_path_factory.mktemp("study")))
    law, unit = default_gains(rig), rig.input_per_torque
    factors, delays = np.linspace(0.1, 3.0, 8), np.linspace(0.0, 0.03, 9)
    makers = {
        "comparison": lambda: [tfarm.compare([LAB, LAB.with_numbers(hub_inertia=0.2)], modes=2)],
        "bode": lambda: [tfarm.bode(LAB, "root_moment", (1.0, 300.0))],
        "gain_map": lambda: [plane()],
        "locus": lambda: [tfarm.locus(LAB, LAW, "K2", -1.0, 1.6, points=60, branches=3)],
        "measured_response": lambda: [tfarm.overlay(LAB, sweep())],
        "modes": lambda: [tfarm.modes(LAB, count=3)],
        **dict.fromkeys(("nyquist", "disc"), lambda: [tfarm.nyquist(LAB, LAW)]),
        "loop": lambda: [tfarm.loop_function(LAB, LAW, Chain())],
        "nichols": lambda: [tfarm.margins(LAB, LAW)],
        "sensitivity": lambda: [tfarm.loop_function(LAB, LAW)],
        "gain_regions": lambda: [plane(), sampled_map(tfarm.sampled(LAB, LAW, count=8).verdict.loop, K1, K2)],
        "sketch": lambda: [LAB],
        "prediction": lambda: [tfarm.predict(LAB, pulse_run())],
        "tuned_gain": lambda: [tfarm.tune(LAB, Plan(trials=1))],
        "slew": lambda: [LAB, tfarm.simulate(LAB, LAW, duration=2.0, count=8, between=4)],
        **dict.fromkeys(("study", "study_band", "study_scatter"), lambda: [study()]),
        "step": lambda: [tfarm.step(LAB, LAW, scenario_name="slew", duration=2.0)],
        "trade_off": lambda: [TradeOff("lab", "K1-K2", "settling time", "s", FRONT, (LAW, LAW))],
        "reference": lambda: [tfarm.reference(LAB, LAW, Chain(reference=ReferenceShaping(shaper="ZV")))],
        "locus of a law": lambda: [tfarm.locus(LAB, LEAD, "gain", 0.0, 2.0, 10, 3)],
        "gain_map of a law": lambda: [tfarm.map(LAB, factors, delays, law=LEAD, vary=("gain", "delay"))],
        "bode of a rig": lambda: [tfarm.bode(rig, "root_moment", (1.0, 1000.0))],
        **dict.fromkeys(("loop of a rig", "nichols of a rig"), lambda: [tfarm.loop_function(rig, law)]),
        **dict.fromkeys(("nyquist of a rig", "disc of a rig"), lambda: [tfarm.nyquist(rig, law)]),
        "locus of a rig": lambda: [tfarm.locus(rig, law, "K2", -unit, 1.6 * unit, points=40, branches=4)],
        "gain_map of a rig": lambda: [tfarm.map(rig, np.linspace(-1, 4, 40) * law.K1, np.linspace(-1, 1.5, 41) * unit)],
    }
    return cache(lambda name: makers[name]())


def pulse_run():
    """A pulse of torque that turns the hub, as a rig might have it."""
    t = 0.01 * np.arange(100)
    torque = np.where(t < 0.2, 0.5, 0.0)
    outputs = {"hub_angle": 0.1 * np.minimum(t, 0.2), "root_moment": 0.1 * np.sin(70 * t)}
    return RigRun(period=0.01, outputs=outputs, input=torque)


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


@pytest.mark.parametrize("name", [*thinned(PICTURES, 2), *thinned(OTHERS, 2)])
def test_a_picture_in_given_axes_and_on_its_own(name, records):
    """Nothing else is opened for the first; the other has the look of the pages, whatever the user's settings are.

    Both show the same.  Every axis has its quantity and unit; no words overlap, nor lie on a frame or a curve.
    """
    plot, count = getattr(tfarm.plots, name.split()[0]), AXES.get(name.split()[0], 0)
    given = axes_for(count)
    assert as_tuple(plot(*records(name), ax=given)) == as_tuple(given)
    assert pyplot.get_fignums() == []
    axes = [axis for ax in as_tuple(given) if ax.axison for axis in (ax.xaxis, ax.yaxis)]
    named = [axis for axis in axes if axis.get_ticklocs().size and axis.get_tick_params().get("labelbottom", True)]
    assert [axis for axis in named if not re.search(r"\w.* \[.+\]", axis.get_label_text())] == []
    theirs = ("xtick.labelsize", "ytick.labelsize", "axes.labelsize", "font.size")
    with mpl.rc_context(dict.fromkeys(theirs, 31.0)):
        own = as_tuple(plot(*records(name)))
        (figure,) = map(pyplot.figure, pyplot.get_fignums())
        assert [ax.get_figure() for ax in own] == [figure] * max(1, count)
        words = drawn(figure)  # matplotlib makes ticks only when it draws
    assert max(text.get_fontsize() for text, _ in words) < 12
    assert len(words) > 2
    assert complaints(figure) == []
    for here, there in zip(as_tuple(given), own, strict=True):
        assert here.lines or here.images or here.collections
        for mine, other in zip(here.lines, there.lines, strict=True):
            np.testing.assert_array_equal(mine.get_xydata(), other.get_xydata())
    pyplot.close(figure)


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


@pytest.mark.parametrize("name", PICTURES)
def test_a_wrong_argument_of_a_picture_is_refused_with_the_function_to_use(name, records):
    """The first and the last argument of each picture, one at a time; other figures are left alone."""
    right = records(name)
    for place in {0, len(right) - 1}:
        for wrong in (3, LAW, tfarm.transfer(LAB, "root_moment")):
            given = [wrong if n == place else each for n, each in enumerate(right)]
            with pytest.raises(tfarm.ParameterError, match=r"give (what )?tfarm\.\w+"):
                getattr(tfarm.plots, name)(*given)
    assert pyplot.get_fignums() == []


def test_overlapping_words_are_reported():
    """The tests above find none."""
    figure = Figure(figsize=(4.0, 3.0))
    ax = figure.add_axes((0.1, 0.1, 0.8, 0.8))
    ax.plot([0, 1, np.nan, 1, 1], [0, 1, np.nan, 0, 1], color="#0060a8")
    ax.set(xlim=(0, 1), ylim=(0, 1))
    for x, y, text in ((0.5, 0.5, "on the line"), (0.1, 0.8, "one"), (0.12, 0.81, "other"), (0.97, 0.3, "frame")):
        ax.text(x, y, text)
    found = complaints(figure)
    assert {"'on the line' on a curve", "'one' on 'other'", "'frame' across a frame"} <= set(found)
    assert "'one' on a curve" not in found


@pytest.mark.parametrize("name", ["nyquist", "disc"])
def test_nyquist_draws_the_loop_function_with_its_verdict(name, records):
    """Off the arcs past poles every point of the contour is on a line, in a disc at r/(1 + r) for its size r."""
    (data,) = records(name)
    ax = getattr(tfarm.plots, name)(data, ax=axes_for(0), name="mine")
    drawn = {complex(x, y) for line in ax.lines for x, y in zip(*line.get_data(), strict=True)}
    upper = (data.L if name == "nyquist" else compress_radius(data.L))[~data.is_arc]
    assert set(upper.tolist()) | set(upper.conj().tolist()) <= drawn
    assert ax.get_title("left" if name == "nyquist" else "center").split("\n") == [
        f"mine: {data.verdict.word.upper()}",
        "K1 = 0.3, K2 = 0.3",
        f"encirclements of −1: {data.encirclements};  unstable poles: {data.verdict.unstable_roots}",
    ]


def test_modes_draws_the_shapes_with_their_nodes(records):
    (found,) = records("modes")
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
    (found,) = records("gain_map")
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


def test_numbers_of_crowded_contours_do_not_touch():
    """Level lines, ever closer towards the upper edge."""
    figure, place = Figure(), np.linspace(0.0, 1.0, 50)
    ax = figure.subplots()
    ax.set(xlim=(0, 1), ylim=(0, 1))
    contours(place, place, np.tile(0.1 * (1.02 - place[:, None]) ** 1.2, 50), ax)
    assert len(ax.texts) > 4
    assert [each for each in complaints(figure) if " on '" in each] == []


def test_locus_draws_the_branches_and_their_crossings(records):
    """To the ten digits of |s| that hold on every processor."""
    (found,) = records("locus")
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
def test_a_reduced_locus_is_drawn_with_the_exact_one(vary, stop):
    """Dashed, at its own values: fewer where a parameter of the arm varies."""
    found = tfarm.locus(LAB, LAW, vary, 0.01, stop, points=30, branches=3)
    reduced = reduced_locus(found)
    ax = tfarm.plots.locus(found, reduced=reduced, ax=axes_for(0))
    dashed = (line for line in ax.lines if line.get_linestyle() == "--" and len(line.get_xdata()))
    drawn = [line.get_xdata() + 1j * line.get_ydata() for line in dashed]
    assert np.array(drawn) == pytest.approx(reduced.branches, rel=1e-9, abs=0)
    assert reduced.gain.size == 30 if vary == "K1" else reduced.gain.size < 30


def test_measured_draws_both_curves_and_the_coherence(records):
    (found,) = records("measured_response")
    upper, middle, lower = tfarm.plots.measured_response(found, ax=axes_for(3))
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
    (found,) = records("comparison")
    upper, lower, plane = tfarm.plots.comparison(found, ax=axes_for(3))
    for data, above, below in zip(found.responses, upper.lines, lower.lines, strict=False):
        assert above.get_xdata().tolist() == data.omega.tolist()
        assert above.get_ydata() == pytest.approx(20 * np.log10(abs(data.value)), rel=1e-13, abs=1e-12)
        assert below.get_ydata().tolist() == data.phase.tolist()
    drawn = {(float(x), float(y)) for line in plane.lines for x, y in zip(*line.get_data(), strict=True)}
    for region, side in zip(found.regions, found.sides, strict=True):
        columns = zip(region.K1.tolist(), region.stable_intervals, strict=True)
        assert {(K1, end) for K1, column in columns for window in column for end in window} <= drawn
        assert (side.law.K1, side.law.K2) in drawn


def test_overlay_draws_both_regions_edges(records):
    plane, sampled = records("gain_regions")
    ax = tfarm.plots.gain_regions(plane, sampled, ax=axes_for(0))
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
    arm, run = records("slew")
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
    (found,) = records("tuned_gain")
    ax = tfarm.plots.tuned_gain(found, ax=axes_for(0))
    (line,) = (line for line in ax.lines if "K(t)" in str(line.get_label()))
    assert line.get_xdata().tolist() == found.training.result.t.tolist()
    assert line.get_ydata().tolist() == found.training.result.K.tolist()
    (guard,) = ax.patches
    assert (guard.get_y(), guard.get_y() + guard.get_height()) == (found.training.guard.lo, found.training.guard.hi)
    assert ("[s]" in ax.get_xlabel(), ax.get_ylabel()[-3:]) == (True, "[−]")


def test_of_more_modes_than_axes_the_first_are_drawn_with_the_digits_of_their_nodes():
    """Of an arm of 5 cm a node lies less than 0.1 mm from the hub."""
    axes, small = axes_for(4), tfarm.modes(tfarm.load(MICRO), count=5)
    assert tfarm.plots.modes(small, ax=axes) == tuple(axes)
    assert small.nodes[4].min() < 1e-4
    assert [ax.get_title("left").split("[m]: ")[1] for ax in axes] == [
        ", ".join(plain(node, 3) for node in nodes) for nodes in small.nodes[1:5]
    ]


@pytest.mark.parametrize(("name", "number"), [("bode", 2), ("slew", 3)])
def test_too_few_axes_are_refused_with_how_many_it_takes(name, number, records):
    with pytest.raises(tfarm.ParameterError, match=rf"ax = 1: {number} axes, as figure.subplots\({number}\)"):
        getattr(tfarm.plots, name)(*records(name), ax=axes_for(0))


def test_no_file_takes_the_name_of_a_picture_away():
    """A submodule that is imported becomes an attribute of the room, in the place of a function of that name."""
    for module in pkgutil.iter_modules(tfarm.plots.__path__):
        importlib.import_module(f"tfarm.plots.{module.name}")
    assert [name for name in tfarm.plots.__all__ if inspect.ismodule(getattr(tfarm.plots, name))] == []
