"""The front of speed against robustness: laws of least settling time, say, under limits of all strengths.

A robustness of 1 has the limits of the grade *good*: gain margin 6 r dB, phase margin 45 r deg, delay margin r
periods, and Ms = 1 + 1/r.  From strict to lax limits a law is sought near the one before, which meets them, so that the
front has no jumps where the optimum has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw
from tfarm.errors import ConvergenceError
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.synthesis.near_map import find_near_map
from tfarm.synthesis.required import RequiredLaw, RequirementTask
from tfarm.synthesis.requirements import GOOD, MEASURES, limits_of_good
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


def front(task: RequirementTask, named: Sequence[NamedArm], number: int = 12) -> TradeOff:
    """Return the front of a task, whose own requirements of other quantities hold at every point.

    Raises ConvergenceError where no law is stable on all arms.
    """
    limited = {each.name for each in GOOD}
    others = tuple(each for each in task.requirements if each.name not in limited)
    before: RequiredLaw | None = None
    points: list[FrontPoint] = []
    laws: list[Any] = []
    failure: ConvergenceError | None = None
    # from nearly twice the limits of good to less than half as strict ones: a law that is met stays so
    for robustness in np.geomspace(1.9, 0.4, number).tolist():
        own = replace(task, requirements=(*limits_of_good(robustness), *others))
        try:
            if before is not None and before.violation <= 0:
                found = own.find(named, before._replace(goal=own.goal), "near")
            else:
                found = find_near_map(own, named, None, "whole")
        except ConvergenceError as error:
            failure = error
            continue
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
        if found.violation <= 0 or before is None or before.violation > 0:
            before = found
    if failure is not None and not points:
        raise failure
    points.reverse()
    laws.reverse()
    # a law that meets stricter limits meets laxer ones too, and is taken where the search found a worse one
    for n in range(len(points) - 2, -1, -1):
        stricter = points[n + 1]
        if stricter.is_met and not (points[n].is_met and points[n].value <= stricter.value):
            points[n] = stricter._replace(robustness=points[n].robustness)
            laws[n] = laws[n + 1]
    measure = MEASURES[task.minimised]
    return TradeOff(task.arm.name, task.form.name, measure.title, measure.unit, tuple(points), tuple(laws))
