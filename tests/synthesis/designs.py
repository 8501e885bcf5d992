"""Surveys of designs:  python -m tests.synthesis.designs SIZE SEED [optima or held]

Presets and plausible arms (`tests.plausible.arms`).  `optima`: SciPy's differential evolution, of at least 5,000 laws,
minimises the same score within the bounds that a design prints; wrong where it finds a law that holds and is better by
more than half a per cent.  The cases take turns, so that every structure, objective, and kind of design comes up.
`held`: the law recommended, and the same a quarter larger and smaller, has to hold by a Galerkin model of 20 terms
under a hold, which has no modes and no residues.
"""

import time
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.optimize import differential_evolution

import tfarm
from tests.plausible.arms import draw, log
from tests.survey import Finding, main, numbered
from tests.synthesis.held_loop import HeldLoop
from tfarm import ConvergenceError, ParameterError
from tfarm.arm import as_law
from tfarm.arm.chain import Sampling
from tfarm.dsp import Chain
from tfarm.synthesis import design as room
from tfarm.synthesis.judge import LOST, OBJECTIVES, RESERVE
from tfarm.synthesis.structures import STRUCTURES

ALLOWED = 5e-3  # relative: by so much a law may be better
LAWS = 5000  # that differential evolution scores, at least
EDGE = 1e-6  # the Ritz model's radius is right to that, and on the edge of the reserve it is 1
CASES = [
    (structure, objective, kind)
    for kind, objective, structure in product(("sampled", "continuous", "range", "also"), OBJECTIVES, STRUCTURES)
    if not (kind == "continuous" and objective == "cost")
]
PRESETS = [name for name in tfarm.presets() if not tfarm.load(name).has_massless_hub]


def some_arm(rng):
    """A plausible arm."""
    return draw(int(rng.integers(1_000_000)), 0).arm


def sampled_often_enough(arm, rng):
    """A chain in whose period the arm's first mode turns by 0.2 to 2 rad; the first frequency."""
    first = float(tfarm.modes(arm, 1).natural_frequency[-1])
    return Chain(sampling=Sampling(period=1 / (first * rng.uniform(0.5, 5.0)))), first


def designed(arm, chain, structure, objective, kind, rng):
    """The design, and the judges and the structure with its bounds that it was searched with at last."""
    last, search = [], room.search

    def kept(worst, form, *options):
        found = search(worst, form, *options)
        last[:] = worst, found.form
        return found

    mass = arm.payload.mass + 0.1 * arm.link.rhoA * arm.link.length
    more = {
        "continuous": {"continuous": True},
        "range": {"ranges": {"payload.mass": (mass, 2 * mass)}},
        "also": {"also": [arm.having(payload_mass=mass * log(rng, 1.0, 3.0))]},
    }
    room.search = kept
    try:
        found = room.design(arm, objective, structure=structure, chain=chain, **more.get(kind, {}))
    finally:
        room.search = search
    return found, *last


def optima(size, seed):
    """Designs compared with differential evolution on their own score."""
    for number in range(size):
        rng = np.random.default_rng([seed, number])
        structure, objective, kind = CASES[(number * 37 + seed) % len(CASES)]
        if rng.random() < 0.4:
            name = str(rng.choice(PRESETS))
            arm, chain = tfarm.load(name), tfarm.dsp.load_chain(name)
        else:
            arm = some_arm(rng)
            chain, _ = sampled_often_enough(arm, rng)
        case, start = f"{number}: {arm.name}, {structure}, {objective}, {kind}", time.process_time()
        try:
            found, worst, form = designed(arm, chain, structure, objective, kind, rng)
        except (ConvergenceError, ParameterError) as error:
            yield Finding("refused", f"{case}: {str(error)[:90]}")
            continue
        seconds = time.process_time() - start
        x = np.clip(form.at([found.coefficients[each] for each in form.names]), *form.box)
        own, other, by = float(worst.scores(form, x[:, None])[0]), *by_evolution(worst, form, number)
        better = (own - other) / max(abs(own), 1e-12)
        is_beaten = better > ALLOWED and other < LOST and all(judge.holds(by) for judge in worst.judges)
        words = f"{case}: {own:.6g}, by evolution {other:.6g}, {found.agreed} of {found.starts}, {seconds:.1f} s"
        outcome = "beaten" if is_beaten else "not beaten"
        yield Finding(outcome, words, is_beaten, {"CPU s": seconds, "better by": better if is_beaten else 0.0})


def by_evolution(worst, form, seed):
    """The best score that differential evolution finds in the bounds of the structure, and its law."""
    done = differential_evolution(
        lambda points: worst.scores(form, points if points.ndim == 2 else points[:, None]),
        list(zip(*form.box, strict=True)), popsize=15, maxiter=LAWS // (15 * form.size) + 1, tol=0.0, seed=seed,
        polish=False, vectorized=True, updating="deferred",
    )  # fmt: skip
    return float(done.fun), form.record_at(done.x)


def excess(rng, structures=tuple(STRUCTURES)):
    """By how much the largest radius, with the reserve and without, is above 1 on another model; what was designed."""
    arm = some_arm(rng)
    chain, first = sampled_often_enough(arm, rng)
    if not arm.damping:
        arm = replace(arm, link=replace(arm.link, damping=2 * log(rng, 1e-3, 2e-2) / first))
    structure = str(rng.choice(structures))
    law = as_law(room.design(arm, structure=structure, chain=chain, modes=1).law)
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
    main(optima, held, size=20)
