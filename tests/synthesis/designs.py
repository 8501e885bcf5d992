"""Gains that leave least after a slew, against grids of 60 x 60:  python -m tests.synthesis.designs SIZE SEED

Plausible arms at random (5 cm to 10 m, five materials, a hub of a hundredth to a hundred times the beam, a payload or
none, little damping or none).  Three grids look for gains that leave less than what `design` found: even in K1 over
its box, logarithmic in K1 over its box, and one over a random part of it.  Reported: by how much the best stable point
of any grid beats the design, how often by more than 1 %, and the CPU seconds of each design.
"""

import sys
import time
from dataclasses import replace

import numpy as np

import tfarm
from tfarm import Arm, Hub, HubFeedback, Link, Payload, Section
from tfarm.arm import many_laws
from tfarm.loop.plane import gain_map
from tfarm.loop.residual import residual_moment
from tfarm.spectrum.scales import rate_unit
from tfarm.synthesis.design import best_gains

POINTS = 60  # of a grid, along each gain
ALLOWED = 1.01  # a grid may be better by this factor
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


def grids(rng, found):
    """K1 and K2 of three grids in the box of a design."""
    low, high = found.bounds["K1"]
    K2 = np.linspace(*found.bounds["K2"], POINTS + 2)[1:-1]
    least = 1e-7 * min(high, rate_unit(found.verdict.loop.arm))
    yield np.linspace(low, high, POINTS + 2)[1:-1], K2
    yield np.geomspace(least, high * (1 - 1e-9), POINTS), K2
    ends = np.exp(np.sort(rng.uniform(np.log(least), np.log(high), 2)))
    parts = np.sort(rng.uniform(*found.bounds["K2"], 2))
    yield np.linspace(*ends, POINTS), np.linspace(*parts, POINTS)


def least_on(arm, K1, K2):
    """The least residual [N m] of the stable points of a grid; inf where none is."""
    stable = gain_map(arm, K1, K2).stable
    a, b = np.meshgrid(K1, K2)
    return float(residual_moment(arm, many_laws(HubFeedback(), K1=a[stable], K2=b[stable]), 2).min(initial=np.inf))


def compared(arm, rng):
    """What the design leaves over what the best grid leaves, and the CPU seconds that the design took."""
    start = time.process_time()
    found = best_gains(arm, "residual", continuous=True)
    seconds = time.process_time() - start
    return found.value / min(least_on(arm, *grid) for grid in grids(rng, found)), seconds


def main(size: int, seed: int) -> int:
    """Print every arm that a grid serves better, and the summary; how many they are."""
    ratios, seconds = [], []
    for number in range(size):
        rng = np.random.default_rng([seed, number])
        arm = some_arm(rng)
        ratio, spent = compared(arm, rng)
        ratios.append(ratio)
        seconds.append(spent)
        if ratio > ALLOWED or spent > 10:
            print(f"{number}: {arm.name}: {ratio:.4g} times the best grid, {spent:.1f} s", flush=True)
    worse = sum(ratio > ALLOWED for ratio in ratios)
    print(f"{size} arms, seed {seed}: {worse} beaten by more than 1 %, the worst by a factor of {max(ratios):.4g};")
    print(f"the median design leaves {np.median(ratios):.3g} of the best grid; {max(seconds):.1f} CPU s at most")
    return worse


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])) > 0)
