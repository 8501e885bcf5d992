"""The response with rigid links against that of ever stiffer ones:  python -m tests.response.rigid SIZE SEED

Random rigs with links 1e6, 1e8 and 1e10 times as stiff, each output at one frequency and place.  Where these converge,
each step a hundredth of the one before, the rigid response is to be within two steps more of the last (and 1e-9 of it).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

import tfarm
from tests import survey
from tests.chain_elements import reached
from tests.rigs import some_rig
from tests.survey import Finding, numbered
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.rigid import rigid_response

STIFFER = (1e6, 1e8, 1e10)
NEXT = 0.02  # of the last step: the next ones
ROUNDING = 1e-9  # of an output: of the stiffest links, whose waves are slow


@dataclass(frozen=True)
class Case:
    """A rig at one frequency: of each output that has a limit the distance to it, over what it may be."""

    arm: object
    omega: float
    x: float
    departures: dict

    @property
    def wrong(self):
        """The outputs that are not the limit."""
        return {name: value for name, value in self.departures.items() if not value <= 1.0}


def case_of(rng):
    """A rig, and its responses at one frequency and place."""
    arm = some_rig(rng)
    omega, x = reached(arm, 10 ** rng.uniform(-3, 0.5)), float(rng.uniform(0, arm.length))
    return Case(arm, omega, x, {} if contradicts(arm) else departures(arm, omega, x))


def departures(arm, omega, x):
    """|rigid - limit| of each output, over what the limit is known to."""
    found, s = {}, np.array([1j * omega])
    for each in OUTPUTS.values():
        if each.quantity == "strain" or (each.quantity == "current" and (arm.motor is None or arm.is_locked)):
            continue
        at = x if each.place == "x" else None
        rigid = rigid_response(arm, each, s, 0.0 if at is None else at / arm.length)[0]
        values = [tfarm.transfer(stiffened(arm, factor), each, x=at)(s)[0] for factor in STIFFER]
        size, (first, last) = abs(values[-1]), abs(np.diff(values))
        if last <= NEXT * first + ROUNDING * size:
            found[each.name] = abs(rigid - values[-1]) / (NEXT * last + ROUNDING * abs(rigid) + 1e-300)
    return found


def contradicts(arm):
    """Whether an infinite payload and the hub hold the rigid link in two ways, so that it has no response."""
    infinite = math.isinf(arm.payload.mass), math.isinf(arm.payload.inertia)
    return all(infinite) or (any(infinite) and arm.is_locked and arm.clamp.is_rigid and arm.joint.is_rigid)


def stiffened(arm, factor):
    """The arm with E and G of each link so many times as large."""
    first, *outer = (
        replace(link, youngs_modulus=factor * link.youngs_modulus, shear_modulus=factor * link.shear_modulus)
        for link in arm.links
    )
    return replace(arm, link=first, outer=tuple(outer))


def rigs(rng):
    """The finding on one rig."""
    case = case_of(rng)
    words = f"{case.wrong} at {case.omega!r} rad/s, x = {case.x!r} m\n    {case.arm}" if case.wrong else ""
    outcome = "wrong" if words else "right" if case.departures else "held twice over"
    return Finding(outcome, words, bool(words), {"responses": len(case.departures)})


if __name__ == "__main__":
    survey.main(numbered(rigs), seed=0)
