"""Designs against an independent global search:  python -m tests.synthesis.optima SIZE SEED [FIRST]

Presets and plausible arms at random (see `arms`); the cases take turns, so that every structure, objective, and kind of
design comes up: for the sampled loop, for the continuous one, with a range of the payload, and for another arm too.
SciPy's differential evolution, of at least 5,000 laws, minimises the same score within the bounds that the design
prints.  Reported: how often it finds a law that holds and is better, by more than half a per cent, and the seconds.
"""

import sys
import time
from itertools import product

import numpy as np
from scipy.optimize import differential_evolution

import tfarm
from tests.synthesis.arms import log, some_arm
from tfarm import ConvergenceError, ParameterError
from tfarm.dsp import Chain
from tfarm.dsp.chain import Sampling
from tfarm.synthesis import design as room
from tfarm.synthesis.minimax import LOST
from tfarm.synthesis.objectives import OBJECTIVES
from tfarm.synthesis.structures import STRUCTURES

ALLOWED = 5e-3  # relative: by so much a law may be better
LAWS = 5000  # that differential evolution scores, at least
KINDS = ("sampled", "sampled", "continuous", "range", "also")
CASES = [
    (structure, objective, kind)
    for kind, objective, structure in product(dict.fromkeys(KINDS), OBJECTIVES, STRUCTURES)
    if not (kind == "continuous" and objective == "cost")
]
PRESETS = [name for name in tfarm.presets() if not tfarm.load(name).has_massless_hub]


def arm_and_chain(rng):
    """A preset with its chain, or an arm at random whose first mode turns by 0.2 to 2 rad in a sample."""
    if rng.random() < 0.4:
        name = str(rng.choice(PRESETS))
        return tfarm.load(name), tfarm.dsp.load_chain(name)
    arm = some_arm(rng)
    first = float(tfarm.modes(arm, 1).natural_frequency[-1])
    return arm, Chain(sampling=Sampling(period=1 / (first * rng.uniform(0.5, 5.0))))


def designed(arm, chain, structure, objective, kind, rng):
    """The design, and the judges and the structure with its bounds that it was searched with at last."""
    last, search = [], room.search

    def kept(worst, form, tell):
        found = search(worst, form, tell)
        last[:] = worst, found.form
        return found

    more = {"continuous": {"continuous": True}}
    mass = arm.payload.mass + 0.1 * arm.link.rhoA * arm.link.length
    more["range"] = {"ranges": {"payload.mass": (mass, 2 * mass)}}
    more["also"] = {"also": [arm.having(payload_mass=mass * log(rng, 1.0, 3.0))]}
    room.search = kept
    try:
        found = room.design(arm, objective, structure=structure, chain=chain, **more.get(kind, {}))
    finally:
        room.search = search
    return found, *last


def compared(number, seed):
    """A line on one case; by how much of its score differential evolution beats the design; the design's seconds."""
    rng = np.random.default_rng([seed, number])
    structure, objective, kind = CASES[(number * 37 + seed) % len(CASES)]
    arm, chain = arm_and_chain(rng)
    name = f"{number}: {arm.name}, {structure}, {objective}, {kind}"
    start = time.process_time()
    try:
        found, worst, form = designed(arm, chain, structure, objective, kind, rng)
    except (ConvergenceError, ParameterError) as error:
        return f"{name}: refused: {str(error)[:90]}", None, time.process_time() - start
    seconds = time.process_time() - start
    x = np.clip(form.at([found.coefficients[each] for each in form.names]), *form.box)
    own = float(worst.scores(form, x[:, None])[0])
    size = 15 * form.size
    done = differential_evolution(
        lambda points: worst.scores(form, points if points.ndim == 2 else points[:, None]),
        list(zip(*form.box, strict=True)), popsize=15, maxiter=LAWS // size + 1, tol=0.0, seed=number, polish=False,
        vectorized=True, updating="deferred",
    )  # fmt: skip
    better = (own - float(done.fun)) / max(abs(own), 1e-12)
    law = form.record_at(done.x)
    holds = done.fun < LOST and (better <= ALLOWED or all(judge.holds(law) for judge in worst.judges))
    beaten = better if holds else 0.0
    line = f"{name}: {own:.6g}, by evolution {done.fun:.6g}{'' if holds else ' (does not hold)'}, {found.agreed} of "
    return f"{line}{found.starts} agree, {seconds:.1f} s", beaten, seconds


def main(size: int, seed: int, first: int = 0) -> int:
    """Print every case and the summary; how many designs are beaten."""
    beaten, seconds, refused = [], [], 0
    for number in range(first, first + size):
        line, by, spent = compared(number, seed)
        seconds.append(spent)
        refused += by is None
        beaten += [] if by is None else [by]
        print(f"{line}{' BEATEN' if by is not None and by > ALLOWED else ''}", flush=True)
    lost = sum(by > ALLOWED for by in beaten)
    print(f"{size} designs, seed {seed}: {lost} beaten by more than 0.5 %, at most by {max(beaten, default=0.0):.3g};")
    print(f"{refused} refused; {np.median(seconds):.1f} CPU s in the median, {max(seconds):.1f} at most")
    return lost


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
