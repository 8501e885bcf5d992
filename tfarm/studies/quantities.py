"""Quantities that a study asks of each arm: its columns, and the functions that have their values.

Quantities are entries of the records of tfarm, by their dotted names in JSON.
"""

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from itertools import chain
from typing import Any, get_args, get_origin, get_type_hints

# whose statistics take half a second to load
from tfarm.arm import PLANE
from tfarm.assessment.card import LoopCard, analysis_of, loop_card, words_of
from tfarm.assessment.signal_figures import LoopResponse
from tfarm.assessment.step import step
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
from tfarm.spectrum.sensitivities import PARAMETERS
from tfarm.studies.space import Subject
from tfarm.tuner.tuning import tune_by_default

# column of the reason of a missing result
FAILED = "failed"
LOOPS = ("continuous", "sampled")
# the result card of both loops
CARD = "card"
FREQUENCY = "modes.natural_frequency_rad_s"
INTERVAL = "interval"
STABILITY = "interval.verdict"


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


def is_labelled_number(name: str) -> bool:
    """Return whether a column has numbers with a label."""
    of = quantity_of(name)
    return of.is_number and bool(of.label)


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
    kind: Any, value: Any, under: str, parent: Quantity | None = None
) -> Iterator[tuple[str, Quantity, Any]]:
    """Yield dotted name, quantity and value of each entry of a record of that class; no value where that is None.

    The first entry without a label (the value of a graded margin) has the name and the quantity of its parent.
    """
    parent = Quantity() if parent is None else parent
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
            is_text = str in kinds or tuple in kinds
            shown = "; ".join(own) if isinstance(own, tuple) else own
            yield place, replace(column, is_number=not is_text), shown


@cache
def _kinds(kind: Any) -> dict[str, tuple[Any, ...]]:
    """Return the classes of which each field of a record may be."""
    found = {}
    for name, hint in get_type_hints(kind).items():
        parts = (get_origin(part) or part for part in (hint, *get_args(hint)))
        found[name] = tuple(each for each in parts if isinstance(each, type))
    return found


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


def _step_of_both() -> ColumnSource:
    """Return the entries of the slew of both loops."""

    def entries(of: Any) -> Iterator[tuple[str, Quantity, Any]]:
        for loop in LOOPS:
            yield from entries_of(LoopResponse, getattr(of, loop, None), f"step.{loop}")

    def values(one: Subject, _: Set[str]) -> dict[str, Any]:
        found = step(one.case.arm, one.case.law, one.case.chain, "slew")
        return {name: value for name, _, value in entries(found)}

    return {name: column for name, column, _ in entries(None)}, values


def _natural_frequencies() -> ColumnSource:
    """Return the natural frequencies of the undamped arm."""

    def values(one: Subject, names: Set[str]) -> dict[str, float | None]:
        count = _most(names)
        return _number_values(FREQUENCY, modes(one.case.arm, count).natural_frequency[-count:])

    return _columns(FREQUENCY, "natural frequency, mode", "rad/s", "of the undamped arm"), values


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


def _sensitivities() -> ColumnSource:
    """Return the sensitivities of the natural frequencies to each parameter of the arm."""
    columns: dict[str, Quantity] = {}
    for parameter in PARAMETERS:
        label = f"sensitivity to {parameter}, mode"
        meaning = "d ln(natural frequency)/d ln(number)"
        columns |= _columns(f"sensitivity.{parameter}", label, "%/%", meaning)

    def values(one: Subject, names: Set[str]) -> dict[str, float | None]:
        count = _most(names)
        found: dict[str, float | None] = {}
        for parameter, of in modes(one.case.arm, count).sensitivity.items():
            found |= _number_values(f"sensitivity.{parameter}", of[-count:] + 0.0)
        return found

    return columns, values


def _intervals() -> ColumnSource:
    """Return the stability of the continuous-time loop, and the intervals of its gains."""
    columns = {STABILITY: Quantity("stability", help="of the continuous-time loop")}
    for gain in PLANE:
        for name, of in quantities(Interval).items():
            label = f"stability interval of {gain} {of.label}"
            columns[f"{INTERVAL}.{gain}.{name}"] = replace(of, label=label)
    return columns, intervals_of


def intervals_of(one: Subject, names: Set[str]) -> dict[str, Any]:
    """Return stability and intervals of gains at the hub; undecided, without any, where poles cannot be counted."""
    found: dict[str, Any] = {STABILITY: "undecided"}
    with suppress(ConvergenceError):
        verdict = stability(admit_case(SAMPLED_LOOP, one.case))
        wanted = {name.split(".")[1] for name in names}
        gains = [gain for gain in PLANE if gain in verdict.loop.numbers and gain in wanted]
        for gain, of in windows_of(verdict, gains).items():
            for name in Interval._fields:
                found[f"{INTERVAL}.{gain}.{name}"] = getattr(of.interval, name, None)
        found[STABILITY] = verdict.word
    return found


