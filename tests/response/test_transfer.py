"""Transfer functions against mpmath on the paper's determinants, limits, counts and physics."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import tfarm
from tests.outputs import OF_ONE_LINK
from tests.shared import thinned
from tfarm import Arm, Hub, ParameterError
from tfarm.exact import appendix, balls, values
from tfarm.exact.system import system_of

EPS = np.finfo(float).eps
AT_ENDS = [name for name, output in OF_ONE_LINK.items() if output.place != "x"]
ALONG = [name for name, output in OF_ONE_LINK.items() if output.place == "x"]
POINTS = [0.3 + 57.1j, 2e-3j, 40.0 + 0.0j, -5.0 + 900.0j, 1.3e4j]


@pytest.fixture(params=[name for name in tfarm.presets() if tfarm.load(name).is_uniform])
def arm(request: pytest.FixtureRequest) -> Arm:
    return tfarm.load(request.param)


@pytest.mark.parametrize("name", thinned(AT_ENDS, 2))
def test_values_agree_with_the_determinants_of_the_paper(arm: Arm, name: str) -> None:
    G = tfarm.transfer(arm, name)
    for s in POINTS:
        expected = complex(appendix.response(arm, name, s, 20))
        slope = abs(s * G.derivative(s) / expected)
        assert abs(G(s) - expected) <= 90 * EPS * (1 + slope) * abs(expected)


@pytest.mark.parametrize("name", thinned(ALONG, 3))
def test_values_along_the_arm_agree_with_the_paper(arm: Arm, name: str) -> None:
    for share in (0.07, 0.6):
        x = share * arm.link.length
        G = tfarm.transfer(arm, name, x=x)
        for s in POINTS[:4]:
            expected = complex(appendix.response(arm, name, s, 20, x=x))
            assert abs(G(s) - expected) <= 400 * EPS * abs(expected)


@pytest.mark.parametrize("name", AT_ENDS)
def test_derivative_is_the_limit_of_differences_with_many_digits(arm: Arm, name: str) -> None:
    G = tfarm.transfer(arm, name)
    for s in (0.3 + 57.1j, 10 + 700j, 3e-3 + 1e-3j, 2e4j):
        expected = balls.nearest_float(values.slope(system_of(arm), OF_ONE_LINK[name], s))
        scale = abs(G(s) / s) + abs(expected)
        assert abs(G.derivative(s) - expected) <= 4000 * EPS * scale


def test_expansion_at_zero_is_the_rigid_arm(arm: Arm) -> None:
    J, length = arm.total_inertia, arm.link.length
    flexible = replace(arm, hub=Hub(inertia=0.0)).total_inertia
    G = tfarm.transfer(arm, ["hub_angle", "tip_displacement", "root_moment"])
    assert_allclose(G.rigid_body, [1 / J, length / J, 0.0], rtol=8 * EPS)
    assert_allclose(G.static[2], -flexible / J, rtol=16 * EPS)
    assert_allclose(tfarm.transfer(arm, "root_moment")(0), -flexible / J, rtol=16 * EPS)


def test_static_compliance_of_a_locked_arm_is_a_cantilever_free_at_its_tip() -> None:
    arm = replace(tfarm.load("sasaki2012"), hub=Hub(inertia=math.inf))
    G = tfarm.transfer(arm, ["tip_displacement", "tip_deflection", "root_moment", "hub_angle"])
    assert G.input == "hub_angle"
    assert_allclose(G(0), [1.0, 0.0, 0.0, 1.0], atol=EPS)  # turned without acceleration it does not bend


@pytest.mark.parametrize("preset", ["sasaki2012", "sasaki2012-lab"])
def test_digits_agree_with_the_paper_to_forty(preset: str) -> None:
    import mpmath

    arm = tfarm.load(preset)
    G = tfarm.transfer(arm, "root_moment")
    for s in (0.3 + 57.1j, 57.1j, 2.5 + 0j, 1e-5j):
        re, im = G.digits(s, 40)
        with mpmath.workdps(60):
            expected = appendix.response(arm, "root_moment", s, 50)
            for text, part in ((re, expected.real), (im, expected.imag)):
                assert abs(mpmath.mpf(text) - part) <= abs(part) * mpmath.mpf(10) ** -39
                assert len(text.replace("-", "").replace(".", "").lstrip("0")) >= 38 or part == 0


@pytest.mark.parametrize("s", [1e-80j, 1e-120 + 0j, 1e-200j, 1e-300j])
def test_next_to_zero_the_expansion_there_is_the_answer_or_one_line(arm, s) -> None:
    """s^2 leaves the range of float64 long before s does: no NaN, and no natural frequency there."""
    G = tfarm.transfer(arm, ("root_moment", "tip_deflection"))
    assert G(s) == pytest.approx(G.static, rel=1e-14)
    angle = tfarm.transfer(arm, "hub_angle")
    if abs(s) < 1e-150:
        with pytest.raises(ParameterError, match="hub_angle is larger than any float64 there"):
            angle(s)
    else:
        assert angle(s) == pytest.approx(1 / arm.total_inertia / abs(s) ** 2 * (1 if s.real else -1), rel=1e-14)


def test_a_pole_is_named() -> None:
    arm = tfarm.load("sasaki2012")
    omega = tfarm.modes(arm, 1).natural_frequency[1]
    with pytest.raises(ParameterError, match=r"a pole: a natural frequency, 71\.50568247 rad/s"):
        tfarm.transfer(arm, "root_moment")([1j, 1j * omega])
    with pytest.raises(ParameterError, match="rigid body"):
        tfarm.transfer(arm, "hub_angle")(0)


def test_poles_without_damping_are_the_natural_frequencies() -> None:
    arm = tfarm.load("sasaki2012")
    poles = tfarm.transfer(arm, "hub_angle").poles(up_to=3000.0)
    omega = tfarm.modes(arm, up_to=3000.0).natural_frequency
    assert poles.proof == "count"
    assert_allclose(np.sort(poles.values.imag[poles.values.imag > 0]), omega[1:], rtol=4 * EPS)
    assert np.count_nonzero(poles.values == 0) == 2


def test_an_outermost_zero_on_the_edge_of_the_box_moves_the_box() -> None:
    arm = tfarm.load("sasaki2012-lab")
    pole = tfarm.transfer(arm, "hub_angle").poles(up_to=100.0).values[-1]
    poles = tfarm.transfer(arm, "hub_angle").poles(up_to=float(abs(pole.imag)))
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
    with pytest.raises(ParameterError, match=message):
        tfarm.transfer(tfarm.load("sasaki2012"), outputs, x=x)


@pytest.mark.parametrize("s", [math.nan, complex(3.0, math.nan), complex(0, math.inf), -2e20])
def test_s_is_finite_and_in_the_range_of_powers(s: complex) -> None:
    with pytest.raises(ParameterError, match="at most" if s == -2e20 else "finite"):
        tfarm.transfer(tfarm.load("sasaki2012"), "hub_rate")([1.0, s])


def test_many_points_have_the_values_of_few():
    """Over the edges of blocks, also of a list of outputs, and a point that is not finite in the last one."""
    G = tfarm.transfer(tfarm.load("sasaki2012"), ["root_moment", "tip_displacement"])
    s = 1j * np.geomspace(0.1, 1e3, 20_001)
    apart = np.concatenate([G(few) for few in np.array_split(s, 7)], axis=1)
    assert np.array_equal(G(s), apart)
    for wrong in (np.nan, complex(0.0, -np.inf), complex(-1e21, 0.0)):
        with pytest.raises(tfarm.ParameterError, match="s = "):
            G(np.r_[s, wrong])
