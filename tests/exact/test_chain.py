"""The chain, and loads on it, against the plain product of transition matrices, itself cut up, and the paper's arm."""

from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path

import mpmath
import numpy as np
import pytest

import tfarm
from tests.rigs import lossless, rig, some_point, some_rig
from tests.shared import thinned
from tests.transition import determinant, response
from tfarm import Hub
from tfarm.arm import THEORIES, Motor, RotarySpring
from tfarm.errors import ParameterError
from tfarm.exact.outputs import OUTPUTS, Output
from tfarm.exact.series import expansion_at_zero
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import natural_frequencies

EPS = np.finfo(float).eps
LOST = 1e-13  # error over 1 + condition: 20 times what 5,000 rigs of `accuracy` have at most
EXACT = mpmath.mpf("1e-29")  # of 30 digits, rounded
INPUTS = ("hub_torque", "motor_voltage", "motor_current", "hub_angle")
ENDS = [name for name, each in OUTPUTS.items() if each.place != "x" and name != "motor_current"]
ALONG = {  # the oracle's names
    **{name: name for name in ("displacement", "velocity", "acceleration", "deflection", "shear")},
    "rotation": "twist",
    "moment": "gauge",
    "full_moment": "moment",
}


def point_of(arm, share):
    """That share of the exact sum of the lengths [m], as tfarm takes it, to 60 digits."""
    x = Fraction(share) * sum(Fraction(link.length) for link in arm.links)
    with mpmath.workdps(60):
        return mpmath.mpf(x.numerator) / x.denominator


def oracle(arm, s, x, digits=40):
    """Every output in the order of `transfer_of`, by transition matrices."""
    wanted = [*ENDS, *((name, point_of(arm, x / arm.length)) for name in ALONG.values())]
    found = response(arm, s, wanted, digits)
    return [found[each] for each in wanted]


def transfer_of(arm, x, method="closed-form"):
    return tfarm.transfer(arm, [*ENDS, *ALONG], x=x, method=method)


def error(G, s, exact):
    """The largest |G/exact - 1| over 1 + |s G'/G|, of outputs that are not zero; those are zero."""
    exact = np.array([complex(value) for value in exact])
    values, slopes = G(s), G.derivative(s)
    there = abs(exact) > 1e-30 * abs(exact).max()
    assert (abs(values[~there]) < 1e-30 * abs(exact).max()).all()
    condition = abs(s * slopes[there] / exact[there])
    return (abs(values[there] / exact[there] - 1) / (1 + condition)).max()


KINDS = [{"input": drive} for drive in INPUTS] + [{"theory": theory} for theory in THEORIES]


@pytest.mark.parametrize(("kind", "s"), thinned(product(KINDS, [130j, -4 + 900j, -60 + 0j, 1e-3j]), 3))
def test_every_output_of_a_rig_with_everything(kind, s):
    arm = rig(**kind)
    assert error(transfer_of(arm, 0.625), s, oracle(arm, s, 0.625)) < LOST


FLEX = tfarm.load("quanser-flexlink")


@pytest.mark.parametrize(
    "arm", [*(rig(input=drive) for drive in INPUTS[:3]), *(replace(FLEX, input=drive) for drive in INPUTS[:3])]
)
def test_the_current_of_the_motor(arm):
    s = -4 + 900j
    exact = response(arm, s, ["motor_current"], 40)
    G = tfarm.transfer(arm, "motor_current")
    assert error(tfarm.transfer(arm, ["motor_current"]), s, list(exact.values())) < LOST
    (re, im), value = G.digits(s, 20), complex(exact["motor_current"])
    assert abs(complex(float(re), float(im)) - value) <= 2 * EPS * abs(value)


@pytest.mark.parametrize("arm", [rig(motor=None), rig(input="hub_angle")], ids=["no motor", "angle"])
def test_no_current_is_known_without_a_motor_that_drives(arm):
    with pytest.raises(ParameterError, match="motor_current"):
        tfarm.transfer(arm, "motor_current")(1j)


@pytest.mark.parametrize("seed", thinned(range(16), 4))
def test_every_output_of_random_rigs(seed):
    rng = np.random.default_rng([1, seed])
    arm = some_rig(rng)
    s, x = some_point(rng, arm), float(rng.uniform(0, arm.length))
    assert error(transfer_of(arm, x), s, oracle(arm, s, x)) < LOST


