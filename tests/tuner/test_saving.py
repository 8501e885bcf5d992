"""A tuner's file: there and back to the last bit, and everything else refused in one line."""

import json
import math
import os
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.errors import ParameterError
from tfarm.tuner import Plan, load_tuner, save_tuner, tune
from tfarm.tuner.controller import to_text


@pytest.fixture(scope="module")
def tuning():
    return tune(tfarm.load("sasaki2012-lab"), Plan(trials=3, seed=11, seventh_input=True, guard="frozen"))


def test_there_and_back(tuning, tmp_path):
    saved = tuning.saved()
    save_tuner(saved, tmp_path / "tuner.json")
    again = load_tuner(tmp_path / "tuner.json")
    np.testing.assert_array_equal(again.network.weights, saved.network.weights)
    np.testing.assert_array_equal(again.network.scales, saved.network.scales)
    for name in ("guard_kind", "lo", "hi", "K1", "signals", "cost", "arm", "period"):
        assert getattr(again, name) == getattr(saved, name)
    assert to_text(again) == to_text(saved)
    result = tuning.trial.with_network(again.network, again.gain().guard)
    np.testing.assert_array_equal(result.K, tuning.training.result.K)


def test_without_a_guard_any_gain_from_0_on_comes_back(tuning, tmp_path):
    saved = replace(tuning.saved(), guard_kind="none", lo=0.0, hi=math.inf)
    save_tuner(saved, tmp_path / "free.json")
    again = load_tuner(tmp_path / "free.json")
    assert (again.guard_kind, again.lo, again.hi) == ("none", 0.0, math.inf)
    assert again.gain().guard == (0.0, math.inf)


def change(name, value):
    return lambda content: content | {name: value}


BROKEN = [
    change("W1", [[0.1] * 6] * 6),
    change("W1", [[0.1] * 7, [0.1] * 6]),
    change("W1", []),
    change("w2", [0.1] * 5),
    change("w2", [0.1, 0.2, 0.3, 0.4, 0.5, None]),
    change("w2", [0.1, 0.2, 0.3, 0.4, 0.5, float("nan")]),
    change("w2", [0.1, 0.2, 0.3, 0.4, 0.5, float("inf")]),
    change("w2", ["0.1"] * 6),
    change("scales", [1.0] * 6 + [-1.0]),
    change("guard", [0.5, 0.2]),
    change("guard", None),
    change("guard_kind", "none"),
    change("guard_kind", "wide"),
    change("signals", "both"),
    change("format", "tfarm tuner 99"),
    change("a", -1.0),
    change("period", 0.0),
    change("extra", 1),
    lambda content: {name: value for name, value in content.items() if name != "K1"},
    lambda content: [content],
]


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_file_is_one_line(tuning, tmp_path, broken):
    file = tmp_path / "tuner.json"
    file.write_text(json.dumps(broken(json.loads(to_text(tuning.saved())))))
    with pytest.raises(ParameterError) as caught:
        load_tuner(file)
    assert "\n" not in str(caught.value)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "null", "\x00", "[" * 100_000, '{"w2": [' + "1," * 3_000_000])
def test_no_tuner_at_all(tmp_path, text):
    file = tmp_path / "tuner.json"
    file.write_text(text)
    with pytest.raises(ParameterError) as caught:
        load_tuner(file)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 800


def test_no_file(tmp_path):
    """Nothing, a folder, and a pipe that nobody writes to, which is not waited for."""
    pipe = tmp_path / "pipe.json"
    os.mkfifo(pipe)
    for path, why in ((tmp_path / "nothing.json", "cannot be read"), (tmp_path, "a folder"), (pipe, "no regular file")):
        with pytest.raises(ParameterError, match=why):
            load_tuner(path)
