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
from typing import Any, get_args, get_origin, get_type_hints

# whose statistics take half a second to load
from tfarm.arm import PLANE
from tfarm.assessment.card import LoopCard, analysis_of, loop_card, words_of
from tfarm.assessment.step import LoopResponse, step
from tfarm.dsp.stages import admit_case
from tfarm.errors import ConvergenceError, TfarmError, must_be_known, require
from tfarm.exact.system import system_of
from tfarm.loop.poles import closed_loop_poles
from tfarm.loop.sampled_verdict import SAMPLED_LOOP
from tfarm.loop.stability import stability
from tfarm.loop.windows import Interval, windows_of
from tfarm.schema import Quantity, quantities
from tfarm.spectrum import damped_modes, modes
from tfarm.spectrum.frequencies import list_frequencies
from tfarm.spectrum.shapes import PARAMETERS
from tfarm.studies.space import Subject
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


# ------------------------------------------------------------------------------------------------------------ responses
