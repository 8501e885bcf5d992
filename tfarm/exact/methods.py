"""Three roads to one number, to be taken beside each other: by hand what the tests do everywhere.

closed-form   the fused formulas in float64, with ball arithmetic where they lose digits: what tfarm takes
balls         ball arithmetic alone (python-flint): a proven enclosure, and the float64 nearest to it
appendix      the paper's own 4x4 determinant and Cramer's rule with mpmath, at a precision that is doubled until
              two results agree; it shares no formula with the other two
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Theory
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError, did_you_mean
from tfarm.records import record

from . import appendix
from .outputs import Output
from .system import System
from .values import value_with_care

Method = Literal["closed-form", "balls", "appendix"]
METHODS: tuple[Method, ...] = ("closed-form", "balls", "appendix")

APPENDIX_DIGITS = 17  # of the appendix: more than a float64 holds
METHODS_AGREE = 1e-14  # relative: some tens of roundings of a float64, by which each of two roads may be off


@dataclass(frozen=True)
@record
class Roads:
    """The same numbers by each method that has them (`values`), and in words why another is left out (`left_out`)."""

    values: dict[Method, NDArray[Any]]
    left_out: dict[Method, str]

    @property
    def differences(self) -> dict[Method, Real]:
        """How far each is from the closed form, as a share of that; of 1 where that is 0."""
        fast = self.values["closed-form"]
        size = np.where(fast == 0, 1.0, abs(fast))
        return {name: np.asarray(abs(each - fast) / size) for name, each in self.values.items() if each is not fast}

    @property
    def largest_difference(self) -> float:
        """The largest of these."""
        return max(float(each.max(initial=0.0)) for each in self.differences.values())

    @property
    def finding(self) -> str:
        """How far the roads part, in words."""
        return f"{', '.join(self.values)} {'agree' if self.agree else 'part'} to {self.largest_difference:.1e}"

    @property
    def agree(self) -> bool:
        """Whether they differ by no more than their rounding."""
        return self.largest_difference <= METHODS_AGREE


def by_roads(value: Callable[[Method], NDArray[Any]], no_appendix: str) -> Roads:
    """The values of each method, without the appendix where words say why it has none."""
    left_out: dict[Method, str] = {"appendix": no_appendix} if no_appendix else {}
    return Roads({method: np.asarray(value(method)) for method in METHODS if method not in left_out}, left_out)


def roads_answer(found: Roads) -> dict[str, Any]:
    """The values by method, complex ones as pairs, how far they part, and what is left out."""

    def listed(values: NDArray[Any]) -> list[Any]:
        return np.stack([values.real, values.imag], axis=-1).tolist() if np.iscomplexobj(values) else values.tolist()

    return {
        "methods": {name: listed(each) for name, each in found.values.items()},
        "left_out": dict(found.left_out),
        "differences": {name: each.tolist() for name, each in found.differences.items()},
        "largest_difference": found.largest_difference,
    }


def known_method(method: str) -> Method:
    """The method of that name.  Raises ParameterError for any other."""
    if method not in METHODS:
        raise ParameterError(key="method", value=method, remedy=did_you_mean(method, METHODS))
    return method


def why_no_appendix(arm: Arm, theory: Theory, wanted: Sequence[Output] = ()) -> str:
    """Why the paper's appendix has no value of these outputs, or no frequencies; "" where it has."""
    if theory != "timoshenko" or not arm.is_uniform:
        return "the paper's appendix is of one Timoshenko beam on a hub"
    others = [each.name for each in wanted if not each.is_in_appendix]
    return (
        f"the paper's appendix has no {others[0]}: it is an output of rigs, worked out by closed form and balls"
        if others
        else ""
    )


def must_be_of_appendix(arm: Arm, theory: Theory, wanted: Sequence[Output] = ()) -> None:
    """Raise ParameterError where the appendix has no answer."""
    if words := why_no_appendix(arm, theory, wanted):
        raise ParameterError(key="method", value="appendix", remedy=words)


def slow_values(method: Method, arm: Arm, k: System, wanted: Sequence[Output], s: Complex, x: float) -> Complex:
    """Outputs (rows) at s (1-D) one by one, by the balls or by the appendix; x is a share of the length.

    Raises ParameterError at a pole that float64 cannot tell s from, ConvergenceError where the appendix has no limit.
    """
    if method == "balls":
        return np.array([[value_with_care(k, each, complex(at), each.share(x)) for at in s] for each in wanted])

    must_be_of_appendix(arm, arm.theory, wanted)

    place = x * arm.link.length
    return np.array(
        [[complex(appendix.response(arm, each, complex(at), APPENDIX_DIGITS, place)) for at in s] for each in wanted]
    )
