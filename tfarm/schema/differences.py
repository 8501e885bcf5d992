"""Two records compared: the quantities that both have, and their differences in the unit of the quantity."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, NamedTuple

from .quantities import At, Percent, Quantity, entries, is_list_of_records, quantities, text, with_flat

LONGEST_COMPARED = 28  # characters of a text that is compared: a word or an interval, and no sentence
EMPTY = {"None", "", "[]", "()"}  # what is compared where neither has a value
SAME = 4e-14  # of a value: what two computations of it may differ by
NAMES = ("first", "second")  # of two records that have none


class PercentagePoints(Percent):
    """The difference of two ratios that a person reads in per cent."""

    unit = "percentage points"


class Difference(NamedTuple):
    """One quantity of two records."""

    quantity: Annotated[str, Quantity("quantity", help="quantity of both records, in a table after its row")]
    unit: Annotated[str, Quantity("unit", help="unit of both values and of their difference")]
    one: Annotated[Any, Quantity("first", digits=8, help="value of the first record")]
    other: Annotated[Any, Quantity("second", digits=8, help="value of the second record")]

    @property
    def difference(self) -> Annotated[float | None, Quantity("difference", digits=4, help="second less first")]:
        """Second less first, in the unit; what rounding may leave is 0, and what is no number has none."""
        one, other = self.one, self.other
        if any(isinstance(each, bool) or not isinstance(each, int | float) for each in (one, other)):
            return None
        gap = 0.0 if one == other else float(other - one)
        if not math.isfinite(gap):
            return None
        gap = 0.0 if abs(gap) <= SAME * abs(one) else gap
        return PercentagePoints(gap) if isinstance(one, Percent) else gap


class Differences(list[Difference]):
    """Quantities of two records, which are named in the table."""

    def __init__(self, rows: Iterable[Difference], names: tuple[str, str]) -> None:
        super().__init__(rows)
        self.titles = dict(zip(("one", "other"), names, strict=True))


def compare(one: Any, other: Any, names: tuple[str, str] = NAMES) -> Differences:
    """The quantities that two records have, or the records in two lists, row by row.

    Records in lists, and rows of tables, are paired by their first quantity, a name or a number.
    """
    return Differences((_of_rows if isinstance(one, list) else _of_records)(one, other), names)


def _of_records(one: Any, other: Any) -> Iterator[Difference]:
    others = {label: value for label, _, value in entries(other)}
    for label, of, value in entries(one):
        both = [each.value if isinstance(each, At) else each for each in (value, others.get(label))]
        is_short = of.is_number or len(str(value)) < LONGEST_COMPARED
        if label in others and is_short and not set(map(str, both)) <= EMPTY:
            yield Difference(label, of.unit, *both)
    for (value, of, _), (match, *_) in zip(with_flat(one), with_flat(other), strict=False):
        if of.label and is_list_of_records(value) and is_list_of_records(match):
            yield from _of_rows(value, match)


def _of_rows(some: Sequence[Any], others: Sequence[Any]) -> Iterator[Difference]:
    """Differences of rows; a text that is the same in both rows is none."""
    if not some:
        return
    key, of = next(iter(quantities(type(some[0])).items()))
    by_key = {getattr(row, key): row for row in others}
    for row in some:
        at = getattr(row, key)
        name = at if isinstance(at, str) else f"{of.label} {text(at)}"
        for each in _of_records(row, by_key[at]) if at in by_key else ():
            if each.quantity != of.label and not (isinstance(each.one, str) and each.one == each.other):
                yield each._replace(quantity=f"{name}: {each.quantity}")
