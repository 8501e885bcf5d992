"""Lists against counts on random arms, every boundary condition among them."""

import math
from itertools import product

import numpy as np

import tfarm
from tests.spectrum.test_certify import random_arm
from tfarm import Arm, Hub, Payload
from tfarm.exact.system import system_of
from tfarm.spectrum import modes_below
from tfarm.spectrum.frequencies import Counter

ARMS = 81


def arms() -> list[Arm]:
    """Random ones, and each combination of zero, finite and infinite inertias on three of them."""
    generator = np.random.default_rng(2)
    bases = [random_arm(generator) for _ in range(ARMS)]
    kinds = list(product((0.0, 1.0, math.inf), repeat=3))
    for i, base in enumerate(bases):
        hub, mass, inertia = kinds[i % len(kinds)]
        beam = base.link.rhoA * base.link.length
        unit = beam * base.link.length**2
        bases[i] = Arm(
            link=base.link, hub=Hub(inertia=hub * unit), payload=Payload(mass=mass * beam, inertia=0.1 * inertia * unit)
        )
    return bases


def test_the_list_is_the_count_on_random_arms() -> None:
    """`python -m tests.spectrum.ritz 1000` for more, against a Ritz model and in balls too."""
    for arm in arms():
        modes = tfarm.modes(arm, 12)
        omega = modes.natural_frequency[-12:]
        assert (np.diff(omega) >= 0).all()
        count = Counter(system_of(arm))
        steps = np.r_[omega * (1 - 1e-11), omega * (1 + 1e-11)]
        below, above = np.split(count(steps) - arm.has_rigid_mode, 2)
        number = np.arange(1, 13)
        assert (below < number).all()
        assert (above >= number).all()
        assert modes_below(arm, float(omega[-1]) * (1 + 1e-11)) >= 12


def test_releasing_or_loading_an_end_never_raises_a_frequency() -> None:
    """Rayleigh: the frequencies of neighbouring arms interlace."""
    for arm in arms()[:60]:
        omega = tfarm.modes(Arm(link=arm.link, hub=Hub(inertia=math.inf), payload=arm.payload), 8).natural_frequency
        freed = tfarm.modes(arm, 8).natural_frequency
        assert (freed[: omega.size] <= omega * (1 + 1e-12)).all()
