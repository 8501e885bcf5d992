"""A law for the worst of several arms, and of those that a search inside a box of arms finds to be worse.

The law is chosen for the arms that are named; the box is then searched for an arm on which it is worse, which is named
too, and the law chosen anew: the exchange of constraints that semi-infinite programmes are solved by (Hettich and
Kortanek, 1993).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from tfarm.arm import Arm
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.synthesis.arms import ArmBox, NamedArm, worst_inside
from tfarm.synthesis.search import Bounds

_Found = TypeVar("_Found")
Tell = Callable[[str], None]

MOST_EXCHANGES = 4  # of the exchange, at most
MUCH_WORSE = 0.01  # of a score: an arm inside that is so much worse is named


@dataclass(frozen=True)
@record
class WorstCase:
    """How the arms came to be named: the `ranges` of the box, and how many arms inside it were tried.

    `worse` names the arm inside on which the law is worse still, where the exchange ended before there was none.
    """

    ranges: dict[str, Bounds]
    tried: int
    worse: str | None = None

    def sentence(self, number: int) -> str:
        """What so many arms were, and what is not known."""
        if not self.ranges:
            return f"the worst of {number} arms" if number > 1 else ""
        box = ", ".join(f"{key} {low:g} to {high:g}" for key, (low, high) in self.ranges.items())
        ended = "none that is worse" if self.worse is None else f"still a worse one, {self.worse}"
        return (
            f"the worst of {number} arms, the corners of the box {box} among them; a search of {self.tried} arms "
            f"inside it found {ended}: no proof over the box"
        )


WITHOUT_BOX = WorstCase({}, 0)  # of a list, or of one arm


def for_the_worst(
    arms: Sequence[NamedArm], box: ArmBox | None, find: Callable[[Sequence[NamedArm]], _Found],
    score_on: Callable[[_Found, Arm], float], tell: Tell,
) -> tuple[_Found, WorstCase]:  # fmt: skip
    """What `find` finds for the arms, and for those inside the box on which it is worse.

    `score_on` is what is minimised, of one arm, inf where the law does not hold.  Raises ConvergenceError where no law
    is found that holds on all arms that are named, or one inside the box stays on which it does not.
    """
    named, tried = list(arms), 0
    while True:
        try:
            found = find(named)
        except ConvergenceError as error:
            if len(named) == 1:
                raise
            text = f"{error.message}; asked of {len(named)} arms at once: {'; '.join(each.name for each in named)}"
            raise ConvergenceError(text, error.best, error.residual) from None
        if box is None:
            return found, WITHOUT_BOX
        limit = max(score_on(found, each.arm) for each in named)
        worst, score, number = worst_inside(box, partial(score_on, found))
        tried += number
        if score <= limit + MUCH_WORSE * abs(limit):
            return found, WorstCase(box.ranges, tried)
        if len(named) == len(arms) + MOST_EXCHANGES:
            if math.isinf(score):
                raise ConvergenceError(f"no law found holds on {worst.name}: narrow the ranges", None, None)
            return found, WorstCase(box.ranges, tried, worst.name)
        tell(f"{worst.name} is worse than the {len(named)} arms before: the law is chosen for it too")
        named.append(worst)


def same_input(arms: Sequence[NamedArm]) -> None:
    """Raise ParameterError where a law would drive different inputs."""
    first = arms[0].arm.input
    for each in arms:
        if each.arm.input != first:
            remedy = f"{each.name} is driven by {each.arm.input}, {arms[0].name} by {first}: one law drives one input"
            raise ParameterError(key="also", value=each.name, remedy=remedy)
