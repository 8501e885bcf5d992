"""Laws of high order, whose poles lie next to z = 1, and what is known of an integrator there."""

from pathlib import Path

import flint
import numpy as np
import pytest

import tfarm
from tests.loop.law_orders import BITS, law_in_balls, laws, truth
from tests.shared import sized
from tests.survey import each_of, tally
from tfarm import Law
from tfarm.arm.law_tables import load_law
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Sampling, load_chain
from tfarm.dsp.discretise import acting_law, law_in_z, with_estimate
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_analysis import Analysis
from tfarm.loop.sampled_verdict import sampled_verdict

LAB, FILES = tfarm.load("sasaki2012-lab"), Path(__file__).parents[1] / "data" / "reproductions"
T = 0.01
NUM = [0.00169331414232833, 0.03993113080787154, 0.391332712647419, 1.378767566695909, 2.4377415154961057]
DEN = [1.0589339194859544e-05, 0.0012005021651140626, 0.015525504839968703, 0.140135637928477, 0.33676102126880014]
SLOW = Law({"hub_angle": ([*NUM, 2.647353428853636], [*DEN, 1.0])})  # poles from 3 to 100 rad/s
LAG = np.poly([-2.0, -2.2, -2.4, -2.5, -2.6, -2.8, -3.0, -3.1]).tolist()
CLUSTER = {"hub_angle": ([0.2 * LAG[-1]], LAG), "hub_rate": 0.3}


def chain_of(period):
    return Chain(sampling=Sampling(period=period))


def is_stable(law, chain):
    return sampled_verdict(Case(LAB, law, chain)).is_stable


def test_five_poles_next_to_one_are_no_integrator():
    """At 0.5 ms the loop's poles are as good as those of continuous time, which the exact arm has."""
    chain = chain_of(0.0005)
    analysis = Analysis(sampled_verdict(Case(LAB, SLOW, chain)))
    verdict, (low, high) = analysis.verdict, analysis.gain_factors
    slowest = tfarm.closed_loop_poles(LAB, SLOW, 4).values.real.max()
    assert (verdict.word, verdict.is_settled, verdict.loop.poles_at_one) == ("stable", True, 0)
    assert verdict.log_radius == pytest.approx(slowest * 0.0005, rel=1e-3)
    assert low == 0 < 1 < high
    assert [is_stable(SLOW.times(each * high), chain) for each in (1e-6, 1 - 1e-6, 1 + 1e-6)] == [True, True, False]
    (number,) = analysis.stability_intervals
    assert number.interval == pytest.approx((low, high), rel=1e-9)


def reproduced(name):
    """A case of the survey, or of another one: rig, chain and law, the verdict on its loop, and the truth."""
    file = str(FILES / f"{name}.toml")
    case = Case(tfarm.load(file), load_law(FILES / f"{name}_law.toml"), load_chain(file))
    verdict = sampled_verdict(case)
    return verdict, *truth(verdict.loop, case)


@pytest.mark.parametrize("name", ["2_9", "45_316", "45_57"])
def test_poles_of_a_cluster_are_those_of_its_state_transition(name):
    """Seven and eleven poles of the law next to z = 1, where eigenvalues are off by more than their distance to it."""
    verdict, _, logs = reproduced(name)
    assert verdict.word == "unstable"
    assert verdict.loop.poles.log_spectral_radius == pytest.approx(logs[0], rel=1e-6)


def test_a_growth_that_rounding_leaves_open_is_marginal():
    """A second pole next to the integrator's at z = 1, closer than the static gain of the moment has digits."""
    verdict, _, logs = reproduced("45_185")
    poles = verdict.loop.poles
    (left,) = np.flatnonzero((poles.log_radius == 0) & (poles.z != 1))
    assert (verdict.word, verdict.is_settled, poles.unstable) == ("marginal", False, 0)
    assert abs(logs[0]) < poles.error[left] < 1e-7
    others = np.sort(poles.log_radius[poles.log_radius != 0])[::-1]
    np.testing.assert_allclose(others[:6], logs[1:7], rtol=1e-4)


INTEGRATOR, CANCELLED = ([0.02, 0.0], [1.0, -1.0]), ([1.0, -1.0], [1.0, -1.0])


def on_moment(*den):
    """The moment of a hub that turns steadily is 0, so that what integrates it stays where it is."""
    return {"hub_rate": 0.3, "root_moment": ([0.001, 0.0], den)}


