"""The rules that make a law in s one in z: against python-control, and what each of them promises."""

import control
import numpy as np
import pytest

from tfarm import Law
from tfarm.arm.blocks import Rational, StateSpace
from tfarm.dsp.discretise import discretised, matched, tustin, zero_order_hold

T = 0.01
BLOCKS = {
    "lead": Rational((2.0, 1.0), (0.01, 1.0)),
    "notch": Rational((1.0, 0.4, 900.0), (1.0, 24.0, 900.0)),
    "integrator": Rational((1.0, 3.0), (1.0, 40.0, 0.0)),
    "washout": Rational((1.0, 0.0), (1.0, 5.0)),
}


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("rule", ["tustin", "prewarped", "zoh", "matched"])
def test_the_rules_are_those_of_python_control(name, rule):
    block, warp = BLOCKS[name], 25.0
    continuous = control.tf(block.num, block.den)
    mine = {
        "tustin": lambda: tustin(block, T),
        "prewarped": lambda: tustin(block, T, warp),
        "zoh": lambda: zero_order_hold(block, T),
        "matched": lambda: matched(block, T),
    }[rule]()
    method = {"tustin": "bilinear", "prewarped": "bilinear"}.get(rule, rule)
    others = {"prewarp_frequency": warp} if rule == "prewarped" else {}
    if rule == "matched" and name in (
        "integrator",
        "washout",
    ):  # python-control matches a value at rest that is 0 or inf
        z = np.exp(1e-6j)
        mine_there = mine.numerators(np.array([z]))[0, 0] / mine.denominator(np.array([z]))[0]
        assert mine_there == pytest.approx(complex(continuous(np.log(z) / T)), rel=1e-5)
        return
    theirs = control.sample_system(continuous, T, method=method, **others)
    z = np.exp(1j * np.array([0.1, 0.7, 2.0, 3.0]))
    values = mine.numerators(z)[0] / mine.denominator(z)
    np.testing.assert_allclose(values, theirs(z), rtol=1e-9)  # polynomials of python-control lose some digits


def test_prewarping_keeps_the_values_where_it_says():
    block, w0 = BLOCKS["notch"], 30.0
    z = np.exp(np.array([1j * w0 * T]))
    s = np.array([1j * w0])
    exact = block.numerators(s)[0] / block.denominator(s)
    for w, same in ((w0, True), (0.0, False)):
        found = tustin(block, T, w)
        assert np.allclose(found.numerators(z)[0] / found.denominator(z), exact, rtol=1e-12) == same


def test_tustins_derivative_is_the_trapezoidal_rule_backwards():
    law = discretised(Law({"hub_angle": ([1.0, 0.0], [1.0])}), T)
    z = np.exp(1j * np.array([0.3, 2.0]))
    np.testing.assert_allclose(law.values(z)[0], 2 / T * (z - 1) / (z + 1), rtol=1e-13)


def test_several_signals_at_once_are_discretised_as_each_alone():
    A, B, C, D = [[-3.0, 40.0], [-40.0, -3.0]], [[1.0, 0.5], [2.0, -1.0]], [[1.0, 2.0]], [[0.3, 0.0]]
    both = Law.of_matrices(A, B, C, D, ["hub_angle", "root_moment"], rule="zoh")
    z = np.exp(1j * np.array([0.3, 2.0]))
    for column, values in enumerate(discretised(both, T).values(z)):
        one = zero_order_hold(StateSpace(A, np.array(B)[:, [column]], C, np.array(D)[:, [column]]), T)
        np.testing.assert_allclose(values, one.numerators(z)[0] / one.denominator(z), rtol=1e-12)