@pytest.mark.parametrize("side", ["inner", "outer"])
def test_both_sides_of_a_joint_with_a_mass_on_it(side):
    """At 0.25 of the rig M, Q, C and so the gauge jump."""
    arm, s = rig(), -3 + 400j
    units, quantities = {"M": "N m", "Q": "N"}, {"M": "gauge", "Q": "shear"}
    wanted = [
        Output(quantity=name, place="x", unit=units[name], gauge=name == "M", side=side, label=f"{name} {side}")
        for name in units
    ]
    exact = response(arm, s, [(name, 0.25, side) for name in quantities.values()])
    assert error(tfarm.transfer(arm, wanted, x=0.25), s, exact.values()) < LOST


@pytest.mark.parametrize(("drive", "s"), thinned(product(INPUTS, [250j, -4 + 900j]), 5))
def test_thirty_digits_by_balls(drive, s):
    arm = rig(input=drive)
    exact = oracle(arm, s, 0.625, 60)
    for (re, im), value in zip(transfer_of(arm, 0.625).digits(s, 30), exact, strict=True):
        for text, part in ((re, value.real), (im, value.imag)):
            with mpmath.workdps(60):
                assert abs(mpmath.mpf(text) - part) <= EXACT * abs(part) + mpmath.mpf("1e-55") * abs(value)
    balls = transfer_of(arm, 0.625, "balls")(s)
    assert abs(balls - [complex(value) for value in exact]).max() <= 2 * EPS * abs(balls).max()


LOSSES = {
    "friction": {"hub": Hub(inertia=0.1, friction=0.1)},
    "dashpot": {"clamp": RotarySpring(stiffness=300.0, damping=1e-3)},
    "inductance alone": {
        "motor": Motor(resistance=2.0, torque_constant=0.05, back_emf_constant=0.0, inductance=0.01),
        "input": "motor_voltage",
    },
    "none": {},
}


@pytest.mark.parametrize("loss", LOSSES)
def test_digits_of_elastic_links_with_another_loss(loss):
    """No part vanishes on the axis but where nothing dissipates or lags: C = 0 alone is not enough."""
    arm = replace(lossless(rig()), **LOSSES[loss])
    for name, (re, im) in zip(
        ("hub_angle", "hub_rate"), tfarm.transfer(arm, ["hub_angle", "hub_rate"]).digits(99j, 30), strict=True
    ):
        exact = response(arm, 99j, [name])[name]
        with mpmath.workdps(60):
            assert abs(mpmath.mpc(re, im) - exact) <= EXACT * abs(exact)
        assert (mpmath.mpf(re) != 0) == (exact.real != 0)
        assert (mpmath.mpf(im) != 0) == (exact.imag != 0)


@pytest.mark.parametrize("seed", thinned([*range(8), None], 4))
def test_derivatives_are_differences_of_the_oracle(seed):
    """Cauchy's integral has the error of a value over the circle's radius, |s| over the phase of all waves.

    Of random rigs, and of one so high up that many waves stand along it.
    """
    arm, s, x = rig(), 40 + 6e4j, 0.4
    if seed is not None:
        rng = np.random.default_rng([2, seed])
        arm = some_rig(rng)
        s, x = some_point(rng, arm), float(rng.uniform(0, arm.length))
    h = 2.0**-60 * abs(s)  # the square of 2^-60 is far below the requested error
    with mpmath.workdps(80):
        right, left = (oracle(arm, mpmath.mpc(s) + sign * h, x, 80) for sign in (1, -1))
        exact = np.array([complex((a - b) / (2 * h)) for a, b in zip(right, left, strict=True)])
        sizes = abs(exact) + abs(np.array([complex(value) for value in right])) / abs(s)
    found = transfer_of(arm, x).derivative(s)
    assert (abs(found - exact) <= 1e-12 * sizes + 1e-40).all()


def free_rig(**changes):
    """The rig without its springs to ground."""
    arm = rig(hub=replace(rig().hub, stiffness=0.0, friction=0.0), motor=None)
    masses = tuple(replace(each, stiffness=0.0, rotational_stiffness=0.0) for each in arm.attachments)
    return replace(arm, attachments=masses, **changes)


