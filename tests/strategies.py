"""Arms and Laplace variables drawn at random: by a NumPy generator for long runs, by hypothesis for laws of physics."""

import math
from itertools import product

import numpy as np
from hypothesis import strategies as st

from tfarm import Arm, Hub, Link, Payload, Section

ENDS = ("zero", "some", "infinite")
BOUNDARY_CASES = tuple(product(ENDS, repeat=3))  # hub inertia, payload mass, payload inertia


def arm_of(*, length, slenderness, width, density, E, nu, damping, hub, mass, inertia):
    """A rectangular arm; slenderness is length over depth, width in depths, payload in those of the beam.

    The beam's own mass is the unit of `mass`, and a hundredth of its mass times length squared that of `inertia`.
    """
    depth = length / slenderness
    beam = density * width * depth * depth * length
    link = Link.isotropic(
        length=length,
        density=density,
        youngs_modulus=E,
        poissons_ratio=nu,
        section=Section.rectangle(width=width * depth, depth=depth),
        damping=damping,
    )
    payload = Payload(mass=mass * beam, inertia=inertia * beam * length**2 / 100)
    return Arm(link=link, hub=Hub(inertia=hub), payload=payload)


def some_arm(rng, case=None, *, damping=None, slenderness=(5, 500)):
    """An arm with L/h in 5..500, hub 0, 1e-4..1e4 kg m^2 or inf, payload 0..inf; `case` is one of `BOUNDARY_CASES`."""

    def log(low, high):
        return float(10 ** rng.uniform(math.log10(low), math.log10(high)))

    def end(kind):
        return {"zero": 0.0, "some": log(1e-4, 1e4), "infinite": math.inf}[kind]

    if case is None:
        case = rng.choice(ENDS, size=3, p=(0.2, 0.6, 0.2))
    return arm_of(
        length=log(0.1, 10),
        slenderness=log(*slenderness),
        width=log(0.1, 10),
        density=log(500, 1e4),
        E=log(1e9, 3e11),
        nu=float(rng.uniform(0, 0.49)),
        damping=float(rng.choice([0.0, log(1e-7, 1e-3)])) if damping is None else damping,
        hub=end(case[0]),
        mass=end(case[1]),
        inertia=end(case[2]),
    )


def some_s(rng):
    """i w with w = 1e-6..1e6 rad/s, or a complex s of that size in the right or the left half plane."""
    size = 10 ** rng.uniform(-6, 6)
    if rng.random() < 0.6:
        return complex(0.0, size)
    angle = rng.uniform(-math.pi / 2, math.pi / 2)
    return complex(size * np.exp(1j * angle)) * (1 if rng.random() < 0.8 else -1)


def _log(low, high):
    return st.floats(math.log10(low), math.log10(high)).map(lambda power: 10.0**power)


finite = _log(1e-3, 1e3)  # an inertia that is neither zero nor infinite
inertias = st.one_of(st.just(0.0), finite, st.just(math.inf))
dampings = st.one_of(st.just(0.0), _log(1e-7, 1e-4))
undamped = st.just(0.0)
frequencies = _log(1e-3, 1e5)


def arms(*, damping=dampings, hub=inertias, mass=inertias, inertia=inertias):
    """Arms of every boundary case, steel to rubber."""
    return st.builds(
        arm_of,
        length=_log(0.1, 10),
        slenderness=_log(5, 500),
        width=_log(0.1, 10),
        density=_log(500, 1e4),
        E=_log(1e9, 3e11),
        nu=st.floats(0, 0.49),
        damping=damping,
        hub=hub,
        mass=mass,
        inertia=inertia,
    )
