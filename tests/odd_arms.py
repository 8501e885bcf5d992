"""Eight legal arms unlike the paper's: general claims are tested on these.

Materials and sizes are plausible; C gives 0.1 to 3 % of critical damping in the first mode.
"""

import math

from tfarm import Arm, Hub, Link, Payload, Section

STEEL = {"density": 7850.0, "youngs_modulus": 2.1e11, "poissons_ratio": 0.3}
ALUMINIUM = {"density": 2700.0, "youngs_modulus": 7.0e10, "poissons_ratio": 0.33}
RUBBER = {"density": 1100.0, "youngs_modulus": 1.0e7, "poissons_ratio": 0.49}
BOOM = Link(
    length=8.0, density=1600.0, youngs_modulus=1.2e11, shear_modulus=5.0e9, damping=4.0e-4,
    section=Section.tube(outer_diameter=0.12, inner_diameter=0.112, shear_factor=0.53),
)  # fmt: skip


def bar(material, length, width, depth, damping):
    """A rectangular link."""
    section = Section.rectangle(width=width, depth=depth)
    return Link.isotropic(length=length, section=section, damping=damping, **material)


PARTS = {  # link, hub inertia, payload
    "locked": (bar(STEEL, 0.5, 0.04, 0.005, 5.0e-5), math.inf, Payload()),
    "pinned": (bar(ALUMINIUM, 0.8, 0.05, 0.004, 5.0e-5), 0.02, Payload(mass=math.inf)),
    "free-pin": (bar(ALUMINIUM, 1.0, 0.06, 0.006, 1.0e-4), 0.0, Payload()),
    "rubber": (bar(RUBBER, 0.4, 0.04, 0.02, 1.0e-3), 0.005, Payload()),
    "boom": (BOOM, 40.0, Payload(mass=10.0, inertia=0.2)),
    "micro": (bar(STEEL, 0.05, 0.005, 0.0005, 1.0e-6), 1.0e-7, Payload()),
    "heavy-hub": (bar(ALUMINIUM, 1.0, 0.05, 0.005, 1.0e-4), 22.5, Payload()),
    "stubby": (bar(STEEL, 0.4, 0.05, 0.1, 1.0e-6), 0.5, Payload()),
}


def odd_arms():
    """The eight arms by name."""
    return {
        name: Arm(link=link, hub=Hub(inertia=inertia), payload=payload, name=name)
        for name, (link, inertia, payload) in PARTS.items()
    }
