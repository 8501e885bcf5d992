"""Findings over the arms of a study: stable shares, distributions with their drivers, failures, and response bands.

With k of n independent draws stable, at least the share p is stable with the confidence 1 - a, where k or more of n
have the probability a at p: the one-sided interval of Clopper and Pearson (Biometrika 26, 1934).  An arm without a
result counts as not stable.
"""

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any, NamedTuple

import numpy as np

# whose statistics take half a second to load
import scipy

from tfarm.arrays import Real
from tfarm.errors import TfarmError, require
from tfarm.loop.curve import decibels
from tfarm.response import transfer
from tfarm.response.frequency import resonant_band
from tfarm.schema import Percent, Quantity
from tfarm.studies.quantities import LOOPS, STABLE, is_labelled_number, loop_of, quantity_of
from tfarm.studies.space import Subjects

CONFIDENCE = 0.95
QUANTILES = {"least": 0.0, "low": 0.05, "median": 0.5, "high": 0.95, "largest": 1.0}


class StableShare(NamedTuple):
    """Stable arms of one loop."""

    loop: Annotated[str, Quantity("loop", help="continuous-time or sampled")]
    stable: Annotated[int, Quantity(help="arms with a stable loop")]
    other: Annotated[int, Quantity(key="not_stable", help="arms with a marginal or unstable loop")]
    open: Annotated[int, Quantity(key="not_determined", help="arms without a result")]
    certainty: Annotated[str, Quantity(help="weakest word of certainty among the stable arms")]
    at_least: Annotated[
        Percent | None,
        Quantity(help="least share of stable arms, with 95 % confidence; of independent draws only"),
    ]

    @property
    def finding(
        self,
    ) -> Annotated[str, Quantity("finding", help="stable arms, with their confidence in per cent")]:
        """Stable arms with certainty and confidence."""
        count = self.stable + self.other + self.open
        text = f"{self.certainty} stable on {self.stable:,} of {count:,} arms".strip()
        numbers = {"not stable": self.other, "not determined": self.open}
        others = [f"{number:,} {word}" for word, number in numbers.items() if number]
        if others:
            text += f" ({', '.join(others)})"
        if self.at_least is None:
            return text
        # never more than was shown
        percent = math.floor(1e4 * self.at_least + 1e-6) / 100
        return f"{text}: at least {percent:g} % of all with {100 * CONFIDENCE:g} % confidence"


class Spread(NamedTuple):
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
    correlation: Annotated[
        float | None, Quantity("rank correlation", "", 2, help="Spearman's, of that number")
    ]


class Failure(NamedTuple):
    """A reason of missing results."""

    reason: Annotated[str, Quantity("reason", help="error of the first of these arms, without its numbers")]
    arms: Annotated[int, Quantity("arms", help="number of arms with that reason")]
    row: Annotated[int, Quantity("first row", help="number of the first of these rows")]


def least_share(successes: int, count: int) -> float:
    """Return the share that is exceeded with 95 % confidence, one-sided (Clopper and Pearson, 1934)."""
    test = scipy.stats.binomtest(successes, count, alternative="greater")
    return float(test.proportion_ci(CONFIDENCE, method="exact").low)


def shares_of(
    table: Mapping[str, Any], names: Sequence[str], is_independent: bool
) -> tuple[StableShare, ...]:
    """Return the stable shares of the loops whose stability was computed."""
    found = []
    for loop in LOOPS:
        if f"{loop}.stability" not in names:
            continue
        words = table[f"{loop}.stability"].tolist()
        stable = words.count(STABLE)
        undetermined = words.count("")
        texts = table.get(f"{loop}.certainty", [""] * len(words))
        known = [
            text.partition(" ")[0].rstrip(",")
            for text, word in zip(texts, words, strict=True)
            if word == STABLE
        ]
        weakest = ["exact", "certified", "converged", "approximate", "not determined", ""]
        share = StableShare(
            loop=loop.replace("continuous", "continuous-time"),
            stable=stable,
            other=len(words) - stable - undetermined,
            open=undetermined,
            certainty=max(known, key=weakest.index, default=""),
            at_least=Percent(least_share(stable, len(words))) if is_independent else None,
        )
        found.append(share)
    return tuple(found)


def spreads_of(table: Mapping[str, Any], names: Sequence[str], keys: Sequence[str]) -> tuple[Spread, ...]:
    """Return the distribution of each quantity that has finite values."""
    found = []
    for name in filter(is_labelled_number, names):
        of = quantity_of(name)
        is_known = np.isfinite(table[name])
        if not is_known.any():
            continue
        values = table[name][is_known]
        driver, correlation = _driver({key: table[key][is_known] for key in keys}, values)
        ends = np.quantile(values, list(QUANTILES.values())).tolist()
        spread = Spread(
            name=name,
            label=", ".join(filter(None, (loop_of(name), of.label))),
            unit=of.unit,
            arms=values.size,
            driver=driver,
            correlation=correlation,
            **dict(zip(QUANTILES, ends, strict=True)),
        )
        found.append(spread)
    return tuple(found)


def _driver(inputs: Mapping[str, Real], values: Real) -> tuple[str | None, float | None]:
    """Return the varied number of the largest significant rank correlation, and that."""
    found = {}
    is_enough = len(values) >= 10 and np.ptp(values) > 0
    for key, column in inputs.items():
        if is_enough and np.ptp(column) > 0:
            of = scipy.stats.spearmanr(column, values)
            # Bonferroni: of several numbers one is often near it by chance
            if of.pvalue < 0.05 / len(inputs):
                found[key] = float(of.statistic)
    return max(found.items(), key=lambda each: abs(each[1]), default=(None, None))


def failures_of(table: Mapping[str, Any]) -> tuple[Failure, ...]:
    """Return the reasons of missing results with their counts."""
    rows: dict[str, list[int]] = {}
    for row, text in enumerate(table["failed"]):
        rows.setdefault(re.sub(r"[-+]?\d[\d.eE+-]*", "N", text), []).append(int(table["row"][row]))
    return tuple(Failure(reason, len(own), own[0]) for reason, own in rows.items() if reason)


class StudyBand(NamedTuple):
    """Magnitudes [dB] of a response at `omega` [rad/s]: `curves` (arms, n), their quantiles, and unit and label."""

    omega: Real
    curves: list[Real]
    low: Real
    median: Real
    high: Real
    label: str
    unit: str


def response_quantiles(
    subjects: Subjects, rows: Sequence[Sequence[float]], output: str, points: int = 1200
) -> StudyBand:
    """Return the exact responses of the arms of some rows, and their quantiles at each frequency.

    Raises ParameterError for an unknown output, and where no arm has that response.
    """
    arm = subjects.case.arm
    omega = np.geomspace(*resonant_band(arm), points)
    own = transfer(arm, output).rows[0]
    curves = []
    for row in rows:
        # of an arm that is illegal there is none
        with suppress(TfarmError):
            curves.append(decibels(transfer(subjects.at(row).case.arm, output)(1j * omega)))
    require(curves, "output", output, "no arm of the study has that response")
    low, median, high = np.quantile(curves, [QUANTILES[end] for end in ("low", "median", "high")], axis=0)
    return StudyBand(omega, curves, low, median, high, own.label, own.unit)
