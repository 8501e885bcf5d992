"""A search for the best gains K1 and K2 that begins at the region of the requirements in the map of both."""

from collections.abc import Sequence

import numpy as np

from tfarm.arm import TWO_GAINS
from tfarm.errors import ConvergenceError
from tfarm.synthesis.good_region import map_region
from tfarm.synthesis.required import RequiredLaw, RequirementTask
from tfarm.synthesis.search import Search, Worst
from tfarm.synthesis.worst_case import Effort, NamedArm


def find_near_map(
    task: RequirementTask, named: Sequence[NamedArm], before: RequiredLaw | None, effort: Effort
) -> RequiredLaw:
    """Return the law of a search that begins at the region of the requirements in the map of both gains.

    That region may be a sliver, between whose points a search finds none.
    """
    form = task.form
    is_free = form.name == TWO_GAINS and not form.given and not any(form.fixed.values())
    region = None
    if is_free and before is None and effort == "whole":
        region = map_region(named[0].arm, task.chain, task.requirements)
    if region is None:
        return task.find(named, before, effort)
    law = region.start
    x = np.clip(form.at([*law.point]), *form.box)
    search_at = Search(form, [], 1, 1, ())
    start = RequiredLaw(Worst(()), search_at, np.inf, x, law, task.goal, ())
    found: RequiredLaw | None = None
    failure = ConvergenceError("", None, None)
    try:
        found = task.find(named, start, effort)
    except ConvergenceError as error:
        failure = error
    if found is None or found.violation > 0:
        judges = tuple(task.judge(each.arm, task.goal, 0) for each in named)
        chosen = task.examine(named, judges, search_at, x, task.goal)
        if chosen.violation < (np.inf if found is None else found.violation):
            found = chosen
    if found is None:
        raise failure
    return found
