"""Pictures of the loop function: labels are the card's, curves those of python-control on a reduced model."""

import re

import control
import numpy as np
import pytest
from matplotlib.figure import Figure

import tfarm
from tests.odd_arms import odd_arms
from tests.plots.labels import complaints
from tfarm.assessment.card import card_of, reference_damping
from tfarm.dsp import Chain, Sampling

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)
CHAIN = Chain(sampling=Sampling(period=0.01))
MARGIN = re.compile(r"(GM|PM|Ms|Mt) (\S+) (?:dB |deg )?at (\S+) rad/s(, sampled)?")


@pytest.fixture(scope="module")
def model():
    """The loop by python-control on a model of twenty modes with a static remainder."""
    plant = tfarm.reduce(LAB, ["hub_rate", "root_moment"], order=40).state_space()
    return control.StateSpace([], [], [], [[LAW.K1, LAW.K2]]) * plant


@pytest.fixture(scope="module")
def both():
    return tfarm.loop_function(LAB, LAW, CHAIN)


def labels(*axes):
    """Numbers of the margins in the legend, by name and whether of the sampled loop."""
    every = [text for ax in axes for text in ax.get_legend_handles_labels()[1]]
    found = [match for text in every if (match := MARGIN.search(text))]
    return {(each[1], bool(each[4])): (float(each[2]), float(each[3])) for each in found}


def line(ax, label):
    return next(each for each in ax.get_lines() if str(each.get_label()).startswith(label))


def test_labels_are_the_numbers_of_the_card_of_both_loops(both):
    """Which are those of python-control on a reduced model (tests/assessment/test_card.py)."""
    card = tfarm.result_card(LAB, LAW, CHAIN)
    found = labels(*tfarm.plots.loop(both, ax=Figure().subplots(2)))
    found |= labels(tfarm.plots.sensitivity(both, ax=Figure().subplots()))
    for side, sampled in ((card.continuous, False), (card.sampled, True)):
        for name, of in (("GM", side.gain_margin), ("PM", side.phase_margin), ("Ms", side.peak_sensitivity)):
            assert found[name, sampled] == (float(f"{of.value:.4g}"), float(f"{of.omega:.4g}"))


def test_of_an_undamped_arm_it_is_the_loop_with_which_the_card_grades():
    curve, card = tfarm.loop_function(BARE, LAW), tfarm.result_card(BARE, LAW)
    assert curve.margins.phase_margin == card.continuous.phase_margin[:2] or (
        abs(curve.margins.phase), curve.margins.at["phase"]
    ) == card.continuous.phase_margin[:2]  # fmt: skip
    assert curve.arm.damping == reference_damping(BARE)
    assert (curve.stability, "undamped model" in curve.note) == ("stable", True)


def test_a_margin_is_a_line_from_the_curve_to_one():
    found = tfarm.margins(LAB, LAW)
    card, (upper, lower) = card_of(found, Chain()), Figure().subplots(2)
    tfarm.plots.loop(found, ax=(upper, lower))
    (gain,) = (each for each in upper.get_lines() if each.get_linewidth() == 1.6)
    assert gain.get_xdata() == pytest.approx([card.gain_margin.omega] * 2)
    assert gain.get_ydata() == pytest.approx([-card.gain_margin.value, 0.0])
    (phase,) = (each for each in lower.get_lines() if each.get_linewidth() == 1.6)
    assert abs(np.ptp(phase.get_ydata())) == pytest.approx(card.phase_margin.value)
    s = 1j * phase.get_xdata()[:1]
    L = found.stability.loop.loop_function(s)
    assert np.degrees(np.angle(L)) == pytest.approx(phase.get_ydata()[1:], abs=1e-4)
    assert abs(L) == pytest.approx(1.0, abs=1e-5)


def test_nichols_draws_the_curve_of_python_control(model):
    """Of `nichols_plot` the phase to whole turns; |T| on a contour and |S| on that of Ms are constant."""
    ax = tfarm.plots.nichols(tfarm.margins(LAB, LAW), ax=Figure().subplots())
    curve = tfarm.margins(LAB, LAW).curve
    slow = curve.omega < 1e3
    x, y = line(ax, "continuous-time").get_data()
    phase, size = x[~np.isnan(x)][slow], y[~np.isnan(x)][slow]
    L = model(1j * curve.omega[slow])
    assert size == pytest.approx(20 * np.log10(abs(L)), abs=0.03)
    assert abs((phase - np.degrees(np.angle(L)) + 180) % 360 - 180).max() < 0.3
    assert (phase.min() > -360, phase.max() <= 0) == (True, True)
    sizes = set()
    for each in ax.get_lines():
        x, y = np.array(each.get_data(), dtype=float)
        x, y = x[np.isfinite(x)], y[np.isfinite(x)]
        L = 10 ** (y / 20) * np.exp(1j * np.radians(x))
        if str(each.get_label()).startswith("|T|"):
            T = 20 * np.log10(abs(L / (1 + L)))
            assert np.ptp(T) < 1e-9
            sizes.add(round(float(T.mean()), 6))
        elif each.get_label() == "Ms = 2":
            assert abs(1 / (1 + L)) == pytest.approx(np.full(L.size, 2.0))
    assert {0.25, 0.5, 1.0, 3.0, 6.0, -3.0, -6.0} <= sizes


