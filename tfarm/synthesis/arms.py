"""The arms that a law has to serve: a list of them, and a box over numbers of one.

Of a box the corners are taken, and arms inside that a search finds to be worse.  That is no proof over the box: between
the arms that are named nothing is certain.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.keys import KeyedArms
from tfarm.arm.records import ADJUSTABLE
from tfarm.arrays import Real
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.synthesis.search import Bounds

MOST_RANGES = 4  # 16 corners: a search takes so many times as long
MOST_ARMS = 8  # of a list, for the same reason
DECADE = 10.0  # a range of numbers of one sign whose ends are further apart is one of logarithms
ARMS_TRIED = 24  # arms at random inside the box
ARMS_SEED = 0  # of those
BOX_STEPS = (0.25, 0.125, 0.0625)  # of the box: from the worst of them on, along each of its numbers
DOTTED = {f"{room}.{field}": name for name, (room, field) in ADJUSTABLE.items()}


@dataclass(frozen=True)
@record
class NamedArm:
    """An arm, its name in the answer, and the `numbers` that a box gave it, by key."""

    name: str
    arm: Arm
    numbers: dict[str, float]


def varied(arm: Arm, key: str, value: float) -> Arm:
    """The arm with another value of one number, named as in its file ("payload.mass", "hub.friction") or as of a locus.

    Raises ParameterError for a key that it does not have, and for a value as its parts do.
    """
    name = DOTTED.get(key, key)
    if name in ADJUSTABLE:
        return arm.having(**{name: value})
    return KeyedArms(arm, (key,), "range").at({key: value})


@dataclass(frozen=True)
@record
class ArmBox:
    """The arms that have numbers of `ranges` (key: its ends), and all else of `arm`.

    Raises ParameterError for an unknown key, too many of them, ends that are not finite or in order, and corners that
    are no arm.
    """

    arm: Arm
    ranges: dict[str, Bounds]

    def __post_init__(self) -> None:
        if len(self.ranges) > MOST_RANGES:
            remedy = f"at most {MOST_RANGES} ranges, which have {2**MOST_RANGES} corners"
            raise ParameterError(key="range", value=len(self.ranges), remedy=remedy)
        for key, ends in self.ranges.items():
            low, high = ends
            if not -math.inf < low < high < math.inf:
                remedy = "two finite numbers, the lower first, such as 0.1,0.5"
                raise ParameterError(key=f"range {key}", value=ends, remedy=remedy)
        _ = self.corners

    @property
    def corners(self) -> list[NamedArm]:
        """The arms at both ends of every range."""
        return [self.at(np.array(shares)) for shares in itertools.product((0.0, 1.0), repeat=len(self.ranges))]

    def at(self, shares: Real) -> NamedArm:
        """The arm at these shares (n,) of the ranges, 0 to 1; of logarithms where the ends are far apart."""
        arm, numbers = self.arm, {}
        for (key, (low, high)), share in zip(self.ranges.items(), shares.tolist(), strict=True):
            far = low > 0 and high > DECADE * low
            inside = low * (high / low) ** share if far else low + share * (high - low)
            numbers[key] = low if share == 0 else high if share == 1 else float(inside)
            arm = varied(arm, key, numbers[key])
        told = ", ".join(f"{key} = {value:.6g}" for key, value in numbers.items())
        return NamedArm(f"{self.arm.name}, {told}", arm, numbers)


def worst_inside(box: ArmBox, badness: Callable[[Arm], float]) -> tuple[NamedArm, float, int]:
    """The worst arm found in a box, how bad it is, and how many were tried.

    Arms at random, then steps along each number from the worst of them, ever smaller.  No proof that none is worse.
    """
    tried, size = 0, len(box.ranges)

    def worst_of(places: Sequence[Real]) -> tuple[float, Real]:
        nonlocal tried
        tried += len(places)
        scores = [badness(box.at(each).arm) for each in places]
        n = int(np.argmax(scores))
        return scores[n], places[n]

    worst, place = worst_of(list(np.random.default_rng(ARMS_SEED).random((ARMS_TRIED, size))))
    for step in BOX_STEPS:
        if math.isinf(worst):
            break
        around = [np.clip(place + step * way, 0.0, 1.0) for way in (*np.eye(size), *-np.eye(size))]
        worst, place = max((worst, place), worst_of(around), key=lambda pair: pair[0])
    return box.at(place), worst, tried


def arms_of(arm: Arm, also: Sequence[Arm], box: ArmBox | None) -> list[NamedArm]:
    """The arm, those of the list, and the corners of the box.  Raises ParameterError for too many in the list."""
    if len(also) > MOST_ARMS:
        raise ParameterError(key="also", value=len(also), remedy=f"at most {MOST_ARMS} further arms")
    listed = [NamedArm(each.name, each, {}) for each in (arm, *also)]
    corners = [] if box is None else box.corners
    return [*listed, *(each for each in corners if each.arm != arm)]
