"""Frequencies of a rig for the published tables: one function, so that every table asks the same solution.

They are tfarm's own, in the rig's own theory; the transition matrices and elements of the tests were compared with the
same tables.
"""

import math
from itertools import pairwise

import numpy as np

import tfarm
from tfarm import Arm, Hub, Link, Section

SLENDER = 1e4  # L/r of a unit beam: shear and rotary inertia move its first frequencies by some 1e-6 or less


def natural_frequencies(arm, count):
    """The first flexible frequencies [rad/s] of an undamped rig in its own theory."""
    return tfarm.modes(arm, count).natural_frequency[arm.has_rigid_mode :]


def unit_link(length=1.0, EI=1.0, rhoA=1.0):
    """A slender segment of this bending stiffness [N m^2] and mass per length [kg/m]."""
    section = Section.general(area=1.0, second_moment=SLENDER**-2, shear_factor=5 / 6)
    return Link.isotropic(
        length=length, density=rhoA, youngs_modulus=EI * SLENDER**2, poissons_ratio=0.3, section=section
    )


def stepped(steps, EI, rhoA, payload, length=1.0, hub=math.inf):
    """A beam of EI(x) and rhoA(x), 0 <= x <= 1, as so many uniform steps, each as the beam is in its middle."""
    middles = (np.arange(steps) + 0.5) / steps
    links = [unit_link(length / steps, float(EI(x)), float(rhoA(x))) for x in middles]
    return Arm(link=links[0], outer=tuple(links[1:]), hub=Hub(inertia=hub), payload=payload, theory="euler-bernoulli")


def without_steps(make, count, steps=(6, 12, 24)):
    """Frequencies of make(n) for n -> inf: the error goes with 1/n^2, 1/n^4, ... (Richardson and Gaunt 1927)."""
    rows = [natural_frequencies(make(n), count) for n in steps]
    power = 1
    while len(rows) > 1:
        rows = [(4**power * fine - coarse) / (4**power - 1) for coarse, fine in pairwise(rows)]
        power += 1
    return rows[0]
