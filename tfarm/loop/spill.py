"""Spillover: what reduced models of ever more modes say of a law, beside the exact rig.

A law is designed on a model of a few modes; the modes left out are on the rig all the same, and the law may drive one
of them (Balas 1978).  The exact loop has them all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.checks import whole
from tfarm.arm.law import Law
from tfarm.columns import Column, Table
from tfarm.digits import general, plain, singly
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.reduced.sensed import closed, in_series, pade, sensed_model
from tfarm.spectrum import modes

from .answers import law_answer
from .law_loop import LawLoop
from .law_poles import PADE
from .law_stability import law_stability
from .stability import Stability

Complex = NDArray[np.complexfloating[Any, Any]]

MOST = 60  # modes of a model
USUAL = 20
AT_REST = 1e-7  # of w1: poles at 0 come out as small
ON_AXIS = 1e-9  # of its size: what a real part may be of a pole that no model damps


@dataclass(frozen=True)
@record
class Spill:
    """The verdict on the exact loop, and models of `modes` (n,) flexible modes: `unstable` (n,) and `rightmost` (n,).

    `rightmost` [1/s] is the pole of each furthest right, apart from those at 0.  `driven` [1/s] are the exact loop's
    unstable poles with Im >= 0, `first_mode` the flexible mode whose frequency is next to the lowest of those, 0 where
    that is real or slower than half the first; `shown_from` the number of modes from which on every model looked at is
    unstable too, None where the last is not.
    """

    verdict: Stability[LawLoop]
    modes: NDArray[np.int64]
    unstable: NDArray[np.int64]
    rightmost: Complex

    @property
    def driven(self) -> Complex:
        """The exact loop's unstable poles, ascending in Im s."""
        moving = self.verdict.poles.moving
        return moving[moving.real > ON_AXIS * abs(moving)]

    @property
    def first_mode(self) -> int | None:
        """The mode that spills over first, None where the exact loop is stable in its band."""
        if not self.driven.size:
            return None
        lowest = float(self.driven[0].imag)
        table = modes(self.verdict.loop.arm, up_to=2.0 * max(lowest, 1.0) + self.verdict.band)
        flexible = table.natural_frequency[table.index > 0]
        if lowest < flexible[0] / 2:
            return 0
        return int(np.argmin(abs(flexible - lowest))) + 1

    @property
    def shown_from(self) -> int | None:
        """From how many modes on the models are unstable too."""
        content = np.flatnonzero(self.unstable == 0)
        if content.size == 0:
            return int(self.modes[0])
        return None if content[-1] == self.modes.size - 1 else int(self.modes[content[-1] + 1])

    @property
    def content(self) -> NDArray[np.int64]:
        """The models that find nothing unstable."""
        return self.modes[self.unstable == 0]

    @property
    def in_words(self) -> str:
        """What a person should know, in a sentence or two."""
        exact = f"the exact rig is {self.verdict.verdict}"
        if not self.driven.size:
            return exact + (" up to the band" if not self.verdict.is_known_beyond else "")
        which = f"mode {self.first_mode}" if self.first_mode else "a pole below the first mode"
        words = f"{exact}: {which} is driven, at {abs(self.driven[0]):.6g} rad/s"
        if not self.content.size:
            return f"{words}; every model says so"
        last = (
            f"from {self.shown_from} modes on they show it" if self.shown_from else "none looked at shows it for good"
        )
        return f"{words}; models of {_listed(self.content)} find nothing unstable, {last}"


def _listed(numbers: NDArray[np.int64]) -> str:
    """So many modes: one number, a range or the ends of what has gaps."""
    first, last = int(numbers[0]), int(numbers[-1])
    if first == last:
        return f"{first} mode{'s' * (first > 1)}"
    return f"{first} to {last} modes" if last - first + 1 == numbers.size else f"{numbers.size} orders up to {last}"


def spill(arm: Arm, law: Law, most: int = USUAL) -> Spill:
    """The exact loop beside models of 1 to `most` flexible modes, their static remainder left out.

    The models are those that a law is designed on: bare modes.  A delay is in them as a Pade approximation.
    Raises ParameterError where there is no loop, or none of finite order; ConvergenceError as `law_stability` does.
    """
    most = whole("modes", most, 1, MOST, f"a whole number of modes, 1 to {MOST}")
    if law.is_improper:
        remedy = "differentiates, and has no states; add a fast pole to den"
        raise ParameterError(key="law", value=law.name, remedy=remedy)
    verdict = law_stability(arm, law)
    numbers = np.arange(1, most + 1)
    found = [_of_model(verdict.loop, int(number)) for number in numbers]
    unstable, rightmost = (np.array(each) for each in zip(*found, strict=True))
    return Spill(verdict, numbers, unstable, rightmost)


def _of_model(loop: LawLoop, count: int) -> tuple[int, complex]:
    """Unstable poles of a model of so many modes under the law, and the one furthest right."""
    A, B, C, D = sensed_model(loop.arm, loop.law.signals, count)
    law = loop.law.matrices()
    if loop.law.delay:
        law = in_series(law, pade(loop.law.delay, PADE).matrices())
    poles = np.linalg.eigvals(closed((A, B, C, 0 * D), law))
    slowest = AT_REST * float(modes(loop.arm, 1).natural_frequency[-1])
    moving = poles[abs(poles) > slowest]
    return int((moving.real > ON_AXIS * abs(moving)).sum()), complex(moving[np.argmax(moving.real)])


SPILL = (
    Column("modes", "modes", of=lambda it: it.modes.tolist()),
    Column("unstable", "unstable poles of the model", of=lambda it: it.unstable.tolist()),
    Column("re", "rightmost, Re", "1/s", of=lambda it: it.rightmost.real.tolist(), digits=singly(plain, 6),
           printed=singly(general, 6)),
    Column("im", "Im", "rad/s", of=lambda it: abs(it.rightmost.imag).tolist(), digits=singly(plain, 6),
           printed=singly(general, 6)),
)  # fmt: skip


def spill_answer(found: Spill) -> dict[str, Any]:
    """The verdict, what it means in words, and a row a model."""
    verdict = found.verdict
    return {
        "arm": verdict.loop.arm.name,
        **law_answer(verdict.loop.law, verdict.loop.arm),
        "verdict": verdict.verdict,
        "stable": verdict.is_stable,
        "in_words": found.in_words,
        "unstable_roots": verdict.unstable_roots,
        "unstable_roots_infinite": verdict.unstable_roots_infinite,
        "band_rad_s": verdict.band,
        "known_beyond_the_band": verdict.is_known_beyond,
        "beyond_the_band": verdict.tail,
        "driven": [[float(pole.real), float(pole.imag)] for pole in found.driven],
        "first_mode": found.first_mode,
        "shown_from_modes": found.shown_from,
        "models": Table(columns=SPILL, record=found),
    }
