"""The assumptions of a fitted arm: those of the arm before, marked where they name a fitted number, and the fit."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from tfarm.arm.schema import file_key
from tfarm.arm.writing import KeyedArms
from tfarm.digits import join_words
from tfarm.errors import one_line
from tfarm.fitting.data import NUMBER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tfarm.fitting.data import Measured
    from tfarm.fitting.intervals import Fitted
    from tfarm.fitting.runs import RigRun


def assumptions_of(
    family: KeyedArms,
    fitted: Sequence[Fitted],
    in_words: str,
    responses: Sequence[Measured],
    runs: Sequence[RigRun],
    not_determined: Sequence[str],
) -> tuple[str, ...]:
    """Return an arm's assumptions, marked where they name a fitted number, then the fit and its data."""
    # characters of a file in an assumption
    longest_name = 200
    before = family.arm.assumptions
    texts: list[str] = []
    for text in before:
        labels = [file_key(key).label for key in family.keys if is_named(key, family.value(key), text)]
        mark = f"Before the fit of {join_words(labels)}: " if labels else ""
        texts.append(mark + text.removeprefix(mark))
    numbers = [each for each in fitted if "." in each.key]
    values = [f"{each.label} = {each.value:.6g} {file_key(each.key).unit}".rstrip() for each in numbers]
    values = values or ["sensors alone"]
    texts.append(f"Fitted: {join_words(values)}, from the arm {family.arm.name}; {in_words}.")
    for each in responses:
        digest = each.digest or "none"
        texts.append(
            f"Fitted to {each.label} of {one_line(Path(each.source).name, longest_name)}, SHA-256 {digest}."
        )
    for run in runs:
        loop = "in open loop" if run.law is None else f"under {run.law.name}"
        name = one_line(Path(run.source).name, longest_name)
        texts.append(f"Fitted to a run of {name} {loop}, SHA-256 {run.digest or 'none'}.")
    return (*texts, *(f"Of the fit: {words}." for words in not_determined))


def is_named(key: str, value: float, text: str) -> bool:
    """Return whether a text names a number of an arm: by its label, by its symbol (I_h =), or by its value and unit."""
    of = file_key(key)
    *words, last = of.label.split()
    # a symbol ends a label: I_h, Kt
    symbol = last if len(last) <= 3 else ""
    label = " ".join(words) if symbol else of.label
    pattern = rf"(?i:\b{re.escape(label)}\b)" + rf"|(?<!\d )\b{symbol}(?=,| and | of | =)" * bool(symbol)
    values = re.findall(rf"({NUMBER}) {re.escape(of.unit)}(?![\w^/]| m\^)", text) if of.unit else []
    return bool(re.search(pattern, text)) or value in map(float, values)
