"""Learning curves of the gain tuner: the study of a plan over its seed (the paper's Figure 5)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.arm.checks import whole
from tfarm.dsp import Chain
from tfarm.tuner import LearningCurves
from tfarm.tuner import Plan as TunerPlan

from .quantities import TRIAL_COST
from .running import Plan, Progress, results
from .space import Space

MOST_SEEDS = 10_000
THREADS = 2  # compiled loops let other threads run; a report uses no more cores
FINAL, ZERO, STOPPED = "tuner.cost", "tuner.is_zero", "tuner.stopped"


def learning_curves(
    arm: Arm, plan: TunerPlan, chain: Chain, seeds: int, progress: Progress | None = None
) -> LearningCurves:
    """Return the learning curves of a plan from a number of seeds, its own and those that follow.

    `progress` gets (done, total, text).  Raises ParameterError for a number of seeds out of range.
    """
    seeds = whole("seeds", seeds, 1, MOST_SEEDS, f"a whole number of seeds from 1 to {MOST_SEEDS}")
    costs = [f"{TRIAL_COST}.{n}" for n in range(1, plan.trials + 1)]
    space = Space(distributions={}, grids={"tuner.seed": tuple(range(plan.seed, plan.seed + seeds))})
    own, tables = Plan(arm, HubFeedback(), chain, space, (FINAL, ZERO, STOPPED, *costs), plan), []
    with ThreadPoolExecutor(THREADS) as pool:
        for table in pool.map(lambda n: results(own, n, n + 1), range(seeds)):
            tables.append({name: np.inf if value is None else value for name, (value,) in table.items()})
            if progress is not None:
                progress(len(tables), seeds, "learning curves")
    return LearningCurves(
        costs=np.array([[each[name] for name in costs] for each in tables]),
        final=np.array([each[FINAL] for each in tables]),
        diverged=sum(each[STOPPED] != np.inf for each in tables),
        died=sum(map(bool, (each[ZERO] for each in tables))),
    )
