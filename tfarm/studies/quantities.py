"""Quantities that a study asks of each arm, and the findings over all arms.

Quantities are entries of the records of tfarm, by their dotted names in JSON.  Findings are the share of stable arms
with its confidence, the spread of each quantity and its driver, and the reasons of missing results.

With k of n independent draws stable, at least the share p is stable with the confidence 1 - a, where k or more of n
have the probability a at p: the one-sided interval of Clopper and Pearson (Biometrika 26, 1934).  An arm without a
result counts as not stable.
"""

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

# whose statistics take half a second to load
import scipy

from tfarm.arm import PLANE
from tfarm.arrays import Real
from tfarm.assessment.card import LoopCard, analysis_of, loop_card, words_of
from tfarm.assessment.signal_figures import LoopResponse
from tfarm.assessment.step import step
from tfarm.dsp.stages import admit_case
from tfarm.errors import ConvergenceError, TfarmError, must_be_known, require
from tfarm.exact.system import system_of
from tfarm.loop.curve import decibels
from tfarm.loop.poles import closed_loop_poles
from tfarm.loop.sampled_verdict import SAMPLED_LOOP
from tfarm.loop.stability import stability
from tfarm.loop.windows import Interval, windows_of
from tfarm.response import transfer
from tfarm.response.frequency import resonant_band
from tfarm.schema import Percent, Quantity, quantities
from tfarm.spectrum import damped_modes, modes
from tfarm.spectrum.frequencies import list_frequencies
from tfarm.spectrum.sensitivities import PARAMETERS
from tfarm.studies.space import Subject, Subjects
from tfarm.tuner.tuning import tune_by_default

# column of the reason of a missing result
FAILED = "failed"
# modes and poles of a row
LISTED = 5
NO_PARENT = Quantity()
LOOPS = ("continuous", "sampled")
# the result card of both loops
CARD = "card"
FREQUENCY = "modes.natural_frequency_rad_s"
RATIO = "damped_modes.damping_ratio"
SENSITIVITY = "sensitivity"
INTERVAL = "interval"
STABILITY = "interval.verdict"
TRIAL_COST = "tuner.trial_cost"
UNSTABLE = "poles.unstable"
REAL = "poles.re_1_s"
IMAGINARY = "poles.im_rad_s"


CONFIDENCE = 0.95
QUANTILES = {"least": 0.0, "low": 0.05, "median": 0.5, "high": 0.95, "largest": 1.0}
STABLE = "stable"
# of an arm, in these columns
Values = Callable[[Subject, Set[str]], Mapping[str, Any]]
# columns, and their values
ColumnSource = tuple[Mapping[str, Quantity], Values]


def first_of(name: str) -> str:
    """Return the name of the column number 1 of a numbered one, and any other name itself."""
    return re.sub(r"\.[1-9][0-9]{0,6}$", ".1", name)


def quantity_of(name: str) -> Quantity:
    """Return the quantity of a column; of a numbered one there are columns of any number."""
    of = COLUMNS[first_of(name)]
    return COLUMNS.get(name, replace(of, label=f"{of.label.removesuffix(' 1')} {name.rpartition('.')[2]}"))


def loop_of(name: str) -> str:
    """Return the loop of a column, empty for one of the arm alone."""
    return next((loop for loop in LOOPS if loop in name.split(".")), "")


def stability_of(name: str) -> str:
    """Return the column of the stability of the loop of a column, empty for one of the arm alone."""
    if loop := loop_of(name):
        return f"{name.partition(loop)[0]}{loop}.stability"
    return ""


def _most(names: Set[str]) -> int:
    """Return the largest number of numbered columns."""
    return max(int(name.rpartition(".")[2]) for name in names)


def entries_of(
    kind: Any, value: Any, under: str, parent: Quantity = NO_PARENT
) -> Iterator[tuple[str, Quantity, Any]]:
    """Yield dotted name, quantity and value of each entry of a record of that class; no value where that is None.

    The first entry without a label (the value of a graded margin) has the name and the quantity of its parent.
    """
    for name, of in quantities(kind).items():
        kinds = _kinds(kind)[name]
        own = None if value is None else getattr(value, name)
        place = f"{under}.{of.key}"
        column = replace(of, label=f"{parent.label} {of.label}".strip() * bool(of.label))
        if issubclass(kind, tuple) and name == kind._fields[0]:
            place = under
            column = replace(parent, help=parent.help or of.help)
        inner = next(filter(quantities, kinds), None)
        if inner is not None:
            yield from entries_of(inner, own, place, column)
        else:
            is_text = bool({str, tuple} & {*kinds})
            yield (
                place,
                replace(column, is_number=not is_text),
                "; ".join(own) if isinstance(own, tuple) else own,
            )


