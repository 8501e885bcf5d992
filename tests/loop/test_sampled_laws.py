"""Any linear law on the sampled loop: against python-control, models stepped otherwise, edges, Jury's conditions."""

from dataclasses import replace

import control
import numpy as np
import pytest

import tfarm
from tests.dsp.independent import stepped
from tests.loop.law_orders import some_case
from tests.odd_arms import odd_arms
from tests.shared import circle_crossings
from tests.shell import run
from tfarm import HubFeedback, Law, ParameterError
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.dsp.discretise import discretise_law
from tfarm.loop.circle import complete_band
from tfarm.loop.circle_crossings import FACTOR, stable_windows
from tfarm.loop.edges import damping_limit, whole_loop
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict

T = 0.01
LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAWS = {
    "lead": Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "root_moment": 0.1}, delay=0.004),
    "acceleration": Law({"hub_rate": ([0.3], [0.02, 1.0]), "tip_acceleration": ([0.002], [0.02, 1.0])}),
    "along": Law({"hub_rate": 0.3, "moment@0.3": ([0.1], [0.05, 1.0])}, delay=0.013),
    "zero at 2/T": Law({"hub_rate": ([-0.15, 30.0], [1.0, 200.0]), "root_moment": 0.1}),
    "in z": Law({"hub_angle": ([0.4, -0.3], [1.0, -0.5]), "root_moment": ([0.1, 0.0], [1.0, -0.9])}, period=T),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_poles_are_those_of_a_model_stepped_by_matrix_exponentials(law):
    loop = sampled_loop(Case(BARE, law, Chain(sampling=Sampling(delay_samples=1.25))), count=12)
    M = stepped(BARE, discretise_law(law, T), loop.chain, 12)
    mine, theirs = np.sort_complex(loop.poles.z), np.sort_complex(np.linalg.eigvals(M))
    mine, theirs = (z[abs(z) > 0.3] for z in (mine, theirs))
    assert mine.size == theirs.size - loop.has_free_angle
    gap = abs(mine[:, None] - theirs).min(axis=1)
    assert gap.max() < 1e-9  # eigenvalues of a matrix of order 30, one pair of them near 1 twice


def test_a_law_on_the_moment_alone_leaves_the_hub_adrift():
    verdict = sampled_verdict(Case(LAB, Law({"root_moment": ([0.3], [0.01, 1.0])})))
    assert (verdict.word, verdict.log_radius) == ("marginal", 0.0)


