"""The worst arm of a study in one quantity: of those drawn, and of a search from there."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

# whose statistics take half a second to load
import scipy

from tfarm.arm.chain import file_text
from tfarm.arm.writing import law_toml
from tfarm.arrays import Real
from tfarm.errors import ParameterError, require
from tfarm.files import write_file
from tfarm.schema import Quantity
from tfarm.studies.quantities import STABLE
from tfarm.studies.running import (
    OUT,
    Resources,
    Row,
    StudyFolder,
    rows_of,
    search_rows,
)


class WorstArm(NamedTuple):
    """The worst arm of a study in one quantity: that drawn, and that of a search from there within the ranges."""

    quantity: Annotated[str, Quantity("quantity", help="column of the table")]
    row: Annotated[int, Quantity("worst drawn, row", help="number of its row")]
    drawn: Annotated[float | None, Quantity("value there", "", 6, "none where its loop is not stable")]
    found: Annotated[
        float | None, Quantity("value of the search", "", 6, "none where its loop is not stable")
    ]
    evaluations: Annotated[
        int, Quantity("evaluations of the search", help="arms computed; 0 without independent ranges")
    ]
    numbers: Annotated[dict[str, float], Quantity(help="varied numbers of that arm")]
    file: Annotated[str, Quantity("arm file", help="file of that arm, with its chain")]


def badness(order: Sequence[str], values: Mapping[str, Any]) -> float:
    """Return the place of an arm in the order, worse ones last: an unstable loop is worse than any stable one.

    An arm without a value is not in the order: -inf.
    """
    # in the order of worse arms: above each value of a stable loop
    beyond = 1e9
    larger_is_worse = (
        "peak",
        "settling_time_s",
        "overshoot",
        "time_constant_s",
        "residual_rms",
        "steady_state_error",
        "cost",
        "unstable",
        "minimum_damping_s",
        "rise_time_s",
        "re_1_s",
    )
    value, *words = (values[name] for name in order)
    if any(word not in (None, "", STABLE) for word in words):
        return beyond
    if value is None or math.isnan(value):
        return -math.inf
    name = order[0]
    # of these by their size
    if "peak" in name or "steady_state_error" in name:
        value = abs(value)
    if not any(each in name for each in larger_is_worse):
        value = -value
    return float(np.clip(value, -beyond, beyond / 2))


def worst_arm(
    parts: StudyFolder, table: Mapping[str, Any], order: Sequence[str], resources: Resources
) -> WorstArm | None:
    """Return the worst arm in a quantity, of those drawn and of a search from the worst of them, and write its file.

    `table` are the columns of the whole study.  None where the search has no end before the deadline.
    """
    rows = rows_of({name: table[name].tolist() for name in order})
    ranks = [badness(order, row) for row in rows]
    first = int(np.argmax(ranks))
    require(ranks[first] > -math.inf, "worst", order[0], "no arm has a value of it")
    drawn = {name: of[first] for name, of in table.items()}
    seen = search_worst(parts, order, first, resources)
    if seen is None:
        return None
    worst = max(seen or [drawn], key=partial(badness, order))
    numbers = {key: float(worst[key]) for key in parts.plan.space.keys}
    quantity = order[0]
    return WorstArm(
        quantity=quantity,
        row=first,
        drawn=_number_or_none(drawn[quantity]),
        found=_number_or_none(worst[quantity]),
        evaluations=len(seen),
        numbers=numbers,
        file=str(write_case(parts, numbers)),
    )


def _number_or_none(value: float | None) -> float | None:
    """Return a number, None of one that is missing."""
    return None if value is None or math.isnan(value) else float(value)


def search_worst(
    parts: StudyFolder, order: Sequence[str], first: int, resources: Resources
) -> list[Row] | None:
    """Return the rows of a search of the worst arm, by Nelder and Mead's simplex from row `first`.

    It stays within the range of a bounded distribution of n draws, else within its quantiles 1/(2 n) and 1 - 1/(2 n).
    No rows without independent ranges; None where it has no end before the deadline.
    """
    space = parts.plan.space
    if not space.is_independent:
        return []
    start = space.uniform(first)
    with np.errstate(all="ignore"):
        is_bounded = np.isfinite(space.values(np.array([0 * start, 0 * start + 1]))).all(axis=0)
    edge = np.minimum(np.where(is_bounded, 0.0, 0.5 / space.draws), np.minimum(start, 1 - start))
    # of the probability of each number
    step = 0.05
    steps = np.diag(np.where(start < 0.5, step, -step))
    most = 20 + 20 * len(start)

    def search(result: Callable[[Real], Row]) -> None:
        scipy.optimize.minimize(  # type: ignore[call-overload]  # bounds as an array
            lambda u: -badness(order, result(space.values(u[None]))),
            start,
            method="Nelder-Mead",
            bounds=np.array([edge, 1 - edge]).T,
            options={"maxfev": most, "initial_simplex": [start, *(start + steps)]},
        )

    return search_rows(parts.others(f"_worst-{order[0]}-", most, 1, order), search, resources)


def write_case(parts: StudyFolder, numbers: Mapping[str, float]) -> Path:
    """Write the arm with these numbers, its chain and its controller, and return the file."""
    plan = parts.plan
    file = parts.folder / "worst.toml"
    case = plan.subjects.at([*numbers.values()]).case
    text = file_text(replace(case.arm, name=f"{plan.case.arm.name}-worst"), case.chain)
    # of a state space, which has no table
    with suppress(ParameterError):
        text = f"{text}\n{law_toml(case.law)}"
    write_file(file, text.encode(), key=OUT)
    return file
