"""Laws as records: from numbers, fractions, roots and python-control, and from TOML and .mat files.

Laws as files: there and back to the last bit, whatever they hold.
"""

from dataclasses import replace
from textwrap import dedent

import control
import numpy as np
import pytest
import scipy.io

from tests.shared import refusal
from tfarm import HubFeedback, Law, ParameterError
from tfarm.arm.blocks import Rational
from tfarm.arm.law_tables import load_law
from tfarm.arm.writing import law_toml, save_law
from tfarm.dsp.discretise import back_calculation

S = np.array([0.3j, 2 + 3j, -1.5 + 40j])


def test_the_transfer_function_of_a_signal_is_that_of_python_control():
    s = control.tf("s")
    notch = 3 * (s**2 + 0.2 * 57 * s + 57**2) / (s + 57) ** 2
    lag = control.ss([[-1.0, 2.0], [0.0, -4.0]], [[0.0], [1.0]], [[2.0, 1.0]], [[0.5]])
    law = Law({"hub_angle": notch, "tip_acceleration": lag, "hub_rate": 0.3}, delay=0.004)
    expected = [notch(S), lag(S), np.full(3, 0.3)]
    np.testing.assert_allclose(law.values(S), expected, rtol=1e-12)  # of polynomials of order 2: some eps
    assert (law.signals, law.order, law.is_discrete) == (("hub_angle", "tip_acceleration", "hub_rate"), 4, False)
    assert sorted(law.poles.real.round(4)) == [-57.0, -57.0, -4.0, -1.0]


def test_parts_are_one_state_space_and_matrices_their_transfer_functions():
    rng = np.random.default_rng(3)
    own = [rng.normal(size=size) for size in ((5, 5), (5, 2), (1, 5), (1, 2))]
    law = Law({"hub_angle": ([1.0, 2.0], [1.0, 3.0, 50.0]), "hub_rate": {"zeros": [-1], "poles": [-2], "gain": 5}})
    of_matrices = Law.of_matrices(*own, ["hub_angle", "root_moment"])
    for each, (A, B, C, D), rtol in ((law, law.matrices(), 1e-13), (of_matrices, own, 1e-11)):  # cond of s - A: 1e3
        for s in S:
            expected = (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[0]
            np.testing.assert_allclose(each.values(np.array([s]))[:, 0], expected, rtol=rtol)


def test_a_sign_and_references_have_their_effect():
    law = Law({"hub_angle": 2.0}, sign=1)
    assert law.values(S)[0, 0] == -2.0
    matrices = [[-1.0]], [[1.0, 2.0, 3.0]], [[1.0]], [[0.0, 0.0, 0.0]]
    law = Law.of_matrices(*matrices, ["reference:hub_angle", "", "hub_angle"])
    assert law.signals == ("hub_angle",)
    assert law.values(np.array([0j]))[0, 0] == pytest.approx(3.0, rel=1e-15)


@pytest.mark.parametrize("gains", [HubFeedback(K1=0.3, K2=0.2), HubFeedback(Kp=2.0, K1=-1.0), HubFeedback()])
def test_gains_at_the_hub_are_a_law_and_come_back(gains):
    assert Law.of_gains(gains).gains == gains
    assert Law({"hub_rate": 0.3}, delay=1e-3).gains is None
    assert Law({"hub_rate": ([0.3], [1.0, 1.0])}).gains is None
    assert Law({"tip_acceleration": 0.3}).gains is None


def test_each_number_of_a_law_is_what_its_name_gives_back():
    law = Law(
        {
            "hub_angle": ([2.0, 1.0], [0.01, 1.0, 0.0]),
            "hub_rate": 0.3,
            "strain@0.05": ([4.0], [0.1, 2.0]),
            "root_moment": 0,
        }
    )
    assert law.numbers == {
        "gain": 1.0, "hub_angle.gain": 1.0, "hub_angle.num.0": 2.0, "hub_angle.num.1": 1.0, "hub_angle.den.0": 0.01,
        "hub_angle.den.1": 1.0, "hub_rate": 0.3, "strain@0.05.num.0": 4.0, "strain@0.05.den.0": 0.1,
        "strain@0.05.den.1": 2.0,
    }  # fmt: skip
    s = np.array([0.3 + 5j, 40j])
    for name, value in law.numbers.items():
        np.testing.assert_array_equal(law.with_number(name, value).values(s), law.values(s))
        halved = law.with_number(name, value / 2).values(s)
        assert (halved != law.values(s)).any()
    assert Law({"hub_angle": ([2.0, 1.0], [1.0])}).numbers.keys() == {
        "gain", "hub_angle.gain", "hub_angle.num.0", "hub_angle.num.1"
    }  # fmt: skip
    both = Law.of_matrices([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]], ["hub_angle", "hub_rate"])
    assert both.numbers == {"gain": 1.0}
    assert law.with_number("delay", 0.01).delay == 0.01
    with pytest.raises(ParameterError, match="hub_rate"):
        law.with_number("hub_speed", 1.0)


