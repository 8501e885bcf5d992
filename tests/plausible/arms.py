"""Plausible arms and loops, drawn at random: steel to rubber, 5 cm to 10 m, rectangles, rods and tubes."""

import math
from dataclasses import dataclass, replace

import numpy as np

from tests.models import Ritz
from tfarm import Arm, Hub, HubFeedback, Link, Payload, Section
from tfarm.arm import to_toml

MATERIALS = {  # density [kg/m^3], Young's modulus [Pa], Poisson's ratio
    "steel": (7850.0, 2.1e11, 0.3),
    "aluminium": (2700.0, 7.0e10, 0.33),
    "titanium": (4430.0, 1.14e11, 0.34),
    "nylon": (1150.0, 2.5e9, 0.4),
    "rubber": (1100.0, 5.0e6, 0.49),
}


@dataclass(frozen=True)
class PlausibleLoop:
    """One arm of the survey, its first undamped flexible frequency [rad/s], and a law; `rng` draws what a verb asks."""

    arm: Arm
    first: float
    law: HubFeedback
    rng_seed: int

    @property
    def toml(self):
        """The arm's file."""
        return to_toml(self.arm)

    @property
    def rng(self):
        """A fresh generator, the same each time."""
        return np.random.default_rng(self.rng_seed)


def log(rng, low, high):
    """A number whose logarithm is even from low to high."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def draw(number, seed):
    """The arm of that number in the survey of that seed."""
    rng = np.random.default_rng([seed, number])
    density, E, nu = MATERIALS[str(rng.choice(list(MATERIALS)))]
    length, slenderness = log(rng, 0.05, 10.0), log(rng, 5.0, 300.0)
    section = _section(rng, length / slenderness, slenderness)
    link = Link.isotropic(length=length, density=density, youngs_modulus=E, poissons_ratio=nu, section=section)
    beam = link.rhoA * length
    mass = 0.0 if rng.random() < 0.4 else beam * log(rng, 1e-2, 1e2)
    inertia = 0.0 if rng.random() < 0.5 else mass * (length * float(rng.uniform(0.02, 0.2))) ** 2
    hub, payload = Hub(inertia=beam * length**2 / 3 * log(rng, 1e-2, 1e2)), Payload(mass=mass, inertia=inertia)
    arm = Arm(name=f"plausible-{seed}-{number}", link=link, hub=hub, payload=payload)
    first = float(Ritz(arm, 24).natural_frequencies(1)[0])
    if rng.random() >= 0.3:
        arm = replace(arm, link=replace(link, damping=2 * log(rng, 1e-4, 2e-2) / first))
    return PlausibleLoop(arm, first, _law(rng, arm, first), int(rng.integers(2**62)))


def _section(rng, depth, slenderness):
    """A rectangle, rod or tube of that depth [m] in the plane of bending."""
    shape = rng.integers(3)
    if shape == 0:
        return Section.rectangle(width=min(depth * log(rng, 0.3, 30.0), depth * slenderness / 3), depth=depth)
    if shape == 1:
        return Section.round(diameter=depth)
    return Section.tube(outer_diameter=depth, inner_diameter=depth * float(rng.uniform(0.5, 0.95)))


def _law(rng, arm, first):
    """K1 a few hundredths to three times J w1, one in ten negative; K2 in (-2, 1.5)."""
    J = arm.total_inertia
    K1 = J * first * log(rng, 0.02, 3.0) * (-1 if rng.random() < 0.1 else 1)
    K2 = float(rng.uniform(-2.0, 1.5))
    return HubFeedback(K1=K1, K2=K2, Kp=J * first**2 * log(rng, 1e-3, 1.0) if rng.random() < 0.3 else 0.0)
