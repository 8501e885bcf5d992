"""reduce() and its command: by order, by error, by method; what it carries, prints, and refuses."""

import math

import numpy as np
import pytest

import tfarm
from tests.shared import refusal
from tests.shell import answer, refused
from tfarm.reduced import reduce
from tfarm.schema import to_dict


def test_by_order_the_better_method(arm):
    best = reduce(arm, ["root_moment", "hub_rate"], order=14)
    modal = reduce(arm, ["root_moment", "hub_rate"], order=14, method="modal")
    assert (best.method, modal.method) == ("aaa", "modal")
    assert (best.order, modal.order) == (14, 14)
    assert best.worst_error < 1e-8 < modal.worst_error
    assert (modal.first_mode_lacking, best.first_mode_lacking) == (7, 5)
    np.testing.assert_allclose(best.lacking_frequency, tfarm.modes(arm, 5).natural_frequency[-1])


@pytest.mark.parametrize("method", ["modal", "aaa"])
@pytest.mark.parametrize("error", [0.3, 1e-2, 1e-5])
def test_by_error_the_smallest(arm, error, method):
    found = reduce(arm, ["root_moment", "hub_rate"], error=error, method=method)
    assert found.worst_error <= error
    smaller = reduce(arm, ["root_moment", "hub_rate"], order=found.order - 2, method=method)
    assert smaller.worst_error > error or smaller.method != method  # below the modes of the band AAA gives way


def test_aaa_below_the_modes_of_the_band_gives_way(arm):
    reduced = reduce(arm, "root_moment", order=4, method="aaa")
    assert reduced.method == "modal"
    assert "3 modes in the range" in reduced.note


def test_damped_arm_is_modal():
    lab = tfarm.load("sasaki2012-lab")
    reduced = reduce(lab, ["root_moment", "hub_rate"], order=16)
    assert reduced.method == "modal"
    assert (reduced.model.eigenvalues.real < 0).all()
    assert reduced.worst_error < 1e-3
    assert "C = 0" in str(refusal(reduce, lab, "root_moment", order=14, method="aaa"))


def test_odd_orders_are_for_damped_arms():
    lab = tfarm.load("sasaki2012-lab")
    odd, even = (reduce(lab, ["root_moment", "hub_rate"], order=order) for order in (21, 20))
    assert (odd.order, odd.model.states[-1]) == (21, "relaxation")
    assert odd.worst_error < 0.2 * even.worst_error
    assert [-1 / lab.link.damping, 0.0] == to_dict(odd)["poles"][-1]
    small = reduce(lab, ["root_moment", "hub_rate"], error=1e-5)
    assert small.worst_error <= 1e-5
    s = np.array([2.0j, 150j])
    np.testing.assert_allclose(odd.state_space()(s)[:, 0], odd(s), rtol=1e-9)


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({}, "order"),
        ({"order": 4, "error": 1e-3}, "order"),
        ({"order": 13}, "order"),
        ({"order": 0}, "order"),
        ({"order": 402}, "order"),
        ({"order": 4.0}, "order"),
        ({"error": 0.0}, "error"),
        ({"error": math.nan}, "error"),
        ({"error": "1"}, "error"),
        ({"order": 4, "band": (0.0, 1.0)}, "band"),
        ({"order": 4, "band": (2.0, 1.0)}, "band"),
        ({"order": 4, "band": (math.nan, 1.0)}, "band"),
        ({"order": 4, "band": (1.0, math.inf)}, "band"),
        ({"order": 4, "band": 3.0}, "band"),
        ({"order": 4, "method": "balred"}, "method"),
        ({"order": 4, "x": 0.3}, "x"),
    ],
)
def test_bad_input_is_named(arm, given, key):
    assert refusal(reduce, arm, "root_moment", **given).key == key


def test_outputs_without_a_model(arm):
    assert "hub_rate" in str(refusal(reduce, arm.with_numbers(hub_inertia=math.inf), "hub_rate", order=4))
    assert "once" in str(refusal(reduce, arm, ["root_moment", "root_moment"], order=4))


def test_state_space(arm):
    reduced, points = reduce(arm, ["root_moment", "hub_rate"], order=10), np.array([3j, 60j, 0.5 + 200j])
    system = reduced.state_space()
    np.testing.assert_allclose(system(points)[:, 0], reduced(points), rtol=1e-9)
    assert system.output_labels == ["root_moment", "hub_rate"]
    assert system.name == "sasaki2012, aaa, order 10"


def test_by_error_with_a_band_and_a_file(capsys, tmp_path):
    given = ("--error", "1e-6", "--band", "1,500", "--method", "modal", "--mat", str(tmp_path / "arm.mat"))
    found = answer(capsys, "reduce", "sasaki2012", "--outputs", "tip_displacement", *given)
    assert found["worst_error"] <= 1e-6
    assert found["method"] == "modal"
    assert (tmp_path / "arm.mat").exists()


@pytest.mark.parametrize("arguments", ["--order some", "--order 8 --outputs tip", "--order 8 --mat /nowhere/a.mat"])
def test_bad_input_is_one_line(capsys, arguments):
    assert refused(capsys, "reduce", "sasaki2012", *arguments.split())


def test_an_error_out_of_reach_and_below_that_of_the_exact_values(capsys):
    given = ("--error", "1.1e-14", "--method", "aaa", "--band", "1,100")
    assert "no model of" in refused(capsys, "reduce", "sasaki2012", *given, code=3)
    line = "tfarm: error = 1e-30: below the rounding of the exact values; give 1e-14 or more\n"
    assert refused(capsys, "reduce", "sasaki2012-lab", "--error", "1e-30") == line
