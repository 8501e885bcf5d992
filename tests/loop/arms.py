"""Loops drawn at random, and the arms that the tests of the loop name."""

import math

import tfarm
from tests.strategies import some_arm
from tfarm import Arm, Hub, HubFeedback, Link, Section
from tfarm.case import Case
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.stability import stability


def loop_of(arm, law) -> ContinuousLoop:
    """The continuous-time loop of an arm under a law."""
    return ContinuousLoop(Case(arm, law))


def verdict_of(arm, law, band=None):
    """The verdict on it."""
    return stability(Case(arm, law), band)


def window_arm() -> Arm:
    """A deep damped arm that is unstable for K2 in about (-11.47, -8.48) at K1 = 1, stable on either side."""
    section = Section.general(area=0.02, second_moment=0.1 * 0.2**3 / 12, shear_factor=5 / 6)
    link = Link(
        length=1.0, density=7800.0, youngs_modulus=2.1e11, shear_modulus=8e10, section=section, damping=2e-6
    )  # fmt: skip
    return Arm(link=link, hub=Hub(inertia=1.0))


def held(C=1e-4) -> Arm:
    """The lab arm with its tip pinned: no rigid-body mode, a static stiffness."""
    return tfarm.load("sasaki2012-lab").with_numbers(damping=C, payload_mass=math.inf)


def held_stiffness(arm) -> float:
    """Moment at the root over its rotation [N m/rad] where the tip is pinned: bending and shear, by unit loads."""
    link = arm.link
    return 1 / (link.length / (3 * link.EI) + 1 / (link.kGA * link.length))


def hub_units(arm: Arm) -> tuple[float, float]:
    """An inertia [kg m^2] and a frequency [rad/s] in which gains are neither small nor large."""
    omega = tfarm.modes(arm, 1).natural_frequency[-1]
    inertia = arm.hub.inertia or arm.link.rhoA * arm.link.length**3 / 3
    return inertia, float(omega)


def some_loop(rng, *, damping=None, slenderness=(5, 100)) -> tuple[Arm, HubFeedback]:
    """A free hub and gains of any sign; a seventh of the loops without K1, two thirds without Kp."""
    case = [rng.choice(["zero", "some", "infinite"], p=p) for p in ((0.1, 0.9, 0), (0.3, 0.5, 0.2), (0.4, 0.4, 0.2))]
    arm = some_arm(rng, case, damping=0.0, slenderness=slenderness)
    inertia, omega = hub_units(arm)
    if damping is None and rng.random() < 0.5:
        arm = arm.with_numbers(damping=float(10 ** rng.uniform(-4, -0.7)) / omega)
    K1 = rng.choice([0.0, 1.0, -1.0], p=(0.15, 0.65, 0.2)) * inertia * omega * 10 ** rng.uniform(-3, 1)
    K2 = rng.choice([rng.uniform(-1, 1.5), -(10 ** rng.uniform(0, 1.5)), 0.0], p=(0.6, 0.3, 0.1))
    Kp = rng.choice([0.0, 1.0, -1.0], p=(0.66, 0.24, 0.1)) * inertia * omega**2 * 10 ** rng.uniform(-3, 0)
    return arm, HubFeedback(K1=float(K1), K2=float(K2) if arm.hub.inertia else 0.0, Kp=float(Kp))
