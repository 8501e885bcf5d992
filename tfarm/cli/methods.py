"""The same number by three roads, beside each other: what `--compare` prints."""

from __future__ import annotations

import math
from typing import Any

from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.errors import ParameterError
from tfarm.exact.methods import METHODS_AGREE, Method, known_method
from tfarm.tables.terminal import show

MOST_SLOW = 2000  # points by balls or by the appendix, at some milliseconds each
BESIDE_COMPARE = "--compare prints a table of its own: ask for one of them"


def slow_method(method: str, number: int, digits: int | None, compare: bool) -> Method:
    """The method asked for.  Raises ParameterError for an unknown one, too many points, digits beside a slow one."""
    chosen = known_method(method)
    if chosen == "closed-form" and not compare:
        return chosen
    if digits is not None:
        remedy = "they are proven by balls in any case: leave --method and --compare out"
        raise ParameterError(key="--digits", value=digits, remedy=remedy)
    if number > MOST_SLOW:
        remedy = f"at most {MOST_SLOW} by balls or the appendix, which take milliseconds for each"
        raise ParameterError(key="points", value=number, remedy=remedy)
    return chosen


def refuse_beside(others: dict[str, Any], remedy: str) -> None:
    """Raise ParameterError for an option that another one would leave unheard."""
    for key, value in others.items():
        if value is not None:
            raise ParameterError(key=key, value=value, remedy=remedy)


def print_compared(answer: dict[str, Any]) -> None:
    """A row a point or a mode: the closed form's number, and how far the others are from it, relatively."""
    numbers = answer["methods"]["closed-form"]
    if "index" in answer:
        first = Column("index", "mode", of=answer["index"]), Column("", "rad/s", of=numbers, digits=singly(general, 15))
    else:
        points = [f"{complex(*at):.10g}" for at in answer["s"]]
        pairs = ([part if abs(part) > METHODS_AGREE * math.hypot(*pair) else 0.0 for part in pair] for pair in numbers)
        values = [f"{complex(*pair):.15g}" for pair in pairs]  # no part that is less than the rounding of the other
        first = Column("s", "s", "1/s", of=points), Column("", answer["output"], answer["unit"], of=values)
    apart = [
        Column(name, f"{name} differ{end} by", of=answer["differences"][name], digits=singly("{:.1e}".format))
        for name, end in (("balls", ""), ("appendix", "s"))
        if name in answer["differences"]
    ]
    show(Table(columns=(*first, *apart)))
    largest = answer["largest_difference"]
    if largest <= METHODS_AGREE:
        others = " and proven balls" if answer["left_out"] else ", proven balls and the paper's own determinant"
        print(f"Float64{others} agree to {largest:.1e}, their rounding.")
    else:
        print(f"They part by up to {largest:.1e}: more than rounding ({METHODS_AGREE:.0e}); the balls are proven.")
    for method, why in answer["left_out"].items():
        print(f"No {method} here: {why}.")
