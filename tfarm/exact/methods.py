"""Three roads to one number, to be taken beside each other: by hand what the tests do everywhere.

closed-form   the fused formulas in float64, with ball arithmetic where they lose digits: what tfarm takes
balls         ball arithmetic alone (python-flint): a proven enclosure, and the float64 nearest to it
appendix      the paper's own 4x4 determinant and Cramer's rule with mpmath, at a precision that is doubled until
              two results agree; it shares no formula with the other two
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex
from tfarm.errors import ParameterError, did_you_mean

from . import appendix
from .outputs import Output
from .system import System
from .values import value_with_care

Method = Literal["closed-form", "balls", "appendix"]
METHODS: tuple[Method, ...] = ("closed-form", "balls", "appendix")

APPENDIX_DIGITS = 17  # of the appendix: more than a float64 holds


def known_method(method: str) -> Method:
    """The method of that name.  Raises ParameterError for any other."""
    if method not in METHODS:
        raise ParameterError(key="method", value=method, remedy=did_you_mean(method, METHODS))
    return method


def slow_values(method: Method, arm: Arm, k: System, wanted: Sequence[Output], s: Complex, x: float) -> Complex:
    """Outputs (rows) at s (1-D) one by one, by the balls or by the appendix; x is a share of the length.

    Raises ParameterError at a pole that float64 cannot tell s from, ConvergenceError where the appendix has no limit.
    """
    if method == "balls":
        return np.array([[value_with_care(k, each, complex(at), each.share(x)) for at in s] for each in wanted])

    if not (arm.is_uniform and arm.theory == "timoshenko"):
        remedy = "the paper's appendix is of one uniform Timoshenko link on a hub"
        raise ParameterError(key="method", value=method, remedy=remedy)

    for each in wanted:
        if each.is_of_a_chain:
            raise ParameterError(key="output", value=each.name, remedy="the paper's appendix is not asked for it")

    def by_cramer(each: Output, at: complex) -> complex:
        return complex(appendix.response(arm, each, at, APPENDIX_DIGITS, x * arm.link.length))

    return np.array([[by_cramer(each, complex(at)) for at in s] for each in wanted])
