"""Mode shapes, hub participation, energies, nodes and sensitivities, each by a method the code does not use."""

import math
from bisect import bisect_left
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import chebyshev

import tfarm
from tests.models import Ritz
from tests.shared import thinned
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm import Hub, ParameterError, Payload
from tfarm.arm import Attachment, Motor, RotarySpring
from tfarm.arm.parts import Section
from tfarm.exact.system import system_of
from tfarm.spectrum.table import flexible_frequencies

EPS = np.finfo(float).eps
COUNT = 10


def arm_for(case):
    return some_arm(np.random.default_rng(400 + BOUNDARY_CASES.index(case)), case, damping=0.0)


@pytest.fixture(params=BOUNDARY_CASES, ids="-".join, scope="module")
def modes(request):
    return tfarm.modes(arm_for(request.param), COUNT)


def gauss(arm, points=120):
    nodes, weights = np.polynomial.legendre.leggauss(points)
    return arm.link.length * (nodes + 1) / 2, arm.link.length * weights / 2


def modal_mass(modes):
    """int rho A w w + rho I psi psi, and the bodies at the ends: by one Gauss rule of 120 points."""
    arm, (x, weights) = modes.arm, gauss(modes.arm)
    w, psi = modes.shape(x), modes.rotation(x)
    mass = arm.link.rhoA * (w * weights) @ w.T + arm.link.rhoI * (psi * weights) @ psi.T
    tip = arm.link.length
    bodies = (arm.hub.inertia, modes.hub_participation), (arm.payload.mass, modes.shape(tip))
    for inertia, motion in (*bodies, (arm.payload.inertia, modes.rotation(tip))):
        if math.isfinite(inertia):
            mass = mass + inertia * np.outer(motion, motion)
    return mass


def test_modes_are_orthogonal_and_of_unit_modal_mass(modes):
    """The rigid-body one included; what both bodies at the ends cancel is lost, so the scale is theirs."""
    np.testing.assert_allclose(modal_mass(modes), np.eye(len(modes)), rtol=0, atol=1e4 * EPS)


def test_the_fields_obey_the_equations_of_motion(modes):
    """w' = psi + Q/kGA, psi' = M/EI, M' = -rhoI w^2 psi - Q, Q' = -rhoA w^2 w: by Chebyshev differentiation.

    Differentiating n points spectrally multiplies rounding by n^2.
    """
    link, n = modes.arm.link, 60
    nodes = chebyshev.chebpts1(n)
    x, square = link.length * (nodes + 1) / 2, modes.natural_frequency[:, None] ** 2
    fields = modes.shape(x), modes.rotation(x), modes.moment(x), modes.shear(x)
    w, psi, M, Q = fields
    right = (psi, Q / link.kGA), (M / link.EI,), (-link.rhoI * square * psi, -Q), (-link.rhoA * square * w,)
    for field, terms in zip(fields, right, strict=True):
        coefficients_of = chebyshev.chebfit(nodes, field.T, n - 1)
        derivative = chebyshev.chebval(nodes, chebyshev.chebder(coefficients_of)) * 2 / link.length
        scale = sum(abs(term).max(axis=1, keepdims=True) for term in (*terms, field / link.length))
        assert (abs(derivative - sum(terms)) <= 40 * n * n * EPS * scale).all()


def turning(arm, omega):
    """Moment per rotation of a wave at omega: the scale of moments for the mode at the cut-off, where nothing bends."""
    link = arm.link
    return link.EI / link.length + omega * math.sqrt(link.EI * link.rhoI)


