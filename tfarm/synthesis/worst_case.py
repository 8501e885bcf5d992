"""A law for the worst of several arms: of a list, of the corners of a box over numbers of one, and of arms inside it.

The law is chosen for the arms of a list.  The box, or a pool of drawn arms, is then searched for an arm on which it is
worse, which is added to the list, and the law is chosen again: the exchange method of semi-infinite programming
(Hettich and Kortanek, 1993).  The first arms are added by laws of a short search.
That is no proof over the box: between the arms of the list nothing is certain.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.records import ADJUSTABLE
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Real
from tfarm.errors import ConvergenceError, require
from tfarm.records import frozen
from tfarm.synthesis.structures import Bounds

_Robust = TypeVar("_Robust")
# of a search: all runs; one run, and all that follows; one run
Effort = Literal["whole", "near", "sketch"]
# is called with one line of progress
Tell = Callable[[str], None]

# arms at random inside the box
ARMS_TRIED = 24


class NamedArm(NamedTuple):
    """An arm, its name in the results, and its `numbers` of a box, by key."""

    name: str
    arm: Arm
    numbers: dict[str, float]


def vary_arm(arm: Arm, key: str, value: float) -> Arm:
    """Return the arm with another value of one number, named as in its file ("payload.mass") or in a locus.

    Raises ParameterError for an unknown key, and for a value as its parts do.
    """
    name = {".".join(place): name for name, place in ADJUSTABLE.items()}.get(key, key)
    if name in ADJUSTABLE:
        return arm.with_numbers(**{name: value})
    return KeyedArms(arm, (key,), "range").at({key: value})


@frozen
class ArmBox:
    """The arms with numbers in `ranges` (key: its ends), and all other numbers of `arm`.

    Raises ParameterError for an unknown key, too many of them, ends that are not finite or in order, and invalid
    corners.
    """

    arm: Arm
    ranges: dict[str, Bounds]

    def __post_init__(self) -> None:
        # 16 corners: a search takes 16 times as long
        most_ranges = 4
        count = len(self.ranges)
        require(
            count <= most_ranges,
            "range",
            count,
            f"at most {most_ranges} ranges, which have {2**most_ranges} corners",
        )
        for key, ends in self.ranges.items():
            is_range = -math.inf < ends[0] < ends[1] < math.inf
            require(is_range, f"range {key}", ends, "two finite numbers, the lower first, such as 0.1,0.5")
        _ = self.corners

    @property
    def corners(self) -> list[NamedArm]:
        """The arms at both ends of every range."""
        corners = itertools.product((0.0, 1.0), repeat=len(self.ranges))
        return [self.at(np.array(shares)) for shares in corners]

    def at(self, shares: Real) -> NamedArm:
        """Return the arm at these shares (n,) of the ranges, 0 to 1; of logarithms where the ends are far apart."""
        arm = self.arm
        numbers = {}
        for (key, (low, high)), share in zip(self.ranges.items(), shares.tolist(), strict=True):
            value = low + share * (high - low)
            # a range of numbers of one sign whose ends are further apart is one of logarithms
            if low > 0 and high > 10.0 * low:
                value = low * (high / low) ** share
            if share in (0.0, 1.0):
                value = high if share else low
            numbers[key] = float(value)
            arm = vary_arm(arm, key, numbers[key])
        values = ", ".join(f"{key} = {value:.6g}" for key, value in numbers.items())
        return NamedArm(f"{self.arm.name}, {values}", arm, numbers)

    def worst(self, badness: Callable[[Arm], float]) -> tuple[NamedArm, float, int]:
        """Return the worst arm found inside, its badness, and the number of arms tried.

        Arms at random, then smaller and smaller steps along each number from the worst of them.  No proof that none is
        worse.
        """
        tried = 0
        size = len(self.ranges)

        def worst_of(places: Sequence[Real]) -> tuple[float, Real]:
            nonlocal tried
            tried += len(places)
            scores = [badness(self.at(each).arm) for each in places]
            n = int(np.argmax(scores))
            return scores[n], places[n]

        worst, place = worst_of([*np.random.default_rng(0).random((ARMS_TRIED, size))])
        ways = np.concatenate([np.eye(size), -np.eye(size)])
        # from the worst of them on, along each of the numbers
        for step in (0.25, 0.125, 0.0625):
            if math.isinf(worst):
                break
            worse, other = worst_of([*np.clip(place + step * ways, 0.0, 1.0)])
            if worse > worst:
                worst = worse
                place = other
        return self.at(place), worst, tried

    def case(self, tried: int, worse: str | None) -> "WorstCase":
        """Return the choice of the arms."""
        return WorstCase(self.ranges, tried, worse)


@frozen
class DrawnArms:
    """Arms of an ensemble: a `pool`, of which the worst are found for a law, and `fresh` ones, which examine it.

    Of arms that are independent draws (`is_independent`) the fresh ones are, whatever the law.
    """

    source: str
    pool: tuple[NamedArm, ...]
    fresh: tuple[NamedArm, ...]
    is_independent: bool

    def worst(self, badness: Callable[[Arm], float]) -> tuple[NamedArm, float, int]:
        """Return the worst arm of the pool, its badness, and the number of arms tried."""
        scores = [badness(each.arm) for each in self.pool]
        n = int(np.argmax(scores))
        return self.pool[n], scores[n], len(scores)

    def case(self, tried: int, worse: str | None) -> "WorstCase":
        """Return the choice of the arms."""
        return WorstCase({}, tried, worse, len(self.pool), self.source)


def arms_of(arm: Arm, also: Sequence[Arm], box: ArmBox | None) -> list[NamedArm]:
    """Return the arm, those of the list, and the corners of the box.

    Raises ParameterError for too many in the list.
    """
    # of a list, for the same reason
    most_arms = 8
    require(len(also) <= most_arms, "also", len(also), f"at most {most_arms} further arms")
    named = [NamedArm(each.name, each, {}) for each in (arm, *also)]
    if box is None:
        return named
    return named + [each for each in box.corners if each.arm != arm]


class WorstCase(NamedTuple):
    """Choice of the arms of a design: the `ranges` of the box, and the number of arms `tried` inside it.

    `worse` names an arm inside on which the law is still worse, where the exchange ended before there was none.
    Of an ensemble there are no ranges, but `drawn` arms of a `source`.
    """

    ranges: dict[str, Bounds]
    tried: int
    worse: str | None = None
    drawn: int = 0
    source: str = ""

    def sentence(self, number: int) -> str:
        """Return the choice in a sentence, with its limits."""
        ended = "none that is worse"
        if self.worse is not None:
            ended = f"still a worse one, {self.worse}"
        if self.drawn:
            return (
                f"the worst of {number} arms; a search among {self.drawn} arms of {self.source} found {ended}"
            )
        if number == 1:
            return ""
        if not self.ranges:
            return f"the worst of {number} arms"
        box = ", ".join(f"{key} {low:g} to {high:g}" for key, (low, high) in self.ranges.items())
        return (
            f"the worst of {number} arms, the corners of the box {box} among them; a search of {self.tried} arms "
            f"inside it found {ended}: no proof over the box"
        )


def for_the_worst(
    arms: Sequence[NamedArm],
    region: ArmBox | DrawnArms | None,
    find: Callable[[Sequence[NamedArm], _Robust | None, Effort], _Robust],
    score_on: Callable[[_Robust, Arm], float],
    tell: Tell,
) -> tuple[_Robust, list[NamedArm], WorstCase]:
    """Return the result of `find` for the arms and for worse ones of a region, with all of these arms.

    The first worse arms are those of sketches, so that the whole search already has them.  `find` is given the arms,
    what it found before, near which it may begin, and its effort.
    `score_on` is the score of one arm, inf where the law is unstable.  Raises ConvergenceError where no law is found
    that is stable on all arms, or where it stays unstable on one of the region.
    """
    # of a score: an arm inside is added if it is worse by more
    much_worse = 0.01
    named = list(arms)
    if region is None:
        return find(named, None, "whole"), named, WorstCase({}, 0)
    efforts: list[Effort] = ["sketch", "sketch", "whole", *("near",) * 4]
    tried = 0
    found = None
    while True:
        effort = efforts.pop(0)
        found = find(named, found, effort)
        limit = max(score_on(found, each.arm) for each in named)
        worst, score, number = region.worst(partial(score_on, found))
        tried += number
        is_worse = score > limit + much_worse * abs(limit)
        if effort != "sketch" and not is_worse:
            return found, named, region.case(tried, None)
        if not efforts and math.isinf(score):
            raise ConvergenceError(f"no law found is stable on {worst.name}: narrow the ranges", None, None)
        if not efforts:
            return found, named, region.case(tried, worst.name)
        if is_worse:
            tell(f"{worst.name} is worse than the other {len(named)} arms, and added")
            named.append(worst)
        elif efforts[0] == "sketch":
            efforts.pop(0)


def same_input(arms: Sequence[NamedArm]) -> None:
    """Raise ParameterError for arms with different inputs."""
    first, *others = arms
    for each in others:
        remedy = (
            f"the input of {each.name} is {each.arm.input}, that of {first.name} {first.arm.input}: "
            "one law has one"
        )
        require(each.arm.input == first.arm.input, "also", each.name, remedy)
