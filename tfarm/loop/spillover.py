"""Spillover: the exact loop, compared with the models on which a law may have been designed.

A law is designed on a model of a few modes, and may destabilise a mode of the rig that the model omits (Balas 1978).
The verdict of the exact loop, which has all modes, is compared with those of ever larger models.
"""

import warnings
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.blocks import Matrices
from tfarm.arm.checks import whole
from tfarm.arrays import Complex
from tfarm.case import Case
from tfarm.errors import require
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.poles import poles_of_model
from tfarm.loop.stability import Stability, stability
from tfarm.records import frozen
from tfarm.reduced.modal import modal_model, sensed_model
from tfarm.schema import Quantity
from tfarm.spectrum import modes


class SpillModel(NamedTuple):
    """A design model under the law: flexible modes, unstable poles, rightmost pole."""

    modes: Annotated[int, Quantity("modes", help="flexible modes of the design model")]
    unstable: Annotated[int, Quantity("unstable poles", help="of the design model under the controller")]
    rightmost: Annotated[complex, Quantity("rightmost pole", "1/s", help="apart from poles at 0")]


@frozen
class Spill:
    """The verdict on the exact loop, and models of `modes` (n,) flexible modes: `unstable` (n,) and `rightmost` (n,).

    `rightmost` [1/s] is the rightmost pole of each, apart from those at 0.  `destabilised_poles` [1/s] are those of the
    exact loop with Im >= 0.  `first_mode` is the flexible mode whose frequency is next to the lowest of those, 0 where
    that is real or below half the first.  From `shown_from` modes on every model is unstable too; None where the last
    is not.
    """

    verdict: Annotated[Stability, Quantity(flat=True)]
    modes: NDArray[np.int64]
    unstable: NDArray[np.int64]
    rightmost: Complex

    @property
    def destabilised_poles(
        self,
    ) -> Annotated[Complex, Quantity("s", "1/s", key="driven", help="unstable poles of the exact loop")]:
        """The exact loop's unstable poles, ascending in Im s."""
        return _right_of_axis(self.verdict.poles.nonzero)

    @property
    def driven(self) -> Complex:
        """The unstable poles, by their name of version 1.1."""
        warnings.warn(
            "Spill.driven has moved: it is Spill.destabilised_poles", DeprecationWarning, stacklevel=2
        )
        return self.destabilised_poles

    @property
    def first_mode(
        self,
    ) -> Annotated[
        int | None,
        Quantity("lowest destabilised mode", help="of the exact loop; 0: a pole below the first mode"),
    ]:
        """The lowest destabilised mode; None where the exact loop is stable in its band."""
        if not self.destabilised_poles.size:
            return None
        lowest = float(self.destabilised_poles[0].imag)
        table = modes(self.verdict.loop.arm, up_to=2.0 * max(lowest, 1.0) + self.verdict.band)
        flexible = table.natural_frequency[table.index > 0]
        if lowest < flexible[0] / 2:
            return 0
        return int(np.argmin(abs(flexible - lowest))) + 1

    @property
    def shown_from(
        self,
    ) -> Annotated[
        int | None,
        Quantity(
            "design models unstable from (modes)", key="shown_from_modes", help="as are all larger ones"
        ),
    ]:
        """Number of modes from which on the models are unstable too."""
        beyond = self.modes[self.modes > self.content.max(initial=0)]
        return int(beyond[0]) if beyond.size else None

    @property
    def models(
        self,
    ) -> Annotated[list[SpillModel], Quantity("design models", help="bare modes, without remainder")]:
        """One row for each model."""
        poles = (complex(s.real, abs(s.imag)) for s in self.rightmost)
        return list(map(SpillModel, self.modes.tolist(), self.unstable.tolist(), poles))

    @property
    def content(self) -> NDArray[np.int64]:
        """The numbers of modes of the models that are stable."""
        return self.modes[self.unstable == 0]

    @property
    def in_words(
        self,
    ) -> Annotated[str, Quantity("spillover", help="exact loop, compared with the design models")]:
        """The exact loop, and the models that are stable where it is not."""
        if not self.destabilised_poles.size:
            where = "" if self.verdict.is_known_beyond else " in the frequency range"
            return f"none: the exact loop is {self.verdict.word}{where}"
        which = f"mode {self.first_mode}" if self.first_mode else "a pole below the first mode"
        words = f"{which} is unstable in the exact loop, at {abs(self.destabilised_poles[0]):.6g} rad/s"
        if not self.content.size:
            return f"{words}, and every model is unstable"
        count = self.content.size
        first = int(self.content[0])
        last = int(self.content[-1])
        if count == 1:
            models = f"the model of {first} mode{'s' * (first > 1)} is"
        elif last - first + 1 == count:
            models = f"models of {first} to {last} modes are"
        else:
            models = f"{count} of the models up to {last} modes are"
        if self.shown_from:
            end = f"those from {self.shown_from} modes on are not"
        else:
            end = "the largest among them"
        return f"{words}; {models} stable, {end}"


def spill(arm: Arm, law: AnyLaw, most: int = 20) -> Spill:
    """Return the verdict on the exact loop, and models of 1 to `most` flexible modes without their static remainder.

    Such models are used for design: bare modes.  A delay is in them as a Pade approximation.
    Raises ParameterError for an invalid law, where there is no loop, or none of finite order; ConvergenceError as
    `stability` does.
    """
    # modes of a model
    most_spill_modes = 60
    # of w1: poles at 0 come out as small
    rest_share = 1e-7
    case = Case(arm, law)
    most = whole("modes", most, 1, most_spill_modes, f"a whole number of modes, 1 to {most_spill_modes}")
    remedy = "differentiates, and has no states; add a fast pole to den"
    require(not case.law.is_improper, "law", case.law.name, remedy)
    verdict = stability(case)
    loop = verdict.loop
    unstable = []
    rightmost = []
    slowest = rest_share * float(modes(loop.arm, 1).natural_frequency[-1])
    for model in _bare_models(loop, most):
        poles = poles_of_model(loop, model)
        moving = poles[abs(poles) > slowest]
        unstable.append(_right_of_axis(moving).size)
        rightmost.append(moving[moving.real.argmax()])
    return Spill(verdict, np.arange(1, most + 1), np.array(unstable), np.array(rightmost))


def _right_of_axis(poles: Complex) -> Complex:
    """Return the poles right of the imaginary axis by more than 1e-9 of their size, as no model damps some."""
    return poles[poles.real > 1e-9 * abs(poles)]


def _bare_models(loop: ContinuousLoop, most: int) -> Iterator[Matrices]:
    """Yield models of 1 to `most` flexible modes without static remainder, each with the poles of its modes alone.

    They are cut from the largest.  A search of more modes of a strongly damped arm may leave poles without a mode,
    which no smaller model has: then each has a search of its own.
    """
    arm = loop.arm
    signals = loop.law.signals
    numbers = range(1, most + 1)
    first = modal_model(arm, "hub_angle", 1)
    last = modal_model(arm, "hub_angle", most)
    if last.index.tolist() != [*numbers] or last.single.size != first.single.size:
        for number in numbers:
            A, B, C, D = sensed_model(arm, signals, number)
            yield A, B, C, 0 * D
        return
    A, B, C, D = sensed_model(arm, signals, most)
    beyond = np.arange(len(A)) - last.rigid_states
    for number in numbers:
        kept = (beyond < 2 * number) | (beyond >= 2 * most)
        yield A[np.ix_(kept, kept)], B[kept], C[:, kept], 0 * D