def test_the_ends_hold_what_they_should(modes):
    """w(0) = 0; I_h w^2 b = -M(0); m w^2 w(L) = Q(L); I_c w^2 psi(L) = M(L); or no motion at all."""
    arm, L, square = modes.arm, modes.arm.link.length, modes.natural_frequency**2
    x = np.linspace(0, L, 200)
    peaks = {name: abs(getattr(modes, name)(x)).max(axis=1) for name in ("shape", "rotation", "moment", "shear")}
    peaks["moment"] += turning(arm, modes.natural_frequency) * peaks["rotation"]
    peaks["shape"] += L * peaks["rotation"]
    assert (abs(modes.shape(0.0)) <= 1e3 * EPS * peaks["shape"]).all()
    ends = (
        (arm.hub.inertia, modes.rotation(0.0), -modes.moment(0.0), "rotation", "moment"),
        (arm.payload.mass, modes.shape(L), modes.shear(L), "shape", "shear"),
        (arm.payload.inertia, modes.rotation(L), modes.moment(L), "rotation", "moment"),
    )
    for inertia, motion, load, moves, loads in ends:
        if math.isinf(inertia):
            assert (abs(motion) <= 1e3 * EPS * peaks[moves]).all()
        else:
            scale = inertia * square * peaks[moves] + peaks[loads]
            assert (abs(inertia * square * motion - load) <= 1e4 * EPS * scale).all()


def test_the_tip_moves_up(modes):
    tip = modes.shape(modes.arm.link.length)
    if math.isfinite(modes.arm.payload.mass):
        assert (tip > 0).all()


@pytest.mark.parametrize("case", thinned([(case,) for case in BOUNDARY_CASES], 4), ids="-".join)
def test_shapes_and_nodes_are_those_of_a_ritz_model(case):
    """As many nodes as the shape of a model of polynomials changes sign, and zeros of the shape each of them."""
    arm = arm_for(case)
    beam = arm.link.rhoA * arm.link.length
    bodies = {"zero": 0.0, "some": 0.7, "infinite": math.inf}  # heavier ones have a node too near an end
    hub, mass, inertia = (bodies[kind] for kind in case)
    unit = beam * arm.link.length**2
    arm = replace(arm, hub=Hub(inertia=hub * unit), payload=Payload(mass=mass * beam, inertia=0.01 * inertia * unit))
    modes, model = tfarm.modes(arm, 8), Ritz(arm)
    x = np.r_[0, np.geomspace(1e-6, 1e-2, 30), np.linspace(0.01, 1, 400)[1:]]
    shapes = (model.motion(x)[0] @ model.flexibilities()[1][:, :8]).T
    x = x * arm.link.length
    for row, theirs in enumerate(shapes, int(arm.has_rigid_mode)):
        mine, nodes = modes.shape(x)[row], modes.nodes[row]
        if abs(mine).max() < 1e-6 * arm.link.length * abs(modes.rotation(x)[row]).max():
            assert not nodes.size  # the mode at the cut-off
            continue
        scale = (mine @ theirs) / (theirs @ theirs)
        assert abs(mine - scale * theirs).max() < 1e-7 * abs(mine).max()
        signs = np.sign(theirs[1:-1] if math.isinf(mass) else theirs[1:])
        assert nodes.size == (np.diff(signs) != 0).sum()
        assert ((nodes > 0) & (nodes < arm.link.length)).all()
        slope = modes.rotation(nodes)[row] + modes.shear(nodes)[row] / arm.link.kGA
        rounding = 64 * EPS * (abs(slope) * arm.link.length + abs(mine).max())
        assert (abs(modes.shape(nodes)[row]) <= rounding).all()


def test_sensitivities_add_up(modes):
    """Scaling laws: E, G and all inertias together leave w as it is; so do metres, with what they measure."""
    sensitivity = modes.sensitivity
    stiffness = sensitivity["youngs_modulus"] + sensitivity["shear_modulus"]
    bodies = sum(sensitivity[name] for name in ("hub_inertia", "payload_mass", "payload_inertia"))
    flexible = modes.index > 0
    np.testing.assert_allclose(stiffness[flexible], 0.5, rtol=0, atol=1e4 * EPS)
    np.testing.assert_allclose((sensitivity["density"] + bodies)[flexible], -0.5, rtol=0, atol=1e4 * EPS)
    metres = sensitivity["length"] + 2 * sensitivity["area"] + 4 * sensitivity["second_moment"]
    metres = metres + 3 * sensitivity["payload_mass"]
    metres = metres + 5 * (sensitivity["hub_inertia"] + sensitivity["payload_inertia"])
    np.testing.assert_allclose(metres[flexible], -1.0, rtol=0, atol=1e4 * EPS)


