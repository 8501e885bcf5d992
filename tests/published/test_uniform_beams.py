"""Published tables of uniform Euler-Bernoulli beams, against the determinant of their end conditions.

blevins-1979, blevins-1979-sliding, thomson-appendix-d, code-aster-v2.05.400, vpcs-sdll15, bir-2010, wang-2017,
chun-1972, bhat-wagner-1976 and bellezza-lanari-ulivi-1990, as `tfarm.audit` has them; which of their printed
digits are ours, and reasons for the others, `validate` has.
"""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm import Hub, Payload
from tfarm.arm import RotarySpring
from tfarm.audit.published import ALL, agrees, arm_of_case, exact_numbers

inf = math.inf
SOURCES = {source.key: source.cases for source in ALL}
UNIFORM = [
    case for cases in SOURCES.values() for case in cases
    if case.theory == "euler-bernoulli" and not case.arm.attachments
]  # fmt: skip


def beam(root=inf, mass=0.0, inertia=0.0):
    """A beam of L = rhoA = EI = 1 between a hub of that inertia and a payload."""
    return arm_of_case({"hub": {"inertia": root}, "payload": {"mass": mass, "inertia": inertia}})


ENDS = [  # every pair of ends that an arm can have, of which Blevins has those too that the audit leaves out
    beam(root=root, mass=mass, inertia=inertia) for root in (inf, 0.0) for mass in (0.0, inf) for inertia in (0.0, inf)
]
SPRINGS = [  # a yielding clamp, a yielding joint and a spring on a hub without inertia are one and the same here
    replace(beam(), **parts)
    for k in (0.1, 100.0)
    for parts in (
        {"clamp": RotarySpring(stiffness=k)},
        {"joint": RotarySpring(stiffness=k)},
        {"hub": Hub(inertia=0.0, stiffness=k)},
    )
]


def conditions(z, arm, sign=1):
    """The rows of waves cos, sin, cosh, sinh of z x and of theta, over L = rhoA = EI = 1; `sign` is that of I_c.

    w(0) = r theta and w'' = K (w' - theta) at the root, where a hub has (J z^4 - k) theta + w'' - r w''' = 0; beyond
    the tip a body with w'' = z^4 I_c w' - e w''' and w''' = -z^4 m (w + e w'), or held.
    """
    link, hub, body = arm.link, arm.hub, arm.payload
    L, EI, rhoA = (mpmath.mpf(each) for each in (link.length, link.EI, link.rhoA))
    J, r, k = hub.inertia / (rhoA * L**3), hub.radius / L, hub.stiffness * L / EI
    m, e, I_c = body.mass / (rhoA * L), body.offset / L, sign * body.inertia / (rhoA * L**3)
    K = min(arm.clamp.stiffness, arm.joint.stiffness) * L / EI
    s, c, sh, ch = mpmath.sin(z), mpmath.cos(z), mpmath.sinh(z), mpmath.cosh(z)
    start = [(1, 0, -(z**2), 0), (0, z, 0, -(z**3)), (1, 0, z**2, 0), (0, z, 0, z**3)]  # w, w', w'', w''' at 0
    end = [
        (c, -z * s, -(z**2) * c, z**3 * s), (s, z * c, -(z**2) * s, -(z**3) * c),
        (ch, z * sh, z**2 * ch, z**3 * sh), (sh, z * ch, z**2 * sh, z**3 * ch),
    ]  # fmt: skip
    return [
        [*(w for w, *_ in start), -r],
        [*(slope if mpmath.isinf(K) else slope - bend / K for _, slope, bend, _ in start), -1],
        [0, 0, 0, 0, 1] if mpmath.isinf(J) else [*(bend - r * shear for *_, bend, shear in start), J * z**4 - k],
        [*(slope if mpmath.isinf(I_c) else bend + e * shear - z**4 * I_c * slope for _, slope, bend, shear in end), 0],
        [*(w + e * slope if mpmath.isinf(m) else shear + z**4 * m * (w + e * slope) for w, slope, _, shear in end), 0],
    ]  # fmt: skip


def determinant(rows):
    """Laplace's expansion: no pivot that could be refused."""
    first, *others = rows
    terms = (
        (-1) ** n * value * determinant([[*row[:n], *row[n + 1 :]] for row in others])
        for n, value in enumerate(first)
        if value
    )
    return mpmath.fsum(terms) if others else first[0]


def root(arm, guess, sign=1):
    """The z nearest to a guess at which the conditions can be met, to thirty digits."""
    guess = mpmath.mpf(guess)
    pair = guess, guess * (1 + mpmath.mpf(10) ** -6)
    return mpmath.findroot(lambda z: determinant(conditions(z, arm, sign)), pair, verify=False)  # of what size it is


def wave_numbers(arm, count):
    """z of the first flexible modes, as tfarm has them."""
    omega = tfarm.modes(arm, count, theory="euler-bernoulli").natural_frequency[-count:]
    return np.sqrt(omega * arm.link.length**2 * math.sqrt(arm.link.rhoA / arm.link.EI))


