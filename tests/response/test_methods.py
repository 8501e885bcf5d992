"""Agreement of the closed form, ball arithmetic and the paper's appendix."""

import re

import numpy as np
import pytest

import tfarm
from tests.shared import refusal
from tests.shell import answer, refused, run
from tfarm.exact.values import METHODS

S = np.array([0.3 + 57.1j, 57.1j, -3.0 + 400.0j, 2.0 + 0j])
EPS = np.finfo(float).eps


def test_a_method_with_an_error_is_detected(monkeypatch, capsys):
    """The appendix shares no formula with the closed form: an error in (A.2) is reported as a difference."""
    from tfarm.exact.appendix import Appendix

    right = Appendix.wave_numbers

    def wrong(self, Ed):
        one, two = right(self, Ed)
        return one, two * (1 + 1e-9)

    monkeypatch.setattr(Appendix, "wave_numbers", wrong)
    code, out, _ = run(capsys, "response", "sasaki2012", "--output", "root_moment", "--s", "0.3+57.1j", "--compare")
    assert code == 0
    assert "closed-form, balls, appendix: differ by more than rounding" in out


@pytest.mark.parametrize(
    "command",
    [
        "modes quanser-2dsfl --count 2",
        "modes sasaki2012 --count 2 --theory shear",
        "response quanser-2dsfl --output hub_rate --omega 10,100",
        "response sasaki2012 --output tip_angle --omega 10,100",
    ],
)
def test_where_the_appendix_does_not_apply_two_methods_remain_with_the_reason(command, capsys):
    code, out, _ = run(capsys, *command.split(), "--compare")
    assert code == 0
    assert "closed-form, balls: agree to rounding" in out
    assert re.search(r"left out +appendix the paper's appendix (is of one|has no )", out)
    assert "difference of the appendix" not in out
    found = answer(capsys, *command.split(), "--compare")
    assert list(found["methods"]) == list(METHODS[:2])
    assert list(found["differences"]) == ["balls"]
    assert list(found["left_out"]) == ["appendix"]


def test_by_methods_returns_every_method_and_their_differences():
    """Each method's values are those it gives alone."""
    arm = tfarm.load("sasaki2012")
    outputs = ["root_moment", "tip_displacement"]
    found = tfarm.transfer(arm, outputs).by_methods(S)
    for method in METHODS:
        np.testing.assert_array_equal(found.values[method], tfarm.transfer(arm, outputs, method=method)(S))
    apart = abs(found.values["appendix"] / found.values["closed-form"] - 1)
    assert found.differences["appendix"] == pytest.approx(apart, abs=EPS)
    assert found.largest_difference == max(each.max() for each in found.differences.values())
    assert "agree to rounding" in found.finding
    rig = tfarm.modes(tfarm.load("quanser-2dsfl"), 2)
    assert list(rig.by_methods().values) == ["closed-form", "balls"]
    assert "one Timoshenko beam" in rig.by_methods().left_out["appendix"]
    assert "one Timoshenko beam" in str(refusal(rig.frequencies, "appendix"))
    assert "closed-form, balls, appendix" in str(refusal(tfarm.transfer, arm, "hub_rate", method="fem"))
    under_force = tfarm.transfer(arm, "root_moment", input="force@0.3")
    assert "input at the hub" in str(refusal(under_force.by_methods, S))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("response", "sasaki2012", "--output", "", "--omega", "1"), "output = '': known are: hub_angle"),
        (("modes", "sasaki2012", "--method", "fem"), "known are: closed-form, balls, appendix"),
        (("modes", "sasaki2012", "--theory", "shear", "--method", "appendix"), "Timoshenko beam"),
        (("modes", "sasaki2012", "--method", "balls", "--digits", "20"), "leave --method and --compare out"),
        (("modes", "sasaki2012", "--compare", "--digits", "20"), "leave --method and --compare out"),
        (("modes", "sasaki2012", "--compare", "--certify"), "ask for one"),
        (("response", "sasaki2012", "--output", "hub_rate", "--points", "9", "--compare", "--csv", "x.csv"), "--csv"),
        (("response", "sasaki2012", "--output", "hub_rate", "--points", "3000", "--compare"), "at most 2000 by balls"),
    ],
)
def test_an_impossible_request_is_refused_in_one_line(capsys, arguments, words):
    assert words in refused(capsys, *arguments)
