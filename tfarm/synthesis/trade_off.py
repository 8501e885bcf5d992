"""The front of speed against robustness: laws of least settling time, say, under limits of all strengths.

A robustness of 1 has the limits of the grade *good*: gain margin 6 r dB, phase margin 45 r deg, delay margin r
periods, and Ms = 1 + 1/r.  A law is sought near that of the robustness before, so that the front has no jumps where the
optimum has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw
from tfarm.errors import ConvergenceError
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.synthesis.required import RequiredLaw, RequirementTask
from tfarm.synthesis.requirements import MEASURES, Requirement
from tfarm.synthesis.worst_case import NamedArm


class FrontPoint(NamedTuple):
    """A law of the front: its robustness, the minimised quantity, the margins of the sampled loop, and coefficients."""

    robustness: Annotated[float, Quantity("robustness", digits=3, help="1: the limits of the grade good")]
    value: Annotated[float, Quantity("minimised", digits=4, help="quantity that is minimised, in its unit")]
    time_constant: Annotated[float, Quantity("dominant time constant", "s", 4, help="of the sampled loop")]
    gain_margin: Annotated[float, Quantity("gain margin", "dB", 4, help="of the sampled loop")]
    phase_margin: Annotated[float, Quantity("phase margin", "deg", 4, help="of the sampled loop")]
    delay_margin: Annotated[float, Quantity("delay margin", "periods", 4, help="of the sampled loop")]
    peak_sensitivity: Annotated[float, Quantity("peak sensitivity Ms", "", 4, help="of the sampled loop")]
    is_met: Annotated[
        bool, Quantity("met", help="whether a law of the structure meets the limits of this robustness")
    ]
    coefficients: Annotated[dict[str, float], Quantity(help="coefficients of the law")]


@frozen
class TradeOff:
    """The front of a structure on an arm: its points from lax to strict limits, and the law of each."""

    arm: Annotated[str, Quantity("arm", help="name of the arm")]
    structure: Annotated[str, Quantity("structure", help="form of the laws")]
    minimised: Annotated[str, Quantity("minimised", help="quantity that is minimised")]
    unit: Annotated[str, Quantity(help="its unit")]
    points: Annotated[tuple[FrontPoint, ...], Quantity("front", help="laws from lax to strict limits")]
    laws: tuple[AnyLaw, ...]


def scaled_limits(robustness: float) -> tuple[Requirement, ...]:
    """Return the limits of the grade good, made laxer below a robustness of 1 and stricter above."""
    return (
        Requirement("gain_margin_db", ">=", 6.0 * robustness),
        Requirement("phase_margin_deg", ">=", 45.0 * robustness),
        Requirement("delay_margin_periods", ">=", robustness),
        Requirement("peak_sensitivity", "<=", 1.0 + 1.0 / robustness),
    )


def front(task: RequirementTask, named: Sequence[NamedArm], number: int = 12) -> TradeOff:
    """Return the front of a task, whose own requirements of other quantities hold at every point.

    Raises ConvergenceError where no law is stable on all arms.
    """
    limited = {each.name for each in scaled_limits(1.0)}
    others = tuple(each for each in task.requirements if each.name not in limited)
    before: RequiredLaw | None = None
    points = []
    laws: list[Any] = []
    # from less than half of the limits of good to nearly twice as strict ones
    for robustness in np.geomspace(0.4, 1.9, number).tolist():
        own = replace(task, requirements=(*scaled_limits(robustness), *others))
        start = None if before is None else before._replace(goal=own.goal)
        try:
            found = own.find(named, start, "whole" if before is None else "near")
            if found.violation > 0 and before is not None:
                # the optimum has jumped to another part of the plane
                other = own.find(named, None, "whole")
                found = min(found, other, key=attrgetter("violation"))
        except ConvergenceError:
            if before is None:
                raise
            break
        values = task.values_on(task.arm, found.law)
        form = found.search.form
        points.append(
            FrontPoint(
                robustness,
                values[task.minimised],
                values["time_constant_s"],
                values["gain_margin_db"],
                values["phase_margin_deg"],
                values["delay_margin_periods"],
                values["peak_sensitivity"],
                found.violation <= 0,
                dict(zip(form.names, form.coefficients(found.x).tolist(), strict=True)),
            )
        )
        laws.append(found.law)
        before = found
    measure = MEASURES[task.minimised]
    return TradeOff(task.arm.name, task.form.name, measure.title, measure.unit, tuple(points), tuple(laws))
