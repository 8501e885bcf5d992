"""Plausible arms at random: 5 cm to 10 m, five materials, a hub of a hundredth to a hundred times the beam, a payload
or none, little damping or none."""

from dataclasses import replace

import numpy as np

import tfarm
from tfarm import Arm, Hub, Link, Payload, Section

MATERIALS = {  # density [kg/m^3], Young's modulus, shear modulus [Pa]
    "steel": (7850.0, 2.1e11, 8.1e10),
    "aluminium": (2700.0, 7.0e10, 2.6e10),
    "cfrp": (1600.0, 1.2e11, 5.0e9),
    "nylon": (1150.0, 2.5e9, 0.9e9),
    "rubber": (1100.0, 5.0e6, 1.7e6),
}


def log(rng, low, high):
    """A number whose logarithm is even between two others."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def some_arm(rng):
    """A plausible arm with a hub that can turn."""
    material = str(rng.choice(list(MATERIALS)))
    density, E, G = MATERIALS[material]
    length, slenderness = log(rng, 0.05, 10.0), log(rng, 5.0, 300.0)
    depth = length / slenderness
    section = Section.rectangle(width=depth * log(rng, 0.5, 20.0), depth=depth, shear_factor=5 / 6)
    link = Link(length=length, density=density, youngs_modulus=E, shear_modulus=G, section=section)
    beam = link.rhoA * length
    mass = 0.0 if rng.random() < 0.4 else beam * log(rng, 1e-2, 1e2)
    hub = beam * length**2 / 3 * log(rng, 1e-2, 1e2)
    arm = Arm(link=link, hub=Hub(inertia=hub), payload=Payload(mass=mass), name=f"{material}, {length:.2g} m")
    if rng.random() < 0.3:
        return arm
    first = float(tfarm.modes(arm, 1).natural_frequency[-1])
    return replace(arm, link=replace(link, damping=2 * log(rng, 1e-4, 2e-2) / first))