def test_s_and_t_add_to_one_and_peak_at_their_marks(both):
    for each in both.sides:
        S = 1 / (1 + each.L)
        assert 10 ** (each.sensitivity / 20) == pytest.approx(abs(S), rel=1e-12)
        assert 10 ** (each.complementary / 20) == pytest.approx(abs(1 - S), rel=1e-9, abs=1e-12)
    ax = tfarm.plots.sensitivity(both, ax=Figure().subplots())
    for name in ("S", "T"):
        for kind, words in (("continuous-time", ""), ("sampled", ", sampled")):
            drawn = line(ax, f"|{name}|, {kind}").get_ydata().max()
            marks = [(each, MARGIN.fullmatch(str(each.get_label()))) for each in ax.get_lines()]
            (mark,) = (each for each, of in marks if of and (of[1], of[4] or "") == (f"M{name.lower()}", words))
            assert mark.get_ydata()[0] == pytest.approx(drawn, abs=0.02)


@pytest.mark.parametrize("T", [2.5e-4, 0.00025186900597782517])
def test_the_curve_has_each_frequency_once_and_reaches_its_peak(T):
    """Where the sampled loop has a pole so near to the circle that angles about it are equal by rounding."""
    law = tfarm.Law({"hub_angle": ([0.02645123039008574, -0.023806107351077167], [1.0, -0.2])}, period=T)
    found = tfarm.loop_function(odd_arms()["micro"], law, Chain(sampling=Sampling(period=T)))
    assert np.diff(found.omega).min() > 0
    assert 10 ** (found.sensitivity.max() / 20) == pytest.approx(found.margins.peak_sensitivity, rel=1e-2)


def test_the_sampled_loop_is_that_of_a_hold_and_a_sampler(both):
    """At low frequency the hold and the delay of its half period alone: L(iw) e^{-iwT/2} w T/2 over its sine."""
    side, T = both, CHAIN.sampling.period
    slow = side.omega < 3.0
    omega = side.omega[slow]
    delay = CHAIN.sampling.delay_samples * T
    L = tfarm.margins(LAB, LAW).stability.loop.loop_function(1j * omega)
    ratio = side.L[slow] / L
    assert abs(np.unwrap(np.angle(ratio)) + omega * (T / 2 + delay)).max() < 2e-3
    assert abs(ratio) == pytest.approx(np.ones(omega.size), rel=2e-3)


def test_the_circle_of_its_ms_touches_the_nyquist_curve():
    """The distance of L from -1 is 1/Ms, nowhere less."""
    data = tfarm.nyquist(LAB, LAW)
    ax = tfarm.plots.nyquist(data, ax=Figure().subplots())
    (zoom,) = ax.child_axes
    circle = line(zoom, "radius 1/Ms")
    radius = np.hypot(circle.get_xdata() + 1, circle.get_ydata())
    assert radius == pytest.approx(np.full(radius.size, 1 / tfarm.margins(LAB, LAW).in_band.peak_sensitivity))
    x, y = line(zoom, "ω > 0").get_data()
    assert np.nanmin(np.hypot(x + 1, y)) > radius[0] * (1 - 1e-9)
    start = (x + 1 + 1j * y)[:-1]
    step = np.diff(x + 1j * y)
    foot = np.clip(-(start * step.conj()).real / abs(step) ** 2, 0, 1)  # of each drawn piece the point next to -1
    assert np.nanmin(abs(start + foot * step)) == pytest.approx(radius[0], rel=1e-3)
    unit = line(ax, "|L| = 1")
    assert np.hypot(*unit.get_data()) == pytest.approx(np.ones(721))


@pytest.mark.parametrize("name", ["loop", "nichols", "sensitivity"])
def test_an_unstable_loop_and_one_without_feedback_have_curves_and_no_margins(name):
    """Without feedback S is one and nothing crosses."""
    bare = tfarm.loop_function(LAB, tfarm.HubFeedback())
    assert not bare.sensitivity.any()
    for found, word in ((tfarm.margins(LAB, LAW.with_number("K2", 1.5)), "unstable"), (bare, bare.stability)):
        figure = getattr(tfarm.plots, name).figure(found)
        assert (labels(*figure.axes), complaints(figure)) == ({}, [])
        assert f"continuous-time: {word}" in " ".join(figure.axes[0].get_legend_handles_labels()[1])


def test_of_a_law_in_z_it_is_the_sampled_loop_alone():
    law = tfarm.Law({"hub_rate": ([0.3], [1.0])}, period=0.01)
    found = tfarm.loop_function(LAB, law)
    assert (found.period, found.continuous) == (0.01, None)
    assert found.margins.phase_margin == tfarm.result_card(LAB, law).sampled.phase_margin[:2]