@pytest.mark.parametrize("x", [-0.1, 1.1, math.nan])
def test_a_point_outside_the_arm_has_no_shape(x):
    with pytest.raises(ParameterError, match="a point of the arm lies between 0 and"):
        tfarm.modes(tfarm.load("sasaki2012"), 1).shape(x)


def test_euler_bernoulli_has_no_shear_energy():
    arm = replace(tfarm.load("stocky-steel"), payload=Payload(mass=1.0, inertia=0.1))
    for theory, without in (("euler-bernoulli", "shear_modulus"), ("rayleigh", "shear_modulus")):
        assert not tfarm.modes(arm, 5, theory=theory).sensitivity[without].any()
    assert system_of(arm, "shear").segments[0].a == 0


def test_the_root_moment_of_a_light_hub_is_not_rounding():
    """It tends to -I_h w^2 b of the free pin, in proportion to I_h; at the free pin it is 0."""
    free = replace(tfarm.load("sasaki2012"), hub=Hub(inertia=0.0))
    light = replace(free, hub=Hub(inertia=1e-12))
    modes = tfarm.modes(free, COUNT)
    assert not modes.modal_moment.any()
    limit = -(modes.natural_frequency[1:] ** 2) * modes.hub_participation[1:]
    np.testing.assert_allclose(tfarm.modes(light, COUNT).modal_moment[1:] / 1e-12, limit, rtol=1e-6)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_flexible_frequencies_below_are_the_first_ones_of_the_table(count):
    """Half way between two of them, as many as lie below: none, one, two, the rigid body not among them."""
    lab = tfarm.load("sasaki2012-lab")
    w = tfarm.modes(lab, 4).natural_frequency
    found = flexible_frequencies(lab, float(w[count] + w[count + 1]) / 2)
    np.testing.assert_array_equal(found, w[1 : count + 1])


FEW = 4
OF_SECTION = ("area", "second_moment", "shear_factor")


def every_part(theory="timoshenko", **parts):
    """Two segments with all that a sensitivity is given for; nothing damped."""
    bench = tfarm.load("tests/rigs/bench-rig.toml")
    links = [general(replace(link, damping=0.0)) for link in bench.links]
    held = Attachment(x=0.2, mass=0.03, inertia=2e-5, stiffness=300.0, rotational_stiffness=0.5)
    arm = replace(
        bench,
        link=links[0],
        outer=(links[1],),
        hub=Hub(inertia=2e-3, radius=0.04, stiffness=0.7),
        clamp=RotarySpring(stiffness=400.0),
        joint=RotarySpring(stiffness=150.0),
        motor=Motor(resistance=2.6, torque_constant=0.0077, gear_ratio=14.0, rotor_inertia=4e-6),
        attachments=(Attachment(x=0.03, inertia=1e-6), held, Attachment(x=0.06, mass=0.01)),
        payload=Payload(mass=0.12, inertia=4e-5, offset=-0.015),
        input="hub_torque",
        theory=theory,
    )
    return replace(arm, **parts)


def general(link):
    """The same link, its section by numbers."""
    area, second_moment, factor = link.section.area, link.section.second_moment, link.shear_factor
    return replace(link, section=Section.general(area=area, second_moment=second_moment, shear_factor=factor))


