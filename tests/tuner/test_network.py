"""The network: sizes, first weights, the guard's map.

A tuner's file: there and back to the last bit, and everything else refused in one line.
"""

import json
import math

import numpy as np
import pytest

import tfarm
from tfarm.errors import ParameterError
from tfarm.tuner import Network, Plan, initial_network, kernel, load_tuner, save_tuner, tune
from tfarm.tuner.kernel import Limits
from tfarm.tuner.trial import to_text


def test_the_first_weights_are_uniform_and_repeatable():
    weights = np.concatenate([initial_network(seed).weights for seed in range(200)])
    assert abs(weights).max() < 0.5
    assert abs(np.mean(weights)) < 4 * np.sqrt(1 / 12 / weights.size)
    assert np.var(weights) == pytest.approx(1 / 12, rel=0.03)
    np.testing.assert_array_equal(initial_network(7).weights, initial_network(7).weights)
    assert (initial_network(7).weights != initial_network(8).weights).all()
    assert np.unique(initial_network(7).weights).size == 42


def test_the_guard_is_one_minus_e_to_the_minus_softplus():
    """lo + (hi - lo)(1 - e^-kappa), kappa = ln(1 + e^z), is the sigmoid; and its slope is right."""
    z = np.linspace(-30, 30, 601)
    guard = Limits(0.2, 0.7)
    values = np.array([kernel.guard_gain(each, guard) for each in z])
    kappa = np.logaddexp(0, z)
    np.testing.assert_allclose(values[:, 0], 0.2 + 0.5 * -np.expm1(-kappa), rtol=1e-14)
    np.testing.assert_allclose(values[:, 1], 0.5 / (2 * np.cosh(z / 2)) ** 2, rtol=1e-13)
    plain = np.array([kernel.guard_gain(each, Limits(0.0, np.inf)) for each in z])
    np.testing.assert_allclose(plain[:, 0], kappa, rtol=1e-14)
    np.testing.assert_allclose(plain[:, 1], 1 / (1 + np.exp(-z)), rtol=1e-14)


@pytest.mark.parametrize("z", [-1e308, -800.0, -1e-300, 0.0, 36.0, 800.0, 1e308])
def test_no_sum_leaves_the_guard(z):
    for lo, hi in ((0.1, 0.3), (0.1, np.nextafter(0.1, 1)), (1 / 3, 2 / 3)):
        K, slope = kernel.guard_gain(z, Limits(lo, hi))
        assert lo <= K <= hi
        assert slope >= 0


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"W1": np.ones((6, 5))}, "W1"),
        ({"W1": np.ones((0, 6)), "w2": np.ones(0)}, "W1"),
        ({"w2": np.ones(5)}, "w2"),
        ({"w2": np.r_[np.ones(5), np.nan]}, "w2"),
        ({"scales": np.ones(7)}, "scales"),
        ({"scales": np.zeros(6)}, "scales"),
    ],
)
def test_weights_that_do_not_fit_are_refused(change, key):
    good = {"W1": np.ones((6, 6)), "w2": np.ones(6), "scales": np.ones(6)}
    with pytest.raises(ParameterError) as caught:
        Network(**(good | change))
    assert caught.value.key == key


@pytest.fixture(scope="module")
def tuning():
    return tune(tfarm.load("sasaki2012-lab"), Plan(trials=3, seed=11, seventh_input=True, guard="frozen"))


@pytest.mark.parametrize("changed", [{"Kp": 10.0}, {"guard_kind": "none", "guard": None}])
def test_there_and_back(tuning, tmp_path, changed):
    saved = tuning.saved().model_copy(update=changed)
    save_tuner(saved, tmp_path / "tuner.json")
    again = load_tuner(tmp_path / "tuner.json")
    assert again == saved
    assert to_text(again) == to_text(saved)
    assert again.gain().guard == (saved.guard or (0.0, math.inf))
    assert ('"Kp"' in to_text(saved), again.gain().servo.Kp) == ("Kp" in changed, changed.get("Kp", 0.0))
    result = tuning.trial.with_network(again.network, tuning.training.guard.limits)
    np.testing.assert_array_equal(result.K, tuning.training.result.K)


WRONG = {
    "W1": [[[0.1] * 6] * 6, [[0.1] * 7, [0.1] * 6], []],
    "w2": [[0.1] * 5, ["0.1"] * 6, *([0.1, 0.2, 0.3, 0.4, 0.5, each] for each in (None, math.nan, math.inf))],
    "scales": [[1.0] * 6 + [-1.0]],
    "guard": [[0.5, 0.2], None],
    "guard_kind": ["none", "wide"],
    "signals": ["both"],
    "format": ["tfarm tuner 99"],
    "a": [-1.0],
    "period": [0.0],
    "arm": ["x" * 81],
    "extra": [1],
}
BROKEN = [
    *(lambda content, name=name, value=value: content | {name: value} for name in WRONG for value in WRONG[name]),
    lambda content: {name: value for name, value in content.items() if name != "K1"},
    lambda content: [content],
]
TEXTS = ["", "{", "null", "\x00", "[" * 100_000, '{"w2": [' + "1," * 3_000_000]


@pytest.mark.parametrize("broken", [*BROKEN, *TEXTS])
def test_a_broken_file_is_one_line(tuning, tmp_path, broken):
    file = tmp_path / "tuner.json"
    file.write_text(broken if isinstance(broken, str) else json.dumps(broken(json.loads(to_text(tuning.saved())))))
    with pytest.raises(ParameterError) as caught:
        load_tuner(file)
    assert "\n" not in str(caught.value)
    assert str(file) in str(caught.value)
    assert len(str(caught.value)) < 800


def test_no_file(tmp_path):
    with pytest.raises(ParameterError, match="cannot be read"):
        load_tuner(tmp_path / "nothing.json")
