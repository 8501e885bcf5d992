"""Eight legal arms unlike the paper's, as TOML text: what is said of every arm is tried on these.

Materials and sizes are plausible; C gives 0.1 to 3 % of critical damping in the first mode.
"""

from __future__ import annotations

import tomllib

from tfarm.arm import Arm
from tfarm.arm.schema import arm_of_table

LOCKED = """
name = "locked"
[link]
length = 0.5
density = 7850.0
youngs_modulus = 2.1e11
poissons_ratio = 0.3
damping = 5.0e-5
[link.section]
shape = "rectangle"
width = 0.04
depth = 0.005
[hub]
inertia = inf
"""

PINNED = """
name = "pinned"
[link]
length = 0.8
density = 2700.0
youngs_modulus = 7.0e10
poissons_ratio = 0.33
damping = 5.0e-5
[link.section]
shape = "rectangle"
width = 0.05
depth = 0.004
[hub]
inertia = 0.02
[payload]
mass = inf
"""

FREE_PIN = """
name = "free-pin"
[link]
length = 1.0
density = 2700.0
youngs_modulus = 7.0e10
poissons_ratio = 0.33
damping = 1.0e-4
[link.section]
shape = "rectangle"
width = 0.06
depth = 0.006
[hub]
inertia = 0.0
"""

RUBBER = """
name = "rubber"
[link]
length = 0.4
density = 1100.0
youngs_modulus = 1.0e7
poissons_ratio = 0.49
damping = 1.0e-3
[link.section]
shape = "rectangle"
width = 0.04
depth = 0.02
[hub]
inertia = 0.005
"""

BOOM = """
name = "boom"
[link]
length = 8.0
density = 1600.0
youngs_modulus = 1.2e11
shear_modulus = 5.0e9
damping = 4.0e-4
[link.section]
shape = "tube"
outer_diameter = 0.12
inner_diameter = 0.112
shear_factor = 0.53
[hub]
inertia = 40.0
[payload]
mass = 10.0
inertia = 0.2
"""

MICRO = """
name = "micro"
[link]
length = 0.05
density = 7850.0
youngs_modulus = 2.1e11
poissons_ratio = 0.3
damping = 1.0e-6
[link.section]
shape = "rectangle"
width = 0.005
depth = 0.0005
[hub]
inertia = 1.0e-7
"""

HEAVY_HUB = """
name = "heavy-hub"
[link]
length = 1.0
density = 2700.0
youngs_modulus = 7.0e10
poissons_ratio = 0.33
damping = 1.0e-4
[link.section]
shape = "rectangle"
width = 0.05
depth = 0.005
[hub]
inertia = 22.5
"""

STUBBY = """
name = "stubby"
[link]
length = 0.4
density = 7850.0
youngs_modulus = 2.1e11
poissons_ratio = 0.3
damping = 1.0e-6
[link.section]
shape = "rectangle"
width = 0.05
depth = 0.1
[hub]
inertia = 0.5
"""

TEXTS = {
    "locked": LOCKED,
    "pinned": PINNED,
    "free-pin": FREE_PIN,
    "rubber": RUBBER,
    "boom": BOOM,
    "micro": MICRO,
    "heavy-hub": HEAVY_HUB,
    "stubby": STUBBY,
}


def odd_arms() -> dict[str, Arm]:
    """The eight arms by name."""
    return {name: arm_of_table(tomllib.loads(text)) for name, text in TEXTS.items()}