AT_REST = {
    "free": free_rig(),
    "friction": free_rig(hub=replace(rig().hub, stiffness=0.0, friction=0.3)),
    "held": rig(),
    "voltage": free_rig(motor=rig().motor, input="motor_voltage"),
    "angle": rig(input="hub_angle"),
}


@pytest.mark.parametrize("name", thinned(AT_REST, 5))
def test_the_expansion_at_rest(name):
    """From values at +-h and +-ih: powers s^-2 and s^0 stay in the mean of a pair, s^-1 and s in its difference."""
    arm = AT_REST[name]
    with mpmath.workdps(75):
        h = mpmath.mpf("1e-14")
        right, left, up = (oracle(arm, h * turn, 0.625, 75) for turn in (1, -1, 1j))
        down = [mpmath.conj(value) for value in up]
        even, odd = ([(a + sign * b) / 2 for a, b in zip(right, left, strict=True)] for sign in (1, -1))
        even_i, odd_i = ([(a + sign * b) / 2 for a, b in zip(up, down, strict=True)] for sign in (1, -1))
        wanted = [
            (h**2 * (a - b) / 2, h * (c + 1j * d) / 2, (a + b) / 2, (c - 1j * d) / (2 * h))
            for a, b, c, d in zip(even, even_i, odd, odd_i, strict=True)
        ]
        exact = np.array([[complex(value) for value in row] for row in wanted])
    G = transfer_of(arm, 0.625)
    found = np.array([expansion_at_zero(system_of(arm), row, 0.625 / arm.length) for row in G.rows])
    assert np.array_equal(G.rigid_body, found[:, 0])
    assert np.array_equal(G.static, found[:, 2])
    sizes = np.maximum(abs(exact).max(axis=1)[:, None], 1e-20)
    assert (abs(found - exact) <= 1e-13 * abs(exact) + 1e-17 * sizes).all()


@pytest.mark.parametrize(("name", "pieces"), thinned(product(["sasaki2012", "stocky-steel"], [2, 64, 3, 7]), 3))
def test_an_arm_cut_into_equal_pieces(name, pieces):
    """Frequencies as of the uncut one, which is not solved as a chain; responses with its damping too."""
    arm = tfarm.load(name)
    part = replace(arm.link, length=arm.link.length / pieces, damping=1e-5)
    whole = replace(arm, link=replace(arm.link, damping=1e-5))
    cut = replace(whole, link=part, outer=(part,) * (pieces - 1))
    assert not cut.is_uniform
    assert whole.is_uniform
    assert tfarm.modes(cut, 12).natural_frequency == pytest.approx(
        tfarm.modes(whole, 12).natural_frequency, rel=1e-13, abs=0
    )
    s = np.array([0.3, 0.6j, 2.3j, 5j, -0.02 + 9j]) * tfarm.modes(whole, 1).natural_frequency[-1]
    ours, theirs = (tfarm.transfer(each, ENDS) for each in (cut, whole))
    condition = abs(s * theirs.derivative(s) / theirs(s))
    assert (abs(ours(s) / theirs(s) - 1) / (1 + condition)).max() < LOST


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_segment_of_next_to_no_length(place):
    """1e-14 L of a hundredfold stiffness, at the clamp, between two segments and at the tip."""
    whole = lossless(rig())
    sliver = replace(whole.link, length=1e-14 * whole.length, youngs_modulus=7e12, shear_modulus=3e12)
    links = list(whole.links)
    links.insert(place if place < 2 else len(links), sliver)
    cut = replace(whole, link=links[0], outer=tuple(links[1:]))
    found, wanted = (tfarm.modes(arm, 12).natural_frequency for arm in (cut, whole))
    assert found == pytest.approx(wanted, rel=1e-12, abs=0)