def test_an_unstable_cancellation_in_the_law_is_reported_and_grows(capsys, tmp_path):
    law = Law({"hub_angle": {"zeros": [1.2], "poles": [1.2, 0.5], "gain": 0.1}, "hub_rate": 0.3}, period=T)
    found = tfarm.sampled(LAB, law, count=4)
    (words,) = found.warnings
    assert "z = 1.2" in words
    assert (found.verdict.word, found.verdict.slowest) == ("unstable", "a pole of the law")
    assert found.verdict.log_radius == pytest.approx(np.log(1.2), rel=1e-9)
    text = "[law]\nperiod = 0.01\n[law.hub_angle]\nzeros = [1.2]\npoles = [1.2, 0.5]\ngain = 0.1\n"
    (tmp_path / "law.toml").write_text(text)
    assert "the law cancels" in run(capsys, "sampled", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"))[1]


@pytest.mark.parametrize(("number", "seed"), [(2, 3), pytest.param(4, 6, marks=pytest.mark.survey)])
def test_what_is_proven_of_random_laws_is_the_count_of_their_poles(number, seed):
    """By discs around the circle, against the polished eigenvalues of the loop with every mode of the band."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < number:
        case = some_case(rng)
        if case is None or not case.arm.least_damping:
            continue
        band = complete_band(whole_loop(case))
        proven = band.circle.count(band.loop.weights)
        found.append(proven)
        assert proven in (None, (band.full.poles.log_radius > 0).sum())
    assert sum(each is not None for each in found) >= min(number, 3)
    assert any(found)


@pytest.mark.parametrize(("entry", "factor", "change"), [(-1.0, 2.0, 1), (([1.0], [1.0, -0.5]), 1.0, -1)])
def test_a_real_pole_crosses_where_the_law_s_stiffness_is_the_hub_spring_s(entry, factor, change):
    """2 N m/rad hold the hub: k + g C(0) = 0, and one pole passes z = 1, out or in."""
    held = replace(LAB, hub=replace(LAB.hub, stiffness=2.0))
    loop = sampled_loop(Case(held, Law({"hub_angle": entry}), Chain()), count=6)
    (found,) = [each for each in circle_crossings(loop, FACTOR) if each.at == 0.0]
    before, after = (int((loop.times(factor * k).poles.log_radius > 0).sum()) for k in (1 - 1e-7, 1 + 1e-7))
    assert found.t == pytest.approx(factor, rel=1e-9)
    assert found.change == after - before == change


FAINT = ([1e-16], [0.01, 1.0])


@pytest.mark.parametrize(("stiffness", "entry", "windows"), [(0.0, -1.0, []), (2.0, FAINT, [(0.0, np.inf)])])
def test_a_law_whose_factor_moves_no_pole_across_is_stable_or_not_for_all(stiffness, entry, windows):
    arm = replace(LAB, hub=replace(LAB.hub, stiffness=stiffness))
    loop = sampled_loop(Case(arm, Law({"hub_angle": entry}), Chain()), count=6)
    assert stable_windows(loop, FACTOR) == windows
    assert len(circle_crossings(loop, FACTOR)) == 0


def test_margins_end_where_the_verdict_turns():
    found = tfarm.sampled(LAB, LAWS["lead"])
    loop, (low, high) = found.loop, found.gain_factors
    assert (found.verdict.word, low) == ("stable", 0.0)
    assert loop.times(high * (1 - 1e-9)).poles.is_stable
    assert not loop.times(high * (1 + 1e-9)).poles.is_stable
    late = LAWS["lead"].delay / T + found.delay_margin.samples
    for more, stable in ((-1e-6, True), (1e-6, False)):
        assert tfarm.sampled(LAB, replace(LAWS["lead"], delay=(late + more) * T)).verdict.is_stable == stable


@pytest.mark.parametrize(
    ("entries", "others", "key"),
    [
        ({"hub_rate": 0.3}, {"period": 0.02}, "period"),
        ({"hub_angle": ([1.0, 0.0], [1.0])}, {"rule": "zoh"}, "law.hub_angle.num"),
        ({"hub_angle": ([1.0, 0.0], [1.0])}, {"rule": "matched"}, "law.hub_angle.num"),
        ({"hub_rate": ([1.0], [1.0, 1.0])}, {"rule": "zoh", "prewarp": 3.0}, "prewarp"),
        ({"hub_rate": ([1.0], [1.0, 1.0])}, {"prewarp": 400.0}, "prewarp"),
        ({"hub_rate": ([1.0], [1.0, -200.0])}, {}, "rule"),
        ({"hub_rate": 0.3}, {"delay": 3.0}, "delay"),
    ],
)
def test_no_sampled_loop_is_refused_by_its_key(entries, others, key):
    with pytest.raises(ParameterError) as error:
        tfarm.sampled(LAB, Law(entries, **others))
    assert error.value.key == key


@pytest.mark.parametrize("arm", ["free", "damped", "held"])
@pytest.mark.parametrize("law", ["lead", "integrator", "acceleration"])
def test_next_to_z_1_the_loop_goes_as_the_powers_that_are_named(arm, law):
    """whole/fed back at z = 1/(1 - x), x small, is that of the lowest terms: their error is of the order of x."""
    arms = {"free": LAB, "damped": replace(LAB, hub=replace(LAB.hub, friction=0.3)), "held": odd_arms()["pinned"]}
    entries = LAWS | {"integrator": Law({"hub_angle": ([1.0, 3.0], [1.0, 40.0, 0.0])})}
    loop = sampled_loop(Case(arms[arm], entries[law], Chain()), count=6)
    (n, whole), *fed_back = loop.rig.near_one(loop.row)
    lowest = min(order for order, _ in fed_back)
    named = sum(value for order, value in fed_back if order == lowest)
    away = []
    for x in (1e-3, 1e-4):
        A, *B = loop.row * loop.rig.terms(np.array([1 / (1 - x) + 0j]), None, np.ones(1))[:, 0]
        away.append(abs(A / sum(B) / (whole * x**n / (named * x**lowest)) - 1))
    assert away[1] < 0.2 * away[0] < 0.1


def test_from_the_required_damping_on_a_law_is_stable():
    law = Law({"hub_rate": ([6.0], [0.02, 1.0]), "moment@0.5": 0.2}, delay=0.004)
    found = damping_limit(sampled_verdict(Case(LAB, law)).loop, 20).figure
    sides = [sampled_verdict(Case(LAB.with_numbers(damping=share * found.value), law)) for share in (0.999, 1.001)]
    assert (found.is_settled, [each.is_stable for each in sides]) == (True, [False, True])


BLOCKS = {
    "lead": ([2.0, 1.0], [0.01, 1.0]),
    "notch": ([1.0, 0.4, 900.0], [1.0, 24.0, 900.0]),
    "integrator": ([1.0, 3.0], [1.0, 40.0, 0.0]),
    "washout": ([1.0, 0.0], [1.0, 5.0]),
}


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize(("rule", "warp"), [("tustin", 0.0), ("tustin", 25.0), ("zoh", 0.0), ("matched", 0.0)])
def test_the_rules_are_those_of_python_control(name, rule, warp):
    law, continuous = Law({"hub_rate": BLOCKS[name]}, rule=rule, prewarp=warp), control.tf(*BLOCKS[name])
    values = discretise_law(law, T).values
    if rule == "matched" and name in ("integrator", "washout"):  # python-control matches 0 or inf at rest
        assert values(np.exp([1e-6j]))[0, 0] == pytest.approx(complex(continuous(1e-6j / T)), rel=1e-5)
        return
    method, others = {"tustin": "bilinear"}.get(rule, rule), {"prewarp_frequency": warp} if warp else {}
    theirs, z = (
        control.sample_system(continuous, T, method=method, **others),
        np.exp(1j * np.array([0.1, 0.7, 2.0, 3.0])),
    )
    np.testing.assert_allclose(values(z)[0], theirs(z), rtol=1e-9)  # polynomials of python-control lose some digits


@pytest.mark.parametrize("zero", [200.0, 200.0 * (1 - 2**-52), 200.0 * (1 + 1e-9)])
@pytest.mark.parametrize("num", [[-0.5], [0.01, 0.0]], ids=["proper", "improper"])
def test_tustins_rule_keeps_a_zero_at_two_over_the_period(num, zero):
    """Which is at z = infinity; next to it the coefficients are no difference of rounded numbers."""
    law = Law({"hub_rate": (np.polymul(num, [1.0, -zero]).tolist(), [1.0, 200.0])})
    block, z = discretise_law(law, T).parts[0].block, np.exp(1j * np.array([0.1, 1.0, 3.0]))
    s = 2 / T * (z - 1) / (z + 1)
    A, B, C, D = block.matrices()
    found = [(C @ np.linalg.solve(each * np.eye(len(A)) - A, B) + D)[0, 0] for each in z]
    np.testing.assert_allclose(found, np.polyval(num, s) * (s - zero) / (s + 200.0), rtol=1e-12)
    weights = sampled_loop(Case(LAB, law), count=4).in_z
    ((_, _, gain, zeros),) = weights.columns
    own = gain * np.prod(z[:, None] - 1 - zeros, axis=1) / np.prod(z[:, None] - 1 - weights.poles, axis=1)
    np.testing.assert_allclose(own, found, rtol=1e-12)


def test_a_pole_where_tustins_rule_has_none_is_refused():
    for num in ([1.0], [1.0, 2.0, 3.0]):
        with pytest.raises(ParameterError, match="a pole at 200 1/s"):
            discretise_law(Law({"hub_rate": (num, [1.0, -200.0])}), T)


def test_tustins_derivative_is_the_trapezoidal_rule_backwards():
    law = discretise_law(Law({"hub_angle": ([1.0, 0.0], [1.0])}), T)
    z = np.exp(1j * np.array([0.3, 2.0]))
    np.testing.assert_allclose(law.values(z)[0], 2 / T * (z - 1) / (z + 1), rtol=1e-13)


def test_between_crossings_along_one_part_the_count_is_theirs():
    """Random laws, integrators and unstable ones among them, at random factors of either sign."""
    rng, compared = np.random.default_rng(77), 0
    for _ in range(6):
        case = some_case(rng)
        loop = case and sampled_loop(case, count=6)
        for name in loop.law.part_gains if loop else ():
            own = loop.number(name)
            values = own * np.r_[1.0, -(10 ** rng.uniform(-4, 3, 3)), 10 ** rng.uniform(-4, 3, 3)]
            loops = [loop.with_number(name, value) for value in values.tolist()]
            passed = circle_crossings(loop, name).passed(values)
            counts = np.array([(each.poles.log_radius > 0).sum() for each in loops])
            assert (counts - counts[0] == passed - passed[0]).all(), name
            compared += 1
    assert compared > 5


def test_gains_of_a_stiff_arm_have_the_jury_limits():
    """z^2 - 2z + 1 + Kp T^2 (z + 1)/2J + K1 T (z - 1)/J: Kp > 0, K1 > Kp T/2 and K1 < 2J/T."""
    stiff = LAB.with_numbers(length=0.1)
    gains = HubFeedback(K1=0.4 * stiff.turned_inertia / T, Kp=1.0)
    loop = sampled_loop(Case(stiff, gains, Chain()), count=1)
    np.testing.assert_allclose(stable_windows(loop, "Kp"), [(0.0, 2 * gains.K1 / T)], rtol=1e-2)
    np.testing.assert_allclose(stable_windows(loop, "K1"), [(T / 2, 2 * stiff.turned_inertia / T)], rtol=1e-2)


def test_an_angle_gain_that_is_0_lies_at_the_edge_of_its_interval():
    """Apart from z = 1 of the free angle the loop is stable there, and from there on the angle is held."""
    found = tfarm.sampled(LAB, HubFeedback(K1=14.7, K2=-0.26), Chain(), count=6)
    low, high = found.interval("Kp")
    assert (low, found.verdict.is_stable) == (0.0, True)
    held = (found.loop.with_number("Kp", Kp) for Kp in (1e-3, high * 0.999))
    assert all(each.poles.is_stable for each in held)
    driven = replace(found, verdict=replace(found.verdict, loop=found.verdict.loop.with_number("K1", -0.1), band=None))
    assert driven.interval("Kp") is None  # whatever its windows


def test_only_a_part_that_one_signal_has_to_itself_has_a_name():
    both = Law.of_matrices([[0.5]], [[1.0, 1.0]], [[1.0]], [[0.1, 0.2]], ["hub_rate", "root_moment"], period=T)
    assert both.part_gains == {}
    assert LAWS["lead"].part_gains == {"hub_angle.gain": (0, 1.0), "root_moment": (1, 0.1)}
    law = LAWS["in z"]
    for name, (part, value) in law.part_gains.items():
        twice = law.with_factors([2.0 if place == part else 1.0 for place in range(2)])
        z = np.array([0.3 + 0.4j])
        np.testing.assert_allclose(twice.values(z), law.with_number(name, 2 * value).values(z), rtol=1e-14)
