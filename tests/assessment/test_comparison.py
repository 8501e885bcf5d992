"""Comparison of two arms or two laws: differences known in closed form; each side as it is alone."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib import image

import tfarm
from tests.shell import answer, refused, run
from tfarm.assessment import comparison
from tfarm.case import Case
from tfarm.loop.sampled_analysis import Analysis
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.schema import Difference, Percent, table, to_dict

BARE, LAB = tfarm.load("sasaki2012"), tfarm.load("sasaki2012-lab")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)
PHASE = "margins in the frequency range: phase margin"
GAINS = "[law]\n[law.hub_rate]\ngain = {}\n[law.root_moment]\ngain = {}\n"


def by_quantity(rows):
    """Values of both sides and the difference by the name of the quantity."""
    return {row.quantity: (row.one, row.other, row.difference) for row in rows}


@pytest.fixture
def files(tmp_path):
    """The paths of law files: mild and wild gains."""
    texts = {"mild": GAINS.format(0.3, 0.3), "wild": GAINS.format(0.3, 1.5)}
    for name, text in texts.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    return {name: str(tmp_path / f"{name}.toml") for name in texts}


def test_four_times_as_stiff_is_twice_as_fast_and_twice_the_damping_twice_the_ratio():
    """w goes with the root of E where G goes with it, to rounding.

    Twice the damping C is twice the ratio, to first order; the shear that C does not damp makes it less by a share of
    C w.
    """
    link = replace(BARE.link, youngs_modulus=4 * BARE.link.youngs_modulus, shear_modulus=4 * BARE.link.shear_modulus)
    found = tfarm.compare([BARE, replace(BARE, link=link, name="stiff")], modes=5)
    rows = by_quantity(found.mode_differences)
    for one, _, apart in (rows[f"mode {mode}: natural frequency"] for mode in range(1, 6)):
        assert apart == pytest.approx(one, rel=1e-13)
    assert found.is_of_arms
    found = tfarm.compare([LAB, LAB.with_numbers(damping=2 * LAB.damping)], names=("C", "2 C"), modes=2)
    for mode, tolerance in ((1, 1e-3), (2, 5e-3)):
        one, _, apart = by_quantity(found.mode_differences)[f"mode {mode}: damping ratio"]
        assert apart == pytest.approx(one, rel=tolerance)


def test_an_arm_compared_with_itself_differs_in_nothing():
    found = tfarm.compare([LAB, LAB], LAW, modes=3)
    assert not found.is_of_arms
    for rows in (found.pole_differences, found.margin_differences):
        assert {row.difference for row in rows} - {None} == {0.0}
    assert found.regions[0] == found.regions[1]


def test_each_side_is_what_it_is_alone():
    other = tfarm.HubFeedback(K1=2.0, K2=-0.2)
    found = tfarm.compare(LAB, [LAW, other], modes=3)
    for side, law, loop in zip(found.sides, (LAW, other), to_dict(found)["loops"], strict=True):
        assert side.loop == tfarm.margins(LAB, law)
        assert loop == to_dict(side.loop)
        assert side.sampled.is_stable == sampled_verdict(Case(LAB, law)).is_stable
        alone = tfarm.closed_loop_poles(LAB, law, 6).values
        assert side.oscillating_poles[:3] == pytest.approx(alone[alone.imag > 0][:3], rel=1e-12)
    delays = [tfarm.margins(LAB, law).exact_delay for law in (LAW, other)]
    apart = by_quantity(found.margin_differences)["delay margin, exact"]
    assert apart == (*delays, pytest.approx(delays[1] - delays[0], rel=1e-12))


def test_poles_are_compared_mode_by_mode_and_what_has_no_partner_apart():
    """Rows 13 and 14 compared modes 13 and 14 of one arm with poles near 7.5e5 rad/s, in shear, of the other.

    Followed from the open loop in small steps of the gains, each pole comes from the mode that it is listed under.
    """
    found = tfarm.compare([BARE, LAB])
    rows, apart = by_quantity(found.pole_differences), found.unpaired_poles
    assert list(rows)[:24:2] == [f"mode {mode}: abs(s)" for mode in range(1, 13)]
    assert [(row.side, row.mode) for row in apart] == [
        ("first", "mode 13"), ("first", "mode 14"), ("second", "none"), ("second", "none")
    ]  # fmt: skip
    assert min(abs(row.pole) for row in apart[2:]) > 7e5
    assert [len(side.oscillating_poles) for side in found.sides] == [14, 14]
    paths = tfarm.locus(LAB, LAW, "all", 0.0, 1.0, 60, 8)
    for mode in range(1, 7):
        ends = paths.branches[paths.mode == mode, -1]
        assert abs(ends) == pytest.approx([rows[f"mode {mode}: abs(s)"][1]], rel=1e-6)


def test_a_loop_of_the_hub_is_paired_with_the_other_hub():
    """K_p and J make a slow pole on both sides: sqrt(Kp/J)."""
    laws = [tfarm.HubFeedback(K1=0.02, Kp=0.02), tfarm.HubFeedback(K1=0.02, Kp=0.04)]
    hub, *others = tfarm.compare(LAB, laws, modes=3).pole_differences
    assert hub.quantity == "the hub: abs(s)"
    assert hub.difference == pytest.approx((np.sqrt(2) - 1) * hub.one, rel=1e-3)
    assert [row.quantity for row in others][1:6:2] == [f"mode {mode}: abs(s)" for mode in (1, 2, 3)]


def test_a_pole_of_the_law_is_no_mode():
    """A resonance of the law at 1.15 of mode 1, which feeds back little: the mode keeps its number."""
    w = 1.15 * float(tfarm.modes(LAB, 1).natural_frequency[-1])
    tuned = tfarm.Law({"hub_rate": ([0.3 * w**2], [1.0, 0.02 * w, w**2]), "hub_angle": 1e-3})
    found = tfarm.compare(LAB, [tfarm.HubFeedback(K1=0.3, Kp=1e-3), tuned], modes=2)
    apart = [abs(row.pole) for row in found.unpaired_poles if (row.side, row.mode) == ("second", "none")]
    assert apart[:1] == pytest.approx([w], rel=0.25)
    assert by_quantity(found.pole_differences).keys() >= {"mode 1: abs(s)", "mode 2: abs(s)"}


def test_the_assignment_of_poles_to_modes():
    """By least total distance, one a mode; a factor of e away is none, and two poles below mode 1 are not the hub's."""
    own = {1: 10j, 2: 60j, 3: 200j}
    assert comparison.poles_by_mode(np.array([-1 + 9j, -2 + 61j]), own) == {1: -1 + 9j, 2: -2 + 61j}
    assert comparison.poles_by_mode(np.array([1j, 11j, 12j]), own) == {0: 1j, 1: 11j}
    assert comparison.poles_by_mode(np.array([1j, 1.5j, 11j, 9e5j]), own) == {1: 11j}
    assert comparison.poles_by_mode(np.array([], complex), own) == {}


