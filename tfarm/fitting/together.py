"""One fit of several arms: numbers that they share, and each arm's own, from runs of each.

The key of a number that is not shared ends with the name of its arm: "link.youngs_modulus:ruler-200".  Three links on
one hub share its inertia and its drive, which one link alone does not determine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tfarm.arm import Arm, must_be_arm
from tfarm.arm.chain import Chain
from tfarm.errors import must_be_known, require
from tfarm.fitting.fit import Fit, fit_of, renamed
from tfarm.fitting.model import Problem, free_parameters, is_of_chain
from tfarm.fitting.run_model import fit_run
from tfarm.fitting.run_numbers import with_run_numbers
from tfarm.fitting.runs import DRIVE_GAIN, RigRun, commanded
from tfarm.stopping import Progress


def fit_together(
    arms: Sequence[Arm],
    free: Sequence[str],
    *,
    runs: Sequence[Sequence[RigRun]],
    shared: Sequence[str],
    chain: Chain | None = None,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    profile: bool = True,
    progress: Progress | None = None,
) -> Fit:
    """Return the arms whose free numbers explain their runs best, those that are `shared` being one number.

    `free` are keys as of `fit`, free in every arm; `runs` are those of each arm.  `start`, `bounds` and `priors` are by
    key, of all arms or with the name of one: "link.length:ruler-200".  Of the result `arms` are all arms.
    Raises ParameterError as `fit` does, for arms of one name, and for a shared number that is not free.
    """
    require(len(runs) == len(arms) > 1, "runs", len(runs), f"of each of two arms or more: {len(arms)} given")
    for each in arms:
        must_be_arm(each)
    names = [each.name for each in arms]
    remedy = "arms of one fit have names of their own; change one in its file"
    require(len(set(names)) == len(names), "name", ", ".join(names), remedy)
    require(not any(":" in name for name in names), "name", ", ".join(names), "without a colon, in one fit")
    for key in shared:
        must_be_known("shared", key, free)
    known = [*free, *(f"{key}:{name}" for key in free for name in names)]
    for some in (start, bounds, priors):
        for key in some or {}:
            must_be_known("start, bounds or prior", key, known)
    pairs = [*zip(arms, runs, strict=True)]
    if DRIVE_GAIN in free:
        pairs = [commanded(arm, own) for arm, own in pairs]
    given = [renamed(each) for each in (start, bounds, priors)]
    subject = _problem(
        pairs, [*renamed(dict.fromkeys(free))], [*renamed(dict.fromkeys(shared))], given, chain
    )
    size = subject.residuals(np.zeros(len(subject.parameters))).size
    remedy = f"{size} numbers were measured; leave some out"
    require(size >= len(subject.parameters), "free", len(subject.parameters), remedy)
    return fit_of(subject, profile, progress)


def _problem(
    pairs: Sequence[tuple[Arm, Sequence[RigRun]]],
    free: Sequence[str],
    shared: Sequence[str],
    given: Sequence[Mapping[str, Any]],
    chain: Chain | None,
) -> Problem:
    """Return the search: shared numbers and those of the first arm, those of the others, then those of the runs."""
    keys = [key for key in free if not is_of_chain(key)]
    families = []
    numbers = []
    of_runs = []
    for number, (arm, runs) in enumerate(pairs):
        at, ends, before = (_of_arm(each, keys, arm.name) for each in given)
        family, own = free_parameters(arm, keys, start=at, bounds=ends, priors=before)
        families.append(family)
        of_runs += [replace(fit_run(arm, each, chain or Chain()), arm=number) for each in runs]
        for each in own:
            if each.key not in shared:
                numbers.append(replace(each, key=f"{each.key}:{arm.name}"))
            elif number == 0:
                numbers.append(each)
    require(numbers, "free", "nothing", "name what is free of the arms, such as link.youngs_modulus")
    first, *others = families
    whole = Problem(first, tuple(numbers), (), (), tuple(of_runs), tuple(others))
    start, bounds, priors = given
    return with_run_numbers(whole, free, start, bounds, priors, shared)


def _of_arm(given: Mapping[str, Any], keys: Sequence[str], name: str) -> dict[str, Any]:
    """Return what is given of these keys for the arm of a name, or for all."""
    whole = {key: given.get(f"{key}:{name}", given.get(key)) for key in keys}
    return {key: value for key, value in whole.items() if value is not None}
