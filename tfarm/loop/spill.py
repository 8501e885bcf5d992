"""Spillover: stability of a law on reduced models of more and more modes, compared with the exact rig.

A law is designed on a model of a few modes, and may destabilise a mode of the rig that the model omits (Balas 1978).
The exact loop has all modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm, arm_and_law, as_law
from tfarm.arm.checks import whole
from tfarm.arrays import Complex
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.reduced.conversions import sensed_model
from tfarm.schema import Quantity
from tfarm.spectrum import modes

from .poles import poles_of_model
from .stability import Stability, stability

MOST_SPILL_MODES = 60  # modes of a model
USUAL_SPILL_MODES = 20  # of the largest model by default
REST_SHARE = 1e-7  # of w1: poles at 0 come out as small
UNDAMPED_SHARE = 1e-9  # of its size: largest real part of a pole that no model damps


FIRST_MODE = Quantity("lowest destabilised mode", help="of the exact loop; 0: a pole below the first mode")
SHOWN_FROM = Quantity(
    "design models unstable from", "modes", key="shown_from_modes", help="all models of at least so many modes are"
)


class SpillModel(NamedTuple):
    """A design model under the law: flexible modes, unstable poles, rightmost pole."""

    modes: Annotated[int, Quantity("modes", help="flexible modes of the design model")]
    unstable: Annotated[int, Quantity("unstable poles", help="of the design model under the controller")]
    rightmost: Annotated[complex, Quantity("rightmost pole", "1/s", help="apart from poles at 0")]


@dataclass(frozen=True)
@record
class Spill:
    """The verdict on the exact loop, and models of `modes` (n,) flexible modes: `unstable` (n,) and `rightmost` (n,).

    `rightmost` [1/s] is the rightmost pole of each, apart from those at 0.  `driven` [1/s] are the exact loop's
    unstable poles with Im >= 0.  `first_mode` is the flexible mode whose frequency is next to the lowest of those, 0
    where that is real or below half the first.  From `shown_from` modes on every model is unstable too; None where the
    last is not.
    """

    verdict: Annotated[Stability, Quantity(flat=True)]
    modes: NDArray[np.int64]
    unstable: NDArray[np.int64]
    rightmost: Complex

    @property
    def driven(self) -> Annotated[Complex, Quantity("s", "1/s", help="unstable poles of the exact loop")]:
        """The exact loop's unstable poles, ascending in Im s."""
        moving = self.verdict.poles.moving
        return moving[moving.real > UNDAMPED_SHARE * abs(moving)]

    @property
    def first_mode(self) -> Annotated[int | None, FIRST_MODE]:
        """The lowest destabilised mode; None where the exact loop is stable in its band."""
        if not self.driven.size:
            return None
        lowest = float(self.driven[0].imag)
        table = modes(self.verdict.loop.arm, up_to=2.0 * max(lowest, 1.0) + self.verdict.band)
        flexible = table.natural_frequency[table.index > 0]
        if lowest < flexible[0] / 2:
            return 0
        return int(np.argmin(abs(flexible - lowest))) + 1

    @property
    def shown_from(self) -> Annotated[int | None, SHOWN_FROM]:
        """Number of modes from which on the models are unstable too."""
        content = np.flatnonzero(self.unstable == 0)
        if content.size == 0:
            return int(self.modes[0])
        return None if content[-1] == self.modes.size - 1 else int(self.modes[content[-1] + 1])

    @property
    def models(self) -> Annotated[list[SpillModel], Quantity("design models", help="bare modes, without remainder")]:
        """One row for each model."""
        poles = (complex(s.real, abs(s.imag)) for s in self.rightmost)
        return list(map(SpillModel, self.modes.tolist(), self.unstable.tolist(), poles))

    @property
    def content(self) -> NDArray[np.int64]:
        """The numbers of modes of the models that are stable."""
        return self.modes[self.unstable == 0]

    @property
    def in_words(self) -> Annotated[str, Quantity("spillover", help="exact loop, compared with the design models")]:
        """The exact loop, and the models that are stable where it is not."""
        if not self.driven.size:
            where = "" if self.verdict.is_known_beyond else " in the frequency range"
            return f"none: the exact loop is {self.verdict.verdict}{where}"
        which = f"mode {self.first_mode}" if self.first_mode else "a pole below the first mode"
        words = f"{which} is unstable in the exact loop, at {abs(self.driven[0]):.6g} rad/s"
        if not self.content.size:
            return f"{words}, and every model is unstable"
        first, last = int(self.content[0]), int(self.content[-1])
        models = f"models of {first} to {last} modes"
        if first == last:
            models = f"the model of {first} mode{'s' * (first > 1)}"
        elif last - first + 1 != self.content.size:
            models = f"{self.content.size} of the models up to {last} modes"
        end = f"unstable from {self.shown_from} modes on" if self.shown_from else "the largest among them"
        verb = "is" if first == last else "are"
        return f"{words}; {models} {verb} stable, {end}"


def spill(arm: Arm, law: AnyLaw, most: int = USUAL_SPILL_MODES) -> Spill:
    """Return the verdict on the exact loop, and models of 1 to `most` flexible modes without their static remainder.

    Such models are used for design: bare modes.  A delay is in them as a Pade approximation.
    Raises ParameterError for an invalid law, where there is no loop, or none of finite order; ConvergenceError as
    `stability` does.
    """
    (arm, _), law = arm_and_law(arm, law), as_law(law)
    most = whole("modes", most, 1, MOST_SPILL_MODES, f"a whole number of modes, 1 to {MOST_SPILL_MODES}")
    if law.is_improper:
        remedy = "differentiates, and has no states; add a fast pole to den"
        raise ParameterError(key="law", value=law.name, remedy=remedy)
    verdict = stability(arm, law)
    loop, numbers, unstable, rightmost = verdict.loop, np.arange(1, most + 1), [], []
    slowest = REST_SHARE * float(modes(loop.arm, 1).natural_frequency[-1])
    for number in numbers.tolist():
        A, B, C, D = sensed_model(loop.arm, loop.law.signals, number)
        poles = poles_of_model(loop, (A, B, C, 0 * D))
        moving = poles[abs(poles) > slowest]
        unstable.append(int((moving.real > UNDAMPED_SHARE * abs(moving)).sum()))
        rightmost.append(moving[np.argmax(moving.real)])
    return Spill(verdict, numbers, np.array(unstable), np.array(rightmost))
