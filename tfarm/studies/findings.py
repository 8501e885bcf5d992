"""Findings of a study: the share of stable arms with its confidence, the spread of each quantity, its drivers.

With k of n independent draws stable, at least the share p is stable with the confidence 1 - a, where k or more of n
have the probability a at p: the one-sided interval of Clopper and Pearson (Biometrika 26, 1934).  An arm without a
result counts as not stable.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import scipy  # whose statistics take half a second to load

from tfarm.arrays import Real
from tfarm.schema import Percent, Quantity

from .quantities import LOOPS, loop_of, quantity_of

CONFIDENCE = 0.95
QUANTILES = {"least": 0.0, "low": 0.05, "median": 0.5, "high": 0.95, "largest": 1.0}
SIGNIFICANT = 0.05  # of a rank correlation: a larger probability of chance names no driver
FEWEST_RANKED = 10  # rows of a rank correlation
CERTAINTIES = ("exact", "certified", "converged", "approximate", "not determined")
STABLE = "stable"


@dataclass(frozen=True, kw_only=True)
class StableShare:
    """Stable arms of one loop."""

    loop: Annotated[str, Quantity("loop", help="continuous-time or sampled")]
    stable: Annotated[int, Quantity(help="arms with a stable loop")]
    other: Annotated[int, Quantity(key="not_stable", help="arms with a marginal or unstable loop")]
    open: Annotated[int, Quantity(key="not_determined", help="arms without a result")]
    certainty: Annotated[str, Quantity(help="weakest word of certainty among the stable arms")]
    at_least: Annotated[Percent | None, Quantity(
            help="least share of stable arms, with 95 % confidence; of independent draws only")]  # fmt: skip

    @property
    def finding(self) -> Annotated[str, Quantity("finding", help="stable arms, with their confidence in per cent")]:
        """Stable arms with certainty and confidence."""
        text = f"{self.certainty} stable on {self.stable:,} of {self.stable + self.other + self.open:,} arms".strip()
        others = [f"{self.other:,} not stable"] * bool(self.other) + [f"{self.open:,} not determined"] * bool(self.open)
        text += f" ({', '.join(others)})" * bool(others)
        if self.at_least is None:
            return text
        percent = math.floor(1e4 * self.at_least + 1e-6) / 100  # never more than was shown
        return f"{text}: at least {percent:g} % of all with {100 * CONFIDENCE:g} % confidence"


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Distribution of a quantity over the arms."""

    name: Annotated[str, Quantity(help="column of the table")]
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
    """Return the stable shares of the loops whose stability was computed."""
    found = []
    for loop in [each for each in LOOPS if f"{each}.stability" in names]:
        words = table[f"{loop}.stability"]
        stable, open_, count = int((words == STABLE).sum()), int((words == "").sum()), len(words)
        texts = table.get(f"{loop}.certainty", np.full(count, ""))[words == STABLE].tolist()
        known = [text.partition(" ")[0].rstrip(",") for text in texts]
        found.append(StableShare(
            loop=loop.replace("continuous", "continuous-time"), stable=stable, open=open_, other=count - stable - open_,
            certainty=max(known, key=(*CERTAINTIES, "").index, default=""),
            at_least=Percent(least_share(stable, count)) if is_independent else None,
        ))  # fmt: skip
    return tuple(found)


def spreads_of(table: Mapping[str, Any], names: Sequence[str], keys: Sequence[str]) -> tuple[Spread, ...]:
    """Return the distribution of each quantity that has finite values."""
    found = []
    for name, of in ((name, quantity_of(name)) for name in names):
        if of.is_number and of.label and (is_known := np.isfinite(table[name])).any():
            values = table[name][is_known]
            driver, correlation = _driver({key: table[key][is_known] for key in keys}, values)
            ends = dict(zip(QUANTILES, np.quantile(values, list(QUANTILES.values())).tolist(), strict=True))
            label = ", ".join(filter(None, (loop_of(name), of.label)))
            found.append(Spread(name=name, label=label, unit=of.unit, arms=values.size, driver=driver,
                                correlation=correlation, **ends))  # fmt: skip
    return tuple(found)


def _driver(inputs: Mapping[str, Real], values: Real) -> tuple[str | None, float | None]:
    """Return the varied number of the largest significant rank correlation, and that."""
    known = {key: scipy.stats.spearmanr(column, values) for key, column in inputs.items()
             if len(values) >= FEWEST_RANKED and np.ptp(column) > 0 and np.ptp(values) > 0}  # fmt: skip
    level = SIGNIFICANT / max(1, len(inputs))  # Bonferroni: of several numbers one is often near it by chance
    found = {key: float(of.statistic) for key, of in known.items() if of.pvalue < level}
    return max(found.items(), key=lambda each: abs(each[1]), default=(None, None))


def failures_of(table: Mapping[str, Any]) -> tuple[Failure, ...]:
    """Return the reasons of missing results with their counts."""
    rows: dict[str, list[int]] = {}
    for row, text in enumerate(table["failed"]):
        rows.setdefault(re.sub(r"[-+]?\d[\d.eE+-]*", "N", text), []).append(int(table["row"][row]))
    return tuple(Failure(reason, len(own), own[0]) for reason, own in rows.items() if reason)