@cache
def _kinds(kind: Any) -> dict[str, tuple[Any, ...]]:
    """Return the classes of which each field of a record may be."""
    return {
        name: tuple(
            each for part in (hint, *get_args(hint)) if isinstance(each := get_origin(part) or part, type)
        )
        for name, hint in get_type_hints(kind).items()
    }


def _card_of(loop: str) -> ColumnSource:
    """Return the entries of the card of a loop, of which stability and its certainty need the verdict alone."""

    def values(one: Subject, names: Set[str]) -> dict[str, Any]:
        if loop == "continuous" and one.case.law.is_discrete:
            return {}
        if names <= {f"{loop}.stability", f"{loop}.certainty"}:
            case = admit_case(SAMPLED_LOOP, one.case)
            words = words_of(analysis_of(loop, case).verdict, case.chain)
            return {f"{loop}.{key}": text for key, text in words.items()}
        return {name: value for name, _, value in entries_of(LoopCard, loop_card(loop, one.case), loop)}

    return {name: column for name, column, _ in entries_of(LoopCard, None, loop)}, values


def _step_of(one: Subject, _: Set[str]) -> dict[str, Any]:
    found = step(one.case.arm, one.case.law, one.case.chain, "slew")
    return {
        name: value
        for loop in LOOPS
        for name, _, value in entries_of(LoopResponse, getattr(found, loop), f"step.{loop}")
    }


def _modes_of(one: Subject, names: Set[str]) -> dict[str, float | None]:
    count = _most(names)
    return _numbered(FREQUENCY, modes(one.case.arm, count).natural_frequency[-count:])


def prepare(subjects: Sequence[Subject], names: Sequence[str]) -> None:
    """Find the natural frequencies of all these arms in one loop, where columns of modes are asked for.

    An arm whose list fails has its reason where it is asked alone.
    """
    numbers = {name for name in names if first_of(name) == f"{FREQUENCY}.1"}
    alike = defaultdict(list)
    for one in subjects if numbers else ():
        alike[one.case.arm.has_rigid_mode].append(system_of(one.case.arm, one.case.arm.theory).undamped)
    for rigid, systems in alike.items():
        list_frequencies(systems, rigid + 1, rigid + _most(numbers))


def _sensitivities_of(one: Subject, names: Set[str]) -> dict[str, float | None]:
    count = _most(names)
    return {
        name: value
        for parameter, values in modes(one.case.arm, count).sensitivity.items()
        for name, value in _numbered(f"{SENSITIVITY}.{parameter}", values[-count:] + 0.0).items()
    }


def intervals_of(one: Subject, names: Set[str]) -> dict[str, Any]:
    """Stability and intervals of gains at the hub; undecided, without intervals, where poles cannot be counted."""
    found: dict[str, Any] = {STABILITY: "undecided"}
    with suppress(ConvergenceError):
        verdict = stability(admit_case(SAMPLED_LOOP, one.case))
        gains = [
            gain
            for gain in PLANE
            if gain in verdict.loop.numbers and any(f".{gain}." in name for name in names)
        ]
        for gain, of in windows_of(verdict, gains).items():
            found |= {
                f"{INTERVAL}.{gain}.{name}": getattr(of.interval, name, None) for name in Interval._fields
            }
        found[STABILITY] = verdict.word
    return found


def _damped_of(one: Subject, names: Set[str]) -> dict[str, float | None]:
    found = damped_modes(modes(one.case.arm, _most(names)))
    s = found.eigenvalues[found.index > 0, 0]
    return _numbered(RATIO, -s.real / abs(s))