@pytest.mark.parametrize("seed", range(4))
def test_a_value_does_not_depend_on_the_other_points(seed):
    """Points go through in blocks, each segment by waves or by series: 77 in any order are those one at a time.

    The lowest are slow in every segment, the highest in none, and between them some segments are and others not.
    """
    rng = np.random.default_rng(seed)
    arm = some_rig(rng, segments=4)
    first = natural_frequencies(system_of(lossless(arm)), 2, 2)[0]
    s = rng.permutation(first * np.geomspace(1e-2, 1e2, 77)) * np.exp(1j * rng.uniform(0.3, 1.5))
    G = tfarm.transfer(arm, ["hub_angle", "root_moment", "tip_displacement"])
    np.testing.assert_array_equal(G(s), np.array([G(each) for each in s]).T)


@pytest.mark.parametrize("theory", THEORIES)
def test_the_frequencies_of_every_theory_are_sign_changes_of_the_determinant(theory):
    arm = replace(lossless(rig()), theory=theory)
    for omega in tfarm.modes(arm, 3).natural_frequency:
        low, high = (determinant(arm, 1j * omega * (1 + shift)) for shift in (-1e-14, 1e-14))
        assert low.imag == high.imag == 0
        assert low.real * high.real < 0


FEW = 64  # roundings of a value that balls give, and of the oracle's numbers turned to float
BENCH = tfarm.load(str(Path(__file__).parents[1] / "rigs" / "bench-rig.toml"))
S = (3 + 50j, -2 + 900j, 0.2j)
READ = {  # tfarm's words and the oracle's, before, at and beyond a load at 0.6 of the length
    "hub_angle": ("hub_angle", None),
    "root_moment": ("root_moment", None),
    "tip_displacement": ("tip_displacement", None),
    "displacement": ("displacement", (0.3, 0.6, 0.9)),
    "moment": ("gauge", (0.4,)),
}


def inputs(arm):
    """Each load as tfarm writes it, and as the oracle does."""
    low, middle, high = (share * arm.length for share in (0.2, 0.6, 0.7))
    yield f"force@{middle!r}", ("force", middle)
    yield f"moment_pair@{low!r},{high!r}", ("moment_pair", low, high)


@pytest.mark.parametrize(("arm", "s"), thinned([(arm, s) for arm in (BENCH, FLEX) for s in S], 4))
def test_every_output_of_a_load(arm, s):
    for text, load in inputs(arm):
        for name, (theirs, shares) in READ.items():
            for share in shares or (None,):
                x = None if share is None else share * arm.length
                wanted = theirs if x is None else (theirs, x)
                exact = complex(response(arm, s, [wanted], 40, input=load)[wanted])
                found = tfarm.transfer(arm, name, x=x, input=text)(s)
                assert abs(found - exact) <= FEW * EPS * abs(exact)


@pytest.mark.parametrize("s", S)
@pytest.mark.parametrize("share", [0.0, 0.13, 0.6, 1.0])
def test_a_force_turns_the_hub_as_a_torque_moves_the_place(share, s):
    """Reciprocity (Maxwell and Betti), damping included; the inputs are a force and a torque."""
    x = share * BENCH.length
    moved = tfarm.transfer(BENCH, "displacement", x=x)(s)
    assert abs(tfarm.transfer(BENCH, "hub_angle", input=f"force@{x!r}")(s) - moved) <= FEW * EPS * abs(moved)


@pytest.mark.parametrize("x", [0.01, 0.3])
def test_strain_is_half_the_depth_times_the_curvature(x):
    link = BENCH.link if x < BENCH.link.length else BENCH.outer[0]
    for s in S:
        curvature = complex(response(BENCH, s, [("curvature", x)], 40)["curvature", x])
        expected = curvature * dict(link.section.dimensions)["depth"] / 2
        G = tfarm.transfer(BENCH, "strain", x=x)
        assert abs(G(s) - expected) <= FEW * EPS * (abs(expected) + abs(s * G.derivative(s)))


def test_what_is_no_load_is_refused():
    for text in ("force@3", "force@a", "force@0.1,0.2", "moment_pair@0.1", "moment_pair@0.1,0.1", "blow@0.1"):
        with pytest.raises(ParameterError, match=r"^input = "):
            tfarm.transfer(BENCH, "hub_angle", input=text)
    G = tfarm.transfer(BENCH, "hub_angle", input="force@0.1")
    for ask in (lambda: G.derivative(1j), lambda: G.digits(1j, 20), lambda: G.zeros(up_to=10.0), lambda: G.static):
        with pytest.raises(ParameterError, match=r"^input = "):
            ask()
