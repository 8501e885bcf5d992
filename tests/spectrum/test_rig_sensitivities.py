"""Sensitivities of rigs: differences between neighbouring rigs."""

import math
from bisect import bisect_left
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tfarm import Hub, Payload
from tfarm.arm import Attachment, Motor, RotarySpring
from tfarm.arm.parts import Section

EPS = np.finfo(float).eps
COUNT = 4
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
    exact = tfarm.modes(arm, COUNT)
    for name, values in exact.sensitivity.items():
        log = {
            n: np.log(tfarm.modes(varied(arm, name, math.exp(n * h)), COUNT).natural_frequency[-COUNT:])
            for n in (-2, -1, 1, 2)
        }
        difference = (8 * (log[1] - log[-1]) - (log[2] - log[-2])) / (12 * h)
        np.testing.assert_allclose(values[-COUNT:], difference, rtol=0, atol=200 * h**4 + 100 * EPS / h, err_msg=name)


def test_a_rig_has_an_entry_for_every_part_it_has_and_for_each_segment():
    names = set(tfarm.modes(RIGS["every part"], 1).sensitivity)
    assert {"hub_radius", "hub_stiffness", "clamp_stiffness", "joint_stiffness", "payload_offset"} <= names
    assert {"rotor_inertia", "gear_ratio", "segment_1_length", "segment_2_density"} <= names
    assert {name for name in names if name.startswith("attachment")} == {
        "attachment_1_x", "attachment_1_inertia", "attachment_2_x", "attachment_2_mass", "attachment_2_inertia",
        "attachment_2_stiffness", "attachment_2_rotational_stiffness", "attachment_3_mass",
    }  # fmt: skip
    assert not any("segment" in name for name in tfarm.modes(RIGS["one segment"], 1).sensitivity)