def _poles_of(one: Subject, _: Set[str]) -> dict[str, float | None]:
    case = admit_case(SAMPLED_LOOP, one.case)
    found = closed_loop_poles(case.arm, case.law)
    s = found.values
    return {UNSTABLE: float(found.unstable), **_numbered(REAL, s.real), **_numbered(IMAGINARY, s.imag)}


def _numbered(name: str, values: Any) -> dict[str, float | None]:
    """Return values under numbered names, None where there are none."""
    return {
        f"{name}.{n}": each if math.isfinite(each) else None
        for n, each in enumerate(values.tolist(), start=1)
    }


def _columns(name: str, label: str, unit: str, meaning: str) -> dict[str, Quantity]:
    """Return the numbered columns of a quantity of modes or poles."""
    return {
        f"{name}.{n}": Quantity(f"{label} {n}", unit, help=meaning, is_number=True)
        for n in range(1, LISTED + 1)
    }


def _tuner_of(one: Subject, _: Set[str]) -> dict[str, Any]:
    tuning = tune_by_default(one.case.arm, one.case.chain, None, **one.tuner)
    training = tuning.training
    return {
        **_numbered(TRIAL_COST, training.costs),
        "tuner.cost": training.result.cost if training.stopped is None else None,
        "tuner.cost_best_constant": tuning.best_constant.cost,
        "tuner.trials": float(training.costs.size),
        "tuner.is_zero": float(training.died),
        "tuner.stopped": training.stopped and str(training.stopped),
    }


ASKED: tuple[ColumnSource, ...] = (
    *map(_card_of, LOOPS),
    (_columns(FREQUENCY, "natural frequency, mode", "rad/s", "of the undamped arm"), _modes_of),
    (
        {
            name: column
            for parameter in PARAMETERS
            for name, column in _columns(
                f"{SENSITIVITY}.{parameter}",
                f"sensitivity to {parameter}, mode",
                "%/%",
                "d ln(natural frequency)/d ln(number)",
            ).items()
        },
        _sensitivities_of,
    ),
    (
        {
            STABILITY: Quantity("stability", help="of the continuous-time loop"),
            **{
                f"{INTERVAL}.{gain}.{name}": replace(of, label=f"stability interval of {gain} {of.label}")
                for gain in PLANE
                for name, of in quantities(Interval).items()
            },
        },
        intervals_of,
    ),
    (_columns(RATIO, "damping ratio, mode", "", "of the arm without controller"), _damped_of),
    (
        {
            UNSTABLE: Quantity("unstable poles", help="conjugates counted", is_number=True),
            **_columns(REAL, "real part, pole", "1/s", "of the continuous-time loop, ascending in frequency"),
            **_columns(IMAGINARY, "imaginary part, pole", "rad/s", "of the continuous-time loop, ascending"),
        },
        _poles_of,
    ),
    (
        {
            name: column
            for loop in LOOPS
            for name, column, _ in entries_of(LoopResponse, None, f"step.{loop}")
        },
        _step_of,
    ),
    (
        {
            "tuner.cost": Quantity(
                "cost of the tuned slew", help="none where training diverged", is_number=True
            ),
            "tuner.cost_best_constant": Quantity(
                "cost with the best constant gain", help="same slew", is_number=True
            ),
            "tuner.trials": Quantity("trials", help="slews of the training", is_number=True),
            "tuner.is_zero": Quantity(
                "zero gain", help="1 where the moment gain went to zero, else 0", is_number=True
            ),
            f"{TRIAL_COST}.1": Quantity("cost of trial 1", help="none after a divergence", is_number=True),
            "tuner.stopped": Quantity("stopped", help="trial and sample of a divergence"),
        },
        _tuner_of,
    ),
)
COLUMNS = {name: column for columns, _ in ASKED for name, column in columns.items()}


