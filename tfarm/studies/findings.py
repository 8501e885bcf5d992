"""Findings of a study: the share of stable arms with its confidence, the spread of each quantity, its drivers.

With k of n independent draws stable, at least the share p is stable with the confidence 1 - a, where k or more of n
have the probability a at p: the one-sided interval of Clopper and Pearson (Biometrika 26, 1934).  An arm without a
result counts as not stable.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import scipy  # whose statistics load when they are used: half a second

from tfarm.arrays import Real
from tfarm.errors import require
from tfarm.schema import Percent, Quantity

from .quantities import COLUMNS, LOOPS, asked_columns

CONFIDENCE = 0.95
QUANTILES = {"least": 0.0, "low": 0.05, "median": 0.5, "high": 0.95, "largest": 1.0}
SIGNIFICANT = 0.05  # of a rank correlation: a larger probability of chance names no driver
FEWEST_RANKED = 10  # rows of a rank correlation
CERTAINTIES = ("exact", "certified", "converged", "approximate", "not determined")
STABLE = "stable"
LARGER_IS_WORSE = (
    "peak_sensitivity", "settling_time_s", "overshoot", "time_constant_s", "residual_rms", "cost", "unstable",
    "minimum_damping_s", "rise_time_s",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class StableShare:
    """Stable arms of one loop."""

    loop: Annotated[str, Quantity("loop", help="continuous-time or sampled")]
    stable: Annotated[int, Quantity("stable", help="arms with a stable loop")]
    other: Annotated[int, Quantity("not stable", help="arms with a marginal or unstable loop")]
    open: Annotated[int, Quantity("not determined", key="not_determined", help="arms without a result")]
    certainty: Annotated[str, Quantity("certainty", help="weakest word of certainty among the stable arms")]
    at_least: Annotated[Percent | None, Quantity("stable share, at least", "", 4,
            help="with 95 % confidence, one-sided, Clopper and Pearson; independent draws only")]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Distribution of a quantity over the arms."""

    name: Annotated[str, Quantity("name", help="column of the table")]
    label: Annotated[str, Quantity("quantity", key="quantity", help="label of the quantity")]
    unit: Annotated[str, Quantity("unit", help="SI unit")]
    arms: Annotated[int, Quantity("arms", help="arms with a finite value")]
    least: Annotated[float, Quantity("least", "", 4, help="least value")]
    low: Annotated[float, Quantity("5 %", "", 4, key="quantile_05", help="quantile 0.05")]
    median: Annotated[float, Quantity("median", "", 4, help="quantile 0.5")]
    high: Annotated[float, Quantity("95 %", "", 4, key="quantile_95", help="quantile 0.95")]
    largest: Annotated[float, Quantity("largest", "", 4, help="largest value")]
    driver: Annotated[str | None, Quantity("driver", help="varied number with the largest rank correlation")]
    correlation: Annotated[float | None, Quantity("rank correlation", "", 2, help="Spearman's, of that number")]


@dataclass(frozen=True)
class Failure:
    """A reason of missing results."""

    reason: Annotated[str, Quantity("reason", help="error of the first of these arms, without its numbers")]
    arms: Annotated[int, Quantity("arms", help="number of arms with that reason")]
    row: Annotated[int, Quantity("first row", help="number of the first of these rows")]


def least_share(successes: int, count: int, confidence: float = CONFIDENCE) -> float:
    """Return the share that is exceeded with that confidence, one-sided (Clopper and Pearson, 1934)."""
    interval = scipy.stats.binomtest(successes, count, alternative="greater").proportion_ci(confidence, method="exact")
    return float(interval.low)


def shares_of(table: Mapping[str, Any], names: Sequence[str], is_independent: bool) -> tuple[StableShare, ...]:
    """Return the stable shares of the loops whose stability was asked for."""
    found = []
    for loop in LOOPS:
        if f"{loop}.stability" not in names:
            continue
        words = table[f"{loop}.stability"]
        is_stable = words == STABLE
        stable, undetermined = int(is_stable.sum()), int((words == "").sum())
        texts = table.get(f"{loop}.certainty", np.full(len(words), ""))[is_stable].tolist()
        certainty = max(({text.split(" ")[0] for text in texts} & {*CERTAINTIES}) or {""}, key=_rank)
        found.append(StableShare(
            loop=loop.replace("continuous", "continuous-time"), stable=stable, open=undetermined,
            other=len(words) - stable - undetermined, certainty=certainty,
            at_least=Percent(least_share(stable, len(words))) if is_independent and len(words) else None,
        ))  # fmt: skip
    return tuple(found)


def _rank(word: str) -> int:
    return CERTAINTIES.index(word) if word else -1


def spreads_of(table: Mapping[str, Any], names: Sequence[str], keys: Sequence[str]) -> tuple[Spread, ...]:
    """Return the distribution of each quantity that has finite values."""
    found = []
    for name in names:
        of = COLUMNS[name].of
        if COLUMNS[name].is_text or not of.label or not np.isfinite(table[name]).any():
            continue
        values = table[name]
        is_known = np.isfinite(values)
        driver, correlation = _driver({key: table[key][is_known] for key in keys}, values[is_known])
        prefix = next((f"{loop}, " for loop in LOOPS if loop in name.split(".")), "")
        ends = dict(zip(QUANTILES, np.quantile(values[is_known], list(QUANTILES.values())).tolist(), strict=True))
        found.append(Spread(name=name, label=f"{prefix}{of.label}", unit=of.unit, arms=int(is_known.sum()),
                            driver=driver, correlation=correlation, **ends))  # fmt: skip
    return tuple(found)


def _driver(inputs: Mapping[str, Real], values: Real) -> tuple[str | None, float | None]:
    """Return the varied number of the largest significant rank correlation, and that."""
    found = {}
    for key, column in inputs.items():
        if len(values) >= FEWEST_RANKED and np.ptp(column) > 0 and np.ptp(values) > 0:
            of = scipy.stats.spearmanr(column, values)
            if of.pvalue < SIGNIFICANT / len(inputs):  # Bonferroni: of several numbers one is often near it by chance
                found[key] = float(of.statistic)
    if not found:
        return None, None
    key = max(found, key=lambda each: abs(found[each]))
    return key, found[key]


def failures_of(table: Mapping[str, Any]) -> tuple[Failure, ...]:
    """Return the reasons of missing results with their counts."""
    first: dict[str, int] = {}
    count: dict[str, int] = {}
    for row, text in zip(table["row"].tolist(), table["failed"].tolist(), strict=True):
        reason = re.sub(r"[-+]?\d[\d.eE+-]*", "N", text)
        if reason:
            first.setdefault(reason, int(row))
            count[reason] = count.get(reason, 0) + 1
    return tuple(Failure(reason, count[reason], row) for reason, row in first.items())


def quantity_named(word: str, key: str) -> str:
    """Return the one column of numbers of a word.  Raises ParameterError for none or several."""
    names = [name for name in asked_columns([word]) if not COLUMNS[name].is_text and COLUMNS[name].of.label]
    require(len(names) == 1 or word in names, key, word, f"names several quantities: {', '.join(names[:6])}")
    return word if word in names else names[0]
