"""Bands and discs on the unit circle: what they leave out and hold, next to slow poles too; grids, digits shown."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import tfarm
from tests.shared import circle_crossings
from tfarm.arm import FED_BACK, HubFeedback, Law
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Sampling
from tfarm.loop.circle import Arcs, Circle, Discs, complete_band, root_ratio
from tfarm.loop.circle_crossings import FACTOR
from tfarm.loop.edges import delay_limit, whole_loop
from tfarm.loop.left_poles import filter_bound
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.reduced import modal_model

LAB = tfarm.load("sasaki2012-lab")
GAINS = HubFeedback(K1=0.3, K2=0.3)


@pytest.mark.parametrize("delay", [0.0, 1.3])
def test_the_filters_own_pole_errs_by_what_the_model_is_off_at_its_corner(delay):
    """Next to the arm's own, e^{pT} of p = -wc has the residue wc G(-wc): what another G makes of H, all round."""
    corner, T = 200.0, 0.01
    loop = sampled_loop(
        Case(LAB, GAINS, Chain(sampling=Sampling(delay_samples=delay, antialias_corner=corner))), count=2
    )
    s = np.array([-corner + 0j])
    model, exact = modal_model(LAB, FED_BACK, 2)(s)[:, 0], tfarm.transfer(LAB, list(FED_BACK))(s)[:, 0]
    z = np.exp(1j * np.linspace(0, np.pi, 2001))
    late = math.exp(-corner * T * (1 - delay % 1))
    most = max(abs((1 - 1 / z) * late / (z - math.exp(-corner * T))))
    found = filter_bound(loop, 1000.0)
    np.testing.assert_allclose(found, [0.0, *abs(model - exact)[1:] * most], rtol=1e-6, atol=1e-15)
    assert found[2] > 1e-12
    assert not filter_bound(loop, 150.0).any()  # its pole is left of the line


def test_without_a_band_a_delay_margin_has_the_digits_that_twice_the_modes_leave():
    """Less than one sample of it: both ends of what is shown are on their sides of the edge with sixteen modes too."""
    loop = sampled_loop(Case(LAB, replace(GAINS, K2=1.1), Chain(sampling=Sampling(delay_samples=0.5))), count=4)
    figure = delay_limit(loop, None).figure
    assert 0 < figure.value < 1
    assert (figure.is_settled, figure.modes) == (False, 4)
    assert figure.digits >= 2
    half, many = 0.5 * 10.0 ** (math.floor(math.log10(figure.value)) - figure.digits + 1), loop.with_modes(16)
    radii = [abs(many.with_delay(0.5 + float(figure.text) + side * half).eigenvalues).max() for side in (-1, 1)]
    assert radii[0] < 1 < radii[1]


def test_a_law_without_zeros_at_rest_is_seen_to_cross_however_slowly():
    """(J + g T/2) theta'' + (b - g) theta' + 1e-10 J g/b theta, fed back T/2 late: on the axis at g = b."""
    friction, T = 0.3, 0.01
    arm = replace(LAB, hub=replace(LAB.hub, friction=friction))
    soft = 1e-10 * arm.total_inertia / friction
    # a block that is this constant, with a pole of its own: as a gain at the hub it is refused as too small
    law = Law({"hub_rate": -1.0, "hub_angle": ([soft, 1e3 * soft], [1.0, 1e3])})
    (found,) = [
        each for each in circle_crossings(sampled_loop(Case(arm, law, Chain()), count=2), FACTOR) if each.at < 1e-3
    ]
    assert found.t == pytest.approx(friction, rel=1e-6)
    assert found.at == pytest.approx(1e-5 * T / math.sqrt(1 + friction * T / 2 / arm.total_inertia), rel=1e-6)
    assert found.change == 2


ROOTS = {  # less 1
    "a constant": [],
    "a lag": [-0.3],
    "a notch next to z = 1": [-1e-4 + 1e-3j, -1e-4 - 1e-3j],
    "a cluster next to z = 1": [-1e-4, -1.1e-4, -9e-5 + 1e-5j, -9e-5 - 1e-5j],
    "degree 5": [-2.0, -1.7 + 0.4j, -1.7 - 0.4j, -1.0, 0.2],
}