def _damping_ratios() -> ColumnSource:
    """Return the damping ratios of the arm without controller."""
    ratio = "damped_modes.damping_ratio"

    def values(one: Subject, names: Set[str]) -> dict[str, float | None]:
        found = damped_modes(modes(one.case.arm, _most(names)))
        s = found.eigenvalues[found.index > 0, 0]
        return _number_values(ratio, -s.real / abs(s))

    return _columns(ratio, "damping ratio, mode", "", "of the arm without controller"), values


def _poles() -> ColumnSource:
    """Return the poles of the continuous-time loop, and the number of unstable ones."""
    unstable = "poles.unstable"
    real = "poles.re_1_s"
    imaginary = "poles.im_rad_s"

    def values(one: Subject, _: Set[str]) -> dict[str, float | None]:
        case = admit_case(SAMPLED_LOOP, one.case)
        found = closed_loop_poles(case.arm, case.law)
        s = found.values
        parts = _number_values(real, s.real) | _number_values(imaginary, s.imag)
        return {unstable: float(found.unstable), **parts}

    columns = {
        unstable: Quantity("unstable poles", help="conjugates counted", is_number=True),
        **_columns(real, "real part, pole", "1/s", "of the continuous-time loop, ascending in frequency"),
        **_columns(imaginary, "imaginary part, pole", "rad/s", "of the continuous-time loop, ascending"),
    }
    return columns, values


def _tuner_costs() -> ColumnSource:
    """Return the costs of a tuning, and its end."""
    trial_cost = "tuner.trial_cost"

    def values(one: Subject, _: Set[str]) -> dict[str, Any]:
        tuning = tune_by_default(one.case.arm, one.case.chain, None, **one.tuner)
        training = tuning.training
        return {
            **_number_values(trial_cost, training.costs),
            "tuner.cost": training.result.cost if training.stopped is None else None,
            "tuner.cost_best_constant": tuning.best_constant.cost,
            "tuner.trials": float(training.costs.size),
            "tuner.is_zero": float(training.died),
            "tuner.stopped": training.stopped and str(training.stopped),
        }

    number = partial(Quantity, is_number=True)
    columns = {
        "tuner.cost": number("cost of the tuned slew", help="none where training diverged"),
        "tuner.cost_best_constant": number("cost with the best constant gain", help="same slew"),
        "tuner.trials": number("trials", help="slews of the training"),
        "tuner.is_zero": number("zero gain", help="1 where the moment gain went to zero, else 0"),
        f"{trial_cost}.1": number("cost of trial 1", help="none after a divergence"),
        "tuner.stopped": Quantity("stopped", help="trial and sample of a divergence"),
    }
    return columns, values


def _number_values(name: str, values: Any) -> dict[str, float | None]:
    """Return values under numbered names, None where there are none."""
    known = (each if math.isfinite(each) else None for each in values.tolist())
    return {f"{name}.{n}": each for n, each in enumerate(known, start=1)}


def _columns(name: str, label: str, unit: str, meaning: str) -> dict[str, Quantity]:
    """Return the columns of the first five of a quantity of modes or poles."""
    return {f"{name}.{n}": Quantity(f"{label} {n}", unit, help=meaning, is_number=True) for n in range(1, 6)}


SOURCES: tuple[ColumnSource, ...] = (
    *map(_card_of, LOOPS),
    _natural_frequencies(),
    _sensitivities(),
    _intervals(),
    _damping_ratios(),
    _poles(),
    _step_of_both(),
    _tuner_costs(),
)
COLUMNS = dict(chain.from_iterable(columns.items() for columns, _ in SOURCES))


def column_names(words: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the columns that are asked for: "card", "sampled.delay_margin_ms", "delay_margin_ms".

    A word is a name, or the first parts of one, or those after the first.  Raises ParameterError for a word of no
    column.
    """
    found: dict[str, None] = {}
    loops = {CARD: LOOPS}
    for word in chain.from_iterable(loops.get(name, (name,)) for name in words):
        begun = [name for name in COLUMNS if f"{name}.".startswith(f"{word}.")]
        after = [name for name in COLUMNS if f"{name}.".partition(".")[2].startswith(f"{word}.")]
        own = [word] if first_of(word) in COLUMNS else begun or after
        if not own:
            parts = {CARD, *COLUMNS, *".".join(COLUMNS).split(".")}
            must_be_known("ask", word, sorted(each for each in parts if not each.isdigit()))
        found |= dict.fromkeys(own)
    require(found, "ask", "", f"name at least one quantity: {CARD}, modes, damped_modes, poles, step, tuner")
    return tuple(found)


def order_of(word: str) -> tuple[str, ...]:
    """Return the columns of the order by a quantity: that, and the stability of its loop where it has one.

    Raises ParameterError for a word of no number or of several.
    """
    names = [*filter(is_labelled_number, column_names([word]))]
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
    for columns, values in SOURCES:
        own = dict.fromkeys(name for name in names if first_of(name) in columns)
        if own:
            found.append((own.keys(), values))
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
    names = chain.from_iterable(own for own, _ in sources)
    return {**{name: found.get(name) for name in names}, FAILED: "; ".join(reasons) or None}