@pytest.mark.parametrize(
    ("entries", "others", "key"),
    [
        ({}, {}, "law"),
        ({"hub_rate": "much"}, {}, "hub_rate"),
        ({"hub rate": 1.0}, {}, "signal"),
        ({"hub_rate": ([1.0], [0.0])}, {}, "hub_rate.den"),
        ({"hub_rate": ([np.inf], [1.0])}, {}, "hub_rate.num"),
        ({"hub_rate": {"gain": 1.0, "poles": [[-1.0, 2.0]]}}, {}, "poles"),
        ({"hub_rate": 1.0}, {"delay": -1.0}, "delay"),
        ({"hub_rate": 1.0}, {"sign": 2}, "sign"),
        ({"hub_rate": 1.0}, {"input": "torque"}, "input"),
        ({"hub_rate": 1.0}, {"rule": "euler"}, "rule"),
        ({"hub_rate": 1.0}, {"references": ("hub_angle",)}, "references"),
        ({"hub_angle": control.tf([1.0], [1.0, 0.5], 0.01)}, {"period": 0.02}, "period"),
        ({"hub_angle": ([1.0, 0.0], [1.0])}, {"period": 0.02}, "num"),
    ],
)
def test_what_is_no_law_is_refused_by_its_key(entries, others, key):
    assert refusal(Law, entries, **others).key == key


def written(path, text):
    path.write_text(dedent(text))
    return path


def test_a_file_holds_what_the_record_does(tmp_path):
    path = written(
        tmp_path / "law.toml",
        """
        [law]
        delay = 0.004
        input = "hub_torque"
        [law.hub_angle]
        num = [2.0, 1]
        den = [0.01, 1.0]
        [law.strain]
        x = 0.02
        gain = 3.0
        poles = [[-1.0, 2.0], [-1.0, -2.0]]
        """,
    )
    expected = Law(
        {"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "strain@0.02": {"gain": 3.0, "poles": [-1 + 2j, -1 - 2j]}},
        delay=0.004,
        input="hub_torque",
    )  # fmt: skip
    assert load_law(path) == expected
    assert load_law("sasaki2012") is None


def test_a_mat_file_holds_matrices_or_a_structure_of_them(tmp_path):
    matrices = {"A": [[0.5]], "B": [[1.0, 2.0]], "C": [[3.0]], "D": [[0.0, 4.0]]}
    scipy.io.savemat(tmp_path / "c.mat", matrices | {"lqg": matrices})
    head = "[law]\nmatrices = 'c.mat'\nperiod = 0.01\nsignals = ['hub_angle', 'root_moment']\n"
    for more, factor in (("", 1.0), ("system = 'lqg'\nscales = [1.0, 10.0]\n", 10.0)):
        law = load_law(written(tmp_path / "law.toml", head + more))
        z = np.array([1.2 + 0.1j])
        np.testing.assert_allclose(law.values(z)[:, 0], [3 / (z[0] - 0.5), factor * (6 / (z[0] - 0.5) + 4)], rtol=1e-15)
        assert law.period == 0.01


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("law = 3", "give a table, headed [law]"),
        ("[law]\ndelya = 0.1", 'did you mean "delay"'),
        (
            "[law]\nhub_angle = 2.5",
            "law.hub_angle = 2.5: a signal has a table of its own: [law.hub_angle] with gain = 2.5",
        ),
        ("[law]\n[law.hub_rate]\ngian = 1.0", 'did you mean "gain"'),
        ("[law]\n[law.hub_rate]\nden = [1.0]", "law.hub_rate.num is missing"),
        ("[law]\n[law.hub_rate]\nx = 0.1", "law.hub_rate.gain is missing"),
        ("[law]\n[law.hub_rate]\ngain = 1.0\nnum = [1.0]", "either num and den"),
        ("[law]\nmatrices = 'none.mat'\nsignals = ['hub_rate']", "none.mat"),
        ("[law]\nmatrices = 'law.toml'\nsignals = ['hub_rate']", "no .mat file"),
        ("[law]\nmatrices = 'empty.mat'\nsignals = ['hub_rate']", "holds no A, B, C, D"),
        ("[law]\nsignals = ['hub_rate']\n[law.hub_rate]\ngain = 1.0", "law.matrices is missing"),
        ("[law]", "name at least one signal"),
    ],
)
def test_a_wrong_entry_of_a_file_is_refused_in_a_line_with_its_name(tmp_path, text, words):
    scipy.io.savemat(tmp_path / "empty.mat", {"X": [[1.0]]})
    error = str(refusal(load_law, written(tmp_path / "law.toml", text)))
    assert words in error
    assert "law.toml" in error


