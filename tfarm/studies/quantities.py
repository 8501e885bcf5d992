"""Quantities that a study asks of each arm: entries of the records of tfarm, by their dotted names in JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from tfarm.case.card import LoopCard, result_card
from tfarm.case.step import LoopResponse, step
from tfarm.errors import must_be_known, require
from tfarm.loop.poles import closed_loop_poles
from tfarm.schema import Percent, Quantity
from tfarm.schema.quantities import quantities
from tfarm.spectrum import damped_modes, modes
from tfarm.tuner.tuning import tuned

from .space import Subject

LISTED = 5  # modes and poles of a row
LOOPS = ("continuous", "sampled")
SCENARIO = "slew"  # of the time response
CARD = "card"  # the result card of both loops
FREQUENCY, RATIO = "modes.natural_frequency_rad_s", "damped_modes.damping_ratio"
UNSTABLE, REAL, IMAGINARY = "poles.unstable", "poles.re_1_s", "poles.im_rad_s"


NO_PARENT = Quantity()


class Column(NamedTuple):
    """A column of a study: its quantity, and whether its values are texts."""

    of: Quantity
    is_text: bool = False


class Asked(NamedTuple):
    """A record of an arm: its columns by dotted name, and their values."""

    columns: Mapping[str, Column]
    values: Callable[[Subject], Mapping[str, Any]]


def entries_of(kind: Any, value: Any, under: str, parent: Quantity = NO_PARENT) -> Iterator[tuple[str, Column, Any]]:
    """Yield dotted name, column and value of each entry of a record of that class; no value where that is None.

    The first entry without a label (the value of a graded margin) has the name and the quantity of its parent.
    """
    for name, of in quantities(kind).items():
        kinds, own = _kinds(kind)[name], None if value is None else getattr(value, name)
        place, column = f"{under}.{of.key}", replace(of, label=f"{parent.label} {of.label}".strip() * bool(of.label))
        if issubclass(kind, tuple) and name == kind._fields[0]:
            place, column = under, replace(parent, help=parent.help or of.help)
        inner = next(filter(quantities, kinds), None)
        if inner is not None:
            yield from entries_of(inner, own, place, column)
        else:
            yield place, Column(column, bool({str, tuple} & {*kinds})), _plain(own)


@cache
def _kinds(kind: Any) -> dict[str, tuple[Any, ...]]:
    """Return the classes of which each field of a record may be."""
    return {
        name: tuple(each for part in (hint, *get_args(hint)) if isinstance(each := get_origin(part) or part, type))
        for name, hint in get_type_hints(kind).items()
    }


def _plain(value: Any) -> Any:
    """Return a value as a table has it: a float, a text or None."""
    if isinstance(value, tuple):
        return "; ".join(map(str, value))
    return float(value) if isinstance(value, Percent | int) else value


def _of_loops(kind: Any, under: str, find: Callable[[Subject], Any]) -> Asked:
    """Return the entries that a record has of the continuous-time and of the sampled loop."""

    def entries(record: Any) -> Iterator[tuple[str, Column, Any]]:
        for loop in LOOPS:
            yield from entries_of(kind, getattr(record, loop, None), f"{under}{loop}")

    return Asked(
        {name: column for name, column, _ in entries(None)},
        lambda one: {name: value for name, _, value in entries(find(one))},
    )


def _modes_of(one: Subject) -> dict[str, float | None]:
    return _numbered(FREQUENCY, modes(one.arm, LISTED).natural_frequency[-LISTED:])


def _damped_of(one: Subject) -> dict[str, float | None]:
    found = damped_modes(modes(one.arm, LISTED))
    s = found.eigenvalues[found.index > 0, 0]
    return _numbered(RATIO, np.divide(-s.real, abs(s), out=np.full(s.shape, np.nan), where=s != 0))


def _poles_of(one: Subject) -> dict[str, float | None]:
    found = closed_loop_poles(one.arm, one.law)
    s = found.values[:LISTED]
    return {UNSTABLE: float(found.unstable), **_numbered(REAL, s.real), **_numbered(IMAGINARY, s.imag)}


def _numbered(name: str, values: Any) -> dict[str, float | None]:
    """Return values under numbered names, None where there are none."""
    found = [None if np.isnan(each) else each for each in values.tolist()]
    return {f"{name}.{n}": value for n, value in enumerate([*found, *[None] * (LISTED - len(found))], start=1)}


def _columns(name: str, label: str, unit: str, meaning: str) -> dict[str, Column]:
    """Return the numbered columns of a quantity of modes or poles."""
    return {f"{name}.{n}": Column(Quantity(f"{label} {n}", unit, help=meaning)) for n in range(1, LISTED + 1)}


def _tuner_of(one: Subject) -> dict[str, Any]:
    tuning = tuned(one.arm, one.chain, **one.tuner)
    training = tuning.training
    return {
        "tuner.cost": training.result.cost if training.stopped is None else None,
        "tuner.cost_best_constant": tuning.best_constant.cost,
        "tuner.trials": float(training.costs.size),
        "tuner.stopped": training.stopped and str(training.stopped),
    }


ASKED = {
    CARD: _of_loops(LoopCard, "", lambda one: result_card(one.arm, one.law, one.chain)),
    "modes": Asked(_columns(FREQUENCY, "natural frequency, mode", "rad/s", "of the undamped arm"), _modes_of),
    "damped_modes": Asked(_columns(RATIO, "damping ratio, mode", "", "of the arm without controller"), _damped_of),
    "poles": Asked(
        {
            UNSTABLE: Column(Quantity("unstable poles", help="conjugates counted")),
            **_columns(REAL, "real part, pole", "1/s", "of the continuous-time loop, ascending in frequency"),
            **_columns(IMAGINARY, "imaginary part, pole", "rad/s", "of the continuous-time loop, ascending"),
        },
        _poles_of,
    ),
    "step": _of_loops(LoopResponse, "step.", lambda one: step(one.arm, one.law, one.chain, SCENARIO)),
    "tuner": Asked(
        {
            "tuner.cost": Column(Quantity("cost of the tuned slew", "", 4, "none where training diverged")),
            "tuner.cost_best_constant": Column(Quantity("cost with the best constant gain", "", 4)),
            "tuner.trials": Column(Quantity("trials", help="slews of the training")),
            "tuner.stopped": Column(Quantity("stopped", help="trial and sample of a divergence"), is_text=True),
        },
        _tuner_of,
    ),
}
COLUMNS = {name: column for asked in ASKED.values() for name, column in asked.columns.items()}


def asked_columns(words: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the columns that are asked for: "card", "sampled.delay_margin_ms", "delay_margin_ms".

    A word is a record, or whole parts of dotted names.  Raises ParameterError for a word of no column.
    """
    found: dict[str, None] = {}
    for word in words:
        own = list(ASKED[word].columns) if word in ASKED else [n for n in COLUMNS if f".{word}." in f".{n}."]
        if not own:
            parts = {part for name in COLUMNS for part in (name, *name.split(".")) if not part.isdigit()}
            must_be_known("ask", word, sorted({*ASKED, *parts}))
        found |= dict.fromkeys(own)
    require(found, "ask", "", f"name at least one quantity: {', '.join(ASKED)}, or one of theirs")
    return tuple(found)


def values_of(one: Subject, names: Sequence[str]) -> dict[str, Any]:
    """Return the values of these columns for an arm."""
    found: dict[str, Any] = {}
    for asked in ASKED.values():
        if not asked.columns.keys().isdisjoint(names):
            found |= asked.values(one)
    return {name: found.get(name) for name in names}
