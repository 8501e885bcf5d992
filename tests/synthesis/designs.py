"""A survey of designs:  python -m tests.synthesis.designs SIZE SEED

The law recommended for a plausible arm (`tests.plausible.arms`), and the same a quarter larger and smaller, has to hold
by a Galerkin model of 20 terms under a hold, which has no modes and no residues.
"""

from dataclasses import replace

import tfarm
from tests.plausible.arms import draw, log
from tests.survey import Finding, main, numbered
from tests.synthesis.held_loop import HeldLoop
from tfarm import ConvergenceError
from tfarm.arm.chain import Sampling
from tfarm.dsp import Chain
from tfarm.synthesis.design import design
from tfarm.synthesis.judge import RESERVE
from tfarm.synthesis.structures import STRUCTURES

EDGE = 1e-6  # the Ritz model's radius is right to that, and on the edge of the reserve it is 1


def excess(rng, structures=tuple(STRUCTURES)):
    """By how much the largest radius, with the reserve and without, is above 1 on another model; what was designed."""
    arm = draw(int(rng.integers(1_000_000)), 0).arm
    first = float(tfarm.modes(arm, 1).natural_frequency[-1])
    # in whose period the first mode turns by 0.2 to 2 rad
    chain = Chain(sampling=Sampling(period=1 / (first * rng.uniform(0.5, 5.0))))
    if not arm.damping:
        arm = replace(arm, link=replace(arm.link, damping=2 * log(rng, 1e-3, 2e-2) / first))
    structure = str(rng.choice(structures))
    law = design(arm, "damping", structure=structure, chain=chain, modes=1).law
    other = HeldLoop(arm, chain.sampling.period, 20)
    radii = [other.radius(law.times(share)) for share in (1 / RESERVE, 1.0, RESERVE)]
    return max(radii[0], radii[2]) - 1 - EDGE, radii[1] - 1, f"{arm.name}, {structure}"


@numbered
def held(rng):
    """Whether what is recommended holds on another model."""
    try:
        over, own, name = excess(rng)
    except ConvergenceError as error:
        return Finding("refused", str(error)[:120])
    is_wrong = over > 0 or own >= 0
    words = f"{name}: {own:+.3g}, with the reserve {over:+.3g}" if is_wrong else ""
    return Finding("does not hold" if is_wrong else "holds", words, is_wrong)


if __name__ == "__main__":
    main(held, size=20)
