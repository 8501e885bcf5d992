"""Sobol' indices: shares of the variance of each quantity of a study by its varied numbers."""

import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np

# whose statistics take half a second to load
import scipy

from tfarm.arrays import Real
from tfarm.schema import Quantity
from tfarm.studies.findings import CONFIDENCE
from tfarm.studies.quantities import is_labelled_number
from tfarm.studies.running import (
    Resources,
    StudyFolder,
    seconds_an_arm,
    table_of,
    write_missing_parts,
)
from tfarm.studies.space import ENDS

BOOTSTRAP = "95 % bootstrap interval; none without any influence"


class SobolIndex(NamedTuple):
    """Shares of the variance of a quantity by one varied number (Sobol', 1993; Saltelli et al., 2010)."""

    quantity: Annotated[str, Quantity("quantity", help="column of the table")]
    key: Annotated[
        str, Quantity("number", help="varied number; none where the indices are not determined")
    ] = ""
    first: Annotated[float | None, Quantity("first order", "", 3, "share by this number alone")] = None
    first_interval: Annotated[tuple[float, float] | None, Quantity("interval", "", 3, BOOTSTRAP)] = None
    total: Annotated[float | None, Quantity("total", "", 3, "share by this number and its interactions")] = (
        None
    )
    total_interval: Annotated[tuple[float, float] | None, Quantity("interval of total", "", 3, BOOTSTRAP)] = (
        None
    )
    note: Annotated[str, Quantity("note", help="reason where the indices are not determined")] = ""


def sobol_indices(study: StudyFolder, size: int, resources: Resources) -> tuple[SobolIndex, ...]:
    """Return Sobol' indices of every quantity, of a sample of its own of N (numbers + 2) arms, written as parts.

    The first progress has their number and time.  A quantity without a finite value on each arm has no indices.  None
    where the sample is not complete before the deadline.
    """
    plan = study.plan
    space = plan.space
    keys = space.keys
    count = len(keys)
    sample = scipy.stats.qmc.Sobol(2 * count, rng=np.random.default_rng(space.seed)).random(size)
    A, B = np.hsplit(sample, 2)
    # A with one column of B
    pages = [np.where(np.arange(count) == n, B, A) for n in range(count)]
    rows = space.values(np.clip(np.vstack([A, B, *pages]), *ENDS))
    # all workers have some of a small sample
    parts = study.others(f"_sobol-{size}-", len(rows), 64, plan.names)
    if not parts.is_complete:
        seconds = seconds_an_arm(plan, rows) * len(rows) / resources.workers
        resources.progress(0, 0, f"Sobol' indices of {len(rows):,} further arms, about {seconds:.0f} s")
    calls = partial(map, lambda ends: partial(table_of, plan, ends[0], rows[slice(*ends)]))
    write_missing_parts(parts, calls, resources, "parts of Sobol' indices")
    found: list[SobolIndex] = []
    if parts.is_complete:
        for name, values in parts.column(*filter(is_labelled_number, plan.names)).items():
            found += _indices(name, keys, values)
    return tuple(found)


def _indices(name: str, keys: Sequence[str], values: Real) -> Iterator[SobolIndex]:
    """Yield the indices of the values of a quantity: of A, of B and of a page a number, N arms each."""
    missing = int(np.sum(~np.isfinite(values)))
    if missing or np.ptp(values) == 0:
        yield SobolIndex(
            quantity=name, note=f"no finite value on {missing:,} arms" if missing else "no variance"
        )
        return
    f_A, f_B, *f_AB = values.reshape(len(keys) + 2, 1, -1)
    found: Any = scipy.stats.sobol_indices(func={"f_A": f_A, "f_B": f_B, "f_AB": np.array(f_AB)}, n=f_A.size)
    # of an index that does not vary
    no_interval: Any = scipy.stats.DegenerateDataWarning
    with warnings.catch_warnings(action="ignore", category=no_interval), np.errstate(all="ignore"):
        ends = found.bootstrap(confidence_level=CONFIDENCE)
    first = ends.first_order.confidence_interval
    total = ends.total_order.confidence_interval
    columns = (found.first_order, first.low, first.high, found.total_order, total.low, total.high)
    rows = np.reshape(columns, (len(columns), -1)).T.tolist()
    for key, (S, S_low, S_high, T, T_low, T_high) in zip(keys, rows, strict=True):
        yield SobolIndex(name, key, S, (S_low, S_high), T, (T_low, T_high))
