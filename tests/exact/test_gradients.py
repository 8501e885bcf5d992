"""The free response with its derivatives: against the values' own differences, and by what a change of units does."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tfarm.errors import ParameterError
from tfarm.exact.series import Direction, response_gradients
from tfarm.exact.system import system_of
from tfarm.response.signals import Signals

NAMES = ("hub_angle", "tip_acceleration", "root_moment", "root_shear", "strain@0.05", "payload_displacement")
STEP = 2.0**-20
RIG = tfarm.load("tests/rigs/bench-rig.toml")


def with_link(arm, **factors):
    """The arm with numbers of every segment multiplied."""
    links = [replace(link, **{name: getattr(link, name) * by for name, by in factors.items()}) for link in arm.links]
    return replace(arm, link=links[0], outer=tuple(links[1:]))


WAYS = {
    "youngs_modulus": lambda arm, by: with_link(arm, youngs_modulus=by),
    "length": lambda arm, by: replace(arm, link=replace(arm.link, length=arm.link.length * by)),
    "damping": lambda arm, by: with_link(arm, damping=by),
    "hub": lambda arm, by: replace(arm, hub=replace(arm.hub, inertia=arm.hub.inertia * by)),
    "payload": lambda arm, by: replace(arm, payload=replace(arm.payload, mass=arm.payload.mass * by)),
    "offset": lambda arm, by: replace(arm, payload=replace(arm.payload, offset=arm.payload.offset * by)),
    "clamp": lambda arm, by: replace(arm, clamp=replace(arm.clamp, stiffness=arm.clamp.stiffness * by)),
    "radius": lambda arm, by: replace(arm, hub=replace(arm.hub, radius=arm.hub.radius * by)),
}


def gradients(arm, ways, s, names=NAMES):
    """Responses (names, n) and their derivatives along ln p (names, ways, n)."""
    directions = []
    for way in ways:
        below, above = way(arm, 1 - STEP), way(arm, 1 + STEP)
        shares = Signals(below, names).places, Signals(above, names).places
        directions.append(Direction(system_of(below), system_of(above), *shares, 2 * STEP))
    signals = Signals(arm, names)
    drive, outputs = response_gradients(system_of(arm), signals.outputs, signals.places, directions, s)
    H = np.array([each.c[0] / drive.c[0] for each in outputs])
    slopes = [h * (each.c[1] / each.c[0] - drive.c[1] / drive.c[0]) for h, each in zip(H, outputs, strict=True)]
    return H, np.array(slopes)


def test_the_values_are_those_of_the_compiled_sweep():
    near_axis = np.geomspace(1, 2e4, 60) * np.exp(1j * np.linspace(1.2, 1.9, 60))  # of two waves the shorter grows less
    s = np.r_[near_axis, np.geomspace(500, 2e4, 6)]  # on the real axis it grows more
    H, _ = gradients(RIG, [WAYS["clamp"]], s)
    assert abs(H / Signals(RIG, NAMES).values(s) - 1).max() < 1e-11


@pytest.mark.parametrize("name", WAYS)
def test_the_slopes_are_those_of_the_values(name):
    """Off the axis, where nothing is steep: a difference over six points with h = 0.005 is good to 1e-10 there."""
    s = np.geomspace(3, 3e3, 12) * np.exp(0.35j * np.pi)
    H, slopes = gradients(RIG, [WAYS[name]], s)
    h = 0.005
    at = {n: Signals(WAYS[name](RIG, 1 + n * h), NAMES).values(s) for n in (-3, -2, -1, 1, 2, 3)}
    difference = (45 * (at[1] - at[-1]) - 9 * (at[2] - at[-2]) + (at[3] - at[-3])) / (60 * h)
    assert (abs(difference - slopes[:, 0]) / (abs(H) + abs(slopes[:, 0]))).max() < 2e-9
    assert (abs(slopes[:, 0]) / abs(H)).max() > 1e-7  # there is something to be compared


def test_all_that_has_mass_or_stiffness_together_scales_the_response_to_torque():
    """Torque over mass: doubling every modulus, density, mass and stiffness halves what a torque does."""

    def heavier(arm, by):
        arm = with_link(arm, youngs_modulus=by, shear_modulus=by, density=by)
        hub = replace(arm.hub, inertia=arm.hub.inertia * by, friction=arm.hub.friction * by)
        payload = replace(arm.payload, mass=arm.payload.mass * by, inertia=arm.payload.inertia * by)
        clamp = replace(arm.clamp, stiffness=arm.clamp.stiffness * by)
        more = tuple(replace(each, mass=each.mass * by) for each in arm.attachments)
        return replace(arm, hub=hub, payload=payload, clamp=clamp, attachments=more)

    s = 1j * np.geomspace(0.5, 2e4, 200)
    H, slopes = gradients(RIG, [heavier], s, ("hub_angle", "tip_acceleration"))
    assert abs(slopes[:, 0] / H + 1).max() < 1e-8
    H, slopes = gradients(RIG, [heavier], s, ("root_moment", "root_shear"))
    assert (abs(slopes[:, 0]) / abs(H)).max() < 1e-8  # moments do not change


def test_slopes_of_random_rigs():
    rng = np.random.default_rng(14)
    for _ in range(6):
        arm = some_rig(rng, drive="hub_torque")
        s = np.geomspace(0.5, 30, 5) * tfarm.modes(arm, 1).natural_frequency[-1] * np.exp(0.35j * np.pi)
        way, h = WAYS["youngs_modulus"], 1e-3
        names = ("hub_angle", "tip_acceleration", "root_moment")
        H, slopes = gradients(arm, [way], s, names)
        at = {n: Signals(way(arm, 1 + n * h), names).values(s) for n in (-2, -1, 1, 2)}
        difference = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * h)
        assert (abs(difference - slopes[:, 0]) / (abs(slopes[:, 0]) + abs(H))).max() < 2e-9


def test_a_step_that_makes_another_chain_is_refused():
    plain, outputs = replace(RIG, attachments=()), Signals(RIG, ("hub_angle",)).outputs
    direction = Direction(system_of(plain), system_of(RIG), (0.0,), (0.0,), 1.0)
    with pytest.raises(ParameterError, match="another chain"):
        response_gradients(system_of(RIG), outputs, (0.0,), [direction], np.array([1j]))
