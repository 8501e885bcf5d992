"""Plausible arms and loops, drawn as plain numbers: the TOML file that a user would write, and what a model needs.

Sections, shear factors (Cowper 1966) and inertias are computed here once more, so that the models of this folder take
nothing from tfarm.
"""

import math
import tomllib
from dataclasses import dataclass, replace

import numpy as np

from tests.models import Ritz

# density [kg/m^3], Young's modulus [Pa], Poisson's ratio; CFRP is not isotropic and has a shear modulus [Pa] instead
MATERIALS = {
    "steel": (7850.0, 2.1e11, 0.3),
    "aluminium": (2700.0, 7.0e10, 0.33),
    "titanium": (4430.0, 1.14e11, 0.34),
    "nylon": (1150.0, 2.5e9, 0.4),
    "rubber": (1100.0, 5.0e6, 0.49),
    "cfrp": (1600.0, 1.2e11, None),
}
CFRP_SHEAR = 5.0e9
CFRP_FACTOR = {"rectangle": 5 / 6, "round": 0.9, "tube": 0.53}


@dataclass(frozen=True)
class Link:
    """A beam by its stiffnesses and inertias per length, SI."""

    length: float
    EI: float
    kGA: float
    rhoA: float
    rhoI: float
    damping: float = 0.0


@dataclass(frozen=True)
class Body:
    """A hub (its inertia) or a payload."""

    inertia: float = 0.0
    mass: float = 0.0


@dataclass(frozen=True)
class Beam:
    """An arm as the models of this folder take it; the names are those of `tests.models.Ritz`."""

    link: Link
    hub: Body
    payload: Body
    has_rigid_mode = True

    @property
    def total_inertia(self):
        """J [kg m^2]."""
        link, tip = self.link, self.payload
        beam = link.rhoA * link.length**3 / 3 + link.rhoI * link.length
        return self.hub.inertia + beam + tip.mass * link.length**2 + tip.inertia

    def damped(self, C):
        """The same with another damping C [s]."""
        return replace(self, link=replace(self.link, damping=C))


@dataclass(frozen=True)
class Law:
    """The gains of u = -Kp theta - K1 theta_t - K2 M."""

    K1: float
    K2: float
    Kp: float = 0.0

    @property
    def options(self):
        """As the command line takes them."""
        return [f"--{name}={getattr(self, name)!r}" for name in ("K1", "K2", "Kp")]


@dataclass(frozen=True)
class Case:
    """One arm of the survey: its file, its model's numbers, and a law; `rng_seed` draws what a verb asks."""

    number: int
    rng_seed: int
    toml: str
    beam: Beam
    first: float  # rad/s, of the first flexible mode, undamped
    law: Law

    @property
    def arm(self):
        """The arm of that file."""
        from tfarm.arm.schema import arm_of_table

        return arm_of_table(tomllib.loads(self.toml))

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
    material = str(rng.choice(list(MATERIALS)))
    length, slenderness = log(rng, 0.05, 10.0), log(rng, 5.0, 300.0)
    shape, lines, area, second, factor = _section(rng, length / slenderness, slenderness, material)
    density, E, nu = MATERIALS[material]
    G = CFRP_SHEAR if nu is None else E / (2 * (1 + nu))
    beam_mass = density * area * length
    hub = beam_mass * length**2 / 3 * log(rng, 1e-2, 1e2)
    mass = 0.0 if rng.random() < 0.4 else beam_mass * log(rng, 1e-2, 1e2)
    inertia = 0.0 if rng.random() < 0.5 else mass * (length * rng.uniform(0.02, 0.2)) ** 2
    link = Link(length, E * second, factor * G * area, density * area, density * second)
    beam = Beam(link, Body(inertia=hub), Body(mass=mass, inertia=inertia))
    first = float(Ritz(beam, 24).natural_frequencies(1)[0])
    if rng.random() >= 0.3:
        beam = beam.damped(2 * log(rng, 1e-4, 2e-2) / first)
    stiff = f"shear_modulus = {G!r}" if nu is None else f"poissons_ratio = {nu!r}"
    text = [
        f'name = "plausible-{seed}-{number}"',
        "[link]", f"length = {length!r}", f"density = {density!r}", f"youngs_modulus = {E!r}", stiff,
        f"damping = {beam.link.damping!r}",
        "[link.section]", f'shape = "{shape}"', *lines,
        "[hub]", f"inertia = {hub!r}",
        "[payload]", f"mass = {mass!r}", f"inertia = {inertia!r}",
    ]  # fmt: skip
    law = _law(rng, beam, first)
    return Case(number, int(rng.integers(2**62)), "\n".join(text) + "\n", beam, first, law)


def _section(rng, depth, slenderness, material):
    """Shape, lines of TOML, area [m^2], second moment [m^4] and shear factor; `depth` [m] in the plane of bending."""
    shape, nu = str(rng.choice(["rectangle", "round", "tube"])), MATERIALS[material][2]
    if shape == "rectangle":
        width = min(depth * log(rng, 0.3, 30.0), depth * slenderness / 3)
        lines, area, second = [f"width = {width!r}", f"depth = {depth!r}"], width * depth, width * depth**3 / 12
        cowper = None if nu is None else 10 * (1 + nu) / (12 + 11 * nu)
    elif shape == "round":
        lines, area, second = [f"diameter = {depth!r}"], math.pi * depth**2 / 4, math.pi * depth**4 / 64
        cowper = None if nu is None else 6 * (1 + nu) / (7 + 6 * nu)
    else:
        inner = depth * float(rng.uniform(0.5, 0.95))
        lines = [f"outer_diameter = {depth!r}", f"inner_diameter = {inner!r}"]
        area, second = math.pi * (depth**2 - inner**2) / 4, math.pi * (depth**4 - inner**4) / 64
        m = (inner / depth) ** 2
        both = (7 + 6 * (nu or 0)) * (1 + m) ** 2
        cowper = None if nu is None else 6 * (1 + nu) * (1 + m) ** 2 / (both + (20 + 12 * nu) * m)
    if cowper is None:
        lines.append(f"shear_factor = {CFRP_FACTOR[shape]!r}")
    return shape, lines, area, second, CFRP_FACTOR[shape] if cowper is None else cowper


def _law(rng, beam, first):
    """K1 a few hundredths to three times J w1, one in ten negative; K2 in (-2, 1.5)."""
    J = beam.total_inertia
    K1 = J * first * log(rng, 0.02, 3.0) * (-1 if rng.random() < 0.1 else 1)
    K2 = float(rng.uniform(-2.0, 1.5))
    Kp = J * first**2 * log(rng, 1e-3, 1.0) if rng.random() < 0.3 else 0.0
    return Law(K1, K2, Kp)
