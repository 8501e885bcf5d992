"""Transfer functions against mpmath on the paper's determinants, limits, counts and physics."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import tfarm
from tests.shared import refusal
from tfarm import Arm, Hub

EPS = np.finfo(float).eps


@pytest.fixture(params=[name for name in tfarm.presets() if tfarm.load(name).is_uniform])
def arm(request: pytest.FixtureRequest) -> Arm:
    return tfarm.load(request.param)


def test_static_compliance_of_a_locked_arm_is_a_cantilever_free_at_its_tip() -> None:
    arm = replace(tfarm.load("sasaki2012"), hub=Hub(inertia=math.inf))
    G = tfarm.transfer(arm, ["tip_displacement", "tip_deflection", "root_moment", "hub_angle"])
    assert G.input == "hub_angle"
    assert_allclose(G(0), [1.0, 0.0, 0.0, 1.0], atol=EPS)  # turned without acceleration it does not bend


@pytest.mark.parametrize("s", [1e-80j, 1e-120 + 0j, 1e-200j, 1e-300j])
def test_next_to_zero_the_expansion_there_is_the_answer_or_one_line(arm, s) -> None:
    """s^2 leaves the range of float64 long before s does: no NaN, and no natural frequency there."""
    G = tfarm.transfer(arm, ("root_moment", "tip_deflection"))
    assert G(s) == pytest.approx(G.static, rel=1e-14)
    angle = tfarm.transfer(arm, "hub_angle")
    if abs(s) < 1e-150:
        assert "hub_angle is larger than any float64 there" in str(refusal(angle, s))
    else:
        assert angle(s) == pytest.approx(1 / arm.total_inertia / abs(s) ** 2 * (1 if s.real else -1), rel=1e-14)


def test_a_pole_is_named() -> None:
    arm = tfarm.load("sasaki2012")
    omega = tfarm.modes(arm, 1).natural_frequency[1]
    refused = refusal(tfarm.transfer(arm, "root_moment"), [1j, 1j * omega])
    assert "a pole: a natural frequency, 71.50568247 rad/s" in str(refused)
    assert "rigid body" in str(refusal(tfarm.transfer(arm, "hub_angle"), 0))


def test_poles_without_damping_are_the_natural_frequencies() -> None:
    arm = tfarm.load("sasaki2012")
    poles = tfarm.transfer(arm, "hub_angle").poles(up_to=3000.0)
    omega = tfarm.modes(arm, up_to=3000.0).natural_frequency
    assert poles.proof == "count"
    assert_allclose(np.sort(poles.values.imag[poles.values.imag > 0]), omega[1:], rtol=4 * EPS)
    assert np.count_nonzero(poles.values == 0) == 2


def test_an_outermost_zero_on_the_edge_of_the_box_moves_the_box() -> None:
    G = tfarm.transfer(tfarm.load("sasaki2012-lab"), "hub_angle")
    pole = G.poles(up_to=100.0).values[-1]
    poles = G.poles(up_to=float(abs(pole.imag)))
    assert poles.box[3] > abs(pole.imag)
    assert np.isclose(poles.values, pole).any()


def test_shapes() -> None:
    arm = tfarm.load("sasaki2012")
    one, two = tfarm.transfer(arm, "root_moment"), tfarm.transfer(arm, ["root_moment", "hub_rate"])
    s = 1j * np.arange(1, 7).reshape(2, 3)
    assert isinstance(one(1j), complex)
    assert one(s).shape == (2, 3)
    assert two(s).shape == (2, 2, 3)
    assert two(1j).shape == (2,)
    assert (two(s)[0] == one(s)).all()
    assert one(np.empty(0, complex)).shape == (0,)


@pytest.mark.parametrize(
    ("outputs", "x", "message"),
    [
        ("root_momnt", None, 'did you mean "root_moment"'),
        ("moment", None, "give the place"),
        ("moment", 1.5, "between 0 and 1 m"),
        ("moment", math.nan, "between 0 and 1 m"),
        ("hub_angle", 0.5, "leave x out"),
        ([], None, "at least one"),
    ],
)
def test_refusals(outputs: str, x: float | None, message: str) -> None:
    assert message in str(refusal(tfarm.transfer, tfarm.load("sasaki2012"), outputs, x=x))


@pytest.mark.parametrize("s", [math.nan, complex(3.0, math.nan), complex(0, math.inf), -2e20])
def test_s_is_finite_and_in_the_range_of_powers(s: complex) -> None:
    refused = refusal(tfarm.transfer(tfarm.load("sasaki2012"), "hub_rate"), [1.0, s])
    assert ("at most" if s == -2e20 else "finite") in str(refused)


def test_many_points_have_the_values_of_few():
    """Over the edges of blocks, also of a list of outputs, and a point that is not finite in the last one."""
    G = tfarm.transfer(tfarm.load("sasaki2012"), ["root_moment", "tip_displacement"])
    s = 1j * np.geomspace(0.1, 1e3, 20_001)
    apart = np.concatenate([G(few) for few in np.array_split(s, 7)], axis=1)
    assert np.array_equal(G(s), apart)
    assert refusal(G, np.r_[s, np.nan]).key == "s"