def test_states_are_balanced_without_a_warning_however_far_apart_the_coefficients() -> None:
    """Scales of 2^63 and more are no whole numbers: SciPy warned of a cast."""
    s = 3e20j
    A, B, C, D = Rational((1.0,), (1.0, 1.0, 1e40)).matrices()
    value = (C @ np.linalg.solve(s * np.eye(2) - A, B) + D)[0, 0]
    assert value == pytest.approx(1 / (s**2 + s + 1e40), rel=1e-12)


def some_law(rng):
    """A law of one to three signals, each a gain or a rational of order up to four."""
    names = rng.permutation(["hub_angle", "hub_rate", "root_moment", "strain@0.05", "strain@0.3"])[: rng.integers(1, 4)]
    entries = {}
    for name in names:
        order = int(rng.integers(0, 5))
        den = np.r_[1.0, np.exp(rng.normal(size=order) * 5)]
        entries[str(name)] = float(rng.normal()) if not order else (rng.normal(size=order + 1), den)
    sign, references = int(rng.choice([-1, 1])), (str(names[0]),) if rng.random() < 0.5 else ()
    period = None if rng.random() < 0.5 else 0.01
    unusual = {"input": "motor_voltage", "rule": "zoh", "prewarp": 30.0} if rng.random() < 0.5 else {}
    others = {"sign": sign, "references": references, "period": period, "name": 'a "law", θ'} | unusual
    return Law(entries, delay=float(rng.random()), **others)


@pytest.mark.parametrize("seed", range(20))
def test_there_and_back(seed, tmp_path):
    law = some_law(np.random.default_rng(seed))
    save_law(law, tmp_path / "law.toml")
    again = load_law(tmp_path / "law.toml")
    assert again == law
    assert law_toml(again) == law_toml(law)
    both = Law.of_matrices([[-1.0]], [[1.0, 0.5]], [[1.0]], [[0.0, 0.0]], ["hub_angle", "hub_rate"])
    assert "savemat" in str(refusal(law_toml, both))


def test_anti_windup_is_of_one_integrator(tmp_path):
    law = Law({"hub_angle": ([2.0, 1.0], [1.0, 0.0])}, anti_windup=0.5)
    save_law(law, tmp_path / "law.toml")
    assert "anti_windup = 0.5" in (tmp_path / "law.toml").read_text()
    assert load_law(tmp_path / "law.toml") == law
    assert "anti_windup" not in law_toml(replace(law, anti_windup=0.0))
    for den, Tt, words in (([1.0, 2.0], 0.5, "has none"), ([1.0, 0.0], -1.0, "a time constant")):
        assert words in str(refusal(Law, {"hub_angle": ([2.0, 1.0], den)}, anti_windup=Tt))
    limits = (-1.0, 1.0)
    for den in ([1.0, -2.0, 1.0], [1.0, -0.5]):
        bad = Law({"hub_angle": ([1.0], den)}, period=0.01, anti_windup=0.5)
        assert "one integrator" in str(refusal(back_calculation, bad, limits))
    assert back_calculation(law, (-np.inf, np.inf)).tolist() == [-np.inf, np.inf]