@pytest.mark.parametrize(
    ("entries", "at_one"),
    [
        (on_moment(1.0, -1.5, 0.5), 1),  # vanishes at z = 1
        (on_moment(1.0, -1.9, 0.9), 0),  # is 1.1e-16 there, as these are doubles: a lag of 1e15 samples
        (on_moment(1.0, -1.1, 0.1), 0),  # is -8e-17: a pole outside
        (on_moment(3.0, -3.3, 0.3), 0),
        ({"hub_angle": INTEGRATOR, "hub_rate": ([0.32, -0.3], [1.0, -1.0])}, 1),  # of two only the sum is felt
        ({"hub_angle": INTEGRATOR, "hub_rate": 0.3}, 0),
        ({"hub_angle": CANCELLED, "hub_rate": 0.3}, 1),  # in the law itself
        ({"hub_rate": INTEGRATOR}, 0),
    ],
)
def test_an_integrator_of_what_is_0_at_rest_stays_at_one(entries, at_one):
    case = Case(LAB, Law(entries, period=T), chain_of(T))
    loop = sampled_loop(case, count=4)
    there, logs = truth(loop, case)
    assert (loop.poles_at_one, there - loop.has_free_angle) == (at_one, at_one)
    largest = max(logs[0], 0.0) if at_one else logs[0]
    assert loop.poles.log_spectral_radius == pytest.approx(largest, rel=1e-6, abs=0)


@pytest.mark.parametrize("number", sized(8, 100))
def test_small_run_of_the_survey(number):
    found, _, wrong = tally(each_of(laws), number, 3)
    assert wrong == 0
    assert found["right"] == found.total() - found["refused"] - found["not proven"]
    assert found["right"] > 0.7 * found.total()


def values_of(in_z, delta):
    """What each part multiplies each signal by (parts, signals, n), at z = 1 + delta."""
    values = np.zeros((len(in_z.part_poles), len(in_z.signals), delta.size), complex)
    for part, row, gain, zeros in in_z.terms:
        values[part, row] += gain * (delta[:, None] - zeros).prod(axis=1)
    return values / (delta[:, None] - in_z.poles).prod(axis=1)


LAWS = {
    "tustin": Law(CLUSTER),
    "zoh": Law({"hub_angle": ([1.0, 0.0, 0.0], [1.0, 5.0, 4.0, 0.0]), "hub_rate": ([1.0, 0.0], LAG)}, rule="zoh"),
    "matched": Law({"hub_angle": ([2.0, 3.0, 0.0], LAG), "hub_rate": ([1.0, 1.0], [1.0, 0.0, 0.0])}, rule="matched"),
    "in z": Law({"hub_angle": ([0.4, -0.3], [1.0, -2.9, 2.8, -0.9]), "hub_rate": ([1.0, -1.0], [2.0, -1.0])}, period=T),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_values_next_to_one_are_those_of_states_in_balls(law):
    """C (z - A)^-1 B + D, at points from 1e-6 to 2 away from z = 1."""
    in_z = law_in_z(law, acting_law(Case(LAB, law))[0], Chain())
    delta = np.r_[1e-6j, 1e-4 + 1e-4j, 0.03j, -0.3 + 0.7j, -1.999]
    values = values_of(in_z, delta)
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        for n, (name, block, through) in enumerate(law_in_balls(Case(LAB, law, Chain()))):
            for k, each in enumerate(delta.tolist()):
                value = flint.acb(through)
                if block:
                    A, B, C = (flint.acb_mat(matrix.tolist()) for matrix in block)
                    z = (1 + flint.acb(each)) * flint.acb_mat(np.eye(A.nrows(), dtype=int).tolist())
                    value += (C * (z - A).inv() * B)[0, 0]
                found = values[n, law.signals.index(name), k]
                assert found == pytest.approx(complex(value), rel=1e-12)
    finally:
        flint.ctx.prec = before


MATRICES = ([[0.9, 0.2], [0.0, 0.5]], [[0.0, 0.3], [1.0, 0.2]], [[1.0, 0.4]], [[0.1, 0.7]])
OTHERS = {
    "prewarped": Law({"hub_rate": ([1.0, 3.0], [1.0, 2.0, 50.0])}, prewarp=30.0),
    "improper": Law({"hub_angle": ([0.1, 2.0, 1.0], [0.01, 1.0])}),
    "matrices": Law.of_matrices(*MATRICES, ["hub_angle", "hub_rate"], period=T),
    "held matrices": Law.of_matrices(*(np.array(each) for each in MATRICES), ["hub_rate", "hub_angle"], rule="zoh"),
    "sign": Law({"hub_angle": 2.0, "hub_rate": ([0.3], [0.02, 1.0])}, sign=1),
}


@pytest.mark.parametrize("hub_rate", ["ideal", "difference"])
@pytest.mark.parametrize("law", OTHERS.values(), ids=OTHERS)
def test_factors_are_those_of_the_law_as_it_acts(law, hub_rate):
    chain = Chain(converters=Converters(hub_rate=hub_rate, rate_filter=80.0))
    in_computer, _ = acting_law(Case(LAB, law, chain))
    in_z = law_in_z(law, in_computer, chain)
    acting = with_estimate(in_computer, chain)
    z = np.array([1.3, 0.4 + 0.9j, -1.2 + 0.1j])
    assert in_z.signals == acting.signals
    np.testing.assert_allclose(values_of(in_z, z - 1).sum(axis=0), acting.values(z), rtol=1e-11, atol=1e-15)
    A, B, C, D = in_z.matrices
    by_states = np.array([C @ np.linalg.solve(each * np.eye(len(A)) - A, B) + D for each in z.tolist()])
    np.testing.assert_allclose(by_states.sum(axis=1).T, acting.values(z), rtol=1e-11, atol=1e-15)