def test_margins_are_those_known_apart_with_their_unit(capsys):
    """Without damping any delay is too long: what is exact and what holds in the frequency range are two rows."""
    found = tfarm.compare([BARE, LAB], modes=1)
    alone = [tfarm.margins(arm, side.law).in_band.phase for arm, side in zip((BARE, LAB), found.sides, strict=True)]
    rows = by_quantity(found.margin_differences)
    assert rows[PHASE] == (*alone, pytest.approx(alone[1] - alone[0], rel=1e-9))
    assert (rows["delay margin, exact"][0], rows["peak sensitivity Ms, exact"][2]) == (0.0, None)
    assert rows["K2: stable around it"][1] == "(< -50, 1.0305376)"
    code, out, err = run(capsys, "compare", "sasaki2012", "sasaki2012-lab", "--modes", "1")
    assert (code, err) == (0, "")
    (line,) = [line for line in out.splitlines() if line.startswith(f"{PHASE}  ")]
    assert line.split()[-4:] == ["deg", f"{alone[0]:.8g}", f"{alone[1]:.8g}", f"{alone[1] - alone[0]:.4g}"]


def test_two_laws_are_called_by_their_files_and_an_unstable_loop_has_no_margins(capsys, files, tmp_path):
    laws = ("--law", files["mild"], "--law", files["wild"])
    picture = tmp_path / "both.png"
    found = answer(capsys, "compare", "sasaki2012-lab", *laws, "--modes", "1", "--png", str(picture))
    assert min(image.imread(picture).shape[:2]) > 800
    sides = [(side["name"], side["verdict"]) for side in found["sides"]]
    assert (found["of"], sides) == ("laws", [("mild", "stable"), ("wild", "unstable")])
    margins = {row["quantity"]: row for row in found["margins"]}
    assert (margins["disk margin, exact"]["other"], margins["disk margin, exact"]["difference"]) == (None, None)
    assert PHASE not in margins
    assert [loop["K2"] for loop in found["loops"]] == [0.3, 1.5]
    (tmp_path / "z.toml").write_text(GAINS.format(0.3, 0.3).replace("[law]", "[law]\nperiod = 0.005", 1))
    err = refused(capsys, "compare", "sasaki2012-lab", "--law", files["mild"], "--law", str(tmp_path / "z.toml"))
    assert "period = 0.005" in err  # another one than the chain's