def varied(arm, name, factor):
    """The rig with that parameter `factor` times as large; lengths take along what is attached to them."""
    if name.startswith("segment"):
        _, number, *rest = name.split("_")
        return with_link(arm, [int(number) - 1], "_".join(rest), factor)
    if name.startswith("attachment"):
        _, number, *rest = name.split("_")
        each, field = arm.attachments[int(number) - 1], "_".join(rest)
        changed = replace(each, **{field: getattr(each, field) * factor})
        others = tuple(changed if one is each else one for one in arm.attachments)
        return replace(arm, attachments=others)
    if name in ("rotor_inertia", "gear_ratio"):
        return replace(arm, motor=replace(arm.motor, **{name: getattr(arm.motor, name) * factor}))
    for part in ("hub", "payload", "clamp", "joint"):
        if name.startswith(f"{part}_"):
            field, record = name.removeprefix(f"{part}_"), getattr(arm, part)
            return replace(arm, **{part: replace(record, **{field: getattr(record, field) * factor})})
    return with_link(arm, range(len(arm.links)), name, factor)


def with_link(arm, numbers, field, factor):
    links = list(arm.links)
    for number in numbers:
        link = links[number]
        record = link.section if field in OF_SECTION else link
        changed = replace(record, **{field: getattr(record, field) * factor})
        links[number] = replace(link, section=changed) if field in OF_SECTION else changed
    before, after = (np.cumsum([0.0, *(link.length for link in some)]) for some in (arm.links, links))
    attachments = tuple(replace(each, x=moved(each.x, before, after)) for each in arm.attachments)
    return replace(arm, link=links[0], outer=tuple(links[1:]), attachments=attachments)


def moved(x, before, after):
    """Where the same share of the same segment is."""
    number = max(1, bisect_left(before.tolist(), x))
    share = (x - before[number - 1]) / (before[number] - before[number - 1])
    return float(after[number - 1] + share * (after[number] - after[number - 1]))


RIGS = {
    "every part": every_part(),
    "euler-bernoulli": every_part(theory="euler-bernoulli"),
    "centre pinned": every_part(theory="shear", payload=Payload(mass=math.inf, inertia=4e-5, offset=0.02)),
    "locked behind a joint": every_part(theory="rayleigh", hub=Hub(inertia=math.inf, radius=0.04), motor=None),
    "one segment": every_part(outer=(), attachments=(Attachment(x=0.03, mass=0.02),)),
}


@pytest.mark.parametrize("rig", thinned(RIGS, 4))
def test_each_is_the_difference_between_neighbours(rig):
    """Of the logarithms, fourth order with 4 h: their error is h^4 of the fifth derivative and eps/h."""
    arm, h = RIGS[rig], 2.0**-9
    exact = tfarm.modes(arm, FEW)
    for name, values in exact.sensitivity.items():
        log = {
            n: np.log(tfarm.modes(varied(arm, name, math.exp(n * h)), FEW).natural_frequency[-FEW:])
            for n in (-2, -1, 1, 2)
        }
        difference = (8 * (log[1] - log[-1]) - (log[2] - log[-2])) / (12 * h)
        np.testing.assert_allclose(values[-FEW:], difference, rtol=0, atol=200 * h**4 + 100 * EPS / h, err_msg=name)


def test_a_rig_has_an_entry_for_every_part_it_has_and_for_each_segment():
    names = set(tfarm.modes(RIGS["every part"], 1).sensitivity)
    assert {"hub_radius", "hub_stiffness", "clamp_stiffness", "joint_stiffness", "payload_offset"} <= names
    assert {"rotor_inertia", "gear_ratio", "segment_1_length", "segment_2_density"} <= names
    assert {name for name in names if name.startswith("attachment")} == {
        "attachment_1_x", "attachment_1_inertia", "attachment_2_x", "attachment_2_mass", "attachment_2_inertia",
        "attachment_2_stiffness", "attachment_2_rotational_stiffness", "attachment_3_mass",
    }  # fmt: skip
    assert not any("segment" in name for name in tfarm.modes(RIGS["one segment"], 1).sensitivity)