def column_names(words: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the columns that are asked for: "card", "sampled.delay_margin_ms", "delay_margin_ms".

    A word is a name, or the first parts of one, or those after the first.  Raises ParameterError for a word of no
    column.
    """
    found: dict[str, None] = {}
    for word in [each for name in words for each in (LOOPS if name == CARD else (name,))]:
        begun = [name for name in COLUMNS if f"{name}.".startswith(f"{word}.")]
        after = [name for name in COLUMNS if f"{name}.".partition(".")[2].startswith(f"{word}.")]
        own = [word] if first_of(word) in COLUMNS else begun or after
        if not own:
            parts = {each for name in COLUMNS for each in (name, *name.split(".")) if not each.isdigit()}
            must_be_known("ask", word, sorted({CARD, *parts}))
        found |= dict.fromkeys(own)
    require(found, "ask", "", f"name at least one quantity: {CARD}, modes, damped_modes, poles, step, tuner")
    return tuple(found)


def order_of(word: str) -> tuple[str, ...]:
    """Return the columns of the order by a quantity: that, and the stability of its loop where it has one.

    Raises ParameterError for a word of no number or of several.
    """
    names = [name for name in column_names([word]) if quantity_of(name).is_number and quantity_of(name).label]
    require(
        len(names) == 1 or word in names,
        "worst",
        word,
        f"{len(names)} quantities of numbers, not one: {', '.join(names[:6])}",
    )
    quantity = word if word in names else names[0]
    return (quantity, *filter(None, [stability_of(quantity)]))


def sources_of(names: Sequence[str]) -> list[tuple[Set[str], Values]]:
    """Return the functions that have values of these columns, each with its own columns."""
    found = list[tuple[Set[str], Values]]()
    for columns, values in ASKED:
        own = dict.fromkeys(name for name in names if first_of(name) in columns)
        found += [(own.keys(), values)] * bool(own)
    return found


def values_of(one: Subject, sources: Sequence[tuple[Set[str], Values]]) -> dict[str, Any]:
    """Return the values of columns (`sources_of`) for an arm, and under `FAILED` the reason of missing ones."""
    found = dict[str, Any]()
    reasons = []
    for own, values in sources:
        try:
            found |= values(one, own)
        except TfarmError as error:
            reasons.append(f"{min(own).split('.')[0]}: {error}")
    names = (name for own, _ in sources for name in own)
    return {**{name: found.get(name) for name in names}, FAILED: "; ".join(reasons) or None}


# ------------------------------------------------------------------------------------------------------------ findings


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
        text = f"{self.certainty} stable on {self.stable:,} of {self.stable + self.other + self.open:,} arms".strip()
        others = [f"{self.other:,} not stable"] * bool(self.other) + [f"{self.open:,} not determined"] * bool(
            self.open
        )
        text += f" ({', '.join(others)})" * bool(others)
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
    for loop in [each for each in LOOPS if f"{each}.stability" in names]:
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
    for name, of in ((name, quantity_of(name)) for name in names):
        if of.is_number and of.label and (is_known := np.isfinite(table[name])).any():
            values = table[name][is_known]
            driver, correlation = _driver({key: table[key][is_known] for key in keys}, values)
            ends = dict(zip(QUANTILES, np.quantile(values, list(QUANTILES.values())).tolist(), strict=True))
            label = ", ".join(filter(None, (loop_of(name), of.label)))
            found.append(
                Spread(
                    name=name,
                    label=label,
                    unit=of.unit,
                    arms=values.size,
                    driver=driver,
                    correlation=correlation,
                    **ends,
                )
            )
    return tuple(found)


def _driver(inputs: Mapping[str, Real], values: Real) -> tuple[str | None, float | None]:
    """Return the varied number of the largest significant rank correlation, and that."""
    known = {
        key: scipy.stats.spearmanr(column, values)
        for key, column in inputs.items()
        if len(values) >= 10 and np.ptp(column) > 0 and np.ptp(values) > 0
    }
    # Bonferroni: of several numbers one is often near it by chance
    level = 0.05 / max(1, len(inputs))
    found = {key: float(of.statistic) for key, of in known.items() if of.pvalue < level}
    return max(found.items(), key=lambda each: abs(each[1]), default=(None, None))


def failures_of(table: Mapping[str, Any]) -> tuple[Failure, ...]:
    """Return the reasons of missing results with their counts."""
    rows: dict[str, list[int]] = {}
    for row, text in enumerate(table["failed"]):
        rows.setdefault(re.sub(r"[-+]?\d[\d.eE+-]*", "N", text), []).append(int(table["row"][row]))
    return tuple(Failure(reason, len(own), own[0]) for reason, own in rows.items() if reason)


# ------------------------------------------------------------------------------------------------------------ responses


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
