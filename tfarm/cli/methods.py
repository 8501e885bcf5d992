"""The same number by three roads, beside each other: what `--compare` prints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.columns import Column, Table
from tfarm.digits import general, singly
from tfarm.errors import ParameterError
from tfarm.exact.methods import METHODS, Method, known_method
from tfarm.response import transfer
from tfarm.tables.terminal import show

if TYPE_CHECKING:
    from tfarm.arm import Arm
    from tfarm.exact.outputs import Output
    from tfarm.spectrum import Modes

MOST_SLOW = 2000  # points by balls or by the appendix, at some milliseconds each
METHODS_AGREE = 1e-14  # relative: some tens of roundings of a float64, by which each of two roads may be off
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


def responses_by_methods(arm: Arm, output: str | Output, x: float | None, s: NDArray[Any]) -> dict[str, Any]:
    """One output at s by each method, and by what share of its size each differs from the closed form."""
    roads = {method: transfer(arm, output, x=x, method=method) for method in METHODS}
    found, G = {method: np.asarray(road(s)) for method, road in roads.items()}, roads["closed-form"]
    answer = {"arm": arm.name, "output": G.outputs[0], "unit": G.units[0]}
    values = {method: [[float(v.real), float(v.imag)] for v in each] for method, each in found.items()}
    return answer | {"s": [[float(p.real), float(p.imag)] for p in s], "methods": values, **_differences(found)}


def modes_by_methods(table: Modes) -> dict[str, Any]:
    """The frequencies by each method, and by what share each differs from the closed form."""
    found = {method: table.frequencies(method) for method in METHODS}
    answer = {"arm": table.arm.name, "theory": table.theory, "index": [int(index) for index in table.index]}
    return answer | {"methods": {name: each.tolist() for name, each in found.items()}, **_differences(found)}


def _differences(found: dict[Method, NDArray[Any]]) -> dict[str, Any]:
    fast = found["closed-form"]
    size = np.where(fast == 0, 1.0, abs(fast))
    apart = {name: abs(each - fast) / size for name, each in found.items() if name != "closed-form"}
    return {
        "differences": {name: each.tolist() for name, each in apart.items()},
        "largest_difference": max(float(each.max(initial=0.0)) for each in apart.values()),
    }


def print_compared(answer: dict[str, Any]) -> None:
    """A row a point or a mode: the closed form's number, and how far the other two are from it, relatively."""
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
    ]
    show(Table(columns=(*first, *apart)))
    largest = answer["largest_difference"]
    if largest <= METHODS_AGREE:
        print(f"Float64, proven balls and the paper's own determinant agree to {largest:.1e}, their rounding.")
    else:
        print(f"They part by up to {largest:.1e}: more than rounding ({METHODS_AGREE:.0e}); the balls are proven.")