@pytest.mark.parametrize("half", [1e-6, 1e-3, 0.1, 0.8])
@pytest.mark.parametrize("name", ROOTS)
def test_a_disc_holds_every_value_on_its_arc_and_is_no_larger_than_its_terms(name, half):
    """Values at points of the arc with forty digits; their largest distance from the middle is found, not bounded."""
    roots = np.array(ROOTS[name], dtype=complex)
    angles = np.array([0.0, 1e-4, 0.7, 2.0, math.pi])
    radius = np.full(angles.size, 2 * math.sin(half / 2))
    found = root_ratio(Discs(-np.expm1(-1j * angles), radius), roots)
    away = np.zeros(angles.size)
    with mpmath.workdps(40):
        for n, angle in enumerate(angles.tolist()):
            for share in np.linspace(-1, 1, 41).tolist():
                x = 1 - mpmath.expj(-mpmath.mpf(angle) - share * mpmath.mpf(half))
                exact = mpmath.fprod(x * (1 + mpmath.mpc(r)) - mpmath.mpc(r) for r in roots.tolist())
                away[n] = max(away[n], float(abs(exact - mpmath.mpc(found.middle[n].item()))))
    assert (away <= found.radius).all()
    sizes = abs(-np.expm1(-1j * angles)[:, None] * (1 + roots) - roots)
    most = (sizes + radius[:, None] * abs(1 + roots)).prod(axis=1)
    assert (found.radius <= most - sizes.prod(axis=1) + 1e-13 * (1 + most)).all()


def test_a_disc_about_a_point_is_as_wide_as_rounding_next_to_a_pole_too():
    """The sum of r/(z - e^{pT}) with forty digits, z from 1e-9 rad next to a pole on."""
    arm, T = tfarm.load("sasaki2012-lab"), 0.01
    loop = sampled_loop(Case(arm, HubFeedback(), Chain()), count=3)
    plant = loop.plant
    q = np.angle(loop.pulse.multipliers[0]) + np.array([1e-9, 1e-5, 0.3])
    circle = Circle(loop, np.ones(plant.poles.size, bool), np.zeros(3))
    found = circle.pole_sums(Arcs(q, 0 * q), plant.residues)
    with mpmath.workdps(40):
        z = [mpmath.expj(mpmath.mpf(each)) for each in q]
        b = [mpmath.exp(mpmath.mpc(each) * T) for each in plant.poles]
        for row, n in np.ndindex(found.middle.shape):
            exact = mpmath.fsum(r / (z[n] - each) for r, each in zip(plant.residues[row].tolist(), b, strict=True))
            assert abs(found.middle[row, n] - exact) <= found.radius[row, n]
    assert (found.radius < 1e-4 * abs(found.middle)).all()


BRAKED = replace(LAB, hub=replace(LAB.hub, friction=0.01))  # its slow pole is at -b/J = -0.015 1/s
LOOSE = replace(LAB, hub=replace(LAB.hub, friction=1e-7))
SPRUNG = replace(LAB, hub=replace(LAB.hub, stiffness=1e-3))  # and here a slow pair, of the hub on its spring
CHAINS = {
    "plain": Chain(),
    "late": Chain(sampling=Sampling(period=0.005, delay_samples=1.3)),
    "encoder": Chain(sampling=Sampling(period=0.002), converters=Converters(hub_rate="difference")),
}
LEAD = Law({"hub_angle": ([0.1, 1.0], [0.01, 1.0]), "hub_rate": 0.3})
HELD = HubFeedback(K1=0.3, K2=0.3, Kp=1.0)


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("arm", [LAB, BRAKED, LOOSE, SPRUNG], ids=["free", "friction", "hardly any", "spring"])
def test_discs_hold_the_terms_of_the_loop(arm, chain):
    """x^n H, through the law, at the middle and at a point of arcs, by `SampledRig.terms`; before and after a cut."""
    loop = whole_loop(Case(arm, HELD, chain))
    circle, rng = complete_band(loop).circle, np.random.default_rng(3)
    for share in (0.5, rng.uniform(0, 1, circle.first_arcs)):
        arcs = np.flatnonzero(circle.low > 0.1)[: circle.first_arcs]
        q = circle.low[arcs] + (share * np.ones(circle.first_arcs))[: arcs.size] * (circle.high - circle.low)[arcs]
        z = np.exp(1j * q)
        terms = loop.rig.terms(z, None, np.ones(q.size))
        for row, (_, signal, gain, roots) in enumerate(circle.terms):
            disc, order = circle.parts[1 + row], circle.orders[signal] - int((roots == 0).sum())
            off = abs((1 - 1 / z) ** order * terms[row] / gain * z**-loop.in_z.poles.size - disc.middle[arcs])
            is_middle = np.isscalar(share) and arm in (LAB, BRAKED)  # of the others the terms themselves lose digits
            assert (off <= (1e-8 * abs(disc.middle[arcs]) if is_middle else disc.radius[arcs])).all()
        circle.count(loop.with_number("K2", 1.1).weights)
    assert circle.low.size > circle.first_arcs


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("law", [HELD, replace(HELD, Kp=0.01), LEAD], ids=["PD", "soft", "lead"])
@pytest.mark.parametrize("arm", [BRAKED, LOOSE], ids=["friction", "hardly any"])
def test_a_verdict_on_a_hub_with_friction_is_proven(arm, chain, law):
    verdict = sampled_verdict(Case(arm, law, chain))
    assert verdict.is_settled
    assert verdict.is_stable == (np.abs(np.linalg.eigvals(verdict.loop.reduced_matrix())).max() < 1)
