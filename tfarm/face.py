"""`tfarm.Case`: a case with the questions of the package as methods, `tfarm.Case(arm, law).margins()`.

Each method is the function `tfarm.NAME(arm, law, chain, ...)` with what the case has of its arguments.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from inspect import signature
from itertools import takewhile
from typing import Any

import tfarm
from tfarm.case import Case
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.response.signals import controller
from tfarm.schema.terminal import table_lines


@dataclass(frozen=True)
class Question:
    """A function of the package as a method of a case; its documentation is that function's."""

    name: str

    def __get__(self, case: Case | None, _: type[Case]) -> Callable[..., Any]:
        function = getattr(tfarm, self.name)
        if case is None:
            return function
        parts = {"arm": case.arm, "law": case.law, "chain": case.chain}
        names = signature(function).parameters
        first = list(takewhile(parts.__contains__, names))
        # the others by name: what comes between is of the method
        others = {each: parts[each] for each in names if each in parts and each not in first}
        return partial(function, *(parts[each] for each in first), **others)


class CaseFace(Case):
    """An arm under a controller, with the package's functions as methods; shown as its result card.

    Parameters
    ----------
    arm
        Of `tfarm.load`.
    law
        A `HubFeedback` or a `Law`.
    chain
        Sampling, converters and actuator, 10 ms and ideal unless given.

    Raises
    ------
    ParameterError
        For what is no arm, no controller or no chain.
    """

    modes = Question("modes")
    bode = Question("bode")
    transfer = Question("transfer")
    reduce = Question("reduce")
    poles = Question("closed_loop_poles")
    margins = Question("margins")
    nyquist = Question("nyquist")
    locus = Question("locus")
    map = Question("map")
    spill = Question("spill")
    sampled = Question("sampled")
    norm = Question("norm")
    card = Question("result_card")
    loop_function = Question("loop_function")
    step = Question("step")
    simulate = Question("simulate")
    reference = Question("reference")
    predict = Question("predict")
    export = Question("export")
    explore = Question("explore")
    study = Question("study")

    def __repr__(self) -> str:
        name = controller(self.law, self.arm).law
        first = f"{self.arm.name}: {name}, sampled every {1e3 * self.chain.sampling.period:g} ms"
        try:
            return "\n".join([first, *table_lines(self.card().table)])
        except (ParameterError, ConvergenceError) as error:
            return f"{first}\nno result card: {error}"
