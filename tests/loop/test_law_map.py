"""Maps over two numbers of a law: against full counts at single points, gains at the hub, and the command."""

import json
from importlib import import_module

import numpy as np
import pytest

import tfarm
from tests.shared import remember, sized, thinned
from tests.shell import run
from tfarm import ConvergenceError, Law, ParameterError
from tfarm.loop.loop import Loop
from tfarm.loop.plane import between, plane
from tfarm.loop.stability import stability
from tfarm.loop.windows import through_infinity, unstable_below

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)


@pytest.mark.parametrize(
    ("vary", "x", "y"),
    thinned(
        [
            (("hub_angle.num.0", "tip_acceleration.num.0"), (-1, 10), (-2, 2)),
            (("delay", "gain"), (0, 0.03), (-1, 9)),
            (("gain", "delay"), (-1, 9), (0, 0.03)),
            (("hub_angle.den.0", "gain"), (0.001, 0.1), (-1, 60)),
        ],
        2,
    ),
)
@pytest.mark.parametrize("points", sized(2, 4))
def test_counts_are_those_of_full_searches(vary, x, y, points):
    found = plane(Loop(LAB, LAW), vary, between(*x, 8), between(*y, 10))
    assert len(np.unique(found.unstable)) > 2
    for i, j in np.random.default_rng(1).integers((8, 10), size=(points, 2)):
        law = LAW.having(vary[0], found.x[i]).having(vary[1], found.y[j])
        assert stability(LAB, law, found.band).unstable_roots == found.unstable[j, i], law


@pytest.mark.parametrize("vary", [("hub_angle.den.0", "gain"), ("gain", "hub_angle.den.0")])
def test_where_a_filter_turns_over_a_pole_has_passed_infinity(vary):
    """With T < 0 in T s + 1 a pole is unstable that no crossing of the axis brought there."""
    ranges = {"hub_angle.den.0": [-0.1, -0.01, 0.03], "gain": [-1.0, 1.0, 20.0]}
    x, y = (np.array(ranges[each]) for each in vary)
    found = plane(Loop(LAB, LAW), vary, x, y)
    for i, j in np.ndindex(x.size, y.size):
        loop = Loop(LAB, LAW.having(vary[0], x[i]).having(vary[1], y[j]))
        assert unstable_below(loop, found.band) == found.unstable[j, i]


def test_the_gain_that_takes_up_all_waves_of_an_arm_without_a_hub_brings_a_pole_to_infinity():
    """At C = 0 a hub without inertia feels the impedance of an endless beam far right: I sqrt(E rho)."""
    arm = BARE.having(hub_inertia=0.0)
    far = np.array([1e6, 1e7, 1e8], complex) * tfarm.modes(arm, 1).natural_frequency[1]
    drive, (_, rate, _), _ = Loop(arm, Law({"hub_rate": 1.0})).signals.parts(far)
    impedance = arm.link.section.second_moment * np.sqrt(arm.link.youngs_modulus * arm.link.density)
    found = through_infinity(drive, rate)
    assert (found.at, found.change) == (np.inf, -1)  # right of the axis at smaller gains alone, farther right
    assert found.t == pytest.approx(-impedance, rel=1e-8)
    assert through_infinity(drive * far, rate) is None


@pytest.mark.parametrize(
    ("vary", "key"),
    [(("gain", "gain"), "vary"), (("gain", "hub_speed"), "law"), (("gain", "hub_angle.num.7"), "law")],
)
def test_what_is_no_pair_of_numbers_is_refused(vary, key):
    with pytest.raises(ParameterError) as error:
        plane(Loop(LAB, LAW), vary, between(0, 1, 3), between(0, 1, 3))
    assert error.value.key == key


def test_the_command_writes_what_the_map_says(capsys, tmp_path, monkeypatch):
    remember(monkeypatch, import_module("tfarm.loop.plane"), "plane")  # two commands ask for the same
    text = "[law]\ndelay = 0.002\n[law.hub_angle]\nnum = [2.0, 1.0]\nden = [0.01, 1.0]\n"
    (tmp_path / "law.toml").write_text(text)
    ranges = ("--vary", "gain=0,9", "--vary", "delay=0,0.03", "--points", "3")
    code, out, err = run(capsys, "map", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), *ranges, "--json")
    assert (code, err) == (0, "")
    law = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)
    found = plane(Loop(LAB, law), ("gain", "delay"), between(0, 9, 3), between(0, 0.03, 3))
    assert json.loads(out)["unstable_roots"] == found.unstable.tolist()
    code, out, _ = run(
        capsys, "map", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), *ranges, "--csv", str(tmp_path / "m.csv")
    )
    assert (tmp_path / "m.csv").read_text().splitlines()[0] == "gain,delay,unstable_roots"
    assert run(capsys, "map", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), "--vary", "gain=0,9")[0] == 2


def test_a_map_around_a_law_s_own_resonance_counts_as_the_verdict_does():
    """Two zeros close to each other turn the phase once around between two points of a contour of even steps."""
    law = Law({"hub_angle": 1.0, "hub_rate": 0.3, "tip_deflection": ([-100.0], [1.0, 2 * 0.02 * 39.487, 39.487**2])})
    lab, values = tfarm.load("sasaki2012-lab"), np.linspace(0.9, 1.1, 3)
    assert stability(lab, law).is_stable
    assert plane(Loop(lab, law), ("hub_angle", "tip_deflection.num.0"), values, values).stable.all()


def test_a_map_whose_counts_do_not_hold_at_its_corners_is_refused(monkeypatch):
    """As if a pair had come into the band through its top, on the way to the last corner."""
    module = import_module("tfarm.loop.plane")
    counted = module.unstable_below

    def other(loop, band):
        numbers = loop.law.numbers  # a factor is multiplied into them
        is_last = numbers["hub_angle.num.0"] == 20 * 2.0 and numbers["hub_angle.den.1"] == 3.0
        return counted(loop, band) + 2 * is_last

    monkeypatch.setattr(module, "unstable_below", other)
    with pytest.raises(ConvergenceError, match=r"at gain = 20, hub_angle.den.1 = 3 .* ask for a smaller range"):
        plane(Loop(LAB, LAW), ("gain", "hub_angle.den.1"), np.array([1.0, 5.0, 20.0]), np.array([0.5, 1.0, 3.0]))


def test_where_two_poles_meet_at_rest_their_count_goes_on_as_the_lag_says():
    """J s^2 + g (1 - 0.1 s): one pole right of the axis for g < 0, and both for g > 0."""
    law, gains = Law({"hub_angle": ([-0.1, 1.0], [1e-3, 1.0])}), np.array([-0.02, 0.02])
    found = tfarm.map(LAB, np.array([1e-3, 2e-3]), gains, law=law, vary=("hub_angle.den.0", "gain"))
    assert found.unstable.tolist() == [[1, 1], [2, 2]]