def test_a_law_of_other_signals_is_mapped_over_factor_and_delay():
    """At the delay margin a stable interval of factors ends at 1, and at no further delay at the gain margin."""
    late = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)
    found = tfarm.compare(LAB, [LAW, late], modes=1)
    assert found.regions is None
    delays, reaches = found.reaches
    for side, reach in zip(found.sides, reaches, strict=True):
        (around,) = (each for each in reach[0] if each[0] < 1 < each[1])
        factors = [factor for factor in side.loop.in_band.gain if 0.1 < factor < 3.9]
        assert [end for end in around if 0.1 < end < 3.9] == pytest.approx(factors, rel=1e-6)
        delay = side.loop.exact_delay
        _, windows = side.loop.factor_intervals(np.array([0.0, delay]))
        ends = [end for window in windows for end in window]
        assert min(abs(end - 1.0) for end in ends) < 1e-6
        assert 0 < delay < delays[-1]
    figure = tfarm.plots.comparison.figure(found)
    lines = figure.get_suptitle().replace("\u00a0", " ").splitlines()
    assert [line.partition(":")[0] for line in lines] == [each.name for each in found.sides]
    right = figure.axes[2]
    drawn = {(float(x), float(y)) for line in right.lines for x, y in zip(*line.get_data(), strict=True)}
    for reach in reaches:
        columns = zip((1e3 * delays).tolist(), reach, strict=True)
        assert {(delay, end) for delay, column in columns for window in column for end in window} <= drawn


def test_gains_as_a_law_in_z_are_the_same_loop_at_the_samples():
    """The same numbers act at the same samples, by another method: poles, factors and delay are equal."""
    found = tfarm.compare(LAB, [LAW, tfarm.Law({"hub_rate": 0.3, "root_moment": 0.3}, period=0.01)], modes=2)
    assert found.is_sampled
    assert [side.verdict for side in found.sides] == ["stable", "stable"]
    rows = [row for row in (*found.pole_differences, *found.margin_differences) if row.difference is not None]
    assert {"mode 1: abs(s)", "delay margin", "spectral radius"} <= {row.quantity for row in rows}
    for row in rows:
        assert row.difference == pytest.approx(0.0, abs=1e-8 * abs(row.one or 1.0))
    assert all(isinstance(side.loop, Analysis) for side in found.sides)


def test_a_law_in_z_and_gains_are_compared_at_the_samples_of_both():
    """At the largest stable factor L passes -1 over it; at no further delay the plane's edges are these factors."""
    late = tfarm.Law({"hub_rate": ([0.35, -0.1], [1.0, -0.2]), "root_moment": 0.3}, period=0.01)
    found = tfarm.compare(LAB, [LAW, late], modes=1)
    delays, reaches = found.reaches
    for side, law, reach in zip(found.sides, (LAW, late), reaches, strict=True):
        alone = Analysis(sampled_verdict(Case(LAB, tfarm.Law.of_gains(law) if law is LAW else law)))
        assert side.loop.gain_factors == alone.gain_factors
        assert side.sampled.is_stable == alone.verdict.is_stable
        _, L = side.loop_function
        assert abs(1 + alone.gain_factors[1] * L).min() < 1e-2
        assert alone.gain_factors in reach[0]
        stable = [any(low < 1 < high for low, high in each) for each in reach]
        last = delays[stable].max()
        assert last <= side.delay_margin < last + delays[1]
    upper, _, right = tfarm.plots.comparison.figure(found).axes
    assert upper.get_xlim()[1] == pytest.approx(np.pi / 0.01, rel=1e-3)  # the last point of its grid
    assert right.get_xlabel() == "further delay [ms]"
    answered = to_dict(found)
    assert answered["at_samples"]
    assert [loop["stable"] for loop in answered["loops"]] == [True, True]


@pytest.mark.parametrize(
    ("one", "other", "shown", "read"),
    [
        (1.0, 1.0 + 1e-15, 0.0, "0"), (2.0, 1.0, -1.0, "-1"), (None, 1.0, None, "-"), (1.0, np.inf, None, "-"),
        (Percent(0.02), Percent(0.05), 0.05 - 0.02, "3 percentage points"),
    ],
)  # fmt: skip
def test_a_difference_is_a_number_or_none(one, other, shown, read):
    found = Difference("a", "", one, other)
    assert found.difference == shown
    assert table([found], ["difference"]).columns[0].cells == [read]


def test_python_refuses_what_are_not_two():
    for arms, laws in ((LAB, None), (LAB, LAW), ([LAB] * 3, None), (LAB, [LAW] * 3)):
        with pytest.raises(tfarm.ParameterError, match="two arms, or one arm and two laws"):
            tfarm.compare(arms, laws)
    with pytest.raises(tfarm.ParameterError, match="is no Arm"):
        tfarm.compare(["sasaki2012", LAB])