@pytest.mark.parametrize("arm", [*(case.arm for case in UNIFORM), *ENDS, *SPRINGS])
def test_frequencies_are_roots_of_the_end_conditions(arm):
    with mpmath.workdps(50):
        for z in wave_numbers(arm, 8).tolist():
            assert z == pytest.approx(float(root(arm, z)), rel=1e-14)


@pytest.mark.parametrize("key", ["bhat-wagner-1976", "bellezza-lanari-ulivi-1990"])
def test_none_of_the_first_ten_is_left_out(key):
    """By the determinant's changes of sign; a tip body, and a hub, off the end."""
    arm = SOURCES[key][2].arm
    with mpmath.workdps(30):
        grid = mpmath.linspace(0.3, float(wave_numbers(arm, 10)[-1]) + 0.1, 300)
        signs = np.array([int(mpmath.sign(determinant(conditions(z, arm)))) for z in grid])
    assert np.count_nonzero(np.diff(signs)) == 10


@pytest.mark.parametrize("case", SOURCES["wang-2017"][1:])
def test_wang_2017_has_the_sign_of_the_tip_inertia_reversed(case):
    """Theirs are the roots for -I_c, and cannot be frequencies: inertia on the tip lowers them (Rayleigh)."""
    printed = np.array([float(text) for text in case.printed])
    with mpmath.workdps(40):
        for text in case.printed:
            assert agrees(float(root(case.arm, math.sqrt(float(text)), sign=-1) ** 2), text)
    bare, sliding = (beam(mass=case.arm.payload.mass, inertia=inertia) for inertia in (0.0, inf))
    without, held = (exact_numbers(replace(case, arm=arm)) for arm in (bare, sliding))
    assert (exact_numbers(case) < without).all()
    assert (without < printed).all()
    assert (exact_numbers(case)[1:] > held[:-1]).all()  # one more constraint: they interlace


def test_bir_2010_rounded_its_length_and_the_second_frequency_twice():
    """With 1000^(1/2) m the unit EI/(rhoA L^4) is 1 s^-2, so the third agrees, the second rounded twice."""
    bare = SOURCES["bir-2010"][0]
    link = replace(bare.arm.link, length=math.sqrt(1000.0))
    meant = exact_numbers(replace(bare, arm=replace(bare.arm, link=link))).tolist()
    assert agrees(meant[2], bare.printed[2])
    assert not agrees(meant[1], bare.printed[1])
    assert f"{meant[1]:.4f}" == "22.0345"
    assert agrees(22.0345, bare.printed[1])


def test_vpcs_sdll15_has_rayleighs_estimate_for_its_first():
    """sqrt(3 EI / (L^3 (m + 0.24 M))) / 2 pi lies below; the static deflection gives 33/140 of M, the beam's mass."""
    (case,) = SOURCES["vpcs-sdll15"]
    link, first = case.arm.link, exact_numbers(case)[0]

    def estimate(share):
        carried = case.arm.payload.mass + share * link.rhoA * link.length
        return math.sqrt(3 * link.EI / (link.length**3 * carried)) / (2 * math.pi)

    assert agrees(estimate(0.24), case.printed[0])
    assert all(f"{each:.4f}" in case.why[1] for each in (estimate(0.24), first))
    assert estimate(0.24) < first < estimate(33 / 140)


def test_blevins_1979_misprints_the_third_clamped_root_in_its_last_digit():
    """10.9956079: cos z cosh z - 1 changes its sign half a unit and more below it."""
    signs = [
        mpmath.sign(mpmath.cos(mpmath.mpf(z)) * mpmath.cosh(mpmath.mpf(z)) - 1)
        for z in ("10.99560783", "10.99560784", "10.99560785", "10.9956079")
    ]
    assert signs[0] != signs[1] == signs[2] == signs[3]


@pytest.mark.parametrize("theory", ["timoshenko", "shear", "rayleigh"])
def test_a_slender_beam_approaches_the_tables(theory):
    """The other theories come down to Euler's as (r/L)^2: ten times as slender, a hundred times as close."""
    excess = []
    for slenderness in (300.0, 3000.0):
        exact, simple = (
            tfarm.modes(arm_of_case({"slenderness": slenderness}), 3, theory=each).natural_frequency
            for each in (theory, "euler-bernoulli")
        )
        excess.append(simple / exact - 1)
    assert (excess[0] > 0).all()
    assert excess[1] == pytest.approx(excess[0] / 100, rel=1e-2, abs=0)


@pytest.mark.parametrize("part", ["root", "tip"])
def test_an_end_slides_in_the_limit_of_one_over_the_distance(part):
    """A tenth of the distance to the axis, or to the pin beyond the tip, left: ten times the difference."""
    case = SOURCES["blevins-1979-sliding"][part == "tip"]
    found = []
    for far in (1e4, 1e5):
        parts = {"hub": Hub(inertia=0.0, radius=far)} if part == "root" else {"payload": Payload(mass=inf, offset=far)}
        found.append(exact_numbers(replace(case, arm=replace(case.arm, **parts))) - exact_numbers(case))
    assert found[0] == pytest.approx(10 * found[1], rel=1e-3)
